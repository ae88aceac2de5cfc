//! The faces that the standard is fitted to, each laid onto the standard's landmarks.

use std::path::Path;

use visage::faces::modes::LANDMARKS;
use visage::formats;
use visage::geometry::{Mesh, Point3, Vector3, se3};

/// The landmarks that faces are laid onto, mm: eye corners, sellion, nose tip, subnasale.
pub const POSING: [(&str, [f64; 3]); 7] = [
    ("eye_r_inner", [-18.4, 32.5, 92.0]),
    ("eye_l_inner", [18.4, 32.5, 92.0]),
    ("eye_r_outer", [-44.6, 34.3, 86.0]),
    ("eye_l_outer", [44.6, 34.3, 86.0]),
    ("sellion", [0.0, 36.3, 110.7]),
    ("nose_tip", [0.0, 4.1, 130.7]),
    ("subnasale", [0.0, -12.0, 115.7]),
];

/// Sources by the prefix of their files' names.
pub const SOURCES: [&str; 3] = ["ict_", "simpop_", "makehuman_"];

/// A face in the standard's frame, mm.
pub struct PosedFace {
    pub mesh: Mesh,
    /// In the order of [`LANDMARKS`]; some models lack some.
    pub landmarks: [Option<Point3>; LANDMARKS.len()],
    pub source: &'static str,
}

/// The complete faces of a source with landmarks, under free licences.
pub fn posed_faces(data: &Path, source: &'static str) -> Vec<PosedFace> {
    let manifest = std::fs::read_to_string(data.join("manifest.csv")).expect("DATA has a manifest.csv");
    let rows: Vec<Vec<String>> = manifest.lines().map(split_csv).collect();
    let column = |name: &str| rows[0].iter().position(|c| c == name).expect("a known column");
    let (file, label, completeness, licence) =
        (column("file"), column("label"), column("completeness"), column("licence"));
    rows[1..]
        .iter()
        .filter(|row| row[label] == "face" && row[completeness] == "whole" && row[file].contains(&format!("/{source}")))
        .filter(|row| ["MIT", "Apache-2.0", "CC0-1.0"].iter().any(|free| row[licence].starts_with(free)))
        .filter_map(|row| {
            let landmark = |name: &str| numbers(&row[column(name)]);
            posed(load(&data.join(&row[file])), LANDMARKS.map(landmark), source)
        })
        .collect()
}

fn split_csv(line: &str) -> Vec<String> {
    let mut fields = vec![String::new()];
    let mut quoted = false;
    for character in line.chars() {
        match character {
            '"' => quoted = !quoted,
            ',' if !quoted => fields.push(String::new()),
            other => fields.last_mut().expect("never empty").push(other),
        }
    }
    fields
}

fn numbers(field: &str) -> Option<Point3> {
    let values: Vec<f64> = field.split_whitespace().filter_map(|v| v.parse().ok()).collect();
    <[f64; 3]>::try_from(values).ok().map(Point3::from)
}

fn load(path: &Path) -> Mesh {
    let bytes = std::fs::read(path).expect("the model is there");
    let name = path.file_name().expect("a file").to_string_lossy();
    let surface = formats::read_surface(&name, &bytes, &formats::ReadLimits::default()).expect("a sound model");
    surface.mesh().expect("a mesh")
}

/// Lays the mesh onto the standard's landmarks by the least-squares similarity; `None` if it lacks one.
fn posed(mesh: Mesh, landmarks: [Option<Point3>; LANDMARKS.len()], source: &'static str) -> Option<PosedFace> {
    let named = |name: &str| landmarks[LANDMARKS.iter().position(|l| *l == name).expect("a known landmark")];
    let pairs: Vec<(Point3, Point3)> =
        POSING.iter().filter_map(|(name, place)| Some((named(name)?, Point3::from(*place)))).collect();
    if pairs.len() < POSING.len() {
        return None;
    }
    let count = pairs.len() as f64;
    let from = pairs.iter().map(|(p, _)| p.coords).sum::<Vector3>() / count;
    let to = pairs.iter().map(|(_, q)| q.coords).sum::<Vector3>() / count;
    let mut correlation = nalgebra::Matrix3::zeros();
    let mut spread = 0.0;
    for (p, q) in &pairs {
        correlation += (q.coords - to) * (p.coords - from).transpose();
        spread += (p.coords - from).norm_squared();
    }
    let rotation = se3::nearest_rotation(&correlation).to_rotation_matrix();
    let scale = (rotation.matrix().transpose() * correlation).trace() / spread;
    let place = |p: &Point3| Point3::from(rotation * (p.coords - from) * scale + to);
    let vertices = mesh.vertices.iter().map(place).collect();
    Some(PosedFace { mesh: Mesh { vertices, ..mesh }, landmarks: landmarks.map(|l| l.as_ref().map(place)), source })
}
