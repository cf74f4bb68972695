//! Parts of a group that are joined along borders.
//!
//! A join makes two borders one: every span of the first is a span of the second, root edge by root edge, so the parts
//! share their edges and vertices. Borders of parts of different families are edges of different states; `kinds` proves
//! that two states draw the same curves and replaces one by the other. Borders that are no common curve, of a cubic and a
//! quadratic surface, are joined by a strip between them (`strip`).

mod border;
mod fit;
mod kinds;
mod limits;
mod strip;

pub(super) use border::Borders;

use super::lower::Draft;
use crate::automaton::Automaton;
use crate::automaton::topology::Topology;
use border::{Chain, Shape};
use kinds::Kinds;
use limits::Limits;
use std::cmp::Ordering;
use std::collections::BTreeSet;

/// Which border of a part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BorderPath {
    /// A side of a product of two schemes, or of a sum: direction (0 for u, 1 for v), and whether its last end.
    Side {
        /// 0: where u ends; 1: where v ends.
        direction: usize,
        /// At the end of that direction, else at its start.
        last: bool,
    },
    /// Vertices along the border of a subdivision surface's mesh, in either direction; the first again at the end of a
    /// border that is taken all round. Edges between them are spans (Catmull-Clark, Loop); with Doo and Sabin's scheme the
    /// vertices themselves are.
    Vertices(Vec<u32>),
    /// Boundaries (root cell, boundary of its state) of a BC-IFS, one after the other along the border.
    Boundaries(Vec<(usize, usize)>),
}

/// A border of a part of a group.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Border {
    /// Index of the part.
    pub part: usize,
    /// Which of its borders.
    pub path: BorderPath,
}

/// Two borders that become one, or are joined by a strip.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Join {
    /// The borders; which way each runs does not matter.
    pub between: [Border; 2],
    /// Whether a strip fills the space between them: then one belongs to a bicubic and the other to a biquadratic
    /// surface. Otherwise they must be the same curve.
    pub strip: bool,
}

/// What can be found out about the draft's states, or nothing if they are incoherent, which is reported elsewhere.
fn analysed(draft: &Draft) -> Option<(Automaton, Topology)> {
    let automaton = Automaton::new(draft.states.clone()).ok()?;
    let topology = Topology::new(&automaton, &draft.declared).ok()?;
    Some((automaton, topology))
}

/// Joins parts; `parts` has what is known of every part's borders.
///
/// Cost: an analysis of the states, and for every join linear in its spans, quadratic for borders that close.
pub(super) fn lower(joins: &[Join], parts: &[Borders], draft: &mut Draft) {
    let size = super::bcifs::extent(&draft.roots);
    let allowed = super::solve::GLUE_ALLOWED * size;
    let mut taken: BTreeSet<(usize, usize)> = draft.gluings.iter().flat_map(|gluing| gluing.between).collect();
    let mut pairs: Vec<([Chain; 2], String)> = Vec::new();
    let parts_known = joins.iter().any(|join| join.strip).then(|| analysed(draft)).flatten();
    for (index, join) in joins.iter().enumerate() {
        let place = format!("/joins/{index}");
        let [first, second] = [0, 1].map(|side| {
            let place = format!("{place}/between/{side}");
            let chain = border::chain(&join.between[side], parts, &place, draft)?;
            border::claim(&chain, &mut taken, &place, draft).then_some(chain)
        });
        let (Some(first), Some(second)) = (first, second) else { continue };
        if !join.strip {
            pairs.push(([first, second], place));
        } else if let Some((automaton, topology)) = &parts_known {
            let chains = [first, second];
            if let Some(sides) = strip::lower(&chains, Limits { automaton, topology }, allowed, &place, draft) {
                pairs.extend(chains.into_iter().zip(sides).map(|(chain, side)| ([chain, side], place.clone())));
            }
        }
    }
    if draft.has_errors() {
        return;
    }
    let Some((automaton, topology)) = analysed(draft) else { return };
    let mut kinds = Kinds::new(&automaton, &topology, draft);
    for (chains, place) in &pairs {
        glue(chains, place, allowed, &mut kinds, draft);
    }
    if !draft.has_errors()
        && let Err(message) = kinds.replace(draft)
    {
        draft.error("/joins", "join.kind", message);
    }
}

/// Where two borders run, if both are curves of as many spans.
fn shapes(chains: &[Chain; 2], place: &str, allowed: f64, limits: Limits<'_>, draft: &mut Draft) -> Option<[Shape; 2]> {
    let mut found = Vec::with_capacity(2);
    for chain in chains {
        let Some(shape) = Shape::new(chain, limits, draft) else {
            let message = format!("{} is not a curve whose ends are known, so it cannot be joined", chain.words);
            draft.error(place, "join.not-a-curve", message);
            return None;
        };
        let (gap, k) = shape.gap();
        if gap > allowed {
            let message =
                format!("{}: span {} begins {gap:.3e} mm from where span {k} ends; list spans that follow each other", chain.words, k + 1);
            draft.error(place, "join.border", message);
            return None;
        }
        found.push(shape);
    }
    if chains[0].spans.len() != chains[1].spans.len() {
        let words = chains.each_ref().map(|chain| format!("{} has {} spans", chain.words, chain.spans.len()));
        let message = format!("{} and {}: borders that are joined must have the same number", words[0], words[1]);
        draft.error(place, "join.length", message);
        return None;
    }
    found.try_into().ok()
}

/// Finds how two chains lie on each other and glues them span by span.
fn glue(chains: &[Chain; 2], place: &str, allowed: f64, kinds: &mut Kinds<'_>, draft: &mut Draft) {
    let Some([left, right]) = shapes(chains, place, allowed, kinds.limits(), draft) else { return };
    let words = format!("{} and {}", chains[0].words, chains[1].words);
    let order = border::align(&left, &right, allowed);
    for (k, &(other, turned)) in order.iter().enumerate() {
        let (apart, at) = border::apart(&left.samples[k], &right.samples[other], turned);
        // Written so that a distance that is not a number is refused.
        if !matches!(apart.partial_cmp(&allowed), Some(Ordering::Less | Ordering::Equal)) {
            let message = format!(
                "{words} are {apart:.3e} mm apart at ({:.6}, {:.6}, {:.6}), on span {k} of {}, and may be {allowed:.1e} mm apart (1e-6 of the \
                 model's size): they must be the same curve with the same parameters; move one, or join them by a strip",
                at.x,
                at.y,
                at.z,
                order.len()
            );
            return draft.error(place, "join.apart", message);
        }
    }
    for (k, &(other, turned)) in order.iter().enumerate() {
        let between = [chains[0].spans[k], chains[1].spans[other]];
        let turned = turned != (left.backwards[k] != right.backwards[other]);
        if let Err(message) = kinds.glue(between, turned, draft) {
            return draft.error(place, "join.kind", format!("{words}, span {k}: {message}"));
        }
    }
}
