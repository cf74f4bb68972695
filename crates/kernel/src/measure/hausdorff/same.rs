//! What two shapes have in common exactly: simplices with the same coordinates. No point of them is at a distance, and no search is needed to see it.

use super::Filled;
use crate::attractor::cell::{Point, Site};
use crate::measure::contact::{Nature, NodeId, Tree, corners};
use crate::solid::TriMesh;
use std::collections::HashSet;

/// The coordinates of a simplex's corners, by their bits, the least first: a triangle turned by a corner is the same, one turned over is not.
type Key = Vec<[u64; 3]>;

fn key(corners: &[Point]) -> Key {
    // Minus zero is zero.
    let bits: Key = corners.iter().map(|corner| corner.map(|x| (x + 0.0).to_bits())).collect();
    let least = (0..bits.len()).min_by_key(|&k| bits[k]).unwrap_or(0);
    [&bits[least..], &bits[..least]].concat()
}

/// The simplices of a shape that are known exactly.
fn exact<'t>(tree: &'t Tree<'_>, id: NodeId) -> Option<&'t Site> {
    match (tree.node(id).body.nature, tree.node(id).body.sites.as_slice()) {
        (Nature::Exact, [site]) if !tree.node(id).is_group() => Some(site),
        _ => None,
    }
}

/// For the nodes of the first shape that were made so far, whether they hold nothing but simplices of the second.
///
/// Cost: one entry of a table per root of the second, and a look-up per root of the first.
pub(super) fn shared(first: &mut Tree<'_>, second: &Tree<'_>) -> Vec<bool> {
    let count = |tree: &Tree<'_>| tree.count() as NodeId;
    let known: HashSet<Key> = (0..count(second)).filter_map(|id| exact(second, id)).map(|site| key(corners(site))).collect();
    let mut shared = vec![false; count(&*first) as usize];
    // Groups come before what they stand for.
    for id in (0..count(&*first)).rev() {
        shared[id as usize] = if first.node(id).is_group() {
            first.children(id).all(|child| shared[child as usize])
        } else {
            exact(first, id).is_some_and(|site| known.contains(&key(corners(site))))
        };
    }
    shared
}

/// For every solid of either shape, whether the other has the same one, triangle by triangle: nothing of its inside is outside of the other.
///
/// Cost: one entry of a table per triangle of every solid that has as many triangles as some of the other shape.
pub(super) fn shared_solids(solids: [&[Filled<'_>]; 2]) -> [Vec<bool>; 2] {
    let count = |solid: &Filled<'_>| solid.mesh.triangles.len();
    let keys = |mesh: &TriMesh| -> HashSet<Key> {
        mesh.triangles.iter().map(|triangle| key(&triangle.map(|index| mesh.vertices[index as usize].to_array()))).collect()
    };
    let keys_of = |own: &[Filled<'_>], others: &[Filled<'_>]| -> Vec<Option<HashSet<Key>>> {
        own.iter().map(|solid| others.iter().any(|other| count(other) == count(solid)).then(|| keys(solid.mesh))).collect()
    };
    let [first, second] = [keys_of(solids[0], solids[1]), keys_of(solids[1], solids[0])];
    [(&first, &second), (&second, &first)].map(|(own, others)| own.iter().map(|keys| keys.is_some() && others.contains(keys)).collect())
}
