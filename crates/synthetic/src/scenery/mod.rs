//! Scenes of eight kinds to scan, each by seed: things, rooms, streets, people and land; and buildings to walk through. In
//! metres as they are in life, y up, the ground at y = 0.

mod building;
mod furniture;
mod land;
mod person;
mod sculpture;
mod street;

use super::shapes::{Dice, catalogue};
use super::solids::{append, moved, scaled, together};
use visage_geometry::{Bounds, Mesh, Motion, Point3, Vector3};

pub use building::{Building, Stop};
pub use person::body;

/// What is scanned.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, strum::VariantArray, strum::IntoStaticStr, strum::EnumString,
)]
#[strum(serialize_all = "snake_case")]
pub enum SceneKind {
    /// A thing of the catalogue of shapes that has no symmetry.
    Object,
    /// A large carved figure with chisel marks on a base.
    Sculpture,
    /// A furnished room, seen from within.
    Room,
    /// A street with house fronts, cars, poles and trees.
    Street,
    /// A standing person.
    Body,
    /// Many things on a table.
    Table,
    /// A thing that turns on a plate before a background that stands still.
    Turntable,
    /// Hills with houses and trees, seen from above.
    Terrain,
}

impl SceneKind {
    /// Every kind.
    pub const ALL: &[SceneKind] = <SceneKind as strum::VariantArray>::VARIANTS;

    /// The name in rows and tables.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Whether confidence may be fitted on it; the other half is kept for showing how well that went.
    pub fn is_for_fitting(self) -> bool {
        matches!(self, SceneKind::Object | SceneKind::Room | SceneKind::Body | SceneKind::Terrain)
    }
}

/// How sensors go about a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// Around it, looking at its middle.
    Around,
    /// Inside, looking across.
    Inside,
    /// Along its z axis.
    Along,
    /// Over it, or on its ground.
    Above,
}

/// A scene.
#[derive(Debug, Clone)]
pub struct Scenery {
    /// Everything that keeps its place, or turns with the turntable.
    pub mesh: Mesh,
    /// What stands still behind a turntable.
    pub still: Option<Mesh>,
    /// How sensors go about it.
    pub layout: Layout,
    /// Its radius about [`Self::center`] if it is seen from around; else half of its width.
    pub extent: f64,
    /// What sensors look at, or stand about.
    pub center: Point3,
    /// Half of its length, along z, if it is longer than wide.
    pub half_length: f64,
}

impl Scenery {
    /// The instance `seed` of a kind.
    pub fn of(kind: SceneKind, seed: u64) -> Self {
        let dice = &mut Dice::new(seed ^ 0x5ce_e000, CELL_MM);
        match kind {
            SceneKind::Object => Self::around(thing(dice), None),
            SceneKind::Sculpture => Self::around(sculpture::sculpture(dice), None),
            SceneKind::Body => Self::around(body(seed), None),
            SceneKind::Table => Self::around(furniture::laid_table(dice), None),
            SceneKind::Turntable => {
                let (turning, still) = furniture::turntable(dice);
                Self::around(turning, Some(still))
            }
            SceneKind::Room => {
                let (mesh, half) = furniture::room(dice);
                let center = Point3::new(0.0, 1.3, 0.0);
                Scenery { mesh, still: None, layout: Layout::Inside, extent: half.min(2.6), center, half_length: half }
            }
            SceneKind::Street => {
                let center = Point3::new(0.0, 1.7, 0.0);
                let (mesh, extent) = street::street(dice);
                let half_length = street::HALF_LENGTH;
                Scenery { mesh, still: None, layout: Layout::Along, extent, center, half_length }
            }
            SceneKind::Terrain => {
                let extent = land::HALF;
                let center = Point3::origin();
                Scenery {
                    mesh: land::land(dice),
                    still: None,
                    layout: Layout::Above,
                    extent,
                    center,
                    half_length: extent,
                }
            }
        }
    }

    fn around(mesh: Mesh, still: Option<Mesh>) -> Self {
        let bounds = mesh.bounds().unwrap_or(Bounds { min: Point3::origin(), max: Point3::origin() });
        let center = if still.is_some() { Point3::new(0.0, bounds.center().y, 0.0) } else { bounds.center() };
        let extent = mesh.vertices.iter().map(|v| (v - center).norm()).fold(0.0, f64::max);
        Scenery { mesh, still, layout: Layout::Around, extent, center, half_length: extent }
    }

    /// The scene grown about the origin.
    pub fn scaled(&self, factor: f64) -> Scenery {
        Scenery {
            mesh: scaled(&self.mesh, factor),
            still: self.still.as_ref().map(|still| scaled(still, factor)),
            layout: self.layout,
            extent: self.extent * factor,
            center: self.center * factor,
            half_length: self.half_length * factor,
        }
    }

    /// The scene with a floor around it, if it is seen from around: what a sensor with a wide view sees that is set up beside a
    /// thing.
    pub fn with_floor(mut self, seed: u64) -> Scenery {
        if self.layout != Layout::Around {
            return self;
        }
        let dice = &mut Dice::new(seed ^ 0xf100, CELL_MM);
        let bottom = self.mesh.bounds().map_or(0.0, |bounds| bounds.min.y);
        let floor = scaled(&furniture::yard(dice), self.extent);
        let floor = moved(&floor, &Motion::translation(self.center.x, bottom, self.center.z));
        append(&mut self.mesh, &floor);
        self
    }
}

/// Edge of the grid cells from which things are meshed, mm.
const CELL_MM: f64 = 4.0;

/// Something of the catalogue without symmetry, upright, set down at the origin.
fn thing(dice: &mut Dice) -> Mesh {
    let shapes: Vec<_> = catalogue().into_iter().filter(|shape| !shape.is_symmetric()).collect();
    let shape = shapes[dice.number() as usize % shapes.len()];
    set_down(&scaled(&shape.mesh_of(dice.number(), 3.0), 1e-3))
}

/// The mesh with its lowest point at height 0 and the middle of its box over the origin.
fn set_down(mesh: &Mesh) -> Mesh {
    let shift = mesh.bounds().map_or_else(Vector3::zeros, |bounds| {
        let center = bounds.center();
        Vector3::new(-center.x, -bounds.min.y, -center.z)
    });
    moved(mesh, &Motion::translation(shift.x, shift.y, shift.z))
}

/// Turned about the upright axis and shifted.
fn placed(mesh: &Mesh, turn: f64, at: [f64; 3]) -> Mesh {
    moved(mesh, &(Motion::translation(at[0], at[1], at[2]) * Motion::rotation(Vector3::y() * turn)))
}

/// All parts, turned and shifted as one.
fn placed_all(parts: Vec<Mesh>, turn: f64, at: [f64; 3]) -> Mesh {
    placed(&together(parts), turn, at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_differs_by_seed_and_stands_on_the_ground() {
        for &kind in SceneKind::ALL {
            let scene = Scenery::of(kind, 3);
            let bounds = scene.mesh.bounds().expect("it has vertices");
            assert!((500..150_000).contains(&scene.mesh.faces.len()), "{kind:?}: {} faces", scene.mesh.faces.len());
            assert!(scene.mesh.vertices.iter().flat_map(|v| v.iter()).all(|x| x.is_finite()), "{kind:?}");
            assert!(scene.extent > 0.05 && bounds.min.y > -15.0, "{kind:?}: {}", scene.extent);
            assert_eq!(scene.mesh, Scenery::of(kind, 3).mesh, "{kind:?}");
            assert_ne!(scene.mesh, Scenery::of(kind, 4).mesh, "{kind:?}");
        }
    }

    #[test]
    fn half_of_the_kinds_are_for_fitting() {
        assert_eq!(SceneKind::ALL.iter().filter(|kind| kind.is_for_fitting()).count(), 4);
    }

    #[test]
    fn a_person_is_as_tall_as_people_are() {
        for seed in 0..3 {
            let bounds = body(seed).bounds().expect("it has vertices");
            let height = bounds.max.y - bounds.min.y;
            assert!((1.4..2.1).contains(&height), "{height} m");
        }
    }
}
