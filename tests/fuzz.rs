//! Fuzzing without a fuzzer: seeds that are committed, mutated thousands of times by a generator with a fixed seed.
//!
//! Whatever comes in, a reader answers: a value within its limits, or a refusal that says something. `LACUNA_FUZZ_ROUNDS`
//! multiplies the number of cases; a case that ever failed becomes a file of `tests/fuzz/corpus`, which is replayed first.

use std::io::{Cursor, Write as _};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use lacuna_exchange::document::{DocumentLimits, read_address_question, read_job, read_model, read_solve};
use lacuna_exchange::format::{FORMATS, Format, ReadLimits, detect, read};
use lacuna_tests::support::cases;
use lacuna_tests::support::random::Random;
use lacuna_tests::support::root;
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::Service;

/// What readers stumble over, put in the place of a number or a word.
const SPECIAL: [&str; 24] = [
    "0",
    "-0",
    "-1",
    "1e308",
    "-1e309",
    "1e-320",
    "nan",
    "inf",
    "NaN",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551616",
    "0x10",
    "1.",
    ".5",
    "+1",
    "\"\"",
    "null",
    "[]",
    "{}",
    "\u{0}",
    "\u{feff}",
    "\u{1f4a9}",
];

fn below(random: &mut Random, end: usize) -> usize {
    ((random.unit() * end as f64) as usize).min(end.saturating_sub(1))
}

/// A seed with one change, or up to four: most documents do not survive more.
fn mutate(random: &mut Random, seed: &[u8], other: &[u8]) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..=below(random, 4).saturating_sub(below(random, 4)) {
        let (from, to) = (below(random, bytes.len()), below(random, bytes.len()));
        let (from, to) = (from.min(to), from.max(to));
        match below(random, 9) {
            0 if !bytes.is_empty() => bytes[from] ^= 1 << below(random, 8),
            1 if !bytes.is_empty() => bytes[from] = [0, 1, 127, 128, 255, b' ', b'\n', b'"', b'<', b'-'][below(random, 10)],
            2 => bytes.truncate(to),
            3 => drop(bytes.drain(from..to)),
            4 => {
                // Again and again: nesting, repeated members, long runs.
                let piece = bytes[from..to.min(from + 64)].to_vec();
                for _ in 0..=below(random, 40) {
                    bytes.splice(from..from, piece.iter().copied());
                }
            }
            5 => {
                let start = below(random, other.len());
                let end = (start + below(random, 64)).min(other.len());
                bytes.splice(from..from, other[start..end].iter().copied());
            }
            6 | 7 => {
                // A number or a word becomes another.
                let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || b".-+".contains(byte);
                let start = bytes[from..].iter().position(is_word).map_or(bytes.len(), |offset| from + offset);
                let end = bytes[start..].iter().position(|byte| !is_word(byte)).map_or(bytes.len(), |offset| start + offset);
                bytes.splice(start..end, SPECIAL[below(random, SPECIAL.len())].bytes());
            }
            _ => bytes.extend_from_slice(&other[..below(random, other.len().min(256))]),
        }
    }
    bytes
}

/// How many cases a target gets.
fn rounds(base: usize) -> usize {
    base * std::env::var("LACUNA_FUZZ_ROUNDS").ok().and_then(|rounds| rounds.parse::<usize>().ok()).unwrap_or(1)
}

/// Gives a target its seeds and so many mutations of them; none may panic, or take longer than a reader ever should.
fn fuzz(name: &str, number: u64, seeds: &[Vec<u8>], cases: usize, target: impl Fn(&[u8])) {
    assert!(!seeds.is_empty(), "{name} has no seeds");
    let mut random = Random(number);
    let hook = std::panic::take_hook();
    let all = (0..seeds.len() + cases).map(|case| match seeds.get(case) {
        Some(seed) => seed.clone(),
        None => {
            let (seed, other) = (below(&mut random, seeds.len()), below(&mut random, seeds.len()));
            mutate(&mut random, &seeds[seed], &seeds[other])
        }
    });
    let failed = all.enumerate().find_map(|(case, bytes)| {
        let start = Instant::now();
        let result = catch_unwind(AssertUnwindSafe(|| target(&bytes)));
        // Readers are linear in kilobytes; a machine that stands still for seconds is not their fault.
        let slow = start.elapsed() > Duration::from_secs(20);
        (result.is_err() || slow).then_some((case, bytes, start.elapsed()))
    });
    std::panic::set_hook(hook);
    if let Some((case, bytes, time)) = failed {
        let file = std::env::temp_dir().join(format!("lacuna-fuzz-{name}-{case}"));
        std::fs::write(&file, &bytes).unwrap();
        panic!("{name}, case {case}: it panicked, or took {time:?}; the bytes are in {}", file.display());
    }
}

fn corpus(endings: &[&str]) -> Vec<Vec<u8>> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(root().join("tests/fuzz/corpus")).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let wanted = |file: &PathBuf| file.extension().is_some_and(|ending| endings.contains(&&*ending.to_string_lossy()));
    files.into_iter().filter(wanted).map(|file| std::fs::read(file).unwrap()).collect()
}

#[test]
fn documents_are_read_or_refused() {
    let mut seeds = Vec::new();
    let mut folders = vec![cases::folder()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.file_name().is_some_and(|name| name == "model.json" || name == "job.json") {
                seeds.push(path);
            }
        }
    }
    seeds.sort();
    let seeds: Vec<Vec<u8>> = seeds.iter().map(|path| std::fs::read(path).unwrap()).filter(|bytes| bytes.len() < 20_000).collect();
    assert!(seeds.len() > 100, "{}", seeds.len());
    let limits = DocumentLimits { bytes: 1 << 20, values: 100_000, ..DocumentLimits::default() };
    fuzz("documents", 1, &seeds, rounds(40_000), |bytes| {
        // Whoever is refused hears why.
        let heard = |refusals: usize| assert!(refusals > 0, "a refusal without a word");
        drop(read_model(bytes, &limits).map_err(|why| heard(why.len())));
        drop(read_job(bytes, &limits).map_err(|why| heard(why.len())));
        drop(read_solve(bytes, &limits).map_err(|why| heard(why.len())));
        drop(read_address_question(bytes, &limits).map_err(|why| heard(why.len())));
    });
}

/// Reads a file and checks that what comes out is in range.
fn read_within(bytes: &[u8], format: Option<Format>) {
    let limits = ReadLimits { vertices: 5000, triangles: 5000, inflated_bytes: 4 << 20, instances: 1000, ..ReadLimits::default() };
    match read(bytes, format, &limits) {
        Err(error) => assert!(!error.to_string().is_empty() && !error.code().is_empty()),
        Ok(file) => {
            let count = file.mesh.vertices.len();
            assert!(count <= 5000 && file.mesh.triangles.len() <= 5000);
            assert!(file.mesh.triangles.iter().flatten().all(|&index| (index as usize) < count));
            assert!(file.mesh.vertices.iter().all(|vertex| vertex.is_finite()));
            assert!(file.segments.len() + file.points.len() <= 5000);
            assert!(file.segments.iter().flatten().chain(&file.points).all(|&index| (index as usize) < count));
            let corners: usize = file.faces().iter().map(|face| face.len().saturating_sub(2)).sum();
            assert_eq!(corners, file.mesh.triangles.len());
        }
    }
}

#[test]
fn mesh_files_are_read_or_refused() {
    let targets = [("stl", Format::Stl), ("obj", Format::Obj), ("ply", Format::Ply), ("off", Format::Off), ("wrl", Format::Vrml)];
    for (number, (ending, format)) in (10..).zip(targets) {
        fuzz(ending, number, &corpus(&[ending]), rounds(30_000), |bytes| read_within(bytes, Some(format)));
    }
    // Any bytes as any format, and as whatever they look like.
    let seeds = corpus(&["stl", "obj", "ply", "off", "wrl", "xml"]);
    fuzz("any", 20, &seeds, rounds(8000), |bytes| {
        let _ = detect(bytes);
        read_within(bytes, None);
        FORMATS.iter().for_each(|row| read_within(bytes, Some(row.format)));
    });
}

/// A package with a model part.
fn package(model: &[u8], relations: &[u8]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let stored = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    let types = br#"<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"><Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>"#;
    for (name, content) in [("[Content_Types].xml", &types[..]), ("_rels/.rels", relations), ("3D/3dmodel.model", model)] {
        archive.start_file(name, stored).unwrap();
        archive.write_all(content).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

#[test]
fn packages_are_read_or_refused() {
    let relations = br#"<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Target="/3D/3dmodel.model" Id="a" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>"#;
    let models = corpus(&["xml"]);
    read_within(&package(&models[0], relations), None);
    assert!(read(&package(&models[0], relations), None, &ReadLimits::default()).is_ok(), "the seed is legal");
    fuzz("3mf-model", 30, &models, rounds(30_000), |bytes| read_within(&package(bytes, relations), Some(Format::ThreeMf)));
    fuzz("3mf-relations", 31, &[relations.to_vec()], rounds(8000), |bytes| {
        read_within(&package(&models[0], bytes), Some(Format::ThreeMf));
    });
    fuzz("3mf-archive", 32, &[package(&models[0], relations)], rounds(30_000), |bytes| read_within(bytes, Some(Format::ThreeMf)));
}

#[test]
fn requests_are_answered_whatever_their_headers() {
    let scratch = Scratch::new();
    // Room for as many requests as this test makes.
    let service = Service::start_with(scratch.path(), &[("LACUNA_SUBMISSIONS_PER_MINUTE", "1000000"), ("LACUNA_HEADER_SECONDS", "2")]);
    let order = br#"{"lacuna":1,"kind":"measure","model":{"lacuna":1,"shape":{"family":"mesh","vertices":[[0,0,0],[1,0,0]],"faces":[[0,1]]}},"params":{"tolerance_mm":0.1}}"#;
    let done = service.post_with("/v1/jobs", &[("prefer", "wait=30")], order).json();
    let digest = done["outputs"][0]["digest"].as_str().unwrap();
    let id = done["id"].as_str().unwrap();
    let seeds: Vec<Vec<u8>> = [
        format!("GET /v1/results/{digest} HTTP/1.1\r\nhost: localhost\r\nrange: bytes=0-9\r\nif-range: \"{digest}\"\r\nif-none-match: W/\"a\", *\r\n"),
        format!("GET /v1/jobs/{id}/outputs/certificate.json?redirect=0 HTTP/1.1\r\nhost: localhost\r\nrange: bytes=-5\r\naccept: */*;q=0\r\n"),
        "GET /v1/jobs?state=succeeded&kind=measure&limit=2&cursor=job_1 HTTP/1.1\r\nhost: localhost\r\nx-request-id: a-b:c\r\n".to_owned(),
        format!("GET /v1/jobs/{id}/events HTTP/1.1\r\nhost: localhost\r\nlast-event-id: 3\r\n"),
        "POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\nprefer: wait=0, respond-async\r\nidempotency-key: k\r\ncontent-type: application/json\r\ncontent-length: 2\r\n".to_owned(),
        "POST /v1/models?format=off&name=a%20b HTTP/1.1\r\nhost: localhost\r\ncontent-type: model/stl\r\ncontent-disposition: attachment; filename=\"a.stl\"\r\ncontent-length: 2\r\n".to_owned(),
        "OPTIONS /v1/models HTTP/1.1\r\nhost: localhost\r\norigin: http://a\r\naccess-control-request-method: POST\r\n".to_owned(),
    ]
    .map(String::into_bytes)
    .into();
    let (mut random, mut answered) = (Random(40), 0);
    let cases = rounds(400);
    for case in 0..cases {
        let seed = &seeds[case % seeds.len()];
        let other = below(&mut random, seeds.len());
        let mut request = mutate(&mut random, seed, &seeds[other]);
        request.extend_from_slice(b"connection: close\r\n\r\n{}");
        let answer = service.raw(&request, Duration::from_secs(10));
        // Bytes that are no request are answered with nothing or a refusal; never with a failure of ours.
        if let Some(status) = answer.strip_prefix("HTTP/1.1 ") {
            answered += 1;
            assert!(!status.starts_with('5'), "case {case}: {:?} is answered with {answer}", String::from_utf8_lossy(&request));
        }
    }
    assert!(answered > cases / 4, "only {answered} of {cases} were answered at all");
    assert_eq!(service.get("/readyz").status, 200);
}
