//! The commands of the binary. A new one is a file here, a variant of `Command`, and its arm where that is run.

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

mod client;
mod convert;
pub mod demo;
pub mod deviation;
mod doctor;
mod healthcheck;
mod openapi;
pub mod picture;
pub mod register;
pub mod serve;
pub mod surface;
mod surfaces;
mod workplace;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

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
    Serve(serve::ServeArgs),
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
    /// Ask a running service which of its models are faces, or like this one.
    Query(client::query::QueryArgs),
    /// Tell how good a model of a running service is, and why.
    Report(client::report::ReportArgs),
    /// Draw a picture of a scan or a model, or of what is known of one.
    Picture(picture::PictureArgs),
    /// Show everything on code-made scans: server, uploads, jobs, queries.
    Demo(demo::DemoArgs),
    /// Look whether a data folder is sound, and say what to do where it isn't.
    Doctor(doctor::DoctorArgs),
    /// Print the contract of the service (OpenAPI, YAML).
    Openapi,
    /// Ask a running service whether it is well; for container health checks.
    Healthcheck(healthcheck::HealthcheckArgs),
}

/// Runs the command that the arguments name.
pub fn main() -> ExitCode {
    let command = Cli::parse().command;
    // `visage openapi | head` ends quietly when its reader does; a server must outlive its clients
    if !matches!(command, Command::Serve(_) | Command::Demo(_)) {
        sigpipe::reset();
    }
    let done = match command {
        Command::Serve(args) => serve::run(args),
        Command::Register(args) => register::run(*args),
        Command::Convert(args) => convert::run(args),
        Command::Surface(args) => surface::run(args),
        Command::Deviation(args) => deviation::run(args),
        Command::Upload(args) => client::upload::run(*args),
        Command::Jobs(args) => client::jobs::run(args),
        Command::Models(args) => client::models::run(args),
        Command::Query(args) => client::query::run(args),
        Command::Report(args) => client::report::run(args),
        Command::Picture(args) => picture::run(args),
        Command::Demo(args) => demo::run(args),
        Command::Doctor(args) => doctor::run(args),
        Command::Openapi => openapi::run(),
        Command::Healthcheck(args) => healthcheck::run(args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("visage: {error:#}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }
}
