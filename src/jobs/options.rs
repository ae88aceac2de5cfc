//! What the caller of a job may choose: one table for checking requests and for `GET /v1/info`.

use serde_json::{Value, json};

use crate::pipeline::{Method, Options, Scale};

/// One option as `GET /v1/info` describes it.
#[derive(Debug, Clone, PartialEq, serde::Serialize, utoipa::ToSchema)]
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

/// Why options are refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OptionError {
    /// A value is outside of its range.
    #[error("option {name} is {value}, which is not between {minimum} and {maximum}")]
    OutOfRange {
        /// The option.
        name: &'static str,
        /// What was given.
        value: Value,
        /// The smallest value allowed.
        minimum: f64,
        /// The largest value allowed.
        maximum: f64,
    },
    /// Not an object of known options with values of the right types.
    #[error("{0}")]
    Malformed(String),
}

/// The most threads that may be asked for; what is used is capped by the server's own number.
const MAX_THREADS: f64 = 1024.0;
/// Beyond this a length is a mistake in whatever unit.
const MAX_LENGTH: f64 = 1e6;
/// The most rounds of the outer loop.
const MAX_ROUNDS: f64 = 1000.0;

/// Every option, in the order in which people should read about them.
pub fn table() -> Vec<OptionInfo> {
    let defaults = serde_json::to_value(Options::default()).unwrap_or_default();
    let number = |name, kind, minimum, maximum, help| OptionInfo {
        name,
        kind,
        minimum: Some(minimum),
        maximum: Some(maximum),
        choices: None,
        default: defaults[name].clone(),
        help,
    };
    let plain = |name, kind, choices, help| OptionInfo {
        name,
        kind,
        minimum: None,
        maximum: None,
        choices,
        default: defaults[name].clone(),
        help,
    };
    vec![
        plain(
            "method",
            "string",
            Some(Method::ALL.map(|method| json!(method.name())).to_vec()),
            "how the scans are registered with each other",
        ),
        number("threads", "integer", 1.0, MAX_THREADS, "worker threads of the job; capped by the server's own number"),
        number("min_overlap", "number", 0.05, 0.95, "the least overlap of a pair of scans that is registered (xi_0)"),
        number(
            "range_accuracy",
            "number",
            0.0,
            MAX_LENGTH,
            "depth error of the scanner (R_e), in the unit of the scans; estimated from the scans when not given",
        ),
        number("max_rounds", "integer", 1.0, MAX_ROUNDS, "the most rounds of overlap, ICP and averaging"),
        plain(
            "sensor",
            "array",
            None,
            "where the scanner stood in each scan's frame [x, y, z]; believed before what the files say",
        ),
        plain(
            "scale",
            "string",
            Some(Scale::ALL.map(|scale| json!(scale.name())).to_vec()),
            "per_view finds a scale factor for each scan, that of the first being 1: for scanners that disagree in unit",
        ),
        plain(
            "reference",
            "string",
            None,
            "the name of the scan that keeps its pose and so fixes the world; the first when not given",
        ),
        plain(
            "keep_all",
            "boolean",
            None,
            "whether turntable, floor, walls and stray points stay in the scans; else they are left out where they are recognised",
        ),
        plain("cloud", "boolean", None, "whether the merged cloud is made"),
        plain("signature", "boolean", None, "whether the signature is made, by which queries find the model"),
    ]
}

/// Reads `options` of a request. Unknown names, wrong types and values out of range are refused.
pub fn parse(options: Value) -> Result<Options, OptionError> {
    // serde would also take an array of the values in their order
    if !options.is_object() {
        return Err(OptionError::Malformed("options must be a JSON object".to_owned()));
    }
    let parsed: Options = serde_json::from_value(options).map_err(|error| OptionError::Malformed(error.to_string()))?;
    let values = serde_json::to_value(&parsed).map_err(|error| OptionError::Malformed(error.to_string()))?;
    for option in table() {
        if let (Some(minimum), Some(maximum), Some(value)) =
            (option.minimum, option.maximum, values[option.name].as_f64())
            && !(minimum..=maximum).contains(&value)
        {
            let value = values[option.name].clone();
            return Err(OptionError::OutOfRange { name: option.name, value, minimum, maximum });
        }
    }
    Ok(parsed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_names_every_option_and_no_other() {
        let defaults = serde_json::to_value(Options::default()).expect("plain data");
        let mut stated: Vec<&str> = table().iter().map(|option| option.name).collect();
        let mut actual: Vec<&str> = defaults.as_object().expect("an object").keys().map(String::as_str).collect();
        stated.sort_unstable();
        actual.sort_unstable();
        assert_eq!(stated, actual);
    }

    #[test]
    fn defaults_are_within_their_own_ranges() {
        assert_eq!(parse(json!({})), Ok(Options::default()));
    }

    #[test]
    fn ranges_types_and_names_are_checked() {
        let low = parse(json!({"min_overlap": 0})).expect_err("too low");
        assert!(low.to_string().contains("min_overlap"), "{low}");
        assert!(matches!(parse(json!({"threads": 0})), Err(OptionError::OutOfRange { name: "threads", .. })));
        assert!(matches!(parse(json!({"cloud": "yes"})), Err(OptionError::Malformed(_))));
        let unknown = parse(json!({"mesh": true})).expect_err("no such option");
        assert!(unknown.to_string().contains("mesh"), "{unknown}");
        assert!(matches!(parse(json!([1])), Err(OptionError::Malformed(_))));
    }

    #[test]
    fn the_stated_choices_are_accepted() {
        for option in table() {
            for choice in option.choices.into_iter().flatten() {
                parse(json!({ option.name: choice })).expect("a stated choice");
            }
        }
    }
}
