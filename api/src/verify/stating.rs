//! Writes the tables `[shape]`, `[digest]` and `[perf]` into a case, where whoever blesses it asks for them.

use std::fs;
use std::path::Path;

use lacuna_fabrication::{Job, Params};

use super::classes::{self, SHAPE_FORMAT};
use super::manifest::Manifest;
use super::performer::{Made, Performer};
use super::told;
use crate::digest::Digest;
use crate::files;
use crate::problem::Problem;

/// Which tables are wanted.
#[derive(Clone, Debug, Default)]
pub struct Wanted {
    /// `[shape]`, with the distance in mm that is allowed.
    pub shape_mm: Option<f64>,
    /// `[digest]`, of these formats by their endings.
    pub digests: Vec<String>,
    /// `[perf]`, with the budget in seconds.
    pub perf_seconds: Option<f64>,
}

/// The reference that is written, beside the case.
const REFERENCE: &str = "reference.stl";

/// How much of the distance that is allowed the reference takes, being as coarse as that.
const REFERENCE_SHARE: f64 = 0.25;

impl Wanted {
    /// The names of the tables that are wanted.
    pub(super) fn tables(&self) -> Vec<&'static str> {
        let wanted = [("shape", self.shape_mm.is_some()), ("digest", !self.digests.is_empty()), ("perf", self.perf_seconds.is_some())];
        wanted.into_iter().filter_map(|(name, is_wanted)| is_wanted.then_some(name)).collect()
    }

    /// A case without what is about to be written anew.
    pub(super) fn apart_from(&self, manifest: &Manifest) -> Manifest {
        let mut rest = manifest.clone();
        rest.shape = rest.shape.filter(|_| self.shape_mm.is_none());
        rest.digest = rest.digest.filter(|_| self.digests.is_empty());
        rest.perf = rest.perf.filter(|_| self.perf_seconds.is_none());
        rest
    }

    /// Writes them. What is refused, in words, if anything is; nothing has been written then.
    pub(super) fn write(
        &self,
        folder: &Path,
        manifest: &Manifest,
        job: &Job,
        reason: &str,
        performer: &dyn Performer,
    ) -> Result<Result<(), String>, Problem> {
        let shape_format = self.shape_mm.map(|_| SHAPE_FORMAT);
        let asked = classes::with_outputs(job, shape_format.into_iter().chain(self.digests.iter().map(String::as_str)));
        let made = match performer.made(&asked) {
            Ok(made) => made,
            Err(problem) => return Ok(Err(told(&problem))),
        };
        let version = &made.certificate.kernel_version;
        let source = format!("lacuna bless, kernel {version}, {}", crate::clock::now());
        let mut files: Vec<(String, Vec<u8>)> = Vec::new();
        let mut tables: Vec<(&str, String)> = Vec::new();
        if let Some(within_mm) = self.shape_mm {
            let (bytes, tolerance_mm) = match reference(job, within_mm, performer) {
                Ok(made) => made,
                Err(problem) => return Ok(Err(told(&problem))),
            };
            let source = format!("{source}, the same work at a tolerance of {tolerance_mm} mm");
            tables.push(("shape", table("shape", &[("reference", text(REFERENCE)), ("within_mm", number(within_mm))], &source, reason)));
            files.push((REFERENCE.to_owned(), bytes));
        }
        if !self.digests.is_empty() {
            let digest = |name: &String| made.files.get(name).map(|bytes| format!("{name} = {}", text(&Digest::of(bytes).to_string())));
            let digests: Vec<String> = self.digests.iter().filter_map(digest).collect();
            let members = [("kernel_version", text(version)), ("outputs", format!("{{{}}}", digests.join(", ")))];
            tables.push(("digest", table("digest", &members, &source, reason)));
        }
        if let Some(seconds) = self.perf_seconds {
            // Whether time decides is for the case to say, and stays as it is.
            let gating = manifest.perf.as_ref().is_some_and(|perf| perf.gating);
            let took = made.seconds.map_or_else(|| "from memory".to_owned(), |took| format!("{took:.3} s"));
            let members = [("seconds", number(seconds)), ("gating", gating.to_string())];
            tables.push(("perf", table("perf", &members, &format!("{source}, took {took}"), reason)));
        }
        let path = folder.join("expected.toml");
        let before = fs::read_to_string(&path).map_err(|error| Problem::io(path.display(), &error))?;
        let after = match with_tables(&before, &tables) {
            Ok(after) => after,
            Err(why) => return Ok(Err(why)),
        };
        if let Err(why) = holds(&after, files.first().map(|(_, bytes)| bytes), &made, performer) {
            return Ok(Err(why));
        }
        files.push(("expected.toml".to_owned(), after.into_bytes()));
        files::write_together(folder, &files).map_err(|error| Problem::io(folder.display(), &error))?;
        Ok(Ok(()))
    }
}

/// The same work, as coarse as the reference may be, and the tolerance.
fn reference(job: &Job, within_mm: f64, performer: &dyn Performer) -> Result<(Vec<u8>, f64), Problem> {
    let tolerance_mm = job.params.tolerance_mm.max(REFERENCE_SHARE * within_mm);
    let coarse = Job { params: Params { tolerance_mm, ..job.params.clone() }, ..classes::with_outputs(job, [SHAPE_FORMAT].into_iter()) };
    let mut made = performer.made(&coarse)?;
    let missing = || Problem::internal("a job has made no file of a format that was asked for");
    Ok((made.files.remove(SHAPE_FORMAT).ok_or_else(missing)?, tolerance_mm))
}

/// Whether a case with its new tables can be read, and its result is as near to the new reference as they say; else why not.
fn holds(text: &str, reference: Option<&Vec<u8>>, made: &Made, performer: &dyn Performer) -> Result<(), String> {
    let shape = Manifest::read(text, true)?.shape;
    let Some((shape, reference)) = shape.zip(reference) else { return Ok(()) };
    let row = classes::shape_row(&shape, Ok(reference.clone()), made, performer);
    if row.passed { Ok(()) } else { Err(format!("{} is {}, and {} is asked: allow more", row.field, row.got, row.expected)) }
}

fn text(words: &str) -> String {
    toml::Value::String(words.to_owned()).to_string()
}

fn number(value: f64) -> String {
    toml::Value::Float(value).to_string()
}

fn table(name: &str, members: &[(&str, String)], source: &str, reason: &str) -> String {
    let lines = members.iter().map(|(member, value)| format!("{member} = {value}\n"));
    format!("[{name}]\n{}source = {}\nreason = {}\n", lines.collect::<String>(), text(source), text(reason))
}

/// The text of a case with these tables in the place of those of their names, behind everything else, which stays as it is to the last letter.
fn with_tables(before: &str, tables: &[(&str, String)]) -> Result<String, String> {
    let is_of = |line: &str, name: &str| {
        let head = line.trim_start().strip_prefix('[').map(str::trim_start);
        head.and_then(|head| head.strip_prefix(name)).is_some_and(|rest| rest.trim_start().starts_with([']', '.']))
    };
    let mut after = String::new();
    let mut is_replaced = false;
    for line in before.lines() {
        if line.trim_start().starts_with('[') {
            is_replaced = tables.iter().any(|(name, _)| is_of(line, name));
        }
        if !is_replaced {
            after.push_str(line);
            after.push('\n');
        }
    }
    after.truncate(after.trim_end().len());
    after.push('\n');
    for (_, table) in tables {
        after.push('\n');
        after.push_str(table);
    }
    // What was cut out by lines is held against what is meant.
    let rest = |text: &str| -> Result<toml::Table, String> {
        let mut all: toml::Table = toml::from_str(text).map_err(|error| error.to_string())?;
        tables.iter().for_each(|(name, _)| drop(all.remove(*name)));
        Ok(all)
    };
    if rest(before)? == rest(&after)? {
        Ok(after)
    } else {
        Err("expected.toml cannot be changed by lines without changing more than the tables that are asked for; write them by hand".into())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn tables_are_put_behind_the_rest_or_in_the_place_of_their_like() {
        let before = "# why\nabout = \"x\"\n\n[perf]\nseconds = 1\n[perf.more]\na = 1\n\n[exact]\ngenus = 0 # none\n";
        let after = with_tables(before, &[("perf", "[perf]\nseconds = 2.0\n".into())]).unwrap();
        assert_eq!(after, "# why\nabout = \"x\"\n\n[exact]\ngenus = 0 # none\n\n[perf]\nseconds = 2.0\n");
        assert_eq!(with_tables(&after, &[("perf", "[perf]\nseconds = 2.0\n".into())]).unwrap(), after);
        // A line that only looks like a head.
        let tricky = "about = \"\"\"\n[perf]\n\"\"\"\nkind = \"measure\"\n";
        assert!(with_tables(tricky, &[("perf", "[perf]\nseconds = 2.0\n".into())]).is_err());
        assert!(with_tables("perf = {seconds = 1}\n", &[("perf", "[perf]\nseconds = 2.0\n".into())]).is_err());
    }

    #[test]
    fn words_of_any_kind_are_words_in_the_table() {
        let told = table("perf", &[("seconds", number(2.0))], "a", "say \"why\"\n[exact]");
        let read: toml::Table = toml::from_str(&told).unwrap();
        assert_eq!(read["perf"]["reason"].as_str(), Some("say \"why\"\n[exact]"));
        assert_eq!(read["perf"]["seconds"].as_float(), Some(2.0));
    }
}
