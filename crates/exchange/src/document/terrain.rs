//! Reads terrains.

use glam::DVec3;
use lacuna_kernel::model::{Terrain, TerrainBase};

use super::grammar::{Member, TERRAIN};
use super::node::Place;
use super::transform::points;
use super::walk::{Members, Walker, length};
use crate::diagnostic::code;

/// A `terrain` shape.
pub(super) fn terrain(walker: &mut Walker<'_>, place: Place<'_>, added: &[Member]) -> Option<Terrain> {
    let members = walker.object_of(place, &TERRAIN, added)?;
    let base = base(walker, &members);
    let roughness = members.get("roughness").and_then(|place| walker.number(place));
    let levels = members.get("levels").and_then(|place| walker.integer(place, "a number of levels"));
    let random_seed = members.get("random_seed").map_or(Some(0), |place| walker.integer(place, "a seed"));
    // So many levels that their number does not matter: the kernel says how many there may be.
    let levels = u32::try_from(levels?).unwrap_or(u32::MAX);
    Some(Terrain { base: base?, roughness: roughness?, levels, random_seed: random_seed? })
}

fn base(walker: &mut Walker<'_>, members: &Members<'_>) -> Option<TerrainBase> {
    match (members.get("triangle"), members.get("grid")) {
        (Some(place), None) => {
            if let Some(found) = length(place.node)
                && found != 3
            {
                return walker.wrong_length(&place, found, "three points");
            }
            let corners: [DVec3; 3] = points(walker, place, 3)?.try_into().ok()?;
            Some(TerrainBase::Triangle(corners))
        }
        (None, Some(place)) => {
            walker.each_of(place, 2, "an array of rows of points", |walker, row| points(walker, row, 2)).map(TerrainBase::Grid)
        }
        (Some(_), Some(place)) => {
            walker.fault(&place, code::CONFLICTING_MEMBERS, || {
                "\"triangle\" and \"grid\" exclude each other; leave one of them out".to_owned()
            });
            None
        }
        (None, None) => {
            walker.fault(&members.place, code::MISSING_MEMBER, || {
                "a terrain needs the member \"triangle\" (three points) or \"grid\" (rows of points)".to_owned()
            });
            None
        }
    }
}
