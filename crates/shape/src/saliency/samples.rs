//! A surface as evenly spread oriented points, one a cell: what the density of the file's vertices was
//! no longer matters.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use rayon::prelude::*;

use super::cells::CellGrid;
use visage_geometry::{Bounds, Mesh, Point3, Vector3};

/// One point for each cell of edge `spacing` that the surface passes through.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Samples {
    /// Area-weighted mean positions.
    pub points: Vec<Point3>,
    /// Unit normals.
    pub normals: Vec<Vector3>,
    /// The area of the surface inside the cell (for clouds: of one cell's face).
    pub areas: Vec<f64>,
    /// The edge of a cell.
    pub spacing: f64,
}

/// Samples, and for each input point the sample that it went into.
#[derive(Debug, Clone)]
pub(super) struct Gathered {
    pub samples: Samples,
    pub cell_of: Vec<u32>,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Pieces of a face are no longer than this, in cells: some four of them meet in a cell.
        piece_in_cells: f64 = 0.5,
        /// All faces together are cut into about so many pieces at most. Every face that is no sliver has enough of them: no
        /// level is asked for where the surface would pass through more cells than a few of these for each.
        all_pieces: f64 = 3e7,
        /// No face is cut into more rows, or a row into more pieces: such a face is larger than any grid that is asked for.
        most_pieces: f64 = 4096.0,
        /// Marks the key of a cell's second sample; the three coordinates take 21 bits each.
        second: u64 = 1 << 63,
    }
}

impl Samples {
    /// Samples of a mesh by area: large faces are cut into pieces, so faces and vertices of any size do. Normals are
    /// those of the faces in a cell, weighted by area, so that they don't depend on where the faces have their
    /// vertices. Cells where the surface passes twice with opposite normals (a thin wall) give two samples.
    pub fn from_mesh(mesh: &Mesh, spacing: f64) -> Samples {
        Samples::from_part(mesh, spacing, |_| true)
    }

    /// Samples of that part of a mesh where `keep` holds, of faces with a corner there; see [`Samples::from_mesh`].
    pub fn from_part(mesh: &Mesh, spacing: f64, keep: impl Fn(&Point3) -> bool) -> Samples {
        let mut cells = Cells::new(spacing, mesh.bounds());
        let touches = |face: &[u32; 3]| face.iter().any(|&v| keep(&mesh.vertices[v as usize]));
        let touching = || mesh.faces.iter().enumerate().filter(|(_, face)| touches(face)).map(|(index, _)| index);
        let longest = TUNING.piece_in_cells * spacing;
        let (mut pieces, mut area) = (0.0, 0.0);
        for index in touching() {
            let double_area = mesh.area_normal(index).norm();
            if double_area > 0.0 {
                area += 0.5 * double_area;
                pieces += Pieces::of(&mesh.corners(index), 0.5 * double_area, longest).count();
            }
        }
        let most = if pieces > TUNING.all_pieces { TUNING.all_pieces / area } else { f64::INFINITY };
        for index in touching() {
            let across = mesh.area_normal(index);
            let double_area = across.norm();
            if double_area > 0.0 {
                let (corners, area) = (mesh.corners(index), 0.5 * double_area);
                let share = Pieces::of(&corners, area, longest).count() / (most * area).max(1.0);
                cells.add_face(&corners, &(across / double_area), area, longest * share.max(1.0), &keep);
            }
        }
        cells.finish()
    }

    /// Averages normals over the parts of `surface` (these samples, or coarser ones of the same surface) that are nearer
    /// than `radius` and look the same way: the edges of coarse faces are no feature of it. `grid` is of `surface`.
    pub fn smoothed_normals(&self, surface: &Samples, grid: &CellGrid, radius: f64) -> Vec<Vector3> {
        let smoothed = |index: usize| {
            let (normal, mut sum) = (self.normals[index], Vector3::zeros());
            grid.for_each_within(&self.points[index], radius, |other, distance2| {
                if surface.normals[other].dot(&normal) > 0.0 {
                    let weight = surface.areas[other] * (1.0 - distance2 / (radius * radius)).powi(2);
                    sum += surface.normals[other] * weight;
                }
            });
            sum.try_normalize(f64::MIN_POSITIVE).unwrap_or(normal)
        };
        (0..self.points.len()).into_par_iter().map(smoothed).collect()
    }

    /// The same surface with a wider spacing: samples gathered into larger cells.
    pub fn coarser(&self, spacing: f64) -> Samples {
        gather(&self.points, &self.normals, &self.areas, spacing).samples
    }

    /// Those for which `is_kept` says so.
    pub(super) fn kept(self, is_kept: &[bool]) -> Samples {
        fn kept<T>(values: Vec<T>, is_kept: &[bool]) -> Vec<T> {
            values.into_iter().zip(is_kept).filter(|(_, kept)| **kept).map(|(value, _)| value).collect()
        }
        Samples {
            points: kept(self.points, is_kept),
            normals: kept(self.normals, is_kept),
            areas: kept(self.areas, is_kept),
            spacing: self.spacing,
        }
    }

    /// Samples of a cloud with unit normals. Every sample stands for the same area, since the density of a
    /// cloud tells of the scanner and not of the surface.
    pub fn from_cloud(points: &[Point3], normals: &[Vector3], spacing: f64) -> Samples {
        let mut samples = Samples::counted(points, normals, spacing);
        samples.areas.fill(spacing * spacing);
        samples
    }

    /// The same with the number of points in a cell for its area.
    pub fn counted(points: &[Point3], normals: &[Vector3], spacing: f64) -> Samples {
        let mut cells = Cells::new(spacing, Bounds::of(points));
        for (point, normal) in points.iter().zip(normals) {
            cells.add(point, normal, 1.0);
        }
        cells.finish()
    }
}

/// Gathers points into cells of edge `spacing`, weighted by their areas (a point without area counts a little,
/// so that it has a place).
pub(super) fn gather(points: &[Point3], normals: &[Vector3], areas: &[f64], spacing: f64) -> Gathered {
    let mut cells = Cells::new(spacing, Bounds::of(points));
    let cell_of =
        points.iter().zip(normals).zip(areas).map(|((p, n), a)| cells.add(p, n, a.max(f64::MIN_POSITIVE))).collect();
    Gathered { samples: cells.finish(), cell_of }
}

/// Sums of the points in each cell.
pub(super) struct Cells {
    spacing: f64,
    origin: Point3,
    slots: HashMap<u64, u32, BuildHasherDefault<KeyHasher>>,
    sums: Vec<Sum>,
    /// The cell that was looked up last, with its slot.
    last: (u64, u32),
}

/// What has come into a cell, weighted by area.
struct Sum {
    /// The first that came decides which others are of its side.
    first_normal: Vector3,
    /// From the grid's origin.
    position: Vector3,
    normal: Vector3,
    area: f64,
}

impl Cells {
    pub(super) fn new(spacing: f64, bounds: Option<Bounds>) -> Cells {
        Cells {
            spacing: spacing.max(f64::MIN_POSITIVE),
            origin: bounds.map_or(Point3::origin(), |b| b.min),
            slots: HashMap::default(),
            sums: Vec::new(),
            last: (0, u32::MAX),
        }
    }

    /// Adds to the cell's first sample if the normals agree, else to its second.
    pub(super) fn add(&mut self, point: &Point3, normal: &Vector3, area: f64) -> u32 {
        let offset = point - self.origin;
        let [x, y, z] = [0, 1, 2].map(|axis| (offset[axis] / self.spacing) as u64 & 0x1f_ffff);
        let key = x | y << 21 | z << 42;
        let mut slot = self.slot(key, normal);
        if self.sums[slot as usize].first_normal.dot(normal) < 0.0 {
            slot = self.slot(key | TUNING.second, normal);
        }
        let sum = &mut self.sums[slot as usize];
        sum.position += offset * area;
        sum.normal += normal * area;
        sum.area += area;
        slot
    }

    fn slot(&mut self, key: u64, normal: &Vector3) -> u32 {
        // what is added mostly comes cell by cell
        if self.last.0 == key && (self.last.1 as usize) < self.sums.len() {
            return self.last.1;
        }
        let next = self.sums.len() as u32;
        let slot = *self.slots.entry(key).or_insert(next);
        if slot == next {
            let nothing = Vector3::zeros();
            self.sums.push(Sum { first_normal: *normal, position: nothing, normal: nothing, area: 0.0 });
        }
        self.last = (key, slot);
        slot
    }

    /// Cuts a face into pieces no longer than `longest`, in rows along its longest edge; each that is kept counts by its
    /// area.
    fn add_face(
        &mut self,
        corners: &[Point3; 3],
        normal: &Vector3,
        area: f64,
        longest: f64,
        keep: impl Fn(&Point3) -> bool,
    ) {
        let Pieces { first: k, length, rows, longest } = Pieces::of(corners, area, longest);
        let (a, b, c) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
        let [along, up] = [b - a, c - a];
        for row in 0..rows as usize {
            // a row is a trapezoid: its two widths as shares of the base, and the height of its centroid
            let (lower, upper) = (1.0 - row as f64 / rows, 1.0 - (row + 1) as f64 / rows);
            let v = (row as f64 + (lower + 2.0 * upper) / (lower + upper) / 3.0) / rows;
            let count = pieces_along(length * 0.5 * (lower + upper), longest);
            let share = area * (lower * lower - upper * upper) / count;
            for piece in 0..count as usize {
                let u = (piece as f64 + 0.5) / count * (1.0 - v);
                let piece = a + along * u + up * v;
                if keep(&piece) {
                    self.add(&piece, normal, share);
                }
            }
        }
    }

    pub(super) fn finish(self) -> Samples {
        let mut samples = Samples { spacing: self.spacing, ..Samples::default() };
        for Sum { position, normal, area, .. } in self.sums {
            samples.points.push(self.origin + position / area);
            samples.normals.push(normal.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::zeros));
            samples.areas.push(area);
        }
        samples
    }
}

/// How a face is cut: in rows along its longest edge.
struct Pieces {
    /// The corner where that edge begins.
    first: usize,
    length: f64,
    rows: f64,
    longest: f64,
}

/// Pieces no longer than `longest` along an extent.
fn pieces_along(extent: f64, longest: f64) -> f64 {
    (extent / longest).ceil().clamp(1.0, TUNING.most_pieces)
}

impl Pieces {
    fn of(corners: &[Point3; 3], area: f64, longest: f64) -> Pieces {
        let length2 = |k: usize| (corners[(k + 1) % 3] - corners[k]).norm_squared();
        let first = (0..3).fold(0, |best, k| if length2(k) > length2(best) { k } else { best });
        let length = length2(first).sqrt();
        Pieces { first, length, rows: pieces_along(2.0 * area / length, longest), longest }
    }

    /// About how many there are.
    fn count(&self) -> f64 {
        (0.5 * self.rows * pieces_along(self.length, self.longest)).max(1.0)
    }
}

/// Hashes a cell's key by one multiplication: the default hasher would cost more than the rest. The map is
/// only ever looked up, never iterated, so the order of its entries shows nowhere.
#[derive(Debug, Default)]
struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u64(u64::from(byte));
        }
    }

    fn write_u64(&mut self, value: u64) {
        let mixed = (self.0 ^ value).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ (mixed >> 32);
    }
}

#[cfg(test)]
mod tests {
    use super::super::curvature::tests::sphere;
    use super::*;

    #[test]
    fn samples_keep_the_area_and_lie_on_the_surface() {
        let mesh = sphere(1.0, 5);
        let samples = Samples::from_mesh(&mesh, 0.1);
        let area: f64 = samples.areas.iter().sum();
        assert!((area / (4.0 * std::f64::consts::PI) - 1.0).abs() < 0.01, "{area}");
        for (point, normal) in samples.points.iter().zip(&samples.normals) {
            assert!((point.coords.norm() - 1.0).abs() < 0.01);
            assert!(point.coords.normalize().dot(normal) > 0.99);
        }
    }

    #[test]
    fn coarse_faces_are_filled() {
        let plate = Mesh {
            vertices: vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)],
            faces: vec![[0, 1, 2]],
        };
        let samples = Samples::from_mesh(&plate, 0.05);
        assert!((200..=240).contains(&samples.points.len()), "{}", samples.points.len());
        assert!((samples.areas.iter().sum::<f64>() - 0.5).abs() < 1e-12);
    }

    #[test]
    fn normals_do_not_depend_on_the_triangulation() {
        // a coarse ball, and the same flat faces each cut into four
        let coarse = sphere(1.0, 3);
        let mut fine = Mesh { vertices: coarse.vertices.clone(), faces: Vec::new() };
        for &[a, b, c] in &coarse.faces {
            let first = fine.vertices.len() as u32;
            for [i, j] in [[a, b], [b, c], [c, a]] {
                fine.vertices.push(nalgebra::center(&coarse.vertices[i as usize], &coarse.vertices[j as usize]));
            }
            let [d, e, f] = [first, first + 1, first + 2];
            fine.faces.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
        }
        let smooth = |mesh: &Mesh| {
            let mut samples = Samples::from_mesh(mesh, 0.1);
            samples.normals = samples.smoothed_normals(&samples, &CellGrid::new(&samples.points, 0.2), 0.3);
            samples
        };
        let (one, other) = (smooth(&coarse), smooth(&fine));
        let grid = CellGrid::new(&other.points, 0.1);
        for (point, normal) in one.points.iter().zip(&one.normals) {
            assert!(normal.dot(&point.coords.normalize()) > 0.98, "rounder than its faces");
            let (near, _) = grid.nearest_where(point, 0.1, |_| true).expect("the same surface");
            assert!(other.normals[near].dot(normal) > 0.99);
        }
    }

    #[test]
    fn both_sides_of_a_thin_wall_are_kept_apart() {
        let points = vec![Point3::new(0.5, 0.5, 0.0), Point3::new(0.5, 0.5, 0.01)];
        let normals = vec![-Vector3::z(), Vector3::z()];
        let samples = Samples::from_cloud(&points, &normals, 1.0);
        assert_eq!(samples.normals, normals);
    }

    #[test]
    fn gathering_tells_where_each_point_went() {
        let points: Vec<Point3> = [0.1, 0.2, 1.4, 0.3].iter().map(|&x| Point3::new(x, 0.0, 0.0)).collect();
        let gathered = gather(&points, &[Vector3::z(); 4], &[1.0; 4], 1.0);
        assert_eq!(gathered.cell_of, [0, 0, 1, 0]);
        assert!((gathered.samples.points[0].x - 0.2).abs() < 1e-12);
    }
}
