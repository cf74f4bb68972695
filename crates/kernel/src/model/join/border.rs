//! Borders of parts: which edges of which root cells they are, where they run, and how two lie on each other.

use super::kinds::place;
use super::limits::Limits;
use super::{Border, BorderPath};
use crate::model::lower::Draft;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// What a lowered part says of its borders.
#[derive(Clone, Debug, Default)]
pub(in crate::model) enum Borders {
    /// It has none that can be named.
    #[default]
    None,
    /// A product of two curves: numbers of spans, and the root of every cell, the second direction fastest; cells that are
    /// single points have none.
    Grid {
        /// Spans per direction.
        counts: [usize; 2],
        /// Roots of the cells.
        roots: Vec<Option<usize>>,
    },
    /// Border edges (root, boundary) of a mesh by their vertices, in the direction of their face.
    Edges(BTreeMap<[u32; 2], (usize, usize)>),
    /// Border spans of a mesh by the vertices that they belong to (Doo-Sabin).
    Vertices(BTreeMap<u32, Vec<(usize, usize)>>),
    /// A mesh that was subdivided before: its edges are no spans.
    Subdivided,
    /// A BC-IFS: its first root, and how many it has.
    Cells {
        /// First root.
        first: usize,
        /// Number of roots.
        count: usize,
    },
}

/// A border as root edges (root, boundary), one after the other.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub(super) spans: Vec<(usize, usize)>,
    /// What it is, for messages.
    pub(super) words: String,
}

/// The root edges of a border, or a finding.
pub(super) fn chain(border: &Border, parts: &[Borders], place: &str, draft: &mut Draft) -> Option<Chain> {
    let part = border.part;
    let Some(known) = parts.get(part) else {
        draft.error(&format!("{place}/part"), "join.part", format!("part {part} does not exist: there are {}", parts.len()));
        return None;
    };
    let (words, member, spans) = match (&border.path, known) {
        (&BorderPath::Side { direction, last }, Borders::Grid { counts, roots }) => {
            let words = format!("side {} of part {part}", side_name(direction, last));
            (words, "/side", side(*counts, roots, direction, last))
        }
        (BorderPath::Vertices(list), Borders::Edges(edges)) => {
            (format!("the border of part {part}"), "/vertices", along_edges(list, edges))
        }
        (BorderPath::Vertices(list), Borders::Vertices(spans)) => {
            (format!("the border of part {part}"), "/vertices", along_vertices(list, spans))
        }
        (BorderPath::Vertices(_), Borders::Subdivided) => {
            let message =
                "the mesh has so many kinds of patches that it is subdivided before, so its edges are no spans; join smaller meshes";
            (String::new(), "/vertices", Err((String::new(), message.into())))
        }
        (BorderPath::Boundaries(list), &Borders::Cells { first, count }) => {
            let known = |(k, &(cell, boundary)): (usize, &(usize, usize))| {
                let exists = cell < count && boundary < draft.states[draft.roots[first + cell].state.index()].boundaries.len();
                let message = || (format!("/{k}"), format!("there is no boundary {boundary} of a root cell {cell}"));
                exists.then_some((first + cell, boundary)).ok_or_else(message)
            };
            (format!("the border of part {part}"), "/boundaries", list.iter().enumerate().map(known).collect())
        }
        _ => {
            let message = "this part's border is not named like that: \"side\" is for products of two curves, \"vertices\" for subdivision \
                           surfaces, \"boundaries\" for BC-IFS; other families have no border that can be joined";
            draft.error(place, "join.border", message.into());
            return None;
        }
    };
    match spans {
        Ok(spans) if spans.is_empty() => {
            draft.error(&format!("{place}{member}"), "join.border", "the border has no span".into());
            None
        }
        Ok(spans) => Some(Chain { spans, words }),
        Err((pointer, message)) => {
            draft.error(&format!("{place}{member}{pointer}"), "join.border", message);
            None
        }
    }
}

fn side_name(direction: usize, last: bool) -> String {
    format!("{}_{}", if direction == 0 { "u" } else { "v" }, if last { "max" } else { "min" })
}

/// Spans, or the place and words of a fault.
type Spans = Result<Vec<(usize, usize)>, (String, String)>;

fn side(counts: [usize; 2], roots: &[Option<usize>], direction: usize, last: bool) -> Spans {
    if direction > 1 {
        return Err((String::new(), "there are two directions".into()));
    }
    let across = if last { counts[direction] - 1 } else { 0 };
    let cell = |k: usize| if direction == 0 { across * counts[1] + k } else { k * counts[1] + across };
    let collapsed = || (String::new(), "the side has a cell that is a single point".into());
    let boundary = 2 * (1 - direction) + usize::from(last);
    (0..counts[1 - direction]).map(|k| roots[cell(k)].map(|root| (root, boundary)).ok_or_else(collapsed)).collect()
}

fn along_edges(list: &[u32], edges: &BTreeMap<[u32; 2], (usize, usize)>) -> Spans {
    let span = |(k, pair): (usize, &[u32])| {
        let found = edges.get(&[pair[0], pair[1]]).or_else(|| edges.get(&[pair[1], pair[0]]));
        let message = || (format!("/{}", k + 1), format!("the mesh has no border edge ({}, {})", pair[0], pair[1]));
        found.copied().ok_or_else(message)
    };
    list.windows(2).enumerate().map(span).collect()
}

fn along_vertices(list: &[u32], spans: &BTreeMap<u32, Vec<(usize, usize)>>) -> Spans {
    let closed = list.len() > 2 && list.first() == list.last();
    let own = if closed { &list[..list.len() - 1] } else { list };
    let span = |(k, vertex): (usize, &u32)| match spans.get(vertex).map(Vec::as_slice) {
        Some([span]) => Ok(*span),
        Some(_) => Err((format!("/{k}"), format!("vertex {vertex} is a sharp corner of the border, which cannot be joined"))),
        None => Err((format!("/{k}"), format!("vertex {vertex} is not on the mesh's border"))),
    };
    own.iter().enumerate().map(span).collect()
}

/// Refuses spans that are joined already: within the part, by another join, or twice by this one.
pub(super) fn claim(chain: &Chain, taken: &mut BTreeSet<(usize, usize)>, place: &str, draft: &mut Draft) -> bool {
    for (k, &span) in chain.spans.iter().enumerate() {
        if !taken.insert(span) {
            let message = format!("{}, span {k}, is joined already; a border is joined once", chain.words);
            draft.error(place, "join.twice", message);
            return false;
        }
    }
    true
}

/// Where a chain runs in space.
pub(super) struct Shape {
    /// Points of every span, in the direction of the chain.
    pub(super) samples: Vec<Vec<DVec3>>,
    /// Whether every span's own direction is the other.
    pub(super) backwards: Vec<bool>,
    pub(super) closed: bool,
}

/// Subdivisions of a span where two borders are compared.
const DEPTH: u32 = 3;

impl Shape {
    /// `None` if a span is no curve.
    pub(super) fn new(chain: &Chain, limits: Limits<'_>, draft: &Draft) -> Option<Self> {
        let mut samples = Vec::with_capacity(chain.spans.len());
        for &(root, boundary) in &chain.spans {
            let root = &draft.roots[root];
            let boundary = draft.states[root.state.index()].boundaries.get(boundary)?;
            let points = limits.curve(boundary.state, DEPTH)?;
            samples.push(points.iter().map(|point| place(&root.points, &boundary.incidence.apply(point))).collect::<Vec<_>>());
        }
        let mut backwards = vec![false; samples.len()];
        let ends = |samples: &[Vec<DVec3>], k: usize| [samples[k][0], samples[k][samples[k].len() - 1]];
        for k in 0..samples.len() {
            let own = ends(&samples, k);
            let gap = |end: DVec3, others: &[DVec3]| others.iter().map(|other| end.distance(*other)).fold(f64::INFINITY, f64::min);
            // The first span ends where the second begins or ends; every other begins where the one before it ended.
            backwards[k] = if k > 0 {
                let before = [ends(&samples, k - 1)[1]];
                gap(own[1], &before) < gap(own[0], &before)
            } else if samples.len() > 1 {
                let next = ends(&samples, 1);
                gap(own[0], &next) < gap(own[1], &next)
            } else {
                false
            };
            if backwards[k] {
                samples[k].reverse();
            }
        }
        let (first, last) = (ends(&samples, 0)[0], ends(&samples, samples.len() - 1)[1]);
        let size = samples.iter().flatten().map(|point| point.distance(first)).fold(0.0, f64::max);
        let closed = first.distance(last) <= 1e-9 * size;
        Some(Self { samples, backwards, closed })
    }

    /// Largest distance between the end of a span and the beginning of the next, and which.
    pub(super) fn gap(&self) -> (f64, usize) {
        let gap = |k: usize| (self.samples[k][self.samples[k].len() - 1].distance(self.samples[k + 1][0]), k);
        (0..self.samples.len() - 1).map(gap).fold((0.0, 0), |a, b| if a.0 >= b.0 { a } else { b })
    }
}

/// The largest distance of two spans' points, and where; `turned`: the second from its other end.
pub(super) fn apart(left: &[DVec3], right: &[DVec3], turned: bool) -> (f64, DVec3) {
    let count = right.len();
    let other = |k: usize| right[if turned { count - 1 - k } else { k }];
    let far = |(k, point): (usize, &DVec3)| (point.distance(other(k)), *point);
    left.iter().enumerate().map(far).fold((0.0, DVec3::ZERO), |a, b| if a.0 >= b.0 { a } else { b })
}

/// For every span of the first border the span of the second that lies on it, and whether their own directions differ.
/// All rotations of borders that close are tried, as far as their first points agree.
pub(super) fn align(first: &Shape, second: &Shape, allowed: f64) -> Vec<(usize, bool)> {
    let count = first.samples.len();
    let rotations = if first.closed && second.closed { count } else { 1 };
    let order = |shift: usize, turned: bool| {
        (0..count).map(move |k| if turned { (2 * count - 1 - k - shift) % count } else { (k + shift) % count })
    };
    let start = |shift: usize, turned: bool| {
        let other = order(shift, turned).next().unwrap_or(0);
        let samples = &second.samples[other];
        first.samples[0][0].distance(if turned { samples[samples.len() - 1] } else { samples[0] })
    };
    let candidates = (0..rotations).flat_map(|shift| [(shift, false), (shift, true)]);
    let near = candidates.clone().map(|(shift, turned)| start(shift, turned)).fold(f64::INFINITY, f64::min);
    let distance = |&(shift, turned): &(usize, bool)| {
        let pairs = order(shift, turned).enumerate();
        pairs.map(|(k, other)| apart(&first.samples[k], &second.samples[other], turned).0).fold(0.0, f64::max)
    };
    let likely = candidates.filter(|&(shift, turned)| rotations == 1 || start(shift, turned) <= near + allowed);
    let best = likely.map(|candidate| (distance(&candidate), candidate)).min_by(|a, b| a.0.total_cmp(&b.0));
    let (shift, turned) = best.map_or((0, false), |(_, candidate)| candidate);
    order(shift, turned).map(|other| (other, turned)).collect()
}
