//! Standing persons: a clothed body by seed, with one of the heads of [`head`](super::head) on it.
//!
//! The frame: x to the subject's left, y up from the floor, z out of the face, mm.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::head::{Proportions, head_with};
use super::implicit::{cut, ellipsoid, join, limb};
use super::{Specimen, surface_nets};
use visage_geometry::{Bounds, Mesh, Motion, Point3, Vector3};

/// Edge of the grid cells from which bodies are meshed, mm; heads have finer ones.
const CELL: f64 = 10.0;
/// From the head's origin to its crown, and down to where the neck goes into the body, mm of an average head.
const CROWN: f64 = 145.0;
const NECK: f64 = 118.0;
/// The body below the neck of the person whose measures are written down here, mm.
const SHOULDERS: f64 = 1460.0;

/// A standing person by seed: 1.5 to 1.95 m tall, arms held in some way, in folded clothes, with or without hair. The
/// landmarks are those of the face.
///
/// Head and body are two closed surfaces that reach into each other.
pub fn person(seed: u64) -> Specimen {
    let build = Build::of(seed);
    let (mut mesh, head_pose) = (build.body(), build.head_pose());
    let head = build.head();
    append(&mut mesh, &head.mesh, &head_pose);
    let landmarks = head.landmarks.into_iter().map(|(name, p)| (name, head_pose * p)).collect();
    Specimen { mesh, landmarks }
}

/// The same person without a head.
pub fn headless(seed: u64) -> Specimen {
    Specimen { mesh: Build::of(seed).body(), landmarks: std::collections::BTreeMap::new() }
}

fn append(mesh: &mut Mesh, part: &Mesh, pose: &Motion) {
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(part.vertices.iter().map(|v| pose * v));
    mesh.faces.extend(part.faces.iter().map(|face| face.map(|v| first + v)));
}

/// Shoulder, elbow and hand of one arm, in the body's measures.
type Arm = [[f64; 3]; 3];

/// What makes one person.
struct Build {
    height: f64,
    /// Width and depth of the trunk relative to the average.
    girth: f64,
    head: Proportions,
    /// How the head is turned and tilted: small angles about x, y and z.
    turn: Vector3,
    /// Left and right.
    arms: [Arm; 2],
    /// Half the distance between the feet, and how far one stands before the other.
    stance: [f64; 2],
    /// Waves of the cloth: direction and frequency, phase, height.
    folds: Vec<(Vector3, f64, f64)>,
    /// How far hair stands off the skull, mm, none for bald heads; and down to where it hangs.
    hair: Option<[f64; 2]>,
    hair_phase: f64,
}

impl Build {
    fn of(seed: u64) -> Build {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x0b0d_1e50);
        let arms = [1.0, -1.0].map(|side| arm(side, &mut rng));
        let folds = (0..10)
            .map(|_| {
                // cloth hangs: its folds run down rather than around
                let wave =
                    Vector3::new(rng.random_range(-1.0..1.0), rng.random_range(-0.6..0.6), rng.random_range(-1.0..1.0));
                let length = rng.random_range(50.0..160.0);
                (wave.normalize() * (TAU / length), rng.random_range(0.0..TAU), 0.018 * length)
            })
            .collect();
        let hair = match rng.random_range(0..4) {
            0 => None,
            1 => Some([rng.random_range(9.0..20.0), -100.0]),
            _ => Some([rng.random_range(4.0..12.0), -10.0]),
        };
        Build {
            height: rng.random_range(1500.0..1950.0),
            girth: rng.random_range(0.88..1.2),
            head: Proportions::of(seed),
            turn: Vector3::from_fn(|_, _| rng.random_range(-0.12..0.12)),
            arms,
            stance: [rng.random_range(70.0..190.0), rng.random_range(-70.0..70.0)],
            folds,
            hair,
            hair_phase: rng.random_range(0.0..TAU),
        }
    }

    /// The size of the body relative to the one whose measures are written down here.
    fn scale(&self) -> f64 {
        (self.height - (CROWN + NECK) * self.head.size) / SHOULDERS
    }

    fn head_pose(&self) -> Motion {
        let up = self.height - CROWN * self.head.size;
        Motion::translation(0.0, up, 25.0) * Motion::rotation(self.turn)
    }

    fn head(&self) -> Specimen {
        let Some([thickness, down_to]) = self.hair else { return head_with(&self.head, 0.0, |head, _| head) };
        head_with(&self.head, 40.0, |head, p| {
            let strands =
                (0.5 * p.x + 1.3 * (0.08 * p.y + self.hair_phase).sin()).sin() + (0.35 * p.z + 0.1 * p.y).sin();
            let cap = ellipsoid(p, [0.0, 66.0, -2.0], [81.0 + thickness, 83.0 + thickness, 100.0 + thickness]);
            let back = limb(p, [0.0, 40.0, -50.0], [0.0, down_to, -62.0], 66.0 + thickness, 50.0 + thickness);
            let hair = join(cap, back, 25.0) + 0.8 * strands;
            // the hairline goes over the brow and down before the ears
            let face = ellipsoid(p, [0.0, 8.0, 92.0], [78.0, 88.0, 110.0]);
            join(head, cut(hair, face, 8.0), 3.0)
        })
    }

    fn body(&self) -> Mesh {
        let scale = self.scale();
        let field = |p: &Point3| self.solid(&(p / scale)) * scale;
        let mut bounds = Bounds { min: Point3::new(-790.0, -25.0, -330.0), max: Point3::new(790.0, 1560.0, 680.0) };
        bounds.min *= scale;
        bounds.max *= scale;
        surface_nets::mesh(&field, &bounds, CELL)
    }

    /// The body in the measures written down here: soles at 0, shoulders at [`SHOULDERS`].
    fn solid(&self, p: &Point3) -> f64 {
        let g = self.girth;
        let mut trunk = ellipsoid(p, [0.0, 1270.0, -5.0], [165.0 * g, 215.0, 112.0 * g]);
        trunk = join(trunk, ellipsoid(p, [0.0, 1040.0, 5.0], [145.0 * g, 190.0, 105.0 * g]), 80.0);
        trunk = join(trunk, ellipsoid(p, [0.0, 910.0, -10.0], [168.0 * g, 130.0, 120.0 * g]), 60.0);
        let across = [-120.0, 120.0].map(|x| [x * g, 1385.0, -10.0]);
        trunk = join(trunk, limb(p, across[0], across[1], 70.0, 70.0), 60.0);
        trunk = join(trunk, limb(p, [0.0, 1400.0, -5.0], [0.0, SHOULDERS - 5.0, -8.0], 72.0, 57.0), 50.0);
        for (arm, side) in self.arms.iter().zip([1.0, -1.0]) {
            let [shoulder, elbow, hand] = *arm;
            let inner = [side * 110.0 * g, 1370.0, -10.0];
            let mut whole = limb(p, inner, shoulder, 68.0, 60.0);
            whole = join(whole, limb(p, shoulder, elbow, 58.0, 45.0), 20.0);
            whole = join(whole, limb(p, elbow, hand, 45.0, 33.0), 15.0);
            let fist = Point3::from(hand) + (Point3::from(hand) - Point3::from(elbow)).normalize() * 60.0;
            whole = join(whole, limb(p, hand, fist.into(), 34.0, 40.0), 15.0);
            trunk = join(trunk, whole, 30.0);
        }
        let [apart, before] = self.stance;
        for (side, z) in [(1.0, before), (-1.0, -before)] {
            let knee = [side * (0.5 * apart + 45.0), 490.0, 0.6 * z + 12.0];
            let ankle = [side * apart, 85.0, z - 15.0];
            let mut leg = limb(p, [side * 85.0 * g, 860.0, -5.0], knee, 98.0 * g.sqrt(), 66.0);
            leg = join(leg, limb(p, knee, ankle, 64.0, 48.0), 25.0);
            leg = join(
                leg,
                limb(p, [side * apart, 45.0, z - 30.0], [side * (apart + 35.0), 38.0, z + 150.0], 46.0, 38.0),
                30.0,
            );
            trunk = join(trunk, leg, 30.0);
        }
        trunk + self.cloth(p)
    }

    /// How far folds stand above the mean cloth; hands, feet and the collar have none.
    fn cloth(&self, p: &Point3) -> f64 {
        let share = ((p.y - 100.0) / 60.0).clamp(0.0, 1.0) * ((1420.0 - p.y) / 60.0).clamp(0.0, 1.0);
        self.folds.iter().map(|(wave, phase, height)| height * (wave.dot(&p.coords) + phase).sin()).sum::<f64>()
            * 0.6
            * share
    }
}

/// An arm on the side with this sign of x.
fn arm(side: f64, rng: &mut ChaCha8Rng) -> Arm {
    let shoulder = Point3::new(side * 195.0, 1355.0, -10.0);
    let (abduction, forward): (f64, f64) = (rng.random_range(0.25..1.1), rng.random_range(-0.25..0.45));
    let down = |abduction: f64, forward: f64| {
        Vector3::new(side * abduction.sin(), -abduction.cos() * forward.cos(), abduction.cos() * forward.sin())
    };
    let bend = rng.random_range(0.05..1.0);
    let elbow = shoulder + down(abduction, forward) * 285.0;
    let hand = elbow + down(0.8 * abduction, forward + bend) * 250.0;
    [shoulder.into(), elbow.into(), hand.into()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn persons_have_the_height_of_adults_a_face_and_differ() {
        for seed in [1, 2] {
            let person = person(seed);
            let bounds = person.mesh.bounds().expect("a body");
            let height = bounds.max.y - bounds.min.y;
            assert!((1480.0..2000.0).contains(&height), "{height}");
            assert!(bounds.min.y.abs() < 25.0, "soles at {}", bounds.min.y);
            let tip = person.landmarks["nose_tip"];
            let head = 260.0;
            assert!(tip.z > 60.0 && (bounds.max.y - tip.y) < head, "{tip}");
            let distances = person.mesh.vertices.iter().map(|v| (v - tip).norm());
            assert!(distances.fold(f64::INFINITY, f64::min) < 4.0, "the nose's tip is on the surface");
            let litres = person.mesh.signed_volume_6() / 6.0 * 1e-6;
            assert!((35.0..140.0).contains(&litres), "{litres} l");
        }
        assert_ne!(headless(1).mesh, headless(2).mesh);
        assert_eq!(headless(1).mesh, headless(1).mesh);
    }
}
