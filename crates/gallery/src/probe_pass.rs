//! A search's pass over a part of the gallery, which measures few of its models.
//!
//! Two sure faces are compared by their dense distance alone. Most distances are known to be too great by three bounds, each
//! closer and dearer than the one before: by PCA codes, by the points at which faces differ most, by all points ([`super::face_order`],
//! [`super::dense_rows`]). What is no sure face is kept for later if its shape may be near enough ([`super::shape_rows`]).

use super::dense_rows::DenseProbe;
use super::likeness::{FACE_KINSHIP, Weights, as_things, reach_of_things};
use super::live_segment::LiveSegment;
use super::probe::{Address, Found, Probe, Unsure};
use super::segment::Segment;
use visage_shape::faces::judgement::MATCH_SCORE;

/// Faces that are held against one bound after the other together, so that memory is read for many at once.
const BLOCK: usize = if cfg!(test) { 32 } else { 1024 };
/// Of a segment at least so many models are measured before any bound is.
const LEAST_NEAR: usize = 64;
/// More than rounding makes of a score.
const HAIR: f64 = 1e-12;

impl Probe {
    /// Offers all of a part that are compared by their dense signatures; adds the others that have a chance.
    pub fn scan(&self, segments: &[LiveSegment], which: usize, found: &mut Found, others: &mut Vec<Unsure>) {
        if let Some(dense) = &self.dense {
            self.scan_faces(dense, segments, which, found);
        }
        let live = &segments[which];
        let bounds = self.shape.as_ref().map(|shape| live.segment.shapes.against(shape));
        if let Some(bounds) = bounds.as_ref().filter(|_| found.least() <= 0.0 && self.face_score < MATCH_SCORE) {
            // whatever seems near first: all others are held against what that finds
            let all = bounds.reach(f64::INFINITY);
            let least = |place: u32| Some((bounds.least_within(place, &all)?, place));
            let mut near: Vec<(f64, u32)> = live.places().filter_map(least).collect();
            let count = (2 * found.top_k.limit).max(LEAST_NEAR);
            if count < near.len() {
                near.select_nth_unstable_by(count, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                near.truncate(count);
            }
            let addresses = near.into_iter().map(|(_, place)| (which, place));
            addresses.for_each(|address| self.offer_thing(segments, address, found));
        }
        let least = found.least();
        // beside their shapes models may have their faces in common
        let of_faces = self.dense.as_ref().map_or(0.0, |_| (self.face_score / MATCH_SCORE).min(1.0));
        let reach = reach_of_things(least - of_faces);
        let bounds = bounds.as_ref().map(|bounds| (bounds, bounds.reach(reach)));
        let has_reach = reach.is_finite();
        let offered = |place: u32| {
            let distance = bounds.as_ref().and_then(|(bounds, reach)| bounds.least_within(place, reach));
            if has_reach && distance.is_none() {
                return None;
            }
            let most = self.weights(live, place).likeness(Some(0.0), as_things(distance));
            (most >= least - HAIR).then(|| Unsure {
                most,
                id: live.segment.ids[place as usize],
                address: (which, place),
            })
        };
        self.for_each_unsure(live, least, |place| others.extend(offered(place)));
    }

    fn scan_faces(&self, dense: &DenseProbe, segments: &[LiveSegment], which: usize, found: &mut Found) {
        let live = &segments[which];
        let (rows, list) = (&live.segment.dense, &live.segment.faces);
        let sure = self.sure_faces(&live.segment);
        let faces = list.against(dense.signature());
        if found.least() < FACE_KINSHIP {
            // whatever seems near first: all others are held against what that finds
            let nearest = faces.nearest(found.top_k.limit, sure).into_iter().map(|number| list.places[number]);
            nearest
                .filter(|place| live.is_alive(*place))
                .for_each(|place| self.offer_face(segments, (which, place), found));
        }
        // two sure faces are weighed so
        let bound = |least: f64| faces.bound(Weights::new(1.0, 1.0, true).reach_mm(least));
        let (mut least, mut known) = (found.least(), bound(found.least()));
        let mut near = Vec::new();
        for start in (0..sure).step_by(BLOCK) {
            faces.near(start..sure.min(start + BLOCK), &known, &mut near);
            let places = near.iter().map(|number| list.places[*number]).filter(|place| live.is_alive(*place));
            rows.fetch(places.clone());
            for place in places {
                if dense.is_beyond(rows, place, &known.rows) {
                    continue;
                }
                self.offer_face(segments, (which, place), found);
                if found.least().to_bits() != least.to_bits() {
                    // changes seldom
                    (least, known) = (found.least(), bound(found.least()));
                }
            }
        }
    }

    /// How many of a segment's faces are compared by their dense signatures alone: the first ones.
    fn sure_faces(&self, segment: &Segment) -> usize {
        let is_sure = |place: &u32| Weights::are_sure(self.face_score, segment.face_scores[*place as usize]);
        self.dense.as_ref().map_or(0, |_| segment.faces.places.partition_point(is_sure))
    }

    /// Offers a model that is compared by its dense signature alone.
    fn offer_face(&self, segments: &[LiveSegment], (which, place): Address, found: &mut Found) {
        let segment = &segments[which].segment;
        let weights = self.weights(&segments[which], place);
        let distance_mm = self.dense.as_ref().and_then(|dense| dense.distance_mm(&segment.dense, place));
        found.offer(segment.ids[place as usize], (which, place), weights.likeness(distance_mm, 0.0));
    }

    /// Visits the places of the models that are not compared by their dense signatures alone, but for those that no shape would
    /// give a score of `least`.
    fn for_each_unsure(&self, live: &LiveSegment, least: f64, mut visit: impl FnMut(u32)) {
        let (scores, faces) = (&live.segment.face_scores, &live.segment.faces);
        if self.face_score < MATCH_SCORE {
            // no model and this probe are both faces for sure
            return live.places().for_each(visit);
        }
        // all that are not told are less surely faces than the probe; the more surely one is, the more it may score
        let is_worth_it = |place: &&u32| {
            let score = scores[**place as usize];
            let most = Weights::new(self.face_score, score, true).likeness(Some(0.0), 1.0);
            most >= least - HAIR
        };
        let lists = [&faces.places[self.sure_faces(&live.segment)..], &faces.others];
        let unsure = lists.into_iter().flat_map(|places| places.iter().take_while(is_worth_it)).copied();
        unsure.filter(|place| live.is_alive(*place)).for_each(&mut visit);
    }
}
