"""Makes `visage.core` of the service's contract before the package is built.

It is not kept in the repository: what is generated is never read, and one that is kept would have to be made anew by each
change of the contract. What is published holds it.
"""

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class MakeCore(BuildHookInterface[Any]):
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        root = Path(self.root)
        # beside this file in what is published, else in the repository
        contracts = [root / "openapi.yaml", root.parent.parent / "openapi.yaml"]
        contract = next((path for path in contracts if path.is_file()), None)
        if contract is None:
            raise FileNotFoundError("there is no openapi.yaml: build from the repository, or from what is published")
        core = root / "src" / "visage" / "core"
        shutil.rmtree(core, ignore_errors=True)
        command = [sys.executable, "-m", "openapi_python_client", "generate", "--meta", "none", "--fail-on-warning"]
        config = root / "openapi-python-client.yml"
        command += ["--path", str(contract), "--config", str(config), "--output-path", str(core)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
