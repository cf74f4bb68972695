//! Smaller promises of the surface: shortcuts, superseded jobs, rates, pages of problems, what trades know.

use std::time::{Duration, Instant};

use lacuna_tests::support::binary::{run, succeed};
use lacuna_tests::support::cases::model;
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::Service;
use serde_json::{Value, json};

/// Work for a minute at least.
fn long_order(tolerance: f64) -> Value {
    json!({ "lacuna": 1, "kind": "solidify", "model": model("ifs/sierpinski_tetrahedron"),
        "params": { "tolerance_mm": tolerance, "radius_mm": 0.4 }, "outputs": ["stl"], "limits": { "triangles": 40_000_000 } })
}

#[test]
fn shortcuts_are_jobs_that_are_waited_for() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let order = json!({ "lacuna": 1, "model": model("meshes/segment"), "params": { "tolerance_mm": 0.1 } });
    let measured = service.post("/v1/measure", &order);
    assert_eq!((measured.status, &measured.json()["state"], &measured.json()["kind"]), (200, &json!("succeeded"), &json!("measure")));
    let evaluated = service.post("/v1/evaluate", &order);
    assert_eq!((evaluated.status, &evaluated.json()["outputs"][0]["name"]), (200, &json!("obj")));
    assert_eq!(service.get(measured.header("location")).json()["id"], measured.json()["id"]);
    // An answer at once is still to be had, and nothing is lost by it.
    let asked = service.post_with("/v1/measure", &[("prefer", "respond-async")], order.to_string().as_bytes());
    assert!(matches!(asked.status, 200 | 202), "{}", asked.status);
    // Faults are where the caller has them, and the kind is the address's to say.
    let wrong = service.post_with("/v1/measure", &[], br#"{"lacuna": 1, "colour": 1, "kind": "measure", "params": {}}"#);
    assert_eq!(wrong.status, 422);
    let told = wrong.json()["errors"].clone();
    let colour = told.as_array().unwrap().iter().find(|finding| finding["pointer"] == "/colour").unwrap();
    assert_eq!((&colour["line"], &colour["column"]), (&json!(1), &json!(25)), "{told}");
    assert!(told.to_string().contains("kind"), "{told}");
    for body in ["{}", "", "[]", "}{", "{\"lacuna\": 1"] {
        let answer = service.post_with("/v1/evaluate", &[], body.as_bytes());
        assert!(matches!(answer.status, 400 | 422), "{body:?}: {}", answer.status);
    }
}

#[test]
fn a_new_job_stops_the_one_that_it_supersedes() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let first = service.post("/v1/jobs", &long_order(0.04)).json()["id"].as_str().unwrap().to_owned();
    let mut second = long_order(0.05);
    second["supersedes"] = json!(first);
    // A job that is refused replaces nothing.
    let mut refused = second.clone();
    refused["params"]["radius_mm"] = json!(-1);
    assert_eq!(service.post("/v1/jobs", &refused).status, 422);
    assert!(matches!(service.get(&format!("/v1/jobs/{first}")).json()["state"].as_str(), Some("queued" | "running")));

    let answer = service.post("/v1/jobs", &second);
    assert_eq!(answer.status, 202, "{}", answer.json());
    let second_id = answer.json()["id"].as_str().unwrap().to_owned();
    let start = Instant::now();
    assert_eq!(service.ended(&first)["state"], "cancelled");
    assert!(start.elapsed() < Duration::from_secs(10));
    assert_ne!(service.get(&format!("/v1/jobs/{second_id}")).json()["state"], "cancelled");
    assert_eq!(service.post(&format!("/v1/jobs/{second_id}/cancel"), &json!({})).status / 100, 2);

    second["supersedes"] = json!("job_none");
    let unknown = service.post("/v1/jobs", &second);
    assert_eq!((unknown.status, &unknown.json()["code"]), (422, &json!("job.unknown-job")), "{}", unknown.json());
    // On the command line there is nothing to replace.
    let file = scratch.join("job.json");
    std::fs::write(&file, second.to_string()).unwrap();
    assert_eq!(run(["plan".as_ref(), file.as_os_str()]).status.code(), Some(3));
}

#[test]
fn rates_are_announced_and_kept() {
    let scratch = Scratch::new();
    let environment = [("LACUNA_API_KEYS", "ada,bob"), ("LACUNA_CALLS_PER_MINUTE", "3"), ("LACUNA_CORS_ORIGINS", "https://cad.example")];
    let service = Service::start_with(scratch.path(), &environment);
    let call = |key: &str| service.get_with("/v1/jobs", &[("authorization", key), ("origin", "https://cad.example")]);
    let first = call("Bearer ada");
    assert_eq!(
        (first.status, first.header("ratelimit-policy"), first.header("ratelimit")),
        (200, "\"calls\";q=3;w=60", "\"calls\";r=2;t=20")
    );
    let (_, _) = (call("Bearer ada"), call("Bearer ada"));
    let refused = call("Bearer ada");
    assert_eq!((refused.status, refused.header("ratelimit-policy")), (429, first.header("ratelimit-policy")), "{}", refused.json());
    let seconds: u64 = refused.header("retry-after").parse().unwrap();
    assert!((1..=20).contains(&seconds) && refused.header("ratelimit").starts_with("\"calls\";r=0;t="), "{refused:?}");
    assert_eq!((&refused.json()["code"], &refused.json()["allowed"]), (&json!("rate-limited"), &json!(3.0)));
    // A page of the listed origin may read all of it, the refusal's headers too.
    assert_eq!(refused.header("access-control-allow-origin"), "https://cad.example");
    for name in ["RateLimit", "RateLimit-Policy", "Retry-After", "X-Request-Id"] {
        assert!(refused.header("access-control-expose-headers").contains(name), "{name}");
    }
    // Another key has a rate of its own, submissions have theirs, and probes none.
    assert_eq!(call("Bearer bob").status, 200);
    let submitted =
        service.request("POST", "/v1/validate", &[("authorization", "Bearer ada"), ("content-type", "application/json")], b"{}");
    assert_eq!((submitted.status, submitted.header("ratelimit-policy")), (200, "\"submissions\";q=600;w=60"));
    for _ in 0..10 {
        assert_eq!(service.get("/readyz").status, 200);
    }
}

#[test]
fn keys_of_a_file_have_scopes_and_are_not_told() {
    let scratch = Scratch::new();
    let sha256 = |key: &str| {
        let file = scratch.join("key");
        std::fs::write(&file, key).unwrap();
        String::from_utf8(std::process::Command::new("sha256sum").arg(file).output().unwrap().stdout).unwrap()[..64].to_owned()
    };
    let keys: String = ["read", "run", "admin"]
        .map(|scope| format!("[[keys]]\nname = \"{scope}\"\nsha256 = \"{}\"\nscope = \"{scope}\"\n", sha256(&format!("{scope}-key"))))
        .concat();
    let file = scratch.join("lacuna.toml");
    std::fs::write(&file, format!("workers = 1\nretention_hours = 5\n{keys}")).unwrap();
    let told = std::process::Command::new(lacuna_tests::support::binary::lacuna())
        .args(["doctor", "--config"])
        .arg(&file)
        .env("LACUNA_WORKERS", "4")
        .output()
        .unwrap();
    let told: Value = serde_json::from_slice(&told.stdout).unwrap();
    let setting = |name: &str| told["settings"].as_array().unwrap().iter().find(|setting| setting["name"] == name).unwrap().clone();
    assert_eq!((&setting("LACUNA_WORKERS")["value"], &setting("LACUNA_WORKERS")["origin"]), (&json!("4"), &json!("environment")));
    assert_eq!((&setting("LACUNA_RETENTION_HOURS")["value"], &setting("LACUNA_RETENTION_HOURS")["origin"]), (&json!("5"), &json!("file")));
    assert_eq!(&setting("keys")["value"], &json!("3 set"));

    let service = Service::start_with(&scratch.join("data"), &[("LACUNA_CONFIG", file.to_str().unwrap())]);
    let order = json!({ "lacuna": 1, "kind": "measure", "model": model("meshes/segment"), "params": { "tolerance_mm": 0.1 } }).to_string();
    for (key, look, submit, metrics) in
        [("none", 401, 401, 401), ("read-key", 200, 403, 403), ("run-key", 200, 202, 403), ("admin-key", 200, 202, 200)]
    {
        let bearer = format!("Bearer {key}");
        let headers = [("authorization", bearer.as_str())];
        assert_eq!(service.get_with("/v1/jobs", &headers).status, look, "{key}");
        let submitted = service.post_with("/v1/jobs", &headers, order.as_bytes());
        assert!(submitted.status == submit || submitted.status == 200 && submit == 202, "{key}: {}", submitted.json());
        assert_eq!(service.get_with("/metrics", &headers).status, metrics, "{key}");
    }
    std::fs::write(&file, "wokers = 1\n").unwrap();
    let refused = run(["doctor".as_ref(), "--config".as_ref(), file.as_os_str()]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("wokers"));
}

#[test]
fn the_type_of_a_problem_leads_to_its_page() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_API_KEYS", "key")]);
    for path in ["/v1/jobs", "/v1/nothing", "/problems/nothing"] {
        let problem = service.get(path).json();
        let page = service.get(problem["type"].as_str().unwrap());
        assert_eq!(page.status, 200, "{problem}");
        assert_eq!(
            (&page.json()["type"], &page.json()["status"], &page.json()["title"]),
            (&problem["type"], &problem["status"], &problem["title"])
        );
    }
}

#[test]
fn what_trades_know_has_sources() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let materials = service.get("/v1/materials").json();
    assert_eq!(serde_json::from_slice::<Value>(&succeed(["materials"])).unwrap(), materials);
    let silver = materials["items"].as_array().unwrap().iter().find(|item| item["name"] == "sterling_silver").unwrap();
    assert_eq!((&silver["density_g_cm3"], &silver["range_g_cm3"]), (&json!(10.4), &json!([10.36, 10.4])));
    let profiles = service.get("/v1/profiles").json();
    assert_eq!(serde_json::from_slice::<Value>(&succeed(["profiles"])).unwrap(), profiles);
    for profile in profiles["items"].as_array().unwrap() {
        let name = profile["name"].as_str().unwrap();
        assert_eq!(&service.get(&format!("/v1/profiles/{name}")).json(), profile);
        assert_eq!(&serde_json::from_slice::<Value>(&succeed(["profiles", name])).unwrap(), profile);
        for quantity in profile["quantities"].as_array().unwrap() {
            assert!(quantity["value"].is_number() && !quantity["source"].as_str().unwrap().is_empty(), "{quantity}");
        }
    }
    assert_eq!(service.get("/v1/profiles/knitting").status, 404);
    assert_eq!(run(["profiles", "knitting"]).status.code(), Some(2));
    let capabilities = service.get("/v1/capabilities").json();
    assert_eq!(capabilities["profiles"], json!(["cast", "panels", "sla"]));
    assert!(capabilities["kinds"].as_array().unwrap().contains(&json!("convert")) && capabilities["limits"]["upload_bytes"] == 256 << 20);
}
