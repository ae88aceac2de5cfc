//! What is asked, read from JSON or from a form.

use super::super::models::parse_id as parse_model_id;
use super::super::problem::{Code, Problem};
use super::super::state::AppState;
use super::super::upload::{self, Form, FormRules};
use super::super::{describe, names};
use super::views::QueryBody;
use crate::faces::Signature;
use crate::retrieval::{Gallery, Match, MatchMethod};
use crate::store::ModelId;

/// The form by which an uploaded probe is asked about.
pub const RULES: FormRules = FormRules { files: &["probe"], most_files: 1, texts: &["unit", "limit", "threshold"] };
/// Matches in one answer.
const MOST_MATCHES: usize = 1000;
const DEFAULT_MATCHES: usize = 20;

/// A question to the gallery.
pub struct Question {
    about: About,
    limit: usize,
    threshold: Option<f64>,
}

enum About {
    Standard { name: String, method: MatchMethod },
    Probe { signature: Box<Signature>, stored: Option<ModelId> },
}

impl Question {
    /// The ranked matches.
    pub fn answer(&self, gallery: &Gallery) -> Result<Vec<Match>, Problem> {
        match &self.about {
            About::Standard { name, method } => {
                gallery.by_standard(name, *method, self.limit, self.threshold).ok_or_else(|| {
                    let detail = format!("there is no standard {name:?}");
                    Problem::new(Code::UnknownStandard, detail, "GET /v1/standards lists those that can be asked for")
                })
            }
            About::Probe { signature, stored } => {
                Ok(gallery.by_probe(signature, stored.map(ModelId::number), self.limit, self.threshold))
            }
        }
    }
}

/// The question that a JSON body asks.
pub async fn question_of_json(state: &AppState, body: QueryBody) -> Result<Question, Problem> {
    let (limit, threshold) = bounds(body.limit, body.threshold)?;
    let about = match (body.standard, body.model_id) {
        (Some(name), None) => About::Standard { name, method: body.method.unwrap_or_default().into() },
        (None, Some(_)) if body.method.is_some() => {
            let detail = "method tells how models are judged against a standard";
            return Err(Problem::new(Code::InvalidField, detail, "leave it out when asking about a model"));
        }
        (None, Some(id)) => {
            let id = parse_model_id(&id)?;
            About::Probe { signature: Box::new(stored_signature(state, id).await?), stored: Some(id) }
        }
        _ => {
            let detail = "a query names either a standard or a model_id";
            return Err(Problem::new(
                Code::InvalidField,
                detail,
                "send {\"standard\": \"face\"} or {\"model_id\": \"...\"}",
            ));
        }
    };
    Ok(Question { about, limit, threshold })
}

/// The question that a form with a probe asks.
pub async fn question_of_form(state: &AppState, mut form: Form) -> Result<Question, Problem> {
    let limit = form.text("limit")?.map(|text| number("limit", text)).transpose()?;
    let threshold = form.text("threshold")?.map(|text| number("threshold", text)).transpose()?;
    let (limit, threshold) = bounds(limit, threshold)?;
    let unit = form.text("unit")?.map(names::unit).transpose()?.unwrap_or_default();
    let file = form.files.pop().ok_or_else(|| {
        Problem::new(
            Code::InvalidField,
            "the form has no part `probe`",
            "send the mesh or cloud as a file named `probe`",
        )
    })?;
    let (file, surface) = upload::read_surface(state, file).await?;
    let signature = describe::describe(state, &file.name, surface, unit).await?;
    Ok(Question { about: About::Probe { signature: Box::new(signature), stored: None }, limit, threshold })
}

fn number<T: std::str::FromStr>(part: &str, text: &str) -> Result<T, Problem> {
    text.trim().parse().map_err(|_| {
        Problem::new(
            Code::InvalidField,
            format!("the part {part} is {text:?}, which is no number that fits"),
            "send a number",
        )
    })
}

fn bounds(limit: Option<usize>, threshold: Option<f64>) -> Result<(usize, Option<f64>), Problem> {
    let limit = limit.unwrap_or(DEFAULT_MATCHES);
    if !(1..=MOST_MATCHES).contains(&limit) {
        let detail = format!("limit is {limit}, which is not between 1 and {MOST_MATCHES}");
        return Err(Problem::new(Code::InvalidField, detail, "ask for fewer matches"));
    }
    if let Some(threshold) = threshold
        && !(0.0..=1.0).contains(&threshold)
    {
        let detail = format!("threshold is {threshold}, which is not between 0 and 1");
        return Err(Problem::new(Code::InvalidField, detail, "scores are between 0 and 1"));
    }
    Ok((limit, threshold))
}

async fn stored_signature(state: &AppState, id: ModelId) -> Result<Signature, Problem> {
    state.shop.store.model(id).await?;
    let refused = |reason: String| {
        let hint = "upload the model again, or register its scans again with signature: true";
        Problem::new(Code::NoSignature, format!("model {id} can't be asked about: {reason}"), hint)
    };
    let content = state.shop.store.signature(id).await?.ok_or_else(|| refused("it has no signature".to_owned()))?;
    Signature::from_bytes(&content).map_err(|error| refused(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_of_limit_and_threshold() {
        assert_eq!(bounds(None, None).expect("defaults"), (20, None));
        assert!(bounds(Some(0), None).is_err());
        assert!(bounds(Some(1001), None).is_err());
        assert!(bounds(None, Some(f64::NAN)).is_err());
        assert!(bounds(None, Some(1.5)).is_err());
        assert_eq!(bounds(Some(5), Some(0.5)).expect("in bounds"), (5, Some(0.5)));
    }
}
