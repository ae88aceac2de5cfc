//! JSON poses: `{"scan name": 4x4}` or `{"poses": {...}}`, each matrix row-major, nested or flat; `null` for a scan
//! without a pose.

use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::value::RawValue;

use super::{Fault, PoseFile, REMEDY};
use visage_geometry::{Motion, se3};

/// Reads a JSON pose file, keeping the order of its keys.
pub(super) fn read(text: &str) -> Result<PoseFile, Fault> {
    let root = Node::parse(text, DEPTH).map_err(|error| Fault {
        place: format!("line {}, column {}", error.line(), error.column()),
        problem: "it is no sound JSON".into(),
        remedy: REMEDY,
    })?;
    let Node::Map(entries) = root else {
        return Err(Fault::file("it is no JSON object"));
    };
    let wrapped = entries.iter().find_map(|(key, node)| match node {
        Node::Map(inner) if key == "poses" => Some(inner),
        _ => None,
    });
    let mut file = PoseFile::default();
    for (name, node) in wrapped.unwrap_or(&entries) {
        match node {
            Node::Null => file.unplaced.push(name.clone()),
            _ => {
                let rows = rows(node).ok_or_else(|| Fault::scan(name, "it is neither null nor 4 rows of 4 numbers"))?;
                file.push_matrix(name, rows)?;
            }
        }
    }
    Ok(file)
}

/// A 4x4 matrix, whether as four lists of four or as one list of sixteen.
fn rows(node: &Node) -> Option<[[f64; 4]; 4]> {
    let Node::List(items) = node else { return None };
    let is_row = |node: &Node| matches!(node, Node::List(row) if row.len() == 4);
    let flat: Vec<&Node> = match items.len() {
        4 if items.iter().all(is_row) => items.iter().flat_map(Node::items).collect(),
        16 => items.iter().collect(),
        _ => return None,
    };
    let mut rows = [[0.0; 4]; 4];
    for (slot, node) in rows.as_flattened_mut().iter_mut().zip(flat) {
        let Node::Number(value) = node else { return None };
        *slot = *value;
    }
    Some(rows)
}

/// Poses lie no deeper: file, `poses`, matrix, row, number.
const DEPTH: usize = 5;

/// JSON that keeps the order of its keys (and keys that come twice), and whose numbers are exact to the last bit, so
/// that a model's poses come back as they were written (serde_json alone may be off by one in the last place).
enum Node {
    Null,
    Number(f64),
    List(Vec<Node>),
    Map(Vec<(String, Node)>),
    /// A string, a truth value, or something deeper than poses lie: no part of a pose.
    Other,
}

impl Node {
    /// Parses one JSON value. The outermost call checks all of it.
    fn parse(text: &str, depth: usize) -> Result<Node, serde_json::Error> {
        let inner = |raw: &RawValue| match depth {
            0 | 1 => Ok(Node::Other),
            _ => Node::parse(raw.get(), depth - 1),
        };
        match text.trim_ascii_start().as_bytes().first() {
            Some(b'{') => {
                let Entries(entries) = serde_json::from_str(text)?;
                let entries = entries.into_iter().map(|(key, raw)| Ok((key, inner(&raw)?)));
                Ok(Node::Map(entries.collect::<Result<_, serde_json::Error>>()?))
            }
            Some(b'[') => {
                let Items(items) = serde_json::from_str(text)?;
                Ok(Node::List(items.iter().map(|raw| inner(raw)).collect::<Result<_, _>>()?))
            }
            _ => {
                let value: &RawValue = serde_json::from_str(text)?;
                let number = value.get().parse().map_or(Node::Other, Node::Number);
                Ok(if value.get() == "null" { Node::Null } else { number })
            }
        }
    }

    /// The items of a list; nothing for anything else.
    fn items(&self) -> &[Node] {
        if let Node::List(items) = self { items } else { &[] }
    }
}

/// No list of a pose is longer.
const MOST_ITEMS: usize = 16;
/// No file names more scans.
const MOST_ENTRIES: usize = u16::MAX as usize;

/// The first items of a list, not looked into: one more than a pose can have tells that it is none, and the others are not
/// kept.
struct Items(Vec<Box<RawValue>>);

impl<'de> Deserialize<'de> for Items {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(ItemsVisitor)
    }
}

struct ItemsVisitor;

impl<'de> Visitor<'de> for ItemsVisitor {
    type Value = Items;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("a JSON list")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Items, A::Error> {
        let mut items = Vec::new();
        while items.len() <= MOST_ITEMS {
            match list.next_element()? {
                Some(item) => items.push(item),
                None => return Ok(Items(items)),
            }
        }
        while list.next_element::<IgnoredAny>()?.is_some() {}
        Ok(Items(items))
    }
}

/// The entries of an object in their order, not looked into.
struct Entries(Vec<(String, Box<RawValue>)>);

impl<'de> Deserialize<'de> for Entries {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(EntriesVisitor)
    }
}

struct EntriesVisitor;

impl<'de> Visitor<'de> for EntriesVisitor {
    type Value = Entries;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("a JSON object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Entries, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = map.next_entry()? {
            if entries.len() >= MOST_ENTRIES {
                return Err(serde::de::Error::custom("more entries than there can be scans"));
            }
            entries.push(entry);
        }
        Ok(Entries(entries))
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
    let entry = |(name, rows): &(String, Option<[[f64; 4]; 4]>)| {
        format!("  {}: {}", serde_json::Value::from(name.as_str()), serde_json::json!(rows))
    };
    let entries: Vec<String> = matrices.iter().map(entry).collect();
    format!("{{\n{}\n}}\n", entries.join(",\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn what_is_no_matrix_names_the_scan() {
        let expected = "the pose of \"a\": it is neither null nor 4 rows of 4 numbers";
        for value in ["3", "\"x\"", "true", "[]", "[1,2,3]", "{}", "[[1,2,3],[1,2,3,4,5],[1,2,3,4],[1,2,3,4]]"] {
            assert_eq!(problem(&format!("{{\"a\": {value}}}")), expected, "{value}");
        }
        let number = "[[1,0,0,\"0\"],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
        assert_eq!(problem(&format!("{{\"a\": {number}}}")), expected);
        assert_eq!(problem("[1]"), "the whole file: it is no JSON object");
        let long = format!("{{\"a\": [{}0]}}", "0,".repeat(100_000));
        assert_eq!(problem(&long), expected);
        let many = format!("{{{}\"b\":1}}", "\"a\":0,".repeat(70_000));
        assert!(problem(&many).ends_with("it is no sound JSON"));
        assert_eq!(problem("{\"a\":\n"), "line 2, column 0: it is no sound JSON");
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
