//! Where a view, or a component of views, may lie that fits the placed ones in several ways: all of its places with how much
//! speaks for each, or the axis about which it turns.
//!
//! Places come from the hypotheses to placed views; the motions between two places that fit are symmetries of the object, and
//! so their products are tried too.

use rayon::prelude::*;

use super::coarse_view::CoarseView;
use super::consensus::alike;
use super::pair_hypothesis::PairHypothesis;
use super::placement::PlacedComponent;
use super::slippage::{Slippage, WeakestMotion, can_slip};
use super::surfel_icp::align_onto;
use super::verification::verify;
use super::{Search, onto};
use crate::global::coarse_set::resolution;
use crate::outcome::Outcome;
use crate::view::{View, common_spacing};
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Motion, Point3, Vector3, se3};

/// The most places that are told.
pub const MOST: usize = 8;
visage_geometry::tuning! {
    const TUNING: Tuning {
        /// A place is told if so much speaks for it, in what speaks for the best: what counts as a rival when components are grown is
        /// 0.8, less what noise and holes make of it.
        least_score: f64 = 0.7,
        /// Places with less than this share are not refined on surfels,
        least_raw: f64 = 0.4,
        /// and with less than this not on the surface.
        least_drawn: f64 = 0.6,
        /// Placed views on which a place is refined, at most: those that most agree with it.
        grounds: usize = 6,
        /// So many surfels have to speak for the best place.
        least: f64 = 12.0,
        /// Places that are tried, at most.
        tried: usize = 64,
        /// Surfels of a view that are queried of a place.
        samples: usize = 200,
        /// Places nearer to each other than this, in edges, are one.
        same: f64 = 4.0,
        /// Surfels that the placed ones hold lie within this distance of them, in edges.
        held: f64 = 0.6,
        /// A motion that hardly turns the surface, as a share of how it shifts it, is no turn about an axis.
        turns: f64 = 0.1,
    }
}

/// What is laid on the placed views: one view, or a component that hangs together.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// Its views,
    views: Vec<usize>,
    /// and their poses in a frame of its own, scan to there: a single view stands at the identity.
    scan_poses: Vec<Motion>,
}

impl Piece {
    /// A view by itself.
    pub fn of_view(view: usize) -> Self {
        Piece { views: vec![view], scan_poses: vec![Motion::identity()] }
    }

    /// A component.
    pub fn of_component(component: &PlacedComponent) -> Self {
        Piece { views: component.views.clone(), scan_poses: component.scan_poses.clone() }
    }
}

/// A place: its world, and how much speaks for it in what speaks for the best.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Alternative {
    world_from_piece: Motion,
    score: f64,
}

/// A turn, or a shift, that leaves a piece on the surface of the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Freedom {
    /// A turn about an axis of the world: a point on it and its direction.
    Axis(Point3, Vector3),
    /// A shift along a direction of the world.
    Along(Vector3),
}

/// The places of a piece.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternatives {
    piece: Piece,
    /// The best first; one of all of them where the piece can slide.
    places: Vec<Alternative>,
    /// How it slides, if it does.
    freedom: Option<Freedom>,
}

/// The places of one view, as a report holds them.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct AlternativesReport {
    /// The scan.
    pub name: String,
    /// Its places, the best first; one of all of them where it can slide.
    pub poses: Vec<AlternativePose>,
    /// The axis about which it turns, if it does.
    pub axis: Option<AxisReport>,
    /// The direction along which it slides, if it does.
    pub along: Option<[f64; 3]>,
}

/// One place of a view.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct AlternativePose {
    /// Scan to world.
    pub pose: [[f64; 4]; 4],
    /// How much speaks for it, in what speaks for the best.
    pub score: f64,
}

/// An axis of the world.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct AxisReport {
    /// A point on it.
    pub point: [f64; 3],
    /// Its direction.
    pub direction: [f64; 3],
}

impl Alternatives {
    /// A row for each view.
    pub fn report(&self, names: &[String]) -> Vec<AlternativesReport> {
        let axis = match self.freedom {
            Some(Freedom::Axis(point, direction)) => {
                Some(AxisReport { point: point.coords.into(), direction: direction.into() })
            }
            _ => None,
        };
        let along = match self.freedom {
            Some(Freedom::Along(direction)) => Some(direction.into()),
            _ => None,
        };
        let views = self.piece.views.iter().zip(&self.piece.scan_poses);
        let row = |(view, scan_pose): (&usize, &Motion)| {
            let place = |place: &Alternative| AlternativePose {
                pose: se3::to_rows(&(place.world_from_piece * scan_pose)),
                score: place.score,
            };
            AlternativesReport {
                name: names[*view].clone(),
                poses: self.places.iter().map(place).collect(),
                axis,
                along,
            }
        };
        views.map(row).collect()
    }
}

/// The places of pieces among the views that are placed; those with one place alone are left out.
pub fn alternatives(
    views: &[View],
    search: &Search,
    result: &Outcome,
    pieces: Vec<Piece>,
    progress: &Progress,
) -> Result<Vec<Alternatives>, Canceled> {
    let found: Vec<Option<Alternatives>> = pieces
        .into_par_iter()
        .with_max_len(1)
        .map(|piece| {
            progress.check()?;
            Ok(Ground::new(views, search, result, piece).and_then(Ground::alternatives))
        })
        .collect::<Result<_, Canceled>>()?;
    Ok(found.into_iter().flatten().collect())
}

/// A piece and the placed views beside it.
struct Ground<'a> {
    views: &'a [View],
    search: &'a Search,
    /// Placed views that are not of the piece, local frame to world.
    placed: Vec<(usize, Motion)>,
    piece: Piece,
    /// The piece's views, local frame to the piece's.
    members: Vec<(usize, Motion)>,
    /// Where the piece lies now, if it is placed.
    own: Option<Motion>,
    /// Size of the piece.
    radius: f64,
}

impl<'a> Ground<'a> {
    fn new(views: &'a [View], search: &'a Search, result: &Outcome, piece: Piece) -> Option<Self> {
        let is_beside = |view: &usize| result.placed[*view] && !piece.views.contains(view);
        let placed: Vec<(usize, Motion)> =
            (0..views.len()).filter(is_beside).map(|view| (view, result.local_poses[view])).collect();
        let local = |(view, pose): (&usize, &Motion)| (*view, views[*view].local_pose(pose));
        let members: Vec<(usize, Motion)> = piece.views.iter().zip(&piece.scan_poses).map(local).collect();
        let &(first, pose) = members.first()?;
        let own = result.placed[first].then(|| result.local_poses[first] * pose.inverse());
        let from_first = |(view, pose_of): &(usize, Motion)| {
            (pose_of.translation.vector - pose.translation.vector).norm() + views[*view].radius
        };
        let radius = members.iter().map(from_first).fold(0.0, f64::max);
        Some(Ground { views, search, placed, piece, members, own, radius })
    }

    fn edge(&self) -> f64 {
        self.search.edge
    }

    fn coarse_view(&self, view: usize) -> &CoarseView {
        // the first search is of all views
        &self.search.coarse_views[view]
    }

    /// Whether two worlds of the piece put it into the same place.
    fn is_same(&self, a: &Motion, b: &Motion) -> bool {
        let Some((_, pose)) = self.members.first() else { return true };
        alike(&(a * pose), &(b * pose), self.radius, TUNING.same * self.edge())
    }

    fn alternatives(self) -> Option<Alternatives> {
        let mut found: Vec<(f64, Motion)> = Vec::new();
        let raw = self.proposed();
        let best = raw.iter().map(|(balance, _)| *balance).fold(0.0, f64::max);
        let near = raw.iter().filter(|(balance, _)| *balance >= TUNING.least_raw * best).take(TUNING.tried);
        let mut drawn: Vec<(f64, Motion)> =
            near.map(|(balance, world)| self.drawn(world).unwrap_or((*balance, *world))).collect();
        drawn.sort_by(|a, b| b.0.total_cmp(&a.0));
        let best = drawn.first().map_or(0.0, |(balance, _)| *balance);
        for (_, world) in drawn.iter().take_while(|(balance, _)| *balance >= TUNING.least_drawn * best) {
            if !found.iter().any(|(_, other)| self.is_same(other, world)) {
                self.try_place(world, &mut found);
            }
        }
        self.try_products(&mut found);
        let best = found.first().map(|(balance, _)| *balance).filter(|best| *best >= TUNING.least)?;
        found.retain(|(balance, _)| *balance >= TUNING.least_score * best);
        let freedom = self.freedom(&found.first()?.1);
        found.truncate(if freedom.is_some() { 1 } else { MOST });
        let place = |(balance, world): &(f64, Motion)| Alternative { world_from_piece: *world, score: balance / best };
        let places: Vec<Alternative> = found.iter().map(place).collect();
        (places.len() > 1 || freedom.is_some()).then_some(Alternatives { piece: self.piece, places, freedom })
    }

    /// The worlds that hypotheses to placed views propose, and how much speaks for each; the best first.
    fn proposed(&self) -> Vec<(f64, Motion)> {
        let pose =
            |views: &[(usize, Motion)], view: usize| views.iter().find(|(v, _)| *v == view).map(|(_, pose)| *pose);
        let world = |hypothesis: &PairHypothesis| {
            let (i, j) = (hypothesis.i, hypothesis.j);
            match (pose(&self.placed, i), pose(&self.members, j)) {
                (Some(pose_i), Some(pose_j)) => Some(pose_i * hypothesis.i_from_j * pose_j.inverse()),
                _ => Some(pose(&self.placed, j)? * hypothesis.i_from_j.inverse() * pose(&self.members, i)?.inverse()),
            }
        };
        let mut hypotheses: Vec<&PairHypothesis> =
            self.search.hypotheses.iter().filter(|hypothesis| hypothesis.is_promising()).collect();
        hypotheses.sort_by(|a, b| b.score().total_cmp(&a.score()).then((a.i, a.j).cmp(&(b.i, b.j))));
        let mut worlds: Vec<Motion> = self.own.into_iter().collect();
        for world in hypotheses.into_iter().filter_map(world) {
            if worlds.len() < TUNING.tried && !worlds.iter().any(|other| self.is_same(other, &world)) {
                worlds.push(world);
            }
        }
        let mut rated: Vec<(f64, Motion)> = worlds.into_iter().map(|world| (self.balance(&world), world)).collect();
        rated.sort_by(|a, b| b.0.total_cmp(&a.0));
        rated
    }

    /// A world of a single view drawn onto the surfels of the placed ones, and how much speaks for it; `None` if it then lies
    /// elsewhere. Most places are found out by surfels alone, at a tenth of what the surface costs.
    fn drawn(&self, world: &Motion) -> Option<(f64, Motion)> {
        let [(view, pose)] = self.members[..] else { return None };
        let placed: Vec<(&CoarseView, Motion)> =
            self.placed.iter().map(|(view, pose)| (self.coarse_view(*view), *pose)).collect();
        let drawn = align_onto(&placed, self.coarse_view(view), &(world * pose), self.edge()) * pose.inverse();
        self.is_same(&drawn, world).then(|| (self.balance(&drawn), drawn))
    }

    /// The placed views that most agree with a world of the piece.
    fn grounds(&self, world: &Motion) -> Vec<(usize, Motion)> {
        let mut agree = vec![0.0; self.views.len()];
        self.measured(world).for_each(|hypothesis| agree[hypothesis.i] += hypothesis.evidence.both().agree);
        let mut grounds: Vec<(usize, Motion)> =
            self.placed.iter().filter(|(view, _)| agree[*view] > 0.0).copied().collect();
        grounds.sort_by(|a, b| agree[b.0].total_cmp(&agree[a.0]).then(a.0.cmp(&b.0)));
        grounds.truncate(TUNING.grounds);
        grounds
    }

    /// Draws a place onto the surface and keeps it if it is a new one; the best stay first.
    fn try_place(&self, world: &Motion, found: &mut Vec<(f64, Motion)>) -> bool {
        let spacing = common_spacing(self.views);
        let spacing = resolution(spacing, self.search.noise, self.edge());
        let refined = onto::settled(self.views, &self.grounds(world), &self.members, world, spacing);
        let world = if self.is_same(&refined, world) { refined } else { *world };
        if found.iter().any(|(_, other)| self.is_same(other, &world)) {
            return false;
        }
        let balance = self.balance(&world);
        if balance <= 0.0 {
            return false;
        }
        let place = found.partition_point(|(other, _)| *other >= balance);
        found.insert(place, (balance, world));
        true
    }

    /// Tries the products of the symmetries that the best places show, as long as they lead to new ones.
    fn try_products(&self, found: &mut Vec<(f64, Motion)>) {
        let mut tried = 0;
        let mut is_new = true;
        while is_new && tried < TUNING.tried {
            is_new = false;
            let Some(&(best, first)) = found.first() else { return };
            let known: Vec<Motion> = found
                .iter()
                .filter(|(balance, _)| *balance >= TUNING.least_score * best)
                .take(MOST)
                .map(|(_, world)| *world)
                .collect();
            let products = known.iter().skip(1).flat_map(|a| known.iter().skip(1).map(move |b| (a, b)));
            for world in products.flat_map(|(a, b)| [a * first.inverse() * b, first * a.inverse() * b]) {
                if tried < TUNING.tried && !found.iter().any(|(_, other)| self.is_same(other, &world)) {
                    tried += 1;
                    is_new |= self.try_place(&world, found);
                }
            }
        }
    }

    /// How much speaks for a world of the piece.
    fn balance(&self, world: &Motion) -> f64 {
        self.measured(world).map(|hypothesis| hypothesis.evidence.both().balance()).sum()
    }

    /// What all pairs of a placed view and one of the piece say of a world of the piece.
    fn measured(&self, world: &Motion) -> impl Iterator<Item = PairHypothesis> {
        let pairs = self.placed.iter().flat_map(|placed| self.members.iter().map(move |member| (placed, member)));
        pairs.filter_map(move |((i, pose_i), (j, pose_j))| {
            let i_from_j = pose_i.inv_mul(&(world * pose_j));
            let (a, b) = (self.coarse_view(*i), self.coarse_view(*j));
            let is_near = i_from_j.translation.vector.norm() <= a.radius + b.radius;
            let hypothesis = || PairHypothesis {
                i: *i,
                j: *j,
                i_from_j,
                evidence: verify(a, b, &i_from_j, self.edge(), TUNING.samples),
            };
            is_near.then(hypothesis)
        })
    }

    /// How the piece slides on the placed views, if it does.
    fn freedom(&self, world: &Motion) -> Option<Freedom> {
        let measured: Vec<PairHypothesis> = self.measured(world).collect();
        if !can_slip(&self.search.coarse_views, &measured, self.edge(), TUNING.samples) {
            return None;
        }
        weakest(&self.held(world))
    }

    /// The surfels of the piece that lie on placed views: position and normal in the world.
    fn held(&self, world: &Motion) -> Vec<(Vector3, Vector3)> {
        let reach2 = (TUNING.held * self.edge()).powi(2) as f32;
        let mut held = Vec::new();
        for (view, pose) in &self.members {
            let (coarse_view, pose) = (self.coarse_view(*view), world * pose);
            for index in coarse_view.inner.iter().map(|index| *index as usize) {
                let place = pose * Point3::from(coarse_view.position(index).cast::<f64>());
                let is_near = |(other, at): &(usize, Motion)| {
                    let local = at.inverse_transform_point(&place).coords.cast::<f32>();
                    self.coarse_view(*other).indexed.tree.nearest(&local.into(), reach2).is_some()
                };
                if self.placed.iter().any(is_near) {
                    held.push((place.coords, pose * coarse_view.normals[index].cast::<f64>()));
                }
            }
        }
        held
    }
}

/// The motion that changes the distances of a surface from itself least.
fn weakest(surfels: &[(Vector3, Vector3)]) -> Option<Freedom> {
    let slippage = Slippage::of(surfels)?;
    let WeakestMotion { shift, turn } = slippage.weakest();
    if turn.norm() < TUNING.turns * shift.norm() {
        return Some(Freedom::Along(shift.normalize()));
    }
    // the screw axis of the twist about the middle
    let point = slippage.middle() + slippage.spread() * turn.cross(&shift) / turn.norm_squared();
    Some(Freedom::Axis(point.into(), turn.normalize()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surface_of_revolution_gives_its_axis_and_a_gutter_its_direction() {
        let (axis, point) = (Vector3::new(1.0, 2.0, -0.5).normalize(), Vector3::new(30.0, -4.0, 7.0));
        let frame = nalgebra::Rotation3::rotation_between(&Vector3::z(), &axis).expect("not opposite");
        let on = |angle: f64, height: f64, radius: f64, slope: f64| {
            let out = Vector3::new(angle.cos(), angle.sin(), 0.0);
            let place = radius * out + Vector3::z() * height;
            (point + frame * place, frame * (out - slope * Vector3::z()).normalize())
        };
        let cone: Vec<_> =
            (0..400).map(f64::from).map(|k| on(0.01 * k, 0.3 * (k % 37.0), 9.0 + 0.15 * (k % 37.0), 0.5)).collect();
        let Some(Freedom::Axis(found, direction)) = weakest(&cone) else { panic!("a cone turns about its axis") };
        assert!(direction.dot(&axis).abs() > 0.9999, "{direction}");
        assert!((found.coords - point).cross(&axis).norm() < 0.05, "{found}");
        let waves = |k: f64| 0.3 * (k % 37.0);
        let gutter: Vec<_> = (0..400)
            .map(f64::from)
            .map(|k| {
                let (x, slope) = (waves(k), waves(k).sin());
                (Vector3::new(x, 1.0 - x.cos(), (k / 37.0).floor()), Vector3::new(-slope, 1.0, 0.0).normalize())
            })
            .collect();
        let Some(Freedom::Along(direction)) = weakest(&gutter) else { panic!("a gutter slides along itself") };
        assert!(direction.z.abs() > 0.999, "{direction}");
    }
}
