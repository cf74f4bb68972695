//! A job does nothing to the service that it does to its own process: memory that runs out, crashes, an end that nobody saw coming.

use std::time::{Duration, Instant};

use lacuna_tests::support::cases::{long_job, model};
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::{Service, is_alive, resident_bytes, send_signal, submit, until};
use serde_json::{Value, json};

/// How long anything may take that takes a moment on an idle machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// The work of a moment, another one for every number.
fn small(number: u32) -> Value {
    json!({ "lacuna": 1, "kind": "measure", "model": model("meshes/segment"), "params": { "tolerance_mm": 0.1 + f64::from(number) / 1e6 } })
}

/// A job that is being computed, and the process that does it, beside those of other jobs.
#[track_caller]
fn running(service: &Service, number: u32, others: &[u32]) -> (String, u32) {
    let id = submit(service, &long_job(number));
    until(PATIENCE, "progress", || service.get(&format!("/v1/jobs/{id}")).json()["progress"].is_object());
    let its: Vec<u32> = service.children().into_iter().filter(|child| !others.contains(child)).collect();
    assert_eq!(its.len(), 1, "a process of its own");
    (id, its[0])
}

/// The union of so many small cubes that overlap here and there: its engine keeps no account of its memory.
fn cubes(count: u32, memory_bytes: u64) -> Value {
    let input = |number: u32| {
        let at = |step: u32| f64::from(number.wrapping_mul(step) % 1000) / 10.0;
        let corner = |k: u32| json!([at(7) + f64::from(4 * (k & 1)), at(389) + f64::from(2 * (k & 2)), at(617) + f64::from(k & 4)]);
        let faces = json!([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]);
        let vertices: Vec<Value> = (0..8).map(corner).collect();
        json!({ "name": format!("cube {number}"), "model": { "shape": { "family": "mesh", "vertices": vertices, "faces": faces } } })
    };
    json!({ "lacuna": 1, "kind": "intersect", "inputs": (0..count).map(input).collect::<Vec<_>>(), "outputs": ["stl"],
        "params": { "operation": "union", "tolerance_mm": 0.05 }, "limits": { "memory_bytes": memory_bytes } })
}

#[test]
fn a_job_that_exceeds_its_memory_ends_alone() {
    // Half of what the plan says, and less: a third would be refused by it.
    const ALLOWED: u64 = 32 << 20;
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let (bystander, process) = running(&service, 0, &[]);
    let job = service.done(&cubes(10_000, ALLOWED));
    let problem = &job["problem"];
    assert_eq!((&job["state"], &problem["code"], &problem["status"]), (&json!("failed"), &json!("limit.memory"), &json!(422)), "{job}");
    assert_eq!((&problem["limit"], problem["allowed"].as_f64()), (&json!("memory_bytes"), Some(33_554_432.0)), "{problem}");
    assert!(problem["detail"].as_str().unwrap().contains("the operating system refused it another"), "{problem}");
    // Nobody else notices; and with the memory that it needs the same work is done.
    assert_eq!(service.get(&format!("/v1/jobs/{bystander}")).json()["state"], "running");
    assert!(service.children() == [process] && is_alive(process));
    let enough = service.done(&cubes(10_000, 1 << 30));
    assert_eq!(enough["state"], "succeeded", "{enough}");
    assert_eq!(enough["reused"], false);
}

/// Pairs of tetrahedra x, y, z >= 0, x + y + z <= 2, apart from each other; the second of each pair is moved by 1 along x, so that what both have is one of 1.
fn tetrahedra(pairs: u32, limits: &Value) -> Value {
    let input = |number: u32| {
        let (pair, second) = (number / 2, number % 2);
        let at = [pair % 20, pair / 20 % 20, pair / 400].map(|step| 4.0 * f64::from(step));
        let corner = |k: usize| -> [f64; 3] {
            std::array::from_fn(|axis| at[axis] + if axis + 1 == k { 2.0 } else { 0.0 } + if axis == 0 { f64::from(second) } else { 0.0 })
        };
        let (vertices, faces) = ([0, 1, 2, 3].map(corner), json!([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]));
        json!({ "name": format!("{number}"), "model": { "shape": { "family": "mesh", "vertices": vertices, "faces": faces } } })
    };
    json!({ "lacuna": 1, "kind": "intersect", "inputs": (0..2 * pairs).map(input).collect::<Vec<_>>(), "outputs": ["stl"],
        "params": { "operation": "union", "tolerance_mm": 0.01 }, "limits": limits })
}

#[test]
fn ten_thousand_operands_have_the_volume_of_their_union() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let start = Instant::now();
    let job = service.done(&tetrahedra(5_000, &json!({ "memory_bytes": 512 << 20, "seconds": 60 })));
    eprintln!("the union of 10,000 tetrahedra: {:?}", start.elapsed());
    assert_eq!(job["state"], "succeeded", "{}", job["problem"]);
    let certificate = &job["certificate"];
    // Two of 8 / 6 each, less the one of 1 / 6 that they share.
    let (exact, [low, high]) = (5_000.0 * (8.0 + 8.0 - 1.0) / 6.0, [0, 1].map(|end| certificate["volume_mm3"][end].as_f64().unwrap()));
    assert!(low <= exact && exact <= high && high - low < 1e-2 * exact, "[{low}, {high}] for {exact}");
    assert_eq!([&certificate["components"], &certificate["genus"], &certificate["cavities"]], [&json!(5_000), &json!(0), &json!(0)]);
    // A hundredth of a second is not enough for as many.
    let hurried = service.done(&tetrahedra(4_999, &json!({ "seconds": 0.01 })));
    assert_eq!([&hurried["state"], &hurried["problem"]["code"]], [&json!("failed"), &json!("limit.seconds")], "{}", hurried["problem"]);
}

#[test]
fn memory_is_given_back_after_a_large_result() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let job = service.done(&json!({ "lacuna": 1, "kind": "evaluate", "model": model("ifs/sierpinski_tetrahedron"), "outputs": ["obj"],
        "params": { "tolerance_mm": 0.06 } }));
    let bytes = job["outputs"][0]["bytes"].as_u64().unwrap();
    assert!(bytes > 100 << 20, "{bytes} bytes are no large result");
    assert_eq!(service.done(&small(0))["state"], "succeeded");
    let children: u64 = service.children().into_iter().map(resident_bytes).sum();
    let all = service.resident_bytes() + children;
    eprintln!("after a result of {} MB: {} MB resident, those of its processes included", bytes / 1_000_000, all / 1_000_000);
    assert!(all < 128 << 20, "{all} bytes");
}

#[test]
fn a_question_that_exceeds_its_memory_is_refused_alone() {
    const ALLOWED: u64 = 16 << 20;
    let scratch = Scratch::new();
    let allowed = ALLOWED.to_string();
    let service = Service::start_with(scratch.path(), &[("LACUNA_LIMIT_MEMORY_BYTES", &allowed)]);
    let order =
        |name: &str| json!({ "lacuna": 1, "kind": "solidify", "model": model(name), "params": { "tolerance_mm": 0.1, "radius_mm": 2.0 } });
    let small = || assert_eq!(service.post("/v1/plan", &order("meshes/segment")).status, 200);
    small();
    let processes = service.answering();
    assert_eq!(processes.len(), 1, "a process of its own");
    let before = service.resident_bytes();
    // It winds through space: blocks of a lattice have very many cells.
    let large = order("ifs/hilbert_curve");
    for _ in 0..3 {
        let answer = service.post("/v1/plan", &large);
        let problem = answer.json();
        assert_eq!(
            (answer.status, &problem["code"], &problem["limit"]),
            (422, &json!("limit.memory"), &json!("memory_bytes")),
            "{problem}"
        );
        assert_eq!(problem["allowed"].as_f64(), Some(16_777_216.0), "{problem}");
        assert!(problem["detail"].as_str().unwrap().contains("ask about a smaller model"), "{problem}");
        small();
    }
    let grown = service.resident_bytes().saturating_sub(before);
    assert!(grown < 16 << 20, "the service itself has {grown} bytes more");
    until(PATIENCE, "the process that had no memory is gone", || !processes.iter().any(|&process| is_alive(process)));
    // What an answer may not take a job may try, and fail.
    let job = service.done(&large);
    assert_eq!((&job["state"], &job["problem"]["code"]), (&json!("failed"), &json!("limit.memory")), "{job}");
}

#[test]
fn a_small_question_takes_a_moment_beside_a_large_job() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let _ = running(&service, 0, &[]);
    let mut times: Vec<Duration> = (0..40)
        .map(|number| {
            let start = Instant::now();
            assert_eq!(service.post("/v1/plan", &small(number)).status, 200);
            start.elapsed()
        })
        .collect();
    times.sort();
    eprintln!("a small plan beside a large job: median {:?}, longest {:?} of {}", times[20], times[39], times.len());
    assert_eq!(service.answering().len(), 1, "one process answers what comes one after the other");
    // Milliseconds on a machine that is not overloaded; this one may be.
    assert!(times[20] < Duration::from_millis(250), "{times:?}");
}

#[test]
fn a_crash_ends_one_job_and_nothing_else() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    assert!(service.children().is_empty(), "a process is started for a job, not before");
    let (bystander, beside) = running(&service, 0, &[]);
    for (number, (signal, code)) in
        [("SEGV", "worker-crashed"), ("ABRT", "worker-crashed"), ("KILL", "worker-killed")].into_iter().enumerate()
    {
        let (id, process) = running(&service, 1 + u32::try_from(number).unwrap(), &[beside]);
        // The first SEGV only takes the handler away that looks for overflown stacks: nothing in the program causes it again.
        until(PATIENCE, "dead", || {
            let _ = send_signal(process, signal);
            !is_alive(process)
        });
        let job = service.ended(&id);
        assert_eq!((&job["state"], &job["problem"]["code"], &job["attempt"]), (&json!("failed"), &json!(code), &json!(1)), "{job}");
        // What is to be done about it is said where somebody can do something.
        assert_eq!(job["problem"]["retry_after"].is_u64(), signal == "KILL");
        assert_eq!(service.done(&small(u32::try_from(number).unwrap()))["state"], "succeeded");
        let other = service.get(&format!("/v1/jobs/{bystander}")).json();
        assert_eq!(other["state"], "running", "{other}");
    }
    assert!(service.said(&["defect", "signal: 11"]), "the cause of a crash is in the log");
    assert_eq!(service.post(&format!("/v1/jobs/{bystander}/cancel"), &json!({})).status / 100, 2);
    assert_eq!(service.ended(&bystander)["state"], "cancelled");
}

#[test]
fn a_process_that_dies_between_two_jobs_is_replaced() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_WORKERS", "1")]);
    for number in 0..3 {
        let job = service.done(&small(number));
        assert_eq!((&job["state"], &job["attempt"]), (&json!("succeeded"), &json!(1)), "{job}");
        let kept = service.children();
        assert_eq!(kept.len(), 1, "a small process is kept");
        assert!(send_signal(kept[0], "KILL"));
        until(PATIENCE, "dead", || !is_alive(kept[0]));
    }
}

#[test]
fn every_job_of_a_process_tells_of_its_progress() {
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_WORKERS", "1")]);
    // One after the other without a pause: each begins in the phase in which the one before was a moment ago.
    let ids: Vec<String> = (0..24).map(|number| submit(&service, &small(number))).collect();
    for id in ids {
        assert_eq!(service.ended(&id)["state"], "succeeded");
        let events = String::from_utf8(service.get(&format!("/v1/jobs/{id}/events")).body).unwrap();
        assert!(events.contains("event: progress"), "{events}");
    }
    assert_eq!(service.children().len(), 1, "one process did them all");
}

#[test]
fn stopping_a_job_frees_its_process_at_once() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let mut times = Vec::new();
    for number in 0..5 {
        let (id, process) = running(&service, number, &[]);
        let start = Instant::now();
        assert_eq!(service.post(&format!("/v1/jobs/{id}/cancel"), &json!({})).status / 100, 2);
        until(PATIENCE, "free", || !is_alive(process));
        times.push(start.elapsed());
        assert_eq!(service.ended(&id)["state"], "cancelled");
    }
    times.sort();
    eprintln!("from the wish to stop to the end of the process: median {:?}, longest {:?} of {}", times[2], times[4], times.len());
    // 250 ms are promised on a machine that is not overloaded; this one may be.
    assert!(times[2] < Duration::from_secs(2), "{times:?}");
}

#[test]
fn a_time_limit_ends_the_process_too() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let mut order = long_job(0);
    order["limits"]["seconds"] = json!(0.5);
    let job = service.done(&order);
    assert_eq!((&job["state"], &job["problem"]["code"]), (&json!("failed"), &json!("limit.seconds")), "{job}");
    assert_eq!((&job["problem"]["limit"], &job["problem"]["allowed"]), (&json!("seconds"), &json!(0.5)));
    until(PATIENCE, "gone", || service.children().is_empty());
}

#[test]
fn a_service_that_is_killed_leaves_no_process_behind() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let first = running(&service, 0, &[]).1;
    let processes = [first, running(&service, 1, &[first]).1];
    service.kill();
    let time = until(PATIENCE, "gone", || processes.iter().all(|&process| !is_alive(process)));
    eprintln!("two processes ended {time:?} after their service was killed");
    // What they were writing is swept at the next start, and the jobs are done again.
    let again = Service::start(scratch.path());
    let jobs = again.get("/v1/jobs").json();
    assert_eq!(jobs["items"].as_array().unwrap().len(), 2);
}

/// What every thread of a process gives way to others by: 19 for the most, 0 as usual.
fn niceness(process: u32) -> Vec<i32> {
    let tasks = std::fs::read_dir(format!("/proc/{process}/task")).unwrap();
    let lines = tasks.filter_map(|task| std::fs::read_to_string(task.ok()?.path().join("stat")).ok());
    // The name of the thread comes second and may hold anything; niceness is the nineteenth.
    lines.map(|line| line.rsplit_once(") ").unwrap().1.split(' ').nth(16).unwrap().parse().unwrap()).collect()
}

#[test]
fn every_thread_of_a_job_gives_way_to_those_that_answer() {
    let scratch = Scratch::new();
    let service = Service::start(scratch.path());
    let (_, process) = running(&service, 0, &[]);
    let computing = niceness(process);
    assert!(computing.len() > 2 && computing.iter().all(|nice| *nice == 19), "{computing:?}");
    let usual = niceness(std::process::id())[0];
    assert!(niceness(service.id()).iter().all(|nice| *nice == usual), "the service keeps its priority");
    // A question is waited for: who answers it does not stand behind jobs.
    let answering = service.answering();
    assert!(!answering.is_empty() && answering.iter().flat_map(|process| niceness(*process)).all(|nice| nice == usual));
}
