//! JSON as far as poses need it: bounded in depth and count, with the order of its keys.

use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::value::RawValue;

use super::{Fault, kinds};

/// Poses lie no deeper: file, `frames`, frame, matrix, row, number.
const DEPTH: usize = 6;
/// No file names more scans.
const MOST_ENTRIES: usize = u16::MAX as usize;
/// No list of numbers of a pose is longer.
const MOST_NUMBERS: usize = 16;
/// What is kept of a file in all: every pose a named 4x4 matrix.
const MOST_NODES: usize = 32 * MOST_ENTRIES;
/// Keys of what belongs to no pose and may be long: it is not looked into.
const PASSED_OVER: &[&str] = &["edges"];

/// JSON that keeps the order of its keys (and keys that come twice), and whose numbers are exact to the last bit, so
/// that a model's poses come back as they were written (serde_json alone may be off by one in the last place).
pub(crate) enum Node {
    Null,
    Number(f64),
    Text(String),
    List(Vec<Node>),
    Map(Vec<(String, Node)>),
    /// A truth value, or something deeper than poses lie: no part of a pose.
    Other,
}

impl Node {
    /// Parses a JSON file.
    pub(crate) fn read(text: &str) -> Result<Node, Fault> {
        Node::parse(text, DEPTH, &mut { MOST_NODES }).map_err(|error| Fault {
            place: format!("line {}, column {}", error.line(), error.column()),
            problem: "it is no sound JSON".into(),
            remedy: kinds::remedy(),
        })
    }

    /// Parses one JSON value. The outermost call checks all of it.
    fn parse(text: &str, depth: usize, left: &mut usize) -> Result<Node, serde_json::Error> {
        let mut inner = |raw: &RawValue| match depth {
            0 | 1 => Ok(Node::Other),
            _ => Node::parse(raw.get(), depth - 1, left),
        };
        match text.trim_ascii_start().as_bytes().first() {
            Some(b'{') => {
                let Entries(entries) = serde_json::from_str(text)?;
                let mut nodes = Vec::with_capacity(entries.len());
                for (key, raw) in entries {
                    let is_passed_over = PASSED_OVER.contains(&key.as_str());
                    let node = if is_passed_over { Node::Other } else { inner(&raw)? };
                    nodes.push((key, node));
                }
                take(left, nodes.len())?;
                Ok(Node::Map(nodes))
            }
            Some(b'[') => {
                let Items(items) = serde_json::from_str(text)?;
                let nodes = items.iter().map(|raw| inner(raw)).collect::<Result<Vec<_>, _>>()?;
                take(left, nodes.len())?;
                Ok(Node::List(nodes))
            }
            Some(b'"') => serde_json::from_str(text).map(Node::Text),
            _ => {
                let value: &RawValue = serde_json::from_str(text)?;
                let number = value.get().parse().map_or(Node::Other, Node::Number);
                Ok(if value.get() == "null" { Node::Null } else { number })
            }
        }
    }

    /// The items of a list; nothing for anything else.
    pub(crate) fn items(&self) -> &[Node] {
        if let Node::List(items) = self { items } else { &[] }
    }

    /// The first entry of an object with this key.
    pub(crate) fn get(&self, key: &str) -> Option<&Node> {
        let Node::Map(entries) = self else { return None };
        entries.iter().find(|(name, _)| name == key).map(|(_, node)| node)
    }

    /// The first entry that one of these keys has.
    pub(crate) fn get_any(&self, keys: &[&str]) -> Option<&Node> {
        keys.iter().find_map(|key| self.get(key))
    }

    pub(crate) fn text(&self) -> Option<&str> {
        if let Node::Text(text) = self { Some(text) } else { None }
    }

    pub(crate) fn number(&self) -> Option<f64> {
        if let Node::Number(value) = self { Some(*value) } else { None }
    }

    /// The numbers of a list of numbers, or of a list of such lists, one after the other.
    pub(crate) fn numbers(&self) -> Option<Vec<f64>> {
        let Node::List(items) = self else { return None };
        let is_nested = items.iter().all(|item| matches!(item, Node::List(_)));
        let flat: Vec<&Node> =
            if is_nested { items.iter().flat_map(Node::items).collect() } else { items.iter().collect() };
        flat.into_iter().map(Node::number).collect()
    }
}

fn take(left: &mut usize, count: usize) -> Result<(), serde_json::Error> {
    *left = left.checked_sub(count).ok_or_else(|| serde::de::Error::custom("more values than poses can have"))?;
    Ok(())
}

/// The items of a list, not looked into. Of a list of plain values only so many are kept as tell that it is no matrix.
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
        let mut items: Vec<Box<RawValue>> = Vec::new();
        while let Some(item) = list.next_element::<Box<RawValue>>()? {
            let is_plain = !item.get().starts_with(['{', '[']);
            items.push(item);
            if items.len() > MOST_ENTRIES {
                return Err(serde::de::Error::custom("more entries than there can be scans"));
            }
            if is_plain && items.len() > MOST_NUMBERS {
                while list.next_element::<IgnoredAny>()?.is_some() {}
                break;
            }
        }
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
