//! Smooth noise in space, by seed: height fields, chisel marks and how bright a surface is.

use visage_geometry::{Point3, Vector3};

/// A number in 0..1 for a lattice point.
fn lattice(x: i64, y: i64, z: i64, seed: u64) -> f64 {
    let mut h = seed ^ 0x9e37_79b9_7f4a_7c15;
    for part in [x, y, z] {
        h = (h ^ part as u64).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h ^= h >> 29;
        h = h.wrapping_mul(0x94d0_49bb_1331_11eb);
        h ^= h >> 32;
    }
    (h >> 11) as f64 / (1u64 << 53) as f64
}

/// Noise of wavelength 1 between -1 and 1, blended smoothly between the lattice points.
pub fn noise(p: &Point3, seed: u64) -> f64 {
    let cell = p.coords.map(f64::floor);
    let t = (p.coords - cell).map(|t| t * t * (3.0 - 2.0 * t));
    let [x, y, z] = [0, 1, 2].map(|axis| cell[axis] as i64);
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let row = |dy: i64, dz: i64| mix(lattice(x, y + dy, z + dz, seed), lattice(x + 1, y + dy, z + dz, seed), t.x);
    let sheet = |dz: i64| mix(row(0, dz), row(1, dz), t.y);
    2.0 * mix(sheet(0), sheet(1), t.z) - 1.0
}

/// Noise with `octaves` layers, each of half the wavelength and half the height of the one before; about -1 to 1.
pub fn rough(p: &Point3, octaves: u32, seed: u64) -> f64 {
    let layer = |octave: u32| {
        let fine = f64::from(1u32 << octave);
        noise(&(Point3::from(p.coords * fine) + Vector3::repeat(0.37 * f64::from(octave))), seed + u64::from(octave))
            / fine
    };
    (0..octaves).map(layer).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_smooth_seeded_and_fills_its_range() {
        let at = |k: u32, seed| noise(&Point3::new(0.137 * f64::from(k), 0.05 * f64::from(k), -3.3), seed);
        let values: Vec<f64> = (0..2000).map(|k| at(k, 5)).collect();
        let (least, most) = values.iter().fold((1.0f64, -1.0f64), |(a, b), v| (a.min(*v), b.max(*v)));
        assert!(least < -0.7 && most > 0.7 && least >= -1.0 && most <= 1.0, "{least} {most}");
        assert!(values.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 0.6), "no jumps");
        assert_ne!(at(7, 5), at(7, 6));
        assert_eq!(at(7, 5), at(7, 5));
    }
}
