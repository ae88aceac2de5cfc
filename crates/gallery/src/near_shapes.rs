//! Models whose shapes are within a distance of a stored one's: those that may be the same thing. Exact.

use rayon::prelude::*;

use super::ModelId;
use super::gallery::Gallery;
use super::live_segment::LiveSegment;
use visage_shape::descriptor::ShapeDescriptor;

impl Gallery {
    /// The first model after this one, by id; the first of all without one.
    pub fn model_after(&self, last: Option<ModelId>) -> Option<ModelId> {
        let of_segment = |live: &LiveSegment| {
            let ids = &live.segment.ids;
            let from = last.map_or(0, |last| ids.partition_point(|id| *id <= last)) as u32;
            (from..ids.len() as u32).find(|place| live.is_alive(*place)).map(|place| ids[place as usize])
        };
        self.segments.iter().filter_map(of_segment).min()
    }

    /// The models before this one, by id, whose shapes are within `distance` of its own, ascending; none if it has no shape. Runs inside the
    /// caller's rayon pool.
    pub fn alike_before(&self, model: ModelId, distance: f64) -> Vec<ModelId> {
        let Some(shape) = self.shape(model) else { return Vec::new() };
        let mut found: Vec<ModelId> =
            self.segments.iter().flat_map(|live| alike_in(live, shape, model, distance)).collect();
        found.sort_unstable();
        found
    }

    fn shape(&self, model: ModelId) -> Option<&ShapeDescriptor> {
        let place = |live: &LiveSegment| live.segment.place(model).filter(|place| live.is_alive(*place));
        self.segments.iter().find_map(|live| live.segment.shapes.shape(place(live)?))
    }
}

fn alike_in(live: &LiveSegment, shape: &ShapeDescriptor, before: ModelId, distance: f64) -> Vec<ModelId> {
    let segment = &live.segment;
    let bounds = segment.shapes.against(shape);
    let reach = bounds.reach(distance);
    let end = segment.ids.partition_point(|id| *id < before) as u32;
    let is_alike = |place: &u32| {
        live.is_alive(*place)
            && bounds.least_within(*place, &reach).is_some()
            && segment.shapes.shape(*place).is_some_and(|other| shape.distance(other) <= distance)
    };
    let places = (0..end).into_par_iter().with_min_len(1024).filter(is_alike);
    places.map(|place| segment.ids[place as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_shape::faces::Signature;
    use visage_shape::faces::signature::example::example;

    #[test]
    fn it_is_what_measuring_all_finds_wherever_models_are_kept() {
        let models: Vec<(ModelId, Signature)> = (0..400u128)
            .map(|k| (k, example(0.11 * (k % 150) as f64, 5)))
            .map(|(k, signature)| if k % 9 == 4 { (k, signature.with_shape(None)) } else { (k, signature) })
            .collect();
        let mut gallery = Gallery::build(models[..250].to_vec());
        models[250..].iter().for_each(|(id, signature)| gallery.insert(*id, signature.clone()));
        assert!(gallery.remove(7) && gallery.remove(300));
        let mut some = 0;
        for (id, signature) in models.iter().filter(|(id, _)| ![7, 300].contains(id)) {
            for distance in [0.0, 0.2] {
                let is_near = |other: &Signature| {
                    signature.shape().zip(other.shape()).is_some_and(|(a, b)| a.distance(b) <= distance)
                };
                let expected: Vec<ModelId> = models[..*id as usize]
                    .iter()
                    .filter(|(other, signature)| ![7, 300].contains(other) && is_near(signature))
                    .map(|(other, _)| *other)
                    .collect();
                assert_eq!(gallery.alike_before(*id, distance), expected);
                some += usize::from(!expected.is_empty());
            }
        }
        assert!(some > 100, "{some}");
        assert_eq!(gallery.alike_before(7, 1.0), [], "it is gone");
    }

    #[test]
    fn models_come_in_order_of_their_ids() {
        let mut gallery = Gallery::build((0..40u128).map(|k| (3 * k, example(0.1, 4))).collect());
        (0..10u128).for_each(|k| gallery.insert(3 * k + 1, example(0.2, 4)));
        assert!(gallery.remove(0));
        let all: Vec<ModelId> =
            std::iter::successors(gallery.model_after(None), |last| gallery.model_after(Some(*last))).collect();
        assert_eq!(all.len(), 49);
        assert!(all.is_sorted() && all[0] == 1);
        assert_eq!(Gallery::default().model_after(None), None);
    }
}
