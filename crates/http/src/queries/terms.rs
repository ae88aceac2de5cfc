//! What every question may add: how many, from where on, which models, how much to tell.

use serde::Deserialize;
use utoipa::ToSchema;

use super::super::extract::parse_json;
use super::super::names;
use super::super::problem::{Code, Problem};
use super::super::scan_set_views::UnitView;
use super::super::schemas::ShortText;
use super::super::upload::Form;
use visage_gallery::{Filter, Source};

/// Matches in one answer.
const MOST_MATCHES: usize = 1000;
const DEFAULT_MATCHES: usize = 20;
/// Labels or units in one filter.
const MOST_CHOICES: usize = 100;

/// How a model came into the gallery.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, ToSchema)]
#[schema(as = Source)]
#[serde(rename_all = "snake_case")]
pub enum SourceView {
    /// As a finished mesh or cloud.
    Uploaded,
    /// By registration of its scans.
    Registered,
}

/// Which models may be answered with. All conditions must hold; what is left out asks nothing.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize, ToSchema)]
#[schema(as = Filter)]
#[serde(deny_unknown_fields)]
pub struct FilterView {
    /// One of these labels.
    #[schema(min_items = 1, max_items = 100)]
    pub labels: Option<Vec<String>>,
    /// A label that begins so.
    pub label_prefix: Option<String>,
    /// Each of these words, or parts of words, stands in its name or label, in large letters or small.
    #[schema(value_type = Option<ShortText>)]
    pub text: Option<String>,
    /// Stored after this time (RFC 3339).
    #[schema(format = DateTime)]
    pub created_after: Option<String>,
    /// Stored before this time (RFC 3339).
    #[schema(format = DateTime)]
    pub created_before: Option<String>,
    /// One of these units.
    #[schema(min_items = 1, max_items = 100)]
    pub units: Option<Vec<UnitView>>,
    /// Come this way.
    pub source: Option<SourceView>,
}

impl FilterView {
    fn words(&self) -> Result<Vec<String>, Problem> {
        Ok(self.text.as_deref().map(|text| names::words("filter.text", text)).transpose()?.unwrap_or_default())
    }

    fn checked(self) -> Result<Filter, Problem> {
        Ok(Filter {
            labels: choices("labels", self.labels)?,
            label_prefix: self.label_prefix,
            created_after_ms: self.created_after.map(|time| milliseconds("created_after", &time, false)).transpose()?,
            created_before_ms: self
                .created_before
                .map(|time| milliseconds("created_before", &time, true))
                .transpose()?,
            units: choices("units", self.units)?.into_iter().map(UnitView::into).collect(),
            source: self.source.map(|source| match source {
                SourceView::Uploaded => Source::Uploaded,
                SourceView::Registered => Source::Registered,
            }),
        })
    }
}

fn choices<T>(field: &str, choices: Option<Vec<T>>) -> Result<Vec<T>, Problem> {
    match choices {
        Some(choices) if choices.is_empty() || choices.len() > MOST_CHOICES => {
            let detail = format!("filter.{field} names {} choices, not 1 to {MOST_CHOICES}", choices.len());
            Err(Problem::new(Code::InvalidField, detail, "leave it out to take any"))
        }
        choices => Ok(choices.unwrap_or_default()),
    }
}

/// A time in whole milliseconds, as those of models are; a part of one is rounded down, or `up`.
fn milliseconds(field: &str, text: &str, up: bool) -> Result<i64, Problem> {
    let time: jiff::Timestamp = text.parse().map_err(|_| {
        let detail = format!("filter.{field} is {text:?}, which is no time");
        Problem::new(Code::InvalidField, detail, "send a time such as 2026-01-31T12:00:00Z")
    })?;
    let down = time.as_nanosecond().div_euclid(1_000_000);
    let whole = if up && time.as_nanosecond().rem_euclid(1_000_000) != 0 { down + 1 } else { down };
    i64::try_from(whole).map_err(Problem::internal)
}

/// The terms as they were sent.
#[derive(Debug, Clone, Default)]
pub struct RawTerms {
    /// At most so many matches.
    pub limit: Option<usize>,
    /// The score from which on a model is a match.
    pub threshold: Option<f64>,
    /// Whether to leave out what is no match.
    pub only_matches: Option<bool>,
    /// Where to go on.
    pub cursor: Option<String>,
    /// Which models.
    pub filter: Option<FilterView>,
    /// Whether to tell each step's figure.
    pub explain: Option<bool>,
    /// Whether to lay the probe onto the first matches.
    pub place: Option<bool>,
    /// Whether an answer from a part of the gallery will do.
    pub partial: Option<bool>,
}

impl RawTerms {
    /// The terms in a form.
    pub fn of_form(form: &Form) -> Result<RawTerms, Problem> {
        Ok(RawTerms {
            limit: form.text("limit")?.map(|text| value("limit", text, "a number")).transpose()?,
            threshold: form.text("threshold")?.map(|text| value("threshold", text, "a number")).transpose()?,
            only_matches: form.text("only_matches")?.map(|text| truth("only_matches", text)).transpose()?,
            cursor: form.text("cursor")?.map(str::to_owned),
            filter: form.text("filter")?.map(|t| parse_json("the part filter", t.as_bytes())).transpose()?,
            explain: form.text("explain")?.map(|text| truth("explain", text)).transpose()?,
            place: form.text("place")?.map(|text| truth("place", text)).transpose()?,
            partial: form.text("partial")?.map(|text| truth("partial", text)).transpose()?,
        })
    }

    /// The terms, if they are allowed.
    pub fn checked(self) -> Result<Terms, Problem> {
        let limit = self.limit.unwrap_or(DEFAULT_MATCHES);
        if !(1..=MOST_MATCHES).contains(&limit) {
            let detail = format!("limit is {limit}, which is not between 1 and {MOST_MATCHES}");
            return Err(Problem::new(Code::InvalidField, detail, "ask for several pages"));
        }
        if let Some(threshold) = self.threshold
            && !(0.0..=1.0).contains(&threshold)
        {
            let detail = format!("threshold is {threshold}, which is not between 0 and 1");
            return Err(Problem::new(Code::InvalidField, detail, "scores are between 0 and 1"));
        }
        Ok(Terms {
            limit,
            threshold: self.threshold,
            only_matches: self.only_matches.unwrap_or(false),
            cursor: self.cursor,
            words: self.filter.as_ref().map(FilterView::words).transpose()?.unwrap_or_default(),
            filter: self.filter.map(FilterView::checked).transpose()?.unwrap_or_default(),
            explain: self.explain.unwrap_or(false),
            place: self.place.unwrap_or(false),
            partial: self.partial.unwrap_or(false),
        })
    }
}

/// The terms of a question, checked.
#[derive(Debug, Clone)]
pub struct Terms {
    /// At most so many matches.
    pub limit: usize,
    /// The score from which on a model is a match; the question's own if `None`.
    pub threshold: Option<f64>,
    /// Whether to leave out what is no match.
    pub only_matches: bool,
    /// Where to go on, not read yet.
    pub cursor: Option<String>,
    /// Which models.
    pub filter: Filter,
    /// Words of their names or labels.
    pub words: Vec<String>,
    /// Whether to tell each step's figure.
    pub explain: bool,
    /// Whether to lay the probe onto the first matches.
    pub place: bool,
    /// Whether an answer from a part of the gallery will do.
    pub partial: bool,
}

/// Forms hold text only, and Python writes `True`.
fn truth(part: &str, text: &str) -> Result<bool, Problem> {
    value(part, &text.to_ascii_lowercase(), "true or false")
}

fn value<T: std::str::FromStr>(part: &str, text: &str, what: &str) -> Result<T, Problem> {
    text.trim().parse().map_err(|_| {
        let detail = format!("the part {part} is {text:?}, which is not {what} that fits");
        Problem::new(Code::InvalidField, detail, format!("send {what}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_of_limit_and_threshold() {
        let check = |limit, threshold| RawTerms { limit, threshold, ..RawTerms::default() }.checked();
        let terms = check(None, None).expect("defaults");
        assert_eq!((terms.limit, terms.threshold, terms.only_matches, terms.explain), (20, None, false, false));
        assert!(terms.filter.is_empty() && terms.words.is_empty());
        assert!(check(Some(0), None).is_err() && check(Some(1001), None).is_err());
        assert!(check(None, Some(f64::NAN)).is_err() && check(None, Some(1.5)).is_err());
        assert_eq!(check(Some(5), Some(0.5)).expect("in bounds").limit, 5);
    }

    #[test]
    fn times_are_whole_milliseconds_that_leave_nothing_out() {
        let at = |text: &str, up| milliseconds("created_after", text, up);
        assert_eq!(at("1970-01-01T00:00:01.5Z", false).expect("a time"), 1500);
        assert_eq!(at("1970-01-01T00:00:00.0004Z", false).expect("a time"), 0);
        assert_eq!(at("1970-01-01T00:00:00.0004Z", true).expect("a time"), 1);
        assert_eq!(at("1970-01-01T01:00:00+01:00", true).expect("a time"), 0);
        assert!(at("yesterday", false).is_err());
    }

    #[test]
    fn a_text_is_words_and_an_empty_one_is_refused() {
        let terms = |text: &str| {
            let filter = FilterView { text: Some(text.to_owned()), ..FilterView::default() };
            RawTerms { filter: Some(filter), ..RawTerms::default() }.checked()
        };
        assert_eq!(terms(" red  jug ").expect("sound").words, ["red", "jug"]);
        assert!(terms("  ").is_err() && terms(&"x".repeat(201)).is_err());
    }

    #[test]
    fn an_empty_choice_is_refused() {
        let none = FilterView { labels: Some(Vec::new()), ..FilterView::default() };
        assert!(none.checked().is_err());
        let some = FilterView { units: Some(vec![UnitView::Mm]), ..FilterView::default() };
        assert_eq!(some.checked().expect("sound").units, [visage_geometry::Unit::Mm]);
    }
}
