//! Drawings of automata, as in the literature: states as nodes, transitions and boundaries as two kinds of arrows.
//!
//! A [`Diagram`] is a plain description. It is made of a model, whether or not the model can be evaluated: what is
//! wrong is drawn where it is wrong.

mod dot;
mod layout;
mod route;
mod svg;

use std::collections::BTreeMap;

use lacuna_kernel::automaton::Automaton;
use lacuna_kernel::model::{Bcifs, CellKind, Finding, Group, Ifs, Model, Shape};

/// What is drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Diagram {
    /// The model's name.
    pub title: Option<String>,
    /// The states.
    pub nodes: Vec<Node>,
    /// The arrows between them, one for each pair of states and kind of bond.
    pub arrows: Vec<Arrow>,
    /// What concerns no state alone.
    pub notes: Vec<Fault>,
}

/// A state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Node {
    /// Its name.
    pub name: String,
    /// Its topological kind, if the model states one.
    pub kind: Option<CellKind>,
    /// Number of control points.
    pub control_points: usize,
    /// Indices of the root cells of this state.
    pub roots: Vec<usize>,
    /// What is wrong with it.
    pub faults: Vec<Fault>,
}

/// What an arrow stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Bond {
    /// A child of the cell.
    Transition,
    /// A boundary of the cell.
    Boundary,
}

/// All transitions, or all boundaries, from one state to another.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrow {
    /// Index of the node where it starts.
    pub from: usize,
    /// Index of the node where it ends.
    pub to: usize,
    /// What it stands for.
    pub bond: Bond,
    /// Their indices in the state's list.
    pub indices: Vec<usize>,
}

/// Something that is wrong, or odd.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Stable code.
    pub code: String,
    /// What, in words.
    pub message: String,
    /// Whether the model can be used all the same.
    pub warning: bool,
}

impl From<&Finding> for Fault {
    fn from(finding: &Finding) -> Self {
        Self { code: finding.code.to_owned(), message: finding.message.clone(), warning: finding.warning }
    }
}

/// Arrows in the making, by their ends and kind.
type Bonds = BTreeMap<(usize, usize, Bond), Vec<usize>>;

impl Diagram {
    /// Describes a model: the states as its author wrote them, else those to which its family lowers.
    #[must_use]
    pub fn of(model: &Model) -> Self {
        let lowered = model.lower();
        let findings = match &lowered {
            Ok(lowered) => &lowered.findings,
            Err(findings) => findings,
        };
        let mut diagram = Self { title: model.name.clone(), ..Self::default() };
        match (&model.shape, &lowered) {
            (Shape::Bcifs(_), _) | (_, Err(_)) => {
                let mut told = vec![false; findings.len()];
                diagram.shape(&model.shape, "", findings, &mut told);
                diagram.notes = findings.iter().zip(told).filter(|(_, told)| !told).map(|(finding, _)| finding.into()).collect();
            }
            (_, Ok(lowered)) => {
                diagram.automaton(lowered.attractor.automaton());
                for (index, root) in lowered.attractor.roots().iter().enumerate() {
                    diagram.nodes[root.state.index()].roots.push(index);
                }
                diagram.notes = findings.iter().map(Fault::from).collect();
            }
        }
        diagram
    }

    /// The diagram as DOT text, for Graphviz.
    #[must_use]
    pub fn dot(&self) -> String {
        dot::text(self)
    }

    /// The diagram as a picture. Beyond 60 states or 400 arrows it lists them instead, and says so.
    #[must_use]
    pub fn svg(&self) -> String {
        svg::text(self)
    }

    fn automaton(&mut self, automaton: &Automaton) {
        let mut bonds = Bonds::new();
        for (index, state) in automaton.states().iter().enumerate() {
            let node = Node { name: state.name.clone(), kind: state.kind, control_points: state.dimension, ..Node::default() };
            self.nodes.push(node);
            for transition in &state.transitions {
                bonds.entry((index, transition.to.index(), Bond::Transition)).or_default().push(transition.label);
            }
            for (label, boundary) in state.boundaries.iter().enumerate() {
                bonds.entry((index, boundary.state.index(), Bond::Boundary)).or_default().push(label);
            }
        }
        self.connect(bonds);
    }

    fn connect(&mut self, bonds: Bonds) {
        self.arrows.extend(bonds.into_iter().map(|((from, to, bond), indices)| Arrow { from, to, bond, indices }));
    }

    fn shape(&mut self, shape: &Shape, place: &str, findings: &[Finding], told: &mut [bool]) {
        match shape {
            Shape::Bcifs(bcifs) => self.bcifs(bcifs, place, findings, told),
            Shape::Ifs(ifs) => self.ifs(ifs, place, findings, told),
            Shape::Group(Group { parts, .. }) => {
                for (index, part) in parts.iter().enumerate() {
                    self.shape(&part.shape, &format!("{place}/parts/{index}/shape"), findings, told);
                }
            }
            Shape::BezierCurve(curve) => self.alone("bezier curve", curve.control_points.len(), place, findings, told),
            Shape::CornerCutting(_) => self.alone("corner cutting", 3, place, findings, told),
            Shape::Curve(curve) => self.alone("curve", curve.control_points.points.len(), place, findings, told),
            Shape::TensorProduct(product) => self.alone("tensor product", product.control_points.points.len(), place, findings, told),
            Shape::Sum(sum) => {
                let points = sum.u.control_points.points.len() * sum.v.control_points.points.len();
                self.alone("sum", points, place, findings, told);
            }
            Shape::Subdivision(surface) => self.alone("subdivision", surface.vertices.len(), place, findings, told),
            Shape::Mesh(_) => self.alone("mesh", 3, place, findings, told),
            Shape::Terrain(_) => self.alone("terrain", 3, place, findings, told),
        }
    }

    /// A family whose automaton is not in the document: one node with all that is wrong.
    fn alone(&mut self, name: &str, control_points: usize, place: &str, findings: &[Finding], told: &mut [bool]) {
        let node = self.nodes.len();
        self.nodes.push(Node { name: name.into(), control_points, roots: vec![node], ..Node::default() });
        self.blame(place, findings, told, |_| Some(node));
    }

    /// Gives findings below a place to the nodes that `whose` names for the rest of their pointers.
    fn blame(&mut self, place: &str, findings: &[Finding], told: &mut [bool], whose: impl Fn(&str) -> Option<usize>) {
        for (finding, told) in findings.iter().zip(told).filter(|(_, told)| !**told) {
            let Some(rest) = finding.pointer.strip_prefix(place).filter(|_| !finding.pointer.is_empty()) else { continue };
            if let Some(node) = whose(rest).and_then(|node| self.nodes.get_mut(node)) {
                node.faults.push(finding.into());
                *told = true;
            }
        }
    }

    fn bcifs(&mut self, bcifs: &Bcifs, place: &str, findings: &[Finding], told: &mut [bool]) {
        let first = self.nodes.len();
        let mut known: BTreeMap<&str, usize> = BTreeMap::new();
        for (index, state) in bcifs.states.iter().enumerate() {
            known.entry(&state.name).or_insert(first + index);
            let node = Node { name: state.name.clone(), kind: Some(state.cell), control_points: state.dimension, ..Node::default() };
            self.nodes.push(node);
        }
        let mut bonds = Bonds::new();
        for (index, state) in bcifs.states.iter().enumerate() {
            let transitions = state.transitions.iter().map(|transition| (transition.to.as_str(), Bond::Transition)).enumerate();
            let boundaries = state.boundaries.iter().map(|boundary| (boundary.state.as_str(), Bond::Boundary)).enumerate();
            for (label, (name, bond)) in transitions.chain(boundaries) {
                let to = *known.entry(name).or_insert_with(|| {
                    let message = format!("state '{name}' does not exist");
                    let fault = Fault { code: "automaton.unknown-state".into(), message, warning: false };
                    self.nodes.push(Node { name: format!("{name}?"), faults: vec![fault], ..Node::default() });
                    self.nodes.len() - 1
                });
                bonds.entry((first + index, to, bond)).or_default().push(label);
            }
        }
        self.connect(bonds);
        let roots: usize = self.nodes[..first].iter().map(|node| node.roots.len()).sum();
        for (index, cell) in bcifs.cells.iter().enumerate() {
            if let Some(node) = known.get(cell.state.as_str()) {
                self.nodes[*node].roots.push(roots + index);
            }
        }
        let of_state = |name: &String| known.get(name.as_str()).copied();
        self.blame(place, findings, told, |rest| {
            let (list, index) = place_in_list(rest)?;
            match list {
                "states" => Some(first + index).filter(|_| index < bcifs.states.len()),
                "incidences" => of_state(&bcifs.incidences.get(index)?.state),
                "adjacencies" => of_state(&bcifs.adjacencies.get(index)?.state),
                "cells" => of_state(&bcifs.cells.get(index)?.state),
                _ => None,
            }
        });
    }

    /// Without a graph one state to which all maps lead; with one, a state after each map.
    fn ifs(&mut self, ifs: &Ifs, place: &str, findings: &[Finding], told: &mut [bool]) {
        let first = self.nodes.len();
        let node = |name: String| Node { name, control_points: 4, ..Node::default() };
        let mut bonds = Bonds::new();
        self.nodes.push(Node { roots: vec![first], ..node("attractor".into()) });
        let after = |map: usize| if ifs.graph.is_some() { first + 1 + map } else { first };
        for map in 0..ifs.maps.len() {
            bonds.entry((first, after(map), Bond::Transition)).or_default().push(map);
            if ifs.graph.is_some() {
                self.nodes.push(node(format!("after map {map}")));
            }
        }
        for (map, next) in ifs.graph.iter().flatten().enumerate().take(ifs.maps.len()) {
            for &next in next.iter().filter(|&&next| next < ifs.maps.len()) {
                bonds.entry((after(map), after(next), Bond::Transition)).or_default().push(next);
            }
        }
        self.connect(bonds);
        self.blame(place, findings, told, |rest| match place_in_list(rest) {
            Some(("maps" | "graph", map)) if map < ifs.maps.len() => Some(after(map)),
            _ => Some(first),
        });
    }
}

/// The list and the index with which a pointer begins: `/states/3/transitions/0` gives states and 3.
fn place_in_list(pointer: &str) -> Option<(&str, usize)> {
    let mut words = pointer.strip_prefix('/')?.split('/');
    Some((words.next()?, words.next()?.parse().ok()?))
}

/// The word of a kind of cell.
fn kind_word(kind: CellKind) -> &'static str {
    match kind {
        CellKind::Vertex => "vertex",
        CellKind::Edge => "edge",
        CellKind::Face => "face",
        CellKind::Volume => "volume",
    }
}

impl Node {
    /// Kind and number of control points, in words.
    fn about(&self) -> String {
        let points = if self.control_points == 1 { "1 point".to_owned() } else { format!("{} points", self.control_points) };
        self.kind.map_or(points.clone(), |kind| format!("{}, {points}", kind_word(kind)))
    }

    /// The root cells of the state, in words.
    fn rooted(&self) -> Option<String> {
        let word = if self.roots.len() == 1 { "root cell" } else { "root cells" };
        (!self.roots.is_empty()).then(|| format!("{word} {}", lacuna_kernel::attractor::ranges(&self.roots)))
    }
}

#[cfg(test)]
mod tests;
