//! Settings of the service: by the command line, the environment, a file, or as they are by default, in this order.
//!
//! There is one table of them, the arguments of `visage serve`: a line of the file is the name of an argument. What
//! the file says is made the argument's default, so nothing else has to know where a value is from.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command};

use crate::config::DatabaseUrl;

/// The commands that have settings.
const COMMANDS: [&str; 2] = ["serve", "config"];
/// What a file can't say: it is about the file, or about no setting.
const NOT_IN_FILES: [&str; 3] = ["config", "help", "version"];
const NAME: &str = "--config";
const VARIABLE: &str = "VISAGE_CONFIG";

/// A file of settings.
#[derive(Debug)]
pub(super) struct SettingsFile {
    path: PathBuf,
    values: BTreeMap<String, Vec<String>>,
}

impl SettingsFile {
    /// The file that these arguments or the environment name, if they do.
    pub(super) fn named(arguments: &[OsString], variable: Option<OsString>) -> anyhow::Result<Option<SettingsFile>> {
        if !arguments.get(1).and_then(|name| name.to_str()).is_some_and(|name| COMMANDS.contains(&name)) {
            return Ok(None);
        }
        let mut path = variable.filter(|path| !path.is_empty());
        for (index, argument) in arguments.iter().enumerate() {
            match argument.to_str() {
                Some(NAME) => path = arguments.get(index + 1).cloned().or(path),
                Some(text) => path = text.strip_prefix("--config=").map(OsString::from).or(path),
                None => {}
            }
        }
        path.map(|path| SettingsFile::read(Path::new(&path))).transpose()
    }

    fn read(path: &Path) -> anyhow::Result<SettingsFile> {
        let text =
            std::fs::read_to_string(path).with_context(|| format!("reading the settings in {}", path.display()))?;
        let table: toml::Table =
            toml::from_str(&text).with_context(|| format!("reading the settings in {}", path.display()))?;
        let mut values = BTreeMap::new();
        for (name, value) in table {
            let value = texts(&value).with_context(|| {
                format!("{}: {name} is neither a text, a number, true or false, nor a list of them", path.display())
            })?;
            values.insert(name, value);
        }
        Ok(SettingsFile { path: path.to_owned(), values })
    }

    /// Makes what it says the defaults of the arguments.
    pub(super) fn apply(&self, mut command: Command) -> anyhow::Result<Command> {
        let serve = command.find_subcommand("serve").context("there is no command serve")?;
        let known: Vec<&str> = settings(serve).filter_map(Arg::get_long).collect();
        if let Some(name) = self.values.keys().find(|name| !known.contains(&name.as_str())) {
            bail!("{}: there is no setting {name:?}; there are {}", self.path.display(), known.join(", "));
        }
        for name in COMMANDS {
            command = command.mut_subcommand(name, |command| command.mut_args(|argument| self.told(argument)));
        }
        Ok(command)
    }

    fn told(&self, argument: Arg) -> Arg {
        match argument.get_long().and_then(|name| self.values.get(name)) {
            Some(values) => argument.required(false).default_values(values.clone()),
            None => argument,
        }
    }

    /// What to say of a wrong value, which may stand here.
    pub(super) fn remark(&self) -> String {
        format!("the settings in {} count like arguments", self.path.display())
    }
}

fn settings(command: &Command) -> impl Iterator<Item = &Arg> {
    command.get_arguments().filter(|argument| argument.get_long().is_some_and(|name| !NOT_IN_FILES.contains(&name)))
}

/// A value as it would stand on the command line.
fn texts(value: &toml::Value) -> Option<Vec<String>> {
    let text = match value {
        toml::Value::String(text) => text.clone(),
        toml::Value::Integer(number) => number.to_string(),
        toml::Value::Float(number) => number.to_string(),
        toml::Value::Boolean(flag) => flag.to_string(),
        toml::Value::Array(items) => {
            let nested: Option<Vec<Vec<String>>> =
                items.iter().map(|item| if item.is_array() { None } else { texts(item) }).collect();
            return Some(nested?.concat());
        }
        toml::Value::Datetime(_) | toml::Value::Table(_) => return None,
    };
    Some(vec![text])
}

/// The commands, with what the file says as defaults. To look at settings none is needed.
pub(super) fn command(command: Command, file: Option<&SettingsFile>) -> anyhow::Result<Command> {
    let command = command.mut_subcommand("config", |config| config.mut_args(|argument| argument.required(false)));
    match file {
        Some(file) => file.apply(command),
        None => Ok(command),
    }
}

/// The variable that names the file.
pub(super) fn variable() -> Option<OsString> {
    std::env::var_os(VARIABLE)
}

/// One setting as it is in force, and where that is from.
#[derive(Debug, PartialEq, Eq)]
struct InForce {
    name: String,
    value: String,
    from: String,
}

/// Prints what is in force and where it comes from: a table that can be used as a file.
pub(super) fn print(command: &Command, matches: &ArgMatches, file: Option<&SettingsFile>) -> anyhow::Result<()> {
    for InForce { name, value, from } in in_force(command, matches, file)? {
        let line = if value.is_empty() { format!("# {name} =") } else { format!("{name} = {value}") };
        println!("{line:<44} # {from}");
    }
    Ok(())
}

fn in_force(command: &Command, matches: &ArgMatches, file: Option<&SettingsFile>) -> anyhow::Result<Vec<InForce>> {
    let serve = command.find_subcommand("config").context("there is no command config")?;
    let mut all = Vec::new();
    for argument in settings(serve) {
        let (id, name) = (argument.get_id().as_str(), argument.get_long().unwrap_or_default());
        let is_list = argument.get_value_delimiter().is_some();
        let raw = matches.get_raw(id).into_iter().flatten().map(|value| value.to_string_lossy().into_owned());
        let values: Vec<String> = match argument.get_value_delimiter() {
            Some(between) => {
                raw.flat_map(|value| value.split(between).map(str::to_owned).collect::<Vec<_>>()).collect()
            }
            None => raw.collect(),
        };
        // its password is for nobody's screen
        let values: Vec<String> = match name {
            "database" => values.iter().map(|url| DatabaseUrl::masked(url)).collect(),
            _ => values,
        };
        let from = match (matches.value_source(id), file) {
            (Some(ValueSource::CommandLine), _) => format!("--{name}"),
            (Some(ValueSource::EnvVariable), _) => {
                argument.get_env().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
            }
            (_, Some(file)) if file.values.contains_key(name) => file.path.display().to_string(),
            _ => "default".to_owned(),
        };
        all.push(InForce { name: name.to_owned(), value: written(&values, is_list), from });
    }
    Ok(all)
}

/// A value as it stands in a file.
fn written(values: &[String], is_list: bool) -> String {
    let plain = |text: &String| text.parse::<u64>().is_ok() || text == "true" || text == "false";
    let quoted = |text: &String| if plain(text) { text.clone() } else { format!("{text:?}") };
    match values {
        [] => String::new(),
        [one] if !is_list => quoted(one),
        several => format!("[{}]", several.iter().map(quoted).collect::<Vec<_>>().join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Cli;
    use super::*;
    use clap::CommandFactory;

    fn file(text: &str) -> anyhow::Result<(SettingsFile, tempfile::TempDir)> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("visage.toml");
        std::fs::write(&path, text).expect("written");
        Ok((SettingsFile::read(&path)?, folder))
    }

    fn found(text: &str, arguments: &[&str]) -> BTreeMap<String, (String, String)> {
        let (file, _folder) = file(text).expect("settings");
        let command = command(Cli::command(), Some(&file)).expect("known settings");
        let arguments = ["visage", "config"].iter().chain(arguments);
        let matches = command.clone().try_get_matches_from(arguments).unwrap_or_else(|error| panic!("{error}"));
        let (_, matches) = matches.subcommand().expect("a command");
        let all = in_force(&command, matches, Some(&file)).expect("told");
        all.into_iter().map(|setting| (setting.name, (setting.value, setting.from))).collect()
    }

    #[test]
    fn arguments_go_before_the_file_and_the_file_before_defaults() {
        let text = "jobs = 2\nthreads = 3\nhost = [\"a.example\", \"b.example\"]\nopen = true\ndata = \"/srv\"\n";
        let all = found(text, &["--threads", "4"]);
        let value = |name: &str| all[name].0.as_str();
        assert_eq!((value("jobs"), value("threads"), value("open")), ("2", "4", "true"));
        assert_eq!(value("host"), "[\"a.example\", \"b.example\"]");
        assert_eq!(value("log"), "\"warn,visage=info\"");
        assert_eq!((value("data"), value("max-scans"), value("keep-models")), ("\"/srv\"", "500", ""));
        assert!(all["jobs"].1.ends_with("visage.toml"), "{all:?}");
        assert_eq!((all["threads"].1.as_str(), all["max-scans"].1.as_str()), ("--threads", "default"));
    }

    #[test]
    fn the_password_of_a_database_is_not_printed() {
        let all = found("data = \"/srv\"\ndatabase = \"postgres://visage:geheim@db/visage\"\n", &[]);
        assert_eq!(all["database"].0, "\"postgres://visage@db/visage\"");
    }

    #[test]
    fn what_is_printed_is_a_file_again() {
        let first = found("jobs = 2\ndata = \"/srv/a b\"\n", &["--host", "a.example,[::1]:80"]);
        let text: String = first
            .iter()
            .filter(|(_, (value, _))| !value.is_empty())
            .map(|(name, (value, _))| format!("{name} = {value}\n"))
            .collect();
        let again = found(&text, &[]);
        for (name, (value, _)) in first {
            assert_eq!(again[&name].0, value, "{name}");
        }
    }

    #[test]
    fn what_is_no_setting_is_refused_with_what_there_is() {
        for (text, part) in [
            ("jbos = 2", "there is no setting \"jbos\""),
            ("config = \"x\"", "there is no setting"),
            ("[serve]\njobs = 2", "neither a text"),
            ("jobs = ", "visage.toml"),
            ("jobs = 2\njobs = 3", "visage.toml"),
        ] {
            let refused = file(text).and_then(|(file, _folder)| file.apply(Cli::command()).map(drop));
            let said = format!("{:#}", refused.expect_err(text));
            assert!(said.contains(part), "{text}: {said}");
        }
    }

    #[test]
    fn the_file_is_named_by_an_argument_before_the_environment_and_for_the_service_alone() {
        let (_, folder) = file("jobs = 2").expect("settings");
        let path = folder.path().join("visage.toml").into_os_string();
        let none = OsString::from("/nowhere");
        let named = |arguments: &[&OsString], variable: Option<&OsString>| {
            let arguments: Vec<OsString> = arguments.iter().map(|argument| (*argument).clone()).collect();
            SettingsFile::named(&arguments, variable.cloned())
        };
        let [visage, serve, demo, config] = ["visage", "serve", "demo", "--config"].map(OsString::from);
        assert!(named(&[&visage, &serve, &config, &path], Some(&none)).expect("read").is_some());
        assert!(named(&[&visage, &serve], Some(&path)).expect("read").is_some());
        assert!(named(&[&visage, &serve], None).expect("none").is_none());
        assert!(named(&[&visage, &demo, &config, &none], Some(&none)).expect("not looked at").is_none());
        assert!(named(&[&visage, &serve], Some(&none)).is_err());
    }

    /// The table of the manual is that of the program.
    #[test]
    fn every_setting_stands_in_the_manual_with_its_variable() {
        let manual =
            std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/OPERATIONS.md")).expect("there");
        let command = Cli::command();
        let serve = command.find_subcommand("serve").expect("there");
        let mut count = 0;
        for argument in settings(serve) {
            let name = argument.get_long().expect("a name");
            let variable = argument.get_env().expect(name).to_string_lossy().into_owned();
            assert!(manual.contains(&format!("| `--{name}` | `{variable}` |")), "--{name} ({variable})");
            count += 1;
        }
        assert!(count > 20, "{count}");
    }
}
