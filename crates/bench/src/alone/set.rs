//! Scans with known poses, made strange: shuffled, turned at random, under neutral names.

use std::path::Path;

use anyhow::{Context, ensure};
use nalgebra::{Quaternion, UnitQuaternion};
use rand::seq::SliceRandom;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::paper::conf_of;
use visage::formats::{self, ReadLimits};
use visage::geometry::{Cloud, Motion};

/// One of Stanford's sets as it was read: points in metres, poses from its .conf.
pub struct KnownSet {
    /// `bunny`, `dragon` or `happy`.
    pub name: String,
    /// The points of each scan, in the scan's frame.
    pub clouds: Vec<Cloud>,
    /// `pose_world` of each scan.
    pub poses: Vec<Motion>,
}

impl KnownSet {
    /// Reads `stanford/NAME` below `data`.
    pub fn read(data: &Path, name: &str) -> anyhow::Result<KnownSet> {
        let folder = data.join("stanford").join(name);
        let read = |path: &Path| std::fs::read(path).with_context(|| format!("reading {}", path.display()));
        let conf = conf_of(&folder)?;
        let posed = formats::poses::read(&conf.to_string_lossy(), &read(&conf)?)
            .with_context(|| format!("reading {}", conf.display()))?
            .poses;
        ensure!(posed.len() > 1, "{} names {} scan(s), not several", conf.display(), posed.len());
        let (mut clouds, mut poses) = (Vec::new(), Vec::new());
        for (scan, pose) in posed {
            let path = folder.join(&scan);
            let surface = formats::read_surface(&scan, &read(&path)?, &ReadLimits::default())
                .with_context(|| format!("reading {}", path.display()))?;
            clouds.push(Cloud::from_points(surface.cloud.points));
            poses.push(pose);
        }
        Ok(KnownSet { name: name.to_owned(), clouds, poses })
    }

    /// The scans in another order, each turned about its centroid.
    pub fn made_strange(&self, seed: u64) -> KnownSet {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut order: Vec<usize> = (0..self.clouds.len()).collect();
        order.shuffle(&mut rng);
        let (mut clouds, mut poses) = (Vec::new(), Vec::new());
        for view in order {
            let turn = random_turn(&self.clouds[view], &mut rng);
            clouds.push(self.clouds[view].moved(&turn));
            poses.push(self.poses[view] * turn.inverse());
        }
        KnownSet { name: self.name.clone(), clouds, poses }
    }
}

/// A turn about the cloud's centroid, all turns equally likely, that leaves the centroid at the origin.
fn random_turn(cloud: &Cloud, rng: &mut impl Rng) -> Motion {
    let mut normal = || rng.sample::<f64, _>(StandardNormal);
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(normal(), normal(), normal(), normal()));
    Motion::from_parts(nalgebra::Translation3::identity(), rotation)
        * nalgebra::Translation3::from(-cloud.centroid().coords)
}
