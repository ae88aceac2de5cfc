"""Scans on their way to the service."""

import base64
import hashlib
import json
import tempfile
import uuid
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO, cast

from attrs import frozen

from ._errors import NoConnection, Refused
from ._files import ARCHIVES, Parcel, Paths, zipped
from ._progress import Progress
from ._steps import Call, Steps, ask, succeeded, tell
from .core import models
from .core.api.scan_sets import (
    create_scan_set,
    create_upload,
    get_upload,
    list_uploads,
    put_pose_file,
    put_poses,
    put_scan,
    send_piece,
    upload_scan_set,
)
from .core.types import File

Poses = str | PathLike[str] | Mapping[str, Any]
"""A pose file of any format, or 4x4 matrices (scan to world) by scan name."""

__all__ = ["Paths", "Poses", "store"]

LARGE = 4 << 20
"""Smaller files are sent whole: that is one request instead of several."""
PIECE = 8 << 20
"""What is in memory at a time."""
MOST_LOSSES = 5
"""So often a piece may be lost before the connection counts as lost for good."""


def store(parcel: Parcel, name: str | None, unit: str | None, poses: Poses | None, progress: Progress) -> Steps[models.ScanSet]:
    """Stores scans as a set."""
    title = name or parcel.name
    if parcel.whole:
        scan_set = yield from _store_whole(parcel, title, unit, progress)
    else:
        body = models.NewScanSetBody(name=title)
        if unit is not None:
            body.unit = models.Unit(unit)
        scan_set = yield from ask(create_scan_set, models.ScanSet, body=body, idempotency_key=str(uuid.uuid4()))
        yield from send_scans(scan_set.id, parcel.scans, progress)
    if poses is not None:
        yield from send_poses(scan_set.id, poses)
    return scan_set


def _store_whole(parcel: Parcel, title: str, unit: str | None, progress: Progress) -> Steps[models.ScanSet]:
    """What is understood together goes as one form, which is kept as a whole or not at all."""
    progress(f"sending {title}", 0.0)
    with tempfile.TemporaryDirectory() as place:
        files = parcel.whole
        archives = [file for file in files if file.lower().endswith(ARCHIVES)]
        if len(archives) < len(files) and len(files) > 1:
            files = {"scans.zip": zipped(files, Path(place))}
        opened = [(file, path.open("rb")) for file, path in files.items()]
        try:
            form = models.ScanSetForm(scans=[File(payload=file, file_name=name) for name, file in opened], name=title)
            if unit is not None:
                form.unit = models.Unit(unit)
            key = str(uuid.uuid4())
            return (yield from ask(upload_scan_set, models.ScanSet, body=form, idempotency_key=key))
        finally:
            for _, file in opened:
                file.close()


def send_poses(scan_set: uuid.UUID, poses: Poses) -> Steps[models.PosesView]:
    """Sets where the scans start."""
    if isinstance(poses, Mapping):
        plain = {name: None if pose is None else _rows(pose) for name, pose in poses.items()}
        body = models.Poses.from_dict(plain)
        return (yield from ask(put_poses, models.PosesView, id=scan_set, body=body))
    file = _file(Path(poses).read_bytes())
    return (yield from ask(put_pose_file, models.PosesView, id=scan_set, body=file))


def _rows(pose: Any) -> list[list[float]]:
    return [[float(value) for value in row] for row in pose]


@frozen
class _Scan:
    """A scan that is to be sent."""

    scan_set: uuid.UUID
    name: str
    path: Path
    bytes: int
    digest: str


def send_scans(scan_set: uuid.UUID, scans: dict[str, Path], progress: Progress) -> Steps[None]:
    """Sends scans one by one; large ones piece by piece, from where an earlier attempt has ended."""
    total = sum(path.stat().st_size for path in scans.values()) or 1
    before = 0
    for name, path in scans.items():
        scan = _Scan(scan_set, name, path, path.stat().st_size, _digest(path))
        if scan.bytes <= LARGE:
            progress(f"sending {name}", before / total)
            yield from ask(
                put_scan,
                models.ScanView,
                id=scan_set,
                name=name,
                body=_file(path.read_bytes()),
                content_digest=scan.digest,
            )
        else:
            start = before
            yield from _send_large(scan, lambda sent: progress(f"sending {name}", (start + sent) / total))
        before += scan.bytes


def _send_large(scan: _Scan, sent: Any) -> Steps[None]:
    upload = yield from _known(scan)
    losses, reached = 0, 0
    while True:
        try:
            if upload is None:
                upload = yield from _begin(scan)
            answer = yield from tell(get_upload, id=upload)
            offset = int(answer.headers["upload-offset"])
            while offset < scan.bytes:
                # as long as something arrives it goes on
                losses, reached = (0, offset) if offset > reached else (losses, reached)
                sent(offset)
                offset = yield from _send_piece(scan, upload, offset)
            return
        except NoConnection:
            losses += 1
            if losses >= MOST_LOSSES:
                raise
        except Refused as refused:
            losses += 1
            # given up meanwhile: begun anew; or an earlier attempt of our own was still under way
            upload = None if refused.status == 404 else upload
            may_pass = refused.status == 404 or refused.code in ("offset_mismatch", "request_in_progress")
            if losses >= MOST_LOSSES or not may_pass:
                raise


def _known(scan: _Scan) -> Steps[uuid.UUID | None]:
    """An upload of this very file that was broken off."""
    uploads = yield from ask(list_uploads, models.UploadList, id=scan.scan_set)
    for upload in uploads.items:
        if (upload.name, upload.bytes_, upload.digest) == (scan.name, scan.bytes, scan.digest):
            return upload.id
    return None


def _begin(scan: _Scan) -> Steps[uuid.UUID]:
    pairs = {"filename": scan.name, "digest": scan.digest}
    metadata = ",".join(f"{key} {base64.b64encode(value.encode()).decode()}" for key, value in pairs.items())
    upload = yield from ask(
        create_upload, models.Upload, id=scan.scan_set, upload_length=scan.bytes, upload_metadata=metadata
    )
    return upload.id


def _send_piece(scan: _Scan, upload: uuid.UUID, offset: int) -> Steps[int]:
    with scan.path.open("rb") as file:
        file.seek(offset)
        piece = file.read(PIECE)
    # without a checksum, what arrives of it before the connection breaks is kept; the digest of the whole guards it
    arguments = {"id": upload, "upload_offset": offset, "body": _file(piece)}
    # not sent again unasked: how much of it has arrived has to be known first
    answer = succeeded((yield Call(send_piece, arguments, is_repeatable=False)))
    return int(answer.headers["upload-offset"])


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").digest()
    return f"sha-256=:{base64.b64encode(digest).decode()}:"


def _file(content: bytes) -> File:
    """Bytes can be sent again, and where nothing may block; the generator wants a file."""
    return File(payload=cast(BinaryIO, content))


def hints_of(hints: str | PathLike[str] | Mapping[str, Any] | None) -> models.Hints | None:
    """What a person says of the scans: a JSON file, or its content."""
    if hints is None:
        return None
    content = hints if isinstance(hints, Mapping) else json.loads(Path(hints).read_text("utf-8"))
    return models.Hints.from_dict(content)
