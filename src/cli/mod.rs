//! The commands of the binary. A new one is a file here, a variant of `Command`, and its arm where that is run.

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

mod backup;
mod client;
mod convert;
mod database;
pub mod demo;
pub mod deviation;
mod doctor;
mod exchange;
mod healthcheck;
mod key;
mod migrate;
mod objects;
pub mod open;
mod openapi;
pub mod picture;
pub mod register;
pub mod serve;
mod settings;
pub mod surface;
mod surfaces;
mod workplace;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use settings::SettingsFile;

/// Registers batches of 3D range scans into one model and finds faces among the models it keeps.
#[derive(Debug, Parser)]
#[command(name = "visage", version, about, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run the service.
    Serve(Box<serve::ServeArgs>),
    /// Print the settings that `serve` would have, and where each is from.
    Config(Box<serve::ServeArgs>),
    /// Register the scans of a folder, without a server.
    Register(Box<register::RegisterArgs>),
    /// Write a scan, a model or poses in another format.
    Convert(convert::ConvertArgs),
    /// Make a mesh of a cloud from elsewhere, or a mesh coarser.
    Surface(surface::SurfaceArgs),
    /// Measure how far one model is from another of the same frame.
    Deviation(deviation::DeviationArgs),
    /// Send scans to a running service and register them there.
    Upload(Box<client::upload::UploadArgs>),
    /// Jobs of a running service: list, show, wait, cancel, retry, delete.
    Jobs(client::jobs::JobsArgs),
    /// Models of a running service: list, show, add, download, delete.
    Models(client::models::ModelsArgs),
    /// The recycle bin of a running service: list, restore, delete, empty.
    Bin(client::bin::BinArgs),
    /// Ask a running service which of its models are faces, or like this one.
    Query(client::query::QueryArgs),
    /// Tell how good a model of a running service is, and why.
    Report(client::report::ReportArgs),
    /// Show a mesh, a cloud or what `register` left in the page, until Ctrl-C.
    Open(open::OpenArgs),
    /// Draw a picture of a scan or a model, or of what is known of one.
    Picture(picture::PictureArgs),
    /// Show everything on code-made scans: server, uploads, jobs, queries.
    Demo(demo::DemoArgs),
    /// Look whether a data folder is sound, and say what to do where it isn't.
    Doctor(doctor::DoctorArgs),
    /// Copy a data folder, also while a server uses it; only what is new since the last time.
    Backup(backup::BackupArgs),
    /// Move the database of a data folder to a PostgreSQL server.
    Migrate(migrate::MigrateArgs),
    /// Put a backup back into a new data folder.
    Restore(backup::RestoreArgs),
    /// Write the gallery of a data folder into one file, for a program of another version.
    Export(exchange::ExportArgs),
    /// Read what `visage export` has written into a data folder.
    Import(exchange::ImportArgs),
    /// Make, list and revoke the keys of a service.
    Key(key::KeyArgs),
    /// Print the contract of the service (OpenAPI, YAML).
    Openapi,
    /// Ask a running service whether it is well; for container health checks.
    Healthcheck(healthcheck::HealthcheckArgs),
}

/// Runs the command that the arguments name.
pub fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("visage: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> anyhow::Result<()> {
    let arguments: Vec<OsString> = std::env::args_os().collect();
    let file = SettingsFile::named(&arguments, settings::variable())?;
    let command = settings::command(Cli::command(), file.as_ref())?;
    let matches = command.clone().try_get_matches_from(arguments).unwrap_or_else(|error| {
        if let (Some(file), true) = (&file, error.use_stderr()) {
            eprintln!("visage: {}", file.remark());
        }
        error.exit()
    });
    if let Some(("config", matches)) = matches.subcommand() {
        sigpipe::reset();
        return settings::print(&command, matches, file.as_ref());
    }
    let command = Cli::from_arg_matches(&matches)?.command;
    // `visage openapi | head` ends quietly when its reader does; a server must outlive its clients
    if !matches!(command, Command::Serve(_) | Command::Demo(_) | Command::Open(_)) {
        sigpipe::reset();
    }
    match command {
        Command::Serve(args) => serve::run(&args),
        // printed above: it wants to know where each value is from
        Command::Config(_) => Ok(()),
        Command::Register(args) => register::run(*args),
        Command::Convert(args) => convert::run(args),
        Command::Surface(args) => surface::run(args),
        Command::Deviation(args) => deviation::run(args),
        Command::Upload(args) => client::upload::run(*args),
        Command::Jobs(args) => client::jobs::run(args),
        Command::Models(args) => client::models::run(args),
        Command::Bin(args) => client::bin::run(args),
        Command::Query(args) => client::query::run(args),
        Command::Report(args) => client::report::run(args),
        Command::Open(args) => open::run(args),
        Command::Picture(args) => picture::run(args),
        Command::Demo(args) => demo::run(args),
        Command::Doctor(args) => doctor::run(args),
        Command::Backup(args) => backup::back_up(args),
        Command::Migrate(args) => migrate::run(&args),
        Command::Restore(args) => backup::restore(args),
        Command::Export(args) => exchange::export(args),
        Command::Import(args) => exchange::import(args),
        Command::Key(args) => key::run(args),
        Command::Openapi => openapi::run(),
        Command::Healthcheck(args) => healthcheck::run(args),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }
}
