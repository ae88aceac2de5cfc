"""The client of those who may wait."""

import uuid
from collections.abc import Mapping
from functools import cached_property
from os import PathLike
from types import TracebackType
from typing import Any, Self, TypeVar

from . import _jobs
from ._drive import Core, Patience, run
from ._files import Paths, parcel
from ._jobs import Outcome, Registered
from ._progress import Progress, silent
from ._settings import core
from ._steps import Steps, ask
from ._surfaces import Mesh, PointCloud
from ._uploads import Poses, store
from .core import models
from .core.api.jobs import get_job
from .core.api.service import info

T = TypeVar("T")


class Client:
    """A service of visage.

    `url` is its address (VISAGE_SERVER or http://127.0.0.1:8080 if not given), `key` what it knows you by (VISAGE_KEY).
    `core` is the generated client, for every other call of the contract: `visage.core.api`.
    """

    def __init__(
        self, url: str | None = None, *, key: str | None = None, patience: Patience | None = None, verify: str | bool = True
    ):
        self.core: Core = core(url, key, verify)
        self._patience = patience or Patience()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Ends the connections."""
        self.core.get_httpx_client().close()

    def run(self, steps: Steps[T]) -> T:
        """Makes calls one after the other."""
        return run(self.core, self._patience, steps)

    def info(self) -> models.Info:
        """Limits, versions, formats and the options of jobs."""
        return self.run(ask(info, models.Info))

    def upload(
        self,
        scans: Paths,
        *,
        poses: Poses | None = None,
        unit: str | None = None,
        name: str | None = None,
        progress: Progress | None = None,
    ) -> models.ScanSet:
        """Stores scans as a set: a folder, files, or an archive. What was broken off goes on where it stood."""
        found = parcel(scans, self.info().file_formats)
        return self.run(store(found, name, unit, poses, progress or silent))

    def register(
        self,
        scans: Paths,
        *,
        poses: Poses | None = None,
        unit: str | None = None,
        name: str | None = None,
        label: str | None = None,
        options: Mapping[str, Any] | None = None,
        hints: str | PathLike[str] | Mapping[str, Any] | None = None,
        progress: Progress | None = None,
    ) -> "Registration":
        """Sends scans, waits until they are registered, and gives the result.

        `scans` is a folder, an archive, a file or several; `poses` where they start, a pose file of any format or matrices by
        name; `unit` that of the scans; `options` as `info().job_options` lists them; `progress` is told what is being done.
        """
        steps = _jobs.registered(scans, poses, unit, name, label, options, hints, progress or silent)
        return Registration(self, self.run(steps))

    def wait(self, job: str | uuid.UUID, *, progress: Progress | None = None) -> "Registration":
        """Waits for the end of a registration that was ordered before."""
        found = self.run(ask(get_job, models.Job, id=uuid.UUID(str(job))))
        return Registration(self, self.run(_jobs.ended(found, progress)))

    def like(self, to: str | PathLike[str] | uuid.UUID, *, limit: int = 20, unit: str | None = None) -> list[models.Match]:
        """Models that are like a stored one (its id), or like a mesh or cloud in a file; best first."""
        return self.run(_jobs.alike(to, limit, unit))

    def matching(self, standard: str = "face", *, limit: int = 20, only_matches: bool = True) -> list[models.Match]:
        """Models that are of a class: faces, or what a standard of your own says; best first."""
        return self.run(_jobs.of_standard(standard, limit, only_matches))


class Registration(Registered):
    """A registered model, and how it came about."""

    def __init__(self, client: Client, outcome: Outcome):
        super().__init__(outcome)
        self._client = client

    @cached_property
    def cloud(self) -> PointCloud:
        """The points of all placed scans."""
        return PointCloud.of(self._client.run(_jobs.surface(self.model.id, "cloud.ply")))

    @cached_property
    def mesh(self) -> Mesh:
        """The surface."""
        return Mesh.of(self._client.run(_jobs.surface(self.model.id, "mesh.ply")))
