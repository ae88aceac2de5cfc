//! From the merged cloud of placed scans to a surface: one skin where scans overlap, holes closed as far as is wanted.
//!
//! 1. [`samples`]: the points are averaged, cell by cell and side by side
//! 2. [`field`]: near them the signed distance is the mean of their planes
//! 3. [`coarse`]: which side is outside, over all of space; what scanners looked through is ([`free_space`])
//! 4. [`levels`]: between data the field is carried on, from coarse to fine, wherever the surface passes
//! 5. [`extract`]: the surface where the field is zero, closed and manifold ([`cubes`]), finer where it bends ([`refine`])
//! 6. [`trim`]: what nobody saw is cut off, but for what is to be closed; [`colors`]
//!
//! The resolution is the scans' own: the edge of a cell goes with the spacing of a single scan and the cube root of the
//! [`noise`]. Finer cells follow the noise: points that were left out of the input lie farther from the surface again.

pub mod balance;
pub mod coarse;
pub mod colors;
pub mod components;
pub mod cubes;
pub mod extract;
pub mod field;
pub mod free_space;
pub mod grid;
pub mod layers;
pub mod levels;
pub mod mask;
pub mod noise;
pub mod refine;
pub mod rims;
pub mod samples;
pub mod simple;
pub mod topology;
pub mod trim;

use self::field::FIELD_BYTES;
use self::free_space::FreeSpace;
use self::samples::{Frame, Samples};
pub use self::trim::Fill;
use visage_geometry::progress::{Canceled, Progress, Stage};
use visage_geometry::{Bounds, Cloud, Mesh};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Edge of a cell, in spacings, of points whose noise is the usual one. With 2.0 and the same reach detail is a little coarser than
        /// that of the best rival, with 1.8 hardly finer than this for 5 % more time (docs/results/surface.md).
        cell: f64 = 1.85,
        /// Noise in spacings: that of laser scans at their own resolution.
        usual_noise: f64 = 0.13,
        /// The error of a local fit is least where its variance, noise^2 / width^2, and its squared bias, width^4, grow alike: the
        /// width goes with the cube root of the noise.
        power: f64 = 1.0 / 3.0,
        /// A cell has at least and at most so many spacings: below holes open between points, beyond detail is lost that the many
        /// points of a noisy scan do show.
        cells: [f64; 2] = [1.67, 4.0],
        /// Of an unseen patch that counts as small no place is farther than this from data, in spacings: what a scanner looked
        /// through is known from that far on (`sensor/looked_through.rs`), and nobody may invent surface there.
        small: f64 = 5.0,
        /// A neck that nobody saw is cut where that takes no more than so many spacings. With 10 a false handle of the simulated
        /// heads stays; with 40 one of the buddha's more goes, and a ring that is the object's could.
        widest_cut: f64 = 20.0,
        /// By how much a cell is widened if the grid would take more memory than it may.
        wider: f64 = 1.25,
    }
}

/// What is wanted of a surface.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceOptions<'a> {
    /// What becomes of holes.
    pub fill: Fill,
    /// Memory that the grid may take (bytes); beyond it the cells become wider.
    pub max_bytes: u64,
    /// For each point the view that it is of, if that is known: colours of views are made equally bright.
    pub views: Option<&'a [u16]>,
    /// What scanners looked through, if that is known: surface that nobody saw does not reach into it.
    pub free_space: Option<&'a FreeSpace>,
}

impl Default for SurfaceOptions<'_> {
    fn default() -> Self {
        SurfaceOptions { fill: Fill::default(), max_bytes: 2 << 30, views: None, free_space: None }
    }
}

/// A surface with what is known of it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Reconstruction {
    /// Triangles, counter-clockwise seen from outside, in the frame and unit of the cloud.
    pub mesh: Mesh,
    /// For each vertex how many points it is the mean of, about; 0 where nobody saw it.
    pub support: Vec<f32>,
    /// For each vertex its colour, if the cloud has colours.
    pub colors: Option<Vec<[u8; 3]>>,
    /// How it came about.
    pub report: SurfaceReport,
}

/// How a surface came about.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SurfaceReport {
    /// Edge of a cell of the grid, a length: finer detail is averaged.
    pub cell: f64,
    /// Standard deviation of the points from the surface, a length; scans that lie apart where they overlap count. 0 if
    /// there are too few points to say.
    #[serde(default)]
    pub noise: f64,
    /// Whether cells were widened to stay within the memory that was allowed.
    pub widened: bool,
    /// Vertices.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Unseen patches that were closed.
    pub closed_holes: usize,
    /// Unseen patches that were left open.
    pub open_holes: usize,
    /// Pieces that were too small to be told from outliers.
    pub dropped_pieces: usize,
    /// Share of the surface's area that nobody saw.
    pub unseen_area: f64,
}

/// The surface of a cloud whose normals point outward; `spacing` is that of a single scan. `None` if the cloud has no
/// normals, or makes no surface.
///
/// # Errors
/// [`Canceled`], between steps.
pub fn reconstruct(
    cloud: &Cloud,
    spacing: f64,
    options: &SurfaceOptions,
    progress: &Progress,
) -> Result<Option<Reconstruction>, Canceled> {
    let at = |share: f64| {
        progress.report(Stage::Merging, share);
        progress.check()
    };
    at(0.0)?;
    let (Some(bounds), Some(normals)) = (Bounds::of(&cloud.points), cloud.normals.as_ref()) else { return Ok(None) };
    if !(spacing > 0.0 && spacing.is_finite()) {
        return Ok(None);
    }
    // coordinates of nodes are kept in 17 bits of blocks
    let extent = (bounds.max - bounds.min).amax();
    let least = extent / f64::from(grid::MOST_NODES);
    let noise = noise::noise(&Frame::around(&bounds, (TUNING.cell * spacing).max(least)), cloud);
    let wanted = noise.map_or(TUNING.cell, |noise| {
        (TUNING.cell * (noise / (TUNING.usual_noise * spacing)).powf(TUNING.power))
            .clamp(TUNING.cells[0], TUNING.cells[1])
    }) * spacing;
    let mut cell = wanted.max(least);
    if !cell.is_finite() {
        return Ok(None);
    }
    let (frame, samples) = loop {
        let frame = Frame::around(&bounds, cell);
        let samples = Samples::of(&frame, &cloud.points, normals);
        if samples.blocks.keys().len() as u64 * FIELD_BYTES <= options.max_bytes {
            break (frame, samples);
        }
        at(0.0)?;
        cell *= TUNING.wider;
    };
    at(0.2)?;
    let field = field::field(&samples);
    at(0.5)?;
    let is_free = |place: &[f32; 3]| options.free_space.is_some_and(|free| free.holds(&frame.world(place)));
    let mut coarse = coarse::sides(&samples, &frame.size);
    coarse.keep_out(&is_free);
    at(0.6)?;
    let mut volume = levels::volume(&field, &coarse, &is_free);
    drop(field);
    at(0.8)?;
    extract::close(&mut volume);
    if options.fill != Fill::None {
        let cells = |spacings: f64| spacings * spacing / cell;
        // nearer than that what was looked through is not known
        let outside = if options.fill == Fill::All { cells(TUNING.small).round() as usize } else { 1 };
        let doubt =
            topology::Doubt { widest: cells(TUNING.widest_cut) as f32, outside: outside.max(1), is_free: &is_free };
        let changed = topology::simplify(&mut volume, &doubt);
        extract::close_around(&mut volume, changed);
    }
    let closed = extract::extract(&volume);
    drop(volume);
    at(0.9)?;
    let kept = trim::trim(closed, &samples, options.fill, (TUNING.small * spacing / cell) as f32);
    if kept.triangles.faces.is_empty() {
        return Ok(None);
    }
    let unseen_area = kept.triangles.unseen_area();
    let trim::Kept { triangles, closed, open, dropped } = kept;
    let report = SurfaceReport {
        cell,
        noise: noise.unwrap_or(0.0),
        widened: cell > wanted,
        vertices: triangles.vertices.len(),
        triangles: triangles.faces.len(),
        closed_holes: closed,
        open_holes: open,
        dropped_pieces: dropped,
        unseen_area,
    };
    let colors = colors::colors(&frame, cloud, options.views, &triangles.vertices);
    let vertices = triangles.vertices.iter().map(|place| frame.world(place)).collect();
    let mesh = Mesh { vertices, faces: triangles.faces };
    Ok(Some(Reconstruction { mesh, support: triangles.support, colors, report }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;
    use visage_geometry::{Point3, Vector3};

    /// Points spread evenly over a sphere of radius 10, as far as `is_seen`.
    fn sphere(count: usize, is_seen: impl Fn(&Vector3) -> bool) -> Cloud {
        let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let direction = |k: usize| {
            let z = 1.0 - 2.0 * (k as f64 + 0.5) / count as f64;
            let (sine, cosine) = (golden * k as f64).sin_cos();
            let radius = (1.0 - z * z).sqrt();
            Vector3::new(radius * cosine, radius * sine, z)
        };
        let directions: Vec<Vector3> = (0..count).map(direction).filter(is_seen).collect();
        Cloud {
            points: directions.iter().map(|d| Point3::from(10.0 * d)).collect(),
            normals: Some(directions.iter().map(|d| d.cast()).collect()),
            ..Cloud::default()
        }
    }

    /// Spacing of the sphere's points.
    fn spacing(count: usize) -> f64 {
        10.0 * (4.0 * std::f64::consts::PI / count as f64).sqrt()
    }

    fn surface(cloud: &Cloud, count: usize, fill: Fill) -> Reconstruction {
        let options = SurfaceOptions { fill, ..SurfaceOptions::default() };
        reconstruct(cloud, spacing(count), &options, &Progress::silent()).expect("not canceled").expect("a surface")
    }

    /// Edges by how many triangles they are of; each must be passed as often in one direction as in the other.
    fn edges(mesh: &Mesh) -> BTreeMap<[u32; 2], (usize, i32)> {
        let mut found: BTreeMap<[u32; 2], (usize, i32)> = BTreeMap::new();
        for face in &mesh.faces {
            for k in 0..3 {
                let (a, b) = (face[k], face[(k + 1) % 3]);
                let entry = found.entry([a.min(b), a.max(b)]).or_default();
                *entry = (entry.0 + 1, entry.1 + if a < b { 1 } else { -1 });
            }
        }
        found
    }

    fn is_closed_manifold(mesh: &Mesh) -> bool {
        edges(mesh).values().all(|(count, direction)| (*count, *direction) == (2, 0))
    }

    fn euler(mesh: &Mesh) -> i64 {
        mesh.vertices.len() as i64 - edges(mesh).len() as i64 + mesh.faces.len() as i64
    }

    #[test]
    fn a_sphere_is_closed_manifold_outward_and_where_it_should_be() {
        let count = 8000;
        let found = surface(&sphere(count, |_| true), count, Fill::Small);
        assert!(is_closed_manifold(&found.mesh) && euler(&found.mesh) == 2);
        assert!(found.mesh.signed_volume_6() > 0.0);
        let farthest = found.mesh.vertices.iter().map(|v| (v.coords.norm() - 10.0).abs()).fold(0.0, f64::max);
        assert!(farthest < 0.1 * spacing(count), "{} spacings", farthest / spacing(count));
        assert_eq!((found.report.unseen_area, found.report.closed_holes), (0.0, 0));
    }

    #[test]
    fn a_wide_hole_is_left_open_and_closed_when_all_are() {
        let count = 8000;
        // the cap beyond 37 degrees of the pole was not seen: it is some 33 spacings wide
        let cloud = sphere(count, |direction| direction.z < 0.8);
        let open = surface(&cloud, count, Fill::Small);
        assert_eq!(open.report.open_holes, 1);
        let highest = open.mesh.vertices.iter().map(|v| v.z).fold(0.0, f64::max);
        // what is there is carried on by no more than the reach of the field
        assert!((7.9..9.3).contains(&highest), "{highest}");
        assert!(edges(&open.mesh).values().all(|(count, direction)| *count == 1 || (*count, *direction) == (2, 0)));
        let closed = surface(&cloud, count, Fill::All);
        assert!(is_closed_manifold(&closed.mesh) && euler(&closed.mesh) == 2);
        assert!(closed.report.unseen_area > 0.05, "{:?}", closed.report);
        let invented = closed.support.iter().filter(|support| **support == 0.0).count();
        assert!(invented > 30, "what nobody saw says so: {invented}");
    }

    #[test]
    fn a_narrow_hole_is_closed_unless_none_is() {
        let count = 8000;
        let width = 4.2 * spacing(count) / 10.0;
        let cloud = sphere(count, |direction| direction.z < width.cos());
        let closed = surface(&cloud, count, Fill::Small);
        assert!(is_closed_manifold(&closed.mesh), "{:?}", closed.report);
        let open = surface(&cloud, count, Fill::None);
        assert!(!is_closed_manifold(&open.mesh), "{:?}", open.report);
    }

    #[test]
    fn both_sides_of_a_thin_wall_stay() {
        // a plate of 40 x 40 whose sides are 3 apart, in points of spacing 1
        let side = |z: f64| (0..1600).map(move |k| Point3::new(f64::from(k % 40), f64::from(k / 40), z));
        let cloud = Cloud {
            points: side(0.0).chain(side(3.0)).collect(),
            normals: Some([-1.0f32, 1.0].iter().flat_map(|z| vec![nalgebra::Vector3::z() * *z; 1600]).collect()),
            ..Cloud::default()
        };
        let found = reconstruct(&cloud, 1.0, &SurfaceOptions::default(), &Progress::silent())
            .expect("not canceled")
            .expect("a surface");
        let middle = |v: &&Point3| (5.0..35.0).contains(&v.x) && (5.0..35.0).contains(&v.y);
        let heights: Vec<f64> = found.mesh.vertices.iter().filter(middle).map(|v| v.z).collect();
        assert!(heights.iter().all(|z| z.abs() < 0.1 || (z - 3.0).abs() < 0.1), "nothing between the sides");
        assert!(heights.iter().any(|z| *z < 1.0) && heights.iter().any(|z| *z > 2.0));
    }

    #[test]
    fn a_surface_is_the_same_for_any_number_of_threads_and_fits_into_less_memory() {
        let count = 8000;
        let cloud = sphere(count, |direction| direction.z < 0.8);
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| surface(&cloud, count, Fill::All))
        };
        assert_eq!(with(1), with(3));
        let options = SurfaceOptions { max_bytes: 20 * FIELD_BYTES, ..SurfaceOptions::default() };
        let coarse = reconstruct(&cloud, spacing(count), &options, &Progress::silent()).expect("not canceled");
        let coarse = coarse.expect("a surface").report;
        assert!(coarse.widened && coarse.cell > 1.2 * TUNING.cell * spacing(count), "{coarse:?}");
    }

    #[test]
    fn what_has_no_normals_or_no_extent_makes_no_surface() {
        let silent = Progress::silent();
        let bare = Cloud::from_points(vec![Point3::origin(); 10]);
        assert_eq!(reconstruct(&bare, 1.0, &SurfaceOptions::default(), &silent), Ok(None));
        let pointing = Cloud { normals: Some(vec![nalgebra::Vector3::z(); 10]), ..bare };
        for spacing in [0.0, f64::NAN, f64::INFINITY] {
            assert_eq!(reconstruct(&pointing, spacing, &SurfaceOptions::default(), &silent), Ok(None), "{spacing}");
        }
    }
}
