//! The options of a job as they go over the wire: `GET /v1/info` and the contract, both made of the table.

use serde_json::Value;
use utoipa::openapi::schema::{AdditionalProperties, SchemaType};
use utoipa::openapi::{ObjectBuilder, OneOfBuilder, Ref, RefOr, Schema, Type};
use utoipa::{Number, PartialSchema, ToSchema};

use super::schemas::{choice, list, null, number, text};
use visage_domain::options::{JobOption, Kind, OPTIONS};

/// One option as `GET /v1/info` describes it.
#[derive(Debug, Clone, PartialEq, serde::Serialize, ToSchema)]
pub struct OptionInfo {
    /// Its name in `options`.
    #[schema(example = "min_overlap")]
    pub name: &'static str,
    /// `number`, `integer`, `boolean`, `string` or `array`.
    #[serde(rename = "type")]
    #[schema(example = "number")]
    pub kind: &'static str,
    /// The smallest value allowed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub minimum: Option<f64>,
    /// The largest value allowed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub maximum: Option<f64>,
    /// The values allowed, if it is a choice.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub choices: Option<Vec<Value>>,
    /// What is used when it is not given; null if the data decides.
    #[schema(value_type = Value)]
    pub default: Value,
    /// What it does.
    pub help: &'static str,
}

/// What `GET /v1/info` says of options.
pub fn infos(options: &[JobOption]) -> Vec<OptionInfo> {
    options.iter().map(OptionInfo::of).collect()
}

impl OptionInfo {
    fn of(option: &JobOption) -> Self {
        let (kind, range, choices) = match option.kind {
            Kind::Number(..) => ("number", option.kind.range(), None),
            Kind::Integer(..) => ("integer", option.kind.range(), None),
            Kind::Flag => ("boolean", None, None),
            Kind::Choice { words, .. } => ("string", None, Some(words().into_iter().map(Value::from).collect())),
            Kind::Text => ("string", None, None),
            Kind::Point(_) => ("array", None, None),
        };
        let (minimum, maximum) = range.unzip();
        let default = (option.default)();
        OptionInfo { name: option.name, kind, minimum, maximum, choices, default, help: option.help }
    }
}

/// The options of a job, as the contract describes them.
pub struct OptionsView;

impl PartialSchema for OptionsView {
    fn schema() -> RefOr<Schema> {
        let about = "The options of a job; all are optional in a request.";
        schema(OPTIONS).description(Some(about)).build().into()
    }
}

impl ToSchema for OptionsView {
    fn name() -> std::borrow::Cow<'static, str> {
        "JobOptions".into()
    }

    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        for option in OPTIONS {
            if let Kind::Choice { name, about, words } = option.kind {
                schemas.push((name.to_owned(), choice(words(), about)));
            }
        }
    }
}

/// The schema of an object with these options.
pub fn schema(options: &[JobOption]) -> ObjectBuilder {
    let object = ObjectBuilder::new()
        .schema_type(Type::Object)
        .additional_properties(Some(AdditionalProperties::FreeForm(false)));
    options.iter().fold(object, |object, option| object.property(option.name, property(option)))
}

fn property(option: &JobOption) -> RefOr<Schema> {
    let about = sentence(option.help);
    let plain = match option.kind {
        Kind::Choice { name, .. } => return named(name, about).into(),
        Kind::Point(reach) => {
            let coordinate = number().minimum(Some(short(-reach))).maximum(Some(short(reach)));
            let point = list(coordinate, 3).description(Some(about));
            return if option.is_open() { OneOfBuilder::new().item(point).item(null()).into() } else { point.into() };
        }
        Kind::Number(..) => number(),
        Kind::Integer(..) => ObjectBuilder::new().schema_type(Type::Integer),
        Kind::Flag => ObjectBuilder::new().schema_type(Type::Boolean),
        Kind::Text => text(),
    };
    let (least, most) = option.kind.range().unzip();
    let described = plain.description(Some(about)).minimum(least.map(short)).maximum(most.map(short));
    let kind = match option.kind {
        Kind::Number(..) => Type::Number,
        Kind::Integer(..) => Type::Integer,
        Kind::Flag => Type::Boolean,
        _ => Type::String,
    };
    let property = if option.is_open() {
        described.schema_type(SchemaType::from_iter([kind, Type::Null]))
    } else {
        described.examples([(option.default)()])
    };
    property.build().into()
}

fn named(schema: &str, about: String) -> Ref {
    let mut named = Ref::from_schema_name(schema);
    named.description = about;
    named
}

/// A whole number without decimals.
fn short(value: f64) -> Number {
    if value.fract() == 0.0 && value.abs() < 1e15 { Number::Int(value as isize) } else { Number::Float(value) }
}

/// A help text as a sentence of its own.
fn sentence(help: &str) -> String {
    let mut letters = help.chars();
    letters.next().map_or_else(String::new, |first| format!("{}{}.", first.to_uppercase(), letters.as_str()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use visage_domain::options::Declared;
    use visage_domain::options::dummy::WithDummy;

    fn value(schema: impl serde::Serialize) -> Value {
        serde_json::to_value(schema).expect("plain data")
    }

    #[test]
    fn a_line_is_all_that_an_option_needs_to_be_described() {
        let described = value(infos(WithDummy::TABLE));
        let expected = json!({
            "name": "dummy_rounds", "type": "integer", "minimum": 1.0, "maximum": 9.0, "default": 3,
            "help": "how often nothing is done",
        });
        assert_eq!(described[1], expected);
        let stated = value(schema(WithDummy::TABLE).build());
        let expected = json!({
            "type": "integer", "minimum": 1, "maximum": 9, "examples": [3], "description": "How often nothing is done.",
        });
        assert_eq!(stated["properties"]["dummy_rounds"], expected);
    }

    #[test]
    fn the_contract_says_of_every_option_what_is_checked() {
        let stated = value(OptionsView::schema());
        assert_eq!(stated.get("required"), None);
        assert_eq!(stated["additionalProperties"], false);
        assert_eq!(stated["properties"].as_object().map(serde_json::Map::len), Some(OPTIONS.len()));
        for info in infos(OPTIONS) {
            let stated = &stated["properties"][info.name];
            assert_eq!(stated["minimum"].as_f64(), info.minimum, "{}", info.name);
            assert_eq!(stated["maximum"].as_f64(), info.maximum, "{}", info.name);
        }
        let mut named = Vec::new();
        OptionsView::schemas(&mut named);
        let choices = infos(OPTIONS).into_iter().filter_map(|info| info.choices);
        for choices in choices {
            assert!(named.iter().any(|(_, schema)| value(schema)["enum"] == json!(choices)), "{choices:?}");
        }
    }
}
