//! The options of a job as arguments: one each, made of the table that declares them.

use clap::builder::{PossibleValuesParser, TypedValueParser, ValueParser};
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use serde_json::{Map, Value, json};

use crate::domain::options::{Declared, JobOption, Kind};

/// The options that the arguments give.
#[derive(Debug)]
pub struct Given<O>(pub O);

impl<O: Declared> Args for Given<O> {
    fn augment_args(command: Command) -> Command {
        command.args(O::TABLE.iter().map(argument))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<O: Declared> FromArgMatches for Given<O> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let given: Map<String, Value> =
            O::TABLE.iter().filter_map(|option| Some((option.name.to_owned(), value_of(option, matches)?))).collect();
        let refused = |error| clap::Error::raw(clap::error::ErrorKind::ValueValidation, format!("{error}\n"));
        O::parse(given.into()).map(Given).map_err(refused)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// The value that was given for an option, if one was.
fn value_of(option: &JobOption, matches: &ArgMatches) -> Option<Value> {
    match option.kind {
        Kind::Flag => matches.get_flag(option.name).then(|| json!(!is_on(option))),
        _ => matches.get_one::<Value>(option.name).cloned(),
    }
}

/// Whether a flag is on unless it is turned off.
fn is_on(option: &JobOption) -> bool {
    (option.default)() == json!(true)
}

/// `--name VALUE`; for a flag `--name`, or `--no-name` if it is on by itself.
fn argument(option: &'static JobOption) -> Arg {
    let words = option.name.replace('_', "-");
    let mut letters = option.help.chars();
    let help = letters.next().map_or_else(String::new, |first| first.to_uppercase().to_string() + letters.as_str());
    let argument = Arg::new(option.name);
    if matches!(option.kind, Kind::Flag) {
        let (name, help) =
            if is_on(option) { (format!("no-{words}"), format!("Don't {}", option.help)) } else { (words, help) };
        return argument.long(name).help(help).action(ArgAction::SetTrue);
    }
    let default = match (option.default)() {
        Value::Null => String::new(),
        Value::String(word) => format!(" [default: {word}]"),
        value => format!(" [default: {value}]"),
    };
    let range = match (option.kind, option.kind.range()) {
        (Kind::Number(..) | Kind::Integer(..), Some((least, most))) => format!(" [{least} to {most}]"),
        _ => String::new(),
    };
    let argument = argument.long(words).help(format!("{help}{range}{default}")).value_parser(parser(option));
    match option.kind {
        Kind::Point(_) => argument.value_name("X,Y,Z").allow_hyphen_values(true),
        _ => argument.value_name(option.name.to_uppercase()).allow_negative_numbers(true),
    }
}

fn parser(option: &'static JobOption) -> ValueParser {
    match option.kind {
        Kind::Choice { words, .. } => PossibleValuesParser::new(words()).map(Value::String).into(),
        _ => ValueParser::from(move |text: &str| value(option, text)),
    }
}

/// The value that a text stands for, within its range.
fn value(option: &JobOption, text: &str) -> Result<Value, String> {
    let numbers = |count: usize, what: &str| -> Result<Vec<f64>, String> {
        let numbers: Vec<f64> = text.split(',').map_while(|part| part.trim().parse().ok()).collect();
        let is_whole = numbers.len() == count && text.split(',').count() == count;
        let numbers = if is_whole { numbers } else { return Err(format!("give {what}")) };
        option.check(&numbers).map(|()| numbers).map_err(|error| error.to_string())
    };
    match option.kind {
        Kind::Number(..) => Ok(json!(numbers(1, "a number")?[0])),
        Kind::Integer(..) => {
            let number = text.parse::<u64>().map_err(|_| "give a whole number".to_owned())?;
            numbers(1, "a whole number").map(|_| json!(number))
        }
        Kind::Point(_) => Ok(json!(numbers(3, "three numbers, such as 0,0,0")?)),
        Kind::Flag | Kind::Choice { .. } | Kind::Text => Ok(json!(text)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::options::dummy::WithDummy;
    use crate::domain::options::{OPTIONS, Options, Scale};

    fn parse_as<O: Declared>(arguments: &[&str]) -> Result<O, String> {
        let command = Given::<O>::augment_args(Command::new("visage"));
        let matches = command.try_get_matches_from([&["visage"], arguments].concat()).map_err(|e| e.to_string())?;
        Given::<O>::from_arg_matches(&matches).map(|given| given.0).map_err(|error| error.to_string())
    }

    fn parse(arguments: &[&str]) -> Result<Options, String> {
        parse_as(arguments)
    }

    #[test]
    fn a_line_is_all_that_an_option_needs_to_be_an_argument() {
        let parsed = parse_as::<WithDummy>(&["--dummy-rounds", "7"]).expect("sound");
        assert_eq!((parsed.dummy_rounds, parsed.min_overlap), (7, 0.5));
        assert!(parse_as::<WithDummy>(&["--dummy-rounds", "10"]).is_err_and(|error| error.contains("between 1 and 9")));
        let help = Given::<WithDummy>::augment_args(Command::new("visage")).render_long_help().to_string();
        assert!(help.contains("How often nothing is done [1 to 9] [default: 3]"), "{help}");
    }

    #[test]
    fn nothing_given_means_the_defaults() {
        assert_eq!(parse(&[]), Ok(Options::default()));
    }

    #[test]
    fn every_kind_of_option_is_read() {
        let arguments = ["--min-overlap", "0.3", "--threads=2", "--sensor", "-1,2,3e1", "--scale", "per_view"];
        let more = ["--reference", "a.ply", "--keep-all", "--no-cloud", "--max-rounds", "7"];
        let options = parse(&[&arguments[..], &more].concat()).expect("sound");
        let expected = Options {
            min_overlap: 0.3,
            threads: Some(2),
            sensor: Some([-1.0, 2.0, 30.0]),
            scale: Scale::PerView,
            reference: Some("a.ply".to_owned()),
            keep_all: true,
            cloud: false,
            max_rounds: 7,
            ..Options::default()
        };
        assert_eq!(options, expected);
    }

    #[test]
    fn ranges_are_those_of_the_service() {
        for option in OPTIONS {
            let Some((least, most)) = option.kind.range() else { continue };
            for outside in [least - 1.0, most * 2.0 + 1.0] {
                let text =
                    if matches!(option.kind, Kind::Point(_)) { format!("0,0,{outside}") } else { outside.to_string() };
                let refused = parse(&[&format!("--{}={text}", option.name.replace('_', "-"))]);
                assert!(refused.is_err_and(|error| error.contains("invalid value")), "{option:?}: {text}");
            }
        }
        for [name, wrong] in [["sensor", "1,2"], ["sensor", "1,2,x"], ["threads", "1.5"], ["min-overlap", "nan"]] {
            assert!(parse(&[&format!("--{name}={wrong}")]).is_err(), "{name} {wrong}");
        }
        assert!(parse(&["--method", "magic"]).is_err_and(|error| error.contains("possible values: joint, ma-aticp")));
    }
}
