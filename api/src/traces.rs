//! Traces of requests and jobs for an OpenTelemetry collector: OTLP over HTTP, in its JSON encoding.
//!
//! A span is a request, a job's attempt, or a phase of one; a job belongs to the trace of the request that ordered it, wherever it is done. What
//! cannot be delivered is dropped and counted in the log: nobody waits for a collector. Models and their names are in no span.
//!
//! Own code, because the exporter's crates would be a dozen, with a second HTTP client, for one document of JSON.

use std::sync::OnceLock;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use uuid::Uuid;

/// Spans that may wait for the collector.
const WAITING: usize = 4096;
/// Spans that are sent at once.
const BATCH: usize = 512;
/// How long a span waits for others.
const EVERY: Duration = Duration::from_secs(1);
/// How long the collector may take for a batch.
const PATIENCE: Duration = Duration::from_secs(5);

static EXPORTER: OnceLock<SyncSender<Told>> = OnceLock::new();

/// What the exporter is told.
enum Told {
    Span(Box<Span>),
    /// Whoever has the other end waits until what came before has been sent.
    Finish(SyncSender<()>),
}

/// Where a span stands: its trace and its own id, as `traceparent` has them (W3C Trace Context).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Context {
    trace: u128,
    span: u64,
}

impl Context {
    /// A span of a trace of its own.
    #[must_use]
    pub fn new() -> Self {
        Self { trace: Uuid::now_v7().as_u128(), span: new_id() }
    }

    /// Another span of the same trace.
    #[must_use]
    pub fn child(self) -> Self {
        Self { span: new_id(), ..self }
    }

    /// The caller's span, if the header's value names one.
    #[must_use]
    pub fn of_header(value: &str) -> Option<Self> {
        let mut parts = value.split('-');
        let (version, trace, span) = (parts.next()?, parts.next()?, parts.next()?);
        let hexadecimal = |word: &str, length: usize| word.len() == length && word.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'));
        if !hexadecimal(version, 2) || version == "ff" || !hexadecimal(trace, 32) || !hexadecimal(span, 16) {
            return None;
        }
        let found = Self { trace: u128::from_str_radix(trace, 16).ok()?, span: u64::from_str_radix(span, 16).ok()? };
        (found.trace != 0 && found.span != 0).then_some(found)
    }
}

impl Default for Context {
    fn default() -> Self {
        Self::new()
    }
}

impl From<Context> for String {
    fn from(context: Context) -> Self {
        format!("00-{:032x}-{:016x}-01", context.trace, context.span)
    }
}

impl TryFrom<String> for Context {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        Self::of_header(&text).ok_or(text)
    }
}

/// The random half of a new id.
fn new_id() -> u64 {
    Uuid::now_v7().as_u64_pair().1
}

/// What a span is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpanKind {
    /// A part of another span.
    Internal = 1,
    /// A request that is answered.
    Server = 2,
    /// Work that was ordered earlier.
    Consumer = 5,
}

/// Something that took its time.
#[derive(Clone, Debug)]
pub struct Span {
    /// Route, kind of job or phase: from a bounded set.
    pub name: String,
    /// What it is of.
    pub kind: SpanKind,
    /// Where it stands.
    pub context: Context,
    /// What it is a part of, or follows from.
    pub parent: Option<Context>,
    /// When it began.
    pub start: SystemTime,
    /// When it ended.
    pub end: SystemTime,
    /// Facts about it.
    pub attributes: Vec<(&'static str, Value)>,
    /// Whether it went wrong, by our fault.
    pub failed: bool,
}

impl Span {
    fn told(&self) -> Value {
        let nanoseconds = |time: SystemTime| time.duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos().to_string();
        let mut span = json!({
            "traceId": format!("{:032x}", self.context.trace),
            "spanId": format!("{:016x}", self.context.span),
            "name": self.name,
            "kind": self.kind as u8,
            "startTimeUnixNano": nanoseconds(self.start),
            "endTimeUnixNano": nanoseconds(self.end),
            "attributes": self.attributes.iter().map(|(key, value)| attribute(key, value)).collect::<Vec<_>>(),
            "status": { "code": if self.failed { 2 } else { 0 } },
        });
        if let Some(parent) = self.parent {
            span["parentSpanId"] = format!("{:016x}", parent.span).into();
        }
        span
    }
}

/// 64-bit integers are texts in this encoding.
fn attribute(key: &str, value: &Value) -> Value {
    let value = match value {
        Value::Number(number) if !number.is_f64() => json!({ "intValue": number.to_string() }),
        Value::Number(number) => json!({ "doubleValue": number }),
        Value::Bool(flag) => json!({ "boolValue": flag }),
        other => json!({ "stringValue": other.as_str().map_or_else(|| other.to_string(), str::to_owned) }),
    };
    json!({ "key": key, "value": value })
}

/// Sends spans to a collector from now on: `url` is its address up to `/v1/traces`.
///
/// # Errors
/// When the system has no thread to spare.
pub fn start(url: &str) -> std::io::Result<()> {
    let (sender, spans) = mpsc::sync_channel(WAITING);
    let place = format!("{}/v1/traces", url.trim_end_matches('/'));
    std::thread::Builder::new().name("traces".into()).spawn(move || export(&place, &spans))?;
    // A second one could only come from an embedding program, which then has its own.
    let _ = EXPORTER.set(sender);
    Ok(())
}

/// Whether anybody wants spans.
#[must_use]
pub fn wanted() -> bool {
    EXPORTER.get().is_some()
}

/// Tells of a span, if anybody wants to know.
pub fn tell(span: Span) {
    if let Some(exporter) = EXPORTER.get()
        && exporter.try_send(Told::Span(Box::new(span))).is_err()
    {
        tracing::debug!("a span is dropped: the collector is slow or away");
    }
}

/// Waits until the collector has what was told, but not for longer than it may take for a batch: a process that goes leaves no trace
/// without its end.
pub fn finish() {
    let (done, waiting) = mpsc::sync_channel(1);
    if let Some(exporter) = EXPORTER.get()
        && exporter.try_send(Told::Finish(done)).is_ok()
    {
        let _ = waiting.recv_timeout(PATIENCE);
    }
}

fn export(place: &str, heard: &Receiver<Told>) {
    let config = ureq::Agent::config_builder().timeout_global(Some(PATIENCE)).tls_config(crate::trust::tls()).build();
    let agent = ureq::Agent::new_with_config(config);
    while let Ok(first) = heard.recv() {
        let (mut batch, mut finished) = (Vec::new(), Vec::new());
        let (mut next, until) = (Some(first), Instant::now() + EVERY);
        while let Some(told) = next {
            match told {
                Told::Span(span) => batch.push(*span),
                Told::Finish(done) => finished.push(done),
            }
            let full = batch.len() == BATCH || !finished.is_empty();
            next = if full { None } else { heard.recv_timeout(until.saturating_duration_since(Instant::now())).ok() };
        }
        send(&agent, place, &batch);
        for done in finished {
            // Whoever waited may have gone.
            let _ = done.try_send(());
        }
    }
}

fn send(agent: &ureq::Agent, place: &str, batch: &[Span]) {
    if batch.is_empty() {
        return;
    }
    let document = json!({ "resourceSpans": [{
        "resource": { "attributes": [
            attribute("service.name", &json!("lacuna")),
            attribute("service.version", &json!(env!("CARGO_PKG_VERSION"))),
            attribute("process.pid", &json!(std::process::id())),
        ] },
        "scopeSpans": [{ "scope": { "name": "lacuna" }, "spans": batch.iter().map(Span::told).collect::<Vec<_>>() }],
    }] });
    if let Err(error) = agent.post(place).header("content-type", "application/json").send(document.to_string().as_bytes()) {
        tracing::warn!(%error, spans = batch.len(), "the collector of traces did not take spans; they are dropped");
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_header_names_a_span_or_nothing() {
        // The example of the W3C recommendation.
        let text = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";
        let context = Context::of_header(text).unwrap();
        assert_eq!(String::from(context), text);
        assert_eq!((context.child().trace, context.child().span != context.span), (context.trace, true));
        let zero = "00-00000000000000000000000000000000-00f067aa0ba902b7-01";
        for bad in [
            "",
            "00",
            zero,
            "ff-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
            "00-4BF92F3577B34DA6A3CE929D0E0E4736-00f067aa0ba902b7-01",
        ] {
            assert_eq!(Context::of_header(bad), None, "{bad}");
        }
        assert_eq!(serde_json::from_str::<Context>(&serde_json::to_string(&context).unwrap()).unwrap(), context);
    }
}
