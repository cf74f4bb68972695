//! Which faces are seen from the other side: of a face's children, and of the roots.

use super::NotEnclosed;
use crate::attractor::Attractor;
use crate::automaton::StateId;
use crate::automaton::topology::{Source, Topology, View};
use std::collections::BTreeMap;

/// An edge, and which way a face's outline runs along it.
type Side<K> = (K, bool);

/// Whether a curve, viewed so, starts where it ends.
fn is_flipped(topology: &Topology, edge: StateId, view: View) -> Option<bool> {
    let [start, _] = topology.ends(edge)?;
    Some(topology.cell_seen(edge, view, start).0 != start)
}

/// Which faces are to be turned so that neighbours run along their edges in opposite directions, and how many groups of neighbours there are. Faces of the first
/// entry stay as they are, and so does the first of every further group. `None` when they cannot be turned so, or an edge has more than two sides.
fn turned<K: Ord + Copy>(faces: &[Vec<Side<K>>]) -> Option<(Vec<bool>, usize)> {
    let mut along: BTreeMap<K, Vec<(usize, bool)>> = BTreeMap::new();
    for (face, sides) in faces.iter().enumerate() {
        sides.iter().for_each(|&(edge, backwards)| along.entry(edge).or_default().push((face, backwards)));
    }
    let mut turned: Vec<Option<bool>> = vec![None; faces.len()];
    let mut groups = 0;
    for first in 0..faces.len() {
        if turned[first].is_some() {
            continue;
        }
        groups += 1;
        turned[first] = Some(false);
        let mut waiting = vec![(first, false)];
        while let Some((face, own)) = waiting.pop() {
            for &(edge, backwards) in &faces[face] {
                let sides = &along[&edge];
                if sides.len() > 2 {
                    return None;
                }
                // The same face on both sides, or its neighbour; none at a border.
                let place = sides.iter().position(|&side| side == (face, backwards))?;
                let Some(&(other, other_backwards)) = sides.get(1 - place) else { continue };
                let wanted = own ^ backwards ^ other_backwards ^ true;
                match turned[other] {
                    Some(known) if known != wanted => return None,
                    Some(_) => {}
                    None => {
                        turned[other] = Some(wanted);
                        waiting.push((other, wanted));
                    }
                }
            }
        }
    }
    Some((turned.into_iter().flatten().collect(), groups))
}

/// Of every child of a face, whether its outline runs against its parent's.
pub(super) fn children_turned(topology: &Topology, id: StateId) -> Option<Vec<bool>> {
    /// Edges inside come before those on the parent's boundary.
    type Key = (bool, usize, usize);
    let own = topology.state(id);
    let outline = own.outline.as_ref()?;
    // The parent from behind: as if it were a neighbour of all children at its boundary.
    let mut faces: Vec<Vec<Side<Key>>> = vec![Vec::new()];
    for &(cell, backwards) in outline {
        let chain = topology.state(own.closure.cells[cell].state).chain.as_ref()?;
        faces[0].extend(chain.iter().map(|&(piece, piece_backwards)| ((true, cell, piece), !(backwards ^ piece_backwards))));
    }
    for (child, sources) in own.split.children.iter().enumerate() {
        let state = topology.state(own.split.pieces[child].state);
        let mut sides = Vec::new();
        for &(cell, backwards) in state.outline.as_ref()? {
            let (key, view) = match sources[cell] {
                Source::Piece { cell, piece, view } => ((true, cell, piece), view),
                Source::Fresh { index, view } => ((false, index, 0), view),
                Source::Vertex { .. } => return None,
            };
            sides.push((key, backwards ^ is_flipped(topology, state.closure.cells[cell].state, view)?));
        }
        faces.push(sides);
    }
    let (turned, groups) = turned(&faces)?;
    (groups == 1 || own.split.children.is_empty()).then(|| turned[1..].to_vec())
}

/// Of every root, whether its outline runs against that of the first.
pub(super) fn roots_turned(attractor: &Attractor) -> Result<Vec<bool>, NotEnclosed> {
    let (topology, start) = attractor.brep().ok_or(NotEnclosed::NoSurface)?;
    let mut faces: Vec<Vec<Side<u32>>> = Vec::with_capacity(attractor.roots().len());
    let mut uses: BTreeMap<u32, u32> = BTreeMap::new();
    for (index, root) in attractor.roots().iter().enumerate() {
        let own = topology.state(root.state);
        let mut sides = Vec::new();
        for &(cell, backwards) in own.outline.as_ref().ok_or(NotEnclosed::NoSurface)? {
            let (edge, view) = start.cell_of(index, cell);
            if !start.is_collapsed(edge) {
                let flipped = is_flipped(topology, own.closure.cells[cell].state, view).ok_or(NotEnclosed::NoSurface)?;
                sides.push((edge, backwards ^ flipped));
                *uses.entry(edge).or_default() += 1;
            }
        }
        faces.push(sides);
    }
    let open = uses.values().filter(|&&uses| uses != 2).count();
    if open > 0 {
        return Err(NotEnclosed::Open(open as u64));
    }
    match turned(&faces) {
        None => Err(NotEnclosed::OneSided("it can be walked around to the other side".to_owned())),
        Some((_, groups)) if groups > 1 => Err(NotEnclosed::Pieces(groups)),
        Some((turned, _)) => Ok(turned),
    }
}
