//! How quickly files are read, in CPU time (user and system, of all threads) of reading from memory:
//!
//! ```sh
//! cargo run --release -p visage-formats --example speed              # files made by code, of each format
//! cargo run --release -p visage-formats --example speed -- a.laz ... # these files
//! ```
//! Each is read five times, and the median is said. Megabytes are those of the file, 10^6 bytes.

use std::error::Error;
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

use nix::sys::resource::{UsageWho, getrusage};
use nix::sys::time::TimeValLike;
use visage_formats::{ReadLimits, e57, las, ply, read, stl};
use visage_geometry::{Cloud, Mesh, Point3};

const ROUNDS: usize = 5;
/// Points of a side of the surface that is made.
const SIDE: u32 = 1500;

/// The CPU seconds of the process.
fn cpu() -> Result<f64, Box<dyn Error>> {
    let usage = getrusage(UsageWho::RUSAGE_SELF)?;
    Ok((usage.user_time().num_microseconds() + usage.system_time().num_microseconds()) as f64 * 1e-6)
}

fn measure(name: &str, bytes: &[u8]) -> Result<(), Box<dyn Error>> {
    let limits = ReadLimits { max_bytes: u64::MAX, ..ReadLimits::default() };
    let (mut times, mut said) = (Vec::new(), String::new());
    for _ in 0..ROUNDS {
        let (begin, wall) = (cpu()?, Instant::now());
        let reading = read(name, bytes, &limits)?;
        times.push((cpu()? - begin, wall.elapsed().as_secs_f64()));
        said = format!("{} points, {} triangles", reading.surface.cloud.len(), reading.surface.faces.len());
    }
    times.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (cpu, wall) = times[ROUNDS / 2];
    let megabytes = bytes.len() as f64 * 1e-6;
    println!(
        "{name:12} {megabytes:6.1} MB  {cpu:6.3} CPU s  {:6.0} MB/s of CPU  {wall:6.3} s of wall  ({said})",
        megabytes / cpu
    );
    Ok(())
}

/// A wavy surface of `SIDE` x `SIDE` points, in the digits that files have.
fn surface() -> Mesh {
    let place = |k: u32| {
        let (x, y) = (f64::from(k % SIDE) * 0.001, f64::from(k / SIDE) * 0.001);
        let p = [x - 0.7, y - 0.7 + 0.0003 * (9.0 * x).sin(), 0.1 * (7.0 * x).sin() * (5.0 * y).cos()];
        Point3::from(p.map(|x| f64::from(x as f32)))
    };
    let vertices = (0..SIDE * SIDE).map(place).collect();
    let cells = (0..SIDE - 1).flat_map(|row| (0..SIDE - 1).map(move |column| row * SIDE + column));
    let faces = cells.flat_map(|k| [[k, k + 1, k + SIDE], [k + 1, k + SIDE + 1, k + SIDE]]).collect();
    Mesh { vertices, faces }
}

/// The texts that other programs would write of it.
fn texts(mesh: &Mesh) -> Result<Vec<(&'static str, String)>, Box<dyn Error>> {
    let (mut xyz, mut vertices, mut corners) = (String::new(), String::new(), String::new());
    for p in &mesh.vertices {
        writeln!(xyz, "{:.6} {:.6} {:.6}", p.x, p.y, p.z)?;
        writeln!(vertices, "v {:.6} {:.6} {:.6}", p.x, p.y, p.z)?;
    }
    let (mut polygons, mut faces) = (String::new(), String::new());
    for [a, b, c] in &mesh.faces {
        writeln!(polygons, "3 {a} {b} {c}")?;
        writeln!(faces, "f {} {} {}", a + 1, b + 1, c + 1)?;
    }
    for index in 0..mesh.faces.len() {
        corners.push_str("facet normal 0.000000 0.000000 1.000000\n  outer loop\n");
        for p in mesh.corners(index) {
            writeln!(corners, "    vertex {:.6} {:.6} {:.6}", p.x, p.y, p.z)?;
        }
        corners.push_str("  endloop\nendfacet\n");
    }
    let count = mesh.vertices.len();
    let head = format!(
        "ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\n"
    );
    let list = format!("element face {}\nproperty list uchar int vertex_indices\nend_header\n", mesh.faces.len());
    Ok(vec![
        ("cloud.ply", format!("{head}end_header\n{xyz}")),
        ("mesh.ply", format!("{head}{list}{xyz}{polygons}")),
        ("mesh.obj", vertices + &faces),
        ("text.stl", format!("solid a\n{corners}endsolid a\n")),
        ("mesh.off", format!("OFF\n{count} {} 0\n{xyz}{polygons}", mesh.faces.len())),
        ("cloud.xyz", xyz),
    ])
}

fn main() -> Result<(), Box<dyn Error>> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    for file in &files {
        let name = Path::new(file).file_name().and_then(|name| name.to_str()).ok_or("the name is no UTF-8")?;
        measure(name, &std::fs::read(file)?)?;
    }
    if files.is_empty() {
        let mesh = surface();
        let count = mesh.vertices.len();
        let cloud = Cloud {
            colors: Some((0..count).map(|k| [k as u8, (k >> 8) as u8, 7]).collect()),
            intensities: Some((0..count).map(|k| (k % 1000) as f32).collect()),
            ..Cloud::from_points(mesh.vertices.clone())
        };
        for (name, text) in texts(&mesh)? {
            measure(name, text.as_bytes())?;
        }
        measure("binary.stl", &stl::write_mesh(&mesh))?;
        measure("binary.ply", &ply::write_mesh(&mesh))?;
        measure("cloud.las", &las::write_cloud(&cloud))?;
        measure("cloud.e57", &e57::write_cloud(&cloud))?;
    }
    Ok(())
}
