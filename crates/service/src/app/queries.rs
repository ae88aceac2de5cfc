//! The gallery is asked: which models are of a class, are like this one, have this triangle on them.

use std::collections::{HashMap, HashSet};

use super::context::ServiceContext;
use super::live_gallery::NotReady;
use super::placing::Shows;
use super::search::message::Found;
use super::search::{Elsewhere, scatter};
use super::standards::{self, Ranking};
use crate::storage::DatabaseError;
use visage_domain::{MatchedModel, ModelId, PARTS, Parts, StandardRecord, StoredVerdict};
use visage_gallery::{
    Comparison, Evidence, Filter, Gallery, Likeness, Match, PROBE_MATCH_SCORE, Rank, Reason, TopK, compare,
    triangle_match_score,
};
use visage_geometry::{Point3, Vector3};
use visage_shape::faces::judgement::MATCH_SCORE;
use visage_shape::faces::{FaceStandard, MatchMethod, Signature, standard};
use visage_shape::standards::limit::Learned;

/// A question: about what, and which part of the ranking is wanted.
#[derive(Debug, Clone)]
pub struct Question {
    /// About what.
    pub about: About,
    /// At most so many matches.
    pub limit: usize,
    /// The score from which on a model is a match; the question's own if `None`.
    pub threshold: Option<f64>,
    /// Whether to leave out what is no match.
    pub only_matches: bool,
    /// Which models.
    pub filter: Filter,
    /// Only those that have each of these in their name or label, in large letters or small.
    pub words: Vec<String>,
    /// Only what comes after this rank: where the page before ended.
    pub after: Option<Rank>,
}

/// What is asked about.
#[derive(Debug, Clone)]
pub enum About {
    /// Which models are of this built-in class?
    BuiltIn {
        /// The class.
        standard: FaceStandard,
        /// How they are judged.
        method: MatchMethod,
    },
    /// Which models are of this class that a user has made?
    Standard {
        /// The name or id of its standard.
        name: String,
    },
    /// Which models are like this one?
    Probe {
        /// The probe.
        signature: Box<Signature>,
        /// Its id, if it is stored.
        stored: Option<ModelId>,
        /// What makes models alike.
        likeness: Likeness,
    },
    /// On which models does this triangle occur?
    Triangle(TriangleProbe),
}

/// A bare triangle.
#[derive(Debug, Clone, PartialEq)]
pub struct TriangleProbe {
    /// Its corners, in units of its own size about their mean.
    pub corners: [Point3; 3],
    /// The direction that is outside, if it matters.
    pub outward: Option<Vector3>,
    /// What errors on the standard face's triangle are multiplied with.
    pub error_factor: f64,
}

/// The part of the ranking that was asked for.
#[derive(Debug, Clone)]
pub struct Answer {
    /// The matches, best first.
    pub matches: Matches,
    /// Models that were searched.
    pub searched: usize,
    /// Models that are yet to be judged: the answer is not complete until there are none.
    pub pending: u64,
    /// Whether a part of the gallery was not searched, which was agreed to.
    pub is_partial: bool,
    /// The rank of the last match, if there are more.
    pub next: Option<Rank>,
}

/// Matches with what is stored of their models; one that was deleted since the search is left out.
#[derive(Debug, Clone)]
pub enum Matches {
    /// As the gallery found them.
    Found(Vec<(Match, MatchedModel)>),
    /// As they were judged by a job against a standard that a user has made.
    Judged {
        /// The standard.
        standard: Box<StandardRecord>,
        /// What its examples tell.
        learned: Learned,
        /// The verdicts.
        verdicts: Vec<(StoredVerdict, MatchedModel)>,
    },
}

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum QueryError {
    /// The index is still being loaded.
    #[error(transparent)]
    NotReady(#[from] NotReady),
    /// Nobody who answers has a part of the gallery.
    #[error("no server that answers has {missing} of the {PARTS} parts of the gallery")]
    NotSearched {
        /// How many parts.
        missing: usize,
    },
    /// The index is not here.
    #[error(transparent)]
    Elsewhere(#[from] Elsewhere),
    /// There is no standard of this name.
    #[error("there is no standard {0:?}")]
    UnknownStandard(String),
    /// The database.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// A task ended badly.
    #[error("searching the gallery: {0}")]
    Task(#[from] tokio::task::JoinError),
}

/// Asks the gallery as it is at this moment. `partial` agrees to an answer from what can be searched, where a part can't.
pub async fn ask(context: &ServiceContext, question: &Question, partial: bool) -> Result<Answer, QueryError> {
    context.settled().await?;
    match &question.about {
        About::Standard { name } => ask_verdicts(context, question, name).await,
        _ => ask_gallery(context, question, partial).await,
    }
}

async fn ask_gallery(context: &ServiceContext, question: &Question, partial: bool) -> Result<Answer, QueryError> {
    let (mut matches, searched, missing) = match context.has_index() {
        Ok(()) => {
            let Found { parts, searched, matches } = found_here(context, question, Parts::ALL).await?;
            (matches, searched, Parts::ALL.without(&parts))
        }
        Err(Elsewhere) => {
            let found = scatter::ask(context, question).await?;
            (found.matches, found.searched, found.missing)
        }
    };
    if !missing.is_empty() && !partial {
        return Err(QueryError::NotSearched { missing: missing.len() });
    }
    let next = cut(&mut matches, question.limit, |found| Rank { score: found.score, model_id: found.model_id });
    let models = models(context, matches.iter().map(|found| ModelId::from_number(found.model_id))).await?;
    let matches = with_models(matches, models, |found| ModelId::from_number(found.model_id));
    Ok(Answer { matches: Matches::Found(matches), searched, pending: 0, is_partial: !missing.is_empty(), next })
}

/// Searches those of some parts of the gallery that the index of this server has: as it is at this moment, without looking at the database first.
pub async fn found_here(context: &ServiceContext, question: &Question, parts: Parts) -> Result<Found, QueryError> {
    let named = named(context, question).await?;
    let (gallery, asked, span) = (context.gallery.clone(), question.clone(), tracing::Span::current());
    let search = move || {
        let _entered = span.enter();
        gallery.ask_parts(&parts, |index, parts| {
            let catalogue = gallery.catalogue();
            let accepts = |id| is_named(named.as_ref(), id) && catalogue.takes(&asked.filter, id);
            Found { parts, searched: index.len(), matches: asked.matches(index, &asked.top_k(&accepts)) }
        })
    };
    Ok(tokio::task::spawn_blocking(search).await??)
}

/// The models of a class that a user has made: they are judged by a job and ranked by what it stored.
async fn ask_verdicts(context: &ServiceContext, question: &Question, name: &str) -> Result<Answer, QueryError> {
    // behind a filter, or on a later page, the wanted models may stand anywhere in the ranking
    let is_first = question.filter.is_empty() && question.words.is_empty() && question.after.is_none();
    if !question.filter.is_empty() {
        // what filters ask stands beside the index
        context.has_index()?;
    }
    let named = named(context, question).await?;
    let rows = if is_first { question.limit + 1 } else { i64::MAX as usize };
    let ranking = standards::ranking(context, name, rows).await?;
    let ranking = ranking.ok_or_else(|| QueryError::UnknownStandard(name.to_owned()))?;
    let Ranking { standard, learned, mut verdicts, judged, pending } = ranking;
    let rank = |verdict: &StoredVerdict| Rank {
        score: learned.score(verdict.residual_mm),
        model_id: verdict.model_id.number(),
    };
    {
        let catalogue = context.gallery.catalogue();
        let accepts = |id| is_named(named.as_ref(), id) && catalogue.takes(&question.filter, id);
        let (wanted, threshold) = (question.top_k(&accepts), question.decisive_threshold());
        verdicts.retain(|verdict| {
            let Rank { score, model_id } = rank(verdict);
            wanted.takes(score, model_id, threshold)
        });
    }
    let next = cut(&mut verdicts, question.limit, rank);
    let models = models(context, verdicts.iter().map(|verdict| verdict.model_id)).await?;
    let verdicts = with_models(verdicts, models, |verdict| verdict.model_id);
    let searched = usize::try_from(judged).unwrap_or(usize::MAX);
    let matches = Matches::Judged { standard: Box::new(standard), learned, verdicts };
    Ok(Answer { matches, searched, pending, is_partial: false, next })
}

/// The models that have all words of the question; `None` if it has no words. Names are not in the index: the database knows them.
async fn named(context: &ServiceContext, question: &Question) -> Result<Option<HashSet<u128>>, DatabaseError> {
    if question.words.is_empty() {
        return Ok(None);
    }
    let ids = context.database.models_with_words(&question.words).await?;
    Ok(Some(ids.into_iter().map(ModelId::number).collect()))
}

fn is_named(named: Option<&HashSet<u128>>, id: u128) -> bool {
    named.is_none_or(|named| named.contains(&id))
}

/// Leaves what is asked for of a ranking; answers with where it goes on, if it does.
fn cut<T>(ranking: &mut Vec<T>, limit: usize, rank: impl Fn(&T) -> Rank) -> Option<Rank> {
    let more = ranking.len() > limit;
    ranking.truncate(limit);
    ranking.last().filter(|_| more).map(rank)
}

async fn models(
    context: &ServiceContext,
    ids: impl Iterator<Item = ModelId>,
) -> Result<Vec<MatchedModel>, DatabaseError> {
    context.database.matched_models(&ids.collect::<Vec<_>>()).await
}

fn with_models<T>(matches: Vec<T>, models: Vec<MatchedModel>, id: impl Fn(&T) -> ModelId) -> Vec<(T, MatchedModel)> {
    let mut models: HashMap<ModelId, MatchedModel> = models.into_iter().map(|model| (model.id, model)).collect();
    let found = |each: T| models.remove(&id(&each)).map(|model| (each, model));
    matches.into_iter().filter_map(found).collect()
}

impl Question {
    /// The part of the ranking that is asked for, and one more, which tells whether there is another page.
    fn top_k<'a>(&self, accepts: &'a (dyn Fn(u128) -> bool + Sync)) -> TopK<'a> {
        TopK {
            limit: self.limit + 1,
            after: self.after,
            threshold: self.threshold,
            only_matches: self.only_matches,
            accepts,
        }
    }

    fn matches(&self, gallery: &Gallery, top_k: &TopK<'_>) -> Vec<Match> {
        match &self.about {
            About::BuiltIn { standard, method } => {
                gallery.by_standard(standard.name, *method, top_k).unwrap_or_default()
            }
            About::Probe { signature, stored, likeness } => {
                gallery.by_likeness(signature, *likeness, stored.map(ModelId::number), top_k)
            }
            About::Triangle(triangle) => {
                let mut matches = gallery.by_triangle(triangle.corners, triangle.outward, top_k);
                for found in &mut matches {
                    found.matching_error_mm *= triangle.error_factor;
                    found.sum_of_distances_mm *= triangle.error_factor;
                }
                matches
            }
            About::Standard { .. } => Vec::new(),
        }
    }

    /// What its probe shows of a thing.
    pub fn probe_shows(&self) -> Shows {
        match self.about {
            About::Probe { likeness: Likeness::View, .. } => Shows::SingleScan,
            _ => Shows::Whole,
        }
    }

    /// The threshold that decides.
    pub fn decisive_threshold(&self) -> f64 {
        let own = || match self.about {
            About::BuiltIn { .. } | About::Standard { .. } => MATCH_SCORE,
            About::Probe { .. } => PROBE_MATCH_SCORE,
            About::Triangle(_) => triangle_match_score(),
        };
        self.threshold.unwrap_or_else(own)
    }
}

/// What speaks for and against a match: from what is stored beside the index, where landmarks and figures are not kept.
#[derive(Debug, Clone)]
pub struct Grounds {
    /// The standard that the model is held against: the one asked about, else the face.
    pub standard: FaceStandard,
    /// The model's signature.
    pub signature: Option<Signature>,
    /// How it was judged against the standard.
    pub evidence: Option<Evidence>,
    /// Why it is no match; `None` if it is one.
    pub reason: Option<Reason>,
    /// By probe: how the two compare.
    pub comparison: Option<Comparison>,
}

impl Grounds {
    /// Looks at a match once more; reads its signature, so beside the async threads. The comparison is made on request.
    pub fn of(question: &Question, found: &Match, model: &MatchedModel, compared: bool) -> Grounds {
        let (standard, method, threshold) = match &question.about {
            About::BuiltIn { standard, method } => (*standard, *method, question.threshold),
            _ => (standard::face(), MatchMethod::Verified, None),
        };
        let is_about_standard = matches!(question.about, About::BuiltIn { .. });
        let signature = model.signature.as_deref().and_then(|content| Signature::from_bytes(content).ok());
        let evidence = signature.as_ref().map(|signature| Evidence::new(signature, &standard, method, threshold));
        let reason = match &evidence {
            _ if found.is_match => None,
            Some(evidence) if is_about_standard => evidence.reason(),
            _ => Some(Reason::BelowThreshold { score: found.score, threshold: question.decisive_threshold() }),
        };
        let comparison = match (&question.about, &signature) {
            (About::Probe { signature: probe, .. }, Some(signature)) if compared => Some(compare(probe, signature)),
            _ => None,
        };
        Grounds { standard, signature, evidence, reason, comparison }
    }
}

#[cfg(test)]
mod tests {
    use super::super::context::testing::{context, file};
    use super::super::models::{self, Upload};
    use super::*;
    use visage_domain::NewModel;
    use visage_shape::faces::signature::example::example;

    fn about_face(limit: usize, after: Option<Rank>) -> Question {
        let about = About::BuiltIn { standard: standard::face(), method: MatchMethod::Verified };
        Question {
            about,
            limit,
            threshold: None,
            only_matches: false,
            filter: Filter::default(),
            words: Vec::new(),
            after,
        }
    }

    fn found(answer: &Answer) -> Vec<ModelId> {
        match &answer.matches {
            Matches::Found(matches) => matches.iter().map(|(_, model)| model.id).collect(),
            Matches::Judged { .. } => panic!("the face is built in"),
        }
    }

    #[tokio::test]
    async fn pages_go_on_where_the_one_before_ended() {
        let (context, _place) = context().await;
        for k in 0..3 {
            let signature = example(0.3 * f64::from(k), 5);
            let model = NewModel { signature: Some((&signature).into()), ..NewModel::example(None) };
            let file = file(&context, b"a mesh").await;
            models::add(&context, Upload { model, file, thumbnail: None, signature }, None).await.expect("added");
        }
        let all = ask(&context, &about_face(3, None), false).await.expect("answered");
        assert_eq!((found(&all).len(), all.searched, all.next), (3, 3, None));
        let first = ask(&context, &about_face(2, None), false).await.expect("answered");
        let second = ask(&context, &about_face(2, first.next), false).await.expect("answered");
        assert_eq!([found(&first), found(&second)].concat(), found(&all));
        assert_eq!(second.next, None);
    }

    #[tokio::test]
    async fn words_of_names_narrow_an_answer_and_its_pages() {
        let (context, _place) = context().await;
        for (k, name) in ["Red jug", "a head", "red head", "JUG, red"].into_iter().enumerate() {
            let signature = example(0.3 * k as f64, 5);
            let name = name.to_owned();
            let model = NewModel { name, signature: Some((&signature).into()), ..NewModel::example(None) };
            let file = file(&context, b"a mesh").await;
            models::add(&context, Upload { model, file, thumbnail: None, signature }, None).await.expect("added");
        }
        let names = |answer: &Answer| match &answer.matches {
            Matches::Found(matches) => matches.iter().map(|(_, model)| model.name.clone()).collect::<Vec<_>>(),
            Matches::Judged { .. } => panic!("the face is built in"),
        };
        let with = |words: &[&str], limit, after| Question {
            words: words.iter().map(|word| (*word).to_owned()).collect(),
            ..about_face(limit, after)
        };
        let all = names(&ask(&context, &about_face(9, None), false).await.expect("answered"));
        let red: Vec<String> = all.iter().filter(|name| *name != "a head").cloned().collect();
        let found = ask(&context, &with(&["RED"], 9, None), false).await.expect("answered");
        assert_eq!((names(&found), found.searched), (red.clone(), 4));
        let jugs = names(&ask(&context, &with(&["jug", "red"], 9, None), false).await.expect("answered"));
        assert_eq!(jugs.len(), 2, "{jugs:?}");
        assert!(names(&ask(&context, &with(&["blue"], 9, None), false).await.expect("answered")).is_empty());
        let first = ask(&context, &with(&["red"], 2, None), false).await.expect("answered");
        let rest = ask(&context, &with(&["red"], 2, first.next), false).await.expect("answered");
        assert_eq!([names(&first), names(&rest)].concat(), red);
    }

    #[tokio::test]
    async fn a_standard_that_is_not_there_is_named() {
        let (context, _place) = context().await;
        let question = Question { about: About::Standard { name: "teapot".to_owned() }, ..about_face(1, None) };
        let error = ask(&context, &question, false).await.expect_err("there is none");
        assert_eq!(error.to_string(), "there is no standard \"teapot\"");
    }
}
