"""The client of those who may not wait; `_client` says what each call does."""

import uuid
from collections.abc import Mapping
from os import PathLike
from types import TracebackType
from typing import Any, Self, TypeVar

from . import _jobs
from ._drive import Core, Patience, run_async
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


class AsyncClient:
    """As `Client`, with calls to be awaited."""

    def __init__(
        self, url: str | None = None, *, key: str | None = None, patience: Patience | None = None, verify: str | bool = True
    ):
        self.core: Core = core(url, key, verify)
        self._patience = patience or Patience()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Ends the connections."""
        await self.core.get_async_httpx_client().aclose()

    async def run(self, steps: Steps[T]) -> T:
        """Makes calls one after the other."""
        return await run_async(self.core, self._patience, steps)

    async def info(self) -> models.Info:
        """As `Client.info`."""
        return await self.run(ask(info, models.Info))

    async def upload(
        self,
        scans: Paths,
        *,
        poses: Poses | None = None,
        unit: str | None = None,
        name: str | None = None,
        progress: Progress | None = None,
    ) -> models.ScanSet:
        """As `Client.upload`."""
        found = parcel(scans, (await self.info()).file_formats)
        return await self.run(store(found, name, unit, poses, progress or silent))

    async def register(
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
    ) -> "AsyncRegistration":
        """As `Client.register`."""
        steps = _jobs.registered(scans, poses, unit, name, label, options, hints, progress or silent)
        return AsyncRegistration(self, await self.run(steps))

    async def wait(self, job: str | uuid.UUID, *, progress: Progress | None = None) -> "AsyncRegistration":
        """As `Client.wait`."""
        found = await self.run(ask(get_job, models.Job, id=uuid.UUID(str(job))))
        return AsyncRegistration(self, await self.run(_jobs.ended(found, progress)))

    async def like(
        self, to: str | PathLike[str] | uuid.UUID, *, limit: int = 20, unit: str | None = None
    ) -> list[models.Match]:
        """As `Client.like`."""
        return await self.run(_jobs.alike(to, limit, unit))

    async def matching(
        self, standard: str = "face", *, limit: int = 20, only_matches: bool = True
    ) -> list[models.Match]:
        """As `Client.matching`."""
        return await self.run(_jobs.of_standard(standard, limit, only_matches))


class AsyncRegistration(Registered):
    """A registered model, and how it came about."""

    def __init__(self, client: AsyncClient, outcome: Outcome):
        super().__init__(outcome)
        self._client = client

    async def cloud(self) -> PointCloud:
        """The points of all placed scans."""
        return PointCloud.of(await self._client.run(_jobs.surface(self.model.id, "cloud.ply")))

    async def mesh(self) -> Mesh:
        """The surface."""
        return Mesh.of(await self._client.run(_jobs.surface(self.model.id, "mesh.ply")))
