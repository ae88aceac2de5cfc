//! Registers three scans: `cargo run --release -- a.ply b.ply c.ply` prints a pose (scan to world) for each.

use visage_formats::{ReadLimits, read_surface};
use visage_registration::geometry::{progress::Progress, se3};
use visage_registration::{method::Method, register::register};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let names: Vec<String> = std::env::args().skip(1).collect();
    let read = |name: &String| Ok(read_surface(name, &std::fs::read(name)?, &ReadLimits::default())?);
    let scans = names.iter().map(read).collect::<Result<Vec<_>, Box<dyn std::error::Error>>>()?;
    let registered = register(&scans, &vec![None; scans.len()], Method::Joint, &Progress::silent())?;
    for (name, pose) in names.iter().zip(&registered.world_from_scan) {
        println!("{name} {:?}", pose.as_ref().map(se3::to_rows));
    }
    println!("{:?} {:?}", registered.verdict.quality, registered.verdict.reasons);
    Ok(())
}
