//! `visage-bench faces`: the paper's Table 3 for the faces of a labelled set, faces against other things step by step,
//! landmark errors, and what disturbances do to a verdict. Every unit is taken as unknown.

mod costs;
pub(super) mod dataset;
mod disturbances;
mod robustness;
mod roc;
mod tables;

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use rayon::prelude::*;

use dataset::Row;
use visage::faces::{self, Signature};
use visage::geometry::{Surface, Unit};
use visage::progress::Progress;

/// Arguments of `visage-bench faces`.
#[derive(Debug, Args)]
pub struct FacesArgs {
    /// A folder with `manifest.csv` and the models it names; rows with ambiguous = 1 are left out.
    #[arg(long)]
    data: PathBuf,
    /// Writes `faces.md` and `roc.svg` there instead of printing.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Also disturbs every model: turned, subdivided, thinned to a noisy cloud, cut in half, scanned badly.
    #[arg(long)]
    robustness: bool,
    /// Only the disturbances whose names contain this (may be repeated); implies --robustness.
    #[arg(long, value_name = "NAME")]
    disturbance: Vec<String>,
    /// Only the models whose paths contain this (may be repeated).
    #[arg(long, value_name = "NAME")]
    model: Vec<String>,
    /// Also measures what each signature costs, on one thread: of the model as it is, and with 20 000 vertices.
    #[arg(long)]
    costs: bool,
}

/// A model of the set with its signature.
struct Judged {
    row: Row,
    surface: Surface,
    signature: Signature,
}

/// Runs the measurement.
pub fn run(args: FacesArgs) -> anyhow::Result<()> {
    let rows = dataset::read(&args.data)?;
    let is_wanted = |row: &Row| args.model.is_empty() || args.model.iter().any(|name| row.file.contains(name));
    let judged = rows
        .into_par_iter()
        .filter(is_wanted)
        .map(|row| {
            let surface = dataset::load(&args.data, &row)?;
            let signature = described(&surface).with_context(|| format!("{} can't be described", row.file))?;
            Ok(Judged { row, surface, signature })
        })
        .collect::<anyhow::Result<Vec<Judged>>>()?;
    let mut report = tables::all(&judged);
    if args.robustness || !args.disturbance.is_empty() {
        report += &robustness::table(&judged, &args.disturbance);
    }
    if args.costs {
        report += &costs::table(&judged)?;
    }
    let Some(out) = args.out else {
        print!("{report}");
        return Ok(());
    };
    std::fs::create_dir_all(&out).with_context(|| format!("{} can't be made", out.display()))?;
    for (name, content) in [("faces.md", report), ("roc.svg", roc::picture(&judged))] {
        let path = out.join(name);
        std::fs::write(&path, content).with_context(|| format!("{} can't be written", path.display()))?;
    }
    Ok(())
}

fn described(surface: &Surface) -> anyhow::Result<Signature> {
    Ok(faces::describe(surface, Unit::Unknown, &Progress::silent())?)
}
