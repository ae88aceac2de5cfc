//! Reads a scan or model and writes it in another format: `cargo run -p visage-formats --example convert IN OUT [--ascii]`.
//!
//! The endings of the names say which formats these are. What was read, and what was not taken, is said. `--ascii` writes text
//! where the format knows both.

use std::error::Error;
use std::path::Path;

use visage_formats::{Format, ReadLimits, extension, read};

fn main() -> Result<(), Box<dyn Error>> {
    let mut names: Vec<String> = std::env::args().skip(1).collect();
    let is_text = names.pop_if(|last| last == "--ascii").is_some();
    let [from, to] = names.as_slice() else { return Err("usage: convert IN OUT [--ascii]".into()) };
    let name = Path::new(from).file_name().and_then(|name| name.to_str()).ok_or("the name of IN is no UTF-8")?;
    let reading = read(name, &std::fs::read(from)?, &ReadLimits::default())?;
    let surface = reading.surface;
    println!("{} points, {} triangles", surface.cloud.len(), surface.faces.len());
    if !reading.dropped.is_empty() {
        println!("not taken: {}", reading.dropped);
    }
    if let Some(unit) = reading.unit {
        println!("unit: {} m", unit.metres);
    }
    let writers = Format::of_ending(&extension(to)).ok_or("OUT has an unknown ending")?.writers;
    let writers = if is_text { writers.as_text()? } else { writers };
    let bytes = match (surface.mesh(), writers.mesh, writers.cloud) {
        (Some(mesh), Some(write), _) => write(&(&mesh).into()),
        (_, _, Some(write)) => write(&surface.cloud),
        _ => return Err("nothing of this is written in the format of OUT".into()),
    };
    std::fs::write(to, bytes)?;
    Ok(())
}
