//! A picture of what each kind of sensor sees and of what comes of it: `cargo run --release --example scanner_pictures -- FOLDER`.
//!
//! For each sensor a scene that it is used for is scanned by code and registered from the scans alone. `FOLDER/SENSOR.png`
//! shows on the left the scans as they came, each in a frame of its own, and on the right the model that came of them; each
//! scan has a colour, and those without a place are left out.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use visage::geometry::neighbours::{IndexedPoints, LocalPoint};
use visage::geometry::normals::local_planes;
use visage::geometry::{Bounds, Motion, Point3, Unit, Vector3};
use visage::pipeline::{self, NamedScan, Options, Start};
use visage::progress::Progress;
use visage::synthetic::scenery::SceneKind;
use visage::synthetic::sensors::{SensorKind, SensorSet, sensor_set};

/// What each sensor is shown with, and by which seed: sets that come out whole.
const SHOWN: [(SensorKind, SceneKind, u64); 6] = [
    (SensorKind::Laser, SceneKind::Sculpture, 2),
    (SensorKind::DepthCamera, SceneKind::Room, 1),
    (SensorKind::Phone, SceneKind::Table, 1),
    (SensorKind::Vehicle, SceneKind::Street, 2),
    (SensorKind::Panorama, SceneKind::Room, 1),
    (SensorKind::Carried, SceneKind::Sculpture, 1),
];

/// Side of a half picture, pixels, and what lies between the halves.
const SIDE: usize = 360;
const GAP: usize = 16;
/// Neighbours that a normal is taken from.
const NEIGHBOURS: usize = 12;
/// Colours of views, as in Okabe and Ito's palette; with more views they come again, darker.
const COLOURS: [[f64; 3]; 8] = [
    [230.0, 159.0, 0.0],
    [86.0, 180.0, 233.0],
    [0.0, 158.0, 115.0],
    [240.0, 228.0, 66.0],
    [0.0, 114.0, 178.0],
    [213.0, 94.0, 0.0],
    [204.0, 121.0, 167.0],
    [150.0, 150.0, 150.0],
];

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let Some(folder) = arguments.next() else { anyhow::bail!("scanner_pictures FOLDER") };
    std::fs::create_dir_all(&folder)?;
    for (sensor, scene, seed) in SHOWN {
        let path = Path::new(&folder).join(format!("{}.png", sensor.name()));
        let set = sensor_set(sensor, scene, seed);
        let scans = set.scans.iter().enumerate();
        let scans = scans.map(|(k, scan)| NamedScan { name: format!("scan{k}.ply"), surface: scan.clone() }).collect();
        let options = Options { cloud: false, signature: false, ..Options::default() };
        let outcome = pipeline::run_from(scans, &Start::default(), Unit::Unknown, &options, &Progress::silent())?;
        let placed: Vec<Option<Motion>> = outcome.poses.iter().map(|(_, pose)| *pose).collect();
        let points: usize = set.scans.iter().map(|scan| scan.cloud.len()).sum();
        println!(
            "{}: {} of {} views of a {} placed, {points} points, {}",
            path.display(),
            placed.iter().flatten().count(),
            placed.len(),
            scene.name(),
            outcome.report.to_json()["verdict"]["quality"].as_str().unwrap_or("refused"),
        );
        write(&path, &picture(&set, &placed))?;
    }
    Ok(())
}

/// A point as it is drawn.
struct Dot {
    place: Point3,
    normal: Vector3,
    /// How wide the surface is that it stands for.
    width: f64,
    view: usize,
}

/// Points of a view with normals to the side that it was seen from, moved by `motion`.
fn dots(set: &SensorSet, view: usize, motion: &Motion) -> Vec<Dot> {
    let scan = &set.scans[view];
    let center = scan.cloud.centroid();
    let local = |p: &Point3| -> LocalPoint { (p - center).cast::<f32>().into() };
    let indexed = IndexedPoints::new(scan.cloud.points.iter().map(local).collect());
    let eye = scan.sensor.unwrap_or_default();
    let planes = local_planes(&indexed, &indexed.points, NEIGHBOURS);
    let dot = |(point, plane): (&LocalPoint, _)| {
        let plane: &visage::geometry::normals::LocalPlane = plane;
        let place = Point3::from(nalgebra::Vector3::from(*point).cast::<f64>()) + center.coords;
        let normal = nalgebra::Vector3::from(plane.normal).cast::<f64>();
        let normal = if normal.dot(&(Point3::from(eye) - place)) < 0.0 { -normal } else { normal };
        Dot { place: motion * place, normal: motion.rotation * normal, width: 0.0, view }
    };
    let mut dots: Vec<Dot> = indexed.points.iter().zip(&planes).map(dot).collect();
    let mut near = Vec::new();
    for (dot, point) in dots.iter_mut().zip(&indexed.points) {
        indexed.tree.k_nearest(point, NEIGHBOURS, f32::INFINITY, &mut near);
        // the disc that holds the neighbours has room for each of them
        let reach2 = near.iter().map(|n| n.distance2).fold(0.0, f32::max);
        dot.width = 2.0 * (f64::from(reach2) / NEIGHBOURS as f64).sqrt();
    }
    dots
}

/// The scans as they came beside the model.
fn picture(set: &SensorSet, placed: &[Option<Motion>]) -> Vec<u8> {
    let views = 0..placed.len();
    // turned as the scene stands, whichever view is the reference
    let upright = views.clone().find_map(|view| Some(set.poses[view] * placed[view]?.inverse())).unwrap_or_default();
    let came: Vec<Dot> = views.clone().flat_map(|view| dots(set, view, &Motion::identity())).collect();
    let model: Vec<Dot> =
        views.filter_map(|view| Some(dots(set, view, &(upright * placed[view]?)))).flatten().collect();
    let (left, right) = (drawn(&came), drawn(&model));
    let gap = [255; 3 * GAP];
    let rows = left.chunks(3 * SIDE).zip(right.chunks(3 * SIDE));
    rows.flat_map(|(left, right)| left.iter().chain(&gap).chain(right)).copied().collect()
}

/// RGB of dots seen from obliquely above. What shows its back is left out: so one looks into rooms.
fn drawn(dots: &[Dot]) -> Vec<u8> {
    let (turn, tilt) = (0.6_f64, 0.5_f64);
    let right = Vector3::new(turn.cos(), 0.0, -turn.sin());
    let towards = Vector3::new(turn.sin() * tilt.cos(), tilt.sin(), turn.cos() * tilt.cos());
    let up = towards.cross(&right);
    let seen: Vec<(&Dot, Vector3)> = dots
        .iter()
        .filter(|dot| dot.normal.dot(&towards) > 0.05)
        .map(|dot| {
            let p = dot.place.coords;
            (dot, Vector3::new(p.dot(&right), p.dot(&up), p.dot(&towards)))
        })
        .collect();
    let mut image = vec![255u8; 3 * SIDE * SIDE];
    let corners: Vec<Point3> = trimmed_corners(&seen);
    let Some(bounds) = Bounds::of(&corners) else { return image };
    let size = bounds.max - bounds.min;
    let scale = 0.94 * SIDE as f64 / f64::max(size.x, size.y).max(f64::MIN_POSITIVE);
    let middle = bounds.center();
    let mut depths = vec![f64::NEG_INFINITY; SIDE * SIDE];
    for (dot, place) in seen {
        let at = (place - middle.coords) * scale;
        let (x, y) = (at.x + 0.5 * SIDE as f64, 0.5 * SIDE as f64 - at.y);
        let radius = (0.5 * dot.width * scale).clamp(0.6, 2.2);
        let shade = 0.3 + 0.7 * dot.normal.dot(&towards);
        let darker = if dot.view < COLOURS.len() { 1.0 } else { 0.6 };
        let colour = COLOURS[dot.view % COLOURS.len()].map(|c| (c * shade * darker) as u8);
        for row in pixels(y, radius) {
            for column in pixels(x, radius) {
                let index = row * SIDE + column;
                if place.z > depths[index] {
                    depths[index] = place.z;
                    image[3 * index..3 * index + 3].copy_from_slice(&colour);
                }
            }
        }
    }
    image
}

/// Two corners of the box that holds what is seen, without the farthest hundredth on each side.
fn trimmed_corners(seen: &[(&Dot, Vector3)]) -> Vec<Point3> {
    let along = |axis: usize| {
        let mut values: Vec<f64> = seen.iter().map(|(_, place)| place[axis]).collect();
        values.sort_by(f64::total_cmp);
        let at = |share: f64| values.get((share * values.len() as f64) as usize).copied().unwrap_or_default();
        [at(0.01), at(0.99)]
    };
    let [x, y, z] = [0, 1, 2].map(along);
    (0..2).map(|k| Point3::new(x[k], y[k], z[k])).collect()
}

/// Pixels whose middles lie within `radius` of `at`, at least the one it lies in.
fn pixels(at: f64, radius: f64) -> std::ops::Range<usize> {
    let first = (at - radius).round().max(0.0) as usize;
    let end = (at + radius).round().max(0.0) as usize;
    first.min(SIDE)..end.max(first + 1).min(SIDE)
}

fn write(path: &Path, rgb: &[u8]) -> anyhow::Result<()> {
    let mut encoder = png::Encoder::new(BufWriter::new(File::create(path)?), (2 * SIDE + GAP) as u32, SIDE as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::High);
    encoder.write_header()?.write_image_data(rgb)?;
    Ok(())
}
