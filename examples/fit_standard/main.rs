//! Fits the built-in face: `cargo run --release --example fit_standard DATA src/faces`.
//!
//! DATA is a folder with `manifest.csv` and `models/`. Taken are complete faces with landmarks under the MIT,
//! Apache-2.0 and CC0 licences. Each is laid onto the standard's landmarks by a similarity; the relief's spline is the
//! robust least-squares fit to all of them, every source counting the same. The modes are the principal components of
//! what is left when each face is registered to that relief without folds. Writes `relief_table.rs` and, in a second
//! run (which needs the new relief compiled in: `--modes`), `modes_table.rs`. Further arguments name sources to leave
//! out (their files' prefix), to judge those sources' faces honestly.

mod dataset;
mod heights;
mod modes;

use std::path::Path;

use dataset::{PosedFace, SOURCES, posed_faces};

fn main() {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let with_modes = arguments.iter().any(|a| a == "--modes");
    arguments.retain(|a| a != "--modes");
    let [data, out, left_out @ ..] = arguments.as_slice() else {
        eprintln!("usage: fit_standard DATA OUT [--modes] [PREFIX OF A SOURCE TO LEAVE OUT]...");
        std::process::exit(2);
    };
    let kept = SOURCES.into_iter().filter(|source| !left_out.iter().any(|out| out == source));
    let faces: Vec<PosedFace> = kept.flat_map(|source| posed_faces(Path::new(data), source)).collect();
    let (name, table) =
        if with_modes { ("modes_table.rs", modes::table(&faces)) } else { ("relief_table.rs", heights::table(&faces)) };
    std::fs::write(Path::new(out).join(name), table).expect("the table can be written");
}

/// How many of the faces are of this one's source.
fn of_its_source(face: &PosedFace, faces: &[PosedFace]) -> f64 {
    faces.iter().filter(|other| other.source == face.source).count() as f64
}
