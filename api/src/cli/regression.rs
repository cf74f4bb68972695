//! Commands that compare results with what they should be: `verify`, `bless` and `diff`.

use std::fmt::Write as _;
use std::path::Path;

use lacuna_exchange::format::ReadLimits;
use lacuna_fabrication::{Input, Job, JobKind, Params};
use lacuna_kernel::budget::Limits;
use serde_json::{Value, json};

use super::args::{BlessArgs, DiffArgs, VerifyArgs};
use super::remote::questions::AtServer;
use super::work::{Manner, is_mesh_file};
use super::{DOCUMENT_BYTES, print, print_json, read_input};
use crate::digest::Digest;
use crate::problem::{Problem, ProblemKind};
use crate::verify::difference::{self, Difference, Verdict};
use crate::verify::{self, Here, Performer, Wanted};
use crate::{documents, files};

/// The Hausdorff distance of two meshes is found to this share of what it may be.
const DISTANCE_SHARE: f64 = 0.02;

/// Does something where the command line says.
fn at_work<T>(manner: Manner<'_>, work: impl FnOnce(&dyn Performer) -> Result<T, Problem>) -> Result<T, Problem> {
    match manner.server {
        Some(server) => work(&AtServer::new(server)?),
        None => work(&Here),
    }
}

/// `lacuna verify`.
pub(super) fn verify(args: &VerifyArgs, manner: Manner<'_>) -> Result<(), Problem> {
    let report = at_work(manner, |performer| verify::verify(&args.folder, args.filter.as_deref(), performer))?;
    if let Some(path) = &args.junit {
        files::write_whole(path, report.junit().as_bytes()).map_err(|error| Problem::io(path.display(), &error))?;
    }
    if args.json {
        print_json(&report)?;
    } else {
        print(report.table(manner.quiet).as_bytes())?;
    }
    let failed = report.cases.iter().filter(|case| !case.passed).count();
    if failed == 0 {
        Ok(())
    } else {
        Err(Problem::new(ProblemKind::CheckFailed, format!("{failed} of {} cases failed", report.cases.len())))
    }
}

/// `lacuna bless`. It never succeeds: whoever has just written what is expected has verified nothing.
pub(super) fn bless(args: &BlessArgs, manner: Manner<'_>) -> Result<(), Problem> {
    let wanted = Wanted { shape_mm: args.shape, digests: args.digest.clone(), perf_seconds: args.perf };
    for name in &wanted.digests {
        documents::format(name).map_err(|problem| Problem { kind: ProblemKind::Usage, ..problem })?;
    }
    let cases = at_work(manner, |performer| verify::bless(&args.folder, args.filter.as_deref(), &args.reason, &wanted, performer))?;
    if args.json {
        print_json(&json!({ "cases": cases }))?;
    } else {
        let mut text = String::new();
        for case in &cases {
            match (&case.refused, &case.differences) {
                (Some(why), _) => {
                    let _ = writeln!(text, "NOT BLESSED  {}: {why}", case.case);
                }
                (None, None) => {
                    let _ = writeln!(text, "blessed      {}, for the first time", case.case);
                }
                (None, Some(differences)) => {
                    let _ = write!(text, "blessed      {}\n{}", case.case, difference::table(differences));
                }
            }
            if !case.stated.is_empty() {
                let tables: Vec<String> = case.stated.iter().map(|name| format!("[{name}]")).collect();
                let _ = writeln!(text, "             {} written into expected.toml", tables.join(", "));
            }
        }
        print(text.as_bytes())?;
    }
    let refused = cases.iter().filter(|case| case.refused.is_some()).count();
    let detail = format!(
        "{} of {} cases were blessed; a blessing is no verification: look at what changed, keep it with the cases, and run `lacuna verify`",
        cases.len() - refused,
        cases.len()
    );
    Err(Problem::new(ProblemKind::CheckFailed, detail).code("blessed"))
}

/// `lacuna diff`.
pub(super) fn diff(args: &DiffArgs, manner: Manner<'_>) -> Result<(), Problem> {
    let (first, second) = (Subject::read(&args.first)?, Subject::read(&args.second)?);
    let differences = match (&first, &second, args.within) {
        (Subject::Statement(first), Subject::Statement(second), None) => difference::differences(first, second),
        (Subject::Mesh(first), Subject::Mesh(second), within) => meshes(first, second, within, manner)?,
        (Subject::Statement(_), Subject::Statement(_), Some(_)) => {
            let detail = "--within is for mesh files: of certificates the bounds say how far they may be apart";
            return Err(Problem::new(ProblemKind::Usage, detail));
        }
        _ => {
            let detail =
                format!("{} and {} are a certificate and a mesh file; name two of a kind", args.first.display(), args.second.display());
            return Err(Problem::new(ProblemKind::Usage, detail));
        }
    };
    let apart = differences.iter().filter(|difference| difference.verdict == Verdict::Apart).count();
    if args.json {
        print_json(&json!({ "apart": apart, "differences": differences }))?;
    } else {
        print(difference::table(&differences).as_bytes())?;
    }
    if apart == 0 {
        return Ok(());
    }
    Err(Problem::new(ProblemKind::CheckFailed, format!("{apart} members cannot be true of one shape")))
}

/// What is compared.
enum Subject {
    /// A certificate.
    Statement(Value),
    /// A mesh file.
    Mesh(Vec<u8>),
}

impl Subject {
    /// A certificate, by itself or in what `lacuna run`, a service or a blessing tells; or a mesh file.
    fn read(path: &Path) -> Result<Self, Problem> {
        let bytes = read_input(path, DOCUMENT_BYTES.max(ReadLimits::default().file_bytes))?;
        if is_mesh_file(path, &bytes) {
            return Ok(Self::Mesh(bytes));
        }
        let unfit = |why: String| {
            Problem::new(ProblemKind::InvalidFile, format!("{} is neither a certificate nor a mesh file: {why}", path.display()))
                .code("diff.unfit")
        };
        let mut value: Value = serde_json::from_slice(&bytes).map_err(|error| unfit(error.to_string()))?;
        let statement = value.get_mut("certificate").map(Value::take).unwrap_or(value);
        let tells = |name: &str| statement.get(name).is_some();
        if tells("requested_tolerance_mm") && tells("bbox_mm") {
            return Ok(Self::Statement(statement));
        }
        Err(unfit("it states no requested_tolerance_mm and no bbox_mm".to_owned()))
    }
}

/// The same bytes, or surfaces that are nowhere farther apart than they may be.
fn meshes(first: &[u8], second: &[u8], within: Option<f64>, manner: Manner<'_>) -> Result<Vec<Difference>, Problem> {
    let digests = [first, second].map(|bytes| Value::from(Digest::of(bytes).to_string()));
    let same = digests[0] == digests[1];
    let [one, other] = digests;
    let verdict = if same { Verdict::Same } else { Verdict::Told };
    let bytes = Difference { field: "digest".to_owned(), unit: None, first: one, second: other, difference: None, allowed: None, verdict };
    if same {
        return Ok(vec![bytes]);
    }
    let Some(within) = within else {
        let detail = "the files differ; say with --within MM how far apart their surfaces may be";
        return Err(Problem::new(ProblemKind::Usage, detail).code("diff.within"));
    };
    let limits = ReadLimits::default();
    let input = |name: &str, bytes: &[u8]| {
        let model = documents::mesh_model(bytes, None, &limits)?;
        Ok::<_, Problem>(Input { name: name.to_owned(), model, radius_mm: None })
    };
    let job = Job {
        kind: JobKind::Measure,
        inputs: vec![input("first", first)?, input("second", second)?],
        params: Params::new(within * DISTANCE_SHARE),
        outputs: Vec::new(),
        limits: Limits::default(),
    };
    let certificate = at_work(manner, |performer| performer.certificate(&job))?;
    let found = certificate.hausdorff.ok_or_else(|| Problem::internal("a comparison of two shapes without their distance"))?;
    let row = |field: &str, [low, high]: [f64; 2], judged: bool| Difference {
        field: field.to_owned(),
        unit: Some("mm"),
        first: Value::Null,
        second: json!([low, high]),
        difference: Some(high),
        allowed: judged.then_some(within),
        // Only what is proven to be near is near.
        verdict: match judged {
            true if high > within => Verdict::Apart,
            true => Verdict::Within,
            false => Verdict::Told,
        },
    };
    Ok(vec![
        row("hausdorff_mm", found.distance_mm, true),
        bytes,
        row("from_first_mm", found.from_first.distance_mm, false),
        row("from_second_mm", found.from_second.distance_mm, false),
    ])
}
