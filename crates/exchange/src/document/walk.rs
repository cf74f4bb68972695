//! Takes a [`Node`] tree apart: typed values out, faults into the report, and never a stop at the first.
//!
//! Every function returns `None` when it has reported something, so that a caller can go on with the
//! other members and only build its value when all of them are there.

use super::grammar::{Member, Object};
use super::node::{Node, Path, Place, Value, number_text, quoted};
use super::report::Report;
use super::units::Unit;
use super::{DocumentLimits, MeshFinder};
use crate::diagnostic::code;

/// Characters that a name of a model, a state or a parameter may have.
const NAME_LENGTH: usize = 256;

/// The largest integer up to which every integer is a double: indices and counts stay below.
const LARGEST_INTEGER: f64 = 9_007_199_254_740_992.0;

/// State of a walk through one document.
pub(super) struct Walker<'w> {
    pub(super) report: Report,
    pub(super) limits: &'w DocumentLimits,
    pub(super) unit: Unit,
    pub(super) states: usize,
    pub(super) transitions: usize,
    /// Where meshes are found that the document names; nowhere for documents without a folder.
    pub(super) files: Option<MeshFinder<'w>>,
}

/// The members of an object that its grammar knows.
pub(super) struct Members<'p> {
    pub(super) place: Place<'p>,
    entries: &'p [(std::borrow::Cow<'p, str>, Node<'p>)],
}

impl<'p> Members<'p> {
    /// The member of this name.
    pub(super) fn get<'s>(&'s self, name: &str) -> Option<Place<'s>> {
        let (key, node) = self.entries.iter().find(|(key, _)| key == name)?;
        Some(Place { node, path: self.place.path.member(key) })
    }

    /// Whether the member is there.
    pub(super) fn has(&self, name: &str) -> bool {
        self.get(name).is_some()
    }
}

impl<'w> Walker<'w> {
    pub(super) fn new(limits: &'w DocumentLimits, report: Report) -> Self {
        Self { report, limits, unit: Unit::Millimetre, states: 0, transitions: 0, files: None }
    }

    /// Reports a fault at a value.
    pub(super) fn fault(&mut self, place: &Place<'_>, code: &'static str, message: impl FnOnce() -> String) {
        self.report.add(&place.path, place.node.offset, code, message);
    }

    /// Reports a value of the wrong type, unless the parser has already reported it.
    pub(super) fn wrong_type<T>(&mut self, place: &Place<'_>, expected: &str) -> Option<T> {
        if !matches!(place.node.value, Value::Reported) {
            self.fault(place, code::WRONG_TYPE, || format!("is {}; expected {expected}", place.node.describe()));
        }
        None
    }

    /// An object with the members of `grammar`: unknown and missing members are reported, and the
    /// known ones can be read in either case.
    pub(super) fn object<'p>(&mut self, place: Place<'p>, grammar: &Object) -> Option<Members<'p>> {
        self.object_of(place, grammar, &[])
    }

    /// As [`Self::object`], with members that the context adds.
    pub(super) fn object_of<'p>(&mut self, place: Place<'p>, grammar: &Object, added: &[Member]) -> Option<Members<'p>> {
        let Value::Object(entries) = &place.node.value else {
            return self.wrong_type(&place, &format!("an object ({})", grammar.title));
        };
        let known = || grammar.members.iter().chain(added);
        for (name, node) in entries {
            if !known().any(|member| member.name == name) {
                let names = known().map(|member| member.name);
                self.report.add(&place.path.member(name), node.offset, code::UNKNOWN_MEMBER, || {
                    format!("{} is not a member of {}; {}", quoted(name), grammar.title, suggestion(name, names))
                });
            }
        }
        for member in known().filter(|member| member.required) {
            if !entries.iter().any(|(name, _)| name == member.name) {
                self.fault(&place, code::MISSING_MEMBER, || {
                    format!("{} needs the member \"{}\": {}", grammar.title, member.name, member.about)
                });
            }
        }
        Some(Members { place, entries })
    }

    /// Applies `read` to every element of an array.
    pub(super) fn each<T>(
        &mut self,
        place: Place<'_>,
        expected: &str,
        mut read: impl FnMut(&mut Self, Place<'_>) -> Option<T>,
    ) -> Option<Vec<T>> {
        let path = place.path;
        let mut elements = Vec::new();
        let mut complete = true;
        let mut take = |element: Option<T>| match element {
            // why: after a fault nothing is built any more, so nothing is kept either
            Some(element) if complete => elements.push(element),
            Some(_) => {}
            None => complete = false,
        };
        match &place.node.value {
            Value::Array(nodes) => {
                for (index, node) in nodes.iter().enumerate() {
                    take(read(self, Place { node, path: path.index(index) }));
                }
            }
            Value::Numbers(numbers) => {
                for (index, &number) in numbers.iter().enumerate() {
                    let node = Node { offset: place.node.offset, value: Value::Number(number) };
                    take(read(self, Place { node: &node, path: path.index(index) }));
                }
            }
            _ => return self.wrong_type(&place, expected),
        }
        complete.then_some(elements)
    }

    /// As [`Self::each`], with a least number of elements.
    pub(super) fn each_of<T>(
        &mut self,
        place: Place<'_>,
        least: usize,
        expected: &str,
        read: impl FnMut(&mut Self, Place<'_>) -> Option<T>,
    ) -> Option<Vec<T>> {
        let elements = self.each(place, expected, read);
        match length(place.node) {
            Some(found) if found < least => {
                self.fault(&place, code::TOO_FEW, || format!("is {}; expected {expected}, {least} or more", place.node.describe()));
                None
            }
            _ => elements,
        }
    }

    /// A list of exactly N finite numbers.
    pub(super) fn numbers<const N: usize>(&mut self, place: Place<'_>, expected: &str) -> Option<[f64; N]> {
        if let Value::Numbers(numbers) = &place.node.value
            && let Ok(numbers) = <[f64; N]>::try_from(&**numbers)
        {
            return Some(numbers);
        }
        let elements = self.each(place, expected, |walker, element| walker.number(element));
        match length(place.node) {
            Some(found) if found != N => self.wrong_length(&place, found, expected),
            _ => elements?.try_into().ok(),
        }
    }

    /// Reports an array of the wrong length.
    pub(super) fn wrong_length<T>(&mut self, place: &Place<'_>, found: usize, expected: &str) -> Option<T> {
        self.fault(place, code::WRONG_LENGTH, || format!("has {found} elements; expected {expected}"));
        None
    }

    /// A finite number.
    pub(super) fn number(&mut self, place: Place<'_>) -> Option<f64> {
        match &place.node.value {
            Value::Number(number) => Some(*number),
            Value::Text(_) | Value::Unescaped(_) if reads_as_number(place.node.text()) => {
                self.fault(&place, code::NUMBER_AS_STRING, || {
                    format!("is {}; expected a number: remove the quotes", place.node.describe())
                });
                None
            }
            _ => self.wrong_type(&place, "a number"),
        }
    }

    /// A positive finite number.
    pub(super) fn positive(&mut self, place: Place<'_>, meaning: &str) -> Option<f64> {
        let number = self.number(place)?;
        if number > 0.0 {
            return Some(number);
        }
        self.fault(&place, code::NOT_POSITIVE, || format!("is {}; expected {meaning} above zero", number_text(number)));
        None
    }

    /// A non-negative integer.
    pub(super) fn integer(&mut self, place: Place<'_>, meaning: &str) -> Option<u64> {
        let number = self.number(place)?;
        if number >= 0.0 && number.fract() == 0.0 && number <= LARGEST_INTEGER {
            // why: checked just above, so nothing is lost
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            return Some(number as u64);
        }
        self.fault(&place, code::NOT_AN_INDEX, || format!("is {}; expected {meaning}: an integer, zero or above", number_text(number)));
        None
    }

    /// An index below `length`.
    pub(super) fn index(&mut self, place: Place<'_>, length: usize, meaning: &str) -> Option<usize> {
        let index = self.integer(place, meaning)?;
        self.in_range(&place.path, place.node.offset, index, length, meaning)
    }

    /// Reports an index that is not below `length`.
    pub(super) fn in_range(&mut self, path: &Path<'_>, offset: u32, index: u64, length: usize, meaning: &str) -> Option<usize> {
        match usize::try_from(index) {
            Ok(index) if index < length => Some(index),
            _ => {
                self.report.add(path, offset, code::INDEX_OUT_OF_RANGE, || match length {
                    0 => format!("is {index}; there is no {meaning} to point to"),
                    1 => format!("is {index}; there is one {meaning}, so the only index is 0"),
                    _ => format!("is {index}; there are {length}, so the index of a {meaning} is 0 to {}", length - 1),
                });
                None
            }
        }
    }

    /// Two non-negative integers.
    pub(super) fn index_pair(&mut self, place: Place<'_>, expected: &str) -> Option<(u64, u64)> {
        let pair = self.each(place, expected, |walker, element| walker.integer(element, expected));
        match (length(place.node), pair.as_deref()) {
            (Some(found), _) if found != 2 => self.wrong_length(&place, found, expected),
            (_, Some(&[one, other])) => Some((one, other)),
            _ => None,
        }
    }

    /// True or false.
    pub(super) fn flag(&mut self, place: Place<'_>) -> Option<bool> {
        match place.node.value {
            Value::Flag(flag) => Some(flag),
            _ => self.wrong_type(&place, "true or false"),
        }
    }

    /// A string.
    pub(super) fn text<'p>(&mut self, place: Place<'p>, expected: &str) -> Option<&'p str> {
        match place.node.text() {
            Some(text) => Some(text),
            None => self.wrong_type(&place, expected),
        }
    }

    /// A name: some characters, not too many, none of them a control character.
    pub(super) fn name(&mut self, place: Place<'_>, meaning: &str) -> Option<String> {
        let text = self.text(place, meaning)?;
        if text.is_empty() || text.chars().any(char::is_control) || text.chars().nth(NAME_LENGTH).is_some() {
            self.fault(&place, code::BAD_NAME, || {
                format!("{} cannot be {meaning}; expected 1 to {NAME_LENGTH} characters without control characters", quoted(text))
            });
            return None;
        }
        Some(text.to_owned())
    }

    /// A length in the document's unit, as mm.
    pub(super) fn millimetres(&mut self, place: &Place<'_>, length: f64) -> Option<f64> {
        let millimetres = self.unit.to_mm(length);
        if millimetres.is_finite() {
            return Some(millimetres);
        }
        let unit = self.unit.symbol();
        self.fault(place, code::NOT_FINITE, || format!("{} {unit} has no finite value in mm; use a smaller length", number_text(length)));
        None
    }

    /// One of the words allowed.
    pub(super) fn word<T: Copy>(&mut self, place: Place<'_>, meaning: &str, words: &[(&str, T)]) -> Option<T> {
        let text = self.text(place, meaning)?;
        if let Some((_, value)) = words.iter().find(|(word, _)| *word == text) {
            return Some(*value);
        }
        let names = words.iter().map(|(word, _)| *word);
        self.fault(&place, code::UNKNOWN_VALUE, || format!("{} is not {meaning}; {}", quoted(text), suggestion(text, names)));
        None
    }

    /// Counts transitions of the model towards the limit; the fault is reported once.
    pub(super) fn count_transitions(&mut self, place: &Place<'_>, more: usize) {
        let allowed = self.limits.transitions;
        let was_within = self.transitions <= allowed;
        self.transitions = self.transitions.saturating_add(more);
        if was_within && self.transitions > allowed {
            let total = self.transitions;
            self.fault(place, code::TOO_MANY_TRANSITIONS, || format!("the model has {total} transitions or more; {allowed} are allowed"));
        }
    }

    /// Counts states of the model towards the limit; the fault is reported once.
    pub(super) fn count_states(&mut self, place: &Place<'_>, more: usize) {
        let allowed = self.limits.states;
        let was_within = self.states <= allowed;
        self.states = self.states.saturating_add(more);
        if was_within && self.states > allowed {
            let total = self.states;
            self.fault(place, code::TOO_MANY_STATES, || format!("the model has {total} states or more; {allowed} are allowed"));
        }
    }
}

/// The document's root.
pub(super) fn root<'p>(node: &'p Node<'p>) -> Place<'p> {
    Place { node, path: Path::ROOT }
}

/// Number of elements, if it is an array.
pub(super) fn length(node: &Node<'_>) -> Option<usize> {
    match &node.value {
        Value::Array(nodes) => Some(nodes.len()),
        Value::Numbers(numbers) => Some(numbers.len()),
        _ => None,
    }
}

/// Whether a string holds a number, in any spelling that people and programs use.
pub(super) fn reads_as_number(text: Option<&str>) -> bool {
    text.is_some_and(|text| text.len() <= 400 && text.trim().replace(',', ".").parse::<f64>().is_ok())
}

/// `did you mean "x"?` when a name is near, else the list of names.
pub(super) fn suggestion<'n>(found: &str, names: impl Iterator<Item = &'n str>) -> String {
    // why: a bound on the work, not on what is legal
    let names: Vec<&str> = names.take(1000).collect();
    let nearest = names.iter().map(|name| (edits(found, name), *name)).min();
    match nearest {
        Some((distance, name)) if distance < name.len() && distance <= 1 + name.len() / 4 => format!("did you mean \"{name}\"?"),
        _ if names.is_empty() => "no name is known here".into(),
        _ => {
            let listed: Vec<String> = names.iter().take(24).map(|name| quoted(name)).collect();
            format!("expected one of {}{}", listed.join(", "), if names.len() > 24 { ", …" } else { "" })
        }
    }
}

/// Edit distance (insertions, deletions, substitutions, case folded); names that are too long to be a
/// slip of the pen are far from everything.
fn edits(one: &str, other: &str) -> usize {
    const LONGEST: usize = 48;
    if one.len() > LONGEST || other.len() > LONGEST {
        return usize::MAX;
    }
    let one: Vec<char> = one.to_lowercase().chars().collect();
    let other: Vec<char> = other.to_lowercase().chars().collect();
    let mut row: Vec<usize> = (0..=other.len()).collect();
    for (line, letter) in one.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = line + 1;
        for (column, against) in other.iter().enumerate() {
            let substituted = diagonal + usize::from(letter != against);
            diagonal = row[column + 1];
            row[column + 1] = substituted.min(diagonal + 1).min(row[column] + 1);
        }
    }
    row[other.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_of_the_pen_are_recognised() {
        assert_eq!(edits("mapps", "maps"), 1);
        assert_eq!(edits("Control_Points", "control_points"), 0);
        assert_eq!(suggestion("radius", ["tolerance_mm", "radius_mm"].into_iter()), "did you mean \"radius_mm\"?");
        assert!(suggestion("colour", ["maps", "graph"].into_iter()).starts_with("expected one of \"maps\", \"graph\""));
    }

    #[test]
    fn numbers_in_strings_are_recognised() {
        for text in ["0.5", " 1e3 ", "NaN", "0,5", "-inf"] {
            assert!(reads_as_number(Some(text)), "{text}");
        }
        assert!(!reads_as_number(Some("a")));
    }
}
