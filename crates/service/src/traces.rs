//! The seam to what follows requests and jobs across programs: the service knows spans alone.

use std::fmt::Debug;

use tracing::Span;

/// Knows where spans belong beyond this process. `traceparent` is what the W3C calls that header, and what it holds.
pub trait Traces: Debug + Send + Sync + 'static {
    /// The `traceparent` of the span at hand, if it is followed.
    fn traceparent(&self) -> Option<String>;

    /// Makes a span that has not begun go on with what another one, here or in another program, has begun. What can't be read is
    /// nothing.
    fn go_on(&self, span: &Span, traceparent: &str);
}

/// Nobody follows anything.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoTraces;

impl Traces for NoTraces {
    fn traceparent(&self) -> Option<String> {
        None
    }

    fn go_on(&self, _span: &Span, _traceparent: &str) {}
}
