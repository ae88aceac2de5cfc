"""Round trips of E57, LAS, LAZ, GLB, glTF and 3MF with the libraries that others use.

Each file is made by a library, converted by `convert IN OUT` (an example of visage-formats) and read again by a library, and the
other way round: coordinates are exact to the format's precision, colours exact, counts equal.

    pip install -r tests/roundtrip/requirements.txt
    cargo build -p visage-formats --example convert
    python tests/roundtrip/containers.py target/debug/examples/convert
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import laspy
import numpy as np
import pye57
import pygltflib
import trimesh
from plyfile import PlyData

CONVERT = Path(sys.argv[1]).resolve()
COUNT = 5000


def convert(source, target):
    run = subprocess.run([CONVERT, source, target], capture_output=True, text=True)
    assert run.returncode == 0, f"{source.name} to {target.name}: {run.stderr}"
    return target


def ply(path):
    """Points and, where there are any, colours and intensities of a PLY file."""
    vertex = PlyData.read(str(path))["vertex"].data
    columns = lambda names: np.stack([vertex[name] for name in names], axis=1)
    names = vertex.dtype.names
    colors = columns(["red", "green", "blue"]) if "red" in names else None
    return columns("xyz"), colors, vertex["intensity"] if "intensity" in names else None


def same(read, written, within=0.0):
    read, written = np.asarray(read), np.asarray(written)
    assert read.shape == written.shape, f"{read.shape} is not {written.shape}"
    off = np.abs(read.astype(float) - written.astype(float)).max()
    assert off <= within, f"off by {off}"


def points(offset=(0.0, 0.0, 0.0)):
    random = np.random.default_rng(1)
    # whole parts of 1024 are exact in every precision, with or without an offset
    return random.integers(-4096, 4096, (COUNT, 3)) / 1024 + np.array(offset)


def colors():
    return np.random.default_rng(2).integers(0, 256, (COUNT, 3)).astype(np.uint8)


UTM = (500_000.0, 4_500_000.0, 100.0)


def e57_of_pye57(folder):
    """Two scans with poses come as one cloud in the frame of the file."""
    path = folder / "scans.e57"
    file = pye57.E57(str(path), mode="w")
    rotation = trimesh.transformations.quaternion_about_axis(0.5, [0.1, 0.2, 0.9])
    expected = []
    for translation in [np.array(UTM), np.array(UTM) + 1]:
        xyz, rgb = points(), colors()
        data = {f"cartesian{axis}": xyz[:, k].copy() for k, axis in enumerate("XYZ")}
        data |= {f"color{name}": rgb[:, k].copy() for k, name in enumerate(["Red", "Green", "Blue"])}
        data["intensity"] = np.linspace(0, 1, COUNT).astype(np.float32)
        file.write_scan_raw(data, name="scan", rotation=rotation, translation=translation)
        matrix = trimesh.transformations.quaternion_matrix(rotation)
        expected.append(xyz @ matrix[:3, :3].T + translation)
    file.close()
    xyz, rgb, intensities = ply(convert(path, folder / "scans.ply"))
    # PLY keeps what is far away as doubles
    same(xyz, np.concatenate(expected), 1e-6)
    same(rgb, np.concatenate([colors(), colors()]))
    same(intensities[:COUNT], np.linspace(0, 1, COUNT).astype(np.float32))


def e57_for_pye57(folder):
    source = las_file(folder / "for_e57.las", 2)
    file = pye57.E57(str(convert(source, folder / "written.e57")))
    assert file.scan_count == 1
    data = file.read_scan(0, intensity=True, colors=True, ignore_missing_fields=True)
    same(np.stack([data[f"cartesian{axis}"] for axis in "XYZ"], axis=1), points(UTM), 1e-6)
    same(np.stack([data[f"color{name}"] for name in ["Red", "Green", "Blue"]], axis=1), colors())
    same(data["intensity"], np.arange(COUNT))


def las_file(path, point_format, factor=257):
    header = laspy.LasHeader(point_format=point_format, version="1.4")
    header.scales, header.offsets = [1 / 1024] * 3, UTM
    file = laspy.LasData(header)
    file.x, file.y, file.z = points(UTM).T
    file.intensity = np.arange(COUNT)
    if point_format in (2, 3, 5, 7, 8, 10):
        file.red, file.green, file.blue = colors().astype(np.uint16).T * factor
    file.write(str(path))
    return path


def las_of_laspy(folder):
    for ending in ["las", "laz"]:
        for point_format in [0, 1, 2, 3, 6, 7, 8]:
            for factor in [1, 256, 257]:
                path = las_file(folder / f"{point_format}_{factor}.{ending}", point_format, factor)
                xyz, rgb, intensities = ply(convert(path, path.with_suffix(".ply")))
                same(xyz, points(UTM))
                same(intensities, np.arange(COUNT))
                if rgb is not None:
                    same(rgb, colors())
                assert (rgb is not None) == (point_format in (2, 3, 7, 8))


def las_for_laspy(folder):
    source = las_file(folder / "for_las.laz", 7)
    file = laspy.read(str(convert(source, folder / "written.las")))
    same(file.xyz, points(UTM), 5e-5)
    same(np.stack([file.red, file.green, file.blue], axis=1), colors().astype(np.uint16) * 257)
    same(file.intensity, np.arange(COUNT))


def glb_of_trimesh(folder):
    cloud = trimesh.PointCloud(points(), colors=colors())
    mesh = trimesh.creation.icosphere(subdivisions=3)
    mesh.visual.vertex_colors = colors()[: len(mesh.vertices)]
    scene = trimesh.Scene()
    moved = trimesh.transformations.translation_matrix([10, 20, 30])
    scene.add_geometry(mesh, transform=moved)
    for ending in ["glb", "gltf"]:
        path = folder / f"cloud.{ending}"
        if ending == "glb":
            cloud.export(path)
            xyz, rgb, _ = ply(convert(path, folder / "cloud.ply"))
            same(xyz, points())
            same(rgb, colors())
    scene.export(folder / "scene.glb")
    target = convert(folder / "scene.glb", folder / "scene.ply")
    read = trimesh.load(target, process=False)
    same(read.vertices, mesh.vertices + [10, 20, 30], 1e-5)
    same(read.faces, mesh.faces)


def mesh_of_3mf(folder):
    mesh = trimesh.creation.icosphere(subdivisions=3)
    mesh.export(folder / "ball.3mf")
    read = trimesh.load(convert(folder / "ball.3mf", folder / "ball_3mf.ply"), process=False)
    same(read.vertices, mesh.vertices, 1e-6)
    same(read.faces, mesh.faces)


def glb_for_others(folder):
    mesh = trimesh.creation.icosphere(subdivisions=3)
    mesh.export(folder / "ball.ply")
    target = convert(folder / "ball.ply", folder / "ball.glb")
    document = pygltflib.GLTF2().load(str(target))
    assert document.accessors[0].count == len(mesh.vertices)
    read = trimesh.load(target, process=False, force="mesh")
    same(read.vertices, mesh.vertices, 1e-6)
    same(read.faces, mesh.faces)
    source = las_file(folder / "for_glb.las", 2)
    read = trimesh.load(convert(source, folder / "cloud_written.glb"), process=False)
    cloud = next(iter(read.geometry.values()))
    same(cloud.colors[:, :3], colors())


def textured_glb(folder):
    """A texture gives colours to the vertices."""
    from PIL import Image

    pixels = np.random.default_rng(3).integers(0, 256, (4, 4, 3)).astype(np.uint8)
    corners = [(x, y) for y in range(4) for x in range(4)]
    vertices = np.array([[x, y, 0] for x, y in corners], float)
    uv = np.array([[(x + 0.5) / 4, 1 - (y + 0.5) / 4] for x, y in corners])
    faces = [[4 * y + x, 4 * y + x + 1, 4 * y + x + 4] for y in range(3) for x in range(3)] + [[15, 14, 11]]
    # without a factor of its own
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(pixels))
    visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    trimesh.Trimesh(vertices, faces, visual=visual, process=False).export(folder / "picture.glb")
    convert(folder / "picture.glb", folder / "picture.e57")
    data = pye57.E57(str(folder / "picture.e57")).read_scan(0, colors=True, ignore_missing_fields=True)
    read = {(round(x), round(y)): rgb for x, y, *rgb in zip(*(data[f"cartesian{a}"] for a in "XY"), *(data[f"color{c}"] for c in ["Red", "Green", "Blue"]))}
    for x, y in corners:
        same(read[(x, y)], pixels[y, x])


def main():
    checks = [e57_of_pye57, e57_for_pye57, las_of_laspy, las_for_laspy, glb_of_trimesh, mesh_of_3mf, glb_for_others, textured_glb]
    failed = 0
    for check in checks:
        with tempfile.TemporaryDirectory() as folder:
            try:
                check(Path(folder))
                print(f"ok {check.__name__}")
            except AssertionError as error:
                failed += 1
                print(f"FAILED {check.__name__}: {error}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
