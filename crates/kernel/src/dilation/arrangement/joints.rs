//! Where segments end at others, their dilations are cut: what balls around the common end add lies in that of one of them, or of all together.
//!
//! Let site S_i have the end B and the unit vector u_i along it, out of B. Its dilations may be cut by the half-space H_i: (x - B) . u_i <= c_i, c_i > 0, if
//!
//! * (one keeps) another site that ends at B, with no smaller a radius, is not cut there, or one that goes on through B has no smaller a radius, or
//! * (none does) all sites that end at B have one radius, are cut there, and c_i > m r, with m the length of some vector w in the hull of the u_j.
//!
//! Then D_t(S) is the union of the D_t(S_i) in H_i, for all t up to r. For let S_i be nearest to x in D_t(S), and x not in H_i. Then B is its closest point. All other sites that end at B are no nearer, and those with no
//! smaller a radius no farther: B is their closest point, too, so that x is beyond the other end of none of them, and beyond neither end of what goes on through B. Where one keeps, x is in what is left of its dilation. Where none does and x is in no H_j,
//! (x - B) . u_j > m r for all of them, and for w; but (x - B) . w <= |x - B| m <= m r.
//!
//! So all caps but one are left out, and that one, too, where wires cross or go on nearly straight. The bounds of the union, and those of its topology, hold for bodies that are cut as for whole ones.

use super::figure::{Figure, Outline, order};
use super::polytopes::{Plane, Shell, beyond_place, ordered};
use crate::attractor::cell::{Point, between, distance_squared, dot, subtract, unit};
use crate::budget::{Budget, Stopped};
use crate::dilation::convex::Convex;
use crate::solid::box_tree::{Box32, BoxTree};
use crate::split_mix;

/// What a cut is farther out than it must be, in units of the band between the balls: by a half to a whole, so that none coincide.
const SHIFT: f64 = 0.04;
/// Steps towards the shortest vector of a hull.
const STEPS: usize = 32;
/// How far a place on a segment is from its ends that counts as between them, in units of the radius: far more than what closest points move by where places do by rounding.
const CLEAR: f64 = 1e-3;
/// The share of the room for shifts that cuts leave to strips.
const LEAST_ROOM: f64 = 0.25;

/// An end of a site, or a place on one where others end.
pub(super) struct End {
    pub(super) at: Point,
    pub(super) site: u32,
    /// Which of the two, in their order; none in the middle, and of a point.
    pub(super) end: Option<usize>,
}

/// Points, and the ends of segments, in the order of their places.
pub(super) fn ends(sites: &[Figure]) -> Vec<End> {
    let mut ends: Vec<End> = Vec::with_capacity(2 * sites.len());
    for (site, figure) in (0..).zip(sites).filter(|(_, figure)| matches!(figure.outline, Outline::Point(_) | Outline::Segment(_))) {
        let [first, second] = ordered(figure);
        if first == second {
            ends.push(End { at: first, site, end: None });
        } else {
            ends.extend([first, second].into_iter().enumerate().map(|(end, at)| End { at, site, end: Some(end) }));
        }
    }
    sort(&mut ends);
    ends
}

fn sort(ends: &mut [End]) {
    ends.sort_unstable_by(|a, b| order(&a.at, &b.at).then(a.site.cmp(&b.site)));
}

/// How far beyond its ends, in their order, every site may be cut; none where it is not. What is no farther than `flatness` from a segment is on it. Polytopes that are cut at both ends are around the inner ball where their corners are `girth` times as far, others where they are `reach` times as far.
///
/// # Errors
/// [`Stopped`].
pub(super) fn cuts(
    sites: &[Figure],
    flatness: f64,
    [reach, girth]: [f64; 2],
    shell: impl Fn(&Figure) -> Shell,
    budget: &Budget,
) -> Result<Vec<[Option<f64>; 2]>, Stopped> {
    let mut ends = ends(sites);
    let through = through(sites, flatness, ends.chunk_by(|a, b| a.at == b.at), &shell, budget)?;
    ends.extend(through);
    sort(&mut ends);
    let joints = || ends.chunk_by(|a, b| a.at == b.at).filter(|joint| joint.len() > 1);
    let mut is_joined = vec![[false; 2]; sites.len()];
    for end in joints().flatten() {
        end.end.into_iter().for_each(|own| is_joined[end.site as usize][own] = true);
    }
    let mut cuts = vec![[None; 2]; sites.len()];
    let mut outwards = Vec::new();
    for joint in joints() {
        let deficit = |end: &End| sites[end.site as usize].deficit;
        let least = joint.iter().map(deficit).fold(f64::INFINITY, f64::min);
        let shell = shell(&sites[joint[0].site as usize]);
        let length = if joint.iter().all(|end| end.end.is_some() && deficit(end) == least) {
            outwards.clear();
            outwards.extend(joint.iter().map(|end| outward(sites, end)));
            shortest(&outwards)
        } else {
            f64::INFINITY
        };
        let band = shell.outer - shell.inner;
        let has_free_ends = joint.iter().any(|end| end.end.is_some_and(|own| !is_joined[end.site as usize][1 - own]));
        let most = farthest(shell, if has_free_ends { reach } else { girth });
        // All radii in question are below the outer one.
        let common = length * shell.outer + SHIFT * band;
        let keeper = joint.iter().filter(|end| deficit(end) == least).min_by_key(|end| (end.end.is_some(), end.site)).map(|end| end.site);
        for end in joint {
            let Some(own) = end.end else { continue };
            let shift = shift(shell, u64::from(end.site) << 1 | own as u64);
            if common < most {
                cuts[end.site as usize][own] = Some(length * shell.outer + shift);
            } else if Some(end.site) != keeper {
                cuts[end.site as usize][own] = Some(shift);
            }
        }
    }
    // Where the other end keeps, a cut far out leaves its cap no room. It may be left out: then the site keeps at both.
    for (site, cut) in sites.iter().zip(&mut cuts).filter(|(_, cut)| cut.contains(&None)) {
        let most = farthest(shell(site), reach);
        cut.iter_mut().for_each(|cut| *cut = cut.filter(|beyond| *beyond < most));
    }
    Ok(cuts)
}

/// The places between the ends of segments, and clear of these, where others end that have no larger a radius: one segment for each place.
fn through<'a>(
    sites: &[Figure],
    flatness: f64,
    joints: impl Iterator<Item = &'a [End]>,
    shell: impl Fn(&Figure) -> Shell,
    budget: &Budget,
) -> Result<Vec<End>, Stopped> {
    let mut tree = BoxTree::default();
    let box_of = |site: u32| {
        let figure = &sites[site as usize];
        let is_segment = matches!(figure.outline, Outline::Segment(_));
        is_segment.then(|| figure.box_within(flatness))
    };
    tree.build(sites.len(), box_of, true);
    let mut found = Vec::new();
    for joint in joints {
        budget.cancel.check()?;
        let (at, deficit) = (joint[0].at, |end: &End| sites[end.site as usize].deficit);
        let least = joint.iter().map(deficit).fold(f64::INFINITY, f64::min);
        let keeps = |site: &u32| {
            let figure = &sites[*site as usize];
            let is_on = distance_squared(&figure.closest(&at), &at) <= flatness * flatness;
            let clear = CLEAR * shell(figure).outer;
            is_on && figure.corners().iter().all(|end| distance_squared(end, &at) > clear * clear) && figure.deficit <= least
        };
        tree.query(&Box32::of(&[at]), 0, |leaf| {
            let keeper = tree.items(leaf).iter().find(|site| keeps(site));
            found.extend(keeper.map(|&site| End { at, site, end: None }));
            keeper.is_none()
        });
    }
    Ok(found)
}

/// How far out a polytope may be cut so that its corners, which are so many times farther out than the inner radius at least, have room.
fn farthest(shell: Shell, times: f64) -> f64 {
    let least = shell.inner * times;
    (shell.outer.powi(2) - (least + LEAST_ROOM * (shell.outer - least)).powi(2)).max(0.0).sqrt()
}

/// The planes that a figure's dilations are cut by: beyond the ends of a segment, or the sides of a polygon.
pub(super) fn planes(figure: &Figure, beyond: &[Option<f64>]) -> Box<[Plane]> {
    let cut = beyond.iter().enumerate().filter_map(|(place, beyond)| beyond.map(|beyond| (place, beyond)));
    if let Some(polygon) = figure.polygon() {
        return cut.map(|(side, beyond)| beyond_place(polygon.outward[side], &polygon.corners[side], beyond)).collect();
    }
    let ends = ordered(figure);
    cut.map(|(end, beyond)| beyond_place(unit(&subtract(&ends[end], &ends[1 - end])), &ends[end], beyond)).collect()
}

/// The unit vector along a segment, out of one of its ends.
pub(super) fn outward(sites: &[Figure], end: &End) -> Point {
    let ends = ordered(&sites[end.site as usize]);
    let own = end.end.unwrap_or_default();
    unit(&subtract(&ends[own], &ends[1 - own]))
}

/// The length of a vector in the hull of some, nearly the shortest: each step goes to the shortest on the way to the lowest of them (Gilbert, 1966).
fn shortest(vectors: &[Point]) -> f64 {
    let mut x = vectors[0];
    for _ in 0..STEPS {
        let lowest = vectors.iter().min_by(|a, b| dot(a, &x).total_cmp(&dot(b, &x)));
        let Some(lowest) = lowest else { break };
        let way = subtract(lowest, &x);
        let square = dot(&way, &way);
        if square == 0.0 {
            break;
        }
        x = between(&x, lowest, (-dot(&x, &way) / square).clamp(0.0, 1.0));
    }
    dot(&x, &x).sqrt()
}

/// How much farther out a cut is than it must be, which looks random and is told by a seed.
pub(super) fn shift(shell: Shell, seed: u64) -> f64 {
    SHIFT * (shell.outer - shell.inner) * (0.5 + 0.5 * split_mix::share(split_mix::number(!seed.wrapping_mul(split_mix::STEP))))
}

#[cfg(test)]
mod tests {
    use super::super::form::{Form, Kind};
    use super::*;
    use crate::attractor::cell::Site;
    use crate::dilation::convex::Convex;
    use crate::dilation::tree::Weighted;
    use crate::split_mix::Random;

    /// Balls around what joints bring together are covered by what is left of each segment's own.
    #[test]
    fn what_is_cut_off_is_in_others() {
        let mut random = Random(11);
        let (shell, mut one_keeps, mut none_does, mut one_goes_on) = (Shell { inner: 0.9, outer: 1.1 }, 0, 0, 0);
        let covering = Form::within(shell.reach(), Kind::Rod).expect("coarse enough").covering;
        for round in 0..400 {
            let mut unit = || (random.next() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
            let mut vector = || -> Point { std::array::from_fn(|_| unit()) };
            let (count, straight) = (2 + round % 5, vector());
            let through = vector();
            let mut sites: Vec<Figure> = (0..count)
                .map(|k| {
                    let bend = [1.0, 0.3, 0.05][round % 3];
                    let way = match round % 4 {
                        0 => vector(),
                        // Nearly straight on, and across each other.
                        1 => between(&straight.map(|x| if k % 2 == 0 { x } else { -x }), &vector(), bend),
                        2 => std::array::from_fn(|axis| if axis == k / 2 % 3 { [3.0, -3.0][k % 2] } else { 0.0 }),
                        _ => vector().map(|x| 0.3 * x),
                    };
                    let (centre, deficit) = ([5.0, -7.0, 2.0], if round % 7 == 6 { 0.2 * k as f64 } else { 0.0 });
                    let end = std::array::from_fn(|axis| centre[axis] + way[axis]);
                    Weighted { site: if k == 5 { Site::Point(centre) } else { Site::Segment([end, centre]) }, deficit }.into()
                })
                .collect();
            // One that goes on through the centre, as large as any or smaller.
            if round % 3 == 1 {
                let ends = [1.7, -2.3].map(|far| std::array::from_fn(|axis| [5.0, -7.0, 2.0][axis] + far * through[axis]));
                sites.push(Weighted { site: Site::Segment(ends), deficit: if round % 2 == 0 { 0.0 } else { 0.1 } }.into());
            }
            let of = |site: &Figure| Shell { inner: site.in_space(shell.inner), outer: site.in_space(shell.outer) };
            let cuts = cuts(&sites, 1e-12, [covering.reach, covering.girth], of, &Budget::default()).unwrap();
            let centre = [5.0, -7.0, 2.0];
            let joint = |k: usize| ordered(&sites[k]).iter().position(|end| *end == centre).expect("all end there");
            let cut = (0..count).filter(|&k| cuts[k][joint(k)].is_some()).count();
            // One of six is a point.
            assert!(cut + 1 + count / 6 >= count, "{round}");
            one_keeps += usize::from(cut < count);
            let is_whole = sites.get(count).is_some_and(|through| sites[..count].iter().all(|site| site.deficit >= through.deficit));
            one_goes_on += usize::from(is_whole && cut + count / 6 == count);
            none_does += usize::from(cut == count && sites.len() == count);
            for _ in 0..300 {
                let x: Point = std::array::from_fn(|axis| centre[axis] + 1.5 * unit());
                let nearest = sites.iter().map(|site| site.distance_squared(&x)).fold(f64::INFINITY, f64::min).sqrt();
                let holds = |(figure, cuts): (&Figure, &[Option<f64>; 2])| {
                    let ends = ordered(figure);
                    let length = distance_squared(&ends[0], &ends[1]).sqrt();
                    figure.distance_squared(&x).sqrt() <= nearest * (1.0 + 1e-12)
                        && (0..2).all(|end| {
                            let along = subtract(&ends[end], &ends[1 - end]);
                            cuts[end].is_none_or(|most| dot(&subtract(&x, &ends[end]), &along) <= most * length)
                        })
                };
                assert!(nearest > 1.1 || sites.iter().zip(&cuts).any(holds), "{round}: {x:?}");
            }
        }
        assert!(one_keeps > 100 && none_does > 60 && one_goes_on > 40, "{one_keeps} {none_does} {one_goes_on}");
    }
}
