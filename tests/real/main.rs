//! On the real scans and models in the folder `VISAGE_DATA`:
//! `VISAGE_DATA=DIR cargo test --release --test real -- --ignored --nocapture [MODULE]`.

mod additions;
mod cases;
mod faces;
mod formats;
mod global;
mod queries;
mod registration;
mod sets;

use std::path::{Path, PathBuf};

/// A path in the folder of the real data.
fn data(path: &str) -> PathBuf {
    Path::new(&std::env::var_os("VISAGE_DATA").expect("VISAGE_DATA names the folder of the real data")).join(path)
}

fn read(path: impl AsRef<Path>) -> Vec<u8> {
    let path = path.as_ref();
    std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}
