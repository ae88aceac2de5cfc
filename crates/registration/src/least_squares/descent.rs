//! One body laid onto others that stand still: correspondences found within less and less, a step for each.

use super::normal_equations::{NormalEquations, RIGID};
use visage_geometry::{Motion, se3};

/// Improves `start` by a Gauss-Newton step for each of `reaches`. `gather` sums the correspondences that a motion has
/// within a reach, in the frame that it maps into; if they hold nothing, the motion stays.
pub fn descend(
    start: &Motion,
    reaches: impl IntoIterator<Item = f64>,
    mut gather: impl FnMut(&Motion, f64, &mut NormalEquations<RIGID>),
) -> Motion {
    let mut motion = *start;
    for reach in reaches {
        let mut sums = NormalEquations::default();
        gather(&motion, reach, &mut sums);
        let Some(twist) = sums.step() else { break };
        motion = se3::exp(&twist) * motion;
    }
    motion
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Point3, Vector3};

    #[test]
    fn points_on_three_planes_find_back_and_on_none_they_stay() {
        let places = [(0, 1.0, 2.0), (0, -1.0, 3.0), (0, 2.0, -2.0), (1, 1.0, 1.0), (1, -2.0, 2.0), (2, 3.0, 1.0)];
        let planes = places.map(|(axis, a, b)| {
            let mut place = Vector3::zeros();
            (place[(axis + 1) % 3], place[(axis + 2) % 3]) = (a, b);
            (Vector3::ith_axis(axis).into_inner(), Point3::from(place))
        });
        let start = Motion::new(Vector3::new(0.1, -0.2, 0.05), Vector3::new(0.05, 0.02, -0.04));
        let found = descend(&start, [3.0; 6], |motion, _, sums| {
            for (normal, place) in &planes {
                let moved = motion * place;
                sums.add(normal, &moved.coords, normal.dot(&moved.coords), 1.0);
            }
        });
        assert!(se3::log(&found).norm() < 1e-9, "{found}");
        assert_eq!(descend(&start, [1.0], |_, _, _| {}), start);
    }
}
