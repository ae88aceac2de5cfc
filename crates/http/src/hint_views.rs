//! Hints as the contract describes them.

use std::collections::BTreeMap;

use serde::Deserialize;
use utoipa::ToSchema;

use super::problem::{Code, Problem};
use super::schemas::{NamedPair, PickedPair, Point, ScanUnits};
use visage_pipeline::Hints;

/// What a person says of the scans where machines can't tell. Everything is in the scans' own frames and unit.
#[derive(Deserialize, ToSchema)]
#[schema(as = Hints)]
#[expect(dead_code, reason = "only describes `pipeline::Hints`; a test holds them against each other")]
pub struct HintsView {
    /// Points that are the same place in two scans.
    #[schema(required = false, max_items = 1000)]
    points: Vec<PickedPointsView>,
    /// Pairs of scans that overlap.
    #[schema(required = false, value_type = Vec<NamedPair>, max_items = 1000)]
    overlaps: Vec<[String; 2]>,
    /// Parts of scans to use or to leave out.
    #[schema(required = false, max_items = 1000)]
    regions: Vec<RegionHintView>,
    /// The units of scans that are in another one than the set, by name: their lengths are converted.
    #[schema(required = false, value_type = ScanUnits)]
    units: BTreeMap<String, String>,
}

/// Places that were picked in two scans.
#[derive(Deserialize, ToSchema)]
#[schema(as = PickedPoints)]
#[expect(dead_code, reason = "only describes `Hints`")]
pub struct PickedPointsView {
    /// One scan,
    a: String,
    /// the other one,
    b: String,
    /// and the same places in both: first in `a`, then in `b`; not all in a line.
    #[schema(value_type = Vec<PickedPair>, min_items = 3, max_items = 1000)]
    pairs: Vec<[[f64; 3]; 2]>,
}

/// A part of a scan: exactly one of `use` and `leave` is given.
#[derive(Deserialize, ToSchema)]
#[schema(as = RegionHint)]
#[expect(dead_code, reason = "only describes `Hints`")]
pub struct RegionHintView {
    /// The scan.
    scan: String,
    /// Of the scan only what lies in such regions is used.
    #[serde(rename = "use")]
    only: Option<RegionView>,
    /// What lies here is left out.
    leave: Option<RegionView>,
}

/// A part of space: exactly one of both is given.
#[derive(Deserialize, ToSchema)]
#[schema(as = Region)]
#[expect(dead_code, reason = "only describes `Hints`")]
pub struct RegionView {
    /// A box along the axes.
    #[serde(rename = "box")]
    cuboid: Option<CuboidView>,
    /// A ball.
    sphere: Option<SphereView>,
}

/// A box along the axes.
#[derive(Deserialize, ToSchema)]
#[schema(as = Box)]
#[expect(dead_code, reason = "only describes `Hints`")]
pub struct CuboidView {
    /// Its corner with the least coordinates,
    #[schema(value_type = Point)]
    min: [f64; 3],
    /// and that with the largest.
    #[schema(value_type = Point)]
    max: [f64; 3],
}

/// A ball.
#[derive(Deserialize, ToSchema)]
#[schema(as = Sphere)]
#[expect(dead_code, reason = "only describes `Hints`")]
pub struct SphereView {
    /// Its middle.
    #[schema(value_type = Point)]
    center: [f64; 3],
    /// Its radius.
    #[schema(exclusive_minimum = 0)]
    radius: f64,
}

/// Reads the hints of a request; whether they fit the scans is checked with these.
pub fn parse(hints: serde_json::Value) -> Result<Hints, Problem> {
    let refused = |detail: String| {
        let hint = "send {\"points\": [...], \"overlaps\": [...], \"regions\": [...]}; /openapi.yaml has the fields";
        Problem::new(Code::InvalidHints, detail, hint)
    };
    // serde would also take an array of the values in their order
    if !hints.is_object() {
        return Err(refused("hints must be a JSON object".to_owned()));
    }
    serde_json::from_value(hints).map_err(|error| refused(format!("the hints can't be read: {error}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};
    use utoipa::PartialSchema;

    /// The fields that a schema states.
    fn stated<T: PartialSchema>() -> Vec<String> {
        let schema = serde_json::to_value(T::schema()).expect("plain data");
        let mut fields: Vec<String> = schema["properties"].as_object().expect("an object").keys().cloned().collect();
        fields.sort_unstable();
        fields
    }

    fn fields(value: &Value) -> Vec<String> {
        let mut fields: Vec<String> = value.as_object().expect("an object").keys().cloned().collect();
        fields.sort_unstable();
        fields
    }

    #[test]
    fn the_contract_names_every_field_of_hints() {
        let whole = json!({
            "points": [{"a": "a.ply", "b": "b.ply", "pairs": [[[0, 0, 0], [1, 0, 0]]]}],
            "overlaps": [["a.ply", "b.ply"]],
            "regions": [
                {"scan": "a.ply", "use": {"box": {"min": [0, 0, 0], "max": [1, 1, 1]}}},
                {"scan": "a.ply", "leave": {"sphere": {"center": [0, 0, 0], "radius": 1}}},
            ],
            "units": {"b.ply": "m"},
        });
        let hints = serde_json::to_value(parse(whole).expect("hints")).expect("plain data");
        assert_eq!(stated::<HintsView>(), fields(&hints));
        assert_eq!(stated::<PickedPointsView>(), fields(&hints["points"][0]));
        let (used, left) = (&hints["regions"][0], &hints["regions"][1]);
        let mut of_region = [fields(used), fields(left)].concat();
        of_region.sort_unstable();
        of_region.dedup();
        assert_eq!(stated::<RegionHintView>(), of_region);
        assert_eq!(stated::<RegionView>(), ["box", "sphere"]);
        assert_eq!(stated::<CuboidView>(), fields(&used["use"]["box"]));
        assert_eq!(stated::<SphereView>(), fields(&left["leave"]["sphere"]));
    }

    #[test]
    fn what_are_no_hints_is_refused_with_the_remedy() {
        for wrong in [json!([]), json!({"point": []}), json!({"points": [{"a": "a.ply", "b": "b.ply"}]})] {
            assert_eq!(parse(wrong).expect_err("no hints").code(), Code::InvalidHints);
        }
    }
}
