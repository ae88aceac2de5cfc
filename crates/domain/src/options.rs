//! What the caller of a job may choose. [`OPTIONS`] declares each option once: its field, its checks, what
//! `GET /v1/info` and the contract say of it, and the arguments of `visage register` follow from its line.

use std::fmt;

use serde_json::Value;

use visage_geometry::MAX_COORDINATE;
pub use visage_registration::method::Method;
pub use visage_surface::reconstruct::Fill;

/// One option.
pub struct JobOption {
    /// Its name in `options`, and that of the field.
    pub name: &'static str,
    /// Its type, and the values that it may have.
    pub kind: Kind,
    /// What is used when it is not given; null if the data decides.
    pub default: fn() -> Value,
    /// What it does, without a capital or a full stop; of a flag, what it asks for: "don't" may stand before it.
    pub help: &'static str,
}

/// The type of an option and the values that it may have.
#[derive(Clone, Copy)]
pub enum Kind {
    /// A number from the first to the second.
    Number(f64, f64),
    /// A whole number from the first to the second.
    Integer(u32, u32),
    /// Yes or no.
    Flag,
    /// One of a few words.
    Choice {
        /// What the contract calls the type.
        name: &'static str,
        /// What the contract says of the type.
        about: &'static str,
        /// The words, the default first.
        words: fn() -> Vec<&'static str>,
    },
    /// Any text.
    Text,
    /// Three coordinates, none larger than this.
    Point(f64),
}

impl Kind {
    /// The least and the most that its numbers may be.
    pub fn range(self) -> Option<(f64, f64)> {
        match self {
            Kind::Number(least, most) => Some((least, most)),
            Kind::Integer(least, most) => Some((least.into(), most.into())),
            Kind::Point(reach) => Some((-reach, reach)),
            Kind::Flag | Kind::Choice { .. } | Kind::Text => None,
        }
    }
}

impl JobOption {
    /// Whether it may be left open: then the data decides.
    pub fn is_open(&self) -> bool {
        (self.default)().is_null()
    }

    /// Checks the numbers of a value.
    ///
    /// # Errors
    /// [`OptionError::OutOfRange`] for the first that is not in the range.
    pub fn check(&self, numbers: &[f64]) -> Result<(), OptionError> {
        let Some((minimum, maximum)) = self.kind.range() else { return Ok(()) };
        match numbers.iter().find(|number| !(minimum..=maximum).contains(*number)) {
            None => Ok(()),
            Some(value) => {
                let is_whole = matches!(self.kind, Kind::Integer(..));
                let value = if is_whole { format!("{value}") } else { format!("{value:?}") };
                Err(OptionError::OutOfRange { name: self.name, value, minimum, maximum })
            }
        }
    }
}

impl fmt::Debug for JobOption {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
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
        value: String,
        /// The smallest value allowed.
        minimum: f64,
        /// The largest value allowed.
        maximum: f64,
    },
    /// Not an object of known options with values of the right types.
    #[error("{0}")]
    Malformed(String),
}

/// The numbers in a value, for the check of its range.
pub trait Numbers {
    /// All of them; most types have none.
    fn numbers(&self) -> Vec<f64> {
        Vec::new()
    }
}

impl Numbers for bool {}
impl Numbers for String {}
impl Numbers for Method {}
impl Numbers for Scale {}
impl Numbers for Fill {}

impl Numbers for f64 {
    fn numbers(&self) -> Vec<f64> {
        vec![*self]
    }
}

impl Numbers for usize {
    fn numbers(&self) -> Vec<f64> {
        vec![*self as f64]
    }
}

impl Numbers for [f64; 3] {
    fn numbers(&self) -> Vec<f64> {
        self.to_vec()
    }
}

impl<T: Numbers> Numbers for Option<T> {
    fn numbers(&self) -> Vec<f64> {
        self.as_ref().map_or_else(Vec::new, T::numbers)
    }
}

/// Options that a table declares.
pub trait Declared: Default + serde::Serialize + serde::de::DeserializeOwned {
    /// The table.
    const TABLE: &'static [JobOption];

    /// Checks the ranges of all values.
    ///
    /// # Errors
    /// [`OptionError::OutOfRange`] for the first option that is not in its range.
    fn check(&self) -> Result<(), OptionError>;

    /// Reads `options` of a request.
    ///
    /// # Errors
    /// [`OptionError`] for unknown names, wrong types and values out of range.
    fn parse(options: Value) -> Result<Self, OptionError> {
        // serde would also take an array of the values in their order
        if !options.is_object() {
            return Err(OptionError::Malformed("options must be a JSON object".to_owned()));
        }
        let parsed: Self =
            serde_json::from_value(options).map_err(|error| OptionError::Malformed(error.to_string()))?;
        parsed.check()?;
        Ok(parsed)
    }
}

/// Declares options, a line each: `name: type = default, kind, help;`.
macro_rules! options {
    ($(#[$doc:meta])* $options:ident, $table:ident;
     $($name:ident: $type:ty = $default:expr, $kind:expr, $help:literal;)*) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $options {
            $(
                #[doc = $help]
                pub $name: $type,
            )*
        }

        impl Default for $options {
            fn default() -> Self {
                $options { $($name: $default,)* }
            }
        }

        /// Every option, in the order in which people should read about them.
        pub const $table: &[$crate::options::JobOption] = &[$(
            $crate::options::JobOption {
                name: stringify!($name),
                kind: $kind,
                default: || {
                    let default: $type = $default;
                    serde_json::to_value(default).unwrap_or_default()
                },
                help: $help,
            },
        )*];

        impl $crate::options::Declared for $options {
            const TABLE: &'static [$crate::options::JobOption] = $table;

            fn check(&self) -> Result<(), $crate::options::OptionError> {
                use $crate::options::Numbers;
                let numbers = [$(self.$name.numbers()),*];
                $table.iter().zip(numbers).try_for_each(|(option, numbers)| option.check(&numbers))
            }
        }
    };
}
/// Beyond this a length is a mistake in whatever unit.
const LONGEST: f64 = 1e6;

const METHODS: Kind = Kind::Choice {
    name: "MethodName",
    about: "A registration method.",
    words: || Method::ALL.iter().map(|choice| choice.name()).collect(),
};

const SCALES: Kind = Kind::Choice {
    name: "ScaleName",
    about: "Whether scans get scale factors.",
    words: || Scale::ALL.iter().map(|choice| choice.name()).collect(),
};

const FILLS: Kind = Kind::Choice {
    name: "FillName",
    about: "What becomes of the holes of a mesh.",
    words: || Fill::ALL.iter().map(|choice| choice.name()).collect(),
};

options! {
    /// What the caller of a job may choose. Unknown fields are refused.
    Options, OPTIONS;
    method: Method = Method::Joint, METHODS, "how the scans are registered with each other";
    threads: Option<usize> = None, Kind::Integer(1, 1024),
        "worker threads, one per core when not given; capped by the server's own number";
    min_overlap: f64 = 0.5, Kind::Number(0.05, 0.95),
        "the least overlap of a pair of scans that is registered (xi_0)";
    range_accuracy: Option<f64> = None, Kind::Number(0.0, LONGEST),
        "depth error of the scanner (R_e), in the unit of the scans; estimated from the scans when not given";
    max_rounds: usize = 20, Kind::Integer(1, 1000), "the most rounds of overlap, ICP and averaging";
    sensor: Option<[f64; 3]> = None, Kind::Point(MAX_COORDINATE),
        "where the scanner stood in each scan's frame [x, y, z]; believed before what the files say";
    scale: Scale = Scale::None, SCALES,
        "whether scans are scaled: per_view finds a factor for each, the first's being 1: for scanners of several units";
    reference: Option<String> = None, Kind::Text,
        "the name of the scan that keeps its pose and so fixes the world; the first when not given";
    keep_all: bool = false, Kind::Flag,
        "keep turntable, floor, walls and stray points in the scans; else they are left out where they are recognised";
    cloud: bool = true, Kind::Flag, "make the merged cloud";
    mesh: bool = true, Kind::Flag, "make a mesh of the merged cloud, where there is one";
    fill: Fill = Fill::Small, FILLS,
        "which holes of the mesh are closed: small ones are hardly wider than what the scans resolve, all make it watertight";
    triangles: Option<usize> = None, Kind::Integer(4, 1_000_000_000),
        "the most triangles of the mesh: it is made coarser where that shows least; all are kept when not given";
    max_error: Option<f64> = None, Kind::Number(0.0, LONGEST),
        "make the mesh coarser as far as no place of it is farther off than this, in the unit of the scans";
    preview: bool = true, Kind::Flag, "make coarse copies of the mesh for pages and phones";
    deface: bool = false, Kind::Flag,
        "cut the face out of cloud and mesh, where one is found: for copies that must not show whose it is";
    signature: bool = true, Kind::Flag, "make the signature by which queries find the model";
}

/// Whether scans are scaled.
#[derive(
    Debug,
    Clone,
    Copy,
    Default,
    PartialEq,
    Eq,
    serde::Serialize,
    serde::Deserialize,
    strum::VariantArray,
    strum::IntoStaticStr,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Scale {
    /// All scans are in one unit.
    #[default]
    None,
    /// Each scan has a scale factor of its own, that of the first being 1: for scanners that disagree in unit.
    PerView,
}

impl Scale {
    /// Every choice, the default first.
    pub const ALL: &[Scale] = <Scale as strum::VariantArray>::VARIANTS;

    /// The name used in options and messages.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Options with a line of their own, for tests of what is made of a table.
#[doc(hidden)]
pub mod dummy {
    use super::*;

    options! {
        /// The least overlap, and an option that there is not.
        WithDummy, TABLE;
        min_overlap: f64 = 0.5, Kind::Number(0.05, 0.95), "the least overlap";
        dummy_rounds: usize = 3, Kind::Integer(1, 9), "how often nothing is done";
    }
}

#[cfg(test)]
mod tests {
    use super::dummy::WithDummy;
    use super::*;
    use serde_json::json;

    #[test]
    fn a_line_is_all_that_an_option_needs_to_be_checked() {
        assert_eq!(WithDummy::parse(json!({"dummy_rounds": 9})).map(|options| options.dummy_rounds), Ok(9));
        let error = WithDummy::parse(json!({"dummy_rounds": 10})).expect_err("too many").to_string();
        assert_eq!(error, "option dummy_rounds is 10, which is not between 1 and 9");
        assert!(Options::parse(json!({"dummy_rounds": 3})).is_err(), "there is no such option");
    }

    #[test]
    fn the_table_names_every_option_in_the_order_of_the_fields() {
        let defaults = serde_json::to_value(Options::default()).expect("plain data");
        let fields = defaults.as_object().expect("an object");
        for option in OPTIONS {
            assert_eq!(fields[option.name], (option.default)(), "{option:?}");
        }
        assert_eq!(OPTIONS.len(), fields.len());
    }

    #[test]
    fn defaults_are_within_their_own_ranges() {
        assert_eq!(Options::parse(json!({})), Ok(Options::default()));
    }

    #[test]
    fn ranges_types_and_names_are_checked() {
        let refused = |options: Value| Options::parse(options).expect_err("refused");
        let message = refused(json!({"min_overlap": 0})).to_string();
        assert_eq!(message, "option min_overlap is 0.0, which is not between 0.05 and 0.95");
        assert!(matches!(refused(json!({"threads": 0})), OptionError::OutOfRange { name: "threads", .. }));
        assert!(matches!(refused(json!({"sensor": [0, 0, 1e13]})), OptionError::OutOfRange { name: "sensor", .. }));
        assert!(matches!(refused(json!({"cloud": "yes"})), OptionError::Malformed(_)));
        assert!(refused(json!({"meshes": true})).to_string().contains("meshes"));
        assert!(matches!(refused(json!([1])), OptionError::Malformed(_)));
        // what no JSON can hold comes from programs
        for wrong in [
            Options { min_overlap: f64::NAN, ..Options::default() },
            Options { range_accuracy: Some(f64::INFINITY), ..Options::default() },
        ] {
            assert!(wrong.check().is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn the_stated_choices_are_accepted() {
        for option in OPTIONS {
            if let Kind::Choice { words, .. } = option.kind {
                assert_eq!(json!(words()[0]), (option.default)());
                words().iter().for_each(|word| {
                    Options::parse(json!({ option.name: word })).expect("a stated choice");
                });
            }
        }
    }
}
