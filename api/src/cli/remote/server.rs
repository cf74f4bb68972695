//! A service at an address: requests, and its refusals as problems.

use std::io::Read;
use std::time::Duration;

use serde::de::DeserializeOwned;
use ureq::http::{Method, Request, Response};
use ureq::{Agent, Body};

use crate::problem::{Problem, ProblemKind};
use crate::store::ModelView;

/// The variable that holds the key: a command line would show it to everybody on the machine.
const KEY: &str = "LACUNA_API_KEY";

/// Time to reach the service.
const CONNECT: Duration = Duration::from_secs(10);

/// Longest silence: event streams say something every 15 s, and the longest answer to wait for is a prediction.
const SILENCE: Duration = Duration::from_secs(60);

/// Longest answer that is held in memory: a job with a large certificate.
const ANSWER_BYTES: u64 = 256 << 20;

/// A service at an address.
#[derive(Clone, Debug)]
pub(in super::super) struct Server {
    base: String,
    key: Option<String>,
    agent: Agent,
}

impl Server {
    /// The service at an address, with the key of the environment.
    pub(in super::super) fn at(url: &str) -> Result<Self, Problem> {
        let usage = |detail: String| Problem::new(ProblemKind::Usage, detail);
        let base = url.trim().trim_end_matches('/');
        let address = base.strip_prefix("http://").or_else(|| base.strip_prefix("https://"));
        if address.is_none_or(str::is_empty) {
            return Err(usage(format!("{base:?} is no address of a service; http://HOST:PORT or https://HOST:PORT is expected")));
        }
        let key = std::env::var(KEY).ok().map(|key| key.trim().to_owned()).filter(|key| !key.is_empty());
        let config = Agent::config_builder()
            .tls_config(crate::trust::tls())
            .http_status_as_error(false)
            .max_redirects(0)
            .max_redirects_will_error(false)
            .timeout_connect(Some(CONNECT))
            .timeout_per_read(Some(SILENCE))
            .timeout_per_write(Some(SILENCE))
            .user_agent(concat!("lacuna/", env!("CARGO_PKG_VERSION")));
        Ok(Self { base: base.to_owned(), key, agent: config.build().into() })
    }

    /// Its address.
    pub(super) fn base(&self) -> &str {
        &self.base
    }

    /// Sends a request and gives the answer, whatever its status.
    pub(super) fn send(&self, method: Method, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Result<Response<Body>, Problem> {
        let mut request = Request::builder().method(&method).uri(format!("{}{path}", self.base));
        if let Some(key) = &self.key {
            request = request.header("authorization", format!("Bearer {key}"));
        }
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let unfit = |error: ureq::http::Error| Problem::new(ProblemKind::Usage, format!("{}: {error}", self.base));
        let answer = if method == Method::POST {
            self.agent.run(request.body(body).map_err(unfit)?)
        } else {
            self.agent.run(request.body(()).map_err(unfit)?)
        };
        answer.map_err(|error| self.unreachable(&error))
    }

    /// Sends a request that must succeed.
    pub(super) fn ask(&self, method: Method, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Result<Response<Body>, Problem> {
        let mut answer = self.send(method, path, headers, body)?;
        if answer.status().is_success() { Ok(answer) } else { Err(self.refusal(&mut answer)) }
    }

    /// Sends a request that is answered with JSON.
    pub(super) fn json<T: DeserializeOwned>(
        &self,
        method: Method,
        path: &str,
        headers: &[(&str, &str)],
        body: &[u8],
    ) -> Result<T, Problem> {
        let headers: Vec<_> = headers.iter().copied().chain([("content-type", "application/json")]).collect();
        let mut answer = self.ask(method, path, &headers, body)?;
        let bytes = self.bytes(&mut answer)?;
        serde_json::from_slice(&bytes).map_err(|error| self.strange(&format!("{path} answers with something else: {error}")))
    }

    /// Uploads a mesh file.
    pub(in super::super) fn upload(&self, bytes: &[u8]) -> Result<ModelView, Problem> {
        // Of no type: the service finds the format as this command would.
        let mut answer = self.ask(Method::POST, "/v1/models", &[("content-type", "application/octet-stream")], bytes)?;
        let bytes = self.bytes(&mut answer)?;
        serde_json::from_slice(&bytes).map_err(|error| self.strange(&format!("an upload is answered with something else: {error}")))
    }

    fn bytes(&self, answer: &mut Response<Body>) -> Result<Vec<u8>, Problem> {
        let read = answer.body_mut().with_config().limit(ANSWER_BYTES).read_to_vec();
        read.map_err(|error| self.unreachable(&error))
    }

    /// The problem that an answer carries; what is no problem document did not come from the service.
    pub(super) fn refusal(&self, answer: &mut Response<Body>) -> Problem {
        const SHOWN: u64 = 1 << 20;
        let status = answer.status();
        let mut body = Vec::new();
        let _ = answer.body_mut().as_reader().take(SHOWN).read_to_end(&mut body);
        serde_json::from_slice(&body).unwrap_or_else(|_| self.strange(&format!("it answers {status} without a problem document")))
    }

    fn unreachable(&self, error: &ureq::Error) -> Problem {
        let detail = format!("the service at {} cannot be reached: {error}; is it running, and is the address right?", self.base);
        Problem::new(ProblemKind::ServiceUnreachable, detail)
    }

    fn strange(&self, what: &str) -> Problem {
        Problem::new(ProblemKind::ServiceUnreachable, format!("{} is no lacuna service of this version: {what}", self.base))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn addresses_that_cannot_be_served_are_refused() {
        for bad in ["localhost:7878", "ftp://x", "http://", "https://", ""] {
            assert_eq!(Server::at(bad).unwrap_err().kind.exit_code(), 2, "{bad}");
        }
        assert_eq!(Server::at("http://127.0.0.1:7878/").unwrap().base(), "http://127.0.0.1:7878");
    }

    #[test]
    fn nobody_there_is_exit_code_5() {
        // Port 9 of this machine: nothing discards there any more.
        let server = Server::at("http://127.0.0.1:9").unwrap();
        let problem = server.json::<serde_json::Value>(Method::GET, "/version", &[], b"").unwrap_err();
        assert_eq!(problem.kind.exit_code(), 5, "{problem}");
    }
}
