//! Which side of a surface is outside: from the volume of a mesh, from a cloud's own normals, from the
//! scanner's place, or left open.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rayon::prelude::*;

use super::curvature::{Edge, sorted_edges};
use super::proximity::Proximity;
use super::samples::Samples;
use super::skin::{self, Skin};
use visage_geometry::normals::least_spread;
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Bounds, Mesh, Point3, Surface, UnionFind, Vector3};

/// What is known of the outer side of a surface with consistent normals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The normals point outward.
    Outward,
    /// They point inward, all of them.
    Inward,
    /// They agree with each other, but no one knows which side is outside: try both.
    Unknown,
}

impl Side {
    /// The factors to try that turn normals outward.
    pub fn signs(self) -> &'static [f64] {
        match self {
            Side::Outward => &[1.0],
            Side::Inward => &[-1.0],
            Side::Unknown => &[1.0, -1.0],
        }
    }

    /// The likeliest factor.
    pub fn first_sign(self) -> f64 {
        self.signs()[0]
    }
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// At most this share of a mesh's edges may lie between faces that are wound against each other, or belong to more than
        /// two: scanned and decimated models have a few such edges.
        most_wrong_edges: f64 = 1e-3,
        /// At most this share may belong to one face only: of loose triangles no one knows whether they agree.
        most_open_edges: f64 = 0.1,
        /// The openings may be as large as this share of the surface: a bust's neck, but not a mask's back.
        most_opening: f64 = 0.3,
        /// Points of a cloud that are looked at, at most: a ball as densely sampled as its cells allow has 175 000.
        most_points: usize = 200_000,
        /// Cells of a cloud with more are enlarged by this.
        coarser: f64 = 1.3,
    }
}

/// The outer side of a mesh by the sign of its volume, if its faces agree and its openings leave no doubt of the sign.
///
/// Closing all the openings of a piece by one cone, to some place, gives a volume that depends on the place linearly, by a
/// third of the sum of the faces' area vectors, which is nothing for a closed piece. The side is known if no places in the
/// pieces' bounding boxes change the sign of all together. Several openings that face each other are judged as one.
pub fn side_of_mesh(mesh: &Mesh) -> Side {
    if !faces_agree(mesh) {
        return Side::Unknown;
    }
    let pieces = pieces(mesh);
    let sum = |of: fn(&Piece) -> f64| pieces.iter().map(of).sum::<f64>();
    if sum(|piece| piece.opening.norm()) > TUNING.most_opening * sum(|piece| piece.area) {
        return Side::Unknown;
    }
    let doubt = sum(|piece| piece.opening.abs().dot(&(piece.bounds.max - piece.bounds.min)) / 6.0);
    match sum(|piece| piece.volume) {
        volume if volume > doubt => Side::Outward,
        volume if volume < -doubt => Side::Inward,
        _ => Side::Unknown,
    }
}

/// Faces that hang together.
struct Piece {
    bounds: Bounds,
    area: f64,
    /// The sum of the faces' area vectors.
    opening: Vector3,
    /// The sum of the cones from the middle of the box to the faces.
    volume: f64,
}

fn pieces(mesh: &Mesh) -> Vec<Piece> {
    let mut groups = UnionFind::new(mesh.vertices.len());
    for &[a, b, c] in &mesh.faces {
        groups.join(a as usize, b as usize);
        groups.join(b as usize, c as usize);
    }
    let number_of = groups.numbered();
    let mut pieces: Vec<Piece> = Vec::new();
    for (point, &number) in mesh.vertices.iter().zip(&number_of) {
        if let Some(piece) = pieces.get_mut(number) {
            piece.bounds = piece.bounds.with(point);
        } else {
            let bounds = Bounds { min: *point, max: *point };
            pieces.push(Piece { bounds, area: 0.0, opening: Vector3::zeros(), volume: 0.0 });
        }
    }
    for (index, face) in mesh.faces.iter().enumerate() {
        let piece = &mut pieces[number_of[face[0] as usize]];
        let across = 0.5 * mesh.area_normal(index);
        piece.area += across.norm();
        piece.opening += across;
        piece.volume += across.dot(&(mesh.corners(index)[0] - piece.bounds.center())) / 3.0;
    }
    pieces
}

/// Whether nearly all neighbours among the faces are wound alike.
fn faces_agree(mesh: &Mesh) -> bool {
    let edges = sorted_edges(mesh);
    let (mut count, mut open, mut wrong) = (0usize, 0usize, 0usize);
    for group in edges.chunk_by(Edge::is_beside) {
        count += 1;
        open += usize::from(group.len() == 1);
        wrong += usize::from(group.len() > 2 || (group.len() == 2 && group[0] == group[1]));
    }
    let at_most = |number: usize, share: f64| number as f64 <= share * count as f64;
    count > 0 && at_most(wrong, TUNING.most_wrong_edges) && at_most(open, TUNING.most_open_edges)
}

/// A cloud with unit normals, what is known of their side, and its neighbours.
#[derive(Debug, Clone)]
pub struct OrientedCloud {
    /// Positions, thinned.
    pub points: Vec<Point3>,
    /// Unit normals; zero where the neighbours tell none.
    pub normals: Vec<Vector3>,
    /// Which side they point to.
    pub side: Side,
    /// Each point's neighbours.
    pub proximity: Proximity,
}

/// A bare cloud thinned to cells of edge `cell`, with unit normals. Its own normals are outward by the convention of
/// this program; without them normals are estimated from the neighbours, and turned towards the scanner if its place
/// is known.
///
/// A cloud that fills space is thinned further: see `TUNING.most_points`.
pub fn oriented_cloud(surface: &Surface, cell: f64, progress: &Progress) -> Result<OrientedCloud, Canceled> {
    if let Some(normals) = &surface.cloud.normals {
        let unit = |n: &nalgebra::Vector3<f32>| n.cast::<f64>().try_normalize(1e-9).unwrap_or_else(Vector3::zeros);
        let normals: Vec<Vector3> = normals.iter().map(unit).collect();
        let Samples { points, normals, .. } = thinned(&surface.cloud.points, &normals, cell, progress)?;
        let proximity = Proximity::new(&points, progress)?;
        return Ok(OrientedCloud { points, normals, side: Side::Outward, proximity });
    }
    let same_side = vec![Vector3::z(); surface.cloud.len()];
    let points = thinned(&surface.cloud.points, &same_side, cell, progress)?.points;
    let proximity = Proximity::new(&points, progress)?;
    let mut normals = plane_normals(&points, &proximity);
    let Some(sensor) = surface.sensor else {
        make_consistent(&points, &proximity, &mut normals, progress)?;
        return Ok(OrientedCloud { points, normals, side: Side::Unknown, proximity });
    };
    for (point, normal) in points.iter().zip(&mut normals) {
        if normal.dot(&(sensor - point)) < 0.0 {
            *normal = -*normal;
        }
    }
    Ok(OrientedCloud { points, normals, side: Side::Outward, proximity })
}

/// Samples of a cloud, at most `TUNING.most_points`, on the surface in the middle of its skin.
fn thinned(points: &[Point3], normals: &[Vector3], cell: f64, progress: &Progress) -> Result<Samples, Canceled> {
    let mut samples = Samples::counted(points, normals, cell);
    let skin = Skin::of(points, cell, progress)?;
    if let Some(skin) = &skin {
        samples = skin::without_specks(samples, skin, progress)?;
    }
    while samples.points.len() > TUNING.most_points {
        progress.check()?;
        samples = samples.coarser(TUNING.coarser * samples.spacing);
    }
    match skin.and_then(|skin| skin.radius(samples.spacing)) {
        Some(radius) => skin::settled(&samples, radius, progress),
        None => Ok(samples),
    }
}

/// Normals of the planes fitted to the neighbours; either sign. Zero with too few neighbours.
fn plane_normals(points: &[Point3], proximity: &Proximity) -> Vec<Vector3> {
    (0..points.len())
        .into_par_iter()
        .map(|index| {
            let (mut sum, mut squares, mut count) = (Vector3::zeros(), nalgebra::Matrix3::zeros(), 0.0);
            for other in proximity.of(index) {
                let offset = points[other] - points[index];
                sum += offset;
                squares += offset * offset.transpose();
                count += 1.0;
            }
            if count < 4.0 {
                return Vector3::zeros();
            }
            least_spread(&(squares - sum * sum.transpose() / count)).0
        })
        .collect()
}

/// Turns normals so that neighbours agree, along the minimum spanning tree of the neighbour graph (Hoppe et al., 1992).
/// Each component starts at its highest point, turned up.
///
/// Neighbours agree as on a circular arc: the normal of one, mirrored at the plane that bisects their connection, is
/// the other's. So a bend as sharp as a nose is passed even where points are sparse, and the two sides of a thin wall
/// look away from each other (after Konig and Gumhold, 2009). An edge costs `1 - |agreement|`.
fn make_consistent(
    points: &[Point3],
    proximity: &Proximity,
    normals: &mut [Vector3],
    progress: &Progress,
) -> Result<(), Canceled> {
    let listed_by = proximity.reversed();
    let mut by_height: Vec<usize> = (0..points.len()).collect();
    by_height.sort_by(|&a, &b| points[b].z.total_cmp(&points[a].z).then(a.cmp(&b)));
    let mut done = vec![false; points.len()];
    let mut heap: BinaryHeap<Reverse<(u64, u32, u32)>> = BinaryHeap::new();
    for start in by_height {
        if done[start] {
            continue;
        }
        if normals[start].z < 0.0 {
            normals[start] = -normals[start];
        }
        heap.push(Reverse((0, start as u32, start as u32)));
        while let Some(Reverse((_, point, from))) = heap.pop() {
            let (point, from) = (point as usize, from as usize);
            if std::mem::replace(&mut done[point], true) {
                continue;
            }
            progress.check()?;
            if agreement(points, normals, from, point) < 0.0 {
                normals[point] = -normals[point];
            }
            for other in proximity.of(point).chain(listed_by.of(point)).filter(|&other| !done[other]) {
                let cost = (1.0 - agreement(points, normals, point, other).abs()).max(0.0);
                // bits of a non-negative float order as the float does
                heap.push(Reverse((cost.to_bits(), other as u32, point as u32)));
            }
        }
    }
    Ok(())
}

/// The cosine between the normal of one point, mirrored to the place of the other, and the other's.
fn agreement(points: &[Point3], normals: &[Vector3], from: usize, to: usize) -> f64 {
    let along = (points[to] - points[from]).try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::zeros);
    let mirrored = normals[from] - along * (2.0 * along.dot(&normals[from]));
    mirrored.dot(&normals[to])
}

#[cfg(test)]
mod tests {
    use super::super::curvature::tests::sphere;
    use super::*;
    use visage_geometry::Cloud;

    fn oriented_cloud(surface: &Surface, cell: f64) -> OrientedCloud {
        super::oriented_cloud(surface, cell, &Progress::silent()).expect("not canceled")
    }

    #[test]
    fn a_vessel_tells_its_side_and_a_dish_does_not() {
        let mut vessel = sphere(1.0, 4);
        let below =
            |mesh: &Mesh, face: &[u32; 3], height: f64| face.iter().all(|&v| mesh.vertices[v as usize].z < height);
        let whole = vessel.clone();
        vessel.faces.retain(|face| below(&whole, face, 0.8));
        assert_eq!(side_of_mesh(&vessel), Side::Outward);
        for face in &mut vessel.faces {
            face.swap(1, 2);
        }
        assert_eq!(side_of_mesh(&vessel), Side::Inward);
        let mut dish = whole.clone();
        dish.faces.retain(|face| below(&whole, face, -0.3));
        assert_eq!(side_of_mesh(&dish), Side::Unknown);
    }

    #[test]
    fn bits_far_away_do_not_turn_a_vessel_inside_out() {
        let mut littered = sphere(1.0, 4);
        let bits: Vec<[Point3; 3]> = (0..littered.faces.len()).step_by(80).map(|face| littered.corners(face)).collect();
        for corners in bits {
            let first = littered.vertices.len() as u32;
            // a bit that looks the other way than the part of the vessel before it
            littered.vertices.extend(corners.map(|p| p + corners[0].coords * 200.0));
            littered.faces.push([first, first + 2, first + 1]);
        }
        assert!(littered.signed_volume_6() < 0.0, "as a whole it looks inside out");
        assert_eq!(side_of_mesh(&littered), Side::Outward);
    }

    #[test]
    fn faces_that_disagree_or_hang_together_nowhere_tell_no_side() {
        let mut twisted = sphere(1.0, 3);
        twisted.faces.iter_mut().step_by(10).for_each(|face| face.swap(1, 2));
        assert_eq!(side_of_mesh(&twisted), Side::Unknown);
        let whole = sphere(1.0, 3);
        let vertices = whole.faces.iter().flatten().map(|&v| whole.vertices[v as usize]).collect();
        let faces = (0..whole.faces.len() as u32).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect();
        assert_eq!(side_of_mesh(&Mesh { vertices, faces }), Side::Unknown);
    }

    #[test]
    fn closed_meshes_tell_their_side() {
        let mut mesh = sphere(1.0, 3);
        assert_eq!(side_of_mesh(&mesh), Side::Outward);
        for face in &mut mesh.faces {
            face.swap(1, 2);
        }
        assert_eq!(side_of_mesh(&mesh), Side::Inward);
        assert_eq!(side_of_mesh(&Mesh::default()), Side::Unknown);
    }

    #[test]
    fn estimated_normals_of_a_sphere_agree() {
        let cloud = Cloud::from_points(sphere(1.0, 4).vertices);
        let OrientedCloud { points, normals, side, .. } =
            oriented_cloud(&Surface { cloud, ..Surface::default() }, 0.05);
        assert_eq!(side, Side::Unknown);
        assert!(normals.iter().zip(&points).all(|(n, p)| n.dot(&p.coords) > 0.95), "highest point turned up");
    }

    #[test]
    fn a_known_scanner_settles_the_side() {
        let points = sphere(1.0, 4).vertices.into_iter().filter(|p| p.x > 0.4).collect();
        let sensor = Some(Point3::new(5.0, 0.0, 0.0));
        let surface = Surface { cloud: Cloud::from_points(points), sensor, ..Surface::default() };
        let OrientedCloud { points, normals, side, .. } = oriented_cloud(&surface, 0.05);
        assert_eq!(side, Side::Outward);
        assert!(normals.iter().zip(&points).all(|(n, p)| n.dot(&p.coords) > 0.9));
    }

    #[test]
    fn own_normals_are_believed() {
        let mut cloud = Cloud::from_points(vec![Point3::origin()]);
        cloud.normals = Some(vec![nalgebra::Vector3::new(0.0, 0.0, 2.0)]);
        let OrientedCloud { normals, side, .. } = oriented_cloud(&Surface { cloud, ..Surface::default() }, 1.0);
        assert_eq!((normals[0], side), (Vector3::z(), Side::Outward));
    }
}
