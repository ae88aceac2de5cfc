//! `visage deviation`: how far one model is from another, as figures and as a coloured cloud or mesh.

use std::path::PathBuf;

use anyhow::{Context, ensure};
use clap::Args;

use super::surface::length;
use super::surfaces;
use super::workplace::Workplace;
use crate::geometry::Unit;
use crate::pipeline::deviation::{Deviation, DeviationReport, Question};
use crate::progress::Stage;

/// Which two, and what is to be said.
#[derive(Debug, Args)]
pub struct DeviationArgs {
    /// The cloud or mesh that is measured, of any format that is read
    model: PathBuf,
    /// What it is measured to: a mesh, or a cloud, in the same frame and unit
    reference: PathBuf,
    /// Write MODEL as PLY with its distances: red is outside of REFERENCE, blue inside, grey out of reach
    #[arg(long, value_name = "PLY")]
    out: Option<PathBuf>,
    /// What is tolerated: the share beyond it is counted, and the colours are full there [default: what 95 % don't exceed]
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    limit: Option<f64>,
    /// Places that have nothing of the other within this have no counterpart, and are left out of the figures
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    reach: Option<f64>,
    /// Unit of the coordinates, for words: mm, cm, m, in or unknown [default: what the file of MODEL declares]
    #[arg(long)]
    unit: Option<Unit>,
    /// Worker threads [default: one per core]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Say the figures as JSON
    #[arg(long)]
    json: bool,
}

/// Measures both ways and says it.
pub fn run(args: DeviationArgs) -> anyhow::Result<()> {
    let place = Workplace::new(args.threads.map(usize::from))?;
    place.progress.report(Stage::Loading, 0.0);
    let (model, _) = surfaces::read(&args.model)?;
    let (other, _) = surfaces::read(&args.reference)?;
    let unit = surfaces::unit(args.unit, &model);
    let is_same = model.unit.zip(other.unit).is_none_or(|(a, b)| a == b);
    ensure!(is_same, "the files declare different units; convert one of them first");
    let question = Question { limit: args.limit, reach: args.reach };
    place.progress.report(Stage::Judging, 0.0);
    let measured = || Deviation::measured(&model.surface, &other.surface, question, &place.progress);
    let deviation = place.pool.install(measured)?.context("a file without points is no reference")?;
    if let Some(out) = &args.out {
        let bytes = deviation.coloured(model.surface, args.limit);
        std::fs::write(out, bytes).with_context(|| format!("writing {}", out.display()))?;
    }
    let Deviation { has_sides, forth, back, .. } = deviation;
    let reports = [forth, back];
    place.done();
    if args.json {
        let unit = unit.name();
        let figures = serde_json::json!({"unit": unit, "has_sides": has_sides, "model_to_reference": reports[0],
            "reference_to_model": reports[1]});
        println!("{}", serde_json::to_string_pretty(&figures)?);
        return Ok(());
    }
    if !has_sides {
        eprintln!("note: the reference is a cloud without normals: distances have no sign");
    }
    for (way, report) in ["model to reference", "reference to model"].into_iter().zip(&reports) {
        println!("{}", in_words(way, report, unit, args.limit));
    }
    Ok(())
}

fn in_words(way: &str, report: &DeviationReport, unit: Unit, limit: Option<f64>) -> String {
    let DeviationReport { points, out_of_reach, mean_signed, absolute, beyond_limit, .. } = report;
    let unit = surfaces::behind(unit);
    let beyond = match (limit, beyond_limit) {
        (Some(limit), Some(share)) => format!("; {:.2} % beyond {limit}{unit}", 100.0 * share),
        _ => String::new(),
    };
    let without = if *out_of_reach > 0 { format!("; {out_of_reach} points out of reach") } else { String::new() };
    format!(
        "{way}: {points} points, mean {}{unit}, absolute mean {}, rms {}, 95 % {}, 99 % {}, largest {}{beyond}{without}",
        surfaces::short(*mean_signed),
        surfaces::short(absolute.mean),
        surfaces::short(absolute.rms),
        surfaces::short(absolute.p95),
        surfaces::short(absolute.p99),
        surfaces::short(absolute.max)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::{ReadLimits, ply, read};
    use crate::synthetic::objects;
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        args: DeviationArgs,
    }

    #[test]
    fn a_grown_blob_is_red_all_over() {
        let place = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| place.path().join(name).to_str().expect("UTF-8").to_owned();
        let blob = objects::blob(1, 20_000).mesh;
        let center = blob.bounds().expect("vertices").center();
        let mut grown = blob.clone();
        grown.vertices.iter_mut().for_each(|vertex| *vertex = center + (*vertex - center) * 1.05);
        std::fs::write(at("blob.ply"), ply::write_mesh(&blob)).expect("written");
        std::fs::write(at("grown.ply"), ply::write_mesh(&grown)).expect("written");
        let line = ["visage", &at("grown.ply"), &at("blob.ply"), "--out", &at("map.ply"), "--limit", "1"];
        run(Line::parse_from(line).args).expect("measured");
        let bytes = std::fs::read(at("map.ply")).expect("there");
        assert!(String::from_utf8_lossy(&bytes[..400]).contains("property float deviation"));
        let map = read("map.ply", &bytes, &ReadLimits::default()).expect("own files are read").surface;
        assert_eq!((map.cloud.len(), map.faces.len()), (grown.vertices.len(), grown.faces.len()));
        let colors = map.cloud.colors.expect("colours");
        let red = colors.iter().filter(|[red, green, _]| *red == 255 && *green < 128).count();
        assert!(red as f64 > 0.95 * colors.len() as f64, "{red} of {}", colors.len());
    }
}
