//! The dilation of solids from that of their surfaces.
//!
//! Let S hold the surface of a solid M. D_r(M) is M and D_r(S). A boundary of D_r(S), or of what stands for it, is nowhere nearer to S than the band's inner end, so each of its connected surfaces lies inside of M as a whole, or
//! outside: without those inside, the rest bounds the dilation of M. While the dilations of the sites become the polytopes (see `nerve`) no surface meets S, so each is on one side of it all the time, and what is proven of the topology of both
//! unions holds for what is left of them.

use crate::dilation::surface::BlockSurface;
use crate::groups::Groups;
use crate::solid::Inside;
use glam::DVec3;

/// Leaves out the surfaces inside of solids. False, with nothing changed, where a solid's own surface winds around one otherwise than once: then it crosses itself.
pub(super) fn leave_out(solids: &[Inside<'_>], surface: &mut BlockSurface) -> bool {
    let is_outside = |x: DVec3| {
        let mut windings = solids.iter().map(|solid| solid.winding(x));
        windings.try_fold(true, |is_outside, winding| (0..=1).contains(&winding).then_some(is_outside && winding == 0))
    };
    solids.is_empty() || keep(surface, is_outside)
}

/// Keeps the connected surfaces of which a vertex is wanted. False, with nothing changed, where that is not known of one.
pub(super) fn keep(surface: &mut BlockSurface, is_wanted: impl Fn(DVec3) -> Option<bool>) -> bool {
    let groups = Groups::of_triangles(surface.vertices.len(), &surface.triangles).all();
    let mut is_kept = vec![false; groups.len()];
    // A group is called by the least of its vertices.
    for (vertex, _) in (0..).zip(&groups).filter(|&(vertex, &group)| vertex == group) {
        let Some(is_so) = is_wanted(DVec3::from_array(surface.vertices[vertex as usize])) else { return false };
        is_kept[vertex as usize] = is_so;
    }
    surface.triangles.retain(|triangle| is_kept[groups[triangle[0] as usize] as usize]);
    surface.drop_unused();
    true
}
