//! Logs: one line an event on standard error, as text or as JSON; panics are logged like errors.

use std::io::IsTerminal;

use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::format::FmtSpan;

use visage_service::panics::panic_message;

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
    #[error("log filter {filter:?}: {source}; write it like \"info\" or \"warn,visage=debug\"")]
    Filter {
        /// The filter as given.
        filter: String,
        /// What is wrong with it.
        source: tracing_subscriber::filter::ParseError,
    },
    /// A logger is already installed in this process.
    #[error("logging is already set up: {0}")]
    AlreadySet(String),
}

/// Installs the logger and the panic hook of this process.
pub fn init(format: LogFormat, filter: &str) -> Result<(), TelemetryError> {
    let parsed =
        EnvFilter::try_new(filter).map_err(|source| TelemetryError::Filter { filter: filter.to_owned(), source })?;
    let builder = tracing_subscriber::fmt()
        .with_env_filter(parsed)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_span_events(FmtSpan::NONE);
    let installed = match format {
        LogFormat::Text => builder.try_init(),
        LogFormat::Json => builder.json().flatten_event(true).try_init(),
    };
    installed.map_err(|error| TelemetryError::AlreadySet(error.to_string()))?;
    std::panic::set_hook(Box::new(log_panic));
    Ok(())
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
        let error = init(LogFormat::Text, "visage=[[").expect_err("no filter");
        assert!(error.to_string().contains("visage=[["), "{error}");
    }
}
