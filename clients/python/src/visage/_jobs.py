"""Registrations: ordered, waited for, and looked at when they have ended."""

import uuid
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any, cast

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from ._errors import NotRegistered
from ._files import Paths, parcel
from ._progress import Progress
from ._steps import Steps, ask
from ._uploads import Poses, hints_of, store
from .core import models
from .core.api.jobs import create_job, get_job
from .core.api.models import get_model, get_model_file, get_model_poses
from .core.api.queries import query, query_by_probe
from .core.api.service import info
from .core.types import File

WAIT_WITH_PROGRESS = 1
"""Seconds after which a job that has not ended is asked about again, if somebody wants to see how far it is."""
WAIT = 30

SENDING = 0.3
"""How much of all the sending of scans counts for."""

Pose = NDArray[np.float64]


@frozen
class Outcome:
    """What a registration has left."""

    job: models.Job
    model: models.Model
    poses: dict[str, Pose | None]


class Registered:
    """A registered model, and how it came about."""

    def __init__(self, outcome: Outcome):
        self.job = outcome.job
        """The job that made it."""
        self.model = outcome.model
        """The model as the service knows it."""
        self.poses = outcome.poses
        """For each scan the 4x4 motion that maps it into the world; `None` for one that could not be placed."""

    @property
    def quality(self) -> str:
        """`good`, `doubtful` or `failed`."""
        return str(self.model.quality)

    @property
    def result(self) -> dict[str, Any]:
        """All figures of the registration, as `report.json` has them: the same for the same scans."""
        report = self.model.report
        content = report.to_dict() if isinstance(report, models.ModelReportType0) else {}
        return cast(dict[str, Any], content.get("result", {}))

    def __repr__(self) -> str:
        placed = sum(pose is not None for pose in self.poses.values())
        return f"<{type(self).__name__} {self.model.name!r}: {self.quality}, {placed} of {len(self.poses)} scans placed>"


def registered(
    scans: Paths,
    poses: Poses | None,
    unit: str | None,
    name: str | None,
    label: str | None,
    options: Mapping[str, Any] | None,
    hints: str | PathLike[str] | Mapping[str, Any] | None,
    progress: Progress,
) -> Steps[Outcome]:
    """Scans to a registered model."""
    offered = yield from ask(info, models.Info)
    found = parcel(scans, offered.file_formats)
    told = hints_of(hints)
    wanted = None if options is None else models.JobOptions.from_dict(options)
    scan_set = yield from store(found, name, unit, poses, lambda what, done: progress(what, SENDING * done))
    body = models.NewJobBody(scan_set_id=scan_set.id)
    if wanted is not None:
        body.options = wanted
    if told is not None:
        body.hints = told
    if label is not None:
        body.label = label
    job = yield from ask(create_job, models.Job, body=body, idempotency_key=str(uuid.uuid4()))
    return (yield from ended(job, lambda what, done: progress(what, SENDING + (1 - SENDING) * done)))


def ended(job: models.Job, progress: Progress | None) -> Steps[Outcome]:
    """Waits for the end of a job."""
    job = yield from wait(job, progress)
    if job.status != models.JobStatus.SUCCEEDED or not isinstance(job.model_id, uuid.UUID):
        raise NotRegistered(job)
    return (yield from outcome(job))


def wait(job: models.Job, progress: Progress | None) -> Steps[models.Job]:
    """Asks until a job has ended: the service holds each question back until then, or for a while."""
    seconds = WAIT if progress is None else WAIT_WITH_PROGRESS
    while job.status in (models.JobStatus.QUEUED, models.JobStatus.RUNNING):
        if progress is not None:
            progress(job.stage if isinstance(job.stage, str) else "waiting", job.progress)
        job = yield from ask(get_job, models.Job, id=job.id, wait=seconds)
    if progress is not None:
        progress(str(job.status), 1.0)
    return job


def outcome(job: models.Job) -> Steps[Outcome]:
    """What a job that has succeeded has left."""
    model = yield from ask(get_model, models.Model, id=cast(uuid.UUID, job.model_id))
    found = yield from ask(get_model_poses, models.Poses, id=model.id)
    poses = {name: None if rows is None else np.array(rows, dtype=np.float64) for name, rows in found.to_dict().items()}
    return Outcome(job, model, poses)


def surface(model: uuid.UUID, file: str) -> Steps[bytes]:
    """A file of a model."""
    content = yield from ask(get_model_file, File, id=model, file=models.SurfaceFile(file))
    return content.payload.read()


def alike(to: str | PathLike[str] | uuid.UUID, limit: int, unit: str | None) -> Steps[list[models.Match]]:
    """What of the gallery is like a stored model, or a file."""
    known = to if isinstance(to, uuid.UUID) else _uuid(to)
    if known is not None:
        body = models.QueryBody(model_id=known, limit=limit)
        return (yield from ask(query, models.QueryAnswer, body=body)).matches
    path = Path(cast("str | PathLike[str]", to))
    with path.open("rb") as file:
        form = models.ProbeForm(probe=File(payload=file, file_name=path.name), limit=limit)
        if unit is not None:
            form.unit = models.Unit(unit)
        return (yield from ask(query_by_probe, models.QueryAnswer, body=form)).matches


def of_standard(standard: str, limit: int, only_matches: bool) -> Steps[list[models.Match]]:
    """What of the gallery is of a class."""
    body = models.QueryBody(standard=standard, limit=limit, only_matches=only_matches)
    return (yield from ask(query, models.QueryAnswer, body=body)).matches


def _uuid(text: str | PathLike[str]) -> uuid.UUID | None:
    try:
        return uuid.UUID(str(text))
    except ValueError:
        return None
