//! What stands for a leaf cell of a state with a B-rep: the chord of a curve, the polygon of a face's corners.
//!
//! A state is a curve between its ends when its children form a chain of such curves from one end to the other. Its
//! attractor is then the limit of connected chains, hence connected and containing both ends (Hata, "On the structure
//! of self-similar sets", Japan J. Appl. Math. 2, 1985, for one state).

use super::topology::Topology;
use super::{Automaton, LeafPrimitive, StateId};

/// The two ends of a curve, in its state's barycentric space. Both belong to the attractor.
#[derive(Clone, Debug, PartialEq)]
pub struct Ends {
    /// Where it starts.
    pub start: Vec<f64>,
    /// Where it ends.
    pub end: Vec<f64>,
}

/// Sets the leaf primitives of edges that are curves and of faces that their edges surround.
pub(super) fn connect(automaton: &mut Automaton, topology: &Topology) {
    for index in 0..automaton.states().len() {
        let id = StateId::new(index);
        let own = topology.state(id);
        if automaton.state(id).leaf != LeafPrimitive::Centre {
            continue;
        }
        let point = |cell: usize| own.closure.cells[cell].point.clone();
        if let (Some(_), Some([start, end])) = (&own.chain, topology.ends(id)) {
            automaton.set_leaf(id, LeafPrimitive::Chord(Ends { start: point(start), end: point(end) }));
        } else if own.dimension == 1 && own.connected && !own.closure.boundaries.is_empty() {
            automaton.set_leaf(id, LeafPrimitive::Star(own.closure.cells.iter().map(|cell| cell.point.clone()).collect()));
        } else if let Some(outline) = &own.outline {
            let corner = |&(position, backwards): &(usize, bool)| {
                let edge = &own.closure.cells[position];
                let [start, end] = topology.ends(edge.state)?;
                Some(point(edge.cells[if backwards { end } else { start }].0))
            };
            if let Some(corners) = outline.iter().map(corner).collect() {
                automaton.set_leaf(id, LeafPrimitive::Polygon(corners));
            }
        }
    }
}
