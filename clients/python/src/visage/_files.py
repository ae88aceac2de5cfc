"""What of the files that are named goes to the service, and in which way."""

import re
import tempfile
import zipfile
from collections.abc import Iterable, Iterator
from os import PathLike
from pathlib import Path

from attrs import frozen

Paths = str | PathLike[str] | Iterable[str | PathLike[str]]

ARCHIVES = (".zip", ".tar", ".tar.gz", ".tgz")
SEVERAL = (".e57", ".ptx")
"""Files of these formats may hold several scans: the service takes them apart."""
LOOSE = (".asc", ".bin", ".csv", ".npy", ".npz", ".txt")
"""Files of these formats are scans only where there are no others."""


@frozen
class Parcel:
    """What is sent."""

    name: str
    """What people would call it."""
    scans: dict[str, Path]
    """Scans of which each is a file, by name."""
    whole: dict[str, Path]
    """Files that are understood together: they go as one form."""


def parcel(paths: Paths, formats: Iterable[str]) -> Parcel:
    """Looks at what is named: folders, files, or archives."""
    named = [Path(paths)] if isinstance(paths, (str, PathLike)) else [Path(path) for path in paths]
    if not named:
        raise ValueError("no scans are named")
    files = dict(sorted(_list(named), key=lambda item: _natural(item[0])))
    name = _stem(named[0])
    scans = _scans(files, formats)
    needs_others = [file for file in files if file.lower().endswith((*ARCHIVES, *SEVERAL, ".mtl"))]
    if scans and not needs_others:
        return Parcel(name, scans, {})
    if not files:
        raise FileNotFoundError(f"there are no files in {', '.join(map(str, named))}")
    return Parcel(name, {}, files)


def _list(named: list[Path]) -> Iterator[tuple[str, Path]]:
    seen: dict[str, Path] = {}
    for path in named:
        if path.is_dir():
            below = (file for file in path.rglob("*") if file.is_file())
            found = [(file.relative_to(path).as_posix(), file) for file in below]
        elif path.is_file():
            found = [(path.name, path)]
        else:
            raise FileNotFoundError(f"there is no {path}")
        for name, file in found:
            if any(part.startswith(".") for part in name.split("/")):
                continue
            if name in seen:
                raise ValueError(f"{seen[name]} and {file} have one name, {name}: rename one")
            seen[name] = file
            yield name, file


def _scans(files: dict[str, Path], formats: Iterable[str]) -> dict[str, Path]:
    endings = tuple(f".{ending}" for ending in formats)
    endings += tuple(f"{ending}.gz" for ending in endings)
    scans = {name: path for name, path in files.items() if name.lower().endswith(endings)}
    sure = {name: path for name, path in scans.items() if not name.lower().removesuffix(".gz").endswith(LOOSE)}
    return sure or scans


def _natural(name: str) -> list[tuple[int, int, str]]:
    """So that scan2 comes before scan10."""
    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.split(r"(\d+)", name)]


def _stem(path: Path) -> str:
    name = path.resolve().name
    for ending in ARCHIVES:
        if name.lower().endswith(ending):
            return name[: -len(ending)]
    return name if path.is_dir() else Path(name).stem


def zipped(files: dict[str, Path], place: Path) -> Path:
    """The files as one archive in a folder."""
    target = Path(tempfile.mkstemp(suffix=".zip", dir=place)[1])
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, path in files.items():
            archive.write(path, name)
    return target
