"""The whole way against a live service."""

import asyncio
import json
import os
import uuid
from pathlib import Path

import numpy as np
import pytest

import visage
from visage._drive import Patience
from visage.core import models
from visage.core.api.scan_sets import delete_scan_set, get_scan_set


def hurry() -> Patience:
    return Patience(attempts=6, first_pause=0.01, longest_pause=0.05)


@pytest.fixture(scope="module")
def registration(tmp_path_factory: pytest.TempPathFactory) -> visage.Registration:
    scans = Path(os.environ["VISAGE_SCANS"])
    told: list[tuple[str, float]] = []
    result = visage.register(
        scans.glob("*.ply"),
        url=os.environ["VISAGE_SERVER"],
        poses=scans / "rough.json",
        unit="mm",
        name="head",
        label="face",
        progress=lambda what, done: told.append((what, done)),
    )
    shares = [done for _, done in told]
    assert shares == sorted(shares) and shares[-1] == 1.0, told
    assert any(what.startswith("sending ") for what, _ in told), told
    return result


def test_a_folder_becomes_poses_a_cloud_and_a_mesh(registration: visage.Registration, scans: Path) -> None:
    names = sorted(path.name for path in scans.glob("*.ply"))
    assert registration.quality == "good" and sorted(registration.poses) == names
    for pose in registration.poses.values():
        assert pose is not None and pose.shape == (4, 4)
        assert np.allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-6)
    cloud, mesh = registration.cloud, registration.mesh
    assert len(cloud) == registration.model.points and cloud.points.shape == (len(cloud), 3)
    assert cloud.normals is not None and np.allclose(np.linalg.norm(cloud.normals, axis=1), 1, atol=1e-3)
    assert mesh.triangles.shape[1] == 3 and mesh.triangles.max() < len(mesh.vertices)
    assert np.all(mesh.vertices.min(axis=0) > cloud.points.min(axis=0) - 5)
    assert registration.result["views"] and "head" in repr(registration)


def test_the_gallery_is_asked(client: visage.Client, registration: visage.Registration, tmp_path: Path) -> None:
    found = registration.model.id
    assert found in [match.model_id for match in client.matching("face", limit=100)]
    client.like(str(found))
    registration.cloud.save(tmp_path / "probe.ply")
    assert client.like(tmp_path / "probe.ply", unit="mm", limit=100)[0].model_id == found
    assert client.wait(registration.job.id).model.id == found


def test_surfaces_go_over_to_trimesh(registration: visage.Registration) -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = registration.mesh.to_trimesh()
    assert isinstance(mesh, trimesh.Trimesh) and len(mesh.faces) == len(registration.mesh.triangles)
    assert len(registration.cloud.to_trimesh().vertices) == len(registration.cloud)


def test_surfaces_go_over_to_open3d(registration: visage.Registration) -> None:
    pytest.importorskip("open3d")
    # what trimesh was given before stays ours
    registration.mesh.to_trimesh()
    assert len(registration.cloud.to_open3d().points) == len(registration.cloud)
    assert len(registration.mesh.to_open3d().triangles) == len(registration.mesh.triangles)


def test_what_may_not_wait_gets_the_same(scans: Path, registration: visage.Registration) -> None:
    async def register() -> visage.AsyncRegistration:
        poses = json.loads((scans / "rough.json").read_text())
        two = sorted(scans.glob("*.ply"))[:2]
        chosen = {path.name: poses[path.name] for path in two}
        async with visage.AsyncClient(os.environ["VISAGE_SERVER"]) as client:
            result = await client.register(two, poses=chosen, unit="mm", options={"threads": 1, "mesh": False})
            cloud = await result.cloud()
            assert len(cloud) == result.model.points
            assert await client.like(registration.model.id) is not None
            return result

    result = asyncio.run(register())
    assert len(result.poses) == 2 and result.job.options.threads == 1


def large_scan(path: Path, points: int = 900_000) -> bytes:
    grid = np.random.default_rng(7).uniform(-100, 100, (points, 3)).astype("<f4")
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {points}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    content = head.encode() + grid.tobytes()
    path.write_bytes(content)
    return content


def test_a_line_that_breaks_costs_only_what_was_under_way(breaking_line, client: visage.Client, tmp_path: Path) -> None:
    content = large_scan(tmp_path / "large.ply")
    told: list[float] = []
    with visage.Client(breaking_line.url, patience=hurry()) as broken:
        scan_set = broken.upload(tmp_path / "large.ply", progress=lambda _, done: told.append(done))
    assert breaking_line.breaks == 4
    # none began anew: what had arrived was not sent again
    assert told == sorted(told) and told[-1] > 0, told
    stored = get_scan_set.sync(scan_set.id, client=client.core)
    assert isinstance(stored, models.ScanSet)
    assert [(scan.bytes_, scan.points) for scan in stored.scans] == [(len(content), 900_000)]
    assert delete_scan_set.sync_detailed(scan_set.id, client=client.core).status_code == 204


def test_an_archive_goes_as_a_whole(client: visage.Client, scans: Path, tmp_path: Path) -> None:
    import zipfile

    with zipfile.ZipFile(tmp_path / "set.zip", "w") as archive:
        for path in sorted(scans.glob("*.ply"))[:2]:
            archive.write(path, path.name)
    scan_set = client.upload(tmp_path / "set.zip")
    assert (scan_set.name, len(scan_set.scans)) == ("set", 2)
    assert delete_scan_set.sync_detailed(scan_set.id, client=client.core).status_code == 204


def test_what_is_refused_says_why_and_what_to_do(client: visage.Client, scans: Path, tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_bytes(b"ply\nno scan")
    with pytest.raises(visage.Refused) as refused:
        client.register(tmp_path)
    assert (refused.value.code, refused.value.scan) == ("unreadable_scan", "a.ply") and refused.value.hint
    with pytest.raises(visage.Refused) as refused:
        client.register(next(scans.glob("*.ply")))
    assert refused.value.code == "too_few_scans"
    with pytest.raises(visage.Refused) as refused:
        client.wait(uuid.uuid4())
    assert refused.value.status == 404
    with pytest.raises(FileNotFoundError):
        client.register(tmp_path / "nowhere")


def test_a_service_that_is_not_there_is_said() -> None:
    with visage.Client("http://127.0.0.1:9", patience=hurry()) as client, pytest.raises(visage.NoConnection):
        client.info()
