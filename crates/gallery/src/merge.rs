//! Small segments become larger ones, and those with many gaps are closed: the gallery's only upkeep. It takes
//! seconds, so it is apart from the changes that make it due and can be done beside searches and further changes.

use std::sync::Arc;

use super::gallery::{FULL_SEGMENT, Gallery, YOUNG_SEGMENT};
use super::live_segment::{Home, LiveSegment};
use super::segment::{Kept, Segment};
use super::segment_handle::SegmentHandle;

/// So many segments of one level become one. Each level holds so many times the models of the one below.
const FAN: usize = 8;

/// Segments that are to become one.
#[derive(Debug)]
pub struct Merge {
    sources: Vec<LiveSegment>,
}

/// The one they became.
#[derive(Debug)]
pub struct Merged {
    sources: Vec<LiveSegment>,
    segment: LiveSegment,
}

/// The level of a segment by its number of models; full ones have none.
fn level(models: usize) -> Option<usize> {
    let mut bound = YOUNG_SEGMENT;
    for level in 0.. {
        if models >= FULL_SEGMENT {
            return None;
        }
        if models <= bound {
            return Some(level);
        }
        bound *= FAN;
    }
    None
}

/// Whether a good part of a segment's models is gone.
fn has_gaps(live: &LiveSegment) -> bool {
    let gone = live.segment.ids.len() - live.models;
    gone > YOUNG_SEGMENT && gone > live.models / 3
}

impl Gallery {
    /// What should be merged next, if anything. To be run, and adopted by the gallery as it is then.
    pub fn due(&self) -> Option<Merge> {
        // the last is built anew by the next addition, unless it has grown up
        let grown_up = match self.segments.split_last() {
            Some((last, others)) if last.is_young() => others,
            _ => self.segments.as_slice(),
        };
        let of_level = |top_k: usize| {
            let segments: Vec<LiveSegment> =
                grown_up.iter().filter(|p| level(p.models) == Some(top_k)).cloned().collect();
            (segments.len() >= FAN).then(|| within_full(segments))
        };
        let top = level(FULL_SEGMENT - 1).unwrap_or(0);
        let gappy = || grown_up.iter().find(|live| has_gaps(live)).map(|live| vec![live.clone()]);
        let sources = (0..=top).find_map(of_level).or_else(gappy)?;
        Some(Merge { sources })
    }

    /// A segment to be built anew without its models that are gone, however few: nothing is kept of them then.
    pub fn due_to_forget(&self) -> Option<Merge> {
        let found = self.segments.iter().find(|live| live.models < live.segment.ids.len());
        found.map(|live| Merge { sources: vec![live.clone()] })
    }

    /// Puts a merged segment in the place of those it came from, without the models that went in the meantime.
    /// False if those are not all there any more: then nothing is changed.
    pub fn adopt(&mut self, merged: Merged) -> bool {
        let Merged { sources, segment } = merged;
        let is_source = |live: &&LiveSegment| sources.iter().any(|source| Arc::ptr_eq(&source.segment, &live.segment));
        let now: Vec<LiveSegment> = self.segments.iter().filter(is_source).cloned().collect();
        // one that lost its last model, or was merged otherwise, has left
        if now.len() < sources.len() {
            return false;
        }
        let mut live = segment;
        // both lists have the gallery's order
        for (before, now) in sources.iter().zip(&now) {
            for place in before.places().filter(|place| !now.is_alive(*place)) {
                live.forget(now.segment.ids[place as usize]);
            }
        }
        self.segments.retain(|live| !is_source(&live));
        // not at the end: the last is the one that additions go to
        self.segments.insert(0, live);
        true
    }

    /// Merges until nothing is due. Runs inside the caller's rayon pool.
    pub fn tidy(&mut self) {
        while let Some(merge) = self.due() {
            self.adopt(merge.run());
        }
    }
}

/// As many of the parts, at least two, as make no more than twice a full segment.
fn within_full(mut segments: Vec<LiveSegment>) -> Vec<LiveSegment> {
    let mut models = 0;
    let fitting = segments.iter().take_while(|live| {
        models += live.models;
        models <= 2 * FULL_SEGMENT
    });
    let count = fitting.count().max(2);
    segments.truncate(count);
    segments
}

impl Merge {
    /// The names of the files that it reads from.
    pub fn files(&self) -> impl Iterator<Item = u128> + '_ {
        self.sources.iter().filter_map(|source| SegmentHandle::of(source).file())
    }

    /// Builds the segment. Takes seconds for full ones; runs inside the caller's rayon pool.
    pub fn run(self) -> Merged {
        let kept: Vec<Kept> = self.sources.iter().map(LiveSegment::kept).collect();
        let segment = Segment::build(&kept, &[]);
        drop(kept);
        let is_owed = self.sources.iter().any(|source| source.home != Home::Memory);
        let home = if is_owed { Home::Owed } else { Home::Memory };
        Merged { sources: self.sources, segment: LiveSegment::at(Arc::new(segment), home) }
    }
}

impl Merged {
    /// The segment, to be stored.
    pub fn segment(&self) -> SegmentHandle {
        SegmentHandle::of(&self.segment)
    }

    /// The same with the segment as it is in its file.
    #[must_use]
    pub fn stored_as(self, stored: SegmentHandle) -> Merged {
        Merged { segment: stored.into_live(), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{IndexedModel, ModelId};
    use super::*;
    use visage_shape::faces::signature::example::example;

    fn entry(k: ModelId) -> IndexedModel {
        IndexedModel::new(k, example(0.1 * k as f64, 3))
    }

    fn ids(gallery: &Gallery) -> Vec<ModelId> {
        let mut ids: Vec<ModelId> =
            gallery.segments.iter().flat_map(|live| live.places().map(|p| live.segment.ids[p as usize])).collect();
        ids.sort_unstable();
        ids
    }

    #[test]
    fn levels_rise_with_the_number_of_models() {
        assert_eq!([1, 64, 65, 512, 513, 4096, 32_768, 65_535].map(level), [0, 0, 1, 1, 2, 2, 3, 4].map(Some));
        assert_eq!(level(FULL_SEGMENT), None);
    }

    #[test]
    fn many_additions_leave_few_segments() {
        let mut gallery = Gallery::default();
        for k in 0..700 {
            gallery.put(&entry(k));
            if gallery.due().is_some() {
                gallery.tidy();
            }
        }
        assert!(gallery.segments.len() <= 2 * FAN, "{}", gallery.segments.len());
        assert!(gallery.due().is_none());
        assert_eq!(ids(&gallery), (0..700).collect::<Vec<_>>());
    }

    #[test]
    fn changes_during_a_merge_are_not_lost() {
        let mut gallery = Gallery::default();
        for k in 0..10 {
            gallery.append(&(0..20).map(|j| entry(20 * k + j)).collect::<Vec<_>>());
        }
        let merged = gallery.due().expect("ten of one level").run();
        assert!(gallery.remove(33) && gallery.remove(199));
        gallery.put(&entry(500));
        gallery.put(&entry(34));
        let before = ids(&gallery);
        assert!(gallery.adopt(merged));
        assert_eq!(ids(&gallery), before);
        assert!(!before.contains(&33) && before.contains(&34) && before.contains(&500));
        assert_eq!((gallery.len(), gallery.segments.len()), (before.len(), 2));
    }

    #[test]
    fn a_merge_of_what_is_not_there_any_more_is_thrown_away() {
        let mut gallery = Gallery::default();
        for k in 0..9 {
            gallery.append(&[entry(k)]);
        }
        let merged = gallery.due().expect("eight of one level").run();
        assert!(gallery.remove(3));
        assert!(!gallery.adopt(merged));
        assert_eq!(ids(&gallery), [0, 1, 2, 4, 5, 6, 7, 8]);
    }

    #[test]
    fn what_is_gone_is_forgotten_altogether_when_that_is_asked() {
        let mut gallery = Gallery::default();
        (0..3).for_each(|k| gallery.append(&(100 * k..100 * k + 80).map(entry).collect::<Vec<_>>()));
        assert!(gallery.remove(5) && gallery.remove(207));
        assert!(gallery.due().is_none(), "they are few");
        let before = ids(&gallery);
        while let Some(merge) = gallery.due_to_forget() {
            assert!(gallery.adopt(merge.run()));
        }
        assert_eq!(ids(&gallery), before);
        assert!(gallery.segments().all(|segment| !segment.contains(5) && !segment.contains(207)));
    }

    #[test]
    fn gaps_are_closed() {
        let mut gallery = Gallery::default();
        gallery.append(&(0..400).map(entry).collect::<Vec<_>>());
        for k in 0..150 {
            assert!(gallery.remove(k));
        }
        gallery.tidy();
        assert_eq!(gallery.segments[0].segment.ids.len(), 250);
        assert_eq!(ids(&gallery), (150..400).collect::<Vec<_>>());
    }
}
