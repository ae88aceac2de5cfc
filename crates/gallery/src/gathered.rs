//! Rankings of parts of a gallery, searched apart from each other, as the one of the whole.

use super::{Match, Rank};

/// The best `limit` of several rankings whose models are all different, each best first: what a search over all of them would find. A
/// model's score depends on the question and its own signature alone, so it does not matter beside which others it was searched.
pub fn gathered(rankings: impl IntoIterator<Item = Vec<Match>>, limit: usize) -> Vec<Match> {
    let mut all: Vec<Match> = rankings.into_iter().flatten().collect();
    all.sort_by_key(|found| Rank { score: found.score, model_id: found.model_id }.key());
    all.truncate(limit);
    all
}

#[cfg(test)]
mod tests {
    use super::super::outline::triangles_of;
    use super::super::{Gallery, Likeness, MatchMethod, ModelId, TopK};
    use super::*;
    use proptest::prelude::*;
    use visage_shape::faces::Signature;
    use visage_shape::faces::signature::example::example;

    /// Of 24 different signatures, so that models tie.
    fn signature(id: ModelId) -> Signature {
        example(0.37 * (id % 24) as f64, 4 + (id % 5) as usize)
    }

    type Ask<'a> = Box<dyn Fn(&Gallery, &TopK) -> Vec<Match> + 'a>;

    /// Every kind of question.
    fn questions(probe: &Signature) -> Vec<Ask<'_>> {
        let mut asks: Vec<Ask> = [Likeness::Shape, Likeness::SalientRegions, Likeness::View]
            .into_iter()
            .map(|likeness| -> Ask { Box::new(move |g, k| g.by_likeness(probe, likeness, Some(3), k)) })
            .collect();
        asks.push(Box::new(|g, k| g.by_standard("face", MatchMethod::Verified, k).expect("built in")));
        asks.push(Box::new(|g, k| g.by_triangle(triangles_of(probe)[2].corners, None, k)));
        asks
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]
        #[test]
        fn however_models_are_divided_the_answer_is_that_of_one_gallery(
            holders in prop::collection::vec((0usize..4, any::<bool>()), 30..120), removed in prop::collection::vec(0u128..120, 0..20),
            seed in 0u32..40, limit in 1usize..40, page in any::<bool>(),
        ) {
            let models: Vec<(ModelId, Signature)> =
                (0..holders.len() as u128).map(|id| (id, signature(id))).collect();
            // half of the models come one by one, into segments of other sizes than those of the whole
            let built = |of: Option<usize>| {
                let mine = |id: &ModelId| of.is_none_or(|holder| holders[*id as usize].0 == holder);
                let (early, late): (Vec<_>, Vec<_>) = models.iter().filter(|(id, _)| mine(id)).cloned()
                    .partition(|(id, _)| holders[*id as usize].1);
                let mut gallery = Gallery::build(early);
                late.into_iter().for_each(|(id, signature)| gallery.insert(id, signature));
                removed.iter().for_each(|id| { gallery.remove(*id); });
                gallery
            };
            let (whole, parts) = (built(None), [0, 1, 2, 3].map(|holder| built(Some(holder))));
            let probe = example(0.41 * f64::from(seed), 6);
            for ask in questions(&probe) {
                let first = ask(&whole, &TopK::best(limit));
                let after = first.last().filter(|_| page).map(|last| Rank { score: last.score, model_id: last.model_id });
                let top_k = TopK { after, ..TopK::best(limit) };
                let of_all = ask(&whole, &top_k);
                prop_assert_eq!(&gathered(parts.iter().map(|part| ask(part, &top_k)), limit), &of_all);
                // the same where each is a view of the whole
                let views = (0..4).map(|holder| whole.only(|id| holders[id as usize].0 == holder));
                let views: Vec<Gallery> = views.collect();
                prop_assert_eq!(views.iter().map(Gallery::len).sum::<usize>(), whole.len());
                prop_assert_eq!(&gathered(views.iter().map(|view| ask(view, &top_k)), limit), &of_all);
            }
        }
    }

    #[test]
    fn nothing_gathered_is_nothing() {
        assert!(gathered([], 5).is_empty() && gathered([Vec::new(), Vec::new()], 5).is_empty());
    }
}
