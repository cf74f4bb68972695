//! Questions about models that a service answers at once.

use std::collections::BTreeMap;
use std::time::Instant;

use lacuna_exchange::document::Sought;
use lacuna_fabrication::{Certificate, Job, SolutionSpace};
use lacuna_kernel::attractor::Address;
use lacuna_kernel::budget::CancelToken;
use lacuna_kernel::model::Model;
use serde_json::{Value, json};
use ureq::http::Method;

use super::Server;
use crate::addresses::AddressAnswer;
use crate::cli::args::LimitArgs;
use crate::cli::stop;
use crate::documents::{self, Order, SolveReport};
use crate::problem::{Problem, ProblemKind};
use crate::verify::{Made, Performer, Solution};

/// A model as the member of a request.
fn member(model: &Model) -> Result<Value, Problem> {
    serde_json::from_str(&documents::model_document(model)).map_err(|error| Problem::internal(error.to_string()))
}

/// `lacuna solve`.
pub(in super::super) fn solve(server: &Server, model: &Model, values: &BTreeMap<String, f64>) -> Result<SolveReport, Problem> {
    let body = json!({ "model": member(model)?, "values": values }).to_string();
    let answer: Value = server.json(Method::POST, "/v1/solve", &[], body.as_bytes()).map_err(|problem| {
        // A value was chosen on the command line, not in a document.
        let of_value = problem.errors.first().is_some_and(|finding| finding.pointer.starts_with("/values/"));
        if of_value { Problem::new(ProblemKind::Usage, problem.detail).code(problem.code) } else { problem.of_model() }
    })?;
    let strange = |error: serde_json::Error| {
        Problem::new(ProblemKind::ServiceUnreachable, format!("{} answers with something else: {error}", server.base()))
    };
    let filled = documents::read_model(answer["model"].to_string().as_bytes())?;
    let space: SolutionSpace = serde_json::from_value(answer).map_err(strange)?;
    Ok(SolveReport { space, model: filled })
}

/// `lacuna address`.
pub(in super::super) fn address(server: &Server, model: &Model, sought: &Sought) -> Result<AddressAnswer, Problem> {
    let mut body = json!({ "model": member(model)? });
    match sought {
        Sought::At(address) => body["at"] = address.to_string().into(),
        Sought::Near { point_mm, within_mm, tolerance_mm, most } => {
            body["near"] = json!(point_mm);
            body["most"] = json!(most);
            for (name, length) in [("within_mm", within_mm), ("tolerance_mm", tolerance_mm)] {
                if let Some(length) = length {
                    body[name] = json!(length);
                }
            }
        }
    }
    server.json(Method::POST, "/v1/address", &[], body.to_string().as_bytes()).map_err(Problem::of_model)
}

/// A service that does what cases ask.
pub(in super::super) struct AtServer<'s> {
    server: &'s Server,
    token: CancelToken,
}

impl<'s> AtServer<'s> {
    /// Ctrl-C stops the case that is at work there.
    ///
    /// # Errors
    /// When the service is not there or does not know the key: no case has failed then.
    pub(in super::super) fn new(server: &'s Server) -> Result<Self, Problem> {
        let _: Value = server.json(Method::GET, "/v1/capabilities", &[], &[])?;
        let token = CancelToken::new();
        stop::on_signals(&token)?;
        Ok(Self { server, token })
    }
}

impl Performer for AtServer<'_> {
    fn certificate(&self, job: &Job) -> Result<Certificate, Problem> {
        // Limits are those of the service.
        let limits = LimitArgs::default();
        let document = super::posted(&Order::new(job.clone(), Vec::new()), &[], &limits)?;
        super::followed(self.server, &document, &self.token, None).and_then(super::certified).map_err(Problem::of_model)
    }

    fn made(&self, job: &Job) -> Result<Made, Problem> {
        let start = Instant::now();
        let limits = LimitArgs::default();
        let document = super::posted(&Order::new(job.clone(), Vec::new()), &job.outputs, &limits)?;
        let view = super::followed(self.server, &document, &self.token, None).map_err(Problem::of_model)?;
        let mut files = BTreeMap::new();
        for name in &job.outputs {
            files.insert(name.clone(), super::fetched(self.server, super::output(&view, name)?)?);
        }
        let seconds = (!view.reused).then(|| start.elapsed().as_secs_f64());
        Ok(Made { certificate: super::certified(view)?, files, seconds })
    }

    fn solution(&self, model: &Model, values: &BTreeMap<String, f64>) -> Result<Solution, Problem> {
        let report = solve(self.server, model, values)?;
        let space = serde_json::to_value(&report.space).map_err(|error| Problem::internal(error.to_string()))?;
        Ok(Solution { space, model: documents::model_file(&report.model) })
    }

    fn points(&self, model: &Model, addresses: &[Address]) -> Result<Vec<[f64; 3]>, Problem> {
        let missing = || Problem::new(ProblemKind::ServiceUnreachable, format!("{} tells no point", self.server.base()));
        let point = |found: &Address| Ok(address(self.server, model, &Sought::At(found.clone()))?.at.ok_or_else(missing)?.point_mm);
        addresses.iter().map(point).collect()
    }
}
