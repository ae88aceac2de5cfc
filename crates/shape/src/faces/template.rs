//! The standard's facial region as a list of points, most telling spread first, and how it deforms.

use std::sync::LazyLock;

use super::modes::{self, Jet, MODES, Weights};
use super::relief;
use visage_geometry::{Point3, Vector3};

/// Points of the standard's surface, mm, ordered so that the first n are spread as widely as n can be: any prefix is
/// a coarser template of the same region.
#[derive(Debug, Clone, PartialEq)]
pub struct Template {
    nodes: Vec<Node>,
}

/// A place of the surface with its tangents, and how both change with each mode.
#[derive(Debug, Clone, PartialEq)]
struct Node {
    rest: Jet,
    modes: [Jet; MODES],
}

/// Points with outward unit normals, in the standard's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Shaped {
    /// Positions, mm.
    pub points: Vec<Point3>,
    /// Outward unit normals.
    pub normals: Vec<Vector3>,
}

/// Number of points of the built-in template.
pub const TEMPLATE_POINTS: usize = 300;
visage_geometry::tuning! {
    const TUNING: Tuning {
        /// The grid that the points are chosen from, mm.
        step_mm: f64 = 1.5,
    }
}

/// The built-in face region: forehead to the foot of the nose, without the eyes, which models show open, closed or not at all.
pub fn face() -> &'static Template {
    static FACE: LazyLock<Template> = LazyLock::new(|| spread(region(), TEMPLATE_POINTS));
    &FACE
}

impl Template {
    /// A surface that keeps its form: points with their outward unit normals, in the order in which they count.
    pub fn rigid(points: &[Point3], normals: &[Vector3]) -> Template {
        let still = Jet { value: Vector3::zeros(), along_x: Vector3::zeros(), along_y: Vector3::zeros() };
        let node = |(point, normal): (&Point3, &Vector3)| {
            let [along_x, along_y] = crate::saliency::quadric::tangents(normal);
            Node { rest: Jet { value: point.coords, along_x, along_y }, modes: [still; MODES] }
        };
        Template { nodes: points.iter().zip(normals).map(node).collect() }
    }

    /// The number of points.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// The first `count` points of the surface deformed by `weights`.
    pub fn shaped(&self, weights: &Weights, count: usize) -> Shaped {
        let (points, normals) = self.nodes.iter().take(count).map(|node| node.shaped(weights)).unzip();
        Shaped { points, normals }
    }

    /// How point `index` moves with each mode, mm for one standard deviation.
    pub fn motions(&self, index: usize) -> [Vector3; MODES] {
        std::array::from_fn(|mode| self.nodes[index].modes[mode].value)
    }
}

impl Node {
    fn at(x: f64, y: f64) -> Node {
        let [z, slope_x, slope_y] = relief::height(x, y);
        let mut rest = Jet {
            value: Vector3::new(x, y, z),
            along_x: Vector3::new(1.0, 0.0, slope_x),
            along_y: Vector3::new(0.0, 1.0, slope_y),
        };
        let [mean, modes @ ..] = modes::displacements(x, y);
        rest.add(1.0, &mean);
        Node { rest, modes }
    }

    fn shaped(&self, weights: &Weights) -> (Point3, Vector3) {
        let mut jet = self.rest;
        for (mode, weight) in self.modes.iter().zip(weights.iter()) {
            jet.add(*weight, mode);
        }
        let normal = jet.along_x.cross(&jet.along_y);
        (Point3::from(jet.value), normal.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::z))
    }
}

/// The built-in face over (x, y) of the relief: its point and outward unit normal there.
pub fn at(x: f64, y: f64) -> (Point3, Vector3) {
    Node::at(x, y).shaped(&Weights::zeros())
}

fn region() -> Vec<Node> {
    let half = (relief::HALF_WIDTH_MM / TUNING.step_mm) as i32;
    let rows = ((relief::HIGHEST_MM - relief::LOWEST_MM) / TUNING.step_mm) as i32;
    (0..=rows)
        .flat_map(|row| (-half..=half).map(move |column| (f64::from(column), f64::from(row))))
        .map(|(column, row)| (column * TUNING.step_mm, relief::LOWEST_MM + row * TUNING.step_mm))
        .filter(|&(x, y)| is_in_region(x, y))
        .map(|(x, y)| Node::at(x, y))
        .collect()
}

/// Inside a rounded frame that stays off temples, hairline and mouth, and outside the eyes with their lids: what
/// moves with the expression is left out.
pub fn is_in_region(x: f64, y: f64) -> bool {
    let frame = (x / 56.0).powi(4) + ((y - 26.0) / 46.0).powi(4);
    let eye = ((x.abs() - 31.5) / 18.0).powi(2) + ((y - 33.0) / 9.0).powi(2);
    frame < 1.0 && eye > 1.0
}

/// The region's points, spread from the one that stands out most.
fn spread(region: Vec<Node>, count: usize) -> Template {
    let places: Vec<Vector3> = region.iter().map(|node| node.rest.value).collect();
    let first = greatest(&places.iter().map(|place| place.z).collect::<Vec<f64>>());
    Template { nodes: farthest_first(&places, first, count).into_iter().map(|index| region[index].clone()).collect() }
}

/// Farthest-point order: each next place is the one farthest from all before it; ties by index. At most `count` places, and
/// none twice.
pub(crate) fn farthest_first(places: &[Vector3], first: Option<usize>, count: usize) -> Vec<usize> {
    let (mut chosen, mut next) = (Vec::new(), first);
    let mut distances = vec![f64::INFINITY; places.len()];
    while let Some(index) = next.filter(|_| chosen.len() < count) {
        chosen.push(index);
        for (distance, other) in distances.iter_mut().zip(places) {
            *distance = distance.min((other - places[index]).norm_squared());
        }
        next = greatest(&distances).filter(|&farthest| distances[farthest] > 0.0);
    }
    chosen
}

/// Where the greatest value is, of equals the first.
pub(crate) fn greatest(values: &[f64]) -> Option<usize> {
    (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b]).then(b.cmp(&a)))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use visage_geometry::Mesh;

    /// The built-in face itself as an open mesh of 1.5 mm squares.
    pub(in crate::faces) fn relief_mesh() -> Mesh {
        let (columns, rows) = (75, 68);
        let vertices = (0..columns * rows)
            .map(|k| (f64::from(k % columns) * 1.5 - 55.5, f64::from(k / columns) * 1.5 - 29.0))
            .map(|(x, y)| at(x, y).0)
            .collect();
        let corners = (0..rows - 1).flat_map(|row| (0..columns - 1).map(move |column| (row * columns + column) as u32));
        let (right, up) = (1, columns as u32);
        let faces = corners.flat_map(|a| [[a, a + right, a + up + right], [a, a + up + right, a + up]]).collect();
        Mesh { vertices, faces }
    }

    #[test]
    fn every_prefix_is_spread_over_the_region() {
        assert_eq!(face().len(), TEMPLATE_POINTS);
        for count in [90, TEMPLATE_POINTS] {
            let prefix = face().shaped(&Weights::zeros(), count).points;
            let nearest =
                |p: &Point3| prefix.iter().filter(|q| *q != p).map(|q| (q - p).norm()).fold(f64::INFINITY, f64::min);
            let gaps: Vec<f64> = prefix.iter().map(nearest).collect();
            let (least, most) = gaps.iter().fold((f64::INFINITY, 0.0_f64), |(l, m), &g| (l.min(g), m.max(g)));
            assert!(most < 2.2 * least, "{least} {most}");
        }
    }

    #[test]
    fn the_region_leaves_out_eyes_and_mouth() {
        let template = face().shaped(&Weights::zeros(), TEMPLATE_POINTS);
        assert!(template.points.iter().all(|p| p.y > -23.0 && p.y < 75.0 && p.x.abs() < 60.0));
        assert!(!template.points.iter().any(|p| (p.x.abs() - 31.5).abs() < 5.0 && (p.y - 33.5).abs() < 2.0));
        assert!(template.normals.iter().all(|n| (n.norm() - 1.0).abs() < 1e-12 && n.z > 0.0));
    }

    #[test]
    fn a_rigid_template_is_its_points_whatever_the_weights() {
        let (points, normals) = ([Point3::new(1.0, 2.0, 3.0)], [Vector3::new(0.6, 0.0, -0.8)]);
        let shaped = Template::rigid(&points, &normals).shaped(&Weights::repeat(2.0), 1);
        assert_eq!(shaped.points, points);
        assert!((shaped.normals[0] - normals[0]).norm() < 1e-12);
    }

    #[test]
    fn a_mode_moves_points_by_its_motions_and_turns_normals_along() {
        let weights = Weights::from_fn(|mode, _| if mode == 0 { 0.5 } else { 0.0 });
        let (rest, moved) = (face().shaped(&Weights::zeros(), 40), face().shaped(&weights, 40));
        for k in 0..40 {
            assert!((moved.points[k] - rest.points[k] - face().motions(k)[0] * 0.5).norm() < 1e-12);
            assert!(moved.normals[k].dot(&rest.normals[k]) > 0.9, "no fold");
        }
    }
}
