//! The files that people begin with, made by code: what docs/FIRST_FILES.md goes through.
//!
//! `cargo run --release --example first_files -- FOLDER` writes them into a folder and prints the commands that register them.

use std::path::Path;

use anyhow::Context;
use serde_json::json;
use visage::formats::archive::ZipWriter;
use visage::formats::e57::{WrittenScan, write_scans};
use visage::formats::{las, ply};
use visage::geometry::{Cloud, Motion, Point3, RangeGrid, Surface, Vector3};
use visage::synthetic::objects;
use visage::synthetic::scanner::{ScanSet, Scanner};
use visage::synthetic::scenery::SceneKind;
use visage::synthetic::sensors::{SensorKind, sensor_set};

fn main() -> anyhow::Result<()> {
    let folder = std::env::args().nth(1).context("give the folder to write to")?;
    let folder = Path::new(&folder);
    let made = [
        ("phone", phone(&folder.join("phone"))?),
        ("realsense", realsense(&folder.join("realsense"))?),
        ("room.e57", room(&folder.join("room.e57"))?),
        ("turntable.zip", turntable(&folder.join("turntable.zip"))?),
        ("tiles", tiles(&folder.join("tiles"))?),
    ];
    for (name, more) in made {
        println!("visage register {0}/{name}{more} --out {0}/{name}-model", folder.display());
    }
    Ok(())
}

/// Writes a file, and the folders that it is in.
fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    path.parent().map_or(Ok(()), std::fs::create_dir_all)?;
    std::fs::write(path, bytes).with_context(|| format!("writing {}", path.display()))
}

/// Scans of a thing of some 20 cm, from so many places around it; coordinates in mm, z away from the scanner.
fn scans(views: usize, resolution: f64) -> ScanSet {
    let scanner = Scanner { views, distance: 600.0, resolution, noise: 0.2, grazing_angle: 75.0 };
    scanner.scan_set(&objects::blob(3, 40_000).mesh, 3)
}

/// A colour for a place on the thing.
fn color(place: &Point3) -> [u8; 3] {
    [place.x, place.y, place.z].map(|x| (128.0 + 100.0 * (x / 17.0).sin()) as u8)
}

/// Captures of a phone: meshes in metres, of which each is two nodes with primitives of their own and vertex colours.
fn phone(folder: &Path) -> anyhow::Result<&'static str> {
    let ScanSet { scans, poses } = scans(6, 2.0);
    for (index, (scan, pose)) in scans.iter().zip(&poses).enumerate() {
        let glb = glb(scan, pose)?;
        write(&folder.join(format!("capture_{index}.glb")), &glb)?;
    }
    Ok("")
}

/// The triangles between neighbouring pixels of a scan.
fn triangles(grid: &RangeGrid, cloud: &Cloud, longest: f64) -> Vec<[u32; 3]> {
    let at = |row: usize, column: usize| grid.pixels[row * grid.columns + column];
    let is_sound = |corners: &[u32; 3]| {
        let places = corners.map(|corner| cloud.points.get(corner as usize));
        let [Some(a), Some(b), Some(c)] = places else { return false };
        [(a, b), (b, c), (c, a)].iter().all(|(a, b)| (*a - *b).norm() < longest)
    };
    let mut all = Vec::new();
    for row in 1..grid.rows {
        for column in 1..grid.columns {
            let [a, b] = [at(row - 1, column - 1), at(row - 1, column)];
            let [c, d] = [at(row, column - 1), at(row, column)];
            all.extend([[a, c, b], [b, c, d]].into_iter().filter(is_sound));
        }
    }
    all
}

/// A scan as binary glTF: its triangles in two nodes, of which one stands elsewhere than its points say.
fn glb(scan: &Surface, pose: &Motion) -> anyhow::Result<Vec<u8>> {
    let grid = scan.grid.as_ref().context("scans have grids")?;
    let all = triangles(grid, &scan.cloud, 12.0);
    let (left, right): (Vec<_>, Vec<_>) =
        all.into_iter().partition(|corners| scan.cloud.points[corners[0] as usize].x < 0.0);
    let mut bytes: Vec<u8> = Vec::new();
    let (mut views, mut accessors, mut meshes, mut nodes) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (index, part) in [left, right].into_iter().enumerate() {
        let shift = Vector3::new(0.0, 0.0, 0.1 * index as f64);
        let metres = |point: &Point3| (point.coords / 1000.0 - shift).cast::<f32>();
        let mut accessor = |content: Vec<u8>, kind: &str, component: u32, count: usize, more: serde_json::Value| {
            views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": content.len()}));
            bytes.extend(content);
            let mut accessor = json!({
                "bufferView": views.len() - 1, "componentType": component, "count": count, "type": kind,
            });
            if let (Some(accessor), Some(more)) = (accessor.as_object_mut(), more.as_object()) {
                accessor.extend(more.clone());
            }
            accessors.push(accessor);
            accessors.len() - 1
        };
        let points = &scan.cloud.points;
        let places: Vec<u8> = points.iter().flat_map(|p| metres(p).data.0[0]).flat_map(f32::to_le_bytes).collect();
        let extent = |pick: fn(f32, f32) -> f32, start: f32| {
            let fold = |so_far: [f32; 3], p: &Point3| {
                let p = metres(p);
                [pick(so_far[0], p.x), pick(so_far[1], p.y), pick(so_far[2], p.z)]
            };
            points.iter().fold([start; 3], fold)
        };
        let bounds = json!({"min": extent(f32::min, f32::MAX), "max": extent(f32::max, f32::MIN)});
        let positions = accessor(places, "VEC3", 5126, points.len(), bounds);
        let colors = points.iter().flat_map(|p| color(&(pose * p))).flat_map(|c| (f32::from(c) / 255.0).to_le_bytes());
        let colors = accessor(colors.collect(), "VEC3", 5126, points.len(), json!({}));
        let corners: Vec<u8> = part.iter().flatten().flat_map(|corner| corner.to_le_bytes()).collect();
        let indices = accessor(corners, "SCALAR", 5125, 3 * part.len(), json!({}));
        let attributes = json!({"POSITION": positions, "COLOR_0": colors});
        meshes.push(json!({"primitives": [{"attributes": attributes, "indices": indices}]}));
        nodes.push(json!({"mesh": index, "translation": [shift.x, shift.y, shift.z]}));
    }
    let head = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}], "nodes": nodes, "meshes": meshes,
        "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": bytes.len()}],
    });
    let mut text = head.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = (12 + 8 + text.len() + 8 + bytes.len()) as u32;
    let mut file = [&b"glTF"[..], &2u32.to_le_bytes(), &length.to_le_bytes()].concat();
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &bytes)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    Ok(file)
}

/// Depth images of a RealSense camera in millimetres, with pictures and intrinsics.
fn realsense(folder: &Path) -> anyhow::Result<&'static str> {
    const SIZE: (usize, usize) = (320, 240);
    const FOCAL: f64 = 300.0;
    let ScanSet { scans, poses } = scans(8, 0.8);
    let (cx, cy) = (SIZE.0 as f64 / 2.0, SIZE.1 as f64 / 2.0);
    for (index, (scan, pose)) in scans.iter().zip(&poses).enumerate() {
        let mut depths = vec![u16::MAX; SIZE.0 * SIZE.1];
        let mut picture = vec![[0; 3]; SIZE.0 * SIZE.1];
        for point in &scan.cloud.points {
            let (column, row) = (FOCAL * point.x / point.z + cx, FOCAL * point.y / point.z + cy);
            let is_seen = (0.0..SIZE.0 as f64).contains(&column) && (0.0..SIZE.1 as f64).contains(&row);
            let pixel = row as usize * SIZE.0 + column as usize;
            let depth = point.z.round() as u16;
            if is_seen && depth < depths[pixel] {
                depths[pixel] = depth;
                picture[pixel] = color(&(pose * point));
            }
        }
        depths.iter_mut().filter(|depth| **depth == u16::MAX).for_each(|depth| *depth = 0);
        let depths: Vec<u8> = depths.iter().flat_map(|depth| depth.to_be_bytes()).collect();
        let gray = png(SIZE, png::ColorType::Grayscale, png::BitDepth::Sixteen, &depths)?;
        write(&folder.join(format!("{index:03}_Depth.png")), &gray)?;
        let colors = png(SIZE, png::ColorType::Rgb, png::BitDepth::Eight, &picture.concat())?;
        write(&folder.join(format!("{index:03}_Color.png")), &colors)?;
    }
    let camera = json!({"width": SIZE.0, "height": SIZE.1, "fx": FOCAL, "fy": FOCAL, "cx": cx - 0.5, "cy": cy - 0.5});
    write(&folder.join("intrinsics.json"), camera.to_string().as_bytes())?;
    Ok("")
}

fn png(size: (usize, usize), color: png::ColorType, depth: png::BitDepth, data: &[u8]) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size.0 as u32, size.1 as u32);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.write_header()?.write_image_data(data)?;
    Ok(bytes)
}

/// A room by a scanner on a tripod: one file with two scans, and with the poses that its program has found, some
/// centimetres off.
fn room(path: &Path) -> anyhow::Result<&'static str> {
    let set = sensor_set(SensorKind::Panorama, SceneKind::Room, 2);
    let off = Motion::new(Vector3::new(0.03, -0.02, 0.01), Vector3::new(0.0, 0.0, 0.01));
    let poses = [set.poses[0], set.poses[1] * off];
    let written = set.scans.iter().zip(&poses).zip(["Setup 1", "Setup 2"]).map(|((scan, pose), name)| WrittenScan {
        name,
        cloud: &scan.cloud,
        grid: scan.grid.as_ref(),
        world_from_scan: Some(pose),
    });
    write(path, &write_scans(&written.collect::<Vec<_>>()))?;
    Ok("")
}

/// Scans of a thing on a turntable, packed as their program packs them.
fn turntable(path: &Path) -> anyhow::Result<&'static str> {
    let mut zip = ZipWriter::new(Vec::new());
    for (index, scan) in scans(8, 1.5).scans.iter().enumerate() {
        zip.add(&format!("Project 7/scan_{index:02}.ply"), &ply::write_cloud(&scan.cloud, None))?;
    }
    zip.add("Project 7/preview.jpg", b"\xff\xd8\xff")?;
    zip.add("__MACOSX/Project 7/._scan_00.ply", b"Mac OS X")?;
    write(path, &zip.finish()?)?;
    Ok(" --unit mm")
}

/// Strips of land from the air as LAS tiles, with large coordinates.
fn tiles(folder: &Path) -> anyhow::Result<&'static str> {
    let set = sensor_set(SensorKind::Carried, SceneKind::Terrain, 3);
    let corner = Vector3::new(500_000.0, 4_500_000.0, 300.0);
    for (index, (scan, pose)) in set.scans.iter().zip(&set.poses).take(3).enumerate() {
        let mut cloud = scan.cloud.moved(pose);
        cloud.points.iter_mut().for_each(|point| *point += corner);
        write(&folder.join(format!("tile_{index}.las")), &las::write_cloud(&cloud))?;
    }
    Ok(" --unit m")
}
