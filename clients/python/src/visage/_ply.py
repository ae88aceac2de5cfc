"""PLY files as the service writes them: binary, little endian; columns of vertices, triangles."""

from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

TYPES = {
    "char": "i1", "uchar": "u1", "short": "<i2", "ushort": "<u2", "int": "<i4", "uint": "<u4", "float": "<f4",
    "double": "<f8", "int8": "i1", "uint8": "u1", "int16": "<i2", "uint16": "<u2", "int32": "<i4", "uint32": "<u4",
    "float32": "<f4", "float64": "<f8",
}  # fmt: skip


@frozen(eq=False)
class Ply:
    """What a file holds."""

    vertices: NDArray[Any]
    faces: NDArray[Any] | None

    def _columns(self, names: list[str]) -> NDArray[Any] | None:
        if any(name not in (self.vertices.dtype.names or ()) for name in names):
            return None
        return np.stack([self.vertices[name] for name in names], axis=1)

    def xyz(self) -> NDArray[np.float64]:
        """The places of the vertices."""
        found = self._columns(["x", "y", "z"])
        if found is None:
            raise ValueError("the PLY file has no coordinates")
        return found.astype(np.float64)

    def normals(self) -> NDArray[np.float64] | None:
        """Their normals, if there are any."""
        found = self._columns(["nx", "ny", "nz"])
        return None if found is None else found.astype(np.float64)

    def colors(self) -> NDArray[np.uint8] | None:
        """Their colours, if there are any."""
        found = self._columns(["red", "green", "blue"])
        return None if found is None else found.astype(np.uint8)

    def triangles(self) -> NDArray[np.int64]:
        """The vertices of each triangle."""
        if self.faces is None:
            return np.empty((0, 3), dtype=np.int64)
        if np.any(self.faces["count"] != 3):
            raise ValueError("the PLY file has faces that are no triangles")
        corners: NDArray[np.int64] = self.faces["corners"].astype(np.int64)
        return corners


def read_ply(content: bytes) -> Ply:
    """Reads a file."""
    head, end, body = content.partition(b"end_header\n")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    if not end or not lines or lines[0] != ["ply"] or ["format", "binary_little_endian", "1.0"] not in lines:
        raise ValueError("this is no binary little-endian PLY file")
    tables: dict[str, tuple[int, list[Any]]] = {}
    columns: list[Any] = []
    for line in lines:
        match line:
            case ["element", name, count]:
                columns = []
                tables[name] = (int(count), columns)
            case ["property", "list", count, item, _]:
                columns += [("count", TYPES[count]), ("corners", TYPES[item], 3)]
            case ["property", kind, name]:
                columns.append((name, TYPES[kind]))
            case _:
                pass
    offset = 0
    read: dict[str, NDArray[Any]] = {}
    for name, (count_of, columns_of) in tables.items():
        kind_of = np.dtype(columns_of)
        read[name] = np.frombuffer(body, kind_of, count_of, offset)
        offset += count_of * kind_of.itemsize
    return Ply(read["vertex"], read.get("face"))
