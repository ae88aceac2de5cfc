//! Prints how well standards made of one model find the others of their class: two code-made classes, and, with the
//! folder of a labelled set (`manifest.csv`, `standard_head.ply`, `standard_face_landmarks.json`), faces.
//!
//! `cargo run --release --example standards [DATA]`

use std::path::Path;

use anyhow::Context;
use visage::formats::{self, ReadLimits};
use visage::geometry::{Cloud, Mesh, Motion, Point3, Surface, Unit, Vector3};
use visage::progress::Progress;
use visage::standards::limit::{Learned, NOTHING_FOUND_MM, learn};
use visage::standards::{Annotation, CornerChoice, Landmark, Standard};
use visage::synthetic::{objects, shapes};

/// Instances of the class, and of each other shape.
const INSTANCES: u64 = 30;
const OTHERS_EACH: u64 = 3;

/// Where a landmark is: the vertex that lies farthest in some sense.
type Farthest = (&'static str, fn(&Point3) -> f64);

fn main() -> anyhow::Result<()> {
    println!(
        "| class | models of it | others | AUC | worst of it, mm | best other, mm | limit, mm | left out, right |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    let teapot: &[Farthest] = &[("spout", |p| p.y - p.x), ("knob", |p| p.y - 2.0 * p.x.abs()), ("handle", |p| p.x)];
    let animal: &[Farthest] = &[
        ("nose", |p| p.x),
        ("tail", |p| p.y - 2.0 * p.x),
        ("ear_left", |p| p.y + 0.5 * p.z),
        ("ear_right", |p| p.y - 0.5 * p.z),
    ];
    for (name, places) in [("teapot", teapot), ("animal", animal)] {
        code_made(name, places)?;
    }
    match std::env::args().nth(1) {
        Some(folder) => faces(Path::new(&folder)),
        None => Ok(()),
    }
}

fn code_made(name: &str, places: &[Farthest]) -> anyhow::Result<()> {
    let catalogue = shapes::catalogue();
    let shape = catalogue.iter().find(|shape| shape.name == name).context("no such shape")?;
    let model = shape.mesh(1);
    let farthest = |far: fn(&Point3) -> f64| model.vertices.iter().copied().max_by(|a, b| far(a).total_cmp(&far(b)));
    let landmark = |(name, far): &Farthest| Some(Landmark { name: (*name).to_owned(), place: farthest(*far)? });
    let landmarks = places.iter().filter_map(landmark).collect();
    let annotation = Annotation { landmarks, triangle: None };
    let standard = Standard::annotated(&turned(model.clone(), 0), Unit::Mm, &annotation, &Progress::silent())?;
    let judged = |mesh: Mesh, seed: u64| residual(&standard, &turned(mesh, seed));
    let of_class: Vec<f64> = (0..INSTANCES).map(|seed| judged(shape.mesh(2 + seed), 1 + seed)).collect();
    let mut others: Vec<f64> = catalogue
        .iter()
        .filter(|other| other.name != name)
        .flat_map(|other| (0..OTHERS_EACH).map(move |seed| (other, 100 + seed)))
        .map(|(other, seed)| judged(other.mesh(seed), seed))
        .collect();
    others.push(judged(objects::jug().mesh, 7));
    print_row(name, &of_class, &others);
    Ok(())
}

/// The mesh as a surface, turned and moved by a seed; 0 leaves it as it is.
fn turned(mesh: Mesh, seed: u64) -> Surface {
    let angle = seed as f64;
    let turn = Vector3::new(2.0 * (1.7 * angle).sin(), 2.0 * (2.9 * angle).sin(), 2.0 * (0.6 * angle).sin());
    let motion = Motion::new(Vector3::new(angle, -2.0 * angle, 0.5 * angle), turn);
    Surface { cloud: Cloud::from_points(mesh.vertices).moved(&motion), faces: mesh.faces, ..Surface::default() }
}

/// As a model of unknown unit is judged.
fn residual(standard: &Standard, surface: &Surface) -> f64 {
    let found = standard.find(surface, Unit::Unknown, &Progress::silent()).ok().flatten();
    found.map_or(NOTHING_FOUND_MM, |found| found.residual_mm)
}

fn print_row(name: &str, of_class: &[f64], others: &[f64]) {
    let Learned { limit_mm, auc, leave_one_out, .. } = learn(of_class, others);
    let worst = of_class.iter().copied().fold(0.0, f64::max);
    let best = others.iter().copied().fold(f64::INFINITY, f64::min);
    let left_out = leave_one_out.map_or_else(String::new, |l| format!("{} of {}", l.right, l.of));
    println!(
        "| {name} | {} | {} | {:.3} | {worst:.2} | {best:.2} | {limit_mm:.2} | {left_out} |",
        of_class.len(),
        others.len(),
        auc.unwrap_or(f64::NAN)
    );
}

/// The rows of the manifest with ambiguous = 0, against a standard made of the head with its landmarks.
fn faces(folder: &Path) -> anyhow::Result<()> {
    let landmarks = landmarks(folder)?;
    let corners =
        ["eye_r_inner", "eye_l_inner", "nose_tip"].map(|name| CornerChoice { name: name.to_owned(), kind: None });
    let head = read(folder, "standard_head.ply")?;
    let manifest = String::from_utf8(bytes(folder, "manifest.csv")?).context("manifest.csv is no text")?;
    let rows: Vec<(&str, bool)> = manifest.lines().skip(1).filter_map(parsed).collect();
    for (name, triangle) in
        [("face, corners chosen by the program", None), ("face, eye corners and nose", Some(corners))]
    {
        let annotation = Annotation { landmarks: landmarks.clone(), triangle };
        let standard = Standard::annotated(&head, Unit::Mm, &annotation, &Progress::silent())?;
        let (mut of_class, mut others) = (Vec::new(), Vec::new());
        for (file, is_face) in &rows {
            let list = if *is_face { &mut of_class } else { &mut others };
            list.push(residual(&standard, &read(folder, file)?));
        }
        print_row(name, &of_class, &others);
    }
    Ok(())
}

/// File and label of a row that is not ambiguous; the fields before have no commas.
fn parsed(line: &str) -> Option<(&str, bool)> {
    let fields: Vec<&str> = line.split(',').collect();
    (*fields.get(4)? == "0").then_some((*fields.first()?, *fields.get(1)? == "face"))
}

fn landmarks(folder: &Path) -> anyhow::Result<Vec<Landmark>> {
    let file: serde_json::Value = serde_json::from_slice(&bytes(folder, "standard_face_landmarks.json")?)?;
    let places = file["landmarks"].as_object().context("the landmark file has no landmarks")?;
    let landmark = |(name, place): (&String, &serde_json::Value)| {
        let place: [f64; 3] = serde_json::from_value(place.clone())?;
        Ok(Landmark { name: name.clone(), place: Point3::from(place) })
    };
    places.iter().map(landmark).collect()
}

fn read(folder: &Path, file: &str) -> anyhow::Result<Surface> {
    Ok(formats::read_surface(file, &bytes(folder, file)?, &ReadLimits::default())?)
}

fn bytes(folder: &Path, file: &str) -> anyhow::Result<Vec<u8>> {
    std::fs::read(folder.join(file))
        .with_context(|| format!("{}: give the folder of the labelled set that holds {file}", folder.display()))
}
