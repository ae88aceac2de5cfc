//! Logs: one line an event on standard error, as text or as JSON; panics are logged like errors.

#[cfg(not(feature = "otel"))]
#[path = "telemetry/no_otel.rs"]
mod otel;
#[cfg(feature = "otel")]
mod otel;

use std::io::IsTerminal;

use tracing::level_filters::LevelFilter;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

use visage_service::panics::panic_message;

pub use otel::Exporter;

/// How log lines are written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum LogFormat {
    /// For people.
    #[default]
    Text,
    /// For log collectors: one JSON object a line.
    Json,
}

/// The default filter: our own events from `info`, everything else from `warn`.
pub const DEFAULT_FILTER: &str = "warn,visage=info";

/// Why logging could not be set up.
#[derive(Debug, thiserror::Error)]
pub enum TelemetryError {
    /// The filter is not understood.
    #[error(
        "log filter {filter:?}: {part:?} is neither a level nor TARGET=LEVEL; write it like \"info\" or \"warn,visage=debug\""
    )]
    Filter {
        /// The filter as given.
        filter: String,
        /// The part that is meant.
        part: String,
    },
    /// A logger is already installed in this process.
    #[error("logging is already set up: {0}")]
    AlreadySet(String),
    /// Spans can't be sent as the environment says.
    #[error("OTEL_EXPORTER_OTLP_*: {0}")]
    Traces(String),
}

/// Installs the logger and the panic hook of this process.
pub fn init(format: LogFormat, filter: &str) -> Result<(), TelemetryError> {
    init_traced(format, filter, &Exporter::none())
}

/// The same for a process whose spans are sent.
pub fn init_traced(format: LogFormat, filter: &str, exporter: &Exporter) -> Result<(), TelemetryError> {
    let lines =
        tracing_subscriber::fmt::layer().with_writer(std::io::stderr).with_ansi(std::io::stderr().is_terminal());
    let filtered = tracing_subscriber::registry().with(targets(filter)?).with(exporter.layer());
    let installed = match format {
        LogFormat::Text => filtered.with(lines).try_init(),
        LogFormat::Json => filtered.with(lines.json().flatten_event(true)).try_init(),
    };
    installed.map_err(|error| TelemetryError::AlreadySet(error.to_string()))?;
    std::panic::set_hook(Box::new(log_panic));
    Ok(())
}

/// Levels by the beginning of the module's name. `EnvFilter` could select by spans and fields too, which nothing of
/// ours needs, and takes a regex engine along.
fn targets(filter: &str) -> Result<Targets, TelemetryError> {
    let mut parts = filter.split(',').map(str::trim).filter(|part| !part.is_empty()).peekable();
    let nothing_said = if parts.peek().is_none() { LevelFilter::ERROR } else { LevelFilter::OFF };
    let mut targets = Targets::new().with_default(nothing_said);
    for part in parts {
        let refused = || TelemetryError::Filter { filter: filter.to_owned(), part: part.to_owned() };
        if let Ok(level) = part.parse::<LevelFilter>() {
            targets = targets.with_default(level);
            continue;
        }
        // a name alone means everything of it
        let (target, level) = match part.split_once('=') {
            None | Some((_, "")) => (part.trim_end_matches('='), LevelFilter::TRACE),
            Some((target, level)) => (target, level.parse().map_err(|_| refused())?),
        };
        if !target.chars().all(|c| c.is_alphanumeric() || ":_-.".contains(c)) {
            return Err(refused());
        }
        targets = targets.with_target(target, level);
    }
    Ok(targets)
}

/// A panic in a log collector's own format, with its place, instead of bare text on standard error.
fn log_panic(panic: &std::panic::PanicHookInfo<'_>) {
    let place = panic.location().map(ToString::to_string).unwrap_or_default();
    let thread = std::thread::current();
    tracing::error!(place, thread = thread.name().unwrap_or("unnamed"), "panic: {}", panic_message(panic.payload()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_filter_is_named() {
        for wrong in ["visage=[[", "info,visage[span]=debug", "visage=loud", "visage=a=b", "[{field}]=info"] {
            let error = init(LogFormat::Text, wrong).expect_err("no filter").to_string();
            assert!(error.contains(wrong) && error.contains("warn,visage=debug"), "{error}");
        }
    }

    #[test]
    fn levels_go_by_the_beginning_of_the_module() {
        use tracing::Level;
        let written =
            |filter: &str, target: &str, level: Level| targets(filter).expect("a filter").would_enable(target, &level);
        // our crates all begin with our name
        assert!(written(DEFAULT_FILTER, "visage_http::access_log", Level::INFO));
        assert!(!written(DEFAULT_FILTER, "visage_http::access_log", Level::DEBUG));
        assert!(written(DEFAULT_FILTER, "sqlx::query", Level::WARN));
        assert!(!written(DEFAULT_FILTER, "sqlx::query", Level::INFO));
        // the longest name decides, in whatever order
        assert!(!written("visage_http=off, visage=debug,", "visage_http::server", Level::ERROR));
        assert!(written("visage_http=off, visage=debug,", "visage_service::jobs", Level::DEBUG));
        assert!(written("visage_http", "visage_http::server", Level::TRACE));
        assert!(!written("visage_http", "sqlx", Level::ERROR));
        // what was said of nothing
        assert!(written("", "sqlx", Level::ERROR) && !written("", "sqlx", Level::WARN));
        assert!(written("INFO", "sqlx", Level::INFO) && !written("off", "visage", Level::ERROR));
    }
}
