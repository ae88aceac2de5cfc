//! `visage query`: the gallery is asked.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use reqwest::multipart::{Form, Part};
use serde_json::{Map, Value, json};

use super::models::cell;
use super::rows::table;
use super::{Connection, block_on, print_json};
use crate::geometry::Unit;

/// What is asked.
#[derive(Debug, Args)]
#[group(id = "question", required = true, multiple = false, args = ["standard", "like", "probe"])]
pub(in super::super) struct QueryArgs {
    /// Which models are of this class: face, or a standard of your own
    #[arg(long, value_name = "NAME")]
    standard: Option<String>,
    /// Which models are like this one
    #[arg(long, value_name = "MODEL")]
    like: Option<String>,
    /// Which models are like this file; it is not stored
    #[arg(long, value_name = "FILE")]
    probe: Option<PathBuf>,
    /// The unit of the probe: mm, cm, m, in or unknown
    #[arg(long, requires = "probe")]
    unit: Option<Unit>,
    /// At most so many answers
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1000))]
    limit: u32,
    /// Only what is a match
    #[arg(long)]
    only_matches: bool,
    /// Only models of this class label
    #[arg(long)]
    label: Option<String>,
    /// Only those with these words, or parts of words, in their name or label
    #[arg(long, value_name = "WORDS")]
    text: Option<String>,
    #[command(flatten)]
    connection: Connection,
}

/// Asks, and prints the ranking.
pub(in super::super) fn run(args: QueryArgs) -> anyhow::Result<()> {
    let client = args.connection.client()?;
    block_on(async {
        let filter = filter(args.label.as_deref(), args.text.as_deref());
        let answer: Value = match &args.probe {
            Some(probe) => {
                let content = std::fs::read(probe).with_context(|| format!("reading {}", probe.display()))?;
                let name = probe.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
                let mut form = Form::new()
                    .part("probe", Part::bytes(content).file_name(name))
                    .text("unit", args.unit.unwrap_or_default().name())
                    .text("limit", args.limit.to_string())
                    .text("only_matches", args.only_matches.to_string());
                if let Some(filter) = filter {
                    form = form.text("filter", filter.to_string());
                }
                client.post_form(client.url(&["v1", "queries", "probe"]), form).await?
            }
            None => {
                let mut body = Map::new();
                body.insert("limit".to_owned(), json!(args.limit));
                body.insert("only_matches".to_owned(), json!(args.only_matches));
                let given =
                    [("standard", json!(args.standard)), ("model_id", json!(args.like)), ("filter", json!(filter))];
                body.extend(given.into_iter().filter(|(_, value)| !value.is_null()).map(|(k, v)| (k.to_owned(), v)));
                client.post(client.url(&["v1", "queries"]), &body).await?
            }
        };
        if args.connection.json {
            return print_json(&answer);
        }
        print!("{}", table(HEADS, &rows(&answer)));
        match answer["pending"].as_u64() {
            None | Some(0) => {}
            Some(pending) => eprintln!("note: {pending} models are not judged yet"),
        }
        Ok(())
    })
}

/// What narrows the answer, if anything does.
fn filter(label: Option<&str>, text: Option<&str>) -> Option<Value> {
    let labels = label.map(|label| ("labels", json!([label])));
    let fields: Map<String, Value> =
        labels.into_iter().chain(text.map(|text| ("text", json!(text)))).map(|(k, v)| (k.to_owned(), v)).collect();
    (!fields.is_empty()).then(|| fields.into())
}

const HEADS: [&str; 6] = ["score", "match", "model", "name", "label", "why not"];

fn rows(answer: &Value) -> Vec<[String; 6]> {
    let matches = answer["matches"].as_array().into_iter().flatten();
    let row = |found: &Value| {
        let score = found["score"].as_f64().map_or_else(|| "-".to_owned(), |score| format!("{score:.3}"));
        let is_match = if found["is_match"] == true { "yes" } else { "no" };
        let [model, name, label] = ["model_id", "name", "label"].map(|field| cell(&found[field]));
        [score, is_match.to_owned(), model, name, label, cell(&found["reason"]["text"])]
    };
    matches.map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_holds_what_is_given() {
        assert_eq!(filter(None, None), None);
        assert_eq!(filter(None, Some("red jug")), Some(json!({"text": "red jug"})));
        assert_eq!(filter(Some("jug"), Some("red")), Some(json!({"labels": ["jug"], "text": "red"})));
    }

    #[test]
    fn answers_are_rows_best_first() {
        let answer = json!({"matches": [
            {"score": 0.98765, "is_match": true, "model_id": "m1", "name": "head", "label": null, "reason": null},
            {"score": 0.1, "is_match": false, "model_id": "m2", "name": "jug", "label": "other",
             "reason": {"code": "no_surface", "text": "there is no face"}}]});
        let rows = rows(&answer);
        assert_eq!(rows[0], ["0.988", "yes", "m1", "head", "-", "-"]);
        assert_eq!(rows[1][5], "there is no face");
    }
}
