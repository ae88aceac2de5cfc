//! The pictures of docs/RESULTS.md and README.md, of things that are made by code:
//! `cargo run --release --example result_pictures -- FOLDER [NAME [PEER]]`.
//!
//! Objects are scanned by code, registered from given poses, and shown as the service would show them. Into the folder PEER `thin`
//! writes the clouds of its things, `leaf.ply` and so on; where that has another program's meshes of them, `leaf_peer.ply` and so on,
//! they are drawn beside ours.

use std::path::{Path, PathBuf};

use visage::formats::{ReadLimits, ply, read_surface};
use visage::geometry::{Bounds, Cloud, Point3, Surface, Unit};
use visage::picture::camera::Side;
use visage::picture::color::INK;
use visage::picture::drawing::Drawing;
use visage::picture::image::Image;
use visage::picture::size::Size;
use visage::pipeline::{self, NamedScan, Options, RegisteredModel};
use visage::progress::Progress;
use visage::report::found::Found;
use visage::report::material::Axis;
use visage::report::{Kind, Made, Material, Wish, draw};
use visage::synthetic::head::{Proportions, head};
use visage::synthetic::scanner::{ScanSet, Scanner};
use visage::synthetic::shapes::{ScanOptions, catalogue, scan_set};
use visage::synthetic::truth::disturb;

/// Side of a picture that stands beside others, pixels.
const SIDE: u32 = 400;
/// The same where each pixel differs from the next, so that files stay small.
const SMALL: u32 = 280;
/// Side of one picture of a thin thing, pixels.
const THIN: u32 = 240;
/// Exposures of the views of the coloured head.
const EXPOSURES: [f64; 8] = [1.0, 1.2, 0.8, 1.1, 0.85, 1.15, 0.9, 1.2];

/// Makes the pictures of one kind, in rows; for some of them there is a folder with other programs' results.
type Maker = fn(Option<&Path>) -> anyhow::Result<Vec<Vec<Image>>>;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let Some(folder) = arguments.next().map(PathBuf::from) else {
        anyhow::bail!("result_pictures FOLDER [NAME [PEER]]")
    };
    std::fs::create_dir_all(&folder)?;
    let (only, peer) = (arguments.next(), arguments.next().map(PathBuf::from));
    let makers: [(&str, Maker); 5] =
        [("model", model), ("deviation", deviation), ("defaced", defaced), ("exposures", exposures), ("thin", thin)];
    for (name, make) in makers {
        if only.as_deref().is_none_or(|only| only == name) {
            write(&folder, name, &make(peer.as_deref())?)?;
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
fn model(_: Option<&Path>) -> anyhow::Result<Vec<Vec<Image>>> {
    let model = registered(&scanned().1, &Options::default())?;
    let (whole, points) = (of_mesh(&model, None)?, of_cloud(&model)?);
    let section = Wish { size: Size::clamped(420, SMALL), ..Wish::of(Kind::Section) };
    let small = |kind| Wish { size: square(SMALL), ..Wish::of(kind) };
    Ok(vec![vec![
        picture(Kind::Views, &points, small(Kind::Views))?,
        picture(Kind::Section, &points, section)?,
        picture(Kind::Landmarks, &whole, small(Kind::Landmarks))?,
    ]])
}

/// The mesh against the head that was scanned.
fn deviation(_: Option<&Path>) -> anyhow::Result<Vec<Vec<Image>>> {
    let (truth, set) = scanned();
    let against = of_mesh(&registered(&set, &Options::default())?, Some(truth))?;
    let wide = Wish { size: Size::clamped(560, SIDE), side: Side::Front, plane: None };
    Ok(vec![vec![picture(Kind::Deviation, &against, wide)?]])
}

/// The head whole, and without its face.
fn defaced(_: Option<&Path>) -> anyhow::Result<Vec<Vec<Image>>> {
    let set = scanned().1;
    let of = |deface| of_mesh(&registered(&set, &Options { deface, ..Options::default() })?, None);
    Ok(vec![vec![shaded(&of(false)?, Side::Front)?, shaded(&of(true)?, Side::Front)?]])
}

/// Scans of other brightness each, and the mesh that came of them.
fn exposures(_: Option<&Path>) -> anyhow::Result<Vec<Vec<Image>>> {
    let coloured = registered(&painted(&scanned().1), &Options::default())?;
    let small = Wish { size: square(SMALL), side: Side::Left, plane: None };
    let of = [of_cloud(&coloured)?, of_mesh(&coloured, None)?];
    Ok(vec![of.iter().map(|of| picture(Kind::Thumbnail, of, small)).collect::<anyhow::Result<_>>()?])
}

/// Things with thin walls, ours and a peer's: as a whole, and cut through.
fn thin(peer: Option<&Path>) -> anyhow::Result<Vec<Vec<Image>>> {
    [("leaf", Axis::X), ("mug", Axis::Y), ("crate", Axis::Y)]
        .map(|(name, axis)| thing(name, axis, peer))
        .into_iter()
        .collect()
}

fn thing(name: &str, axis: Axis, peer: Option<&Path>) -> anyhow::Result<Vec<Image>> {
    let shape = catalogue().into_iter().find(|shape| shape.name == name);
    let shape = shape.ok_or_else(|| anyhow::anyhow!("there is no shape {name}"))?;
    let model = registered(&scan_set(&shape, 16, &ScanOptions::default(), 1), &Options::default())?;
    let mut found = vec![of_mesh(&model, None)?];
    if let (Some(folder), Some(merged)) = (peer, &model.cloud) {
        std::fs::write(folder.join(format!("{name}.ply")), ply::write_cloud(&merged.cloud, None))?;
        if let Ok(bytes) = std::fs::read(folder.join(format!("{name}_peer.ply"))) {
            let surface = read_surface("peer.ply", &bytes, &ReadLimits::default())?;
            found.push(Material { surface, ..plain(&model)? });
        }
    }
    let bounds = found[0].surface.cloud.bounds().ok_or_else(|| anyhow::anyhow!("{name} has no surface"))?;
    let whole =
        found.iter().map(|of| picture(Kind::Thumbnail, of, Wish { size: square(THIN), ..Wish::of(Kind::Thumbnail) }));
    let cut = found.iter().map(|of| Ok(outline(&of.surface, axis, &bounds)));
    whole.chain(cut).collect()
}

/// Where a plane through the middle of `bounds`, square to an axis, cuts a surface.
fn outline(surface: &Surface, axis: Axis, bounds: &Bounds) -> Image {
    let (middle, axis) = (bounds.center(), axis as usize);
    let (right, up) = ((axis + 1) % 3, (axis + 2) % 3);
    let extent = bounds.max - bounds.min;
    let scale = 0.9 * f64::from(THIN) / extent[right].max(extent[up]);
    let pixel = |point: &Point3| {
        let half = f64::from(THIN) / 2.0;
        [half + scale * (point[right] - middle[right]), half - scale * (point[up] - middle[up])]
    };
    let mut drawing = Drawing::new(square(THIN));
    for face in &surface.faces {
        let corners = face.map(|vertex| surface.cloud.points[vertex as usize]);
        let crossed: Vec<[f64; 2]> = (0..3)
            .filter_map(|k| {
                let (p, q) = (corners[k], corners[(k + 1) % 3]);
                let (a, b) = (p[axis] - middle[axis], q[axis] - middle[axis]);
                ((a < 0.0) != (b < 0.0)).then(|| pixel(&(p + (q - p) * (a / (a - b)))))
            })
            .collect();
        if let [from, to] = crossed[..] {
            drawing.line(from, to, 1.5, INK);
        }
    }
    drawing.to_image()
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

/// Rows of pictures beside each other, as one file.
fn write(folder: &Path, name: &str, rows: &[Vec<Image>]) -> anyhow::Result<()> {
    let width_of = |row: &Vec<Image>| row.iter().map(|picture| picture.size().width()).sum::<u32>();
    let height_of = |row: &Vec<Image>| row.iter().map(|picture| picture.size().height()).max().unwrap_or(0);
    let width = rows.iter().map(width_of).max().unwrap_or(0);
    let height = rows.iter().map(height_of).sum();
    let mut sheet = Image::new(Size::clamped(width, height), visage::picture::color::GROUND);
    let mut top = 0;
    for row in rows {
        let mut left = 0;
        for picture in row {
            sheet.put(left, top, picture);
            left += i64::from(picture.size().width());
        }
        top += i64::from(height_of(row));
    }
    let bytes = sheet.to_png()?;
    println!("{name}: {width} x {height}, {} kB", bytes.len() / 1000);
    Ok(std::fs::write(folder.join(format!("{name}.png")), bytes)?)
}
