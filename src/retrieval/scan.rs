//! A search's pass over a part of the gallery, which measures few of its models.
//!
//! Two sure faces are told by their dense distance alone. Most distances are known to be too great by three bounds, each
//! closer and dearer than the one before: by gists, by the foremost points, by all points ([`super::face_list`],
//! [`super::dense_rows`]). What is no sure face is kept for later if its score may be great enough.

use super::dense_rows::DenseProbe;
use super::likeness::{FACE_KINSHIP, Weights};
use super::part::Part;
use super::probe::{Address, Found, Probe};
use super::segment::Segment;
use crate::faces::judgement::MATCH_SCORE;

/// Faces that are held against one bound after the other together, so that memory is read for many at once.
const BLOCK: usize = if cfg!(test) { 32 } else { 1024 };
/// More than rounding makes of a score.
const HAIR: f64 = 1e-12;

impl Probe {
    /// Offers all of a part that are told by their dense signatures; adds where the others are that have a chance.
    pub fn scan(&self, parts: &[Part], which: usize, found: &mut Found, others: &mut Vec<Address>) {
        if let Some(dense) = &self.dense {
            self.scan_faces(dense, parts, which, found);
        }
        others.extend(self.unsure_places(&parts[which], found.least()).into_iter().map(|place| (which, place)));
    }

    fn scan_faces(&self, dense: &DenseProbe, parts: &[Part], which: usize, found: &mut Found) {
        let part = &parts[which];
        let (rows, list) = (&part.segment.dense, &part.segment.faces);
        let sure = self.sure_faces(&part.segment);
        let faces = list.against(dense.signature());
        if found.least() < FACE_KINSHIP {
            // whatever seems near first: all others are held against what that finds
            let nearest = faces.nearest(found.wanted.limit, sure).into_iter().map(|number| list.places[number]);
            nearest
                .filter(|place| part.is_alive(*place))
                .for_each(|place| self.offer_face(parts, (which, place), found));
        }
        // two sure faces are weighed so
        let bound = |least: f64| faces.bound(Weights::new(1.0, 1.0, true).reach_mm(least));
        let (mut least, mut known) = (found.least(), bound(found.least()));
        let mut near = Vec::new();
        for start in (0..sure).step_by(BLOCK) {
            faces.near(start..sure.min(start + BLOCK), &known, &mut near);
            let places = near.iter().map(|number| list.places[*number]).filter(|place| part.is_alive(*place));
            rows.fetch(places.clone());
            for place in places {
                if dense.is_beyond(rows, place, &known.rows) {
                    continue;
                }
                self.offer_face(parts, (which, place), found);
                if found.least().to_bits() != least.to_bits() {
                    // changes seldom
                    (least, known) = (found.least(), bound(found.least()));
                }
            }
        }
    }

    /// How many of a segment's faces are told by their dense signatures alone: the first ones.
    fn sure_faces(&self, segment: &Segment) -> usize {
        let is_sure = |place: &u32| Weights::are_sure(self.face_score, segment.face_scores[*place as usize]);
        self.dense.as_ref().map_or(0, |_| segment.faces.places.partition_point(is_sure))
    }

    /// Offers a model that is told by its dense signature alone.
    fn offer_face(&self, parts: &[Part], (which, place): Address, found: &mut Found) {
        let segment = &parts[which].segment;
        let weights = self.weights(&parts[which], place);
        let distance_mm = self.dense.as_ref().and_then(|dense| dense.distance_mm(&segment.dense, place));
        found.offer(segment.ids[place as usize], (which, place), weights.likeness(distance_mm, 0.0));
    }

    /// The places of the models that are not told by their dense signatures alone and whose score may be `least`.
    fn unsure_places(&self, part: &Part, least: f64) -> Vec<u32> {
        let (scores, faces) = (&part.segment.face_scores, &part.segment.faces);
        let may_come_in = |place: &u32| self.weights(part, *place).likeness(Some(0.0), 1.0) >= least;
        if self.face_score < MATCH_SCORE {
            let unsure = part.places().filter(|place| !self.is_told(part, *place));
            return unsure.filter(may_come_in).collect();
        }
        // all that are not told are less surely faces than the probe; the more surely one is, the more it may score
        let is_worth_it = |place: &&u32| {
            let score = scores[**place as usize];
            let most = Weights::new(self.face_score, score, true).likeness(Some(0.0), 1.0);
            most >= least - HAIR
        };
        let lists = [&faces.places[self.sure_faces(&part.segment)..], &faces.others];
        let unsure = lists.into_iter().flat_map(|places| places.iter().take_while(is_worth_it)).copied();
        unsure.filter(|place| part.is_alive(*place) && may_come_in(place)).collect()
    }

    /// Whether a model is told by its dense signature alone: it and the probe are faces for sure.
    fn is_told(&self, part: &Part, place: u32) -> bool {
        let score = part.segment.face_scores[place as usize];
        Weights::are_sure(self.face_score, score) && self.dense.is_some() && !part.segment.dense.is_missing(place)
    }
}
