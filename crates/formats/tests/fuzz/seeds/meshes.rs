//! PLY, OBJ, STL, OFF and VTK.

use visage_formats::{obj, off, ply, stl};

use super::{Seed, cloud, floats, mesh, rows};

fn xyz() -> String {
    rows(|p| format!("{} {} {}\n", p.x, p.y, p.z))
}

pub fn ply() -> Vec<Seed> {
    let head = |encoding: &str, before: &str, after: &str| {
        let xyz = "property float x\nproperty float y\nproperty float z\n";
        format!("ply\nformat {encoding} 1.0\n{before}element vertex 20\n{xyz}{after}end_header\n")
    };
    let text = |before: &str, after: &str, body: &str| head("ascii", before, after) + body;
    let channels = "property float red\nproperty float green\nproperty float blue\nproperty int64 time\n";
    let strips = "element tristrips 1\nproperty list int int vertex_indices\n";
    let grid = "element range_grid 4\nproperty list uchar int vertex_indices\n";
    let lists = "property list uchar float extra\nelement face 1\nproperty uchar flag\nproperty list uint8 short vertex_index\n";
    let big: Vec<u8> = floats().chunks(4).flat_map(|word| word.iter().rev().copied().collect::<Vec<u8>>()).collect();
    vec![
        Seed::plain("cloud.ply", ply::write_cloud(&cloud(), Some(&[0; 20]))),
        Seed::plain("mesh.ply", ply::write_mesh(&mesh())),
        Seed::plain("text.ply", text("", channels, &rows(|p| format!("{} {} {} 0.5 0.25 1 7\n", p.x, p.y, p.z)))),
        Seed::plain("strips.ply", text("", strips, &format!("{}9 0 1 2 3 -1 4 5 6 7\n", xyz()))),
        Seed::plain(
            "grid.ply",
            text("obj_info num_cols 2\nobj_info num_rows 2\n", grid, &format!("{}1 0\n0\n1 1\n0\n", xyz())),
        ),
        Seed::plain(
            "lists.ply",
            text("", lists, &(rows(|p| format!("{} {} {} 1 9.5\n", p.x, p.y, p.z)) + "7 4 0 1 2 3\n")),
        ),
        Seed::plain("free.ply", text("", "", &xyz().replace('\n', " "))),
        Seed::plain("big.ply", [head("binary_big_endian", "", "property float rgb\n").as_bytes(), &big].concat()),
    ]
}

pub fn obj() -> Vec<Seed> {
    let vertices = rows(|p| format!("v {} {} {} 0.1 0.2 0.3\n", p.x, p.y, p.z)) + &"vn 0 0 1\n".repeat(20);
    vec![
        Seed::plain("mesh.obj", format!("{vertices}vt 0 1\nf 1/1/1 2/1/2 3/1/3 4/1/4\nf -1 -2 -3\nf 1//1 2//2 5//5\n")),
        Seed::plain("cloud.obj", obj::write_cloud(&cloud())),
        Seed::plain(
            "lines.obj",
            format!(
                "# c\no a\n{}f 1 2 \\\n 3\ng b\nl 1 2\np 1\n",
                xyz().replace("\n", " 1\n").split_inclusive('\n').map(|row| format!("v {row}")).collect::<String>()
            ),
        ),
    ]
}

pub fn stl() -> Vec<Seed> {
    let mesh = mesh();
    let facet = |face: &[u32; 3]| {
        let corners = face.map(|vertex| mesh.vertices[vertex as usize]);
        let corners = corners.map(|p| format!("vertex {} {} {}\n", p.x, p.y, p.z));
        format!("facet normal 0 0 1\nouter loop\n{}endloop\nendfacet\n", corners.concat())
    };
    let text = format!("solid a b\n{}endsolid a b\n", mesh.faces.iter().map(facet).collect::<String>());
    let mut named = stl::write_mesh(&mesh);
    named[..6].copy_from_slice(b"solid ");
    vec![
        Seed::plain("text.stl", text.clone()),
        Seed::plain("two.stl", text.repeat(2).to_uppercase()),
        Seed::plain("binary.stl", stl::write_mesh(&mesh)),
        Seed::plain("named.stl", named),
    ]
}

pub fn off() -> Vec<Seed> {
    let polygons = format!("OFF # c\n20 2 0\n{}4 0 1 6 5 255 0 0\n3 7 8 9\n", xyz());
    vec![
        Seed::plain("mesh.off", off::write_mesh(&mesh())),
        Seed::plain("cloud.off", off::write_cloud(&cloud())),
        Seed::plain("polygons.off", polygons),
        Seed::plain(
            "colors.off",
            format!("COFF\n20 0 0\n{}", rows(|p| format!("{} {} {} 9 8 7 255\n", p.x, p.y, p.z))),
        ),
    ]
}

pub fn vtk() -> Vec<Seed> {
    let head = |version: &str, encoding: &str, rest: &str| {
        format!("# vtk DataFile Version {version}\nt\n{encoding}\nDATASET {rest}\n")
    };
    let scalars = "SCALARS intensity float 1\nLOOKUP_TABLE default\n0 1 2 3 4 5 6 7 8 9 0 1 2 3 4 5 6 7 8 9\n";
    let normals = format!("NORMALS n double\n{}", "0 0 1\n".repeat(20));
    let colors = format!("COLOR_SCALARS c 3\n{}", "1 0.5 0\n".repeat(20));
    let field =
        format!("FIELD f 2\nrgb 3 20 unsigned_char\n{}more 1 20 int\n{}\n", "1 2 3\n".repeat(20), "7 ".repeat(20));
    let poly = format!(
        "{}POINTS 20 float\n{}POLYGONS 2 8\n3 0 1 6\n3 0 6 5\nTRIANGLE_STRIPS 1 5\n4 7 8 9 10\nPOINT_DATA 20\n{scalars}{normals}{colors}{field}",
        head("3.0", "ASCII", "POLYDATA"),
        xyz()
    );
    let cells = format!(
        "{}POINTS 20 double\n{}CELLS 3 13\n3 0 1 6\n4 0 1 5 6\n3 7 8 9\nCELL_TYPES 3\n5\n8\n5\nCELL_DATA 3\nSCALARS q int 1\nLOOKUP_TABLE default\n1 2 3\n",
        head("4.2", "ASCII", "UNSTRUCTURED_GRID"),
        xyz()
    );
    let grid = format!("{}DIMENSIONS 5 4 1\nPOINTS 20 float\n{}", head("2.0", "ASCII", "STRUCTURED_GRID"), xyz());
    let word = |numbers: &[i64]| numbers.iter().flat_map(|number| number.to_be_bytes()).collect::<Vec<u8>>();
    let triples: Vec<u8> = floats()
        .chunks(16)
        .flat_map(|row| row[..12].chunks(4).flat_map(|word| word.iter().rev().copied()).collect::<Vec<u8>>())
        .collect();
    let poly_head = head("5.1", "BINARY", "POLYDATA\nPOINTS 20 float");
    let binary = [
        poly_head.as_bytes(),
        &triples,
        b"\nPOLYGONS 3 6\nOFFSETS vtktypeint64\n",
        &word(&[0, 3, 6]),
        b"\nCONNECTIVITY vtktypeint64\n",
        &word(&[0, 1, 6, 0, 6, 5]),
        b"\nPOINT_DATA 20\nCOLOR_SCALARS c 3\n",
        &[9; 60],
        b"\n",
    ];
    vec![
        Seed::plain("poly.vtk", poly),
        Seed::plain("cells.vtk", cells),
        Seed::plain("grid.vtk", grid),
        Seed::plain("binary.vtk", binary.concat()),
    ]
}
