//! What the demo shows: three objects made by code, their scans, and what is known of them.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::formats::{ply, poses};
use crate::geometry::{Motion, Point3};
use crate::synthetic::head::{Proportions, head};
use crate::synthetic::scanner::{ScanSet, Scanner};
use crate::synthetic::{Specimen, objects, truth};

/// How far the given poses are off: degrees and mm.
const DISTURBED_DEG: f64 = 4.0;
const DISTURBED_MM: f64 = 6.0;
/// Everything random in the demo follows from this.
const SEED: u64 = 1;

/// How an object is made.
type Recipe = fn() -> Specimen;

/// An object with its scans and the truth about it.
pub struct Exhibit {
    /// What it is called.
    pub name: &'static str,
    /// What it is, for people.
    description: &'static str,
    /// Whether it has a face.
    pub is_face: bool,
    /// True places of the face's landmarks, mm, in the frame of the object, which is that of the poses.
    pub landmarks: BTreeMap<&'static str, Point3>,
    /// The scans and their true poses.
    pub set: ScanSet,
    /// The poses that are given to the service.
    pub initial: Vec<Motion>,
}

/// Makes all exhibits: a head with a face, a head with bumps in its place, and a jug.
pub fn make() -> Vec<Exhibit> {
    let objects: [(&str, &str, Recipe); 3] = [
        ("head", "a head with a face, its proportions not the standard's", || head(&Proportions::of(SEED))),
        ("decoy", "a head with three bumps in place of the face", objects::head_with_bumps),
        ("jug", "a jug", objects::jug),
    ];
    let exhibit = |index: usize| {
        let (name, description, make) = objects[index];
        let specimen = make();
        let seed = SEED + index as u64;
        let set = Scanner::default().scan_set(&specimen.mesh, seed);
        let initial = truth::disturb(&set.poses, DISTURBED_DEG.to_radians(), DISTURBED_MM, seed);
        let is_face = !specimen.landmarks.is_empty();
        Exhibit { name, description, is_face, landmarks: specimen.landmarks, set, initial }
    };
    (0..objects.len()).into_par_iter().map(exhibit).collect()
}

impl Exhibit {
    /// One line about it.
    pub fn introduction(&self) -> String {
        let points: usize = self.set.scans.iter().map(|scan| scan.cloud.len()).sum();
        let scans = self.set.scans.len();
        format!("{:<6} {}: {scans} scans, {points} points", self.name, self.description)
    }

    /// Its class, for the gallery.
    pub fn label(&self) -> &'static str {
        if self.is_face { "face" } else { "other" }
    }

    /// The name of a scan's file.
    pub fn file_name(view: usize) -> String {
        format!("scan_{view:02}.ply")
    }

    /// The scans as files.
    pub fn files(&self) -> Vec<(String, Vec<u8>)> {
        let file = |(view, scan): (usize, &crate::geometry::Surface)| {
            (Self::file_name(view), ply::write_cloud(&scan.cloud, None))
        };
        self.set.scans.iter().enumerate().map(file).collect()
    }

    /// The disturbed poses as a JSON pose file.
    pub fn initial_poses(&self) -> String {
        let named = self.initial.iter().enumerate().map(|(view, pose)| (Self::file_name(view), Some(*pose)));
        poses::write_json(&named.collect::<Vec<_>>())
    }

    /// Every 10th point of each scan: where errors of poses are measured.
    pub fn sample_points(&self) -> Vec<Vec<Point3>> {
        self.set.scans.iter().map(|scan| scan.cloud.points.iter().step_by(10).copied().collect()).collect()
    }
}
