//! Where a probe lies on a model: turn, place, scale, and whether it is its mirror image.

use visage_geometry::{Motion, Point3, Vector3};

/// Maps a probe onto a model: `p -> motion (scale p)`, with the x of `p` reversed before if it is mirrored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Turn and place, in the unit of the model.
    pub motion: Motion,
    /// Lengths on the model in one of the probe.
    pub scale: f64,
    /// Whether the probe's mirror image lies so.
    pub mirrored: bool,
}

impl Pose {
    /// A place of the probe on the model.
    pub fn point(&self, p: &Point3) -> Point3 {
        self.motion * Point3::from(self.seen(&p.coords) * self.scale)
    }

    /// A direction of the probe on the model.
    pub fn direction(&self, n: &Vector3) -> Vector3 {
        self.motion.rotation * self.seen(n)
    }

    /// The place of the probe that lies at a place of the model.
    pub fn probe_point(&self, p: &Point3) -> Point3 {
        let back = self.motion.inverse_transform_point(p).coords / self.scale;
        Point3::from(self.seen(&back))
    }

    /// The direction of the probe that is this one on the model.
    pub fn probe_direction(&self, n: &Vector3) -> Vector3 {
        self.seen(&(self.motion.rotation.inverse() * n))
    }

    /// The matrix that does it, row by row.
    pub fn matrix(&self) -> [[f64; 4]; 4] {
        let turn = self.motion.rotation.to_rotation_matrix();
        let columns = [0, 1, 2].map(|k| turn.matrix() * self.seen(&Vector3::ith(k, self.scale)));
        let shift = self.motion.translation.vector;
        let row = |k: usize| [columns[0][k], columns[1][k], columns[2][k], shift[k]];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }

    /// The probe, or its mirror image.
    fn seen(&self, v: &Vector3) -> Vector3 {
        if self.mirrored { Vector3::new(-v.x, v.y, v.z) } else { *v }
    }
}
