//! Poses in JSON: matrices by the names of scans, lists of matrices, and what Open3D and programs around NeRF write.

use super::node::Node;
use super::{Fault, LAST_ROW, Naming, PoseFile, rows_of_12, rows_of_16, transposed};
use visage_geometry::{Motion, PoseConvention, se3};

/// Keys by which lists of objects name a scan.
const NAME_KEYS: &[&str] = &["name", "file_path", "file", "filename", "file_name", "scan", "image", "path"];
/// The key, and its value, of poses that the files of the scans tell.
const FROM: (&str, &str) = ("from", "scan files");
/// Keys by which they give its matrix.
const MATRIX_KEYS: &[&str] =
    &["pose", "matrix", "transform", "transformation", "transform_matrix", "pose_world", "camera_to_world", "c2w"];

/// `{"scan name": matrix}` or `{"poses": {...}}`, in the order of the keys.
pub(super) fn by_name(root: &Node) -> Result<PoseFile, Fault> {
    let wrapped = root.get("poses").filter(|node| matches!(node, Node::Map(_)));
    let Node::Map(entries) = wrapped.unwrap_or(root) else {
        return Err(Fault::file("it is no JSON object"));
    };
    let of_scan_files = wrapped.is_some() && root.get(FROM.0).and_then(Node::text) == Some(FROM.1);
    let other_conventions: &[PoseConvention] = if of_scan_files { &[] } else { &[PoseConvention::WorldToScan] };
    let mut file = PoseFile { other_conventions, of_scan_files, ..PoseFile::default() };
    for (name, node) in entries {
        match node {
            Node::Null => file.unplaced.push(name.clone()),
            _ => file.push_matrix(name, rows_at(name, Some(node))?)?,
        }
    }
    Ok(file)
}

/// Whether this is a list of matrices, or of objects that hold one.
pub(super) fn is_list(root: &Node) -> bool {
    matches!(listed(root), Node::List(_))
}

fn listed(root: &Node) -> &Node {
    root.get_any(&["poses", "frames", "transforms"]).unwrap_or(root)
}

/// A list of matrices: by name where they stand in objects with a name, else in the order of the scans.
pub(super) fn list(root: &Node) -> Result<PoseFile, Fault> {
    let list = listed(root);
    let mut file = PoseFile { other_conventions: &[PoseConvention::WorldToScan], ..PoseFile::default() };
    // a list of rows is one matrix, not a list of them
    if let Some(rows) = rows(list) {
        file.naming = Naming::Order;
        file.push_matrix(&file.next_label(), rows)?;
        return Ok(file);
    }
    let name = |node: &Node| node.get_any(NAME_KEYS).and_then(Node::text).map(str::to_owned);
    let is_named = list.items().iter().all(|item| name(item).is_some());
    file.naming = if is_named { Naming::Scans } else { Naming::Order };
    for item in list.items() {
        let name = name(item).filter(|_| is_named).unwrap_or_else(|| file.next_label());
        let matrix = if matches!(item, Node::Map(_)) { item.get_any(MATRIX_KEYS) } else { Some(item) };
        file.push_matrix(&name, rows_at(&name, matrix)?)?;
    }
    Ok(file)
}

fn is_class(root: &Node, class: &str) -> bool {
    root.get("class_name").and_then(Node::text) == Some(class)
}

pub(super) fn is_pose_graph(root: &Node) -> bool {
    let has_pose = |nodes: &Node| nodes.items().iter().any(|node| node.get("pose").is_some());
    is_class(root, "PoseGraph") || root.get("nodes").is_some_and(has_pose)
}

/// Open3D's `PoseGraph`: its nodes map the scans into the world, in their order.
pub(super) fn pose_graph(root: &Node) -> Result<PoseFile, Fault> {
    let mut file = PoseFile { naming: Naming::Order, ..PoseFile::default() };
    for node in root.get("nodes").map(Node::items).unwrap_or_default() {
        let label = file.next_label();
        file.push_matrix(&label, columns_at(&label, node.get("pose"))?)?;
    }
    Ok(file)
}

pub(super) fn is_trajectory(root: &Node) -> bool {
    is_class(root, "PinholeCameraTrajectory")
        || is_class(root, "PinholeCameraParameters")
        || root.get("parameters").is_some_and(|list| list.items().iter().any(|item| item.get("extrinsic").is_some()))
}

/// Open3D's `PinholeCameraTrajectory`: its extrinsics map the world into the cameras.
pub(super) fn trajectory(root: &Node) -> Result<PoseFile, Fault> {
    let said = vec!["the extrinsics of the cameras map the world into the scans: they are inverted".to_owned()];
    let mut file = PoseFile { naming: Naming::Order, said, ..PoseFile::default() };
    let single = root.get("extrinsic").is_some().then_some(root);
    for camera in single.into_iter().chain(root.get("parameters").map(Node::items).unwrap_or_default()) {
        let label = file.next_label();
        file.push_inverse(&label, columns_at(&label, camera.get("extrinsic"))?)?;
    }
    Ok(file)
}

pub(super) fn is_transforms(root: &Node) -> bool {
    root.get("frames").is_some_and(|list| list.items().iter().any(|frame| frame.get("transform_matrix").is_some()))
}

/// `transforms.json`: cameras in the world, y up and z back (OpenGL). Whether a scan has the axes of the camera, or
/// those of depth images, the file can't know: the surfaces tell.
pub(super) fn transforms(root: &Node) -> Result<PoseFile, Fault> {
    let mut file = PoseFile { other_conventions: &[PoseConvention::OpenGlCamera], ..PoseFile::default() };
    for (index, frame) in root.get("frames").map(Node::items).unwrap_or_default().iter().enumerate() {
        let name = frame
            .get("file_path")
            .and_then(Node::text)
            .ok_or_else(|| Fault::file(format!("frame {} has no file_path, so it names no scan", index + 1)))?;
        file.push_matrix(name, rows_at(name, frame.get("transform_matrix"))?)?;
    }
    Ok(file)
}

/// The matrix of a scan, or what is wrong with it.
fn rows_at(name: &str, node: Option<&Node>) -> Result<[[f64; 4]; 4], Fault> {
    node.and_then(rows).ok_or_else(|| Fault::scan(name, "it is neither null nor 3 or 4 rows of 4 numbers"))
}

/// The matrix of a scan whose numbers stand column by column.
fn columns_at(name: &str, node: Option<&Node>) -> Result<[[f64; 4]; 4], Fault> {
    let numbers = node.and_then(Node::numbers).and_then(|numbers| <[f64; 16]>::try_from(numbers).ok());
    let rows = numbers.map(|numbers| transposed(rows_of_16(&numbers)));
    rows.ok_or_else(|| Fault::scan(name, "it is not 16 numbers, column by column"))
}

/// A matrix of 4 or 3 rows, whether as lists of four or as one list.
fn rows(node: &Node) -> Option<[[f64; 4]; 4]> {
    let items = node.items();
    let is_nested = items.iter().all(|item| matches!(item, Node::List(_)));
    if is_nested && items.iter().any(|row| row.items().len() != LAST_ROW.len()) {
        return None;
    }
    let numbers = node.numbers()?;
    match numbers.len() {
        16 => numbers.try_into().ok().map(|numbers| rows_of_16(&numbers)),
        12 => numbers.try_into().ok().map(|numbers| rows_of_12(&numbers)),
        _ => None,
    }
}

/// Writes `{"scan name": 4x4 row-major}`, one scan a line, `null` for an unplaced one. Numbers are the shortest
/// that read back the same, so the same poses give the same bytes.
pub fn write(poses: &[(String, Option<Motion>)]) -> String {
    let matrices: Vec<_> = poses.iter().map(|(name, pose)| (name.clone(), pose.as_ref().map(se3::to_rows))).collect();
    write_matrices(&matrices)
}

/// The same from the matrices themselves, whose upper left blocks may hold a scale.
pub fn write_matrices(matrices: &[(String, Option<[[f64; 4]; 4]>)]) -> String {
    format!("{}\n", object(matrices))
}

fn object(matrices: &[(String, Option<[[f64; 4]; 4]>)]) -> String {
    let entry = |(name, rows): &(String, Option<[[f64; 4]; 4]>)| {
        format!("  {}: {}", serde_json::Value::from(name.as_str()), serde_json::json!(rows))
    };
    let entries: Vec<String> = matrices.iter().map(entry).collect();
    format!("{{\n{}\n}}", entries.join(",\n"))
}

/// Poses that the files of the scans tell, as a file that says so: `{"from": "scan files", "poses": {...}}`. Each is in the
/// unit of its scan's file.
pub fn write_of_scan_files(poses: &[(String, Motion)]) -> String {
    let matrices: Vec<_> = poses.iter().map(|(name, pose)| (name.clone(), Some(se3::to_rows(pose)))).collect();
    format!("{{\"{}\": \"{}\", \"poses\": {}}}\n", FROM.0, FROM.1, object(&matrices))
}

#[cfg(test)]
mod tests {
    use super::super::kinds;
    use super::*;

    fn read(text: &str) -> Result<PoseFile, Fault> {
        kinds::read(text)
    }

    fn sound(text: &str) -> PoseFile {
        read(text).unwrap_or_else(|fault| panic!("{text}: {}", fault.problem))
    }

    fn problem(text: &str) -> String {
        read(text).err().map(|fault| format!("{}: {}", fault.place, fault.problem)).unwrap_or_default()
    }

    #[test]
    fn nested_flat_wrapped_and_null_are_read_in_file_order() {
        let text = "{\"unit\": \"m\", \"done\": true, \"poses\": {\"z\": [1,0,0,7, 0,1,0,0, 0,0,1,0, 0,0,0,1], \"m\": null, \
                    \"a\": [[1,0,0,0.5],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}}";
        let file = read(text).unwrap_or_else(|fault| panic!("{}", fault.problem));
        assert_eq!(
            file.poses,
            [("z".into(), Motion::translation(7.0, 0.0, 0.0)), ("a".into(), Motion::translation(0.5, 0.0, 0.0))]
        );
        assert_eq!(file.unplaced, ["m"]);
    }

    #[test]
    fn poses_of_the_scans_own_files_say_so() {
        let poses = [("b.e57".to_owned(), Motion::translation(7.0, 0.0, 0.0)), ("a".to_owned(), Motion::identity())];
        let file = sound(&write_of_scan_files(&poses));
        assert_eq!((file.of_scan_files, file.other_conventions.len()), (true, 0));
        assert_eq!(file.poses, poses);
        let given = sound(&write(&[("a".to_owned(), Some(Motion::identity()))]));
        assert_eq!((given.of_scan_files, given.other_conventions.len()), (false, 1));
    }

    #[test]
    fn what_is_no_matrix_names_the_scan() {
        let expected = "the pose of \"a\": it is neither null nor 3 or 4 rows of 4 numbers";
        for value in ["3", "\"x\"", "true", "[]", "[1,2,3]", "{}", "[[1,2,3],[1,2,3,4,5],[1,2,3,4],[1,2,3,4]]"] {
            assert_eq!(problem(&format!("{{\"a\": {value}}}")), expected, "{value}");
        }
        let number = "[[1,0,0,\"0\"],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
        assert_eq!(problem(&format!("{{\"a\": {number}}}")), expected);
        assert!(problem("[1]").starts_with("the pose of \"pose 1\": it is neither null"));
        let long = format!("{{\"a\": [{}0]}}", "0,".repeat(100_000));
        assert_eq!(problem(&long), expected);
        for many in
            [format!("{{{}\"b\":1}}", "\"a\":0,".repeat(70_000)), format!("[{}[]]", "[[[],[]]],".repeat(70_000))]
        {
            assert!(problem(&many).ends_with("it is no sound JSON"));
        }
        assert_eq!(problem("{\"a\":\n"), "line 2, column 0: it is no sound JSON");
    }

    const FLAT: &str = "1,0,0,4, 0,1,0,5, 0,0,1,6";
    const COLUMNS: &str = "0,1,0,0, -1,0,0,0, 0,0,1,0, 4,5,6,1";

    #[test]
    fn three_rows_and_lists_are_read() {
        let motion = Motion::translation(4.0, 5.0, 6.0);
        let file = sound(&format!("{{\"a\": [{FLAT}], \"b\": [[1,0,0,4],[0,1,0,5],[0,0,1,6]]}}"));
        assert!(file.poses.iter().all(|(_, pose)| *pose == motion) && file.poses.len() == 2);
        for text in [format!("[[{FLAT}], [{FLAT}]]"), format!("{{\"poses\": [[{FLAT}], [{FLAT}]]}}")] {
            let file = sound(&text);
            assert_eq!((file.kind, file.naming, file.poses.len()), ("JSON list of matrices", Naming::Order, 2));
        }
        let file = sound(&format!("[{{\"file\": \"a.ply\", \"matrix\": [{FLAT}]}}]"));
        assert_eq!((file.naming, &file.poses[0]), (Naming::Scans, &("a.ply".to_owned(), motion)));
        let single = sound("[[1,0,0,4],[0,1,0,5],[0,0,1,6],[0,0,0,1]]");
        assert_eq!(single.poses, [("pose 1".to_owned(), motion)]);
    }

    #[test]
    fn what_open3d_writes_is_read_column_by_column() {
        let turned = Motion::new(visage_geometry::Vector3::new(4.0, 5.0, 6.0), visage_geometry::Vector3::z() * 0.5);
        let quarter = Motion::new(turned.translation.vector, turned.rotation.scaled_axis() * std::f64::consts::PI);
        let graph = format!(
            "{{\"class_name\": \"PoseGraph\", \"edges\": [{{\"x\": [[[[[[[[0]]]]]]]]}}], \"nodes\": [{{\"pose\": [{COLUMNS}]}}]}}"
        );
        let file = sound(&graph);
        assert_eq!((file.kind, file.naming), ("Open3D pose graph", Naming::Order));
        assert!((file.poses[0].1.to_homogeneous() - quarter.to_homogeneous()).norm() < 1e-12);
        let camera = format!("{{\"class_name\": \"PinholeCameraParameters\", \"extrinsic\": [{COLUMNS}]}}");
        for text in [format!("{{\"parameters\": [{camera}]}}"), camera.clone()] {
            let file = sound(&text);
            assert_eq!((file.kind, file.naming), ("Open3D camera trajectory", Naming::Order));
            assert!((file.poses[0].1.inverse().to_homogeneous() - quarter.to_homogeneous()).norm() < 1e-12);
            assert!(file.said[0].contains("inverted"));
        }
        assert_eq!(
            problem("{\"class_name\": \"PoseGraph\", \"nodes\": [{}]}"),
            "the pose of \"pose 1\": it is not 16 numbers, column by column"
        );
    }

    #[test]
    fn frames_are_named_by_their_pictures() {
        let file = sound(&format!(
            "{{\"camera_angle_x\": 0.7, \"frames\": [{{\"file_path\": \"./a.ply\", \"transform_matrix\": [{FLAT}]}}]}}"
        ));
        assert_eq!((file.kind, file.poses[0].0.as_str()), ("NeRF `transforms.json`", "./a.ply"));
        assert_eq!(file.other_conventions, [PoseConvention::OpenGlCamera]);
        let nameless = problem(&format!("{{\"frames\": [{{\"transform_matrix\": [{FLAT}]}}]}}"));
        assert_eq!(nameless, "the whole file: frame 1 has no file_path, so it names no scan");
    }

    #[test]
    fn numbers_come_back_to_the_last_bit() {
        // serde_json's own parser misses some of these by one in the last place
        for value in [-0.9434816530622377, 411.46742216790756, 0.1, -1e-9, 5e-324, -3.6e11] {
            let rows = [[1.0, 0.0, 0.0, value], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
            let text = write_matrices(&[("a".into(), Some(rows))]);
            let file = read(&text).unwrap_or_else(|fault| panic!("{}", fault.problem));
            assert_eq!(file.matrices["a"], rows);
        }
    }

    #[test]
    fn deep_nesting_is_no_pose_and_takes_no_stack() {
        let deep = format!("{{\"a\": {}{}}}", "[".repeat(100_000), "]".repeat(100_000));
        assert!(problem(&deep).contains("a"));
        let deep = format!("{}{}", "{\"poses\":".repeat(50_000), "}".repeat(50_000));
        assert!(!problem(&deep).is_empty());
    }

    #[test]
    fn writing_is_one_line_a_scan() {
        let poses = [("a\"b".into(), Some(Motion::translation(0.1, 0.0, -2.0))), ("c".into(), None)];
        let rows = "[[1.0,0.0,0.0,0.1],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,-2.0],[0.0,0.0,0.0,1.0]]";
        assert_eq!(write(&poses), format!("{{\n  \"a\\\"b\": {rows},\n  \"c\": null\n}}\n"));
    }
}
