//! Meshes put together from boxes, posts, balls and sheets. All are wound outward; they may overlap, for a ray meets the
//! nearest face.

use std::f64::consts::{PI, TAU};

use visage_geometry::{Mesh, Motion, Point3, Vector3};

/// The mesh in another place.
pub fn moved(mesh: &Mesh, motion: &Motion) -> Mesh {
    Mesh { vertices: mesh.vertices.iter().map(|v| motion * v).collect(), faces: mesh.faces.clone() }
}

/// The mesh grown about the origin.
pub fn scaled(mesh: &Mesh, factor: f64) -> Mesh {
    Mesh { vertices: mesh.vertices.iter().map(|v| v * factor).collect(), faces: mesh.faces.clone() }
}

/// Adds the faces of `part`.
pub fn append(mesh: &mut Mesh, part: &Mesh) {
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(&part.vertices);
    mesh.faces.extend(part.faces.iter().map(|face| face.map(|v| first + v)));
}

/// All of them as one.
pub fn together(parts: impl IntoIterator<Item = Mesh>) -> Mesh {
    let mut all = Mesh { vertices: Vec::new(), faces: Vec::new() };
    parts.into_iter().for_each(|part| append(&mut all, &part));
    all
}

/// A four-cornered sheet, its corners counter-clockwise as seen from its front.
pub fn sheet(corners: [[f64; 3]; 4]) -> Mesh {
    Mesh { vertices: corners.map(Point3::from).to_vec(), faces: vec![[0, 1, 2], [0, 2, 3]] }
}

/// A box with these least and greatest coordinates.
pub fn cuboid(min: [f64; 3], max: [f64; 3]) -> Mesh {
    let corner = |k: usize| Point3::from([0, 1, 2].map(|axis| if k >> axis & 1 == 1 { max[axis] } else { min[axis] }));
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    Mesh { vertices: (0..8).map(corner).collect(), faces }
}

/// The inside of a box: its walls seen from within.
pub fn hollow(min: [f64; 3], max: [f64; 3]) -> Mesh {
    let mut walls = cuboid(min, max);
    walls.faces.iter_mut().for_each(|face| face.swap(1, 2));
    walls
}

/// An upright post: from `foot` it rises by `height`, its radius going from `below` to `above`.
pub fn post(foot: [f64; 3], height: f64, below: f64, above: f64) -> Mesh {
    const SIDES: u32 = 20;
    let [x, y, z] = foot;
    let mut mesh = Mesh { vertices: vec![Point3::new(x, y, z), Point3::new(x, y + height, z)], faces: Vec::new() };
    for side in 0..SIDES {
        let (sine, cosine) = (TAU * f64::from(side) / f64::from(SIDES)).sin_cos();
        mesh.vertices.push(Point3::new(x + below * cosine, y, z + below * sine));
        mesh.vertices.push(Point3::new(x + above * cosine, y + height, z + above * sine));
        let (low, next) = (2 + 2 * side, 2 + 2 * ((side + 1) % SIDES));
        mesh.faces.extend([[0, low, next], [1, next + 1, low + 1], [low, low + 1, next], [next, low + 1, next + 1]]);
    }
    mesh
}

/// A ball whose radius is `radius(direction)`.
pub fn ball(center: [f64; 3], radius: impl Fn(&Vector3) -> f64) -> Mesh {
    const ROWS: u32 = 10;
    const COLUMNS: u32 = 18;
    let center = Point3::from(center);
    let mut mesh = Mesh { vertices: Vec::new(), faces: Vec::new() };
    for row in 0..=ROWS {
        for column in 0..COLUMNS {
            let (tilt, turn) = (PI * f64::from(row) / f64::from(ROWS), TAU * f64::from(column) / f64::from(COLUMNS));
            let way = Vector3::new(tilt.sin() * turn.cos(), tilt.cos(), tilt.sin() * turn.sin());
            mesh.vertices.push(center + way * radius(&way));
            if row < ROWS {
                let (here, next) = (row * COLUMNS + column, row * COLUMNS + (column + 1) % COLUMNS);
                mesh.faces.extend([[here, next, here + COLUMNS], [next, next + COLUMNS, here + COLUMNS]]);
            }
        }
    }
    mesh
}

/// Ground over the square of half-side `half`, `height(x, z)` high.
pub fn ground(half: f64, cells: u32, height: impl Fn(f64, f64) -> f64) -> Mesh {
    let mut mesh = Mesh { vertices: Vec::new(), faces: Vec::new() };
    let at = |k: u32| half * (2.0 * f64::from(k) / f64::from(cells) - 1.0);
    for row in 0..=cells {
        for column in 0..=cells {
            let (x, z) = (at(column), at(row));
            mesh.vertices.push(Point3::new(x, height(x, z), z));
            if row < cells && column < cells {
                let here = row * (cells + 1) + column;
                let below = here + cells + 1;
                mesh.faces.extend([[here, below, here + 1], [here + 1, below, below + 1]]);
            }
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solids_are_closed_and_wound_outward() {
        let near = |mesh: &Mesh, volume: f64| (mesh.signed_volume_6() / 6.0 / volume - 1.0).abs() < 0.1;
        assert!(near(&cuboid([1.0, 2.0, 3.0], [2.0, 4.0, 6.0]), 6.0));
        assert!(near(&hollow([1.0, 2.0, 3.0], [2.0, 4.0, 6.0]), -6.0));
        assert!(near(&post([5.0, -1.0, 2.0], 3.0, 1.0, 1.0), 3.0 * PI));
        assert!(near(&ball([5.0, -1.0, 2.0], |_| 2.0), 32.0 / 3.0 * PI));
        let ground = ground(2.0, 4, |x, _| 0.1 * x);
        assert!((0..ground.faces.len()).all(|face| ground.area_normal(face).y > 0.0), "seen from above");
    }
}
