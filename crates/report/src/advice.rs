//! What a report says, in words that need no knowledge of how registration works, with what to do about it.

use super::found::{Found, Pair};
use visage_picture::legend::number;

/// A place of which it is this sure is one to look at.
const SURE: f64 = 0.9;
/// A pose that may be off by so many spacings is one to look at.
const LOOSE: f64 = 1.0;
/// A surface of which so much was seen by nobody is one to look at.
const UNSEEN: f64 = 0.02;
/// More of one kind are counted and not named.
const MOST_OF_A_KIND: usize = 8;

/// The verdict in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InWords {
    /// good, doubtful, failed; other for what has no verdict.
    pub class: &'static str,
    /// In a few words.
    pub headline: &'static str,
    /// What that means.
    pub meaning: &'static str,
}

/// Something to look at, and what to do about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Advice {
    /// What is the matter.
    pub what: String,
    /// What to do.
    pub todo: &'static str,
}

/// What the verdict means.
pub fn verdict(found: Option<&Found>) -> InWords {
    let quality = found.and_then(|found| found.result.verdict.as_ref()).map(|verdict| verdict.quality.as_str());
    let of_model = found.is_some_and(|found| found.result.of_model.is_some());
    let [class, headline, meaning] = match quality {
        Some("good") => [
            "good",
            "The scans fit together",
            "Nothing that was checked speaks against this result: neighbours touch where they overlap, and no scan has surface where \
             another looked through.",
        ],
        Some("doubtful") => [
            "doubtful",
            "Look at this before you use it",
            "Something does not fit as it should. Most of the result may be right: the list below says which scans to look at.",
        ],
        Some("failed") => [
            "failed",
            "Do not use this result",
            "Scans have no place, or lie where they do not belong. The list below says what is missing.",
        ],
        Some(_) => ["other", "A verdict that this version does not know", "The reasons are below."],
        None if of_model => [
            "other",
            "A surface of points that were there before",
            "Nothing was registered: the points are those of another model, and only their surface was made.",
        ],
        None => [
            "other",
            "Uploaded as it is",
            "Nothing was registered here: the model came as one file, and nothing is known of the scans that it was made of.",
        ],
    };
    InWords { class, headline, meaning }
}

/// What to look at, the worst first.
pub fn advice(found: &Found) -> Vec<Advice> {
    let mut all = Vec::new();
    all.extend(limited(without_place(found)));
    all.extend(limited(weak_links(found)));
    all.extend(limited(unsure(found)));
    all.extend(limited(copies(found)));
    let unseen = found.result.surface.as_ref().map_or(0.0, |surface| surface.unseen_area);
    if unseen > UNSEEN {
        all.push(Advice {
            what: format!("{:.0} % of the surface was filled in: nobody saw it", 100.0 * unseen),
            todo: "The picture of support shows where. Add scans from there, or leave it open (fill: none).",
        });
    }
    if found.result.surface.as_ref().is_some_and(|surface| surface.widened) {
        all.push(Advice {
            what: "the surface is coarser than the scans resolve, to stay within memory".to_owned(),
            todo: "Run it again with more memory if fine detail matters.",
        });
    }
    all
}

/// A few of one kind, and how many more there are.
fn limited(mut all: Vec<Advice>) -> Vec<Advice> {
    if let Some(todo) = all.get(MOST_OF_A_KIND).map(|advice| advice.todo) {
        let more = all.len() - MOST_OF_A_KIND;
        all.truncate(MOST_OF_A_KIND);
        all.push(Advice { what: format!("and {more} more of this kind"), todo });
    }
    all
}

fn without_place(found: &Found) -> Vec<Advice> {
    let unplaced = found.result.views.iter().filter(|view| !view.placed && view.copy_of.is_none());
    let advice = |view: &super::found::View| Advice {
        what: match &view.unplaced {
            Some(why) => format!("{} has no place among the others: {}", view.name, why.replace('_', " ")),
            None => format!("{} has no place among the others", view.name),
        },
        todo: "Add scans between it and the others, so that each shares about a third of what it sees with the next; or say where it \
               belongs by a few points that you pick in two scans (hints).",
    };
    unplaced.map(advice).collect()
}

fn weak_links(found: &Found) -> Vec<Advice> {
    let links = found.links();
    let name = |index: usize| found.result.views.get(index).map_or("?", |view| view.name.as_str());
    let neighbours = |index: usize| links.iter().filter(|link| link.i == index || link.j == index).count();
    let advice = |(link, is_weak): (&Pair, bool)| {
        let (a, b) = (name(link.i), name(link.j));
        let spacings = link.disagreement / found.result.spacing;
        if !is_weak {
            return None;
        }
        if spacings.is_finite() && spacings > 2.0 {
            return Some(Advice {
                what: format!("{a} and {b} disagree with all others by {} spacings", number(spacings)),
                todo: "Look at both in a section. Parts that repeat may have been taken for each other: pick a few points in both (hints).",
            });
        }
        let alone = [(link.i, link.j), (link.j, link.i)].into_iter().find(|(one, _)| neighbours(*one) == 1);
        let what = match alone {
            Some((one, other)) => format!("{} is held by one neighbour alone, {}", name(one), name(other)),
            None => format!("only {a} and {b} join the scans on either side of them"),
        };
        Some(Advice { what, todo: "Add a scan between the two: then an error of one link would be seen." })
    };
    links.iter().zip(found.weak()).filter_map(advice).collect()
}

fn unsure(found: &Found) -> Vec<Advice> {
    let advice = |view: &super::found::View| {
        let displacement = view.uncertainty.as_ref().and_then(|uncertainty| uncertainty.displacement_spacings);
        match (view.confidence, displacement) {
            (Some(sure), _) if sure < SURE => Some(Advice {
                what: format!("that {} lies where it belongs is {:.0} % sure", view.name, 100.0 * sure),
                todo: "It may fit elsewhere too. Add a scan that overlaps it more, or say where it belongs (hints).",
            }),
            (_, Some(spacings)) if spacings > LOOSE => Some(Advice {
                what: format!("{} may be off by {} spacings: little holds it", view.name, number(spacings)),
                todo: "Add a scan that sees the same place together with more of its surroundings.",
            }),
            _ => None,
        }
    };
    found.result.views.iter().filter(|view| view.placed).filter_map(advice).collect()
}

fn copies(found: &Found) -> Vec<Advice> {
    let copies = found.result.views.iter().filter_map(|view| Some((&view.name, view.copy_of.as_ref()?)));
    let todo = "It bears out nothing. If it was to be another scan, send that one.";
    copies.map(|(name, of)| Advice { what: format!("{name} has the points of {of}"), todo }).collect()
}

/// What the figures can't tell.
pub fn not_shown(found: Option<&Found>) -> Vec<&'static str> {
    let mut all = vec![
        "Errors that all scans share, such as a scanner that measures too large, leave no trace here: what was measured is compared with \
         itself.",
    ];
    let Some(found) = found else { return all };
    if !found.result.views.is_empty() {
        all.push(
            "Small residuals say that scans lie on each other, not that they lie where they belong: a turned bottle fits anywhere. The \
             pictures of scans in colours and of the section show more than any figure.",
        );
        all.push("Where one scan alone saw the surface, no other bears it out.");
        if found.result.confidence.is_none() {
            all.push("The poses that were given were kept. Whether the scans would fit elsewhere was not asked, so there is no confidence.");
        }
    }
    if found.result.surface.is_some() {
        all.push("What was filled in follows its surroundings. It looks right and was never measured.");
    }
    if found.result.unit.is_empty() || found.result.unit == "unknown" {
        all.push("The unit is not known: all lengths are in that of the files, whatever it is.");
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::found::{Findings, Uncertainty, Verdict, View};

    fn found(views: Vec<View>, pairs: &[(usize, usize)]) -> Found {
        let pair = |(i, j): &(usize, usize)| Pair { i: *i, j: *j, trust: 1.0, ..Pair::default() };
        let verdict = Some(Verdict { quality: "doubtful".to_owned(), reasons: vec!["why".to_owned()] });
        let pairs = pairs.iter().map(pair).collect();
        let result = Findings { views, pairs, spacing: 1.0, verdict, ..Findings::default() };
        Found { result, ..Found::default() }
    }

    fn view(name: &str) -> View {
        View { name: name.to_owned(), placed: true, ..View::default() }
    }

    fn whats(found: &Found) -> Vec<String> {
        advice(found).into_iter().map(|advice| advice.what).collect()
    }

    #[test]
    fn a_scan_that_hangs_on_one_neighbour_is_named_with_it() {
        let found = found(["a", "b", "c", "d"].map(view).to_vec(), &[(0, 1), (1, 2), (2, 0), (2, 3)]);
        assert_eq!(whats(&found), ["d is held by one neighbour alone, c"]);
        assert!(advice(&found)[0].todo.starts_with("Add a scan between"));
    }

    #[test]
    fn what_is_wrong_is_said_once_and_in_order() {
        let mut views = ["a", "b", "c"].map(view).to_vec();
        views[0].uncertainty = Some(Uncertainty { displacement_spacings: Some(3.0) });
        views[1].confidence = Some(0.42);
        views[2].placed = false;
        views[2].unplaced = Some("no_overlap".to_owned());
        views.push(View { copy_of: Some("a".to_owned()), ..view("d") });
        let mut found = found(views, &[(0, 1)]);
        found.result.surface = Some(crate::found::SurfaceFound { unseen_area: 0.2, ..Default::default() });
        let whats = whats(&found);
        assert!(whats[0].starts_with("c has no place among the others: no overlap"), "{whats:?}");
        assert!(whats.iter().any(|what| what.contains("b lies where it belongs is 42 % sure")), "{whats:?}");
        assert!(whats.iter().any(|what| what.contains("a may be off by 3 spacings")), "{whats:?}");
        assert!(whats.iter().any(|what| what == "d has the points of a"), "{whats:?}");
        assert!(whats.last().is_some_and(|what| what.starts_with("20 % of the surface")), "{whats:?}");
    }

    #[test]
    fn hundreds_of_a_kind_are_counted() {
        let views = (0..300).map(|k| View { placed: false, ..view(&format!("scan {k}")) }).collect();
        let whats = whats(&found(views, &[]));
        assert_eq!(whats.len(), MOST_OF_A_KIND + 1);
        assert_eq!(whats.last().map(String::as_str), Some("and 292 more of this kind"));
    }

    #[test]
    fn every_verdict_has_words_and_so_has_none() {
        let of = |quality: &str| {
            let verdict = Some(Verdict { quality: quality.to_owned(), reasons: Vec::new() });
            Found { result: Findings { verdict, ..Findings::default() }, ..Found::default() }
        };
        let classes = ["good", "doubtful", "failed", "splendid"].map(|quality| verdict(Some(&of(quality))).class);
        assert_eq!(classes, ["good", "doubtful", "failed", "other"]);
        assert_eq!(verdict(None).headline, "Uploaded as it is");
        assert!(not_shown(Some(&of("good"))).iter().any(|words| words.contains("unit is not known")));
    }
}
