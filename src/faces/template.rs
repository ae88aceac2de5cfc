//! The standard's facial region as a list of points, most telling spread first.

use std::sync::LazyLock;

use super::relief;
use crate::geometry::{Point3, Vector3};

/// Points of the standard's surface with outward unit normals, mm, ordered so that the first n are spread as widely
/// as n can be: any prefix is a coarser template of the same region.
#[derive(Debug, Clone, PartialEq)]
pub struct Template {
    /// Positions in the standard's frame.
    pub points: Vec<Point3>,
    /// Outward unit normals.
    pub normals: Vec<Vector3>,
}

/// Number of points of the built-in template.
pub const TEMPLATE_POINTS: usize = 300;
/// The grid that the points are chosen from, mm.
const STEP_MM: f64 = 1.5;

/// The built-in face region: forehead to the foot of the nose, without the eyes, which models show open, closed or not at all.
pub fn face() -> &'static Template {
    static FACE: LazyLock<Template> = LazyLock::new(|| spread(&region(), TEMPLATE_POINTS));
    &FACE
}

fn region() -> Vec<(Point3, Vector3)> {
    let half = (relief::HALF_WIDTH_MM / STEP_MM) as i32;
    let rows = ((relief::HIGHEST_MM - relief::LOWEST_MM) / STEP_MM) as i32;
    (0..=rows)
        .flat_map(|row| (-half..=half).map(move |column| (f64::from(column), f64::from(row))))
        .map(|(column, row)| (column * STEP_MM, relief::LOWEST_MM + row * STEP_MM))
        .filter(|&(x, y)| is_in_region(x, y))
        .map(|(x, y)| relief::at(x, y))
        .collect()
}

/// Inside a rounded frame that stays off temples, hairline and mouth, and outside the eyes with their lids: what
/// moves with the expression is left out.
fn is_in_region(x: f64, y: f64) -> bool {
    let frame = (x / 56.0).powi(4) + ((y - 26.0) / 46.0).powi(4);
    let eye = ((x.abs() - 31.5) / 18.0).powi(2) + ((y - 33.0) / 9.0).powi(2);
    frame < 1.0 && eye > 1.0
}

/// Farthest-point order: each next point is the one farthest from all before it; ties by index. Starts at the point
/// that stands out most.
fn spread(region: &[(Point3, Vector3)], count: usize) -> Template {
    let mut template = Template { points: Vec::new(), normals: Vec::new() };
    let mut distances = vec![f64::INFINITY; region.len()];
    let mut next = (0..region.len()).max_by(|&a, &b| region[a].0.z.total_cmp(&region[b].0.z).then(b.cmp(&a)));
    while let Some(chosen) = next.filter(|_| template.points.len() < count) {
        let (point, normal) = region[chosen];
        template.points.push(point);
        template.normals.push(normal);
        for (distance, (other, _)) in distances.iter_mut().zip(region) {
            *distance = distance.min((other - point).norm_squared());
        }
        next = (0..region.len())
            .max_by(|&a, &b| distances[a].total_cmp(&distances[b]).then(b.cmp(&a)))
            .filter(|&farthest| distances[farthest] > 0.0);
    }
    template
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_prefix_is_spread_over_the_region() {
        let template = face();
        assert_eq!(template.points.len(), TEMPLATE_POINTS);
        for count in [90, TEMPLATE_POINTS] {
            let prefix = &template.points[..count];
            let nearest =
                |p: &Point3| prefix.iter().filter(|q| *q != p).map(|q| (q - p).norm()).fold(f64::INFINITY, f64::min);
            let gaps: Vec<f64> = prefix.iter().map(nearest).collect();
            let (least, most) = gaps.iter().fold((f64::INFINITY, 0.0_f64), |(l, m), &g| (l.min(g), m.max(g)));
            assert!(most < 2.2 * least, "{least} {most}");
        }
    }

    #[test]
    fn the_region_leaves_out_eyes_and_mouth() {
        let template = face();
        assert!(template.points.iter().all(|p| p.y > -21.0 && p.y < 73.0 && p.x.abs() < 57.0));
        assert!(!template.points.iter().any(|p| (p.x.abs() - 31.5).abs() < 5.0 && (p.y - 33.5).abs() < 2.0));
        assert!(template.normals.iter().all(|n| (n.norm() - 1.0).abs() < 1e-12 && n.z > 0.0));
    }
}
