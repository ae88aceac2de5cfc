//! Made-up signatures, for tests of what keeps and compares them.

use super::*;

/// A signature with `count` regions on a curve through `seed`, one facial triangle and a shape that `seed` changes.
pub fn example(seed: f64, count: usize) -> Signature {
    let at = |k: usize, phase: f64| (seed + 1.7 * k as f64 + phase).sin() * 10.0;
    let regions: Vec<Region> = (0..count)
        .map(|k| Region {
            center: Point3::new(at(k, 0.0), at(k, 1.0), 0.2 * at(k, 2.5)),
            normal: Vector3::z(),
            strength: 1.0 - 0.05 * k as f64,
            mean_curvature: if k % 3 == 0 { -1.0 } else { 1.0 },
        })
        .collect();
    let candidate = TriangleCandidate {
        corners: [Point3::new(-2.0, 3.3, 9.2), Point3::new(2.0, 3.3, 9.2), Point3::new(seed.cos(), -0.3, 12.9)],
        normals: [Vector3::z(); 3],
        strengths: [2.5, 2.6, 4.0],
        expected: 4.0,
    };
    let size = Size { origin: Point3::origin(), diagonal: 1200f64.sqrt(), radius: 8.0, unit: Unit::Cm };
    let pose = Similarity {
        scale: 0.1,
        stretch: Vector3::repeat(1.0),
        motion: Motion::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.1, 0.2, 0.3)),
    };
    let fit = Fit { pose, weights: Weights::repeat(seed), residual_mm: 1.5 + seed.sin(), observed: 0.9 };
    let heights = std::array::from_fn(|k| (20.0 * (seed + 0.1 * k as f64).sin()) as i8 as u8);
    let face = FoundFace {
        fit,
        landmarks: std::array::from_fn(|k| Point3::new(k as f64, 2.0, 3.0)),
        dense: DenseSignature::from_bytes(heights),
    };
    let shape = std::array::from_fn(|k| (128.0 + 40.0 * (seed + 0.7 * k as f64).sin()) as u8);
    Signature::new(&size, &regions, &Detection { candidates: vec![candidate], face: Some(face) })
        .with_shape(Some(ShapeDescriptor::from_bytes(&shape)))
        .with_views((0..count % 4).map(|view| std::array::from_fn(|k| shape[k + view])).collect())
}
