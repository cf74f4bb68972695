//! The Python and the TypeScript client: in step with the contract, and at work against the real service.

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::Command;

use lacuna_tests::support::python::system_python;
use lacuna_tests::support::root;
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::Service;
use serde_json::{Value, json};

#[test]
fn the_clients_are_those_of_the_contract() {
    let output = system_python().arg(root().join("api/clients/generate.py")).arg("--check").output().unwrap();
    let words = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{words}");
}

/// Bytes after which a connection to the proxy breaks off.
const CUT: usize = 12_000;

/// Stands before a service and breaks off every answer that is long.
fn cutting_proxy(service: SocketAddr) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        for client in listener.incoming().map_while(Result::ok) {
            let service = TcpStream::connect(service).unwrap();
            let (mut from_client, mut to_service) = (client.try_clone().unwrap(), service.try_clone().unwrap());
            std::thread::spawn(move || std::io::copy(&mut from_client, &mut to_service));
            std::thread::spawn(move || {
                let (mut client, mut service, mut left, mut buffer) = (client, service, CUT, [0_u8; 4096]);
                while let Ok(count @ 1..) = service.read(&mut buffer) {
                    let count = count.min(left);
                    left -= count;
                    if client.write_all(&buffer[..count]).is_err() || left == 0 {
                        break;
                    }
                }
                let _ = client.shutdown(std::net::Shutdown::Both);
                let _ = service.shutdown(std::net::Shutdown::Both);
            });
        }
    });
    address
}

/// What either client must have seen.
fn check(output: &std::process::Output) {
    let (stdout, stderr) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{stdout}{stderr}");
    let seen: Value = serde_json::from_str(&stdout).unwrap();
    for (member, expected) in [
        ("version", json!("lacuna")),
        ("same", json!(true)),
        ("state", json!("succeeded")),
        ("last", json!("done")),
        ("binary", json!([true, 206, true, "model/stl"])),
        ("resumed", json!(true)),
        ("absent", json!({ "status": 404, "code": "not-found", "pointers": [] })),
        ("upload", json!(["triangle", 3])),
        ("failed", json!({ "status": 422, "code": "format.cannot-carry", "pointers": [] })),
        ("forgotten", json!(404)),
        ("page", json!(1)),
    ] {
        assert_eq!(seen[member], expected, "{member}: {seen}");
    }
    let words = seen["events"].to_string() + &seen["invalid"].to_string();
    for word in ["\"done\"", "\"output\"", "\"state\"", "/colour", "/params/tolerance_mm", "422"] {
        assert!(words.contains(word), "{words} does not name {word}");
    }
}

#[test]
fn the_python_client_at_work() {
    let scratch = Scratch::new();
    let service = Service::start(&scratch.join("data"));
    let mut session = system_python();
    session
        .arg(root().join("tests/clients/session.py"))
        .env("PYTHONPATH", root().join("api/clients/python"))
        .env("PYTHONDONTWRITEBYTECODE", "1");
    session.env_remove("LACUNA_API_KEY").arg(format!("http://{}", service.address));
    session.arg(format!("http://{}", cutting_proxy(service.address))).arg(scratch.path());
    check(&session.output().unwrap());
}

#[test]
fn the_typescript_client_at_work() {
    // Everything that it needs has been in Node since version 20.
    let version = Command::new("node").arg("--version").output().ok().filter(|output| output.status.success());
    let version = version.map(|output| String::from_utf8_lossy(&output.stdout).trim().trim_start_matches('v').to_owned());
    let major = version.as_deref().and_then(|version| version.split('.').next()?.parse::<u32>().ok());
    if major.is_none_or(|major| major < 20) {
        eprintln!("the TypeScript client is left out: it needs node 20 or newer, and there is {}", version.as_deref().unwrap_or("none"));
        return;
    }
    let scratch = Scratch::new();
    let service = Service::start(&scratch.join("data"));
    let mut session = Command::new("node");
    session.arg(root().join("tests/clients/session.mjs")).arg(root().join("api/clients/typescript/index.js"));
    session.arg(format!("http://{}", service.address)).arg(format!("http://{}", cutting_proxy(service.address)));
    check(&session.output().unwrap());
}
