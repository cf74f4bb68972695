//! `Accept`: which of the representations that there are a caller prefers (RFC 9110, 12.5.1).

use std::cmp::Reverse;

use axum::http::{HeaderMap, header};
use lacuna_exchange::format::Format;

use crate::problem::{Problem, ProblemKind};

/// What a caller accepts. Without the header, or with an empty one, that is everything.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Accept(Vec<MediaRange>);

#[derive(Clone, Debug, PartialEq, Eq)]
struct MediaRange {
    name: String,
    /// In thousandths.
    quality: u16,
}

/// How much a representation is wanted: its quality, then the place in the header of what gives it. RFC 9110 leaves
/// equal qualities to the server, and many callers name first what they like best.
type Rating = (u16, Reverse<usize>);

impl Accept {
    /// Reads the header.
    ///
    /// # Errors
    /// When a quality is none.
    pub fn of(headers: &HeaderMap) -> Result<Self, Problem> {
        let mut ranges = Vec::new();
        for value in headers.get_all(header::ACCEPT) {
            let text = value.to_str().map_err(|_| bad("Accept has characters beyond ASCII"))?;
            for item in text.split(',').map(str::trim).filter(|item| !item.is_empty()) {
                ranges.push(MediaRange::read(item)?);
            }
        }
        Ok(Self(ranges))
    }

    /// The one of `there` that is wanted most, the first of equals; none if all are refused.
    #[must_use]
    pub fn preferred<'t, T: Copy>(&self, there: impl IntoIterator<Item = T>, media_type: impl Fn(T) -> &'t str) -> Option<T> {
        let rated = there.into_iter().filter_map(|one| Some((self.rating(media_type(one))?, one)));
        rated.reduce(|best, next| if next.0 > best.0 { next } else { best }).map(|(_, one)| one)
    }

    /// The rating of a media type; none if it is refused. The most exact of the ranges that it is in decides.
    fn rating(&self, media_type: &str) -> Option<Rating> {
        if self.0.is_empty() {
            return Some((1000, Reverse(0)));
        }
        let within = self.0.iter().enumerate().filter_map(|(place, range)| Some((range.exactness(media_type)?, place, range.quality)));
        let (_, place, quality) = within.reduce(|best, next| if next.0 > best.0 { next } else { best })?;
        (quality > 0).then_some((quality, Reverse(place)))
    }
}

/// An item of a header of preferences, as `Accept` and `Accept-Encoding` are (RFC 9110, 12.4.2).
pub(super) struct Weighted {
    /// What is preferred, in lower case.
    pub(super) name: String,
    /// How much, in thousandths, the finest that RFC 9110 knows; none when what is given is no number from 0 to 1.
    pub(super) quality: Option<u16>,
}

impl Weighted {
    /// Reads one item; all other parameters than `q` are passed over.
    pub(super) fn read(item: &str) -> Self {
        let mut parts = item.split(';').map(str::trim);
        let name = parts.next().unwrap_or_default().to_ascii_lowercase();
        let mut parameters = parts.filter_map(|part| part.split_once('='));
        let weight = parameters.find(|(name, _)| name.trim().eq_ignore_ascii_case("q"));
        let quality = weight.map_or(Some(1.0), |(_, value)| value.trim().parse::<f32>().ok());
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 1000")]
        let quality = quality.filter(|quality| (0.0..=1.0).contains(quality)).map(|quality| (quality * 1000.0).round() as u16);
        Self { name, quality }
    }
}

impl MediaRange {
    fn read(item: &str) -> Result<Self, Problem> {
        let Weighted { name, quality } = Weighted::read(item);
        let quality = quality.ok_or_else(|| {
            let shown: String = item.chars().take(80).collect();
            bad(format!("Accept has {shown:?}; its q is a number from 0 to 1"))
        })?;
        // A format has one name among those that it is known by; `*` alone is what old Java clients send for `*/*`.
        let known = Format::from_name(&name).filter(|_| name.contains('/')).map(|format| format.facts().media_type.to_owned());
        let name = known.unwrap_or(if name == "*" { "*/*".to_owned() } else { name });
        Ok(Self { name, quality })
    }

    /// How exactly the range says a media type; none if it is not in it.
    fn exactness(&self, media_type: &str) -> Option<u8> {
        let kind = self.name.strip_suffix("/*");
        let in_kind = |kind: &str| media_type.strip_prefix(kind).is_some_and(|rest| rest.starts_with('/'));
        match &*self.name {
            name if name == media_type => Some(3),
            "*/*" => Some(0),
            // Whoever takes any bytes takes these: so ask clients that are made from a description of binary answers.
            "application/octet-stream" => Some(1),
            _ => kind.is_some_and(in_kind).then_some(2),
        }
    }
}

fn bad(detail: impl Into<String>) -> Problem {
    Problem::new(ProblemKind::BadRequest, detail).code("bad-header")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Reads as many headers as there are lines.
    fn accept(values: &str) -> Result<Accept, Problem> {
        let mut headers = HeaderMap::new();
        for value in values.split('\n') {
            headers.append(header::ACCEPT, value.parse().unwrap());
        }
        Accept::of(&headers)
    }

    #[test]
    fn qualities_decide_then_the_caller_then_we() {
        let there = ["model/stl", "model/3mf", "image/png"];
        assert_eq!(Accept::of(&HeaderMap::new()).unwrap().preferred(there, |name| name), Some("model/stl"));
        for (values, expected) in [
            ("", Some("model/stl")),
            ("*/*", Some("model/stl")),
            ("*; q=.2", Some("model/stl")),
            ("model/3mf", Some("model/3mf")),
            ("Model/3MF; q=1", Some("model/3mf")),
            ("application/vnd.ms-package.3dmanufacturing-3dmodel+xml", Some("model/3mf")),
            ("model/stl;q=0.2, model/3mf;q=0.8", Some("model/3mf")),
            ("model/stl;q=0.2\nmodel/3mf;q=0.8", Some("model/3mf")),
            ("model/3mf, model/stl", Some("model/3mf")),
            ("model/obj, image/*;q=0.1", Some("image/png")),
            ("*/*, model/*;q=0.5", Some("image/png")),
            ("model/stl;q=0, model/*", Some("model/3mf")),
            ("model/stl;q=0, application/octet-stream", Some("model/3mf")),
            ("application/octet-stream, */*;q=0", Some("model/stl")),
            ("model/stl;version=1;q=0.1, model/3mf;q=0.2", Some("model/3mf")),
            ("model/stl;q=0.001, image/png;q=0", Some("model/stl")),
            ("*/*;q=0", None),
            ("model/obj, text/*", None),
            ("model", None),
            ("mod/*", None),
        ] {
            assert_eq!(accept(values).unwrap().preferred(there, |name| name), expected, "{values:?}");
        }
    }

    #[test]
    fn qualities_are_numbers_from_0_to_1() {
        for value in ["model/stl;q=2", "model/stl;q=-1", "model/stl;q=high", "model/stl;q=", "model/stl;q=nan", "*/*, a/b;q=inf"] {
            assert_eq!(accept(value).unwrap_err().code, "bad-header", "{value}");
        }
    }
}
