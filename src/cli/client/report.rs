//! `visage report`: how good a model is, and why.

use clap::Args;
use serde_json::Value;

use super::models::cell;
use super::rows::{plain, table};
use super::{Connection, block_on, print_json};
use crate::domain::asset::Asset;

/// Which model.
#[derive(Debug, Args)]
pub(in super::super) struct ReportArgs {
    /// The model
    id: String,
    #[command(flatten)]
    connection: Connection,
}

/// Fetches the report and tells what it says.
pub(in super::super) fn run(args: ReportArgs) -> anyhow::Result<()> {
    let client = args.connection.client()?;
    block_on(async {
        if args.connection.json {
            return print_json(&client.get(client.url(&["v1", "models", &args.id, &Asset::Report.name()])).await?);
        }
        let model: Value = client.get(client.url(&["v1", "models", &args.id])).await?;
        print!("{}", told(&model));
        Ok(())
    })
}

/// The verdict with its reasons, and a line a view.
fn told(model: &Value) -> String {
    let result = &model["report"]["result"];
    let mut text = format!("{}: {} points\n", cell(&model["name"]), cell(&model["points"]));
    if result.is_null() {
        return text + "it was uploaded as it is: there is no registration to report\n";
    }
    let verdict = &result["verdict"];
    text += &format!("quality: {}\n", cell(&verdict["quality"]));
    for reason in verdict["reasons"].as_array().into_iter().flatten() {
        text += &format!("- {}\n", reason.as_str().map_or_else(|| reason.to_string(), plain));
    }
    let views: Vec<_> = result["views"].as_array().into_iter().flatten().map(row).collect();
    if !views.is_empty() {
        text += &format!("\n{}", table(["scan", "pose", "sure", "residual", "not placed because"], &views));
    }
    text
}

fn row(view: &Value) -> [String; 5] {
    let number = |field: &str, unit: f64, after: &str, digits: usize| {
        view[field].as_f64().map_or_else(|| "-".to_owned(), |value| format!("{:.digits$}{after}", value * unit))
    };
    let sure = number("confidence", 100.0, " %", 0);
    let residual = number("residual_spacings", 1.0, " spacings", 2);
    [cell(&view["name"]), cell(&view["pose"]), sure, residual, cell(&view["unplaced"])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_verdict_comes_first_then_a_line_a_view() {
        let view =
            json!({"name": "a.ply", "pose": "found", "confidence": 0.97, "residual_spacings": 0.25, "unplaced": null});
        let verdict = json!({"quality": "doubtful", "reasons": ["only one neighbour holds view 2"]});
        let report = json!({"result": {"verdict": verdict, "views": [view]}});
        let text = told(&json!({"name": "head", "points": 12, "report": report}));
        assert!(text.starts_with("head: 12 points\nquality: doubtful\n- only one neighbour holds view 2\n"), "{text}");
        assert!(text.contains("a.ply  found  97 %  0.25 spacings  -"), "{text}");
        let uploaded = told(&json!({"name": "cup", "points": 1, "report": null}));
        assert!(uploaded.contains("it was uploaded as it is"), "{uploaded}");
    }
}
