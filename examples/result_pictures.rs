//! The pictures of docs/RESULTS.md and README.md, of things that are made by code: `cargo run --example result_pictures -- FOLDER`.
//!
//! Objects are scanned by code, registered from given poses, and shown as the service would show them.

use std::path::{Path, PathBuf};

use visage::geometry::{Cloud, Point3, Surface, Unit};
use visage::picture::camera::Side;
use visage::picture::image::Image;
use visage::picture::size::Size;
use visage::pipeline::{self, NamedScan, Options, RegisteredModel};
use visage::progress::Progress;
use visage::report::found::Found;
use visage::report::{Kind, Made, Material, Wish, draw};
use visage::synthetic::head::{Proportions, head};
use visage::synthetic::scanner::{ScanSet, Scanner};
use visage::synthetic::shapes::{ScanOptions, catalogue, scan_set};
use visage::synthetic::truth::disturb;

/// Side of a picture that stands beside others, pixels.
const SIDE: u32 = 400;
/// The same where each pixel differs from the next, so that files stay small.
const SMALL: u32 = 280;
/// Exposures of the views of the coloured head.
const EXPOSURES: [f64; 8] = [1.0, 1.2, 0.8, 1.1, 0.85, 1.15, 0.9, 1.2];

/// Makes the pictures of one kind.
type Maker = fn() -> anyhow::Result<Vec<Image>>;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let Some(folder) = arguments.next().map(PathBuf::from) else { anyhow::bail!("result_pictures FOLDER [NAME]") };
    std::fs::create_dir_all(&folder)?;
    let only = arguments.next();
    let makers: [(&str, Maker); 5] =
        [("model", model), ("deviation", deviation), ("defaced", defaced), ("exposures", exposures), ("thin", thin)];
    for (name, make) in makers {
        if only.as_deref().is_none_or(|only| only == name) {
            write(&folder, name, &make()?)?;
        }
    }
    Ok(())
}

/// A head, scanned.
fn scanned() -> (Surface, ScanSet) {
    let truth = head(&Proportions::of(1)).mesh;
    let set = Scanner { resolution: 2.0, ..Scanner::default() }.scan_set(&truth, 1);
    (Surface { cloud: Cloud::from_points(truth.vertices), faces: truth.faces, ..Surface::default() }, set)
}

fn square(side: u32) -> Size {
    Size::clamped(side, side)
}

fn shaded(of: &Material, side: Side) -> anyhow::Result<Image> {
    picture(Kind::Thumbnail, of, Wish { size: square(SIDE), side, plane: None })
}

/// Scans in colours, a section, landmarks.
fn model() -> anyhow::Result<Vec<Image>> {
    let model = registered(&scanned().1, &Options::default())?;
    let (whole, points) = (of_mesh(&model, None)?, of_cloud(&model)?);
    let section = Wish { size: Size::clamped(420, SMALL), ..Wish::of(Kind::Section) };
    let small = |kind| Wish { size: square(SMALL), ..Wish::of(kind) };
    Ok(vec![
        picture(Kind::Views, &points, small(Kind::Views))?,
        picture(Kind::Section, &points, section)?,
        picture(Kind::Landmarks, &whole, small(Kind::Landmarks))?,
    ])
}

/// The mesh against the head that was scanned.
fn deviation() -> anyhow::Result<Vec<Image>> {
    let (truth, set) = scanned();
    let against = of_mesh(&registered(&set, &Options::default())?, Some(truth))?;
    let wide = Wish { size: Size::clamped(560, SIDE), side: Side::Front, plane: None };
    Ok(vec![picture(Kind::Deviation, &against, wide)?])
}

/// The head whole, and without its face.
fn defaced() -> anyhow::Result<Vec<Image>> {
    let set = scanned().1;
    let of = |deface| of_mesh(&registered(&set, &Options { deface, ..Options::default() })?, None);
    Ok(vec![shaded(&of(false)?, Side::Front)?, shaded(&of(true)?, Side::Front)?])
}

/// Scans of other brightness each, and the mesh that came of them.
fn exposures() -> anyhow::Result<Vec<Image>> {
    let coloured = registered(&painted(&scanned().1), &Options::default())?;
    let small = Wish { size: square(SMALL), side: Side::Left, plane: None };
    let of = [of_cloud(&coloured)?, of_mesh(&coloured, None)?];
    of.iter().map(|of| picture(Kind::Thumbnail, of, small)).collect()
}

/// Things with thin walls.
fn thin() -> anyhow::Result<Vec<Image>> {
    let of = |name: &str| {
        let shape = catalogue().into_iter().find(|shape| shape.name == name);
        let shape = shape.ok_or_else(|| anyhow::anyhow!("there is no shape {name}"))?;
        let set = scan_set(&shape, 16, &ScanOptions::default(), 1);
        shaded(&of_mesh(&registered(&set, &Options::default())?, None)?, Side::Default)
    };
    ["leaf", "mug", "crate"].into_iter().map(of).collect()
}

/// The scans from poses that are a little off.
fn registered(set: &ScanSet, options: &Options) -> anyhow::Result<RegisteredModel> {
    let names: Vec<String> = (0..set.scans.len()).map(|view| format!("scan_{view:02}.ply")).collect();
    let begin = names.iter().cloned().zip(disturb(&set.poses, 0.02, 1.5, 1)).collect();
    let scans = names.into_iter().zip(set.scans.clone()).map(|(name, surface)| NamedScan { name, surface }).collect();
    Ok(pipeline::run(scans, &begin, Unit::Mm, options, &Progress::silent())?)
}

/// The scans in colours, each with an exposure of its own.
fn painted(set: &ScanSet) -> ScanSet {
    let mut set = set.clone();
    for (view, (scan, pose)) in set.scans.iter_mut().zip(&set.poses).enumerate() {
        let exposure = EXPOSURES[view % EXPOSURES.len()];
        let color = |point: &Point3| {
            let place = pose * point;
            let grain = 1.0 + 0.1 * (0.21 * place.x).sin() * (0.17 * place.y).cos() * (0.19 * place.z).cos();
            let skin = if place.y > 75.0 { [92.0, 66.0, 48.0] } else { [196.0, 150.0, 122.0] };
            skin.map(|value: f64| (value * grain * exposure).round().clamp(0.0, 255.0) as u8)
        };
        scan.cloud.colors = Some(scan.cloud.points.iter().map(color).collect());
    }
    set
}

fn plain(model: &RegisteredModel) -> anyhow::Result<Material> {
    let report = serde_json::to_vec(&serde_json::json!({ "result": model.report.to_json() }))?;
    let found = Some(Found::read(&report)?);
    Ok(Material { signature: model.signature.clone(), found, unit: Unit::Mm, ..Material::default() })
}

fn of_mesh(model: &RegisteredModel, other: Option<Surface>) -> anyhow::Result<Material> {
    let made = model.mesh.as_ref().ok_or_else(|| anyhow::anyhow!("there is no mesh"))?;
    let cloud = Cloud { colors: made.surface.colors.clone(), ..Cloud::from_points(made.surface.mesh.vertices.clone()) };
    let surface = Surface { cloud, faces: made.surface.mesh.faces.clone(), ..Surface::default() };
    Ok(Material { surface, support: made.surface.support.clone(), other, ..plain(model)? })
}

fn of_cloud(model: &RegisteredModel) -> anyhow::Result<Material> {
    let merged = model.cloud.as_ref().ok_or_else(|| anyhow::anyhow!("there is no cloud"))?;
    let surface = Surface { cloud: merged.cloud.clone(), ..Surface::default() };
    Ok(Material { surface, views: Some(merged.views.clone()), ..plain(model)? })
}

fn picture(kind: Kind, of: &Material, wish: Wish) -> anyhow::Result<Image> {
    match draw(kind, of, &wish, &Progress::silent())? {
        Made::Image(image) => Ok(image),
        Made::Plot(drawing) => Ok(drawing.to_image()),
    }
}

/// Pictures beside each other, as one file.
fn write(folder: &Path, name: &str, pictures: &[Image]) -> anyhow::Result<()> {
    let width: u32 = pictures.iter().map(|picture| picture.size().width()).sum();
    let height = pictures.iter().map(|picture| picture.size().height()).max().unwrap_or(0);
    let mut sheet = Image::new(Size::clamped(width, height), visage::picture::color::GROUND);
    let mut left = 0;
    for picture in pictures {
        sheet.put(left, 0, picture);
        left += i64::from(picture.size().width());
    }
    let bytes = sheet.to_png()?;
    println!("{name}: {width} x {height}, {} kB", bytes.len() / 1000);
    Ok(std::fs::write(folder.join(format!("{name}.png")), bytes)?)
}
