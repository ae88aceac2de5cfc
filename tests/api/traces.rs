//! Spans of requests and jobs, as a collector of OpenTelemetry gets them.
#![cfg(unix)]

use std::process::Stdio;

use serde_json::{Value, json};

use crate::binary::{Process, client, coarse_scan, disturbed_poses};
use crate::common::receiver::{Message, Receiver};
use crate::common::{expect_json, text};
use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};

const TRACE: &str = "4bf92f3577b34da6a3ce929d0e0e4736";
const SPAN: &str = "53995c3f42cd8ad8";

/// All spans of a message.
fn spans(message: &Message) -> Vec<Value> {
    let body: Value = serde_json::from_str(&message.body).expect("JSON");
    let resource = &body["resourceSpans"][0];
    let named = resource["resource"]["attributes"].as_array().expect("attributes");
    assert!(named.iter().any(|attribute| attribute["value"]["stringValue"] == "visage"), "{resource}");
    let of_scopes = resource["scopeSpans"].as_array().expect("scopes").iter();
    of_scopes.flat_map(|scope| scope["spans"].as_array().expect("spans").clone()).collect()
}

fn attribute(span: &Value, key: &str) -> Option<String> {
    let all = span["attributes"].as_array()?;
    let found = all.iter().find(|attribute| attribute["key"] == key)?;
    found["value"]["stringValue"].as_str().map(str::to_owned)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_request_goes_on_with_the_trace_of_its_client_and_so_do_its_job_and_the_stages_of_that() {
    let mut collector = Receiver::start(&[]).await;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let environment = [
        ("OTEL_EXPORTER_OTLP_ENDPOINT", format!("http://{}", collector.addr)),
        ("OTEL_EXPORTER_OTLP_PROTOCOL", "http/json".to_owned()),
        ("OTEL_BSP_SCHEDULE_DELAY", "100".to_owned()),
    ];
    let process = Process::start_in(folder.path(), &[], &environment, Stdio::null());
    let client = client();
    let names: Vec<String> = (0..3).map(|index| format!("part{index}.ply")).collect();
    let form = names.iter().enumerate().fold(Form::new(), |form, (index, name)| {
        form.part("scans", Part::bytes(coarse_scan(index, 40)).file_name(name.clone()))
    });
    let form = form.part("poses", Part::text(disturbed_poses(&names)));
    let sent = client.post(format!("{}/v1/scan-sets/upload", process.url)).multipart(form).send().await;
    let set = text(&expect_json(sent.expect("an answer"), StatusCode::CREATED).await, "/id");
    let order = client.post(format!("{}/v1/jobs", process.url)).json(&json!({"scan_set_id": set}));
    let order = order.header("traceparent", format!("00-{TRACE}-{SPAN}-01")).send().await;
    let job = text(&expect_json(order.expect("an answer"), StatusCode::ACCEPTED).await, "/id");
    let (mut all, mut job_span) = (Vec::new(), None);
    while job_span.is_none() {
        all.extend(spans(&collector.message().await));
        job_span = all.iter().find(|span| span["name"] == "job").cloned();
    }
    let job_span = job_span.expect("found above");
    let of_trace = |name: &str| -> Vec<&Value> {
        all.iter().filter(|span| span["name"] == name && span["traceId"] == TRACE).collect()
    };
    let request = of_trace("request");
    assert_eq!((request.len(), &request[0]["parentSpanId"]), (1, &json!(SPAN)));
    assert_eq!(attribute(request[0], "path").as_deref(), Some("/v1/jobs"));
    assert_eq!((&job_span["traceId"], &job_span["parentSpanId"]), (&json!(TRACE), &request[0]["spanId"]));
    assert_eq!(attribute(&job_span, "job.id"), Some(job));
    let stages = of_trace("stage");
    assert!(stages.iter().all(|stage| stage["parentSpanId"] == job_span["spanId"]), "{stages:?}");
    let named: Vec<String> = stages.iter().filter_map(|stage| attribute(stage, "stage")).collect();
    assert!(named.contains(&"loading".to_owned()) && named.contains(&"registering".to_owned()), "{named:?}");
    // what nobody follows begins a trace of its own
    let others = all.iter().filter(|span| span["name"] == "request" && span["traceId"] != TRACE);
    assert!(others.count() >= 1);
}
