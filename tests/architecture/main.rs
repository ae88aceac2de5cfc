//! The layers of the house as law: who may use whom, who may use which crate, and what the pure modules must not see.

mod laws;
mod paths;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use laws::{BACKENDS, CRATES, IMPURE_NAMES, IMPURE_PATHS, LAYERS, MOST_LINES, ONLY_IN, PRINTING, PURE};
use paths::{Named, paths};
use visage::domain::asset::{Asset, Origin};

/// The room that a path leads to, if it starts from the root of a crate. `depth` is the number of names in the module path
/// of the file.
fn module_named(named: &Named, depth: usize) -> Option<&str> {
    let first = named.segments.first()?;
    let is_named = |(name, _): &&(&str, Option<&'static str>)| first.strip_prefix("visage_") == Some(name);
    let is_crate = match CRATES.iter().find(is_named) {
        Some((_, Some(room))) => return Some(room),
        // its rooms are named next
        Some((_, None)) => true,
        None => false,
    };
    let supers = named.segments.iter().take_while(|segment| *segment == "super").count();
    let from_root = if first == "crate" || first == "visage" || is_crate {
        1
    } else if supers == depth && supers > 0 {
        supers
    } else {
        return None;
    };
    let module = named.segments.get(from_root)?;
    LAYERS.iter().map(|(name, _)| *name).find(|name| name == module)
}

/// What is wrong in a file of `module`, one line each: `line: complaint`.
fn complaints(module: &str, depth: usize, source: &str) -> Vec<String> {
    let allowed = LAYERS.iter().find(|(name, _)| *name == module).map(|(_, allowed)| *allowed);
    let is_pure = PURE.contains(&module);
    let mut complaints = Vec::new();
    for named in paths(source) {
        let mut complain = |what: String| complaints.push(format!("{}: {what}", named.line));
        if let Some(used) = module_named(&named, depth)
            && used != module
            && !allowed.is_none_or(|allowed| allowed.contains(&used))
        {
            complain(format!("{module} must not use {used} ({})", named.path()));
        }
        let impure = IMPURE_PATHS.iter().any(|path| named.is_in(path))
            || named.segments.iter().any(|segment| IMPURE_NAMES.contains(&segment.as_str()));
        if is_pure && impure {
            complain(format!("{module} is pure and must not use {}", named.path()));
        }
        let prints = named.is_macro && named.segments.last().is_some_and(|name| PRINTING.contains(&name.as_str()));
        if prints && module != "cli" {
            complain(format!("{module} must not print ({}!)", named.path()));
        }
        for (path, users) in ONLY_IN {
            if named.is_in(path) && !is_pure && !users.contains(&module) {
                complain(format!("{} belongs to {}, not to {module}", named.path(), users.join(" and ")));
            }
        }
    }
    complaints
}

/// A source file.
struct Source {
    /// Its path below the root of the house.
    file: PathBuf,
    /// Its path below `src`, as if all rooms stood there: `geometry/se3.rs`.
    place: PathBuf,
    text: String,
}

/// All source files.
fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = files_of(root, Path::new("src"), None);
    for (name, room) in CRATES {
        files.extend(files_of(root, &Path::new("crates").join(name).join("src"), *room));
    }
    files.sort_by(|a, b| a.file.cmp(&b.file));
    files
}

fn files_of(root: &Path, source: &Path, room: Option<&str>) -> Vec<Source> {
    let mut folders = vec![root.join(source)];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder of sources") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let text = std::fs::read_to_string(&path).expect("UTF-8");
                let file = path.strip_prefix(root).expect("below the root").to_owned();
                let inside = file.strip_prefix(source).expect("below the crate");
                let place = match room {
                    Some(room) if inside == Path::new("lib.rs") => Path::new(room).join("mod.rs"),
                    Some(room) => Path::new(room).join(inside),
                    None => inside.to_owned(),
                };
                files.push(Source { file, place, text });
            }
        }
    }
    files
}

/// The names in the module path of a file: `jobs/mod.rs` is `[jobs]`, `jobs/work.rs` is `[jobs, work]`.
fn module_path(file: &Path) -> Vec<String> {
    let names = file.with_extension("");
    let names = names.iter().map(|name| name.to_string_lossy().into_owned());
    names.filter(|name| name != "mod").collect()
}

#[test]
fn layers_point_one_way() {
    let mut all = Vec::new();
    for Source { file, place, text } in sources() {
        let names = module_path(&place);
        let found = complaints(&names[0], names.len(), &text);
        all.extend(found.into_iter().map(|complaint| format!("{}:{complaint}", file.display())));
    }
    assert!(all.is_empty(), "{} places break the layers:\n{}", all.len(), all.join("\n"));
}

/// `http` and `jobs` see the traits of the storage, and one backend does not see the other.
#[test]
fn backends_are_nobodys_business() {
    let mut all = Vec::new();
    for Source { file, place, text } in sources() {
        let names = module_path(&place);
        let tests = text.find("#[cfg(test)]").unwrap_or(text.len());
        for named in paths(&text[..tests]) {
            let is_in = |backend: &str| {
                let root = named.segments[0].as_str();
                let is_root = ["crate", "visage", "visage_service"].contains(&root);
                is_root && named.is_in(&format!("{root}::storage::{backend}"))
            };
            let backend = BACKENDS.iter().find(|backend| is_in(backend));
            let own = names.get(1).map(String::as_str);
            // what is on its way to a bucket is staged in the folder beside it; rows of SQLite move to a server
            let is_beside = |of: &str| [(Some("s3"), "local_files"), (Some("postgres"), "sqlite")].contains(&(own, of));
            let is_own = |backend: &str| own == Some(backend) || own == Some("data_folder") || is_beside(backend);
            let is_allowed = |backend: &str| names[0] == "storage" && is_own(backend);
            if let Some(backend) = backend.filter(|backend| !is_allowed(backend)) {
                all.push(format!("{}:{}: {backend} is behind a trait", file.display(), named.line));
            }
        }
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}

#[test]
fn every_module_has_its_place() {
    let mut files: BTreeMap<String, usize> = BTreeMap::new();
    for source in sources() {
        *files.entry(module_path(&source.place)[0].clone()).or_default() += 1;
    }
    let crates = std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("crates")).expect("the crates");
    for entry in crates {
        let name = entry.expect("an entry").file_name().to_string_lossy().into_owned();
        // benches use what they like: nothing depends on them
        let is_known = name == "bench" || CRATES.iter().any(|(known, _)| *known == name);
        assert!(is_known, "crates/{name} is not known: add it to CRATES");
    }
    for name in files.keys().filter(|name| !["lib", "main"].contains(&name.as_str())) {
        assert!(LAYERS.iter().any(|(known, _)| known == name), "src/{name} is in no layer: add it to LAYERS");
    }
    for (index, (name, allowed)) in LAYERS.iter().enumerate() {
        assert!(files.contains_key(*name), "LAYERS knows {name}, which isn't there any more");
        for used in *allowed {
            let place = LAYERS.iter().position(|(known, _)| known == used);
            assert!(place.is_some_and(|place| place < index), "{name} -> {used} does not point to a layer below");
            let keeps_pure = !PURE.contains(name) || PURE.contains(used);
            assert!(keeps_pure, "{name} is pure and can't use {used}");
        }
    }
}

#[test]
fn files_stay_short() {
    let long: Vec<String> = sources()
        .iter()
        .map(|source| (&source.file, source.text.lines().count()))
        .filter(|(_, lines)| *lines > MOST_LINES)
        .map(|(file, lines)| format!("{}: {lines} lines", file.display()))
        .collect();
    assert!(long.is_empty(), "split these (at most {MOST_LINES} lines): {}", long.join(", "));
}

/// Files of models have their names in one place; what is named elsewhere are pose files that users send.
#[test]
fn names_of_files_of_models_stand_in_one_place() {
    let uploads = Asset::of(Origin::Uploaded);
    let names: Vec<String> =
        Asset::RESULTS.iter().chain(&uploads).map(|asset| format!("\"{}\"", asset.name())).collect();
    let elsewhere = |file: &Path| {
        let is_apart = |folder: &str| file.starts_with(folder);
        // what checks backends is test code as a whole
        !["formats", "domain/asset.rs", "storage/conformance"].into_iter().any(is_apart)
    };
    let mut found = Vec::new();
    for Source { file, text, .. } in sources().into_iter().filter(|source| elsewhere(&source.place)) {
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        let named = code.lines().filter(|line| names.iter().any(|name| line.contains(name)));
        found.extend(named.map(|line| format!("{}: {}", file.display(), line.trim())));
    }
    assert!(found.is_empty(), "ask Asset for these names:\n{}", found.join("\n"));
}

#[test]
fn the_reader_finds_what_is_forbidden() {
    for (source, complaint) in [
        ("use std::fs;", "1: geometry is pure and must not use std::fs"),
        ("use std::{io, fs::{self, File}};", "1: geometry is pure and must not use std::fs::self"),
        ("\nfn f() { std::env::var(\"A\"); }", "2: geometry is pure and must not use std::env::var"),
        ("use std::time::{Duration, Instant};", "1: geometry is pure and must not use std::time::Instant"),
        ("fn f() { let t = Instant::now(); }", "1: geometry is pure and must not use Instant::now"),
        ("use tokio::sync::Mutex;", "1: geometry is pure and must not use tokio::sync::Mutex"),
        ("fn f() { println!(\"{}\", 1) }", "1: geometry must not print (println!)"),
        (
            "use crate::registration::view::View;",
            "1: geometry must not use registration (crate::registration::view::View)",
        ),
        (
            "use visage_registration::view::View;",
            "1: geometry must not use registration (visage_registration::view::View)",
        ),
        ("use visage_shape::faces::Size;", "1: geometry must not use faces (visage_shape::faces::Size)"),
        ("use visage_service::jobs::memory;", "1: geometry must not use jobs (visage_service::jobs::memory)"),
        ("use crate::{progress, http::Server};", "1: geometry must not use http (crate::http::Server)"),
        ("use super::super::storage::Storage;", "1: geometry must not use storage (super::super::storage::Storage)"),
    ] {
        let found = complaints("geometry", 2, source);
        assert!(found.iter().any(|found| found == complaint), "{source:?}: {found:?}");
    }
    assert_eq!(
        complaints("http", 2, "let p: sqlx::SqlitePool;"),
        ["1: sqlx::SqlitePool belongs to storage, not to http"]
    );
    assert_eq!(
        complaints("jobs", 2, "use tokio::{fs, sync::Notify};"),
        ["1: tokio::fs belongs to storage and cli, not to jobs"]
    );
}

#[test]
fn the_reader_passes_over_what_only_looks_so() {
    for source in [
        "//! std::fs, tokio and crate::http are for others",
        "/* use std::fs; /* nested */ println!() */ fn f() {}",
        "const A: &str = \"use std::fs; \\\" crate::http::x\";",
        "const A: &str = r#\"use \"std::fs\"\"#; const B: &[u8] = b\"tokio::fs\";",
        "fn f<'a>(c: &'a str) -> bool { c.starts_with('\"') || c.ends_with('\\'') }",
        "use super::Motion; fn f() { a != b; std::time::Duration::from_secs(1); }",
        "use crate::geometry::{Motion, Point3};",
        "mod tokio_like {} struct SystemTimer; fn instant() {}",
    ] {
        let found = complaints("geometry", 2, source);
        assert!(found.is_empty(), "{source:?}: {found:?}");
    }
}
