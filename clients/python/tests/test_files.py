"""What goes to the service, and how its answers are read."""

from pathlib import Path

import numpy as np
import pytest

from visage._files import parcel
from visage._ply import read_ply

FORMATS = ["ply", "obj", "xyz", "txt", "e57"]


def folder(place: Path, *names: str) -> Path:
    for name in names:
        path = place / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    return place


def test_plain_scans_go_one_by_one_in_natural_order(tmp_path: Path) -> None:
    place = folder(tmp_path, "scan10.ply", "scan2.PLY", "back/a.obj.gz", "notes.txt", ".hidden.ply", "poses.json")
    found = parcel(place, FORMATS)
    assert list(found.scans) == ["back/a.obj.gz", "scan2.PLY", "scan10.ply"] and not found.whole
    assert found.name == tmp_path.name


def test_text_files_are_scans_where_there_are_no_others(tmp_path: Path) -> None:
    assert list(parcel(folder(tmp_path, "a.txt", "b.txt"), FORMATS).scans) == ["a.txt", "b.txt"]


@pytest.mark.parametrize("name", ["room.e57", "set.tar.gz", "painted.mtl", "depth/000.png"])
def test_what_is_understood_together_goes_as_a_whole(tmp_path: Path, name: str) -> None:
    place = folder(tmp_path, name) if name.endswith("png") else folder(tmp_path, name, "a.obj")
    assert name in parcel(place, FORMATS).whole


def test_files_of_one_name_are_refused(tmp_path: Path) -> None:
    folder(tmp_path, "a/x.ply", "b/x.ply")
    with pytest.raises(ValueError, match="one name, x.ply"):
        parcel([tmp_path / "a", tmp_path / "b"], FORMATS)
    with pytest.raises(FileNotFoundError):
        parcel(tmp_path / "nothing", FORMATS)
    with pytest.raises(ValueError):
        parcel([], FORMATS)


def test_a_mesh_is_read() -> None:
    head = "ply\nformat binary_little_endian 1.0\ncomment x\nelement vertex 3\nproperty float x\nproperty float y\n"
    head += "property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    vertex = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f8"), ("r", "u1"), ("g", "u1"), ("b", "u1")])
    vertices = np.array([(0, 0, 0, 1, 2, 3), (1, 0, 0, 4, 5, 6), (0, 1, 0.5, 7, 8, 9)], dtype=vertex)
    face = b"\x03" + np.array([0, 1, 2], "<i4").tobytes()
    ply = read_ply(head.encode() + vertices.tobytes() + face)
    assert ply.xyz().tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0.5]]
    assert ply.triangles().tolist() == [[0, 1, 2]] and ply.normals() is None
    colors = ply.colors()
    assert colors is not None and colors[2].tolist() == [7, 8, 9]


@pytest.mark.parametrize("content", [b"", b"ply\n", b"ply\nformat ascii 1.0\nend_header\n"])
def test_what_is_no_file_of_the_service_is_refused(content: bytes) -> None:
    with pytest.raises(ValueError):
        read_ply(content)
