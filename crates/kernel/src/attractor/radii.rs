//! Radii of their own that roots give to the balls around their points, and the attractor on whose roots they are constant.

use super::cell::{Cell, ControlPoint, Site, child_points};
use super::refine::{RefineError, rounding_mm};
use super::sites::reachable;
use super::{Attractor, Root, StateBound};
use crate::automaton::StateId;
use crate::budget::Budget;
use std::borrow::Cow;

/// The radius of the ball that dilates a root's cell, where it is not the one asked for. In mm.
#[derive(Clone, Debug, PartialEq)]
pub enum OwnRadius {
    /// One for all points.
    Constant(f64),
    /// One at every control point, and between them what the same subdivision makes of these; nowhere less than the second.
    AtPoints(Vec<f64>, f64),
    /// r_k = max(least, first ratio^k) + grown on what leaves the root's recursion at level k, the number of transitions taken within it; `least` + `grown` on its limit set.
    ByLevel {
        /// At level 0.
        first: f64,
        /// From one level to the next, below 1.
        ratio: f64,
        /// Nowhere less.
        least: f64,
        /// Added to all.
        grown: f64,
    },
}

/// An attractor whose roots have one radius each.
pub(crate) struct Graded {
    pub(crate) attractor: Attractor,
    /// Of every root, in mm.
    pub(crate) radii: Vec<f64>,
    /// Its dilation differs from the one asked for by this much at most: with D(e) that of all radii less or more e, D(-deviation) in it in D(deviation).
    pub(crate) deviation_mm: f64,
}

impl Attractor {
    /// Gives roots radii of their own: one entry for every root, or none at all.
    pub(crate) fn with_radii(mut self, radii: Vec<Option<OwnRadius>>) -> Self {
        self.radii = if radii.iter().all(Option::is_none) { Vec::new() } else { radii };
        self
    }

    /// Whether some root has a radius of its own.
    #[must_use]
    pub fn has_own_radii(&self) -> bool {
        !self.radii.is_empty()
    }

    /// The least and the largest radius at roots, where `asked` is that of roots without their own. What varies is nowhere less, and more only where a
    /// subdivision with negative weights overshoots.
    #[must_use]
    pub fn radii(&self, asked: f64) -> [f64; 2] {
        let of_root = |root: usize| match self.own_radius(root) {
            None => [asked; 2],
            Some(OwnRadius::Constant(own)) => [*own; 2],
            Some(OwnRadius::AtPoints(radii, least)) => [*least, radii.iter().copied().fold(*least, f64::max)],
            Some(OwnRadius::ByLevel { first, least, grown, .. }) => [least + grown, first.max(*least) + grown],
        };
        (0..self.roots.len()).map(of_root).fold([f64::INFINITY, 0.0], |all, own| [all[0].min(own[0]), all[1].max(own[1])])
    }

    /// The radius of a root's own.
    pub(crate) fn own_radius(&self, root: usize) -> Option<&OwnRadius> {
        self.radii.get(root).and_then(Option::as_ref)
    }

    /// The attractor with all own radii larger by a length.
    #[must_use]
    pub(crate) fn with_grown_radii(&self, by: f64) -> Cow<'_, Self> {
        if !self.has_own_radii() {
            return Cow::Borrowed(self);
        }
        let grown = |own: &OwnRadius| match own {
            OwnRadius::Constant(radius) => OwnRadius::Constant(radius + by),
            OwnRadius::AtPoints(radii, least) => OwnRadius::AtPoints(radii.iter().map(|radius| radius + by).collect(), least + by),
            &OwnRadius::ByLevel { first, ratio, least, grown } => OwnRadius::ByLevel { first, ratio, least, grown: grown + by },
        };
        let radii = self.radii.iter().map(|own| own.as_ref().map(grown)).collect();
        Cow::Owned(Self { radii, ..self.clone() })
    }

    /// Splits roots until each has one radius, `asked` where it has none of its own, within `tolerance`.
    ///
    /// A cell C of which r(x) is the radius at x, and sites S within d of each other, with all r within v of one radius s: the dilation of S by s is in that of C by r + d + v, and
    /// holds that of C by r - d - v.
    ///
    /// # Errors
    /// [`RefineError`]: a limit, or a stop.
    pub(crate) fn graded(&self, asked: f64, tolerance: f64, budget: &Budget) -> Result<Graded, RefineError> {
        let mut grading = Grading {
            attractor: self,
            tolerance,
            budget,
            roots: Vec::new(),
            kept: Vec::new(),
            radii: Vec::new(),
            deviation_mm: 0.0,
            simplices: [1, 2, 3].map(|corners| self.automaton.simplex(corners)),
        };
        for (index, root) in self.roots.iter().enumerate() {
            let cell = self.root_cell(index);
            match self.own_radius(index) {
                None => grading.keep(root.clone(), asked, Some(index)),
                Some(OwnRadius::Constant(radius)) => grading.keep(root.clone(), *radius, Some(index)),
                Some(OwnRadius::AtPoints(radii, least)) => {
                    let radii: Vec<ControlPoint> =
                        root.points.iter().zip(radii).map(|(point, r)| [point[3] * r, 0.0, 0.0, point[3]]).collect();
                    grading.at_points(&cell, &root.points, &radii, *least, 0)?;
                }
                Some(&OwnRadius::ByLevel { first, ratio, least, grown }) => {
                    let within = reachable(&self.automaton, root.state);
                    let recursion: Vec<bool> = (0..self.automaton.states().len())
                        .map(|state| {
                            within.contains(&state) && reachable(&self.automaton, StateId::new(state)).contains(&root.state.index())
                        })
                        .collect();
                    grading.by_level(root, &root.points, root.state, &recursion, [first, ratio, least, grown], 0)?;
                }
            }
        }
        let Grading { roots, kept, radii, deviation_mm, .. } = grading;
        let mut solids = self.solids.clone();
        for solid in &mut solids {
            // Roots of a solid are kept, one after the other.
            solid.first_root = kept.iter().position(|&root| root == Some(solid.first_root)).unwrap_or(0);
        }
        let own = radii.iter().map(|&radius| Some(OwnRadius::Constant(radius))).collect();
        let deviation_mm = if deviation_mm > 0.0 {
            let largest =
                roots.iter().flat_map(|root| &root.points).flat_map(|point| &point[..3]).fold(0.0, |most: f64, x| most.max(x.abs()));
            deviation_mm + rounding_mm(largest)
        } else {
            0.0
        };
        let trims = vec![None; roots.len()];
        Ok(Graded { attractor: Self { roots, solids, brep: None, trims, radii: own, ..self.clone() }, radii, deviation_mm })
    }
}

struct Grading<'a> {
    attractor: &'a Attractor,
    tolerance: f64,
    budget: &'a Budget,
    roots: Vec<Root>,
    /// Which root of the attractor each of them is, if one.
    kept: Vec<Option<usize>>,
    radii: Vec<f64>,
    deviation_mm: f64,
    simplices: [Option<StateId>; 3],
}

impl Grading<'_> {
    fn keep(&mut self, root: Root, radius: f64, kept: Option<usize>) {
        self.roots.push(root);
        self.radii.push(radius);
        self.kept.push(kept);
    }

    fn check(&self, depth: u32, reached_mm: f64) -> Result<(), RefineError> {
        let (limits, tolerance_mm) = (self.budget.limits, self.tolerance);
        if self.roots.len().is_multiple_of(1024) {
            self.budget.cancel.check()?;
        }
        if self.roots.len() as u64 >= limits.cells {
            return Err(RefineError::Cells { allowed: limits.cells, tolerance_mm });
        }
        if depth >= limits.depth {
            return Err(RefineError::Depth { allowed: limits.depth, tolerance_mm, reached_mm });
        }
        Ok(())
    }

    /// Cells whose radius varies: `radii` are control points of it as a coordinate.
    fn at_points(
        &mut self,
        cell: &Cell,
        points: &[ControlPoint],
        radii: &[ControlPoint],
        least: f64,
        depth: u32,
    ) -> Result<(), RefineError> {
        let attractor = self.attractor;
        let state = attractor.state_of(cell);
        let [low, high] = self.range(cell, radii, least);
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let error = attractor.leaf_error(cell, points).min(cell.ball.radius);
        self.check(depth, error + half)?;
        if error + half <= self.tolerance {
            self.deviation_mm = self.deviation_mm.max(error + half);
            let mut sites = Vec::new();
            attractor.emit(cell, points, &mut |site| sites.push(site));
            for site in sites {
                self.site(&site, middle);
            }
            return Ok(());
        }
        if state.transitions.is_empty() {
            return self.bisected(cell, points, radii, least, depth);
        }
        for (index, transition) in state.transitions.iter().enumerate() {
            let columns = transition.operator.columns();
            let (mut child, mut own) = (vec![[0.0; 4]; columns], vec![[0.0; 4]; columns]);
            child_points(points, &transition.operator, &mut child);
            child_points(radii, &transition.operator, &mut own);
            let next = attractor.child_cell(cell, index, &child);
            self.at_points(&next, &child, &own, least, depth + 1)?;
        }
        Ok(())
    }

    /// The radii of a cell lie between these: the bound of its hull holds in every coordinate.
    fn range(&self, cell: &Cell, radii: &[ControlPoint], least: f64) -> [f64; 2] {
        let values = || radii.iter().map(|r| r[0] / r[3]);
        let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        let margin = match self.attractor.bound(cell.state) {
            StateBound::Hull { margin, .. } => *margin * (high - low),
            // Only affine maps have frames, and those have no radii at points.
            StateBound::Frame { .. } => 0.0,
        };
        [(low - margin).max(least), (high + margin).max(least)]
    }

    /// A segment or triangle whose radius varies too much, cut across the side along which it varies most.
    fn bisected(
        &mut self,
        cell: &Cell,
        points: &[ControlPoint],
        radii: &[ControlPoint],
        least: f64,
        depth: u32,
    ) -> Result<(), RefineError> {
        let value = |k: usize| radii[k][0] / radii[k][3];
        let sides = (0..points.len()).flat_map(|p| (0..p).map(move |q| (p, q)));
        let Some((p, q)) = sides.max_by(|a, b| (value(a.0) - value(a.1)).abs().total_cmp(&(value(b.0) - value(b.1)).abs())) else {
            return Ok(());
        };
        let middle = |list: &[ControlPoint]| std::array::from_fn(|axis| 0.5 * (list[p][axis] + list[q][axis]));
        for replaced in [p, q] {
            let (mut half, mut own) = (points.to_vec(), radii.to_vec());
            (half[replaced], own[replaced]) = (middle(points), middle(radii));
            self.at_points(cell, &half, &own, least, depth + 1)?;
        }
        Ok(())
    }

    fn site(&mut self, site: &Site, radius: f64) {
        let corners: &[[f64; 3]] = match site {
            Site::Point(point) => std::slice::from_ref(point),
            Site::Segment(ends) => ends,
            Site::Triangle(corners) => corners,
        };
        let Some(state) = self.simplices[corners.len() - 1] else { return };
        let points = corners.iter().map(|&[x, y, z]| [x, y, z, 1.0]).collect();
        self.keep(Root { state, points, rational: false, solid: None }, radius, None);
    }

    /// Cells of a recursion, level by level.
    fn by_level(
        &mut self,
        root: &Root,
        points: &[ControlPoint],
        state: StateId,
        recursion: &[bool],
        [radius, ratio, least, grown]: [f64; 4],
        depth: u32,
    ) -> Result<(), RefineError> {
        self.check(depth, radius)?;
        let own = radius.max(least) + grown;
        if radius <= least || !recursion[state.index()] {
            self.keep(Root { state, points: points.to_vec(), ..root.clone() }, own, None);
            return Ok(());
        }
        for transition in &self.attractor.automaton.state(state).transitions {
            let mut child = vec![[0.0; 4]; transition.operator.columns()];
            child_points(points, &transition.operator, &mut child);
            let next = if recursion[transition.to.index()] { radius * ratio } else { radius };
            self.by_level(root, &child, transition.to, recursion, [next, ratio, least, grown], depth + 1)?;
        }
        Ok(())
    }
}
