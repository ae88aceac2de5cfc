//! Sound files that are changed, made by code.

pub mod archives;
pub mod beside;
pub mod binary;
pub mod lidar;
pub mod meshes;
pub mod packed;
pub mod poses;
pub mod text;

use visage_geometry::{Cloud, Mesh, Point3, Vector3};

/// A file to be changed.
#[derive(Clone)]
pub struct Seed {
    /// The name under which it is read.
    pub name: String,
    /// What is changed of it.
    pub bytes: Vec<u8>,
    /// Makes the file of that: puts what was changed into its packing, with checksums and lengths that fit.
    pub wrap: fn(&[u8]) -> Vec<u8>,
}

impl Seed {
    /// A file without a packing.
    pub fn plain(name: &str, bytes: impl Into<Vec<u8>>) -> Self {
        Seed { name: name.to_owned(), bytes: bytes.into(), wrap: <[u8]>::to_vec }
    }
}

/// Twenty places on a grid.
pub fn points() -> Vec<Point3> {
    (0..20).map(|k| Point3::new(f64::from(k % 5), f64::from(k / 5), 0.1 * f64::from(k))).collect()
}

/// A cloud with all attributes.
pub fn cloud() -> Cloud {
    Cloud {
        normals: Some(vec![nalgebra::Vector3::z(); 20]),
        colors: Some((0..20).map(|k| [k, 2, 255 - k]).collect()),
        intensities: Some((0..20).map(|k| k as f32 * 0.5).collect()),
        ..Cloud::from_points(points())
    }
}

/// A few triangles.
pub fn mesh() -> Mesh {
    Mesh { vertices: points(), faces: vec![[0, 1, 6], [0, 6, 5], [7, 8, 9]] }
}

/// A row of text a point.
pub fn rows(row: impl Fn(&Point3) -> String) -> String {
    points().iter().map(row).collect()
}

/// The coordinates as `f32`, with one more number a point.
pub fn floats() -> Vec<u8> {
    points().iter().flat_map(|p| [p.x, p.y, p.z, 0.5]).flat_map(|x| (x as f32).to_le_bytes()).collect()
}

/// A motion.
pub fn motion(k: f64) -> visage_geometry::Motion {
    visage_geometry::Motion::new(Vector3::x() * k, Vector3::y() * 0.5)
}
