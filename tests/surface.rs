//! Smaller promises of the surface: shortcuts, superseded jobs, rates, pages, parts and tags of files, pages of problems, what trades know.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::process::Command;
use std::time::{Duration, Instant};

use lacuna_tests::support::binary::{lacuna, run, succeed};
use lacuna_tests::support::cases::{long_job, model};
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::{Service, until};
use serde_json::{Value, json};

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
    let first = service.post("/v1/jobs", &long_job(0)).json()["id"].as_str().unwrap().to_owned();
    let mut second = long_job(1);
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
    // What `sha256sum` says of the program is what the service says of itself.
    let told = Command::new("sha256sum").arg(lacuna()).output().unwrap().stdout;
    assert_eq!(capabilities["build"], json!(format!("sha256:{}", &String::from_utf8(told).unwrap()[..64])));
    assert_eq!(capabilities["profiles"], json!(["cast", "panels", "sla"]));
    assert!(capabilities["kinds"].as_array().unwrap().contains(&json!("convert")) && capabilities["limits"]["upload_bytes"] == 256 << 20);
}

#[test]
fn a_file_is_told_in_parts_and_by_its_tag() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let order = json!({ "lacuna": 1, "kind": "solidify", "model": model("meshes/segment"),
        "params": { "tolerance_mm": 0.1, "radius_mm": 1 }, "outputs": ["stl"] });
    let job = service.done(&order);
    let output = job["outputs"].as_array().unwrap().iter().find(|output| output["name"] == "stl").unwrap();
    let path = format!("/v1/results/{}", output["digest"].as_str().unwrap());
    let whole = service.get(&path);
    let (length, tag) = (whole.body.len(), whole.header("etag").to_owned());
    assert!(length > 100 && tag.starts_with("\"sha256:") && whole.header("cache-control").contains("immutable"), "{whole:?}");
    // (Range, status, first and last byte); a server may pass over what it does not understand.
    for (range, status, first, last) in [
        ("bytes=0-9", 206, 0, 9),
        ("bytes=90-", 206, 90, length - 1),
        ("bytes=-7", 206, length - 7, length - 1),
        ("bytes=5-18446744073709551616", 206, 5, length - 1),
        ("bytes=-99999999999999999999999", 206, 0, length - 1),
        ("bytes=18446744073709551616-", 416, 0, 0),
        ("bytes=-0", 416, 0, 0),
        ("bytes=9-3", 200, 0, length - 1),
        ("bytes=0-1,3-4", 200, 0, length - 1),
        ("bytes=x", 200, 0, length - 1),
    ] {
        let answer = service.get_with(&path, &[("range", range)]);
        assert_eq!(answer.status, status, "{range}");
        match status {
            416 => {
                assert_eq!(answer.header("content-range"), format!("bytes */{length}"), "{range}");
                assert_eq!(answer.json()["code"], "range", "{range}");
            }
            _ => assert_eq!(answer.body, whole.body[first..=last], "{range}"),
        }
        if status == 206 {
            assert_eq!(answer.header("content-range"), format!("bytes {first}-{last}/{length}"), "{range}");
        }
    }
    // Half of another version is not glued to this one; what is known is not sent again; what was meant is what is here.
    let ranged = |name: &str, value: &str| service.get_with(&path, &[("range", "bytes=0-9"), (name, value)]).status;
    assert_eq!((ranged("if-range", &tag), ranged("if-range", "\"another\""), ranged("if-range", &format!("W/{tag}"))), (206, 200, 200));
    assert_eq!((ranged("if-none-match", &tag), ranged("if-none-match", "\"another\"")), (304, 206));
    // What is not sent has a length that is not 0, so none is told; the connection goes on all the same.
    for method in ["GET", "HEAD"] {
        let unsent = service.request(method, &path, &[("if-none-match", &tag)], b"");
        assert_eq!((unsent.status, unsent.header("etag"), unsent.header("content-length")), (304, tag.as_str(), ""), "{method}");
        assert_eq!(unsent.header("transfer-encoding"), "", "{method}");
    }
    assert_eq!((ranged("if-match", &tag), ranged("if-match", "*"), ranged("if-match", "\"another\"")), (206, 206, 412));
    assert_eq!(ranged("range", "bytes=20-29"), 200, "of two ranges neither is the one that is meant");
    let refused = service.get_with(&path, &[("if-match", "\"another\"")]).json();
    assert!(refused["code"] == "precondition-failed" && refused["detail"].as_str().unwrap().contains(&tag), "{refused}");

    // A model is forgotten only if it is the one that was meant.
    let stored = service.post("/v1/models", &model("meshes/segment"));
    let place = stored.header("location").to_owned();
    assert_eq!(service.request("DELETE", &place, &[("if-match", "\"another\"")], b"").status, 412);
    assert_eq!(service.get_with(&place, &[("if-match", "\"another\"")]).status, 412);
    assert_eq!(service.get_with(&place, &[("if-match", stored.header("etag"))]).status, 200);
    assert_eq!(service.request("DELETE", &place, &[("if-match", stored.header("etag"))], b"").status, 204);
    assert_eq!(service.request("DELETE", &place, &[("if-match", "*")], b"").status, 404);
}

#[test]
fn pages_follow_each_other_to_the_end() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let order = |kind: &str, number: u32| json!({ "lacuna": 1, "kind": kind, "model": model("meshes/segment"), "params": { "tolerance_mm": 0.1 + f64::from(number) } });
    let id = |view: &Value| view["id"].as_str().unwrap().to_owned();
    let mut jobs: Vec<String> = (0..5).map(|number| id(&service.done(&order("measure", number)))).collect();
    jobs.reverse();
    let other = id(&service.done(&order("evaluate", 0)));
    let pages = |path: &str| {
        let (mut found, mut cursor) = (Vec::new(), String::new());
        for _ in 0..10 {
            let page = service.get(&format!("{path}{cursor}")).json();
            found.push(page["items"].as_array().unwrap().iter().map(id).collect::<Vec<_>>());
            let Some(next) = page["next"].as_str() else { break };
            cursor = format!("&cursor={next}");
        }
        found
    };
    assert_eq!(pages("/v1/jobs?limit=2&kind=measure"), [&jobs[..2], &jobs[2..4], &jobs[4..]]);
    assert_eq!(pages("/v1/jobs?limit=3").concat(), [&[other][..], &jobs].concat());
    // An item that goes between two pages takes nothing with it.
    let next = service.get("/v1/jobs?limit=2&kind=measure").json()["next"].as_str().unwrap().to_owned();
    assert_eq!(service.delete(&format!("/v1/jobs/{next}")).status, 204);
    let rest = service.get(&format!("/v1/jobs?kind=measure&cursor={next}")).json();
    assert_eq!(rest["items"].as_array().unwrap().iter().map(id).collect::<Vec<_>>(), jobs[2..]);

    let mut models: Vec<String> =
        ["meshes/segment", "ifs/koch_curve", "ifs/cantor_dust"].map(|name| id(&service.post("/v1/models", &model(name)).json())).into();
    models.sort();
    assert_eq!(pages("/v1/models?limit=2"), [&models[..2], &models[2..]]);
    for path in ["/v1/jobs?cursor=job_1", "/v1/jobs?cursor=", "/v1/jobs?cursor=..%2F..%2Fx", "/v1/models?cursor=%FF"] {
        let refused = service.get(path);
        assert_eq!((refused.status, &refused.json()["code"]), (400, &json!("bad-cursor")), "{path}");
    }
    assert_eq!(service.get(&format!("/v1/models?cursor={next}")).json()["code"], "bad-cursor");
}

#[test]
fn bodies_that_are_announced_as_compressed_are_refused_as_such() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let order = json!({ "lacuna": 1, "kind": "measure", "model": model("meshes/segment"), "params": { "tolerance_mm": 0.1 } }).to_string();
    let triangle = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    for coding in ["gzip", "br", "unknown"] {
        let job = service.post_with("/v1/jobs", &[("content-encoding", coding)], order.as_bytes());
        let headers = [("content-encoding", coding), ("content-type", "application/octet-stream")];
        let file = service.request("POST", "/v1/models?format=off", &headers, triangle);
        for answer in [job, file] {
            let problem = answer.json();
            assert_eq!((answer.status, &problem["code"]), (415, &json!("unsupported-encoding")), "{problem}");
            assert!(problem["detail"].as_str().unwrap().contains(coding), "{problem}");
        }
    }
    assert_eq!(service.get("/v1/jobs").json()["items"], json!([]));
    assert_eq!(service.get("/v1/models").json()["items"], json!([]));
    let plain = service.post_with("/v1/jobs", &[("content-encoding", "identity")], order.as_bytes());
    assert!(matches!(plain.status, 200 | 202), "{}", plain.json());
}

#[test]
fn bodies_that_are_compressed_on_their_way_are_refused_and_not_read() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let head =
        "POST /v1/validate HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\ncontent-type: application/json\r\ntransfer-encoding: ";
    let body = "\r\n\r\n2\r\n{}\r\n0\r\n\r\n";
    let refused = service.raw(format!("{head}gzip, chunked{body}").as_bytes(), Duration::from_secs(30));
    assert!(refused.starts_with("HTTP/1.1 415") && refused.contains("unsupported-encoding"), "{refused}");
    let mut stream = TcpStream::connect(service.address).unwrap();
    write!(stream, "{head}chunked{body}").unwrap();
    let mut read = String::new();
    stream.read_to_string(&mut read).unwrap();
    assert!(read.starts_with("HTTP/1.1 200"), "{read}");
}

#[test]
fn what_says_nothing_of_caches_is_kept_by_none() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    for path in ["/v1/jobs", "/v1/capabilities", "/v1/materials", "/livez", "/nowhere"] {
        assert_eq!(service.get(path).header("cache-control"), "no-store", "{path}");
    }
}

#[test]
fn what_cannot_be_read_in_an_address_or_a_header_is_named() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    for (path, words) in [
        ("/v1/jobs/%FF", &["UTF-8", "id"][..]),
        ("/v1/profiles/%C3%28", &["UTF-8", "process"]),
        ("/v1/jobs?limit=many", &["limit=many"]),
        ("/v1/jobs?limit=201", &["201", "1 to 200"]),
    ] {
        let answer = service.get(path);
        let detail = answer.json()["detail"].as_str().unwrap().to_owned();
        assert!(answer.status == 400 && words.iter().all(|word| detail.contains(word)), "{path}: {detail}");
    }
    let order = json!({ "lacuna": 1, "kind": "measure", "model": model("meshes/segment"), "params": { "tolerance_mm": 0.1 } }).to_string();
    let long = "k".repeat(256);
    for (keys, words) in [(&[long.as_str()][..], &["256", "255"][..]), (&["a", "b"], &["2 headers"])] {
        let headers: Vec<(&str, &str)> = keys.iter().map(|key| ("idempotency-key", *key)).collect();
        let problem = service.post_with("/v1/jobs", &headers, order.as_bytes()).json();
        assert_eq!(problem["code"], "bad-header", "{problem}");
        assert!(words.iter().all(|word| problem["detail"].as_str().unwrap().contains(word)), "{problem}");
    }
    assert_eq!(service.get("/v1/jobs").json()["items"], json!([]));
}

#[test]
fn an_answer_that_takes_too_long_is_a_problem_and_a_job_s_id_comes_before() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_ANSWER_SECONDS", "3")]);
    // A body that never comes, with more time for itself than for the answer.
    let mut stream = TcpStream::connect(service.address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    let head = "POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\nx-request-id: late-1\r\ncontent-type: application/json\r\ncontent-length: 9\r\n\r\n{";
    stream.write_all(head.as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    assert!(head.starts_with("HTTP/1.1 504 ") && head.contains("application/problem+json"), "{answer}");
    let problem: Value = serde_json::from_str(body).unwrap();
    assert_eq!((&problem["code"], &problem["request_id"]), (&json!("timeout"), &json!("late-1")), "{problem}");
    assert!(problem["detail"].as_str().unwrap().contains("3 s"), "{problem}");

    // Whoever would wait longer than an answer may take gets the job's id while there is time.
    let answer = service.post_with("/v1/jobs", &[("prefer", "wait=30")], long_job(0).to_string().as_bytes());
    assert_eq!(answer.status, 202, "{}", answer.json());
    assert!(matches!(answer.header("preference-applied"), "wait=1" | "wait=2"), "{answer:?}");
    assert_eq!(service.post(&format!("{}/cancel", answer.header("location")), &json!({})).status / 100, 2);
}

#[test]
fn metrics_tell_of_routes_kinds_and_phases() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let order = json!({ "lacuna": 1, "kind": "solidify", "model": model("meshes/segment"),
        "params": { "tolerance_mm": 0.1, "radius_mm": 1 }, "outputs": ["stl"] });
    assert_eq!(service.done(&order)["state"], "succeeded");
    let value = |text: &str, name: &str| text.lines().find_map(|line| line.strip_prefix(name)?.trim().parse::<f64>().ok());
    let counted = |text: &str| value(text, "lacuna_job_seconds_count{kind=\"solidify\",state=\"succeeded\"}") == Some(1.0);
    // The end is counted a moment after it is told.
    let told = || String::from_utf8(service.get("/metrics").body).unwrap();
    until(Duration::from_secs(20), "a job that is counted", || counted(&told()) && told().contains("lacuna_phase_seconds_count"));
    let text = told();
    let whole = value(&text, "lacuna_job_seconds_sum{kind=\"solidify\",state=\"succeeded\"}").unwrap();
    let mut phases = 0.0;
    for phase in ["dilate", "write"] {
        let labels = format!("{{kind=\"solidify\",phase=\"{phase}\"}}");
        assert!(value(&text, &format!("lacuna_phase_seconds_count{labels}")).is_some_and(|count| count >= 1.0), "{phase}: {text}");
        phases += value(&text, &format!("lacuna_phase_seconds_sum{labels}")).unwrap();
    }
    // The phases are parts of the whole, up to the moment in which both are noted.
    assert!(0.0 < phases && phases <= whole + 0.1, "{phases} of {whole}");
    assert!(value(&text, "lacuna_http_requests_total{method=\"POST\",route=\"/v1/jobs\",status=\"200\"}").is_some(), "{text}");
}

#[test]
fn the_reader_s_page_asks_nobody_but_the_service() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let page = service.get("/docs");
    let text = String::from_utf8(page.body.clone()).unwrap();
    assert!(page.status == 200 && text.contains("/v1/openapi.json"), "{text}");
    for outside in ["http://", "https://", "src=\"//", "href=\"//", "@import", "<link"] {
        assert!(!text.contains(outside), "the page names {outside}");
    }
    // A browser would refuse it, too.
    let policy = page.header("content-security-policy");
    assert!(policy.starts_with("default-src 'none'") && policy.contains("connect-src 'self'"), "{policy}");
    assert!(!policy.contains("http") && !policy.contains('*'), "{policy}");
}

#[test]
fn a_result_in_several_formats_comes_in_the_one_that_is_preferred() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let order = json!({ "lacuna": 1, "kind": "solidify", "model": model("meshes/segment"),
        "params": { "tolerance_mm": 0.2, "radius_mm": 1 }, "outputs": ["stl", "3mf", "png"] });
    let view = service.done(&order);
    let outputs = view["outputs"].as_array().unwrap();
    let file = |name: &str| outputs.iter().find(|output| output["name"] == name).unwrap();
    let stem = file("stl")["file_name"].as_str().unwrap().strip_suffix(".stl").unwrap();
    let address = format!("/v1/jobs/{}/outputs/{stem}", view["id"].as_str().unwrap());
    let place = |name: &str| format!("/v1/results/{}", file(name)["digest"].as_str().unwrap());
    for (accept, name) in [
        ("*/*", "stl"),
        ("model/3mf", "3mf"),
        ("application/vnd.ms-package.3dmanufacturing-3dmodel+xml", "3mf"),
        ("model/stl;q=0.5, model/3mf;q=0.9, */*;q=0.1", "3mf"),
        ("model/gltf-binary, model/*;q=0.3, image/*;q=0.2", "stl"),
        ("text/html, image/png", "png"),
        ("model/*;q=0, */*", "png"),
    ] {
        let answer = service.get_with(&address, &[("accept", accept)]);
        assert_eq!((answer.status, answer.header("location")), (303, place(name).as_str()), "{accept}");
        assert_eq!(answer.header("vary"), "Accept", "{accept}");
    }
    assert_eq!(service.get(&address).header("location"), place("stl"));
    let named = service.get_with(&format!("{address}?format=3mf"), &[("accept", "model/stl")]);
    assert_eq!((named.status, named.header("location")), (303, place("3mf").as_str()));
    let whole = service.get_with(&format!("{address}?redirect=0"), &[("accept", "image/png")]);
    assert_eq!((whole.status, whole.header("content-type"), whole.header("vary")), (200, "image/png", "Accept"));
    assert!(whole.body.starts_with(b"\x89PNG"));

    // What was not made is not there, and the refusal says what is.
    for (query, accept) in [("", "model/obj"), ("?format=glb", "*/*"), ("?redirect=0", "text/*;q=1, */*;q=0")] {
        let refused = service.get_with(&format!("{address}{query}"), &[("accept", accept)]);
        assert_eq!((refused.status, refused.header("content-type"), refused.header("vary")), (406, "application/problem+json", "Accept"));
        let problem = refused.json();
        assert_eq!((&problem["type"], &problem["code"]), (&json!("/problems/not-acceptable"), &json!("not-acceptable")));
        let detail = problem["detail"].as_str().unwrap();
        assert!(["model/stl", "model/3mf", "image/png", "convert"].iter().all(|word| detail.contains(word)), "{detail}");
    }
    let unknown = service.get(&format!("{address}?format=parchment"));
    assert_eq!((unknown.status, &unknown.json()["code"]), (400, &json!("unknown-format")));
    assert!(["parchment", "stl", "3mf", "glb"].iter().all(|word| unknown.json()["detail"].as_str().unwrap().contains(word)));

    // Drawings are chosen by the same rule.
    let draw = |accept: &str| service.post_with("/v1/automaton", &[("accept", accept)], model("meshes/segment").to_string().as_bytes());
    assert_eq!(draw("*/*").header("content-type"), "image/svg+xml");
    assert_eq!(draw("image/svg+xml;q=0.5, text/vnd.graphviz").header("content-type"), "text/vnd.graphviz; charset=utf-8");
    let refused = draw("model/stl");
    assert_eq!((refused.status, refused.header("vary"), &refused.json()["code"]), (406, "Accept", &json!("not-acceptable")));
}

/// A request as a browser sends it for a page whose name leads to this machine.
fn named(service: &Service, target: &str, fields: &str) -> (u16, Value) {
    let mut stream = TcpStream::connect(service.address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    write!(stream, "GET {target} HTTP/1.1\r\n{fields}connection: close\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    (head["HTTP/1.1 ".len()..][..3].parse().unwrap(), serde_json::from_str(body).unwrap_or_default())
}

#[test]
fn without_keys_only_names_of_this_machine_are_answered() {
    let scratch = Scratch::new();
    let service = Service::start_with(&scratch.join("open"), &[("LACUNA_HOST_NAMES", "cad.example, Other.Example")]);
    let port = service.address.port();
    for own in ["localhost", "a.localhost:1", "127.0.0.1", "127.3.2.1:80", "[::1]:80", "cad.example", "OTHER.example:8080"] {
        assert_eq!(named(&service, "/v1/jobs", &format!("host: {own}\r\n")).0, 200, "{own}");
    }
    assert_eq!(named(&service, &format!("http://localhost:{port}/v1/jobs"), "host: localhost\r\n").0, 200);
    assert_eq!(named(&service, "/v1/jobs", "").0, 200, "whoever names no host is no browser");
    let rebound = format!("evil.example:{port}");
    for (target, fields) in [
        ("/v1/jobs".to_owned(), format!("host: {rebound}\r\n")),
        ("/docs".to_owned(), format!("host: {rebound}\r\n")),
        ("/metrics".to_owned(), format!("host: {rebound}\r\n")),
        ("/nowhere".to_owned(), format!("host: {rebound}\r\n")),
        ("/v1/jobs".to_owned(), format!("host: localhost\r\nhost: {rebound}\r\n")),
        (format!("http://{rebound}/v1/jobs"), "host: localhost\r\n".to_owned()),
    ] {
        let (status, problem) = named(&service, &target, &fields);
        assert_eq!((status, &problem["type"]), (421, &json!("/problems/misdirected")), "{target} {fields}");
        for word in [rebound.as_str(), "localhost", "cad.example, other.example", "LACUNA_HOST_NAMES", "--host-names", "LACUNA_API_KEYS"] {
            assert!(problem["detail"].as_str().unwrap().contains(word), "{word}: {problem}");
        }
    }
    for probe in ["/livez", "/readyz"] {
        assert_eq!(named(&service, probe, "host: 10.0.0.7:80\r\n").0, 200, "{probe}");
    }

    let keyed = Service::start_with(&scratch.join("keyed"), &[("LACUNA_API_KEYS", "ada")]);
    assert_eq!(named(&keyed, "/v1/jobs", "host: any.example\r\nauthorization: Bearer ada\r\n").0, 200);
    assert_eq!(named(&keyed, "/v1/jobs", "host: any.example\r\n").0, 401);

    let told: Value = serde_json::from_slice(&succeed(["doctor", "--host-names", "a.example,b.example"])).unwrap();
    let setting = told["settings"].as_array().unwrap().iter().find(|setting| setting["name"] == "LACUNA_HOST_NAMES").unwrap();
    assert_eq!((&setting["value"], &setting["origin"]), (&json!("a.example, b.example"), &json!("flag")));
    assert_eq!(run(["doctor", "--host-names", "http://a.example"]).status.code(), Some(2));
}

#[test]
fn text_is_compressed_for_those_who_ask() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let order =
        json!({ "lacuna": 1, "kind": "measure", "model": model("meshes/segment"), "params": { "tolerance_mm": 0.1 }, "outputs": [] });
    let view = service.done(&order);
    let id = view["id"].as_str().unwrap();
    let unzipped = |bytes: &[u8]| {
        let mut zipped = std::process::Command::new("gzip");
        let mut child = zipped.arg("-dc").stdin(std::process::Stdio::piped()).stdout(std::process::Stdio::piped()).spawn().unwrap();
        let (mut stdin, bytes) = (child.stdin.take().unwrap(), bytes.to_vec());
        let writer = std::thread::spawn(move || stdin.write_all(&bytes).unwrap());
        let output = child.wait_with_output().unwrap();
        writer.join().unwrap();
        assert!(output.status.success());
        output.stdout
    };
    let gzip = [("accept-encoding", "br, gzip;q=0.8")];
    for path in ["/v1/openapi.json", "/docs", "/metrics", "/v1/capabilities", "/v1/profiles", &format!("/v1/jobs/{id}"), "/v1/jobs"] {
        let (plain, zipped) = (service.get(path), service.get_with(path, &gzip));
        assert_eq!((plain.status, plain.header("content-encoding"), plain.header("vary")), (200, "", "Accept-Encoding"), "{path}");
        assert_eq!((zipped.status, zipped.header("content-encoding"), zipped.header("vary")), (200, "gzip", "Accept-Encoding"), "{path}");
        assert_eq!(zipped.header("content-type"), plain.header("content-type"), "{path}");
        assert_eq!(zipped.header("content-length"), zipped.body.len().to_string(), "{path}");
        assert!(zipped.body.len() * 10 < plain.body.len() * 8, "{path}: {} of {}", zipped.body.len(), plain.body.len());
        if path != "/metrics" {
            assert_eq!(unzipped(&zipped.body), plain.body, "{path}");
            let head = service.request("HEAD", path, &gzip, b"");
            let told = |answer: &lacuna_tests::support::service::Answer| {
                ["content-length", "content-encoding", "vary"].map(|name| answer.header(name).to_owned())
            };
            assert_eq!(told(&head), told(&zipped), "{path}");
        }
    }
    // A problem with a long list of findings.
    let many: serde_json::Map<String, Value> = (0..60).map(|number| (format!("unknown_{number}"), json!(number))).collect();
    let problem = service.post_with("/v1/jobs", &gzip, json!(many).to_string().as_bytes());
    assert_eq!((problem.status, problem.header("content-encoding")), (422, "gzip"));
    assert_eq!(problem.header("content-type"), "application/problem+json");
    assert!(String::from_utf8(unzipped(&problem.body)).unwrap().contains("unknown_59"));

    // What has a strong tag keeps the bytes that the tag is of; events are told one by one; what is short gains nothing.
    let certificate = view["outputs"].as_array().unwrap().iter().find(|output| output["name"] == "certificate.json").unwrap();
    let result = format!("/v1/results/{}", certificate["digest"].as_str().unwrap());
    for path in [&result, "/v1/library/koch_curve", &format!("/v1/jobs/{id}/events"), "/version"] {
        let answer = service.get_with(path, &gzip);
        assert_eq!((answer.status, answer.header("content-encoding"), answer.header("vary")), (200, "", ""), "{path}");
    }
    let part = service.get_with(&result, &[gzip[0], ("range", "bytes=0-9")]);
    assert_eq!((part.status, part.header("content-encoding"), part.body.len()), (206, "", 10));
}

#[test]
fn a_job_that_has_expired_says_so_to_its_owner() {
    let scratch = Scratch::new();
    let order =
        json!({ "lacuna": 1, "kind": "evaluate", "model": model("meshes/segment"), "params": { "tolerance_mm": 0.1 }, "outputs": ["obj"] });
    let ada = ("authorization", "Bearer ada");
    let submit = |service: &Service| {
        let headers = [ada, ("prefer", "wait=30"), ("idempotency-key", "k")];
        service.post_with("/v1/jobs", &headers, order.to_string().as_bytes()).json()
    };
    let keys = ("LACUNA_API_KEYS", "ada,bob");
    let made = {
        let service = Service::start_with(scratch.path(), &[keys]);
        submit(&service)
    };
    assert_eq!(made["state"], "succeeded", "{made}");
    let place = format!("/v1/jobs/{}", made["id"].as_str().unwrap());
    let output = format!("{place}/outputs/obj");
    let result = format!("/v1/results/{}", made["outputs"][0]["digest"].as_str().unwrap());
    // Jobs are kept for no time at all, so the sweep at the start lets this one expire; none comes for an hour after that.
    let service = Service::start_with(scratch.path(), &[keys, ("LACUNA_RETENTION_HOURS", "0")]);
    until(Duration::from_secs(20), "an expired job", || service.get_with(&place, &[ada]).json()["state"] == "expired");
    let view = service.get_with(&place, &[ada]).json();
    for member in ["id", "kind", "created", "started", "finished", "input_digest", "outputs"] {
        assert_eq!(view[member], made[member], "{member}");
    }
    assert!(view["expired"].as_str() >= view["finished"].as_str() && view["warnings"] == json!([]), "{view}");
    assert!(view.get("certificate").is_none() && view.get("problem").is_none(), "{view}");
    for place in [&output, &format!("{output}?redirect=0"), &result] {
        let gone = service.get_with(place, &[ada]);
        assert_eq!((gone.status, &gone.json()["type"]), (410, &json!("/problems/result-expired")), "{place}");
        assert!(gone.json()["detail"].as_str().unwrap().contains("POST /v1/jobs"), "{}", gone.json());
        assert_eq!(service.get_with(place, &[("authorization", "Bearer bob")]).status, 404, "{place}");
    }
    assert_eq!(service.get_with(&format!("{place}/outputs/stl"), &[ada]).status, 404);
    assert_eq!(service.get_with(&place, &[("authorization", "Bearer bob")]).status, 404);
    let listed = |state: &str| service.get_with(&format!("/v1/jobs?state={state}"), &[ada]).json()["items"].as_array().unwrap().len();
    assert_eq!((listed("expired"), listed("succeeded")), (1, 0));
    let events = String::from_utf8(service.get_with(&format!("{place}/events"), &[ada]).body).unwrap();
    assert!(events.contains("event: done") && events.contains("\"state\":\"expired\""), "{events}");
    assert_eq!(service.request("POST", &format!("{place}/cancel"), &[ada], b"").json()["state"], "expired");

    // The way out: the same job, with the same key even, makes it again.
    let again = submit(&service);
    assert_eq!((&again["state"], &again["reused"], &again["outputs"]), (&json!("succeeded"), &json!(false), &made["outputs"]));
    assert_ne!(again["id"], made["id"]);
    assert_eq!(service.get_with(&result, &[ada]).status, 200);
    assert_eq!(service.request("DELETE", &place, &[ada], b"").status, 204);
    assert_eq!(service.get_with(&place, &[ada]).status, 404);
    let limits = service.get_with("/v1/capabilities", &[ada]).json()["limits"].clone();
    assert_eq!((&limits["retention_hours"], &limits["expired_hours"]), (&json!(0), &json!(720)));
    drop(service);

    // Where no record is to be kept either, none is.
    let nothing = [keys, ("LACUNA_RETENTION_HOURS", "0"), ("LACUNA_EXPIRED_HOURS", "0")];
    let service = Service::start_with(scratch.path(), &nothing);
    until(Duration::from_secs(20), "an absent job", || service.get_with("/v1/jobs", &[ada]).json()["items"] == json!([]));
    assert_eq!(service.get_with(&result, &[ada]).status, 404);
}

#[test]
fn pages_from_elsewhere_change_nothing() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_CORS_ORIGINS", "https://cad.example")]);
    let own = format!("http://{}", service.address);
    // What a form of any page may send without asking first.
    let send =
        |method: &str, origin: &str| service.request(method, "/v1/jobs", &[("origin", origin), ("content-type", "text/plain")], b"{}");
    for foreign in ["https://evil.example", "null", "http://localhost:1"] {
        let refused = send("POST", foreign);
        assert_eq!((refused.status, &refused.json()["code"]), (403, &json!("foreign-origin")), "{foreign}");
        assert!(refused.json()["detail"].as_str().unwrap().contains("LACUNA_CORS_ORIGINS"));
        assert_eq!(service.get_with("/v1/jobs", &[("origin", foreign)]).status, 200, "{foreign}");
    }
    for allowed in [own.as_str(), "https://cad.example"] {
        assert_eq!(send("POST", allowed).status, 415, "{allowed}");
    }
}
