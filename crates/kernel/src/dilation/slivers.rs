//! Slivers of a surface that is not simplified: only what lies around them is looked at, so that a surface of any size takes no more memory than itself.

use super::simplify::Core;
use super::surface::BlockSurface;
use crate::solid::around::Around;
use crate::solid::half_edges::NONE;
use crate::solid::mend::{LEAST_HEIGHT, is_sliver};
use std::collections::HashSet;

/// The triangles within `width` of slivers that are new in a node; none where there are no such slivers. One that a smaller node could not remove is not tried
/// again before something around it is new: its corners are `settled`.
///
/// Removing a vertex changes the surface in the box of its star alone. Only where many slivers are removed in a row could that leave what is
/// looked at, and crossings are looked for at the end.
pub(super) fn around(surface: &BlockSurface, core: &Core, rounding: f64, width: f64) -> Option<Around> {
    let at = |corner: u32| surface.vertices[corner as usize];
    let is_new = |triangle: &[u32; 3]| {
        triangle.iter().any(|&corner| !surface.settled[corner as usize])
            && triangle.iter().all(|&corner| core.contains(&at(corner)))
            && is_sliver(&triangle.map(at), LEAST_HEIGHT * rounding)
    };
    let corners: HashSet<u32> = surface.triangles.iter().filter(|triangle| is_new(triangle)).flatten().copied().collect();
    (!corners.is_empty()).then(|| Around::of(&surface.vertices, &surface.triangles, &corners, width))
}

/// Gives what is left of them back to the surface.
pub(super) fn write(around: Around, surface: &mut BlockSurface) {
    let numbers = around.write(&mut surface.vertices, &mut surface.triangles);
    surface.shared.iter_mut().for_each(|(_, number)| *number = numbers[*number as usize]);
    surface.shared.retain(|&(_, number)| number != NONE);
}

/// Notes as settled what lies in the core with all of its neighbours: all that could be tried was.
pub(super) fn settle(surface: &mut BlockSurface, core: &Core) {
    surface.settled.clear();
    surface.settled.extend(surface.vertices.iter().map(|point| core.contains(point)));
    for triangle in &surface.triangles {
        if triangle.iter().any(|&corner| !core.contains(&surface.vertices[corner as usize])) {
            triangle.iter().for_each(|&corner| surface.settled[corner as usize] = false);
        }
    }
}
