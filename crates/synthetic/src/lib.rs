//! Objects made by code and a virtual scanner to scan them: data with a known truth for the demo and the tests.
//!
//! - [`implicit`], [`surface_nets`]: solids as signed fields, and their surfaces as meshes
//! - [`head`]: heads with a face, each seed another person
//! - [`body`], [`depth_views`]: standing persons with such heads, and a depth camera's views around them
//! - [`objects`]: things that are no face: a head with bumps for a face, a jug, a smooth blob
//! - [`shapes`]: a catalogue of thirty kinds of things, each by seed, to scan and register with an exact truth
//! - [`printed`]: a bottle and a wall with a print on them: what turns or slides in itself, and colours that do not
//! - [`scanner`]: range scans by ray casting
//! - [`scene`]: objects on a turntable, on the floor, before a wall
//! - [`scenery`]: eight kinds of scene: objects, sculptures, rooms, streets, bodies, tables, turntables, terrain
//! - [`sensors`]: six kinds of sensor with the faults that they have in life, and sets of scans of every scene by each
//! - [`truth`]: disturbing true poses, and how far estimated ones are from the truth
//!
//! Lengths are millimetres. Pure and deterministic: the same seed gives the same bits.
//!
//! ```
//! use visage_synthetic::{objects::jug, scanner::Scanner};
//!
//! let set = Scanner { views: 3, ..Scanner::default() }.scan_set(&jug().mesh, 1);
//! assert_eq!((set.scans.len(), set.poses.len()), (3, 3));
//! ```

pub mod body;
pub mod depth_views;
pub mod head;
pub mod implicit;
pub mod objects;
pub mod printed;
pub mod scanner;
pub mod scene;
pub mod scenery;
pub mod sensors;
pub mod shapes;
mod solids;
pub mod surface_nets;
mod texture;
mod tracer;
pub mod truth;

use std::collections::BTreeMap;

use visage_geometry::{Mesh, Point3};

/// An object made by code, in its own frame, mm.
#[derive(Debug, Clone)]
pub struct Specimen {
    /// The closed surface, wound outward.
    pub mesh: Mesh,
    /// Named points of the face, if it has one; the names are those of the standards (`eye_r_inner`, `nose_tip`, ...),
    /// right and left being the subject's own.
    pub landmarks: BTreeMap<&'static str, Point3>,
}
