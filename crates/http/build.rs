//! Takes the built page (`web/dist`) into the program. Where it was not built a plain one that says how to get it takes
//! its place: who builds visage needs no Node.js.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

/// Endings of the copies that were packed beforehand.
const PACKED: [&str; 2] = ["gz", "br"];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // `npm run build` touches this file: a folder that is not there can't be watched without running this at every build
    println!("cargo:rerun-if-changed=build.rs");
    let dist = Path::new(&env::var("CARGO_MANIFEST_DIR")?).join("../../web/dist");
    let is_built = dist.join("index.html").is_file();
    let mut table =
        format!("/// Whether this is the real page.\n#[cfg(test)]\npub const IS_BUILT: bool = {is_built};\n");
    table.push_str("/// Every file of the page.\npub static FILES: &[File] = &[\n");
    if is_built {
        println!("cargo:rerun-if-changed={}", dist.display());
        let mut files = Vec::new();
        collect(&dist, &mut files)?;
        files.sort();
        for file in files.iter().filter(|file| !is_packed(file)) {
            entry(&mut table, &dist, file)?;
        }
    } else {
        println!(
            "cargo:warning=web/dist is not there: `/` will say how to get the page (`just web` builds it, with Node.js)"
        );
        table.push_str("File { path: \"/\", plain: include_bytes!(concat!(env!(\"CARGO_MANIFEST_DIR\"), ");
        table.push_str("\"/src/page/missing.html\")), gzip: None, brotli: None },\n");
    }
    table.push_str("];\n");
    fs::write(PathBuf::from(env::var("OUT_DIR")?).join("page_files.rs"), table)?;
    Ok(())
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() { collect(&path, files)? } else { files.push(path) }
    }
    Ok(())
}

fn is_packed(file: &Path) -> bool {
    file.extension().is_some_and(|ending| PACKED.iter().any(|packed| ending == *packed))
}

/// One line of the table.
fn entry(table: &mut String, dist: &Path, file: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let inside = file.strip_prefix(dist)?.to_str().ok_or("a file of the page has no plain name")?.replace('\\', "/");
    if !inside.chars().all(|c| c.is_ascii_alphanumeric() || "._-/".contains(c)) {
        return Err(format!("web/dist/{inside}: an address has letters, digits, and . _ - alone").into());
    }
    let path = match inside.as_str() {
        "index.html" => "/".to_owned(),
        // pages are called without their ending
        other => format!("/{}", other.strip_suffix(".html").unwrap_or(other)),
    };
    let packed = |ending: &str| {
        let copy = PathBuf::from(format!("{}.{ending}", file.display()));
        if copy.is_file() { format!("Some(include_bytes!({copy:?}))") } else { "None".to_owned() }
    };
    writeln!(
        table,
        "File {{ path: {path:?}, plain: include_bytes!({file:?}), gzip: {}, brotli: {} }},",
        packed("gz"),
        packed("br")
    )?;
    Ok(())
}
