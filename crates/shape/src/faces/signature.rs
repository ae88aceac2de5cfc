//! What is stored of a model for retrieval, and its bytes.

pub mod example;

use super::cleaned::LeftOut;
use super::dense_fit::Fit;
use super::dense_signature::DenseSignature;
use super::detection::{Detection, FoundFace};
use super::landmarks::Landmarks;
use super::modes::{LANDMARKS, MODES, Weights};
use super::similarity::Similarity;
use super::triangle_candidates::TriangleCandidate;
use crate::descriptor::{ShapeDescriptor, VIEWS, ViewCode};
use crate::saliency::Region;
use visage_geometry::{Motion, Point3, Unit, Vector3};

/// What is stored of a model for retrieval: its salient regions, its facial triangles, its shape as a whole.
///
/// Positions are kept as f32 relative to a place in the model's middle, which is kept in f64: a model far from
/// its origin loses no digits.
#[derive(Debug, Clone, PartialEq)]
pub struct Signature {
    origin: [f64; 3],
    diagonal: f32,
    radius: f32,
    unit_mm: f32,
    regions: Vec<StoredRegion>,
    triangles: Vec<StoredTriangle>,
    /// One, or none.
    faces: Vec<StoredFace>,
    shape: Option<Box<ShapeDescriptor>>,
    views: Vec<ViewCode>,
    /// What it was made without; not stored with it.
    left_out: LeftOut,
}

/// A fit with its landmarks and dense signature.
#[derive(Debug, Clone, PartialEq)]
struct StoredFace {
    fit: StoredFit,
    landmarks: StoredLandmarks,
    dense: DenseSignature,
}

/// centre, normal, strength, mean curvature
type StoredRegion = [f32; 8];
/// three corners, three normals, three strengths, the level's expected inner-eye distance
type StoredTriangle = [f32; 22];
/// residual, observed, scale, rotation (i, j, k, w), translation, stretch, weights of the modes
type StoredFit = [f32; 13 + MODES];
/// Relative to the origin, in the order of [`LANDMARKS`].
type StoredLandmarks = [f32; 3 * LANDMARKS.len()];

/// Where a model lies and how large it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// A place in the middle of it, in the file's frame.
    pub origin: Point3,
    /// See [`Signature::diagonal`].
    pub diagonal: f64,
    /// See [`Signature::radius`].
    pub radius: f64,
    /// The file's unit.
    pub unit: Unit,
}

/// What the API shows of a signature.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SignatureSummary {
    /// Version of the operator.
    pub version: u32,
    /// Number of salient regions.
    pub regions: usize,
    /// Number of facial triangles kept.
    pub triangles: usize,
    /// Points that it was made without.
    #[serde(default)]
    pub left_out: LeftOut,
}

/// Why stored bytes are no signature of this version.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SignatureError {
    /// Made by another version of the operator.
    #[error("signature version {found}, this program reads {}: make it anew from the model", Signature::VERSION)]
    Version {
        /// The version found.
        found: u32,
    },
    /// Cut short or inconsistent.
    #[error("damaged signature: {0}; make it anew from the model")]
    Damaged(String),
}

const MAGIC: [u8; 4] = *b"VSIG";
/// No signature has more regions or triangles than this; larger counts are damage.
const MOST_ENTRIES: usize = 4096;

impl Signature {
    /// The version of the operator that makes signatures; stored beside each.
    pub const VERSION: u32 = 12;

    /// The signature of a model of this size with these regions and facial triangles, all in the file's frame.
    pub fn new(size: &Size, regions: &[Region], detection: &Detection) -> Signature {
        let origin = size.origin;
        let relative = |p: &Point3| (p - origin).cast::<f32>();
        let regions = regions
            .iter()
            .map(|r| {
                let (c, n) = (relative(&r.center), r.normal.cast::<f32>());
                [c.x, c.y, c.z, n.x, n.y, n.z, r.strength as f32, r.mean_curvature as f32]
            })
            .collect();
        let triangles = detection
            .candidates
            .iter()
            .map(|candidate| {
                let mut stored = [0.0; 22];
                for k in 0..3 {
                    stored[3 * k..3 * k + 3].copy_from_slice(relative(&candidate.corners[k]).as_slice());
                    stored[9 + 3 * k..12 + 3 * k].copy_from_slice(candidate.normals[k].cast::<f32>().as_slice());
                    stored[18 + k] = candidate.strengths[k] as f32;
                }
                stored[21] = candidate.expected as f32;
                stored
            })
            .collect();
        Signature {
            origin: origin.into(),
            diagonal: size.diagonal as f32,
            radius: size.radius as f32,
            unit_mm: size.unit.in_mm().unwrap_or(0.0) as f32,
            regions,
            triangles,
            faces: detection.face.iter().map(|face| StoredFace::new(face, &origin)).collect(),
            shape: None,
            views: Vec::new(),
            left_out: LeftOut::default(),
        }
    }

    /// The same, made without so many points.
    pub(crate) fn with_left_out(self, left_out: LeftOut) -> Signature {
        Signature { left_out, ..self }
    }

    /// The same with a descriptor of its shape, or none.
    pub fn with_shape(self, shape: Option<ShapeDescriptor>) -> Signature {
        Signature { shape: shape.map(Box::new), ..self }
    }

    /// The same with what single scans would see of it, [`VIEWS`] at most.
    pub fn with_views(self, mut views: Vec<ViewCode>) -> Signature {
        views.truncate(VIEWS);
        Signature { views, ..self }
    }

    /// What single scans would see of it.
    pub fn views(&self) -> &[ViewCode] {
        &self.views
    }

    /// The shape as a whole; `None` if there is no area to tell it by.
    pub fn shape(&self) -> Option<&ShapeDescriptor> {
        self.shape.as_deref()
    }

    fn position(&self, stored: &[f32]) -> Point3 {
        Point3::from(self.origin) + vector(stored)
    }

    /// The salient regions, strongest first.
    pub fn regions(&self) -> impl Iterator<Item = Region> + '_ {
        self.regions.iter().map(|r| Region {
            center: self.position(&r[..3]),
            normal: vector(&r[3..6]),
            strength: f64::from(r[6]),
            mean_curvature: f64::from(r[7]),
        })
    }

    /// The facial triangles.
    pub fn candidates(&self) -> impl Iterator<Item = TriangleCandidate> + '_ {
        self.triangles.iter().map(|t| TriangleCandidate {
            corners: [0, 3, 6].map(|k| self.position(&t[k..k + 3])),
            normals: [9, 12, 15].map(|k| vector(&t[k..k + 3])),
            strengths: [18, 19, 20].map(|k| f64::from(t[k])),
            expected: f64::from(t[21]),
        })
    }

    /// The best fit of the standard face's surface, if any place was worth a closer look.
    pub fn fit(&self) -> Option<Fit> {
        let f = self.faces.first()?.fit.map(f64::from);
        let quaternion = nalgebra::Quaternion::new(f[6], f[3], f[4], f[5]);
        let rotation = nalgebra::UnitQuaternion::try_new(quaternion, 1e-6)?;
        let translation = Vector3::new(f[7], f[8], f[9]) + Vector3::from(self.origin);
        let stretch = Vector3::new(f[10], f[11], f[12]);
        let pose = Similarity { scale: f[2], stretch, motion: Motion::from_parts(translation.into(), rotation) };
        let weights = Weights::from_fn(|mode, _| f[13 + mode]);
        Some(Fit { pose, weights, residual_mm: f[0], observed: f[1] })
    }

    /// The landmarks of that fit, in the order of [`LANDMARKS`], in the model's frame and unit.
    pub fn landmarks(&self) -> Option<Landmarks> {
        let stored = &self.faces.first()?.landmarks;
        Some(std::array::from_fn(|k| self.position(&stored[3 * k..3 * k + 3])))
    }

    /// What tells the face at that fit from others.
    pub fn dense(&self) -> Option<&DenseSignature> {
        self.faces.first().map(|face| &face.dense)
    }

    /// The diagonal of the model's bounding box along its principal axes, in its unit.
    pub fn diagonal(&self) -> f64 {
        f64::from(self.diagonal)
    }

    /// Millimetres in one unit of the model; `None` if its unit is not known.
    pub fn unit_mm(&self) -> Option<f64> {
        (self.unit_mm > 0.0).then_some(f64::from(self.unit_mm))
    }

    /// The root mean square distance of the surface from its centroid, in the model's unit: a measure of size that
    /// no turn changes.
    pub fn radius(&self) -> f64 {
        f64::from(self.radius)
    }

    /// What the API shows of it.
    pub fn summary(&self) -> SignatureSummary {
        SignatureSummary {
            version: Self::VERSION,
            regions: self.regions.len(),
            triangles: self.triangles.len(),
            left_out: self.left_out,
        }
    }

    /// One BLOB, little-endian: magic, version, origin (f64 x 3), diagonal, radius, unit in mm or 0, then counted regions,
    /// triangles (f32), the number of faces (0 or 1) with fit, landmarks (f32) and heights (i8), and that of descriptors of the
    /// shape (0 or 1) with its bytes, and the counted views (u8).
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(48 + self.regions.len() * 32 + self.triangles.len() * 88);
        bytes.extend(MAGIC);
        bytes.extend(Self::VERSION.to_le_bytes());
        bytes.extend(self.origin.iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend(self.diagonal.to_le_bytes());
        bytes.extend(self.radius.to_le_bytes());
        bytes.extend(self.unit_mm.to_le_bytes());
        write_list(&mut bytes, &self.regions);
        write_list(&mut bytes, &self.triangles);
        bytes.extend((self.faces.len() as u32).to_le_bytes());
        for face in &self.faces {
            bytes.extend(face.fit.iter().chain(&face.landmarks).flat_map(|x| x.to_le_bytes()));
            bytes.extend(face.dense.to_bytes());
        }
        bytes.extend(u32::from(self.shape.is_some()).to_le_bytes());
        self.shape.iter().for_each(|shape| bytes.extend(shape.to_bytes()));
        bytes.extend((self.views.len() as u32).to_le_bytes());
        bytes.extend(self.views.iter().flatten());
        bytes
    }

    /// The inverse of `to_bytes`; refuses other versions and damaged bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SignatureError> {
        let mut reader = Reader { bytes };
        if reader.take::<4>("magic")? != MAGIC {
            return Err(SignatureError::Damaged("it does not begin with the magic bytes".into()));
        }
        let found = u32::from_le_bytes(reader.take("version")?);
        if found != Self::VERSION {
            return Err(SignatureError::Version { found });
        }
        let mut origin = [0.0; 3];
        for x in &mut origin {
            *x = f64::from_le_bytes(reader.take("origin")?);
        }
        let diagonal = reader.float("diagonal")?;
        let radius = reader.float("radius")?;
        let unit_mm = reader.float("unit")?;
        let regions = reader.list("regions")?;
        let triangles = reader.list("triangles")?;
        let faces = match u32::from_le_bytes(reader.take("faces")?) {
            0 => Vec::new(),
            1 => vec![reader.face()?],
            count => return Err(SignatureError::Damaged(format!("{count} faces"))),
        };
        let shape = match u32::from_le_bytes(reader.take("shapes")?) {
            0 => None,
            1 => Some(Box::new(ShapeDescriptor::from_bytes(&reader.take("shape")?))),
            count => return Err(SignatureError::Damaged(format!("{count} shapes"))),
        };
        let count = u32::from_le_bytes(reader.take("views")?) as usize;
        if count > VIEWS {
            return Err(SignatureError::Damaged(format!("{count} views")));
        }
        let views = (0..count).map(|_| reader.take("views")).collect::<Result<Vec<ViewCode>, _>>()?;
        if !reader.bytes.is_empty() {
            return Err(SignatureError::Damaged(format!("{} bytes too many", reader.bytes.len())));
        }
        if origin.iter().any(|x| !x.is_finite()) {
            return Err(SignatureError::Damaged("the origin is not finite".into()));
        }
        Ok(Signature {
            origin,
            diagonal,
            radius,
            unit_mm,
            regions,
            triangles,
            faces,
            shape,
            views,
            left_out: LeftOut::default(),
        })
    }
}

impl StoredFace {
    fn new(face: &FoundFace, origin: &Point3) -> StoredFace {
        let mut landmarks = [0.0; 3 * LANDMARKS.len()];
        for (slots, place) in landmarks.chunks_exact_mut(3).zip(&face.landmarks) {
            slots.copy_from_slice((place - origin).cast::<f32>().as_slice());
        }
        StoredFace { fit: stored_fit(&face.fit, origin), landmarks, dense: face.dense.clone() }
    }
}

fn stored_fit(fit: &Fit, origin: &Point3) -> StoredFit {
    let (q, t) = (fit.pose.motion.rotation.coords, fit.pose.motion.translation.vector - origin.coords);
    let (s, pose) = (fit.pose.stretch, &fit.pose);
    let mut stored = [0.0; 13 + MODES];
    let placed = [fit.residual_mm, fit.observed, pose.scale, q.x, q.y, q.z, q.w, t.x, t.y, t.z, s.x, s.y, s.z];
    for (slot, x) in stored.iter_mut().zip(placed.iter().chain(fit.weights.iter())) {
        *slot = *x as f32;
    }
    stored
}

fn vector(stored: &[f32]) -> Vector3 {
    Vector3::new(f64::from(stored[0]), f64::from(stored[1]), f64::from(stored[2]))
}

fn write_list<const N: usize>(bytes: &mut Vec<u8>, list: &[[f32; N]]) {
    bytes.extend((list.len() as u32).to_le_bytes());
    bytes.extend(list.iter().flatten().flat_map(|x| x.to_le_bytes()));
}

/// Takes values off the front, with an error that names what was missing.
struct Reader<'a> {
    bytes: &'a [u8],
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self, what: &str) -> Result<[u8; N], SignatureError> {
        let (head, rest) = self
            .bytes
            .split_first_chunk::<N>()
            .ok_or_else(|| SignatureError::Damaged(format!("it ends within its {what}")))?;
        self.bytes = rest;
        Ok(*head)
    }

    fn float(&mut self, what: &str) -> Result<f32, SignatureError> {
        let value = f32::from_le_bytes(self.take(what)?);
        if value.is_finite() { Ok(value) } else { Err(SignatureError::Damaged(format!("{what}: not a finite number"))) }
    }

    fn floats<const N: usize>(&mut self, what: &str) -> Result<[f32; N], SignatureError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.float(what)?;
        }
        Ok(values)
    }

    fn face(&mut self) -> Result<StoredFace, SignatureError> {
        Ok(StoredFace {
            fit: self.floats("fit")?,
            landmarks: self.floats("landmarks")?,
            dense: DenseSignature::from_bytes(self.take("heights")?),
        })
    }

    fn list<const N: usize>(&mut self, what: &str) -> Result<Vec<[f32; N]>, SignatureError> {
        let count = u32::from_le_bytes(self.take(what)?) as usize;
        if count > MOST_ENTRIES {
            return Err(SignatureError::Damaged(format!("{count} {what}")));
        }
        let mut list = Vec::with_capacity(count);
        for _ in 0..count {
            list.push(self.floats(what)?);
        }
        Ok(list)
    }
}

#[cfg(test)]
pub(crate) mod tests;
