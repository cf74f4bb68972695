//! Reads boundary controlled iterated function systems: names, shapes and indices. Whether the
//! operators fit, converge and satisfy their constraints is for the kernel to say.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec4;
use lacuna_kernel::model::{Bcifs, BcifsState, BoundarySpec, CellKind, CurveScheme, Entry, Matrix, RootCell, TransitionSpec};

use super::constraint::{adjacency, glue, incidence, relation};
use super::grammar::{BCIFS, BOUNDARY, Member, ROOT_CELL, STATE, TRANSITION};
use super::node::{Node, Place, Value, quoted};
use super::transform::weighted_point;
use super::walk::{Members, Walker, length, reads_as_number, suggestion};
use crate::diagnostic::code;

/// What other parts of the document may refer to in a state, taken from the tree before anything is
/// checked, so that one wrong operator does not make every reference wrong.
pub(super) struct Outline<'p> {
    /// States of the children.
    pub(super) children: Option<Vec<Option<&'p str>>>,
    /// States of the boundaries.
    pub(super) boundaries: Option<Vec<Option<&'p str>>>,
    /// The number of control points.
    pub(super) dimension: Option<usize>,
}

/// The names that a document declares, in an order that no hash decides. `None` when they cannot be told: then no reference is judged.
pub(super) struct Names<'p> {
    states: Option<BTreeMap<&'p str, Outline<'p>>>,
    parameters: Option<BTreeSet<&'p str>>,
}

impl Names<'_> {
    /// What is known of a state.
    pub(super) fn outline(&self, state: Option<&str>) -> Option<&Outline<'_>> {
        // why: the map's names outlive the lookup, so the longer lifetime may shrink
        self.states.as_ref()?.get(state?)
    }
}

/// A `bcifs` shape.
pub(super) fn bcifs(walker: &mut Walker<'_>, place: Place<'_>, added: &[Member]) -> Option<Bcifs> {
    let members = walker.object_of(place, &BCIFS, added)?;
    let names = Names {
        states: members
            .get("states")
            .filter(|place| length(place.node).is_some_and(|states| states <= walker.limits.states))
            .and_then(|place| outlines(place.node)),
        parameters: match members.get("parameters").map(|place| &place.node.value) {
            None => Some(BTreeSet::new()),
            Some(Value::Object(entries)) => Some(entries.iter().map(|(name, _)| name.as_ref()).collect()),
            Some(_) => None,
        },
    };
    let parameters = members.get("parameters").map_or(Some(Vec::new()), |place| parameters(walker, place));
    let states = members.get("states").and_then(|place| states(walker, place, &names));
    let incidences =
        optional_list(walker, &members, "incidences", "an array of incidences", |walker, place| incidence(walker, place, &names));
    let adjacencies =
        optional_list(walker, &members, "adjacencies", "an array of adjacencies", |walker, place| adjacency(walker, place, &names));
    let relations = optional_list(walker, &members, "relations", "an array of relations", |walker, place| relation(walker, place, &names));
    let cells = members
        .get("cells")
        .and_then(|place| walker.each_of(place, 1, "an array of root cells", |walker, place| root_cell(walker, place, &names)));
    let roots = members.get("cells").and_then(|place| root_states(place.node));
    let glue = optional_list(walker, &members, "glue", "an array of glued boundaries", |walker, place| {
        glue(walker, place, roots.as_deref(), &names)
    });
    Some(Bcifs {
        states: states?,
        incidences: incidences?,
        adjacencies: adjacencies?,
        relations: relations?,
        cells: cells?,
        glue: glue?,
        parameters: parameters?,
    })
}

/// The states of a curve in a product, and the one that it starts from: the first unless another is named.
pub(super) fn curve_states(walker: &mut Walker<'_>, members: &Members<'_>) -> Option<CurveScheme> {
    let place = members.get("states")?;
    let names = Names { states: outlines(place.node), parameters: Some(BTreeSet::new()) };
    let states = states(walker, place, &names);
    let start = match members.get("start") {
        Some(place) => walker.text(place, "the name of a state").map(str::to_owned),
        None => states.as_ref().and_then(|states| states.first()).map(|state| state.name.clone()),
    };
    Some(CurveScheme::Bcifs { states: states?, start: start? })
}

fn optional_list<T>(
    walker: &mut Walker<'_>,
    members: &Members<'_>,
    name: &str,
    expected: &str,
    read: impl FnMut(&mut Walker<'_>, Place<'_>) -> Option<T>,
) -> Option<Vec<T>> {
    members.get(name).map_or(Some(Vec::new()), |place| walker.each(place, expected, read))
}

fn member<'p>(node: &'p Node<'p>, name: &str) -> Option<&'p Node<'p>> {
    match &node.value {
        Value::Object(entries) => entries.iter().find(|(key, _)| key == name).map(|(_, node)| node),
        _ => None,
    }
}

fn elements<'p>(node: &'p Node<'p>) -> Option<&'p [Node<'p>]> {
    match &node.value {
        Value::Array(nodes) => Some(nodes),
        Value::Numbers(numbers) if numbers.is_empty() => Some(&[]),
        _ => None,
    }
}

/// The number, if it is one that counts something.
fn count(node: &Node<'_>) -> Option<usize> {
    match node.value {
        // why: larger dimensions are refused before anything is as long as they are
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        Value::Number(number) if number >= 1.0 && number.fract() == 0.0 && number < 1e9 => Some(number as usize),
        _ => None,
    }
}

fn outlines<'p>(states: &'p Node<'p>) -> Option<BTreeMap<&'p str, Outline<'p>>> {
    let states = elements(states)?;
    let named = states.iter().filter_map(|state| Some((member(state, "name")?.text()?, state)));
    Some(
        named
            .map(|(name, state)| {
                let listed = |list: &'p [Node<'p>], to: &str| list.iter().map(|link| member(link, to).and_then(Node::text)).collect();
                let children = member(state, "transitions").and_then(elements).map(|list| listed(list, "to"));
                let boundaries = member(state, "boundaries").map_or(Some(&[][..]), elements).map(|list| listed(list, "state"));
                (name, Outline { children, boundaries, dimension: member(state, "dimension").and_then(count) })
            })
            .collect(),
    )
}

fn root_states<'p>(cells: &'p Node<'p>) -> Option<Vec<Option<&'p str>>> {
    Some(elements(cells)?.iter().map(|cell| member(cell, "state").and_then(Node::text)).collect())
}

/// Named numbers.
pub(super) fn parameters(walker: &mut Walker<'_>, place: Place<'_>) -> Option<Vec<(String, f64)>> {
    let Value::Object(entries) = &place.node.value else {
        return walker.wrong_type(&place, "an object of named numbers");
    };
    let mut parameters = Some(Vec::with_capacity(entries.len()));
    for (name, node) in entries {
        let value = walker.number(Place { node, path: place.path.member(name) });
        if name.is_empty() || name.len() > 256 || name.chars().any(char::is_control) || reads_as_number(Some(name)) {
            walker.report.add(&place.path.member(name), node.offset, code::BAD_NAME, || {
                format!("{} cannot name a parameter; expected a word, for example \"a\"", quoted(name))
            });
        }
        match (value, &mut parameters) {
            (Some(value), Some(parameters)) => parameters.push((name.clone().into_owned(), value)),
            _ => parameters = None,
        }
    }
    parameters
}

fn states(walker: &mut Walker<'_>, place: Place<'_>, names: &Names<'_>) -> Option<Vec<BcifsState>> {
    walker.count_states(&place, length(place.node).unwrap_or(0));
    if walker.states > walker.limits.states {
        return None;
    }
    let mut first_places: BTreeMap<String, usize> = BTreeMap::new();
    let mut position = 0;
    walker.each_of(place, 1, "an array of states", |walker, place| {
        let state = state(walker, place, names);
        // why: read again, since a state with a fault elsewhere has a name all the same
        if let Some(name) = member(place.node, "name").and_then(Node::text)
            && let Some(first) = first_places.insert(name.to_owned(), position)
        {
            walker.report.add(&place.path.member("name"), place.node.offset, code::DUPLICATE_NAME, || {
                format!("state {first} is called {} already; names of states are unique", quoted(name))
            });
        }
        position += 1;
        state
    })
}

fn state(walker: &mut Walker<'_>, place: Place<'_>, names: &Names<'_>) -> Option<BcifsState> {
    const KINDS: [(&str, CellKind); 4] =
        [("vertex", CellKind::Vertex), ("edge", CellKind::Edge), ("face", CellKind::Face), ("volume", CellKind::Volume)];
    let members = walker.object(place, &STATE)?;
    let name = members.get("name").and_then(|place| walker.name(place, "the name of a state"));
    let cell = members.get("cell").and_then(|place| walker.word(place, "a kind of cell", &KINDS));
    let dimension = members.get("dimension").and_then(|place| dimension(walker, place));
    let transitions = members.get("transitions").and_then(|place| {
        walker.count_transitions(&place, length(place.node).unwrap_or(0));
        walker.each(place, "an array of transitions", |walker, place| transition(walker, place, names))
    });
    let boundaries =
        optional_list(walker, &members, "boundaries", "an array of boundaries", |walker, place| boundary(walker, place, names));
    Some(BcifsState { name: name?, cell: cell?, dimension: dimension?, transitions: transitions?, boundaries: boundaries? })
}

fn dimension(walker: &mut Walker<'_>, place: Place<'_>) -> Option<usize> {
    let dimension = walker.integer(place, "a number of control points")?;
    if dimension == 0 {
        walker.fault(&place, code::NOT_POSITIVE, || "is 0; a cell has at least one control point".into());
        return None;
    }
    usize::try_from(dimension).ok()
}

fn transition(walker: &mut Walker<'_>, place: Place<'_>, names: &Names<'_>) -> Option<TransitionSpec> {
    let members = walker.object(place, &TRANSITION)?;
    let to = members.get("to").and_then(|place| state_name(walker, place, names));
    let operator = members.get("operator").and_then(|place| matrix(walker, place, names));
    Some(TransitionSpec { to: to?, operator: operator? })
}

fn boundary(walker: &mut Walker<'_>, place: Place<'_>, names: &Names<'_>) -> Option<BoundarySpec> {
    let members = walker.object(place, &BOUNDARY)?;
    let state = members.get("state").and_then(|place| state_name(walker, place, names));
    let incidence = members.get("incidence").and_then(|place| matrix(walker, place, names));
    Some(BoundarySpec { state: state?, incidence: incidence? })
}

/// The name of a state of the model.
pub(super) fn state_name(walker: &mut Walker<'_>, place: Place<'_>, names: &Names<'_>) -> Option<String> {
    let name = walker.text(place, "the name of a state")?;
    match &names.states {
        Some(states) if !states.contains_key(name) => {
            walker.fault(&place, code::UNKNOWN_STATE, || {
                format!("{} is not a state of the model; {}", quoted(name), suggestion(name, states.keys().copied()))
            });
            None
        }
        _ => Some(name.to_owned()),
    }
}

fn matrix(walker: &mut Walker<'_>, place: Place<'_>, names: &Names<'_>) -> Option<Matrix> {
    const EXPECTED: &str = "a matrix: an array of rows";
    let mut width = None;
    let rows = walker.each_of(place, 1, EXPECTED, |walker, row| {
        if let Some(found) = length(row.node) {
            let expected = *width.get_or_insert(found);
            if found != expected {
                walker.fault(&row, code::WRONG_LENGTH, || {
                    format!("has {found} entries and the rows above have {expected}; the rows of a matrix have one length")
                });
            }
        }
        if let Value::Numbers(numbers) = &row.node.value
            && !numbers.is_empty()
        {
            return Some(numbers.iter().copied().map(Entry::Number).collect());
        }
        walker.each_of(row, 1, "a row of entries", |walker, place| entry(walker, place, names))
    })?;
    Some(Matrix { rows })
}

fn entry(walker: &mut Walker<'_>, place: Place<'_>, names: &Names<'_>) -> Option<Entry> {
    match &place.node.value {
        Value::Number(number) => Some(Entry::Number(*number)),
        Value::Null => Some(Entry::Unknown),
        Value::Text(_) | Value::Unescaped(_) => {
            let name = place.node.text()?;
            match &names.parameters {
                Some(known) if !known.contains(name) => {
                    if reads_as_number(Some(name)) {
                        return walker.number(place).map(Entry::Number);
                    }
                    walker.fault(&place, code::UNKNOWN_PARAMETER, || {
                        let hint = if known.is_empty() {
                            "declare it in the shape's \"parameters\"".into()
                        } else {
                            suggestion(name, known.iter().copied())
                        };
                        format!("{} is not one of the model's parameters; {hint}", quoted(name))
                    });
                    None
                }
                _ => Some(Entry::Parameter(name.to_owned())),
            }
        }
        _ => walker.wrong_type(&place, "a number, null (unknown) or the name of a parameter"),
    }
}

fn root_cell(walker: &mut Walker<'_>, place: Place<'_>, names: &Names<'_>) -> Option<RootCell> {
    let members = walker.object(place, &ROOT_CELL)?;
    let state = members.get("state").and_then(|place| state_name(walker, place, names));
    let control_points = members
        .get("control_points")
        .and_then(|place| walker.each_of(place, 1, "an array of points [x, y, z] or [x, y, z, w], or null", placed_point));
    Some(RootCell { state: state?, control_points: control_points? })
}

/// A control point, or `null` for one that is to be placed.
#[allow(clippy::option_option)] // why: the outer option is the reader's, for values that are wrong
fn placed_point(walker: &mut Walker<'_>, place: Place<'_>) -> Option<Option<DVec4>> {
    if matches!(place.node.value, Value::Null) {
        return Some(None);
    }
    weighted_point(walker, place).map(Some)
}
