//! Traces by OpenTelemetry: spans of requests and of the stages of jobs, sent by OTLP over HTTP. Settings are the standard's own
//! variables (`OTEL_EXPORTER_OTLP_ENDPOINT`, `OTEL_SERVICE_NAME`, `OTEL_TRACES_SAMPLER` and so on); without an endpoint nothing is sent.

use std::collections::HashMap;
use std::sync::Arc;

use opentelemetry::propagation::TextMapPropagator;
use opentelemetry::trace::TracerProvider;
use opentelemetry_otlp::SpanExporter;
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::propagation::TraceContextPropagator;
use opentelemetry_sdk::trace::{SdkTracer, SdkTracerProvider};
use tracing::Span;
use tracing_opentelemetry::{OpenTelemetryLayer, OpenTelemetrySpanExt};
use tracing_subscriber::registry::LookupSpan;

use super::TelemetryError;
use crate::traces::{NoTraces, Traces};

/// The header that a span is known by.
const TRACEPARENT: &str = "traceparent";
/// Where spans go; nothing is sent where neither is set.
const ENDPOINTS: [&str; 2] = ["OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT"];

/// Sends spans; what waits to be sent is sent when it is dropped.
#[derive(Debug)]
pub struct Exporter(Option<SdkTracerProvider>);

impl Drop for Exporter {
    fn drop(&mut self) {
        if let Some(Err(error)) = self.0.as_ref().map(SdkTracerProvider::shutdown) {
            tracing::warn!("the last spans are not sent: {error}");
        }
    }
}

fn set(name: &str) -> Option<String> {
    std::env::var(name).ok().filter(|value| !value.is_empty())
}

impl Exporter {
    /// Sends nothing.
    pub fn none() -> Exporter {
        Exporter(None)
    }

    /// By the environment.
    ///
    /// # Errors
    /// What is set there can't be used.
    pub fn new() -> Result<Exporter, TelemetryError> {
        let is_off = set("OTEL_SDK_DISABLED").is_some_and(|value| value.eq_ignore_ascii_case("true"))
            || set("OTEL_TRACES_EXPORTER").is_some_and(|value| value == "none");
        if is_off || !ENDPOINTS.iter().any(|name| set(name).is_some()) {
            return Ok(Exporter(None));
        }
        let exporter = SpanExporter::builder().with_http().build();
        let exporter = exporter.map_err(|error| TelemetryError::Traces(error.to_string()))?;
        let resource = match set("OTEL_SERVICE_NAME") {
            Some(_) => Resource::builder(),
            None => Resource::builder().with_service_name("visage"),
        };
        let provider = SdkTracerProvider::builder().with_batch_exporter(exporter).with_resource(resource.build());
        Ok(Exporter(Some(provider.build())))
    }

    /// What takes spans from our own; `None` if nothing is sent.
    pub fn layer<S>(&self) -> Option<OpenTelemetryLayer<S, SdkTracer>>
    where
        S: tracing::Subscriber + for<'span> LookupSpan<'span>,
    {
        let tracer = self.0.as_ref()?.tracer("visage");
        Some(tracing_opentelemetry::layer().with_tracer(tracer))
    }

    /// What the service needs to know of it.
    pub fn traces(&self) -> Arc<dyn Traces> {
        if self.0.is_some() { Arc::new(Followed) } else { Arc::new(NoTraces) }
    }
}

/// Spans are sent.
#[derive(Debug)]
struct Followed;

impl Traces for Followed {
    fn traceparent(&self) -> Option<String> {
        let mut carrier = HashMap::new();
        TraceContextPropagator::new().inject_context(&Span::current().context(), &mut carrier);
        carrier.remove(TRACEPARENT)
    }

    fn go_on(&self, span: &Span, traceparent: &str) {
        let carrier = HashMap::from([(TRACEPARENT.to_owned(), traceparent.to_owned())]);
        // one that is not sent can't go on with anything
        let _ = span.set_parent(TraceContextPropagator::new().extract(&carrier));
    }
}
