//! Names for the scans of files that hold several.

use std::collections::{BTreeMap, BTreeSet};

/// The longest name of a scan that is taken from its file, in bytes.
const LONGEST_NAME: usize = 200;

/// A name for each scan of each file: the file's own if it holds one, else that which the file gives to the scan, if it is
/// plain and no other scan has it, else `file#index`. `files` are their names and what they call their scans; no scan
/// gets one of the names in `others`.
pub fn scan_names(files: &[(&str, Vec<Option<&str>>)], others: &[&str]) -> Vec<Vec<String>> {
    let mut uses: BTreeMap<&str, usize> = others.iter().map(|name| (*name, 1)).collect();
    let several = files.iter().filter(|(_, scans)| scans.len() > 1);
    let own = several.flat_map(|(_, scans)| scans).filter_map(|name| name.filter(|name| is_plain(name)));
    own.for_each(|name| *uses.entry(name).or_default() += 1);
    let mut taken: BTreeSet<String> = uses.keys().map(|name| (*name).to_owned()).collect();
    let mut name_of = |file: &str, index: usize, own: Option<&str>| match own {
        Some(name) if is_plain(name) && uses.get(name) == Some(&1) => name.to_owned(),
        _ => {
            let mut name = format!("{file}#{index}");
            while !taken.insert(name.clone()) {
                name.push('#');
            }
            name
        }
    };
    let of_file = |(file, scans): &(&str, Vec<Option<&str>>)| match scans.as_slice() {
        [_] => vec![(*file).to_owned()],
        scans => scans.iter().enumerate().map(|(index, own)| name_of(file, index, *own)).collect(),
    };
    files.iter().map(of_file).collect()
}

/// Whether a name that a file gives to a scan can be that of a file, as the names of scans are.
fn is_plain(name: &str) -> bool {
    let is_odd = |sign: char| sign.is_control() || matches!(sign, '/' | '\\' | char::REPLACEMENT_CHARACTER);
    !name.is_empty()
        && name.len() <= LONGEST_NAME
        && name.trim() == name
        && !name.starts_with('.')
        && !name.contains(is_odd)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_keep_sound_names_and_get_others_where_they_clash() {
        let files = [
            ("a.e57", vec![Some("door"), Some("../x"), Some("twice"), Some("taken.ply"), Some("a.e57#1"), None]),
            ("b.e57", vec![Some("twice"), Some(" wall")]),
            ("c.e57", vec![Some("alone")]),
            ("d.e57", vec![]),
        ];
        let names = scan_names(&files, &["taken.ply"]);
        assert_eq!(names[0], ["door", "a.e57#1#", "a.e57#2", "a.e57#3", "a.e57#1", "a.e57#5"]);
        assert_eq!(names[1..], [vec!["b.e57#0", "b.e57#1"], vec!["c.e57"], vec![]]);
    }
}
