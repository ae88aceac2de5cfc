//! The results as Markdown.

use std::fmt::Write;

use super::dataset::Dataset;
use super::reported::{Reported, table_1, table_2};
use super::statistics::{Spread, spread, trials_of, wins};
use super::trial::{METHODS, TrialRecord, clock};
use super::{NOISE, PaperArgs};
use visage::pipeline::Method;

/// Writing into a string can't fail.
macro_rules! put {
    ($text:expr, $($line:tt)*) => { let _ = writeln!($text, $($line)*); };
}

/// The whole text.
pub fn write(datasets: &[Dataset], records: &[&TrialRecord], args: &PaperArgs) -> String {
    let mut text = introduction(args);
    write_table_1(&mut text, datasets, records);
    write_table_2(&mut text, datasets, records);
    comparison(&mut text, datasets, records);
    put!(text, "\n## Every trial");
    for dataset in datasets {
        put!(text, "\n![Obj of each trial, {0}]({0}.svg)", dataset.name);
    }
    text
}

fn introduction(args: &PaperArgs) -> String {
    let points = if args.full { "all points" } else { "every 8th point, the spacing measured again" };
    let sets = args.sets.join(",");
    let full = if args.full { " --full" } else { "" };
    format!(
        "# The paper's tables, made again\n\n\
         Made by `visage-bench paper --data DIR --trials {trials} --sets {sets}{full} --out DIR`, visage {version}.\n\n\
         - **Obj** in mm², lower is better. The paper prints no definition; this one was fitted to its figures \
         (`registration/averaging/paper_objective.rs`), so reported and measured columns are near each other but not the same \
         measure. Every 8th point of each scan counts.\n\
         - **Starts**: the poses that come with the scans; the rotation of each but the first is turned by u, drawn \
         uniformly from (-a, a)³ rad; {trials} for each set and level a, the same starts for every method.\n\
         - **Methods**: `lrs-l1alm`, `ma-icp` and `ma-aticp` run on {points}, on one level, as in the paper; `joint` on \
         all points, as `visage register` runs it.\n\
         - **Time**: {clock} of one thread, reading and scoring excluded; the paper's are wall seconds on its machine. \
         Compare ratios, not seconds.\n\
         - mean ± standard deviation over the trials.\n",
        trials = args.trials,
        version = env!("CARGO_PKG_VERSION"),
        clock = clock::NAME,
    )
}

fn write_table_1(text: &mut String, datasets: &[Dataset], records: &[&TrialRecord]) {
    put!(
        text,
        "\n## Table 1: the sets\n\nHere at a = {} rad; the paper does not say from which poses it started.\n",
        NOISE[0]
    );
    put!(text, "| set | method | Obj, reported | Obj, here | s, reported | s, here |");
    put!(text, "| --- | --- | --- | --- | --- | --- |");
    for dataset in datasets {
        let trials = trials_of(records, &dataset.name, 0);
        for method in METHODS {
            let reported = table_1(&dataset.name, method);
            row(text, &dataset.name, method, reported, &trials);
        }
        others(text, dataset, &dataset.name, &trials);
    }
}

fn write_table_2(text: &mut String, datasets: &[Dataset], records: &[&TrialRecord]) {
    put!(text, "\n## Table 2: levels of noise\n\nThe paper reports the bunny only.\n");
    put!(text, "| set, a | method | Obj, reported | Obj, here | s, reported | s, here |");
    put!(text, "| --- | --- | --- | --- | --- | --- |");
    for dataset in datasets {
        for (noise, a) in NOISE.iter().enumerate() {
            let trials = trials_of(records, &dataset.name, noise);
            let what = format!("{}, {a}", dataset.name);
            for method in METHODS {
                row(text, &what, method, table_2(&dataset.name, noise, method), &trials);
            }
            others(text, dataset, &what, &trials);
        }
    }
}

fn row(text: &mut String, what: &str, method: Method, reported: Option<Reported>, trials: &[&TrialRecord]) {
    let obj = spread(trials, method, |result| result.obj_mm2);
    let seconds = spread(trials, method, |result| result.seconds);
    let reported_obj = reported.map(|cell| match cell.deviation {
        Some(deviation) => format!("{:.4} ± {deviation:.4}", cell.mean),
        None => format!("{:.4}", cell.mean),
    });
    put!(
        text,
        "| {what} | {method} | {} | {} | {} | {} |",
        reported_obj.unwrap_or_default(),
        plus_minus(obj, 4),
        reported.map(|cell| format!("{:.1}", cell.seconds)).unwrap_or_default(),
        plus_minus(seconds, 2)
    );
}

/// The rows of what is no method.
fn others(text: &mut String, dataset: &Dataset, what: &str, trials: &[&TrialRecord]) {
    let starts: Vec<f64> = trials.iter().map(|trial| trial.start_mm2).collect();
    put!(text, "| {what} | (ground truth) | | {:.4} | | |", dataset.objective_mm2(&dataset.truth));
    put!(text, "| {what} | (start) | | {} | | |", plus_minus(Spread::of(&starts), 4));
}

fn plus_minus(spread: Option<Spread>, digits: usize) -> String {
    match spread {
        Some(Spread { mean, deviation: Some(deviation) }) => format!("{mean:.digits$} ± {deviation:.digits$}"),
        Some(Spread { mean, deviation: None }) => format!("{mean:.digits$}"),
        None => String::new(),
    }
}

/// Whether `ma-aticp` is the best of the three, trial by trial, and what its threshold did.
fn comparison(text: &mut String, datasets: &[Dataset], records: &[&TrialRecord]) {
    put!(text, "\n## Is `ma-aticp` the best of the three, as the paper says?\n");
    put!(text, "In how many trials its Obj is lower, and how many of the last round's pairs its threshold ended.\n");
    put!(text, "| set | a | below `ma-icp` | below `lrs-l1alm` | lowest mean Obj | pairs ended by e_thr |");
    put!(text, "| --- | --- | --- | --- | --- | --- |");
    for dataset in datasets {
        for (noise, a) in NOISE.iter().enumerate() {
            let trials = trials_of(records, &dataset.name, noise);
            let against = |other| format!("{} of {}", wins(&trials, Method::MaAticp, other), trials.len());
            let means = [Method::MaAticp, Method::LrsL1alm, Method::MaIcp]
                .into_iter()
                .filter_map(|method| Some((method, spread(&trials, method, |result| result.obj_mm2)?.mean)));
            let best = means.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(method, _)| method.name()).unwrap_or_default();
            let ended = spread(&trials, Method::MaAticp, |result| 100.0 * result.below_threshold);
            put!(
                text,
                "| {} | {a} | {} | {} | `{best}` | {} |",
                dataset.name,
                against(Method::MaIcp),
                against(Method::LrsL1alm),
                ended.map(|share| format!("{:.0} %", share.mean)).unwrap_or_default()
            );
        }
    }
}
