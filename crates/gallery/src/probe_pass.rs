//! A search's pass over a part of the gallery, which measures few of its models.
//!
//! Two sure faces are compared by their dense distance alone. Most distances are known to be too great by three bounds, each
//! closer and dearer than the one before: by PCA codes, by the points at which faces differ most, by all points ([`super::face_order`],
//! [`super::dense_rows`]). What is no sure face is kept for later if its score may be great enough.

use super::dense_rows::DenseProbe;
use super::likeness::{FACE_KINSHIP, Weights};
use super::live_segment::LiveSegment;
use super::probe::{Address, Found, Probe};
use super::segment::Segment;
use visage_shape::faces::judgement::MATCH_SCORE;

/// Faces that are held against one bound after the other together, so that memory is read for many at once.
const BLOCK: usize = if cfg!(test) { 32 } else { 1024 };
/// More than rounding makes of a score.
const HAIR: f64 = 1e-12;

impl Probe {
    /// Offers all of a part that are compared by their dense signatures; adds where the others are that have a chance.
    pub fn scan(&self, segments: &[LiveSegment], which: usize, found: &mut Found, others: &mut Vec<Address>) {
        if let Some(dense) = &self.dense {
            self.scan_faces(dense, segments, which, found);
        }
        others.extend(self.unsure_places(&segments[which], found.least()).into_iter().map(|place| (which, place)));
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

    /// The places of the models that are not compared by their dense signatures alone and whose score may be `least`.
    fn unsure_places(&self, live: &LiveSegment, least: f64) -> Vec<u32> {
        let (scores, faces) = (&live.segment.face_scores, &live.segment.faces);
        let may_come_in = |place: &u32| self.weights(live, *place).likeness(Some(0.0), 1.0) >= least;
        if self.face_score < MATCH_SCORE {
            let unsure = live.places().filter(|place| !self.is_told(live, *place));
            return unsure.filter(may_come_in).collect();
        }
        // all that are not told are less surely faces than the probe; the more surely one is, the more it may score
        let is_worth_it = |place: &&u32| {
            let score = scores[**place as usize];
            let most = Weights::new(self.face_score, score, true).likeness(Some(0.0), 1.0);
            most >= least - HAIR
        };
        let lists = [&faces.places[self.sure_faces(&live.segment)..], &faces.others];
        let unsure = lists.into_iter().flat_map(|places| places.iter().take_while(is_worth_it)).copied();
        unsure.filter(|place| live.is_alive(*place) && may_come_in(place)).collect()
    }

    /// Whether a model is compared by its dense signature alone: it and the probe are faces for sure.
    fn is_told(&self, live: &LiveSegment, place: u32) -> bool {
        let score = live.segment.face_scores[place as usize];
        Weights::are_sure(self.face_score, score) && self.dense.is_some() && !live.segment.dense.is_missing(place)
    }
}
