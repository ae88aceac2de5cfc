use super::*;
use crate::Dropped;
use visage_geometry::{Cloud, Point3, RangeGrid, Surface};

fn read_text(text: &str) -> Result<Surface, FormatError> {
    read(text.as_bytes(), &ReadLimits::default()).map(|reading| reading.surface)
}

/// The message of a file of three vertices `body`, after `header` lines of further elements.
fn message(header: &str, body: &str) -> String {
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    let text = format!("ply\nformat ascii 1.0\nelement vertex 3\n{xyz}{header}end_header\n{body}");
    read_text(&text).expect_err(body).to_string()
}

#[test]
fn attributes_faces_and_unknown_elements_are_sorted_out() {
    let surface = read_text(
        "ply\nformat ascii 1.0\nelement camera 1\nproperty float view\nproperty list uchar int flags\n\
         element vertex 4\nproperty double x\nproperty float y\nproperty int z\nproperty float confidence\n\
         property float nx\nproperty float ny\nproperty float nz\nproperty float scalar_Intensity\n\
         property uchar diffuse_red\nproperty uchar diffuse_green\nproperty uchar diffuse_blue\n\
         element face 2\nproperty uchar material\nproperty list uchar int vertex_index\nend_header\n\
         0.5 2 7 8\n\
         0 0 0 0.5 0 0 2 0.25 1 2 3\n\n1 0 0 0.5 0 0 0 1 4 5 6\n1 1 0 0.5 0 1 0 1 0 0 0\n0 1 0 0.5 1 0 0 1 255 300 -1\n\
         9 4 0 1 2 3\n9 2 0 1\n",
    )
    .expect("all of this is sound");
    assert_eq!(surface.cloud.points[2], Point3::new(1.0, 1.0, 0.0));
    let normals = surface.cloud.normals.expect("nx ny nz");
    assert_eq!(normals[0], nalgebra::Vector3::z(), "normals are made unit vectors");
    assert_eq!(normals[1], nalgebra::Vector3::zeros(), "a zero normal stays unknown");
    assert_eq!(surface.cloud.colors.expect("diffuse colors")[3], [255, 255, 0]);
    assert_eq!(surface.cloud.intensities.expect("intensity")[..2], [0.25, 1.0]);
    assert_eq!(surface.faces, [[0, 1, 2], [0, 2, 3]], "a square makes two triangles, an edge none");
}

#[test]
fn confidence_is_no_intensity_and_two_thirds_of_a_normal_are_none() {
    let surface = read_text(
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
         property float confidence\nproperty float nx\nproperty float ny\nend_header\n1 2 3 4 5 6",
    )
    .expect("sound");
    assert_eq!(surface.cloud, Cloud::from_points(vec![Point3::new(1.0, 2.0, 3.0)]));
}

#[test]
fn float_colors_are_fractions() {
    let surface = read_text(
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
         property float red\nproperty float green\nproperty float blue\nend_header\n1 2 3 1 0.5 0\n",
    )
    .expect("sound");
    assert_eq!(surface.cloud.colors, Some(vec![[255, 128, 0]]));
}

#[test]
fn a_range_grid_is_kept() {
    let surface = read_text(
        "ply\nformat ascii 1.0\nobj_info num_cols 2\nobj_info num_rows 3\nbye\nelement vertex 2\nproperty float x\n\
         property float y\nproperty float z\nelement range_grid 6\nproperty list uchar int vertex_indices\n\
         end_header\n0 0 0\n1 1 1\n0 \n1 0 \n0 \n0 \n1 1\n0",
    )
    .expect("a scan of two points");
    let empty = RangeGrid::EMPTY;
    let pixels = vec![empty, 0, empty, empty, 1, empty];
    assert_eq!(surface.grid, Some(RangeGrid { columns: 2, rows: 3, pixels }));
}

/// What was dropped of the same file.
fn dropped(header: &str, body: &str) -> (Surface, Dropped) {
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    let text = format!("ply\nformat ascii 1.0\nelement vertex 3\n{xyz}{header}end_header\n{body}");
    let reading = read(text.as_bytes(), &ReadLimits::default()).expect(body);
    (reading.surface, reading.dropped)
}

#[test]
fn bad_rows_are_named_by_row_and_line() {
    let repair = "; repair the file or export it again";
    assert_eq!(
        message("", "0 0 0\n0 0 1e300\n1 1 1\n"),
        format!("vertex 1 (line 9): z is 1e300, which is too large to be a coordinate (they reach to 1e12){repair}")
    );
    assert_eq!(
        message("", "0 0 0\n0 0\n1 1 1 1\n"),
        format!("vertex 1 (line 9): the line has fewer numbers than the header declares{repair}")
    );
    assert_eq!(message("", "0 0 0\n0 0 x\n1 1 1\n"), format!("vertex 1 (line 9): \"x\" is no number{repair}"));
}

#[test]
fn rows_need_not_be_lines_if_all_are_alike() {
    let expected = [[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]].map(Point3::from);
    for body in ["0 0 0 1 2 3 4 5 6", "0 0\n0\n1 2\n3\n\n4 5\n6\n", "0\n0\n0\n1\n2\n3\n4\n5\n6", "0 0 0 1 2 3\n4 5 6\n"]
    {
        assert_eq!(dropped("", body).0.cloud.points, expected, "{body:?}");
    }
    let fewer = "the line has fewer numbers than the header declares";
    for body in ["0 0 0 1\n2 3 4\n5 6 7", "0 0\n0\n1\n2 3\n4 5\n6\n", "0 0\n0 1\n2 3\n4 5\n6\n"] {
        let message = message("", body);
        assert!(message.contains(fewer) || message.contains("more numbers than the header declares"), "{message}");
    }
    assert!(message("", "0 0 0 1 2 3 4 5 6 7").contains("more numbers"));
    let faces = "element face 2\nproperty list uchar int vertex_indices\n";
    assert_eq!(dropped(faces, "0 0\n0\n1 2\n3\n4 5\n6\n3 0 1 2\n3 2 1 0\n").0.faces, [[0, 1, 2], [2, 1, 0]]);
}

#[test]
fn what_is_not_sound_costs_itself_and_is_counted() {
    let (surface, found) = dropped("", "0 0 0\n0 nan 0\n1 1 -1.#INF\n");
    assert_eq!((surface.cloud.len(), found.no_return), (1, 2));
    let faces = "element face 2\nproperty list uchar int vertexIndices\n";
    let vertices = "0 0 0\n0 0 1\n1 1 1\n";
    for bad in ["3 0 1 3", "3 0 1 -1"] {
        let (surface, found) = dropped(faces, &format!("{vertices}{bad}\n3 0 1 2\n"));
        assert_eq!((surface.faces, found.faces), (vec![[0, 1, 2]], 1), "{bad}");
    }
    let (surface, found) = dropped(faces, "nan 0 0\n0 0 1\n1 1 1\n3 0 1 2\n3 1 2 1\n");
    assert_eq!((surface.faces, found.faces, found.no_return), (vec![[0, 1, 0]], 1, 1));
    let (_, found) =
        dropped("element face 1\nproperty list uchar float vertex_indices\n", &format!("{vertices}3 0 1 2\n"));
    assert_eq!(found.notes, ["the element face is not read: it has no list vertex_indices of whole numbers"]);
}

#[test]
fn strips_are_taken_apart() {
    let strips = "element tristrips 1\nproperty list int int vertex_indices\n";
    let (surface, found) = dropped(strips, "0 0 0\n0 0 1\n1 1 1\n11 0 1 2 0 0 1 -1 2 1 0 7\n");
    assert_eq!(surface.faces, [[0, 1, 2], [2, 1, 0], [2, 1, 0]]);
    assert_eq!(found.faces, 1, "there is no vertex 7");
}

#[test]
fn a_grid_that_can_not_be_right_is_left_out() {
    let grid = |columns: &str, count: u32| {
        format!(
            "obj_info num_cols {columns}\nobj_info num_rows 2\nelement range_grid {count}\n\
             property list uchar int vertex_indices\n"
        )
    };
    for (columns, count, pixels, reason) in [
        ("2", 3, "0\n0\n0\n", "num_cols 2 x num_rows 2 does not give its 3 pixels"),
        ("9223372036854775809", 2, "0\n0\n", "num_cols 9223372036854775809 x num_rows 2 does not give its 2 pixels"),
        ("1", 2, "0\n2 0 1\n", "its pixel 1 sees 2 vertices, more than one"),
        ("1", 2, "0\n1 9\n", "its pixel 1 names vertex 9 of 3"),
    ] {
        let (surface, found) = dropped(&grid(columns, count), &format!("0 0 0\n0 0 1\n1 1 1\n{pixels}"));
        assert_eq!((surface.cloud.len(), surface.grid), (3, None));
        assert_eq!(found.notes, [format!("the range grid is not used: {reason}")]);
    }
}

#[test]
fn limits_hold_for_points_faces_and_fans() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n\
                6 0 1 2 0 1 2\n";
    let limited =
        |max_points, max_faces| read(text.as_bytes(), &ReadLimits { max_points, max_faces, ..ReadLimits::default() });
    assert!(limited(3, 4).is_ok());
    let error = limited(2, 4).expect_err("three points").to_string();
    assert_eq!(error, "points 3 exceeds the limit of 2; thin the scan or raise the limit");
    assert_eq!(limited(3, 3), Err(FormatError::TooLarge { what: "faces", found: 4, limit: 3 }));
}
