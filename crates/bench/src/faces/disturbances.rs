//! What may have happened to a model before it is sent: turned, re-meshed, thinned, cut, scanned badly.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use visage::faces::similarity::Similarity;
use visage::geometry::{Cloud, Mesh, Motion, Point3, Surface, Vector3};

/// A model, the millimetre on it and, if it has a face, where that lies.
pub struct Subject<'a> {
    /// The model as it is.
    pub surface: &'a Surface,
    /// The pose of the standard on its face.
    pub pose: Option<Similarity>,
}

/// A seeded change of a model.
type Change = fn(&Subject, &mut ChaCha8Rng) -> Surface;

/// A disturbance with its name.
pub struct Disturbance {
    /// What the table calls it.
    pub name: &'static str,
    /// Whether it needs a face to know where.
    pub faces_only: bool,
    change: Change,
}

impl Disturbance {
    /// The disturbed copy.
    pub fn apply(&self, subject: &Subject, seed: u64) -> Surface {
        (self.change)(subject, &mut ChaCha8Rng::seed_from_u64(seed))
    }
}

/// All of them, in the order of the table.
pub const DISTURBANCES: [Disturbance; 14] = [
    any("turned at random", turned),
    any("subdivided", |s, _| subdivided(s.surface)),
    any("a quarter of the vertices, 0.2 mm noise, bare cloud", thinned),
    face("upper half of the face's head", |s, _| cut(s, |q| q.y > -20.0)),
    face("front half", |s, _| cut(s, |q| q.z > 40.0)),
    face("left half", |s, _| cut(s, |q| q.x > 0.0)),
    face("right half", |s, _| cut(s, |q| q.x < 0.0)),
    any("0.4 mm noise", |s, r| noisy(s, 0.4, r)),
    any("twelve holes of 12 mm across", holed),
    any("wound inward, no vertex shared", |s, _| soup(s.surface)),
    any("a tenth of the triangles wound the wrong way", miswound),
    any("stray bits all around", littered),
    any("on a bust's shoulders and base", pedestalled),
    face("hair down to the brow and over the ears", |s, _| haired(s)),
];

const fn any(name: &'static str, change: Change) -> Disturbance {
    Disturbance { name, faces_only: false, change }
}

const fn face(name: &'static str, change: Change) -> Disturbance {
    Disturbance { name, faces_only: true, change }
}

impl Subject<'_> {
    /// The length of a millimetre on the standard. Without a face there is none: a head's box has a diagonal of
    /// about 350 of them.
    fn mm(&self) -> f64 {
        let diagonal = self.surface.cloud.bounds().map_or(1.0, |b| b.diagonal());
        self.pose.map_or(diagonal / 350.0, |pose| pose.scale)
    }

    /// The model with other points.
    fn with_points(&self, points: Vec<Point3>) -> Surface {
        Surface { cloud: Cloud::from_points(points), faces: self.surface.faces.clone(), ..Surface::default() }
    }
}

fn turned(subject: &Subject, random: &mut ChaCha8Rng) -> Surface {
    let axis = Vector3::from_fn(|_, _| random.random_range(-3.0..3.0));
    let motion = Motion::new(Vector3::new(30.0, -7.0, 2.0), axis);
    subject.with_points(subject.surface.cloud.points.iter().map(|p| motion * p).collect())
}

/// Every face cut in four at the middles of its edges.
pub(super) fn subdivided(surface: &Surface) -> Surface {
    let mut points = surface.cloud.points.clone();
    let mut middles = std::collections::BTreeMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            points.push(nalgebra::center(&points[a as usize], &points[b as usize]));
            points.len() as u32 - 1
        })
    };
    let mut faces = Vec::with_capacity(4 * surface.faces.len());
    for &[a, b, c] in &surface.faces {
        let (d, e, f) = (middle(a, b), middle(b, c), middle(c, a));
        faces.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
    }
    Surface { cloud: Cloud::from_points(points), faces, ..Surface::default() }
}

/// The sum of twelve has the variance 1.
fn gaussian(random: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random_range(-0.5..0.5)).sum()
}

fn thinned(subject: &Subject, random: &mut ChaCha8Rng) -> Surface {
    let noise = 0.2 * subject.mm();
    let mut points = Vec::new();
    for point in &subject.surface.cloud.points {
        if random.random_range(0..4) == 0 {
            points.push(point + Vector3::from_fn(|_, _| gaussian(random)) * noise);
        }
    }
    Surface { cloud: Cloud::from_points(points), ..Surface::default() }
}

fn noisy(subject: &Subject, noise_mm: f64, random: &mut ChaCha8Rng) -> Surface {
    let noise = noise_mm * subject.mm();
    let shaken = |p: &Point3, random: &mut ChaCha8Rng| p + Vector3::from_fn(|_, _| gaussian(random)) * noise;
    subject.with_points(subject.surface.cloud.points.iter().map(|p| shaken(p, random)).collect())
}

/// The faces whose corners are all kept. Vertices without faces are no surface: they would only widen the box.
fn kept(surface: &Surface, kept: &[bool]) -> Surface {
    let mut places = vec![u32::MAX; kept.len()];
    let mut points = Vec::new();
    for (v, point) in surface.cloud.points.iter().enumerate().filter(|(v, _)| kept[*v]) {
        places[v] = points.len() as u32;
        points.push(*point);
    }
    let whole = surface.faces.iter().filter(|face| face.iter().all(|&v| kept[v as usize]));
    let faces = whole.map(|face| face.map(|v| places[v as usize])).collect();
    Surface { cloud: Cloud::from_points(points), faces, ..Surface::default() }
}

/// What lies on the kept side, in the standard's frame.
fn cut(subject: &Subject, keep: impl Fn(&Point3) -> bool) -> Surface {
    let Some(pose) = &subject.pose else { return subject.surface.clone() };
    let flags: Vec<bool> = subject.surface.cloud.points.iter().map(|p| keep(&pose.standard_point(p))).collect();
    kept(subject.surface, &flags)
}

/// Holes around random vertices; on a face six of them in the face itself.
fn holed(subject: &Subject, random: &mut ChaCha8Rng) -> Surface {
    let points = &subject.surface.cloud.points;
    let radius = 6.0 * subject.mm();
    let on_face: Vec<usize> = (0..points.len())
        .filter(|&v| {
            subject
                .pose
                .is_some_and(|pose| (pose.standard_point(&points[v]) - Point3::new(0.0, 20.0, 100.0)).norm() < 60.0)
        })
        .collect();
    let centers: Vec<Point3> = (0..12)
        .map(|k| {
            if k % 2 == 0 && !on_face.is_empty() {
                on_face[random.random_range(0..on_face.len())]
            } else {
                random.random_range(0..points.len())
            }
        })
        .map(|v| points[v])
        .collect();
    let flags: Vec<bool> = points.iter().map(|p| centers.iter().all(|c| (p - c).norm() > radius)).collect();
    kept(subject.surface, &flags)
}

/// Every triangle with corners of its own, the wrong way round: what some STL files are.
fn soup(surface: &Surface) -> Surface {
    let points: Vec<Point3> =
        surface.faces.iter().flat_map(|&[a, b, c]| [a, c, b]).map(|v| surface.cloud.points[v as usize]).collect();
    let faces = (0..surface.faces.len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    Surface { cloud: Cloud::from_points(points), faces, ..Surface::default() }
}

fn miswound(subject: &Subject, random: &mut ChaCha8Rng) -> Surface {
    let mut copy = subject.with_points(subject.surface.cloud.points.clone());
    for face in &mut copy.faces {
        if random.random_range(0..10) == 0 {
            face.swap(0, 1);
        }
    }
    copy
}

/// Forty triangles of 2 mm within twice the box.
fn littered(subject: &Subject, random: &mut ChaCha8Rng) -> Surface {
    let mut copy = subject.with_points(subject.surface.cloud.points.clone());
    let Some(bounds) = subject.surface.cloud.bounds() else { return copy };
    for _ in 0..40 {
        let center = bounds.center() + (bounds.max - bounds.min).map(|e| e * random.random_range(-1.0..1.0));
        let first = copy.cloud.points.len() as u32;
        let corner = |random: &mut ChaCha8Rng| center + Vector3::from_fn(|_, _| gaussian(random)) * subject.mm();
        copy.cloud.points.extend([corner(random), corner(random), corner(random)]);
        copy.faces.push([first, first + 1, first + 2]);
    }
    copy
}

/// An ellipsoid below the chin, 400 x 240 x 180 mm, and a block below that: other things stand on it, too.
fn pedestalled(subject: &Subject, _: &mut ChaCha8Rng) -> Surface {
    let (mm, bounds) = (subject.mm(), subject.surface.cloud.bounds());
    let Some(bounds) = bounds else { return subject.surface.clone() };
    let lowest = Point3::new(bounds.center().x, bounds.min.y, bounds.center().z);
    let placed =
        |p: Point3| subject.pose.map_or(lowest + (p - Point3::new(0.0, -90.0, 40.0)) * mm, |pose| pose.point(&p));
    let mut copy = subject.with_points(subject.surface.cloud.points.clone());
    for (center, half, roundness) in
        [([0.0, -220.0, 20.0], [200.0, 120.0, 90.0], 2.0), ([0.0, -380.0, 20.0], [110.0, 60.0, 90.0], 8.0)]
    {
        let blob = superellipsoid(center, half, roundness);
        let first = copy.cloud.points.len() as u32;
        copy.cloud.points.extend(blob.vertices.into_iter().map(placed));
        copy.faces.extend(blob.faces.iter().map(|face| face.map(|v| v + first)));
    }
    copy
}

/// `|x/a|^n + |y/b|^n + |z/c|^n = 1`, wound outward: 2 an ellipsoid, 8 almost a block.
fn superellipsoid(center: [f64; 3], half: [f64; 3], n: f64) -> Mesh {
    const RINGS: u32 = 24;
    const SPOKES: u32 = 48;
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for ring in 0..=RINGS {
        for spoke in 0..SPOKES {
            let (tilt, turn) = (
                f64::from(ring) / f64::from(RINGS) * std::f64::consts::PI,
                f64::from(spoke) / f64::from(SPOKES) * std::f64::consts::TAU,
            );
            let direction = Vector3::new(tilt.sin() * turn.sin(), tilt.cos(), tilt.sin() * turn.cos());
            let scaled = direction.component_div(&Vector3::from(half));
            let reach = scaled.map(|c| c.abs().powf(n)).sum().powf(-1.0 / n);
            vertices.push(Point3::from(center) + direction * reach);
            if ring > 0 {
                let [a, b] = [ring * SPOKES + spoke, ring * SPOKES + (spoke + 1) % SPOKES];
                faces.extend([[a - SPOKES, a, b], [a - SPOKES, b, b - SPOKES]]);
            }
        }
    }
    Mesh { vertices, faces }
}

/// The skin above the brow and beside the face raised by 4 to 14 mm in strands.
fn haired(subject: &Subject) -> Surface {
    let Some(pose) = &subject.pose else { return subject.surface.clone() };
    let mesh = Mesh { vertices: subject.surface.cloud.points.clone(), faces: subject.surface.faces.clone() };
    let normals = mesh.vertex_normals();
    let raised = |v: usize| {
        let q = pose.standard_point(&mesh.vertices[v]);
        let edge = ((q.y - 62.0) / 8.0).max((q.x.abs() - 62.0) / 8.0).clamp(0.0, 1.0);
        let strands = 9.0 + 3.0 * (q.x / 5.0 + (q.y / 9.0).sin()).sin() + 2.0 * (q.y / 7.0 + q.z / 6.0).sin();
        let away = pose.normal(&(q - Point3::new(0.0, 20.0, 0.0)));
        let outward = if normals[v].dot(&away) < 0.0 { -normals[v] } else { normals[v] };
        mesh.vertices[v] + outward * (edge * strands * pose.scale)
    };
    subject.with_points((0..mesh.vertices.len()).map(raised).collect())
}
