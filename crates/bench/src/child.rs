//! `visage register` run as a process of its own, so that its whole cost is seen from outside.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;
use visage::domain::asset::Asset;

use anyhow::{Context, ensure};
use nix::sys::resource::{UsageWho, getrusage};
use serde_json::Value;

/// What a run of `visage register` took, and its report.
pub struct Run {
    /// User and system seconds of the whole process.
    pub cpu_seconds: f64,
    /// Seconds from start to end.
    pub wall_seconds: f64,
    /// `report.json`.
    pub report: Value,
}

impl Run {
    /// Seconds that one stage took, by the report.
    pub fn stage_seconds(&self, stage: &str) -> f64 {
        self.report["run"]["seconds"][stage].as_f64().unwrap_or(0.0)
    }
}

/// Registers the scans of `dir` from the poses in it; results go to `out`.
pub fn register(dir: &Path, poses: &Path, out: &Path, options: &[&str]) -> anyhow::Result<Run> {
    let program = program()?;
    let (cpu_before, started) = (cpu_of_children()?, Instant::now());
    let output = Command::new(program)
        .arg("register")
        .arg(dir)
        .arg("--poses")
        .arg(poses)
        .arg("--out")
        .arg(out)
        .args(options)
        .output()
        .context("starting visage register")?;
    let (cpu_seconds, wall_seconds) = (cpu_of_children()? - cpu_before, started.elapsed().as_secs_f64());
    let complaint = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "visage register {} failed: {}", dir.display(), complaint.trim());
    let report = out.join(&*Asset::Report.name());
    let report = std::fs::read(&report).with_context(|| format!("reading {}", report.display()))?;
    let report = serde_json::from_slice(&report).context("reading the report")?;
    Ok(Run { cpu_seconds, wall_seconds, report })
}

/// The program `visage`, which is built beside this one.
fn program() -> anyhow::Result<PathBuf> {
    let this = std::env::current_exe().context("finding this program")?;
    let program = this.with_file_name(format!("visage{}", std::env::consts::EXE_SUFFIX));
    ensure!(
        program.is_file(),
        "{} is not there: build it as this was built (cargo build --release)",
        program.display()
    );
    Ok(program)
}

/// User and system seconds of all finished child processes.
fn cpu_of_children() -> anyhow::Result<f64> {
    let usage = getrusage(UsageWho::RUSAGE_CHILDREN).context("asking for the CPU time of child processes")?;
    let seconds = |time: nix::sys::time::TimeVal| time.tv_sec() as f64 + time.tv_usec() as f64 * 1e-6;
    Ok(seconds(usage.user_time()) + seconds(usage.system_time()))
}
