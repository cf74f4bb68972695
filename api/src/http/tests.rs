//! The whole service in one process, with an engine that makes a segment, waits or fails as its tolerance says.

#![allow(clippy::unwrap_used)]

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use axum::body::Body;
use axum::http::{HeaderMap, Request, StatusCode};
use axum::middleware::from_fn_with_state;
use http_body_util::BodyExt;
use lacuna_fabrication::{Certificate, Geometry, Job, Outcome, Plan};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::tessellation::Tessellation;
use serde_json::{Value, json};
use tower::ServiceExt;

use super::layers;
use super::router::router;
use super::state::{AppState, Shared};
use crate::config::{Config, Flags};
use crate::jobs::worker;
use crate::problem::{Problem, ProblemKind};
use crate::production::{self, Engine};

const MODEL: &str = r#"{"lacuna":1,"name":"bar","shape":{"family":"mesh","vertices":[[0,0,0],[10,0,0]],"faces":[[0,1]]}}"#;

/// Tolerances with a meaning for [`compute`].
const WAITS: f64 = 2.0;
const PANICS: f64 = 3.0;
const REFUSED: f64 = 4.0;
const LONG_PLAN: f64 = 5.0;

/// Plans of [`LONG_PLAN`] that were made.
static LONG_PLANS: AtomicUsize = AtomicUsize::new(0);

fn compute(job: &Job, budget: &Budget) -> Result<Outcome, Problem> {
    production::guarded(|| {
        assert!(job.params.tolerance_mm != PANICS, "as asked");
        budget.report("refine", 0.5, 1);
        while job.params.tolerance_mm == WAITS && budget.cancel.reason().is_none() {
            std::thread::sleep(Duration::from_millis(2));
        }
        let vertices = vec![[0.0; 3].into(), [10.0, 0.0, 0.0].into()];
        let sample = Tessellation { vertices, segments: vec![[0, 1]], ..Tessellation::default() };
        let certificate = Certificate { requested_tolerance_mm: job.params.tolerance_mm, ..Certificate::default() };
        Outcome { geometry: Geometry::Tessellation(sample), certificate }
    })
    .and_then(|outcome| production::why_stopped(budget).map_or(Ok(outcome), Err))
}

fn plan(job: &Job, _: &Budget) -> Result<Plan, Problem> {
    if job.params.tolerance_mm == REFUSED {
        return Err(Problem::new(ProblemKind::Limit, "too much").code("plan.triangles"));
    }
    if job.params.tolerance_mm == LONG_PLAN {
        std::thread::sleep(Duration::from_millis(1500));
        LONG_PLANS.fetch_add(1, Ordering::SeqCst);
    }
    Ok(Plan { leaf_cells: 1.0, ..Plan::default() })
}

struct Service {
    state: Shared,
    folder: PathBuf,
}

impl Service {
    fn start(workers: usize, environment: &[(&str, &str)]) -> Self {
        let folder = std::env::temp_dir().join(format!("lacuna-service-{}", uuid::Uuid::now_v7()));
        Self::start_in(folder, workers, environment)
    }

    fn start_in(folder: PathBuf, workers: usize, environment: &[(&str, &str)]) -> Self {
        let flags = Flags { data: Some(folder.clone()), ..Flags::default() };
        let find = |name: &str| environment.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned());
        let (config, _) = Config::read(&flags, &find).unwrap();
        let state = AppState::with_engine(config, Engine { here: Some(compute), plan }).unwrap();
        worker::start(&state.desk, workers, state.config.job_limits, state.engine).unwrap();
        Self { state, folder }
    }

    /// Ends, as a process does, and leaves its folder to the next.
    fn leave(mut self) -> PathBuf {
        std::mem::take(&mut self.folder)
    }

    async fn send(&self, method: &str, path: &str, headers: &[(&str, &str)], body: impl Into<Body>) -> (StatusCode, HeaderMap, Vec<u8>) {
        let mut request = Request::builder().method(method).uri(path);
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let response = router(Arc::clone(&self.state)).oneshot(request.body(body.into()).unwrap()).await.unwrap();
        let (parts, body) = response.into_parts();
        (parts.status, parts.headers, body.collect().await.unwrap().to_bytes().to_vec())
    }

    async fn get(&self, path: &str) -> (StatusCode, Value) {
        let (status, _, body) = self.send("GET", path, &[], Body::empty()).await;
        (status, serde_json::from_slice(&body).unwrap_or_default())
    }

    async fn submit(&self, tolerance: f64, headers: &[(&str, &str)]) -> (StatusCode, HeaderMap, Value) {
        let body = json!({ "lacuna": 1, "kind": "evaluate", "model": serde_json::from_str::<Value>(MODEL).unwrap(),
            "params": { "tolerance_mm": tolerance }, "outputs": ["obj"] });
        let headers: Vec<_> = [("content-type", "application/json")].iter().chain(headers).copied().collect();
        let (status, headers, body) = self.send("POST", "/v1/jobs", &headers, body.to_string()).await;
        (status, headers, serde_json::from_slice(&body).unwrap())
    }

    async fn ended(&self, id: &str) -> Value {
        let job = self.state.desk.find("local", id).await.unwrap().unwrap();
        serde_json::to_value(job.wait(Duration::from_secs(20)).await).unwrap()
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        self.state.desk.stop();
        self.state.desk.interrupt();
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

#[tokio::test]
async fn who_is_told_that_the_time_is_over_has_ordered_nothing() {
    let service = Service::start(1, &[("LACUNA_ANSWER_SECONDS", "1")]);
    let (status, _, problem) = service.submit(LONG_PLAN, &[]).await;
    assert_eq!((status, &problem["code"]), (StatusCode::GATEWAY_TIMEOUT, &json!("timeout")), "{problem}");
    while LONG_PLANS.load(Ordering::SeqCst) == 0 {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    // A moment, for what would follow.
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert_eq!(service.get("/v1/jobs").await.1["items"], json!([]));
}

#[tokio::test]
async fn a_job_is_waited_for_and_its_files_are_served() {
    let service = Service::start(1, &[]);
    let (status, headers, job) = service.submit(0.1, &[("prefer", "wait=20")]).await;
    assert_eq!((status, headers["preference-applied"].to_str().unwrap()), (StatusCode::OK, "wait=20"));
    assert_eq!(job["state"], "succeeded");
    assert_eq!(job["certificate"]["input_digest"], job["input_digest"]);
    assert_eq!(job["certificate"]["output_digests"]["obj"], job["outputs"][0]["digest"]);
    let id = job["id"].as_str().unwrap();

    let (status, headers, _) = service.send("GET", &format!("/v1/jobs/{id}/outputs/obj"), &[], Body::empty()).await;
    assert_eq!(status, StatusCode::SEE_OTHER);
    let place = headers["location"].to_str().unwrap().to_owned();
    let (status, headers, bytes) = service.send("GET", &place, &[], Body::empty()).await;
    assert_eq!((status, headers["content-type"].to_str().unwrap()), (StatusCode::OK, "model/obj"));
    assert_eq!(headers["content-length"].to_str().unwrap(), bytes.len().to_string());
    assert_eq!(headers["content-disposition"], "attachment; filename=\"bar.obj\"");
    let etag = headers["etag"].to_str().unwrap().to_owned();

    let (status, headers, part) = service.send("GET", &place, &[("range", "bytes=2-5")], Body::empty()).await;
    assert_eq!((status, part.as_slice()), (StatusCode::PARTIAL_CONTENT, &bytes[2..6]));
    assert_eq!(headers["content-range"].to_str().unwrap(), format!("bytes 2-5/{}", bytes.len()));
    let (status, headers, _) = service.send("GET", &place, &[("range", "bytes=99999-")], Body::empty()).await;
    assert_eq!(
        (status, headers["content-range"].to_str().unwrap()),
        (StatusCode::RANGE_NOT_SATISFIABLE, format!("bytes */{}", bytes.len()).as_str())
    );
    let (status, _, body) = service.send("GET", &place, &[("if-none-match", &etag)], Body::empty()).await;
    assert_eq!((status, body.len()), (StatusCode::NOT_MODIFIED, 0));
    let (status, headers, body) = service.send("HEAD", &place, &[], Body::empty()).await;
    assert_eq!((status, headers["content-length"].to_str().unwrap(), body.len()), (StatusCode::OK, bytes.len().to_string().as_str(), 0));
    let (status, _) = service.get(&format!("/v1/jobs/{id}/outputs/certificate.json?redirect=0")).await;
    assert_eq!(status, StatusCode::OK);
}

#[tokio::test]
async fn a_name_that_is_exact_is_refused_where_its_type_is() {
    let service = Service::start(1, &[]);
    let (_, _, job) = service.submit(0.1, &[("prefer", "wait=20")]).await;
    let id = job["id"].as_str().unwrap();
    let ask = async |name: &str, accept: &str| {
        service.send("HEAD", &format!("/v1/jobs/{id}/outputs/{name}"), &[("accept", accept)], Body::empty()).await
    };
    for (name, accept, expected) in [
        ("obj", "model/obj", 303),
        ("obj", "model/*;q=0.1", 303),
        ("obj", "", 303),
        ("bar.obj", "application/octet-stream, application/problem+json", 303),
        ("bar", "text/html, */*;q=0.1", 303),
        ("obj", "model/stl", 406),
        ("obj", "application/json", 406),
        ("bar", "*/*;q=0", 406),
        ("obj?format=obj", "model/stl", 303),
        ("obj?format=stl", "*/*", 406),
        ("bar?format=parchment", "*/*", 400),
        ("obj", "model/obj;q=much", 400),
        ("certificate", "application/json", 303),
        ("ba", "*/*", 404),
        ("", "*/*", 404),
    ] {
        let (status, headers, _) = ask(name, accept).await;
        assert_eq!(status.as_u16(), expected, "{name} {accept}");
        if [303, 406].contains(&expected) {
            assert_eq!(headers["vary"], "Accept", "{name} {accept}");
        }
    }
}

#[tokio::test]
async fn equal_work_is_done_once_and_keys_repeat_answers() {
    let service = Service::start(1, &[]);
    let (_, _, first) = service.submit(0.1, &[("prefer", "wait=20"), ("idempotency-key", "k")]).await;
    let (status, headers, again) = service.submit(0.1, &[("idempotency-key", "k")]).await;
    assert_eq!((status, &again["id"], headers["idempotency-replayed"].to_str().unwrap()), (StatusCode::OK, &first["id"], "true"));
    let (status, _, problem) = service.submit(0.2, &[("idempotency-key", "k")]).await;
    assert_eq!((status, problem["code"].as_str().unwrap()), (StatusCode::UNPROCESSABLE_ENTITY, "idempotency-mismatch"));
    let (status, _, reused) = service.submit(0.1, &[]).await;
    assert_eq!((status, &reused["reused"], &reused["outputs"]), (StatusCode::OK, &json!(true), &first["outputs"]));
    assert_ne!(reused["id"], first["id"]);
}

#[tokio::test]
async fn a_running_job_stops_soon_and_its_events_tell() {
    let service = Service::start(1, &[]);
    let (status, headers, job) = service.submit(WAITS, &[("prefer", "respond-async")]).await;
    assert_eq!((status, headers["preference-applied"].to_str().unwrap()), (StatusCode::ACCEPTED, "respond-async"));
    assert!(headers.contains_key("retry-after"));
    let place = headers["location"].to_str().unwrap().to_owned();
    let id = job["id"].as_str().unwrap();
    let running = Instant::now();
    while service.state.desk.find("local", id).await.unwrap().unwrap().view().progress.is_none()
        && running.elapsed() < Duration::from_secs(20)
    {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let (status, _) = service.get(&format!("{place}/outputs/obj")).await;
    assert_eq!(status, StatusCode::CONFLICT);
    let start = Instant::now();
    let (status, _, _) = service.send("POST", &format!("{place}/cancel"), &[], Body::empty()).await;
    assert!(status == StatusCode::ACCEPTED || status == StatusCode::OK);
    assert_eq!(service.ended(id).await["state"], "cancelled");
    assert!(start.elapsed() < Duration::from_secs(5));

    let (_, headers, body) = service.send("GET", &format!("{place}/events"), &[], Body::empty()).await;
    assert_eq!(headers["content-type"], "text/event-stream");
    let text = String::from_utf8(body).unwrap();
    for event in ["event: state", "event: progress", "event: done", "\"phase\":\"refine\"", "id: 1\n"] {
        assert!(text.contains(event), "{event} in {text}");
    }
    let (status, _, _) = service.send("DELETE", &place, &[], Body::empty()).await;
    assert_eq!(status, StatusCode::NO_CONTENT);
    assert_eq!(service.get(&place).await.0, StatusCode::NOT_FOUND);
}

#[tokio::test]
async fn failures_are_in_the_job_and_refusals_in_the_status() {
    let service = Service::start(1, &[]);
    let (status, _, job) = service.submit(PANICS, &[("prefer", "wait=20")]).await;
    assert_eq!((status, &job["state"], &job["problem"]["status"]), (StatusCode::OK, &json!("failed"), &json!(500)));
    assert!(!job.to_string().contains("as asked"), "the cause stays in the log");
    let (status, _, problem) = service.submit(REFUSED, &[]).await;
    assert_eq!((status, &problem["code"]), (StatusCode::UNPROCESSABLE_ENTITY, &json!("plan.triangles")));
    let body =
        format!(r#"{{"lacuna":1,"kind":"evaluate","model":{MODEL},"params":{{"tolerance_mm":{WAITS}}},"limits":{{"seconds":0.05}}}}"#);
    let headers = [("content-type", "application/json"), ("prefer", "wait=20")];
    let (_, _, body) = service.send("POST", "/v1/jobs", &headers, body).await;
    let job: Value = serde_json::from_slice(&body).unwrap();
    assert_eq!((&job["problem"]["code"], &job["problem"]["limit"]), (&json!("limit.seconds"), &json!("seconds")));
}

#[tokio::test]
async fn every_error_is_a_problem_with_the_request_id() {
    let service = Service::start(0, &[("LACUNA_BODY_BYTES", "2000")]);
    let json = ("content-type", "application/json");
    let long = "x".repeat(3000);
    for (method, path, header, body, status, code) in [
        ("GET", "/v1/nothing", json, "", 404, "not-found"),
        ("PUT", "/v1/jobs", json, "", 405, "method-not-allowed"),
        ("POST", "/v1/jobs", ("content-type", "text/plain"), "{}", 415, "unsupported-media"),
        ("POST", "/v1/jobs", json, "{", 400, "document.truncated"),
        ("POST", "/v1/jobs", json, "{}", 422, "document.missing-member"),
        ("POST", "/v1/jobs", json, long.as_str(), 413, "body-too-large"),
        ("GET", "/v1/jobs?limit=0", json, "", 400, "bad-request"),
        ("GET", "/v1/jobs?colour=red", json, "", 400, "bad-request"),
        ("GET", "/v1/jobs/job_x", json, "", 404, "not-found"),
        ("GET", "/v1/results/sha256:0", json, "", 404, "not-found"),
        ("GET", "/v1/models/..%2F..%2Fx", json, "", 404, "not-found"),
    ] {
        let (got, headers, bytes) = service.send(method, path, &[header, ("x-request-id", "r-7")], body.to_owned()).await;
        let problem: Value = serde_json::from_slice(&bytes).unwrap();
        assert_eq!((got.as_u16(), problem["code"].as_str().unwrap()), (status, code), "{method} {path}");
        assert_eq!((&problem["request_id"], headers["x-request-id"].to_str().unwrap()), (&json!("r-7"), "r-7"));
        assert_eq!(headers["content-type"], "application/problem+json");
    }
    let (_, headers, _) = service.send("PUT", "/v1/jobs", &[], Body::empty()).await;
    assert!(headers["allow"].to_str().unwrap().contains("POST"));
}

#[tokio::test]
async fn keys_divide_the_world() {
    let service = Service::start(1, &[("LACUNA_API_KEYS", "ada,bob")]);
    let (ada, bob) = (("authorization", "Bearer ada"), ("authorization", "Bearer bob"));
    let (status, headers, _) = service.send("GET", "/v1/jobs", &[], Body::empty()).await;
    assert_eq!((status, headers["www-authenticate"].to_str().unwrap()), (StatusCode::UNAUTHORIZED, "Bearer"));
    let (_, _, job) = service.submit(0.1, &[ada, ("prefer", "wait=20")]).await;
    let place = format!("/v1/results/{}", job["outputs"][0]["digest"].as_str().unwrap());
    assert_eq!(service.send("GET", &place, &[ada], Body::empty()).await.0, StatusCode::OK);
    assert_eq!(service.send("GET", &place, &[bob], Body::empty()).await.0, StatusCode::NOT_FOUND);
    let place = format!("/v1/jobs/{}", job["id"].as_str().unwrap());
    assert_eq!(service.send("GET", &place, &[bob], Body::empty()).await.0, StatusCode::NOT_FOUND);
    for open in ["/livez", "/readyz", "/version", "/docs", "/v1/openapi.json"] {
        assert_eq!(service.send("GET", open, &[], Body::empty()).await.0, StatusCode::OK, "{open}");
    }
    let (status, _, _) = service.send("GET", "/v1/nothing", &[], Body::empty()).await;
    assert_eq!(status, StatusCode::NOT_FOUND);
}

#[tokio::test]
async fn models_are_stored_once_and_used_by_reference() {
    let service = Service::start(1, &[]);
    let json = ("content-type", "application/json");
    let (status, headers, body) = service.send("POST", "/v1/models", &[json], MODEL).await;
    let view: Value = serde_json::from_slice(&body).unwrap();
    let place = headers["location"].to_str().unwrap().to_owned();
    assert_eq!((status, &view["name"]), (StatusCode::CREATED, &json!("bar")));
    let spaced = MODEL.replace(',', ", ");
    assert_eq!(service.send("POST", "/v1/models", &[json], spaced).await.0, StatusCode::OK);
    let (status, headers, document) = service.send("GET", &place, &[], Body::empty()).await;
    assert_eq!((status, headers["content-type"].to_str().unwrap()), (StatusCode::OK, "application/vnd.lacuna.model+json;v=1"));
    assert_eq!(serde_json::from_slice::<Value>(&document).unwrap()["name"], "bar");

    let job = format!(r#"{{"lacuna":1,"kind":"evaluate","model_ref":{},"params":{{"tolerance_mm":0.1}}}}"#, view["id"]);
    let (status, _, body) = service.send("POST", "/v1/jobs", &[json, ("prefer", "wait=20")], job).await;
    assert_eq!(status, StatusCode::OK, "{}", String::from_utf8_lossy(&body));
    assert_eq!(service.get("/v1/models").await.1["items"][0]["id"], view["id"]);
    assert_eq!(service.send("DELETE", &place, &[], Body::empty()).await.0, StatusCode::NO_CONTENT);
    assert_eq!(service.get(&place).await.0, StatusCode::NOT_FOUND);
}

#[tokio::test]
async fn queues_are_bounded_and_outlive_the_process() {
    let service = Service::start(0, &[("LACUNA_QUEUED", "1")]);
    let (status, _, job) = service.submit(0.1, &[]).await;
    assert_eq!(status, StatusCode::ACCEPTED);
    let (status, headers, _) = service.submit(0.2, &[]).await;
    assert_eq!(status, StatusCode::TOO_MANY_REQUESTS);
    assert!(headers.contains_key("retry-after"));
    service.state.desk.stop();
    assert_eq!(service.get("/readyz").await.0, StatusCode::SERVICE_UNAVAILABLE);
    assert_eq!(service.submit(0.3, &[]).await.0, StatusCode::SERVICE_UNAVAILABLE);

    let next = Service::start_in(service.leave(), 1, &[]);
    assert_eq!(next.ended(job["id"].as_str().unwrap()).await["state"], "succeeded");
    let (_, list) = next.get("/v1/jobs?state=succeeded&limit=1").await;
    assert_eq!(list["items"][0]["id"], job["id"]);
}

#[tokio::test]
async fn listed_pages_may_read_answers_and_errors() {
    let service = Service::start(0, &[("LACUNA_CORS_ORIGINS", "https://shop.example")]);
    let (status, headers, _) = service.send("GET", "/v1/nothing", &[("origin", "https://shop.example")], Body::empty()).await;
    assert_eq!((status, headers["access-control-allow-origin"].to_str().unwrap()), (StatusCode::NOT_FOUND, "https://shop.example"));
    let (_, headers, _) = service.send("GET", "/livez", &[("origin", "https://other.example")], Body::empty()).await;
    assert!(!headers.contains_key("access-control-allow-origin"));
    let preflight = [("origin", "https://shop.example"), ("access-control-request-method", "POST")];
    assert_eq!(service.send("OPTIONS", "/v1/jobs", &preflight, Body::empty()).await.0, StatusCode::NO_CONTENT);
}

async fn broken() -> StatusCode {
    panic!("index 7 of 3")
}

#[tokio::test]
async fn a_handler_that_panics_is_a_problem_that_listed_pages_may_read() {
    let service = Service::start(0, &[("LACUNA_CORS_ORIGINS", "https://shop.example")]);
    let state = || Arc::clone(&service.state);
    let app = axum::Router::new().route("/broken", axum::routing::get(broken));
    let app = app.layer(from_fn_with_state(state(), layers::observe)).layer(from_fn_with_state(state(), layers::cors));
    let request = Request::get("/broken").header("origin", "https://shop.example").header("x-request-id", "r-8");
    let (parts, body) = app.oneshot(request.body(Body::empty()).unwrap()).await.unwrap().into_parts();
    let problem: Value = serde_json::from_slice(&body.collect().await.unwrap().to_bytes()).unwrap();
    assert_eq!(
        (parts.status, &problem["code"], &problem["request_id"]),
        (StatusCode::INTERNAL_SERVER_ERROR, &json!("internal"), &json!("r-8"))
    );
    assert_eq!(parts.headers["content-type"], "application/problem+json");
    assert_eq!(parts.headers["access-control-allow-origin"], "https://shop.example");
    assert!(!problem.to_string().contains("index 7"), "the cause stays in the log: {problem}");
}

#[tokio::test]
async fn the_library_is_served_and_mesh_files_are_not() {
    let service = Service::start(0, &[]);
    let (status, list) = service.get("/v1/library").await;
    assert_eq!((status, list["items"][0]["name"].as_str()), (StatusCode::OK, Some("barnsley_fern")));
    let (status, headers, document) = service.send("GET", "/v1/library/koch_curve", &[], Body::empty()).await;
    assert_eq!((status, headers["content-type"].to_str().unwrap()), (StatusCode::OK, "application/vnd.lacuna.model+json;v=1"));
    let etag = headers["etag"].to_str().unwrap();
    let (status, _, body) = service.send("GET", "/v1/library/koch_curve", &[("if-none-match", etag)], Body::empty()).await;
    assert_eq!((status, body.len()), (StatusCode::NOT_MODIFIED, 0));
    let json = [("content-type", "application/json")];
    let (status, _, report) = service.send("POST", "/v1/validate", &json, document).await;
    let report: Value = serde_json::from_slice(&report).unwrap();
    assert_eq!((status, &report["valid"]), (StatusCode::OK, &json!(true)));
    let (status, problem) = service.get("/v1/library/no_such").await;
    assert_eq!((status, &problem["code"]), (StatusCode::NOT_FOUND, &json!("library.unknown")));
    // A service has no folder that a document may look into.
    let named = r#"{"lacuna":1,"shape":{"family":"mesh","file":"cage.obj"}}"#;
    let (_, _, report) = service.send("POST", "/v1/validate", &json, named).await;
    let report: Value = serde_json::from_slice(&report).unwrap();
    assert_eq!(report["diagnostics"][0]["code"], "document.file-not-available");
    let (status, _, _) = service.send("POST", "/v1/models", &json, named).await;
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
}
