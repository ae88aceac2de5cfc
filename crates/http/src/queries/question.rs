//! What is asked, read from JSON or from a form.

use super::super::cursor::{self, Fingerprint};
use super::super::models::parse_id as parse_model_id;
use super::super::problem::{Code, Problem};
use super::super::state::AppState;
use super::super::upload::{self, Form, FormRules};
use super::super::{describe, names};
use super::terms::{RawTerms, Terms};
use super::triangle::triangle_probe;
use super::views::{LikenessView, MethodView, QueryBody};
use visage_domain::{ModelId, StandardRecord};
use visage_gallery::MatchMethod;
use visage_geometry::{Surface, Unit};
use visage_service::app::placing::Probe;
use visage_service::app::queries::{About, Question};
use visage_service::app::standards;
use visage_shape::faces::Signature;
use visage_shape::faces::standard::{self, FaceStandard};
use visage_shape::standards::limit::Learned;
use visage_shape::standards::{Found, Standard};

/// The form by which an uploaded probe is asked about.
pub const RULES: FormRules = FormRules {
    files: &["probe"],
    most_files: 1,
    file_name: names::surface_file_name,
    texts: &[
        "unit",
        "standard",
        "method",
        "likeness",
        "limit",
        "threshold",
        "only_matches",
        "cursor",
        "filter",
        "explain",
        "place",
        "partial",
    ],
};

/// What a request asks.
pub enum Asked {
    /// Which models of the gallery are of a class, or like something?
    Gallery(Box<GalleryQuestion>),
    /// Is this probe of the class?
    Verdict(Box<Verdict>),
    /// Is this probe of a class that a user has made?
    ClassVerdict(Box<ClassVerdict>),
}

/// A question to the gallery, as it came over the wire.
pub struct GalleryQuestion {
    /// The question.
    pub question: Question,
    /// Whether to tell each step's figure.
    pub explain: bool,
    /// Whether an answer from a part of the gallery will do.
    pub partial: bool,
    /// The probe that is to be laid onto the first matches, if that is asked for.
    pub place: Option<Probe>,
    /// What a cursor of this question carries.
    pub fingerprint: Fingerprint,
}

/// An uploaded probe that is held against a built-in class.
pub struct Verdict {
    /// The probe.
    pub signature: Signature,
    /// The class.
    pub standard: FaceStandard,
    /// How it is judged.
    pub method: MatchMethod,
    /// The score from which on it is a match.
    pub threshold: Option<f64>,
    /// Whether to tell each step's figure.
    pub explain: bool,
}

/// An uploaded probe that was looked at for a class that a user has made.
pub struct ClassVerdict {
    /// The class.
    pub standard: StandardRecord,
    /// What its examples tell.
    pub learned: Learned,
    /// Where it was found, if anywhere.
    pub found: Option<Found>,
    /// The score from which on it is a match.
    pub threshold: Option<f64>,
}

impl GalleryQuestion {
    fn new(about: About, terms: Terms) -> Result<GalleryQuestion, Problem> {
        let fingerprint = fingerprint(&about, &terms);
        let after = terms.cursor.as_deref().map(|text| cursor::read(text, &fingerprint)).transpose()?;
        let Terms { limit, threshold, only_matches, filter, words, explain, place, partial, .. } = terms;
        let stored = match &about {
            About::Probe { stored, .. } => *stored,
            _ if place => return Err(place_of_probes()),
            _ => None,
        };
        let place = stored.filter(|_| place).map(Probe::Stored);
        let question = Question { about, limit, threshold, only_matches, filter, words, after };
        Ok(GalleryQuestion { question, explain, partial, place, fingerprint })
    }
}

/// The same for every page of a question: `limit` and `explain` may change from page to page.
fn fingerprint(about: &About, terms: &Terms) -> Fingerprint {
    let asked = match about {
        About::BuiltIn { standard, method } => format!("standard {} {method:?}", standard.name).into_bytes(),
        About::Probe { signature, stored, likeness } => {
            [format!("probe {stored:?} {likeness:?}").into_bytes(), signature.to_bytes()].concat()
        }
        About::Triangle(triangle) => format!("triangle {triangle:?}").into_bytes(),
        About::Standard { name } => format!("class {name}").into_bytes(),
    };
    let terms = format!("{:?} {:?} {:?} {:?}", terms.threshold, terms.only_matches, terms.filter, terms.words);
    cursor::fingerprint(&[&asked, terms.as_bytes()])
}

/// The question that a JSON body asks.
pub async fn of_json(state: &AppState, body: QueryBody) -> Result<GalleryQuestion, Problem> {
    let QueryBody { standard, model_id, triangle, method, likeness, .. } = body;
    let terms = RawTerms {
        limit: body.limit,
        threshold: body.threshold,
        only_matches: body.only_matches,
        cursor: body.cursor,
        filter: body.filter,
        explain: body.explain,
        place: body.place,
        partial: body.partial,
    };
    let terms = terms.checked()?;
    if standard.is_none() && method.is_some() {
        let detail = "method tells how models are judged against a standard";
        return Err(Problem::new(Code::InvalidField, detail, "leave it out when asking about anything else"));
    }
    if model_id.is_none() && likeness.is_some() {
        return Err(likeness_of_probes());
    }
    let about = match (standard, model_id, triangle) {
        (Some(name), None, None) => match standard::by_name(&name) {
            Some(standard) => About::BuiltIn { standard, method: method.unwrap_or_default().into() },
            None => {
                verified_alone(&name, method)?;
                About::Standard { name }
            }
        },
        (None, Some(id), None) => {
            let id = parse_model_id(&id)?;
            let signature = Box::new(stored_signature(state, id).await?);
            About::Probe { signature, stored: Some(id), likeness: likeness.unwrap_or_default().into() }
        }
        (None, None, Some(triangle)) => About::Triangle(triangle_probe(triangle)?),
        _ => {
            let detail = "a query names exactly one of standard, model_id and triangle";
            let hint = "send {\"standard\": \"face\"}, {\"model_id\": \"...\"} or {\"triangle\": [[x, y, z], ...]}";
            return Err(Problem::new(Code::InvalidField, detail, hint));
        }
    };
    GalleryQuestion::new(about, terms)
}

/// The question that a form with a probe asks.
pub async fn of_form(state: &AppState, mut form: Form) -> Result<Asked, Problem> {
    let terms = RawTerms::of_form(&form)?.checked()?;
    let unit = form.text("unit")?.map(names::unit).transpose()?.unwrap_or_default();
    let standard = form.text("standard")?.map(|name| name.trim().to_owned());
    let method = form.text("method")?.map(method_named).transpose()?;
    if standard.is_none() && method.is_some() {
        let detail = "method tells how a probe is judged against a standard";
        return Err(Problem::new(Code::InvalidField, detail, "name a standard, or leave it out"));
    }
    let likeness = form.text("likeness")?.map(likeness_named).transpose()?;
    if standard.is_some() && likeness.is_some() {
        return Err(likeness_of_probes());
    }
    // before the work
    if standard.is_some() {
        if terms.place {
            return Err(place_of_probes());
        }
        no_pages(&terms)?;
    }
    let class = match &standard {
        Some(name) if standard::by_name(name).is_none() => {
            verified_alone(name, method)?;
            Some(class_named(state, name).await?)
        }
        _ => None,
    };
    let file = form.files.pop().ok_or_else(|| {
        let detail = "the form has no part `probe`";
        Problem::new(Code::InvalidField, detail, "send the mesh or cloud as a file named `probe`")
    })?;
    let turn = describe::turn(state, &file).await?;
    let (file, surface) = upload::read_surface(state, file).await?;
    if let Some(standard) = class {
        let verdict = looked_for(state, turn, &file.name, surface, unit, standard, terms.threshold).await?;
        return Ok(Asked::ClassVerdict(Box::new(verdict)));
    }
    let place = terms.place.then(|| Probe::Surface(Box::new(surface.clone()), unit));
    let signature = describe::describe(state, turn, &file.name, surface, unit).await?;
    match standard.as_deref().and_then(standard::by_name) {
        Some(standard) => {
            let (method, Terms { threshold, explain, .. }) = (method.unwrap_or_default().into(), terms);
            Ok(Asked::Verdict(Box::new(Verdict { signature, standard, method, threshold, explain })))
        }
        None => {
            let likeness = likeness.unwrap_or_default().into();
            let about = About::Probe { signature: Box::new(signature), stored: None, likeness };
            Ok(Asked::Gallery(Box::new(GalleryQuestion { place, ..GalleryQuestion::new(about, terms)? })))
        }
    }
}

/// A verdict has one page, so no cursor is one of its.
fn no_pages(terms: &Terms) -> Result<(), Problem> {
    let read = |text| cursor::read(text, &cursor::fingerprint(&[b"verdict"]));
    terms.cursor.as_deref().map(read).transpose().map(drop)
}

/// Other methods than the default are for the built-in face.
pub fn verified_alone(name: &str, method: Option<MethodView>) -> Result<(), Problem> {
    if method.is_none_or(|method| matches!(method, MethodView::Verified)) {
        return Ok(());
    }
    let detail = format!("models are judged against {name} by the method verified alone");
    Err(Problem::new(Code::InvalidField, detail, "leave method out; the others are for the face"))
}

/// The standard of this name that a user has made.
async fn class_named(state: &AppState, name: &str) -> Result<StandardRecord, Problem> {
    let found = standards::named(&state.context, name).await?;
    let standard = found.ok_or_else(|| unknown_standard(name))?;
    if standard.definition.version != Standard::VERSION {
        let detail = format!("the standard {name} is of another version and is being made anew");
        return Err(
            Problem::new(Code::NotReady, detail, "try again when the waiting evaluation has ended").retry_after(5)
        );
    }
    Ok(standard)
}

/// Looks for a class on an uploaded probe.
async fn looked_for(
    state: &AppState,
    turn: describe::Turn,
    file: &str,
    surface: Surface,
    unit: Unit,
    standard: StandardRecord,
    threshold: Option<f64>,
) -> Result<ClassVerdict, Problem> {
    let learned = standards::learned(&state.context, standard.id).await?;
    let looking = describe::computed(state, turn, move |engine, progress| {
        let found = engine.find(&[&standard.definition], &surface, unit, progress)?.into_iter().next().flatten();
        Ok(ClassVerdict { standard, learned, found, threshold })
    });
    looking.await.map_err(|problem| problem.scan(file))
}

/// Nothing is known by this name.
pub fn unknown_standard(name: &str) -> Problem {
    let detail = format!("there is no standard {name:?}");
    Problem::new(Code::UnknownStandard, detail, "GET /v1/standards lists those that can be asked for")
}

fn method_named(name: &str) -> Result<MethodView, Problem> {
    serde_json::from_value(serde_json::Value::from(name.trim())).map_err(|_| {
        let detail = format!("there is no method {name:?}");
        Problem::new(Code::InvalidField, detail, "send verified, descriptors or literal")
    })
}

fn likeness_named(name: &str) -> Result<LikenessView, Problem> {
    serde_json::from_value(serde_json::Value::from(name.trim())).map_err(|_| {
        let detail = format!("there is no likeness {name:?}");
        Problem::new(Code::InvalidField, detail, "send shape, salient_regions or view")
    })
}

fn likeness_of_probes() -> Problem {
    let detail = "likeness tells what makes models like a probe";
    Problem::new(Code::InvalidField, detail, "leave it out when asking about a standard or a triangle")
}

fn place_of_probes() -> Problem {
    let detail = "place tells where a probe lies on models that are like it";
    Problem::new(Code::InvalidField, detail, "leave it out when asking about a standard or a triangle")
}

async fn stored_signature(state: &AppState, id: ModelId) -> Result<Signature, Problem> {
    state.context.database.model(id).await?;
    let refused = |reason: String| {
        let hint = "upload the model again, or register its scans again with signature: true";
        Problem::new(Code::NoSignature, format!("model {id} can't be asked about: {reason}"), hint)
    };
    let content =
        state.context.database.signature(id).await?.ok_or_else(|| refused("it has no signature".to_owned()))?;
    Signature::from_bytes(&content).map_err(|error| refused(error.to_string()))
}
