//! What makes scans worse.

use clap::ValueEnum;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use visage::geometry::{Bounds, Cloud, Point3, Vector3};

/// A way to make scans worse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Damage {
    /// They stay as they are
    None,
    /// Half of the points, chosen at random, are removed
    Half,
    /// Each point is moved at random: one spacing along each axis (standard deviation)
    Noise,
    /// One point in ten lies anywhere in the scan's bounding box
    Outliers,
}

impl std::fmt::Display for Damage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Damage::None => "none",
            Damage::Half => "half",
            Damage::Noise => "noise",
            Damage::Outliers => "outliers",
        })
    }
}

/// Of the points of a scan with outliers, the share that are.
const OUTLIERS: f64 = 0.1;

impl Damage {
    /// All of them.
    pub const ALL: [Damage; 4] = [Damage::None, Damage::Half, Damage::Noise, Damage::Outliers];

    /// The scan made worse; `spacing` in its unit. The same arguments give the same points.
    pub fn done_to(self, cloud: &Cloud, spacing: f64, seed: u64) -> Cloud {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut points = cloud.points.clone();
        match self {
            Damage::None => {}
            Damage::Half => points.retain(|_| rng.random::<bool>()),
            Damage::Noise => points.iter_mut().for_each(|point| *point += noise(&mut rng) * spacing),
            Damage::Outliers => {
                let bounds = cloud.bounds().unwrap_or(Bounds { min: Point3::origin(), max: Point3::origin() });
                let count = (OUTLIERS / (1.0 - OUTLIERS) * points.len() as f64) as usize;
                let diagonal = bounds.max - bounds.min;
                let mut anywhere = || bounds.min + diagonal.map(|side| side * rng.random::<f64>());
                points.extend((0..count).map(|_| anywhere()));
            }
        }
        Cloud::from_points(points)
    }
}

fn noise(rng: &mut impl Rng) -> Vector3 {
    Vector3::from_fn(|_, _| rng.sample(StandardNormal))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_damage_does_what_it_says() {
        let cloud =
            Cloud::from_points((0..1000).map(|k| Point3::new(f64::from(k % 100), f64::from(k / 100), 0.0)).collect());
        let damaged = |damage: Damage| damage.done_to(&cloud, 1.0, 3).points;
        assert_eq!(damaged(Damage::None), cloud.points);
        assert!((450..550).contains(&damaged(Damage::Half).len()));
        assert_eq!(damaged(Damage::Outliers).len(), 1111);
        let moved = damaged(Damage::Noise);
        let mean_square = moved.iter().zip(&cloud.points).map(|(a, b)| (a - b).norm_squared()).sum::<f64>() / 1000.0;
        assert!((mean_square - 3.0).abs() < 0.3, "{mean_square}");
        assert_eq!(moved, damaged(Damage::Noise), "the same seed gives the same points");
    }
}
