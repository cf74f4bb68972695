//! What union of half-spaces leaves of a tetrahedron: a convex polytope, cut exactly.
//!
//! A half-space is given by its integer values u at the tetrahedron's four vertices; a point with barycentric weights
//! lambda is covered when u . lambda < 0. The polytope is kept as the planar graph of its corners, each on three facets.
//! Whether a corner is covered is the sign of a 4 x 4 determinant of integers, taken in floating point where that is sure and
//! else exactly.
//!
//! Ties are broken by perturbing the values of every half-space by a positive infinitesimal of its own, the larger the
//! smaller its name (Edelsbrunner and Muecke, "Simulation of simplicity", 1990): u + epsilon (1, 1, 1, 1). Determinants with two such rows vanish, so
//! the first order decides, and always does: see [`Outside::covers`]. So every polytope is simple, the order of the cuts does not matter, and two
//! tetrahedra that share a face see the same polygon on it, since values and names are the same from both sides.

/// Largest absolute value at a vertex: minors of three rows and their products with a fourth fit 128 bits.
pub(super) const MOST: i64 = 1 << 26;

/// Values at the four vertices; covered points have a negative combination. `name` says which half-space it is, the same in
/// all tetrahedra.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfSpace {
    pub(super) values: [i64; 4],
    pub(super) name: u64,
    /// The simplex of the tetrahedron that a function V belongs to, see `smooth`; 0 for sites.
    pub(super) simplex: u8,
}

/// What a cut did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cut {
    /// Nothing was covered.
    Missed,
    /// Something is left.
    Changed,
    /// Nothing is left.
    Empty,
}

/// A corner of the polytope: the facets that meet there, counter-clockwise seen from outside the polytope, and its neighbours, each along the edge
/// that the other two facets share.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub(super) facets: [u16; 3],
    neighbours: [u16; 3],
    /// Barycentric weights, to rounding.
    pub(super) weights: [f64; 4],
}

/// Facets below this are the tetrahedron's: facet m lies opposite to vertex m.
pub(super) const FACES: u16 = 4;

/// See the module's comment. Reused from tetrahedron to tetrahedron.
#[derive(Debug, Default)]
pub(super) struct Outside {
    rows: Vec<HalfSpace>,
    corners: Vec<Corner>,
    covered: Vec<bool>,
    renumbered: Vec<u16>,
}

impl Outside {
    /// The whole tetrahedron.
    pub(super) fn reset(&mut self) {
        self.rows.clear();
        self.corners.clear();
        for m in 0..4 {
            let mut values = [0; 4];
            values[m] = 1;
            self.rows.push(HalfSpace { values, name: 0, simplex: 0 });
        }
        // (k, a, b, c) even for a positive tetrahedron: seen from outside, a, c, b turn counter-clockwise around k.
        for (k, around) in [[1, 3, 2], [0, 2, 3], [3, 1, 0], [2, 0, 1]].into_iter().enumerate() {
            let mut weights = [0.0; 4];
            weights[k] = 1.0;
            self.corners.push(Corner { facets: around, neighbours: around, weights });
        }
    }

    /// The corners; none when everything is covered.
    pub(super) fn corners(&self) -> &[Corner] {
        &self.corners
    }

    /// The name of the half-space that bounds a facet from `FACES` on.
    pub(super) fn name(&self, facet: u16) -> u64 {
        self.rows[usize::from(facet)].name
    }

    /// The simplex of the half-space that bounds a facet from `FACES` on.
    pub(super) fn simplex(&self, facet: u16) -> u8 {
        self.rows[usize::from(facet)].simplex
    }

    /// The values of the half-space of a facet.
    pub(super) fn values(&self, facet: u16) -> [i64; 4] {
        self.rows[usize::from(facet)].values
    }

    /// Facets so far, those that later cuts removed included.
    pub(super) fn facets(&self) -> u16 {
        self.rows.len() as u16
    }

    /// Takes away what a half-space covers.
    pub(super) fn cut(&mut self, half_space: HalfSpace) -> Cut {
        self.covered.clear();
        let mut any = 0;
        for index in 0..self.corners.len() {
            let covered = self.covers(&half_space, index);
            any += usize::from(covered);
            self.covered.push(covered);
        }
        if any == 0 {
            return Cut::Missed;
        }
        if any == self.corners.len() {
            self.corners.clear();
            return Cut::Empty;
        }
        let facet = self.rows.len() as u16;
        self.rows.push(half_space);
        let old = self.corners.len();
        for index in 0..old {
            if self.covered[index] {
                continue;
            }
            for slot in 0..3 {
                let corner = self.corners[index];
                if self.covered[usize::from(corner.neighbours[slot])] {
                    self.corners[index].neighbours[slot] = self.corners.len() as u16;
                    let facets = [facet, corner.facets[(slot + 2) % 3], corner.facets[(slot + 1) % 3]];
                    let weights = self.weights(facets);
                    self.corners.push(Corner { facets, neighbours: [index as u16; 3], weights });
                }
            }
        }
        // Every facet that the plane crosses has two new corners: they are neighbours along the new facet.
        for index in old..self.corners.len() {
            for (slot, shared) in [(1, 2), (2, 1)] {
                let wanted = self.corners[index].facets[shared];
                let partner = (old..self.corners.len()).find(|&other| other != index && self.corners[other].facets[1..].contains(&wanted));
                self.corners[index].neighbours[slot] = partner.unwrap_or(index) as u16;
            }
        }
        self.drop_covered(old);
        Cut::Changed
    }

    fn drop_covered(&mut self, old: usize) {
        self.renumbered.clear();
        let mut count = 0;
        for index in 0..self.corners.len() {
            self.renumbered.push(count);
            if index >= old || !self.covered[index] {
                self.corners[usize::from(count)] = self.corners[index];
                count += 1;
            }
        }
        self.corners.truncate(usize::from(count));
        for corner in &mut self.corners {
            corner.neighbours = corner.neighbours.map(|neighbour| self.renumbered[usize::from(neighbour)]);
        }
    }

    /// The polygon of a facet, counter-clockwise seen from the covered side's opposite, the inside of the polytope being behind
    /// it: as indices of corners. Empty when the facet is gone.
    pub(super) fn polygon(&self, facet: u16, polygon: &mut Vec<u16>) {
        polygon.clear();
        let Some(start) = self.corners.iter().position(|corner| corner.facets.contains(&facet)) else { return };
        let mut at = start as u16;
        loop {
            polygon.push(at);
            let corner = &self.corners[usize::from(at)];
            let slot = corner.facets.iter().position(|&other| other == facet).unwrap_or(0);
            at = corner.neighbours[(slot + 1) % 3];
            if at == start as u16 || polygon.len() > self.corners.len() {
                return;
            }
        }
    }

    /// Whether a half-space covers a corner.
    ///
    /// The corner's weights are the minors of its three rows, normalised to a positive sum s = det(a, b, c, 1), which is not zero:
    /// a perturbed corner at which it vanished would lie at infinity, the sum having no perturbation. Of D = det(a, b, c, u) the perturbation is
    /// sum of epsilon_m det(.. row m replaced by 1 ..), exactly; the last of these to be asked at the latest, that of u itself, is s > 0.
    fn covers(&self, half_space: &HalfSpace, index: usize) -> bool {
        let corner = &self.corners[index];
        let value: f64 = (0..4).map(|k| corner.weights[k] * half_space.values[k] as f64).sum();
        // Weights are exact to 4 roundings each and sum to 1: the sum errs by less than 10 roundings of the largest value.
        if value.abs() > 1e-14 * MOST as f64 {
            return value < 0.0;
        }
        self.covers_exactly(half_space, corner.facets)
    }

    #[cold]
    fn covers_exactly(&self, half_space: &HalfSpace, facets: [u16; 3]) -> bool {
        let rows = facets.map(|facet| self.rows[usize::from(facet)].values);
        let (minors, sign) = normalised(minors(&rows));
        let dot = |minors: &[i128; 4]| -> i128 { (0..4).map(|k| minors[k] * i128::from(half_space.values[k])).sum() };
        let value = dot(&minors);
        if value != 0 {
            return value < 0;
        }
        let mut order: Vec<(u64, Option<usize>)> = facets
            .iter()
            .enumerate()
            .filter(|&(_, &facet)| facet >= FACES)
            .map(|(slot, &facet)| (self.rows[usize::from(facet)].name, Some(slot)))
            .collect();
        order.push((half_space.name, None));
        order.sort_unstable_by_key(|&(name, _)| name);
        for (_, slot) in order {
            let Some(slot) = slot else { return false };
            let mut replaced = rows;
            replaced[slot] = [1; 4];
            let value = sign * dot(&self::minors(&replaced));
            if value != 0 {
                return value < 0;
            }
        }
        false
    }

    /// Barycentric weights of the point on three facets.
    fn weights(&self, facets: [u16; 3]) -> [f64; 4] {
        let rows = facets.map(|facet| self.rows[usize::from(facet)].values);
        let (minors, _) = normalised(minors(&rows));
        let weights = minors.map(|minor| minor as f64);
        let sum: f64 = weights.iter().sum();
        weights.map(|weight| weight / sum)
    }
}

/// Signed 3 x 3 minors: det(a, b, c, x) = minors . x.
fn minors(rows: &[[i64; 4]; 3]) -> [i128; 4] {
    // 2 x 2 minors of the first two rows fit 64 bits.
    let pair = |k: usize, l: usize| rows[0][k] * rows[1][l] - rows[0][l] * rows[1][k];
    let (p01, p02, p03, p12, p13, p23) = (pair(0, 1), pair(0, 2), pair(0, 3), pair(1, 2), pair(1, 3), pair(2, 3));
    let c = rows[2].map(i128::from);
    let times = |p: i64, k: usize| i128::from(p) * c[k];
    [
        -(times(p12, 3) - times(p13, 2) + times(p23, 1)),
        times(p02, 3) - times(p03, 2) + times(p23, 0),
        -(times(p01, 3) - times(p03, 1) + times(p13, 0)),
        times(p01, 2) - times(p02, 1) + times(p12, 0),
    ]
}

fn normalised(minors: [i128; 4]) -> ([i128; 4], i128) {
    let sign = if minors.iter().sum::<i128>() < 0 { -1 } else { 1 };
    (minors.map(|minor| sign * minor), sign)
}
