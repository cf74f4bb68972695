//! A collector of traces: OTLP over HTTP, in JSON.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use serde_json::Value;

/// Takes what is posted to it by any number of processes.
#[derive(Debug)]
pub struct Collector {
    /// Its address, as `LACUNA_TRACES_URL` has it.
    pub url: String,
    spans: Receiver<(i64, Value)>,
}

impl Collector {
    /// Starts one on a free port.
    ///
    /// # Panics
    /// When there is none.
    #[must_use]
    pub fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let (sender, spans) = channel();
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let sender = sender.clone();
                std::thread::spawn(move || take(stream.unwrap(), &sender));
            }
        });
        Self { url, spans }
    }

    /// Spans, each with the number of the process that told of it, until those that have come are enough.
    ///
    /// # Panics
    /// When no more come before.
    #[must_use]
    pub fn until(&self, enough: impl Fn(&[(i64, Value)]) -> bool) -> Vec<(i64, Value)> {
        let mut found = Vec::new();
        while !enough(&found) {
            found.push(self.spans.recv_timeout(Duration::from_secs(60)).unwrap_or_else(|_| panic!("not all spans came: {found:?}")));
        }
        found
    }
}

/// One connection may bring several documents.
fn take(stream: TcpStream, sender: &Sender<(i64, Value)>) {
    let mut stream = BufReader::new(stream);
    loop {
        let (mut head, mut length) = (String::new(), 0);
        while stream.read_line(&mut head).unwrap_or(0) > 2 {
            let line = head.lines().last().unwrap().to_ascii_lowercase();
            length = line.strip_prefix("content-length:").map_or(length, |value| value.trim().parse().unwrap());
        }
        if length == 0 {
            return;
        }
        assert!(head.starts_with("POST /v1/traces "), "{head}");
        let mut body = vec![0; length];
        stream.read_exact(&mut body).unwrap();
        stream.get_mut().write_all(b"HTTP/1.1 200 OK\r\ncontent-type: application/json\r\ncontent-length: 2\r\n\r\n{}").unwrap();
        let document: Value = serde_json::from_slice(&body).unwrap();
        let resource = &document["resourceSpans"][0];
        let attributes = resource["resource"]["attributes"].as_array().unwrap();
        let stated = |key: &str| &attributes.iter().find(|attribute| attribute["key"] == key).unwrap()["value"];
        assert_eq!(stated("service.name")["stringValue"], "lacuna");
        let process = stated("process.pid")["intValue"].as_str().unwrap().parse().unwrap();
        for span in resource["scopeSpans"][0]["spans"].as_array().unwrap() {
            // Whoever waited for spans may have had enough of them.
            let _ = sender.send((process, span.clone()));
        }
    }
}
