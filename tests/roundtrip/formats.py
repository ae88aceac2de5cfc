"""Round trips of text and simple binary formats with Open3D, MeshLab, trimesh and NumPy, both ways.

    pip install -r tests/roundtrip/requirements.txt
    cargo build -p visage-formats --example convert
    python tests/roundtrip/formats.py target/debug/examples/convert

Files of each writer are read by `convert` and compared as PLY; files that
`convert` writes are read by each reader. Coordinates must agree to the format's precision, colours and counts exactly.
"""

import gzip
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import open3d as o3d
import plyfile
import pymeshlab
import trimesh

CONVERT = pathlib.Path(sys.argv[1]).resolve()
FOLDER = pathlib.Path(tempfile.mkdtemp())
# digits of a file of text; files of four bytes round to 6e-8 of the size
NEAR = 1e-5

random = np.random.default_rng(7)
POINTS = random.uniform(-3, 5, (500, 3)).astype(np.float32).astype(np.float64)
NORMALS = random.normal(size=(500, 3))
NORMALS /= np.linalg.norm(NORMALS, axis=1, keepdims=True)
COLORS = random.integers(0, 256, (500, 3))
SPHERE = trimesh.creation.icosphere(subdivisions=2)

failures = []
passed = 0


def check(name, holds, detail=""):
    global passed
    if holds:
        passed += 1
    else:
        failures.append(name)
        print(f"FAILED {name} {detail}")


def convert(name, out, *options):
    run = subprocess.run([CONVERT, FOLDER / name, FOLDER / out, *options], capture_output=True, text=True)
    if run.returncode != 0:
        check(f"{name} to {out}", False, run.stderr.strip())
        return False
    return True


def compare(name, points, normals=None, colors=None, faces=None):
    """Holds arrays read of a file against the truth, as far as the file has them."""
    check(f"{name}: points", points.shape == POINTS.shape and np.abs(points - POINTS).max() < NEAR)
    if normals is not None:
        check(f"{name}: normals", normals.shape == NORMALS.shape and np.abs(normals - NORMALS).max() < NEAR)
    if colors is not None:
        check(f"{name}: colours", np.array_equal(np.asarray(colors), COLORS))


def of_ply(name):
    ply = plyfile.PlyData.read(FOLDER / name)
    rows = ply["vertex"].data
    stack = lambda names: np.stack([rows[k].astype(float) for k in names], 1) if names[0] in rows.dtype.names else None
    faces = len(ply["face"].data) if "face" in ply else 0
    return stack("xyz"), stack(["nx", "ny", "nz"]), stack(["red", "green", "blue"]), faces


def theirs(name, normals, colors):
    """A file of another writer, read by ours."""
    if not convert(name, "out.ply"):
        return
    points, found_normals, found_colors, _ = of_ply("out.ply")
    check(f"{name}: has normals", (found_normals is not None) == normals)
    check(f"{name}: has colours", (found_colors is not None) == colors)
    compare(name, points, found_normals if normals else None, found_colors if colors else None)


def same_corners(corners, expected, name):
    """Holds triangles, by the places of their corners, against the truth: vertices may have another order."""
    order = lambda corners: corners[np.lexsort(np.round(corners.reshape(-1, 9), 4).T)]
    corners, expected = np.asarray(corners, float), np.asarray(expected, float)
    if corners.shape != expected.shape:
        check(f"{name}: triangles", False, f"{corners.shape} is not {expected.shape}")
        return
    off = np.abs(order(corners) - order(expected)).max()
    check(f"{name}: triangles", off < NEAR, f"off by {off}")


def their_mesh(name):
    if convert(name, "out.ply"):
        ply = plyfile.PlyData.read(FOLDER / "out.ply")
        points, _, _, _ = of_ply("out.ply")
        check(f"{name}: vertices", len(points) == len(SPHERE.vertices), str(len(points)))
        faces = np.stack(list(ply["face"].data["vertex_indices"]))
        same_corners(points[faces], SPHERE.vertices[SPHERE.faces], name)


def clouds_of_open3d():
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS))
    cloud.normals = o3d.utility.Vector3dVector(NORMALS)
    cloud.colors = o3d.utility.Vector3dVector(COLORS / 255)
    write = lambda name, **options: o3d.io.write_point_cloud(str(FOLDER / name), cloud, **options)
    for name, options in [("b.pcd", {}), ("a.pcd", {"write_ascii": True}), ("c.pcd", {"compressed": True})]:
        write(name, **options)
        theirs(name, True, True)
    for name, options in [("b.ply", {}), ("a.ply", {"write_ascii": True})]:
        write(name, **options)
        theirs(name, True, True)
    for name, normals, colors in [("a.xyz", False, False), ("a.xyzn", True, False), ("a.xyzrgb", False, True)]:
        write(name)
        theirs(name, normals, colors)
    write("a.pts")
    theirs("a.pts", False, True)


def arrays_of_numpy():
    np.save(FOLDER / "f4.npy", POINTS.astype("<f4"))
    np.save(FOLDER / "f8.npy", np.asfortranarray(POINTS.astype(">f8")))
    theirs("f4.npy", False, False)
    theirs("f8.npy", False, False)
    np.save(FOLDER / "nine.npy", np.hstack([POINTS, NORMALS, COLORS]))
    theirs("nine.npy", True, True)
    rows = np.zeros(len(POINTS), [("x", "f8"), ("y", "f8"), ("z", "f8"), ("r", "u1"), ("g", "u1"), ("b", "u1"), ("id", "i4")])
    for k, name in enumerate("xyz"):
        rows[name] = POINTS[:, k]
    for k, name in enumerate("rgb"):
        rows[name] = COLORS[:, k]
    np.save(FOLDER / "rows.npy", rows)
    theirs("rows.npy", False, True)
    for save in [np.savez, np.savez_compressed]:
        save(FOLDER / "a.npz", points=POINTS, normals=NORMALS, colors=COLORS.astype("u1"))
        theirs("a.npz", True, True)
    np.savetxt(FOLDER / "a.csv", np.hstack([POINTS, COLORS]), delimiter=",", header="x,y,z,r,g,b", comments="")
    theirs("a.csv", False, True)
    np.savetxt(FOLDER / "a.txt", np.hstack([POINTS, NORMALS]))
    theirs("a.txt", True, False)


def meshes():
    for name in ["t.off", "t.obj", "t.stl", "t.ply"]:
        SPHERE.export(FOLDER / name)
        their_mesh(name)
    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(SPHERE.vertices), o3d.utility.Vector3iVector(SPHERE.faces))
    mesh.compute_vertex_normals()
    for name in ["o.off", "o.obj", "o.stl", "o.ply"]:
        o3d.io.write_triangle_mesh(str(FOLDER / name), mesh)
        their_mesh(name)
    for ours, options in [("ours.off", ()), ("ours.obj", ()), ("ours.stl", ()), ("ours.ply", ()), ("text.ply", ("--ascii",))]:
        if convert("t.ply", ours, *options):
            path = str(FOLDER / ours)
            by_trimesh = trimesh.load(path, force="mesh")
            same_corners(by_trimesh.triangles, SPHERE.triangles, f"{ours} by trimesh")
            by_open3d = o3d.io.read_triangle_mesh(path)
            corners = np.asarray(by_open3d.vertices)[np.asarray(by_open3d.triangles)]
            same_corners(corners, SPHERE.triangles, f"{ours} by Open3D")
            by_meshlab = pymeshlab.MeshSet()
            by_meshlab.load_new_mesh(path)
            mesh = by_meshlab.current_mesh()
            same_corners(mesh.vertex_matrix()[mesh.face_matrix()], SPHERE.triangles, f"{ours} by MeshLab")


def files_of_meshlab():
    """What MeshLab writes, with colours and normals of vertices where the format has them."""
    colors = np.hstack([COLORS, np.full((len(COLORS), 1), 255)]) / 255
    cloud = pymeshlab.MeshSet()
    cloud.add_mesh(pymeshlab.Mesh(vertex_matrix=POINTS, v_normals_matrix=NORMALS, v_color_matrix=colors))
    with_colors = {"save_vertex_normal": True, "save_vertex_color": True}
    for name, options, normals, has_colors in [
        ("m.ply", {"binary": True} | with_colors, True, True),
        ("ma.ply", {"binary": False} | with_colors, True, True),
        ("m.obj", with_colors, True, True),
        ("m.off", with_colors, True, True),
        ("m.xyz", {"save_vertex_normal": True}, True, False),
    ]:
        cloud.save_current_mesh(str(FOLDER / name), **options)
        theirs(name, normals, has_colors)
    sphere = pymeshlab.MeshSet()
    sphere.add_mesh(pymeshlab.Mesh(vertex_matrix=SPHERE.vertices, face_matrix=SPHERE.faces))
    for name, options in [
        ("ms.ply", {"binary": True}),
        ("msa.ply", {"binary": False}),
        ("ms.obj", {}),
        ("ms.off", {}),
        ("ms.stl", {"binary": True}),
        ("msa.stl", {"binary": False}),
    ]:
        sphere.save_current_mesh(str(FOLDER / name), **options)
        their_mesh(name)


def ours():
    """Files that we write of a cloud, read by others."""
    source = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS))
    source.normals = o3d.utility.Vector3dVector(NORMALS)
    source.colors = o3d.utility.Vector3dVector(COLORS / 255)
    o3d.io.write_point_cloud(str(FOLDER / "source.ply"), source)
    text = ("--ascii",)
    for name, options in [("ours.ply", ()), ("ours.pcd", ()), ("text.ply", text)]:
        if convert("source.ply", name, *options):
            cloud = o3d.io.read_point_cloud(str(FOLDER / name))
            colors = np.round(np.asarray(cloud.colors) * 255).astype(int)
            compare(f"{name} by Open3D", np.asarray(cloud.points), np.asarray(cloud.normals), colors)
    if convert("source.ply", "text.ply", *text):
        check("text.ply is text", (FOLDER / "text.ply").read_bytes().startswith(b"ply\nformat ascii 1.0\n"))
        points, normals, colors, _ = of_ply("text.ply")
        compare("text.ply by plyfile", points, normals, colors)
        theirs("text.ply", True, True)
    for name, options in [("ours.ply", ()), ("ours.obj", ()), ("text.ply", text)]:
        if convert("source.ply", name, *options):
            by_meshlab = pymeshlab.MeshSet()
            by_meshlab.load_new_mesh(str(FOLDER / name))
            cloud = by_meshlab.current_mesh()
            colors = np.round(cloud.vertex_color_matrix()[:, :3] * 255).astype(int)
            # it takes normals of OBJ from faces only
            normals = cloud.vertex_normal_matrix() if name.endswith("ply") else None
            compare(f"{name} by MeshLab", cloud.vertex_matrix(), normals, colors)
    if convert("source.ply", "ours.xyz"):
        rows = np.loadtxt(FOLDER / "ours.xyz")
        compare("ours.xyz by NumPy", rows[:, :3], rows[:, 3:6], rows[:, 6:9].astype(int))
        compare("ours.xyz by Open3D", np.asarray(o3d.io.read_point_cloud(str(FOLDER / "ours.xyz")).points))
        theirs("ours.xyz", True, True)
    for ending in ["obj", "off"]:
        if convert("source.ply", f"ours.{ending}"):
            theirs(f"ours.{ending}", True, True)
    (FOLDER / "packed.ply.gz").write_bytes(gzip.compress((FOLDER / "source.ply").read_bytes()))
    theirs("packed.ply.gz", True, True)


clouds_of_open3d()
arrays_of_numpy()
meshes()
files_of_meshlab()
ours()
print(f"{passed} passed, {len(failures)} failed")
sys.exit(1 if failures else 0)
