//! What the scanners looked through: no surface is there.
//!
//! Surface that nobody saw bulges into what is open: the inside of a mug is closed by a membrane, though a scanner saw its
//! floor. Poisson reconstruction with envelope constraints (Kazhdan, Chuang, Rusinkiewicz and Hoppe, SGP 2020) keeps the
//! surface out of there.

use visage_geometry::{Motion, Point3};
use visage_registration::sensor::looked_through::LookedThrough;

use crate::merge::PosedView;

/// Says whether a place, in cells of the finest grid, is in free space.
pub type IsFree<'a> = dyn Fn(&[f32; 3]) -> bool + Sync + 'a;

/// The field's value in free space that would otherwise be inside, in cells: there the surface may lie near, as far as is
/// known.
pub const JUST_OUTSIDE: f32 = 0.25;

/// The space between scanners and what they saw.
#[derive(Debug, Clone)]
pub struct FreeSpace {
    looks: Vec<Look>,
}

/// What one scanner looked through.
#[derive(Debug, Clone)]
struct Look {
    through: LookedThrough,
    local_from_world: Motion,
}

impl FreeSpace {
    /// That of the placed views whose scanners are known; `spacing` is that of a single scan.
    pub fn of(posed: &[PosedView], spacing: f64) -> Self {
        let look = |posed: &PosedView| {
            let through = LookedThrough::new(posed.view, &posed.sensor?, spacing);
            Some(Look { through, local_from_world: posed.local_pose.inverse() })
        };
        FreeSpace { looks: posed.iter().filter(|view| view.placed).filter_map(look).collect() }
    }

    /// Whether some scanner looked through a place of the world.
    pub fn holds(&self, place: &Point3) -> bool {
        self.looks.iter().any(|look| {
            let local = look.local_from_world * place;
            look.through.is_free(&local.coords.cast()) == Some(true)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Cloud, Vector3};
    use visage_registration::sensor::Sensor;
    use visage_registration::view::View;

    /// A sheet of 60 x 60 places about the z axis at a height.
    fn sheet(height: f64) -> Cloud {
        let place = |k: usize| Point3::new((k % 60) as f64 - 29.5, (k / 60) as f64 - 29.5, height);
        Cloud::from_points((0..3600).map(place).collect())
    }

    #[test]
    fn what_lies_between_a_scanner_and_what_it_saw_is_free_and_nothing_else_is() {
        let scan = sheet(0.0);
        let view = View::new(&scan).expect("a sheet can be used");
        // in the world the sheet stands upright, and its scanner looks along x
        let world_from_scan = Motion::from_parts(
            nalgebra::Translation3::identity(),
            nalgebra::UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2),
        );
        let posed = PosedView {
            view: &view,
            scan: &scan,
            local_pose: view.local_pose(&world_from_scan),
            placed: true,
            sensor: Some(Sensor::At(Vector3::new(0.0, 0.0, 300.0) - view.center)),
        };
        let is_free = |posed: PosedView, x: f64, y: f64| FreeSpace::of(&[posed], 1.0).holds(&Point3::new(x, y, 0.0));
        assert!(is_free(posed, 20.0, 0.0) && is_free(posed, 200.0, 0.0));
        for (x, y, what) in [(3.0, 0.0, "at the surface"), (-20.0, 0.0, "behind it"), (20.0, 60.0, "beside it")] {
            assert!(!is_free(posed, x, y), "{what}");
        }
        assert!(!is_free(PosedView { placed: false, ..posed }, 20.0, 0.0), "not placed");
        assert!(!is_free(PosedView { sensor: None, ..posed }, 20.0, 0.0), "nobody knows where the scanner was");
    }
}
