//! A question about some parts of the gallery, and the answer, as JSON.
//!
//! Figures of an answer go as the bits they are, since an answer that is put together must have the same bytes as one that was not. What
//! arrives is checked before anything is made of it.

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use serde::{Deserialize, Serialize};

use crate::app::queries::{About, Question, TriangleProbe};
use visage_domain::{ModelId, Parts, SeatId};
use visage_gallery::{Filter, Likeness, Match, Rank, Source};
use visage_geometry::{Point3, Unit, Vector3};
use visage_shape::faces::{MatchMethod, Signature, standard};

/// Counts up whenever a question or an answer would mean something else: one of another number is refused, and another server asked.
const RULES: u32 = 1;
/// Matches that may be asked for, one more than of any query: what is more is nothing that we send.
const MOST_MATCHES: usize = 1001;

/// A message that is none.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the message is not as servers of this version write it: {0}")]
pub struct NoMessage(String);

fn wrong(reason: impl ToString) -> NoMessage {
    NoMessage(reason.to_string())
}

/// A question to one server.
#[derive(Debug, Clone)]
pub struct Asked {
    /// Which server is meant: another one may have its address by now.
    pub node: SeatId,
    /// The version of the gallery that has to be answered from, or a later one.
    pub version: u64,
    /// About which parts.
    pub parts: Parts,
    /// The question.
    pub question: Question,
}

/// What a server has found.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The parts that were searched: those asked about that it has.
    pub parts: Parts,
    /// How many models that were.
    pub searched: usize,
    /// What is asked for of their ranking.
    pub matches: Vec<Match>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct AskedMessage {
    rules: u32,
    node: String,
    version: u64,
    parts: String,
    about: AboutMessage,
    limit: usize,
    threshold: Option<f64>,
    only_matches: bool,
    filter: FilterMessage,
    words: Vec<String>,
    after: Option<(u64, String)>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum AboutMessage {
    BuiltIn { standard: String, method: MatchMethod },
    Probe { signature: String, stored: Option<String>, likeness: Likeness },
    Triangle { corners: [[f64; 3]; 3], outward: Option<[f64; 3]>, error_factor: f64 },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FilterMessage {
    labels: Vec<String>,
    label_prefix: Option<String>,
    created_after_ms: Option<i64>,
    created_before_ms: Option<i64>,
    units: Vec<Unit>,
    source: Option<Source>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FoundMessage {
    rules: u32,
    parts: String,
    searched: usize,
    matches: Vec<MatchMessage>,
}

/// Id, bits of score, matching error and sum of distances, whether it is a match, bits of the corners.
#[derive(Serialize, Deserialize)]
struct MatchMessage(String, u64, u64, u64, bool, Option<[[u64; 3]; 3]>);

fn model(text: &str) -> Result<ModelId, NoMessage> {
    ModelId::parse(text).ok_or_else(|| wrong("an id is none"))
}

impl AboutMessage {
    /// `None` for what is not asked of the index.
    fn of(about: &About) -> Option<AboutMessage> {
        Some(match about {
            About::BuiltIn { standard, method } => {
                AboutMessage::BuiltIn { standard: standard.name.to_owned(), method: *method }
            }
            About::Probe { signature, stored, likeness } => AboutMessage::Probe {
                signature: BASE64_STANDARD.encode(signature.to_bytes()),
                stored: stored.map(|id| id.to_string()),
                likeness: *likeness,
            },
            About::Triangle(TriangleProbe { corners, outward, error_factor }) => AboutMessage::Triangle {
                corners: corners.map(<[f64; 3]>::from),
                outward: outward.map(<[f64; 3]>::from),
                error_factor: *error_factor,
            },
            About::Standard { .. } => return None,
        })
    }

    fn about(self) -> Result<About, NoMessage> {
        Ok(match self {
            AboutMessage::BuiltIn { standard, method } => {
                let standard = standard::by_name(&standard).ok_or_else(|| wrong("it names no standard"))?;
                About::BuiltIn { standard, method }
            }
            AboutMessage::Probe { signature, stored, likeness } => {
                let bytes = BASE64_STANDARD.decode(signature).map_err(wrong)?;
                let signature = Box::new(Signature::from_bytes(&bytes).map_err(wrong)?);
                let stored = stored.as_deref().map(model).transpose()?;
                About::Probe { signature, stored, likeness }
            }
            AboutMessage::Triangle { corners, outward, error_factor } => About::Triangle(TriangleProbe {
                corners: corners.map(Point3::from),
                outward: outward.map(Vector3::from),
                error_factor,
            }),
        })
    }
}

impl Asked {
    /// As it is sent; `None` for a question that is not about the index.
    pub fn encode(&self) -> Option<Vec<u8>> {
        let Question { about, limit, threshold, only_matches, filter, words, after } = &self.question;
        let Filter { labels, label_prefix, created_after_ms, created_before_ms, units, source } = filter.clone();
        let filter = FilterMessage { labels, label_prefix, created_after_ms, created_before_ms, units, source };
        let id = |id| ModelId::from_number(id).to_string();
        let message = AskedMessage {
            rules: RULES,
            node: self.node.to_string(),
            version: self.version,
            parts: self.parts.to_string(),
            about: AboutMessage::of(about)?,
            limit: *limit,
            threshold: *threshold,
            only_matches: *only_matches,
            filter,
            words: words.clone(),
            after: after.map(|rank| (rank.score.to_bits(), id(rank.model_id))),
        };
        serde_json::to_vec(&message).ok()
    }

    /// The inverse.
    pub fn decode(bytes: &[u8]) -> Result<Asked, NoMessage> {
        let message: AskedMessage = serde_json::from_slice(bytes).map_err(wrong)?;
        if message.rules != RULES {
            return Err(wrong("it is of another version"));
        }
        if !(1..MOST_MATCHES).contains(&message.limit) {
            return Err(wrong("it asks for too many matches"));
        }
        let FilterMessage { labels, label_prefix, created_after_ms, created_before_ms, units, source } = message.filter;
        let filter = Filter { labels, label_prefix, created_after_ms, created_before_ms, units, source };
        let rank = |(score, id): (u64, String)| {
            let score = f64::from_bits(score);
            let is_score = score.is_finite() && score.is_sign_positive();
            let rank = Rank { score, model_id: model(&id)?.number() };
            if is_score { Ok(rank) } else { Err(wrong("a score is none")) }
        };
        let question = Question {
            about: message.about.about()?,
            limit: message.limit,
            threshold: message.threshold,
            only_matches: message.only_matches,
            filter,
            words: message.words,
            after: message.after.map(rank).transpose()?,
        };
        Ok(Asked {
            node: SeatId::parse(&message.node).ok_or_else(|| wrong("it names no server"))?,
            version: message.version,
            parts: message.parts.parse().map_err(wrong)?,
            question,
        })
    }
}

impl Found {
    /// As it is sent.
    pub fn encode(&self) -> Vec<u8> {
        let matches = self.matches.iter().map(|found| {
            let id = ModelId::from_number(found.model_id).to_string();
            let corners = found.triangle.map(|corners| corners.map(|corner| corner.map(f64::to_bits)));
            let [score, error, sum] =
                [found.score, found.matching_error_mm, found.sum_of_distances_mm].map(f64::to_bits);
            MatchMessage(id, score, error, sum, found.is_match, corners)
        });
        let (parts, searched, matches) = (self.parts.to_string(), self.searched, matches.collect());
        // plain data: there is nothing that could not be written
        serde_json::to_vec(&FoundMessage { rules: RULES, parts, searched, matches }).unwrap_or_default()
    }

    /// The inverse.
    pub fn decode(bytes: &[u8]) -> Result<Found, NoMessage> {
        let message: FoundMessage = serde_json::from_slice(bytes).map_err(wrong)?;
        if message.rules != RULES {
            return Err(wrong("it is of another version"));
        }
        if message.matches.len() > MOST_MATCHES {
            return Err(wrong("it has too many matches"));
        }
        let found = |MatchMessage(id, score, error, sum, is_match, corners): MatchMessage| {
            Ok(Match {
                model_id: model(&id)?.number(),
                score: f64::from_bits(score),
                matching_error_mm: f64::from_bits(error),
                sum_of_distances_mm: f64::from_bits(sum),
                is_match,
                triangle: corners.map(|corners| corners.map(|corner| corner.map(f64::from_bits))),
            })
        };
        let matches = message.matches.into_iter().map(found).collect::<Result<_, NoMessage>>()?;
        Ok(Found { parts: message.parts.parse().map_err(wrong)?, searched: message.searched, matches })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_shape::faces::signature::example::example;

    fn asked(about: About) -> Asked {
        let filter = Filter {
            labels: vec!["a\"b".to_owned()],
            label_prefix: Some("é".to_owned()),
            created_after_ms: Some(-5),
            created_before_ms: None,
            units: vec![Unit::Mm, Unit::Unknown],
            source: Some(Source::Registered),
        };
        let after = Some(Rank { score: 0.1 + 0.2, model_id: ModelId::new().number() });
        let (threshold, words) = (Some(1.0 / 3.0), vec!["jug".to_owned()]);
        let question = Question { about, limit: 20, threshold, only_matches: true, filter, words, after };
        Asked { node: SeatId::new(), version: u64::MAX, parts: [3, 255].into_iter().collect(), question }
    }

    fn abouts() -> [About; 3] {
        let probe =
            |likeness| About::Probe { signature: Box::new(example(0.3, 6)), stored: Some(ModelId::new()), likeness };
        let corners = [[0.1, 0.2, 0.3], [1.0 / 3.0, 0.0, 1e-300], [2.0, 3.0, 4.0]].map(Point3::from);
        [
            About::BuiltIn { standard: standard::face(), method: MatchMethod::Literal },
            probe(Likeness::View),
            About::Triangle(TriangleProbe { corners, outward: Some(Vector3::z()), error_factor: 0.7 }),
        ]
    }

    #[test]
    fn a_question_arrives_as_it_was_asked() {
        for about in abouts() {
            let asked = asked(about);
            let back = Asked::decode(&asked.encode().expect("about the index")).expect("read");
            assert_eq!(format!("{back:?}"), format!("{asked:?}"));
        }
        assert_eq!(
            asked(About::Standard { name: "teapot".to_owned() }).encode(),
            None,
            "the database answers it, not the index"
        );
    }

    #[test]
    fn an_answer_arrives_to_the_last_bit() {
        let found = |model_id, triangle| Match {
            model_id,
            score: 0.1 + 0.2,
            matching_error_mm: f64::INFINITY,
            sum_of_distances_mm: 5e-324,
            is_match: true,
            triangle,
        };
        let id = || ModelId::new().number();
        let matches = vec![found(id(), None), found(id(), Some([[-0.0, 1.0 / 3.0, 1e300]; 3]))];
        let answer = Found { parts: Parts::ALL, searched: 7, matches };
        assert_eq!(Found::decode(&answer.encode()), Ok(answer));
    }

    #[test]
    fn what_is_no_message_is_refused_and_ends_nothing() {
        let sound = asked(abouts()[1].clone()).encode().expect("about the index");
        let text = String::from_utf8(sound.clone()).expect("JSON");
        for (from, to) in [
            ("\"rules\":1", "\"rules\":2"),
            ("\"limit\":20", "\"limit\":18446744073709551615"),
            ("\"limit\":20", "\"limit\":0"),
            ("\"limit\":20", "\"limit\":-1"),
            ("\"parts\":\"8", "\"parts\":\"x"),
            ("\"version\":", "\"more\":1,\"version\":"),
            ("\"signature\":\"", "\"signature\":\"AAAA"),
            ("\"likeness\":\"view\"", "\"likeness\":\"smell\""),
            ("\"after\":[", "\"after\":[18444492273895866368,\"x\"],\"words\":["),
            ("\"node\":\"", "\"node\":\"x"),
        ] {
            assert!(text.contains(from), "{from}: {text}");
            assert!(Asked::decode(text.replacen(from, to, 1).as_bytes()).is_err(), "{to}");
        }
        for end in (0..sound.len()).step_by(97) {
            assert!(Asked::decode(&sound[..end]).is_err() && Found::decode(&sound[..end]).is_err());
        }
        for bytes in [&b""[..], b"[]", b"null", b"{}", b"\xff\xfe", &[b'['; 100_000]] {
            assert!(Asked::decode(bytes).is_err() && Found::decode(bytes).is_err());
        }
    }
}
