//! From a cage to states and roots.

use super::Scheme;
use super::cage::Cage;
use super::host::{Host, NONE};
use super::refine::{Masks, Rules, edge_point, refine};
use super::stencil::{Cell, Seen, Stencil, Walker};
use crate::attractor::{Gluing, Root};
use crate::automaton::{Boundary, LeafPrimitive, State, StateId, SubdivisionOperator, Transition};
use crate::model::CellKind;
use crate::model::join::Borders;
use crate::model::lower::Draft;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};

/// A cage whose patches have more different stencils than this is subdivided before: that isolates extraordinary
/// vertices, and the states of what is left are few.
const MOST_STENCILS: usize = 256;
/// After two steps no patch has two extraordinary vertices.
const MOST_STEPS: usize = 2;
/// Patches looked at in one go.
const BATCH: usize = 1 << 14;
/// Patches allowed: their control points take half a kilobyte each.
const MOST_PATCHES: usize = 1 << 22;

/// States by stencil. Looked up only: its order never matters.
struct Converter<'a> {
    rules: &'a Rules,
    draft: &'a mut Draft,
    known: HashMap<Stencil, StateId>,
    /// Stencils whose states are to be filled in.
    queue: Vec<(Stencil, StateId)>,
}

/// Adds the states and roots of a cage's limit surface to the draft.
///
/// Cost: linear in the patches, and for every different stencil one step of the scheme on it.
pub(super) fn convert(rules: &Rules, mut cage: Cage, draft: &mut Draft) {
    let scheme = &rules.scheme;
    for step in 0..=MOST_STEPS {
        if cage.host.origin.len() > MOST_PATCHES {
            let message = format!(
                "the cage has {} face corners{}, and at most {MOST_PATCHES} are allowed; use a coarser cage",
                cage.host.origin.len(),
                if step > 0 { " after a step that isolates its extraordinary vertices" } else { "" }
            );
            return draft.error("/mesh", "subdivision.too-large", message);
        }
        let cells = patches(scheme, &cage);
        if let Some(seen) = roots(scheme, &cage.host, &cells, step < MOST_STEPS) {
            let mut converter = Converter { rules, draft, known: HashMap::new(), queue: Vec::new() };
            converter.run(&cage, &cells, seen);
            if step > 0 {
                draft.borders = Borders::Subdivided;
            }
            return;
        }
        cage = cage.refined(refine(rules, &cage.host), *scheme);
    }
}

/// The patches of a cage, by a half-edge of each.
fn patches(scheme: &Scheme, cage: &Cage) -> Vec<u32> {
    let host = &cage.host;
    if *scheme != Scheme::DooSabin {
        return host.first[..host.faces()].to_vec();
    }
    let (mut ahead, mut behind) = (Vec::new(), Vec::new());
    let outs = host.out[..cage.own_vertices].iter().copied();
    outs.filter(|&out| out != NONE && host.fan(out, false, &mut ahead, &mut behind)).collect()
}

/// The different stencils of patches, in order of appearance.
#[derive(Default)]
struct Roots {
    stencils: Vec<Stencil>,
    /// For every patch: its stencil, its vertices in the stencil's order, and which of its half-edges comes first.
    patches: Vec<(u32, Vec<u32>, u32)>,
}

/// Canonical stencils of all patches; `None` when there are too many different ones and `bounded`.
fn roots(scheme: &Scheme, host: &Host, cells: &[u32], bounded: bool) -> Option<Roots> {
    let mut known: HashMap<Stencil, u32> = HashMap::new();
    let mut roots = Roots::default();
    for batch in cells.chunks(BATCH) {
        let seen: Vec<Seen> = batch.par_iter().map_init(|| Walker::new(scheme, host), |walker, &h| walker.see(Cell::Patch(h))).collect();
        for seen in seen {
            let index = match known.get(&seen.stencil) {
                Some(&index) => index,
                None => {
                    if bounded && roots.stencils.len() >= MOST_STENCILS {
                        return None;
                    }
                    let index = roots.stencils.len() as u32;
                    roots.stencils.push(seen.stencil.clone());
                    known.insert(seen.stencil, index);
                    index
                }
            };
            roots.patches.push((index, seen.vertices, seen.start as u32));
        }
    }
    Some(roots)
}

impl Converter<'_> {
    fn run(&mut self, cage: &Cage, cells: &[u32], roots: Roots) {
        let states: Vec<StateId> = roots.stencils.into_iter().map(|stencil| self.intern(stencil)).collect();
        while let Some((stencil, id)) = self.queue.pop() {
            let state = self.state(&stencil);
            self.draft.states[id.index()] = state;
        }
        let first_root = self.draft.roots.len();
        // The root and boundary that every half-edge is.
        let mut place = vec![(NONE, 0_u32); cage.host.origin.len()];
        let mut walker = Walker::new(&self.rules.scheme, &cage.host);
        for (root, (&h, &(_, _, start))) in cells.iter().zip(&roots.patches).enumerate() {
            let sides = walker.sides(h);
            let count = sides.len();
            for (k, side) in sides.into_iter().enumerate() {
                place[side as usize] = (root as u32, ((k + count - start as usize) % count) as u32);
            }
        }
        self.draft.borders = borders(self.rules.scheme, cage, first_root, &place);
        for h in 0..place.len() {
            let twin = cage.host.twin[h];
            if twin == NONE || (twin as usize) < h {
                continue;
            }
            let sides = [place[h], place[twin as usize]];
            if sides.iter().any(|side| side.0 == NONE) {
                continue;
            }
            let vertices = |(root, boundary): (u32, u32)| -> Vec<u32> {
                let (stencil, vertices, _) = &roots.patches[root as usize];
                let incidence = &self.draft.states[states[*stencil as usize].index()].boundaries[boundary as usize].incidence;
                let chosen = (0..incidence.columns()).filter_map(|j| incidence.column(j).iter().position(|&entry| entry == 1.0));
                chosen.map(|row| vertices[row]).collect()
            };
            let [left, right] = sides.map(vertices);
            let order = || left.iter().map(|vertex| right.iter().position(|other| other == vertex)).collect::<Option<Vec<usize>>>();
            let permutation = if left == right { None } else { order() };
            let between = sides.map(|(root, boundary)| (first_root + root as usize, boundary as usize));
            self.draft.gluings.push(Gluing { between, permutation });
        }
        for (stencil, vertices, _) in roots.patches {
            let point = |vertex: u32| {
                let p = cage.points[vertex as usize];
                [p.x, p.y, p.z, 1.0]
            };
            let points = vertices.into_iter().map(point).collect();
            self.draft.roots.push(Root { state: states[stencil as usize], points, rational: false, solid: None });
        }
    }

    /// The state of a stencil, which is filled in later if it is new.
    fn intern(&mut self, stencil: Stencil) -> StateId {
        if let Some(&id) = self.known.get(&stencil) {
            return id;
        }
        let id = if stencil.vertices() == 1 {
            self.draft.point_state()
        } else {
            let id = self.draft.state(State {
                name: String::new(),
                kind: None,
                dimension: stencil.vertices(),
                transitions: Vec::new(),
                boundaries: Vec::new(),
                leaf: LeafPrimitive::Centre,
                frame: false,
            });
            self.queue.push((stencil.clone(), id));
            id
        };
        self.known.insert(stencil, id);
        id
    }

    /// One step of the scheme on a stencil, in symbols.
    fn state(&mut self, stencil: &Stencil) -> State {
        let scheme = &self.rules.scheme;
        let (host, cell) = stencil.host(scheme);
        let (refined, masks) = refine(self.rules, &host);
        let dimension = host.vertices;
        let (boundaries, children) = (boundaries(scheme, &host, cell), children(scheme, &host, &refined, cell));
        let boundaries = {
            let mut walker = Walker::new(scheme, &host);
            let seen: Vec<Seen> = boundaries.into_iter().map(|cell| walker.see(cell)).collect();
            let embed = |seen: Seen| {
                let mut columns = vec![0.0; dimension * seen.vertices.len()];
                seen.vertices.iter().enumerate().for_each(|(j, &vertex)| columns[j * dimension + vertex as usize] = 1.0);
                Boundary { state: self.intern(seen.stencil), incidence: SubdivisionOperator::exact(dimension, columns) }
            };
            seen.into_iter().map(embed).collect()
        };
        let mut walker = Walker::new(scheme, &refined);
        let seen: Vec<Seen> = children.into_iter().map(|cell| walker.see(cell)).collect();
        let transition = |(label, seen): (usize, Seen)| {
            let operator = operator(dimension, &masks, &seen.vertices);
            Transition { to: self.intern(seen.stencil), operator, label }
        };
        let transitions = seen.into_iter().enumerate().map(transition).collect();
        let (kind, what) = match cell {
            Cell::Patch(_) => (CellKind::Face, "patch"),
            Cell::Curve(_) => (CellKind::Edge, "curve"),
            Cell::Point(_) => (CellKind::Vertex, "point"),
        };
        let name = format!("{} {what} of {dimension}", scheme.name());
        State { name, kind: Some(kind), dimension, transitions, boundaries, leaf: LeafPrimitive::Centre, frame: false }
    }
}

/// The border's spans: edges without a second face, or with Doo and Sabin's scheme what lies between a vertex and its
/// double. `place`: the root, from `first_root` on, and boundary that every half-edge is.
fn borders(scheme: Scheme, cage: &Cage, first_root: usize, place: &[(u32, u32)]) -> Borders {
    let host = &cage.host;
    let known = |h: u32| {
        let (root, boundary) = place[h as usize];
        (root != NONE).then(|| (first_root + root as usize, boundary as usize))
    };
    let half_edges = 0..host.origin.len() as u32;
    if scheme != Scheme::DooSabin {
        let border = half_edges.filter(|&h| host.twin[h as usize] == NONE);
        return Borders::Edges(border.filter_map(|h| Some(([host.origin[h as usize], host.destination(h)], known(h)?))).collect());
    }
    let mut spans = BTreeMap::<u32, Vec<(usize, usize)>>::new();
    for h in half_edges.filter(|&h| host.destination(h) as usize >= cage.own_vertices) {
        if let Some(span) = known(h) {
            spans.entry(host.origin[h as usize]).or_default().push(span);
        }
    }
    Borders::Vertices(spans)
}

/// Columns: the masks of the child's control points.
fn operator(dimension: usize, masks: &Masks, vertices: &[u32]) -> SubdivisionOperator {
    let mut columns = vec![0.0; dimension * vertices.len()];
    for (j, &vertex) in vertices.iter().enumerate() {
        let mask = masks.of(vertex);
        // A child's stencil is made of points between the stars of the parent's own vertices, which the parent's
        // stencil holds in full.
        assert!(!mask.is_empty(), "a control point of a child follows from its parent's");
        mask.iter().for_each(|&(source, weight)| columns[j * dimension + source as usize] = weight);
    }
    SubdivisionOperator::exact(dimension, columns)
}

fn boundaries(scheme: &Scheme, host: &Host, cell: Cell) -> Vec<Cell> {
    match cell {
        Cell::Patch(h) => Walker::new(scheme, host).sides(h).into_iter().map(|side| Cell::Curve(host.side(side))).collect(),
        Cell::Curve(side) if *scheme == Scheme::DooSabin => {
            let twin = host.twin[side.half_edge as usize];
            [side.half_edge, twin].map(|h| Cell::Point(host.face[h as usize])).to_vec()
        }
        Cell::Curve(side) => vec![Cell::Point(side.from), Cell::Point(side.to)],
        Cell::Point(_) => Vec::new(),
    }
}

fn children(scheme: &Scheme, host: &Host, refined: &Host, cell: Cell) -> Vec<Cell> {
    let between = |from: u32, to: u32| Cell::Curve(refined.side_between(from, to).expect("a refined edge has two halves"));
    let sides = |h: u32| Walker::new(scheme, host).sides(h).into_iter();
    match (cell, scheme) {
        (Cell::Patch(h), Scheme::CatmullClark) => sides(h).map(|side| Cell::Patch(4 * side)).collect(),
        (Cell::Patch(h), Scheme::Loop) => {
            let middle = 3 * host.origin.len() as u32 + h;
            sides(h).map(|side| 3 * side).chain(std::iter::once(middle)).map(Cell::Patch).collect()
        }
        (Cell::Patch(h), Scheme::DooSabin) => sides(h).map(|side| Cell::Patch(refined.out[side as usize])).collect(),
        (Cell::Curve(side), Scheme::DooSabin) => {
            let halves = [side.half_edge, host.twin[side.half_edge as usize]];
            halves.map(|h| between(h, host.next(h))).to_vec()
        }
        (Cell::Curve(side), _) => {
            let middle = edge_point(host, &side);
            vec![between(side.from, middle), between(middle, side.to)]
        }
        (Cell::Point(_), _) => vec![cell],
    }
}
