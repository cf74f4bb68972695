//! Front ends and workers as processes of their own, over a real PostgreSQL and an S3 server.

use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use lacuna_tests::support::binary::lacuna;
use lacuna_tests::support::cases::{long_job, model, search_job};
use lacuna_tests::support::service::{Service, submit, until, view};
use lacuna_tests::support::stage::{LEASE, Stage};
use serde_json::{Value, json};

/// How long anything may take that takes a moment on an idle machine.
const PATIENCE: Duration = Duration::from_secs(90);

/// A small solid, a different one for every number.
fn order(number: u32) -> Value {
    json!({ "lacuna": 1, "kind": "solidify", "model": model("meshes/segment"), "outputs": ["stl", "3mf"],
        "params": { "tolerance_mm": 0.05, "radius_mm": 1.0 + f64::from(number) / 64.0 } })
}

/// The number of the worker that says it has started a job.
fn taker(workers: &[Option<Service>], id: &str, attempt: u32) -> Option<usize> {
    let attempt = format!("attempt={attempt}");
    workers.iter().position(|worker| worker.as_ref().is_some_and(|worker| worker.said(&["job started", id, &attempt])))
}

#[test]
fn any_front_end_answers_for_any_worker() {
    let Some(stage) = Stage::set() else { return };
    let (first, second) = (stage.start("front", "first"), stage.start("front", "second"));
    let workers = [stage.start("worker", "one"), stage.start("worker", "two")];

    // What is accepted here is seen there, and its files are read in parts from either.
    let id = submit(&first, &order(0));
    assert_eq!(view(&second, &id)["id"], id.as_str());
    let job = second.ended(&id);
    assert_eq!(job["state"], "succeeded", "{job}");
    let file = &job["outputs"][0];
    let place = format!("/v1/results/{}", file["digest"].as_str().unwrap());
    let whole = first.get(&place);
    assert_eq!((whole.status, whole.body.len() as u64), (200, file["bytes"].as_u64().unwrap()));
    let part = second.get_with(&place, &[("range", "bytes=80-83")]);
    assert_eq!((part.status, part.body.as_slice()), (206, &whole.body[80..84]));
    assert_eq!(part.header("content-range"), format!("bytes 80-83/{}", whole.body.len()));
    assert_eq!(first.get("/v1/jobs").json()["items"], second.get("/v1/jobs").json()["items"]);

    // The same bytes as one process makes.
    let alone = Service::start(&stage.scratch.join("alone"));
    let same = alone.done(&order(0));
    assert_eq!(same["outputs"], job["outputs"]);

    // Models, too, and keys of idempotency.
    let stored = first.post("/v1/models", &model("meshes/segment")).json();
    let by_reference = json!({ "lacuna": 1, "kind": "measure", "model_ref": stored["id"], "params": { "tolerance_mm": 0.1 } });
    assert_eq!(second.done(&by_reference)["state"], "succeeded");
    let keyed = |front: &Service, order: &Value| front.post_with("/v1/jobs", &[("idempotency-key", "k")], order.to_string().as_bytes());
    let (one, other) = (keyed(&first, &order(1)), keyed(&second, &order(1)));
    assert_eq!((one.json()["id"].clone(), other.header("idempotency-replayed")), (other.json()["id"].clone(), "true"));
    assert_eq!(keyed(&second, &order(2)).status, 422);

    // A worker tells how it is, and nothing else; nobody tells secrets.
    assert_eq!((workers[0].get("/readyz").status, workers[0].get("/v1/jobs").status), (200, 404));
    for process in [&first, &workers[0]] {
        assert!(!process.said(&["hidden-from-everybody"]) && !process.said(&["not-asked-for"]));
    }
    assert_eq!(first.delete(&format!("/v1/jobs/{id}")).status, 204);
    assert_eq!(second.get(&format!("/v1/jobs/{id}")).status, 404);
}

#[test]
fn limits_hold_though_another_process_has_done_the_work() {
    let Some(stage) = Stage::set() else { return };
    let (first, second) = (stage.start("front", "first"), stage.start("front", "second"));
    let _worker = stage.start("worker", "one");
    crate::service::limits_hold_though_the_work_is_done(&first, &second);
}

#[test]
fn equal_orders_at_once_at_two_front_ends_are_one_work() {
    let Some(stage) = Stage::set() else { return };
    let fronts = [stage.start("front", "first"), stage.start("front", "second")];
    // Orders first, workers then: all wait at the same time.
    let ids: Vec<String> = std::thread::scope(|scope| {
        let send = |k: usize| submit(&fronts[k % 2], &order(0));
        let threads: Vec<_> = (0..8).map(|k| scope.spawn(move || send(k))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    let _workers = [stage.start("worker", "one"), stage.start("worker", "two")];
    let jobs: Vec<Value> = ids.iter().map(|id| fronts[0].ended(id)).collect();
    assert!(jobs.iter().all(|job| job["state"] == "succeeded" && job["outputs"] == jobs[0]["outputs"]), "{jobs:?}");
    let worked = jobs.iter().filter(|job| job["attempt"] == 1).count();
    let reused = jobs.iter().filter(|job| job["attempt"] == 0 && job["reused"] == true).count();
    assert_eq!((worked, reused), (1, 7));
}

#[test]
fn a_job_is_stopped_from_another_process_and_its_events_are_told_there() {
    let Some(stage) = Stage::set() else { return };
    let (first, second) = (stage.start("front", "first"), stage.start("front", "second"));
    let _worker = stage.start("worker", "one");
    let mut longest = Duration::ZERO;
    for number in 0..3 {
        let id = submit(&first, &long_job(number));
        let mut events = TcpStream::connect(second.address).unwrap();
        events.set_read_timeout(Some(PATIENCE)).unwrap();
        write!(events, "GET /v1/jobs/{id}/events HTTP/1.1\r\nhost: localhost\r\n\r\n").unwrap();
        until(PATIENCE, "progress", || view(&second, &id)["progress"]["phase"].is_string());
        let stopped = Instant::now();
        let answer = second.post(&format!("/v1/jobs/{id}/cancel"), &json!({}));
        assert!(matches!(answer.status, 200 | 202), "{}", answer.status);
        until(PATIENCE, "cancelled", || view(&first, &id)["state"] == "cancelled");
        longest = longest.max(stopped.elapsed());
        let told: Vec<String> = BufReader::new(events).lines().map_while(Result::ok).take_while(|line| line != "event: done").collect();
        for event in ["event: state", "event: progress"] {
            assert!(told.iter().any(|line| line == event), "{event} in {told:?}");
        }
    }
    eprintln!("from the wish at one front end to `cancelled` at the other, with the worker in a third process: {longest:?}");
    // 250 ms are promised on a machine that is not overloaded; this one may be.
    assert!(longest < Duration::from_secs(2), "{longest:?}");
}

#[test]
fn a_worker_that_is_asked_to_end_hands_its_job_back_and_another_ends_it() {
    let Some(stage) = Stage::set() else { return };
    let front = stage.start("front", "front");
    let mut workers = [Some(stage.start("worker", "one")), Some(stage.start("worker", "two"))];
    // Some seconds of work: more than the worker has to end it, and it can be waited for.
    let mut order = search_job(0);
    order["params"]["tolerance_mm"] = json!(1e-5);
    let id = submit(&front, &order);
    until(PATIENCE, "a start", || taker(&workers, &id, 1).is_some());
    let first = taker(&workers, &id, 1).unwrap();
    until(PATIENCE, "progress", || view(&front, &id)["progress"]["phase"].is_string());
    let asked = Instant::now();
    let mut leaving = workers[first].take().unwrap();
    leaving.signal("TERM");
    let status = leaving.end(PATIENCE);
    assert!(status.success(), "{status}");
    until(PATIENCE, "a second start", || taker(&workers, &id, 2) == Some(1 - first));
    eprintln!(
        "after SIGTERM with a drain time of 1 s and a lease of {LEASE} s another worker has started the job after {:?}",
        asked.elapsed()
    );
    let job = front.ended(&id);
    assert_eq!((&job["state"], &job["attempt"], &job["reused"]), (&json!("succeeded"), &json!(2), &json!(false)), "{job}");
}

#[test]
fn a_dead_worker_s_job_is_another_s_and_a_job_that_kills_is_given_up() {
    let Some(stage) = Stage::set() else { return };
    let front = stage.start("front", "front");
    let mut workers = [Some(stage.start("worker", "one")), Some(stage.start("worker", "two"))];

    // Killed in the middle of a job, which another worker then does.
    let id = submit(&front, &long_job(0));
    until(PATIENCE, "a start", || taker(&workers, &id, 1).is_some());
    let dead = taker(&workers, &id, 1).unwrap();
    workers[dead].take().unwrap().kill();
    let taken_up = until(PATIENCE, "a second start", || taker(&workers, &id, 2) == Some(1 - dead));
    eprintln!("with a lease of {LEASE} s a dead worker's job was taken up after {taken_up:?}");
    assert_eq!(view(&front, &id)["attempt"], 2);

    // Whoever takes it is killed: after its attempts it is given up, and the service does other work.
    workers[1 - dead].take().unwrap().kill();
    let job = front.ended(&id);
    assert_eq!((&job["state"], &job["problem"]["code"], &job["attempt"]), (&json!("failed"), &json!("interrupted"), &json!(2)), "{job}");
    let _worker = stage.start("worker", "three");
    assert_eq!(front.done(&order(0))["state"], "succeeded");

    // Jobs at several workers are stopped from the front.
    let other = stage.start("worker", "four");
    let ids: Vec<String> = (1..3).map(|number| submit(&front, &long_job(number))).collect();
    until(PATIENCE, "a start", || ids.iter().any(|id| other.said(&["job started", id])));
    for id in &ids {
        assert_eq!(front.post(&format!("/v1/jobs/{id}/cancel"), &json!({})).status / 100, 2);
        assert_eq!(front.ended(id)["state"], "cancelled");
    }
}

#[test]
fn a_worker_that_was_given_up_does_not_overwrite() {
    let Some(stage) = Stage::set() else { return };
    let front = stage.start("front", "front");
    let mut workers = [Some(stage.start("worker", "one")), None];
    let id = submit(&front, &long_job(0));
    until(PATIENCE, "a start", || taker(&workers, &id, 1).is_some());
    // As long as it stands still it cannot renew its lease.
    workers[0].as_ref().unwrap().signal("STOP");
    workers[1] = Some(stage.start("worker", "two"));
    until(PATIENCE, "a second start", || taker(&workers, &id, 2) == Some(1));
    workers[0].as_ref().unwrap().signal("CONT");
    until(PATIENCE, "the first worker sees it", || workers[0].as_ref().unwrap().said(&["no longer this worker's", &id]));
    let job = view(&front, &id);
    assert_eq!((&job["state"], &job["attempt"]), (&json!("running"), &json!(2)), "{job}");
    // The first worker is free again.
    assert_eq!(front.done(&order(0))["state"], "succeeded");
    assert_eq!(front.post(&format!("/v1/jobs/{id}/cancel"), &json!({})).status / 100, 2);
    assert_eq!(front.ended(&id)["state"], "cancelled");
}

#[test]
fn nothing_is_lost_while_the_database_is_away() {
    let Some(stage) = Stage::set() else { return };
    let front = stage.start("front", "front");
    let worker = stage.start("worker", "one");
    let running = submit(&front, &long_job(0));
    until(PATIENCE, "a start", || worker.said(&["job started", &running]));
    let waiting: Vec<String> = (0..5).map(|number| submit(&front, &order(number))).collect();

    stage.database.stop();
    let away = Instant::now();
    let start = Instant::now();
    for answer in [front.get(&format!("/v1/jobs/{running}")), front.post("/v1/jobs", &order(9)), front.get("/readyz")] {
        assert_eq!((answer.status, answer.header("content-type")), (503, "application/problem+json"), "{}", answer.json());
        assert!(answer.header("retry-after").parse::<u32>().unwrap() > 0);
    }
    assert!(start.elapsed() < Duration::from_secs(30), "refused after {:?}", start.elapsed());
    assert_eq!(front.get("/livez").status, 200);
    // Five times the lease: nobody may be given up for it.
    std::thread::sleep(Duration::from_secs(10).saturating_sub(away.elapsed()));
    stage.database.resume();

    let back = until(PATIENCE, "ready", || front.get("/readyz").status == 200);
    eprintln!("ready {back:?} after the database was back");
    assert_eq!(view(&front, &running)["attempt"], 1, "the worker kept its job");
    assert!(!worker.said(&["the lease is lost"]));
    assert_eq!(front.post(&format!("/v1/jobs/{running}/cancel"), &json!({})).status / 100, 2);
    assert_eq!(front.ended(&running)["state"], "cancelled");
    for id in &waiting {
        let job = front.ended(id);
        assert_eq!((&job["state"], &job["attempt"]), (&json!("succeeded"), &json!(1)), "{job}");
    }
    assert_eq!(front.done(&order(9))["state"], "succeeded");
}

#[test]
fn what_ends_while_the_database_or_the_store_is_away_is_recorded_when_it_is_back() {
    let Some(stage) = Stage::set() else { return };
    let front = stage.start("front", "front");
    let worker = stage.start("worker", "one");
    // Time enough to take the database away; the files go to the store in several parts.
    let order = |tolerance: f64| {
        json!({ "lacuna": 1, "kind": "evaluate", "model": model("ifs/sierpinski_tetrahedron"), "outputs": ["obj"],
            "params": { "tolerance_mm": tolerance } })
    };
    let first = submit(&front, &order(0.05));
    until(PATIENCE, "a start", || worker.said(&["job started", &first]));
    stage.database.stop();
    until(PATIENCE, "an end that cannot be recorded", || worker.said(&["not recorded yet", &first]));
    stage.database.resume();
    until(PATIENCE, "ready", || front.get("/readyz").status == 200);

    let second = submit(&front, &order(0.1));
    until(PATIENCE, "a start", || worker.said(&["job started", &second]));
    stage.objects.signal("STOP");
    std::thread::sleep(Duration::from_secs(4));
    assert_ne!(view(&front, &second)["state"], "succeeded", "its files are nowhere yet");
    stage.objects.signal("CONT");
    for id in [&first, &second] {
        let job = front.ended(id);
        assert_eq!((&job["state"], &job["attempt"]), (&json!("succeeded"), &json!(1)), "{job}");
        let file = &job["outputs"][0];
        let kept = front.get(&format!("/v1/results/{}", file["digest"].as_str().unwrap()));
        assert_eq!((kept.status, Some(kept.body.len() as u64)), (200, file["bytes"].as_u64()));
    }
}

#[test]
fn parts_of_a_service_ask_for_what_they_share() {
    let doctor = |pairs: &[(&str, &str)]| std::process::Command::new(lacuna()).arg("doctor").envs(pairs.iter().copied()).output().unwrap();
    let output = doctor(&[("LACUNA_ROLE", "worker")]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("LACUNA_DATABASE_URL"));
    let output = doctor(&[("LACUNA_DATABASE_URL", "postgres://ada:s3cret@db/lacuna"), ("LACUNA_OBJECTS_URL", "s3://parts")]);
    let words = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && words.contains("postgres://ada:***@db/lacuna") && !words.contains("s3cret"), "{words}");
}

#[test]
fn a_job_that_has_expired_is_known_to_every_front_end_for_a_while() {
    let Some(stage) = Stage::set() else { return };
    let first = stage.start("front", "first");
    let _worker = stage.start("worker", "one");
    let made = first.done(&order(7));
    assert_eq!(made["state"], "succeeded", "{made}");
    let id = made["id"].as_str().unwrap();
    let result = format!("/v1/results/{}", made["outputs"][0]["digest"].as_str().unwrap());
    // One that keeps ended jobs for no time at all sweeps as it starts.
    let second = stage.start_with("front", "second", &[("LACUNA_RETENTION_HOURS", "0")]);
    until(PATIENCE, "expired", || view(&first, id)["state"] == "expired");
    for front in [&first, &second] {
        let view = view(front, id);
        assert_eq!((&view["state"], &view["outputs"], &view["finished"]), (&json!("expired"), &made["outputs"], &made["finished"]));
        assert!(view.get("certificate").is_none() && view["expired"].as_str() >= view["finished"].as_str(), "{view}");
        for place in [result.clone(), format!("/v1/jobs/{id}/outputs/stl")] {
            assert_eq!(front.get(&place).status, 410, "{place}");
        }
    }
    // It is made again, and then it is there again.
    let again = second.done(&order(7));
    assert_eq!((&again["outputs"], &again["reused"]), (&made["outputs"], &json!(false)));
    assert_eq!(first.get(&result).status, 200);
    // Two have expired when the next one sweeps, which keeps one record, the younger one's.
    let third = stage.start_with("front", "third", &[("LACUNA_RETENTION_HOURS", "0"), ("LACUNA_EXPIRED_JOBS", "1")]);
    let younger = again["id"].as_str().unwrap();
    until(PATIENCE, "one record", || third.get("/v1/jobs").json()["items"].as_array().is_some_and(|items| items.len() == 1));
    assert_eq!(view(&third, younger)["state"], "expired");
    assert_eq!((third.get(&format!("/v1/jobs/{id}")).status, third.get(&result).status), (404, 410));
    let nothing = [("LACUNA_RETENTION_HOURS", "0"), ("LACUNA_EXPIRED_HOURS", "0")];
    let fourth = stage.start_with("front", "fourth", &nothing);
    until(PATIENCE, "no record", || fourth.get("/v1/jobs").json()["items"] == json!([]));
    assert_eq!(fourth.get(&result).status, 404);
}

#[test]
fn keys_are_served_by_turns_however_many_jobs_one_has() {
    let Some(stage) = Stage::set() else { return };
    let front = stage.start_with("front", "front", &[("LACUNA_API_KEYS", "ada,ben")]);
    let submit = |key: &str, number: u32| {
        let answer = front.post_with("/v1/jobs", &[("authorization", &format!("Bearer {key}"))], order(number).to_string().as_bytes());
        assert_eq!(answer.status, 202, "{}", answer.json());
        answer.json()["id"].as_str().unwrap().to_owned()
    };
    let many: Vec<String> = (0..8).map(|number| submit("ada", number)).collect();
    let few: Vec<String> = (8..10).map(|number| submit("ben", number)).collect();
    let _worker = stage.start("worker", "one");
    let started = |key: &str, id: &String| {
        let authorization = format!("Bearer {key}");
        let mut job = Value::Null;
        until(PATIENCE, "the end", || {
            job = front.get_with(&format!("/v1/jobs/{id}"), &[("authorization", &authorization)]).json();
            job["state"] == "succeeded"
        });
        job["started"].as_str().unwrap().to_owned()
    };
    let of_many: Vec<String> = many.iter().map(|id| started("ada", id)).collect();
    let of_few: Vec<String> = few.iter().map(|id| started("ben", id)).collect();
    // Each of the few begins behind as many of the many as there were turns.
    assert!(of_few[0] < of_many[2] && of_few[1] < of_many[3], "{of_few:?} {of_many:?}");
    assert!(of_many.is_sorted() && of_few.is_sorted());
}
