//! Small files made by code.

use serde_json::{Value, json};

/// An ASCII PLY cloud of `points` points that are all different.
pub fn ply(points: usize) -> Vec<u8> {
    let mut text = header(points);
    for index in 0..points {
        let t = index as f64 * 0.1;
        text.push_str(&format!("{} {} {}\n", t.sin() * 10.0, t.cos() * 10.0, t));
    }
    text.into_bytes()
}

/// The header of an ASCII PLY cloud.
pub fn header(points: usize) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex {points}\nproperty float x\nproperty float y\nproperty float z\n\
         end_header\n"
    )
}

/// A pose file with the identity for each name.
pub fn poses(names: &[String]) -> String {
    let identity = json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]);
    let map: serde_json::Map<String, Value> = names.iter().map(|name| (name.clone(), identity.clone())).collect();
    Value::Object(map).to_string()
}

/// A sphere of 80 mm with bumps, as an OBJ mesh; other phases give other shapes.
pub fn bumpy_sphere(phase: f64) -> Vec<u8> {
    ball(80.0, |polar, azimuth| 80.0 + 6.0 * (3.0 * polar + phase).sin() * (4.0 * azimuth - phase).cos() * polar.sin())
}

/// A ball with three knobs whose tips are at the places given, as an OBJ mesh.
pub fn knobbed_ball(tips: [[f64; 3]; 3]) -> Vec<u8> {
    ball(50.0, |polar, azimuth| {
        let direction = [polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()];
        let knob = |tip: &[f64; 3]| {
            let length = tip.iter().map(|x| x * x).sum::<f64>().sqrt();
            let cosine = tip.iter().zip(&direction).map(|(a, b)| a * b).sum::<f64>() / length;
            (length - 50.0) * ((cosine - 1.0) / 0.1).exp()
        };
        50.0 + tips.iter().map(knob).sum::<f64>()
    })
}

/// A body around the origin by its radius over polar angle and azimuth, as an OBJ mesh; at the poles it is `pole`.
fn ball(pole: f64, radius: impl Fn(f64, f64) -> f64) -> Vec<u8> {
    const ROWS: usize = 48;
    const COLUMNS: usize = 64;
    let mut text = format!("v 0 0 {pole}\n");
    for row in 1..ROWS {
        let polar = std::f64::consts::PI * row as f64 / ROWS as f64;
        for column in 0..COLUMNS {
            let azimuth = std::f64::consts::TAU * column as f64 / COLUMNS as f64;
            let radius = radius(polar, azimuth);
            let (x, y) = (radius * polar.sin() * azimuth.cos(), radius * polar.sin() * azimuth.sin());
            text.push_str(&format!("v {x} {y} {}\n", radius * polar.cos()));
        }
    }
    text.push_str(&format!("v 0 0 -{pole}\n"));
    let vertex = |row: usize, column: usize| 2 + (row - 1) * COLUMNS + column % COLUMNS;
    let last = 2 + (ROWS - 1) * COLUMNS;
    for column in 0..COLUMNS {
        text.push_str(&format!("f 1 {} {}\n", vertex(1, column), vertex(1, column + 1)));
        text.push_str(&format!("f {last} {} {}\n", vertex(ROWS - 1, column + 1), vertex(ROWS - 1, column)));
    }
    for row in 1..ROWS - 1 {
        for column in 0..COLUMNS {
            let (a, b) = (vertex(row, column), vertex(row, column + 1));
            let (c, d) = (vertex(row + 1, column + 1), vertex(row + 1, column));
            text.push_str(&format!("f {a} {d} {c}\nf {a} {c} {b}\n"));
        }
    }
    text.into_bytes()
}

/// A mesh as an OBJ file.
pub fn obj(mesh: &visage::geometry::Mesh) -> Vec<u8> {
    let vertices = mesh.vertices.iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
    let faces = mesh.faces.iter().map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1));
    vertices.chain(faces).collect::<String>().into_bytes()
}
