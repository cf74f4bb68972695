//! What is seen from beyond the service: the command line over TLS, the second address for whoever looks after it, and traces at a collector.

use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::process::{Child, Command, Stdio};

use lacuna_tests::support::binary::lacuna;
use lacuna_tests::support::cases;
use lacuna_tests::support::collector::Collector;
use lacuna_tests::support::python::system_python;
use lacuna_tests::support::scratch::Scratch;
use lacuna_tests::support::service::Service;
use serde_json::{Value, json};

/// Adds TLS to a service, as a proxy in front of it does.
const PROXY: &str = "import socket, ssl, sys, threading
context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
context.load_cert_chain(sys.argv[1], sys.argv[2])
listener = socket.create_server(('127.0.0.1', 0))
print(listener.getsockname()[1], flush=True)
def copy(source, target):
    try:
        while data := source.recv(65536):
            target.sendall(data)
        target.shutdown(socket.SHUT_WR)
    except OSError:
        pass
def serve(plain):
    try:
        client = context.wrap_socket(plain, server_side=True)
    except OSError:
        return
    service = socket.create_connection(('127.0.0.1', int(sys.argv[3])))
    threading.Thread(target=copy, args=(client, service), daemon=True).start()
    copy(service, client)
    client.close()
while True:
    threading.Thread(target=serve, args=(listener.accept()[0],), daemon=True).start()
";

struct Proxy(Child);

impl Drop for Proxy {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn the_command_line_speaks_tls_to_whom_the_machine_trusts() {
    let scratch = Scratch::new();
    let (key, certificate) = (scratch.join("key.pem"), scratch.join("certificate.pem"));
    let made = Command::new("openssl")
        .args(["req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2", "-subj", "/CN=lacuna"])
        .args(["-addext", "subjectAltName=IP:127.0.0.1", "-addext", "basicConstraints=critical,CA:FALSE"])
        .arg("-keyout")
        .arg(&key)
        .arg("-out")
        .arg(&certificate)
        .stderr(Stdio::null())
        .status();
    if !made.is_ok_and(|status| status.success()) {
        eprintln!("left out: openssl, which makes the certificate, is not there");
        return;
    }
    let service = Service::start(&scratch.join("data"));
    let mut child = system_python()
        .args(["-c", PROXY])
        .args([&certificate, &key])
        .arg(service.address.port().to_string())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut port = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut port).unwrap();
    let _proxy = Proxy(child);
    let server = format!("https://127.0.0.1:{}", port.trim());
    let measured = |trusted: bool| {
        let mut command = Command::new(lacuna());
        command.env_remove("LACUNA_SERVER").env_remove("SSL_CERT_DIR").env("SSL_CERT_FILE", "/dev/null");
        if trusted {
            command.env("SSL_CERT_FILE", &certificate);
        }
        command.args(["--server", &server, "measure", "--tolerance", "0.1"]).arg(cases::named("meshes/segment").model()).output().unwrap()
    };
    let done = measured(true);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    assert_eq!(service.get("/v1/jobs").json()["items"].as_array().unwrap().len(), 1);
    // Nobody vouches for it: nothing is sent, and the exit code is that of a service that cannot be reached.
    let refused = measured(false);
    assert_eq!(refused.status.code(), Some(5), "{}", String::from_utf8_lossy(&refused.stderr));
    assert!(String::from_utf8_lossy(&refused.stderr).contains(&server));
    assert_eq!(service.get("/v1/jobs").json()["items"].as_array().unwrap().len(), 1);
}

#[test]
fn a_trace_leads_from_the_caller_to_the_phases_of_a_job() {
    let collector = Collector::start();
    let scratch = Scratch::new();
    let service = Service::start_with(scratch.path(), &[("LACUNA_TRACES_URL", &collector.url)]);
    let model: Value = serde_json::from_slice(&std::fs::read(cases::named("meshes/segment").model()).unwrap()).unwrap();
    let order = json!({ "lacuna": 1, "kind": "solidify", "model": model, "params": { "tolerance_mm": 0.05, "radius_mm": 1.0 } });
    let parent = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";
    let answer = service.post_with("/v1/jobs", &[("traceparent", parent), ("prefer", "wait=30")], order.to_string().as_bytes());
    assert_eq!(answer.json()["state"], "succeeded", "{}", answer.json());
    let names = ["POST /v1/jobs", "job solidify", "dilate", "write"];
    let found = collector.until(|found| names.iter().all(|name| found.iter().any(|(_, span)| span["name"] == *name)));
    let named = |name: &str| &found.iter().find(|(_, span)| span["name"] == name).unwrap().1;
    let (request, job, phase) = (named("POST /v1/jobs"), named("job solidify"), named("dilate"));
    for span in [request, job, phase] {
        assert_eq!(span["traceId"], "4bf92f3577b34da6a3ce929d0e0e4736", "{span}");
        let time = |member: &str| span[member].as_str().unwrap().parse::<u128>().unwrap();
        assert!(time("startTimeUnixNano") <= time("endTimeUnixNano"), "{span}");
    }
    assert_eq!(request["parentSpanId"], "00f067aa0ba902b7");
    assert_eq!((&job["parentSpanId"], &phase["parentSpanId"]), (&request["spanId"], &job["spanId"]));
    assert!(job["attributes"].to_string().contains(answer.json()["id"].as_str().unwrap()));
    assert!(
        request["attributes"].as_array().unwrap().contains(&json!({ "key": "http.response.status_code", "value": { "intValue": "200" } }))
    );
    // A collector that is away costs a line in the log and nothing else.
    let away = Scratch::new();
    let service = Service::start_with(away.path(), &[("LACUNA_TRACES_URL", "http://127.0.0.1:9")]);
    assert_eq!(service.done(&order)["state"], "succeeded");
}

#[test]
fn metrics_have_an_address_of_their_own() {
    let scratch = Scratch::new();
    // A port that was free a moment ago.
    let place = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let environment = [("LACUNA_METRICS_BIND", place.as_str()), ("LACUNA_API_KEYS", "secret")];
    let service = Service::start_with(scratch.path(), &environment);
    let get = |path: &str| {
        let settings = ureq::Agent::config_builder().http_status_as_error(false).build();
        let mut answer = ureq::Agent::new_with_config(settings).get(format!("http://{place}{path}")).call().unwrap();
        (answer.status().as_u16(), answer.body_mut().read_to_string().unwrap())
    };
    // Here without a key, there with one; and nothing else is here.
    assert_eq!(service.get("/metrics").status, 401);
    let (status, metrics) = get("/metrics");
    assert!(status == 200 && metrics.contains("lacuna_workers 2"), "{status}: {metrics}");
    for path in ["/livez", "/readyz", "/version"] {
        assert_eq!(get(path).0, 200, "{path}");
    }
    for path in ["/v1/jobs", "/v1/openapi.json", "/docs"] {
        assert_eq!(get(path).0, 404, "{path}");
    }
    let doctor = Command::new(lacuna()).arg("doctor").env("LACUNA_METRICS_BIND", &place).output().unwrap();
    let told: Value = serde_json::from_slice(&doctor.stdout).unwrap();
    let setting = told["settings"].as_array().unwrap().iter().find(|setting| setting["name"] == "LACUNA_METRICS_BIND").unwrap();
    assert_eq!((setting["value"].as_str(), setting["origin"].as_str()), (Some(place.as_str()), Some("environment")));
}
