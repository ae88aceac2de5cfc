"""Clouds and meshes as arrays."""

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from ._ply import read_ply

Floats = NDArray[np.float64]


def _module(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        raise ImportError(f"{name} is not installed: pip install 'visage-client[{name}]'") from error


@frozen(eq=False)
class PointCloud:
    """Points, and what else is known of each."""

    points: Floats
    """N x 3."""
    normals: Floats | None
    """N x 3, of length 1."""
    colors: NDArray[np.uint8] | None
    """N x 3."""
    content: bytes
    """The file, PLY."""

    @classmethod
    def of(cls, content: bytes) -> "PointCloud":
        """Of a PLY file."""
        ply = read_ply(content)
        return cls(ply.xyz(), ply.normals(), ply.colors(), content)

    def __len__(self) -> int:
        return len(self.points)

    def save(self, path: str | Path) -> None:
        """Writes the file as the service has it."""
        Path(path).write_bytes(self.content)

    def to_open3d(self) -> Any:
        """An `open3d.geometry.PointCloud`."""
        open3d = _module("open3d")
        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(self.points))
        if self.normals is not None:
            cloud.normals = open3d.utility.Vector3dVector(self.normals)
        if self.colors is not None:
            cloud.colors = open3d.utility.Vector3dVector(self.colors / 255.0)
        return cloud

    def to_trimesh(self) -> Any:
        """A `trimesh.PointCloud`."""
        return _module("trimesh").PointCloud(self.points.copy(), colors=self.colors)


@frozen(eq=False)
class Mesh:
    """Vertices and triangles."""

    vertices: Floats
    """N x 3."""
    triangles: NDArray[np.int64]
    """M x 3, indices of vertices."""
    normals: Floats | None
    """N x 3, of length 1."""
    colors: NDArray[np.uint8] | None
    """N x 3."""
    content: bytes
    """The file, PLY."""

    @classmethod
    def of(cls, content: bytes) -> "Mesh":
        """Of a PLY file."""
        ply = read_ply(content)
        return cls(ply.xyz(), ply.triangles(), ply.normals(), ply.colors(), content)

    def save(self, path: str | Path) -> None:
        """Writes the file as the service has it."""
        Path(path).write_bytes(self.content)

    def to_open3d(self) -> Any:
        """An `open3d.geometry.TriangleMesh`."""
        open3d = _module("open3d")
        triangles = open3d.utility.Vector3iVector(self.triangles.astype(np.int32))
        mesh = open3d.geometry.TriangleMesh(open3d.utility.Vector3dVector(self.vertices), triangles)
        if self.normals is not None:
            mesh.vertex_normals = open3d.utility.Vector3dVector(self.normals)
        if self.colors is not None:
            mesh.vertex_colors = open3d.utility.Vector3dVector(self.colors / 255.0)
        return mesh

    def to_trimesh(self) -> Any:
        """A `trimesh.Trimesh`."""
        # of its own: trimesh makes normals that it is given read-only, and they are everybody's here
        normals = None if self.normals is None else self.normals.copy()
        return _module("trimesh").Trimesh(
            self.vertices.copy(),
            self.triangles.copy(),
            vertex_normals=normals,
            vertex_colors=self.colors,
            process=False,
        )
