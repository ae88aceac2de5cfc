//! What is known of the models besides their shape, and filters on it.

use std::collections::HashMap;

use super::ModelId;
use visage_geometry::Unit;

/// How a model came into the gallery.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// As a finished mesh or cloud.
    #[default]
    Uploaded,
    /// By registration of its scans.
    Registered,
}

/// What filters ask of a model. The time of its creation is in its id.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Facets {
    /// Its class, if it has one.
    pub label: Option<Box<str>>,
    /// The unit of its coordinates.
    pub unit: Unit,
    /// How it came into the gallery.
    pub source: Source,
}

/// Which models a query may answer with; what is empty or `None` asks nothing.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Filter {
    /// One of these labels.
    pub labels: Vec<String>,
    /// A label that begins so.
    pub label_prefix: Option<String>,
    /// Stored after this time, milliseconds since 1970 (UTC).
    pub created_after_ms: Option<i64>,
    /// Stored before this time.
    pub created_before_ms: Option<i64>,
    /// One of these units.
    pub units: Vec<Unit>,
    /// Come this way.
    pub source: Option<Source>,
}

impl Filter {
    /// Whether it asks nothing.
    pub fn is_empty(&self) -> bool {
        *self == Filter::default()
    }

    /// Whether the model may be answered with.
    pub fn takes(&self, id: ModelId, facets: &Facets) -> bool {
        let (label, created) = (facets.label.as_deref(), created_ms(id));
        (self.labels.is_empty() || label.is_some_and(|label| self.labels.iter().any(|top_k| top_k == label)))
            && self.label_prefix.as_ref().is_none_or(|prefix| label.is_some_and(|label| label.starts_with(prefix)))
            && self.created_after_ms.is_none_or(|time| created > time)
            && self.created_before_ms.is_none_or(|time| created < time)
            && (self.units.is_empty() || self.units.contains(&facets.unit))
            && self.source.is_none_or(|source| source == facets.source)
    }
}

/// When a model was made, milliseconds since 1970: the first 48 bits of a UUID of version 7.
fn created_ms(id: ModelId) -> i64 {
    (id >> 80) as i64
}

/// The facets of all models of the gallery.
#[derive(Debug, Default)]
pub struct Catalogue {
    // looked up, never gone through where the order would show
    facets: HashMap<ModelId, Facets>,
}

impl Extend<(ModelId, Facets)> for Catalogue {
    fn extend<I: IntoIterator<Item = (ModelId, Facets)>>(&mut self, models: I) {
        self.facets.extend(models);
    }
}

impl Catalogue {
    /// Adds or replaces a model.
    pub fn insert(&mut self, id: ModelId, facets: Facets) {
        self.facets.insert(id, facets);
    }

    /// Takes over what another one knows.
    pub fn append(&mut self, other: Catalogue) {
        if self.facets.is_empty() {
            *self = other;
        } else {
            self.facets.extend(other.facets);
        }
    }

    /// Forgets a model.
    pub fn remove(&mut self, id: ModelId) {
        self.facets.remove(&id);
    }

    /// Forgets the models that `keeps` does not want.
    pub fn retain(&mut self, keeps: impl Fn(ModelId) -> bool) {
        self.facets.retain(|id, _| keeps(*id));
    }

    /// What is known of a model.
    pub fn facets(&self, id: ModelId) -> Option<&Facets> {
        self.facets.get(&id)
    }

    /// The models that have a label, by id; `None` if there are more than `most`.
    pub fn labeled(&self, prefix: &str, most: usize) -> Option<Vec<(ModelId, Box<str>)>> {
        let label = |facets: &Facets| facets.label.clone().filter(|label| label.starts_with(prefix));
        let labeled = self.facets.iter().filter_map(|(id, facets)| Some((*id, label(facets)?)));
        let mut labeled: Vec<_> = labeled.take(most.saturating_add(1)).collect();
        labeled.sort();
        (labeled.len() <= most).then_some(labeled)
    }

    /// Whether the model may be answered with; one that is not known only by a filter that asks nothing.
    pub fn takes(&self, filter: &Filter, id: ModelId) -> bool {
        filter.is_empty() || self.facets.get(&id).is_some_and(|facets| filter.takes(id, facets))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn catalogue() -> Catalogue {
        let mut catalogue = Catalogue::default();
        let models = [
            (1, Some("face/ann"), Unit::Mm, Source::Uploaded),
            (2, Some("face/bob"), Unit::Unknown, Source::Registered),
            (3, Some("owl"), Unit::Mm, Source::Registered),
            (4, None, Unit::M, Source::Uploaded),
        ];
        for (minute, label, unit, source) in models {
            catalogue.insert((minute * 60_000) << 80, Facets { label: label.map(Box::from), unit, source });
        }
        catalogue
    }

    fn taken(filter: Filter) -> Vec<u128> {
        let catalogue = catalogue();
        (1..6).filter(|minute| catalogue.takes(&filter, (minute * 60_000) << 80)).collect()
    }

    #[test]
    fn each_condition_asks_for_its_own() {
        assert_eq!(taken(Filter { labels: vec!["owl".into(), "face/bob".into()], ..Filter::default() }), [2, 3]);
        assert_eq!(taken(Filter { label_prefix: Some("face/".into()), ..Filter::default() }), [1, 2]);
        assert_eq!(taken(Filter { units: vec![Unit::Mm], ..Filter::default() }), [1, 3]);
        assert_eq!(taken(Filter { source: Some(Source::Registered), ..Filter::default() }), [2, 3]);
        assert_eq!(taken(Filter { created_after_ms: Some(60_000), ..Filter::default() }), [2, 3, 4]);
        assert_eq!(taken(Filter { created_before_ms: Some(120_000), ..Filter::default() }), [1]);
    }

    #[test]
    fn conditions_are_joined_by_and() {
        let filter = Filter { units: vec![Unit::Mm], source: Some(Source::Registered), ..Filter::default() };
        assert_eq!(taken(filter.clone()), [3]);
        assert!(taken(Filter { label_prefix: Some("face".into()), ..filter }).is_empty());
    }

    #[test]
    fn labeled_models_are_listed_up_to_a_bound() {
        let labels = |prefix, most| {
            let labeled = catalogue().labeled(prefix, most)?;
            Some(labeled.into_iter().map(|(_, label)| label.into_string()).collect::<Vec<_>>())
        };
        assert_eq!(labels("", 3), Some(["face/ann", "face/bob", "owl"].map(str::to_owned).into()));
        assert_eq!(labels("o", 1), Some(vec!["owl".to_owned()]));
        assert_eq!(labels("", 2), None);
    }

    #[test]
    fn an_empty_filter_takes_even_what_is_not_known() {
        assert_eq!(taken(Filter::default()), [1, 2, 3, 4, 5]);
        let mut catalogue = catalogue();
        catalogue.remove(60_000 << 80);
        assert_eq!(catalogue.facets(60_000 << 80), None);
    }
}
