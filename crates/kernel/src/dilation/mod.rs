//! Thickening: the solid D_r = attractor + closed ball of radius r, on a sparse body-centred lattice, with proven bounds.
//!
//! In every tetrahedron of the lattice the solid is a union of half-spaces, one for every site near: where the affine
//! function with the values of the site's squared distance at the four vertices is below theta. Creases between sites are
//! cut where those functions meet; so, with R a tetrahedron's circumradius, D(sqrt(theta - R^2)) subset solid subset D(sqrt(theta))
//! for the sites (see `block`). theta = r^2, and R^2 = r^2 - (r - e)^2 is a pitch of some 2.5 sqrt(r e), whatever the shape, and
//! 0.65 r at most: above that, which is where e is larger than r / 14, surfaces take longer for more triangles (see `plan`).
//!
//! Where the solid leaves out a critical point of the distance below r, or its surface does not follow the distance, the lattice is refined until it does not: the solid then has
//! D(r)'s topology (proven in `critical`, shown there and in `star`). Where no level is fine enough, that is counted as uncertain.
//!
//! Where points stand for cells, as in most fractals, there are too many of them to be told apart. There the least squared distance at the lattice's vertices alone decides
//! (marching tetrahedra): nothing that sites cover is lost, and what is filled between them is proven to be within the tolerance, or the lattice is refined.
//! Its cubes are larger than that asks where one site serves all that is filled. Gaps that it cannot follow are closed with a ball first (see `block`): without that they would end in false tunnels.
//! What topology that has is told by other points: `flow` shows that their dilation has that of the attractor's, and `told` counts what theirs has.
//! Where all of these points are in one plane, there are far fewer that matter, and a sheet over the plane is the surface (`dense` and `planar` in `arrangement`); cells with few control points are seen as affine frames for that, see `framed` in `attractor`.
//!
//! Points, segments and triangles of which few are near to each other, wires, panels and the faces of solids, need no lattice: a polytope stands for each, and their union's boundary is found facet by facet (`arrangement`) and simplified part by
//! part (`patches`). Of pieces that are alike but for where they are, as in dusts and on trays, one is made and put where the others are (`copies` there). Points and segments in one plane are a sheet over it and its mirror image (`planar` there).
//!
//! NURBS and subdivision surfaces, and all others of which faces are known that hang together, are drawn as triangles first if they are smooth (`drawn`): a sheet on either side of these is the solid's surface (`offset` in `arrangement`); around most solids, and NURBS volumes that are proven to be such (`volume` in `attractor`), there is one outside.
//! Meshes that are far finer than the tolerance are made of fewer triangles first (`decimation`), unless sheets serve all of them; of few triangles only where fewer tell the topology, or all are too many.
//! For graphs over a convex part of a plane that have very many cells, as rough ones do, rays stand that lead down and up from a few of their places (`peaks`): between two sheets is all that is near to these.
//! Where sites are not the shape itself, the topology is proven for it all the same if both are near enough to each other (`steady` there).
//!
//! Parts may have radii of their own (`deficit` in `attractor::sites`). Walls and closings are made of dilations of surfaces (`wall`).
//!
//! The mesh is a closed, oriented 2-manifold by construction: see `block` and `outside`. Triangles are then saved within the same bounds (`simplify`).

mod affine;
mod arrangement;
mod assemble;
mod block;
mod certificate;
mod convex;
mod critical;
mod decimation;
mod drawn;
mod dust;
mod error;
mod flow;
mod frame;
mod half_ball;
mod lattice;
mod octree;
mod outside;
mod parting;
mod patches;
mod peaks;
mod plan;
mod pool;
mod removed;
mod sample;
mod seam;
mod setting;
mod simplify;
mod slivers;
mod smooth;
mod squares;
mod stability;
mod star;
mod stitch;
mod surface;
mod told;
mod tree;
mod unfold;
mod wall;

use crate::attractor::{Attractor, Graph};
use crate::budget::{Budget, Limits};
use crate::measure::bounds::AxisBox;
use crate::solid::Solid;
use crate::tolerance::{Radius, Tolerance};
use drawn::{Drawn, Finer, SHARES_OF_FEW, unless_stopped};
pub use error::DilationError;
use plan::{Balls, Plan};
pub use stability::{Change, CriticalRadius, Stability, Verdict, stability};
pub use wall::{Side, Wall, close, wall};

/// A dilated shape with what is proven of it. Lengths in mm.
#[derive(Clone, Debug)]
pub struct Dilation {
    /// The solid; its coordinates are single-precision numbers.
    pub solid: Solid,
    /// D(r - inner) is inside the solid, whatever radius r parts have of their own.
    pub inner_mm: f64,
    /// The solid is inside D(r + outer).
    pub outer_mm: f64,
    /// a; none where few sites are near to each other, which need no lattice (see `arrangement`).
    pub pitch_mm: Option<f64>,
    /// Leaf cells met, each once in every block of the lattice that needed it, or once where there is no lattice.
    pub leaf_cells: u64,
    /// Pairs of triangles that meet elsewhere than where they are joined.
    pub crossings: u64,
    /// The box of the exact dilation.
    pub bounds: AxisBox,
    /// The least radius: the one asked for, unless parts have their own.
    pub least_radius_mm: f64,
    /// Cubes of the lattice where the distance may have a critical point so close to r that the topology there is not certain, as far as they were looked at: others beside them are not; without a lattice, sets of sites whose dilations may or may not
    /// have a common point, of places with very many of them some. Where points stand for cells critical points of theirs are not those of the attractor: these are not counted, but it is one where the solid is shown to have another topology.
    pub uncertain: u64,
    /// Whether it is proven that the solid has as many components, handles and voids as the exact dilation (see `critical`, and `nerve` in `arrangement`), where nothing was uncertain and no triangles cross: of points, wires, surfaces and solids of these; of curves and smooth surfaces, if what stands for them is near enough (see `steady` there) or is shown to have their topology (see `flow`); and of all that is told by a few points (see `told`).
    pub topology_exact: bool,
}

/// Dilates an attractor by the closed ball of radius r, to the tolerance: both bounds of the result are at
/// most `tolerance`.
///
/// Cost follows the area of the result divided by r times the tolerance, not the number of cells. The result does not
/// depend on the number of threads.
///
/// # Errors
/// [`DilationError`]: a limit, with a value that would pass, or a stop.
pub fn dilate(attractor: &Attractor, radius: Radius, tolerance: Tolerance, budget: &Budget) -> Result<Dilation, DilationError> {
    run(&Order::new(attractor, radius, tolerance, true, budget), budget)
}

/// As [`dilate`], with the triangles of the lattice: only those that have no area are removed.
///
/// # Errors
/// As [`dilate`].
pub fn dilate_unsimplified(
    attractor: &Attractor,
    radius: Radius,
    tolerance: Tolerance,
    budget: &Budget,
) -> Result<Dilation, DilationError> {
    run(&Order::new(attractor, radius, tolerance, false, budget), budget)
}

/// The dilation of a surface by other ways than sheets along it, where a sheet on the side that is asked for does not come out; along fewer triangles that stand for it they may yet.
///
/// # Errors
/// As [`dilate`].
fn dilate_without_sheets(attractor: &Attractor, radius: Radius, tolerance: Tolerance, budget: &Budget) -> Result<Dilation, DilationError> {
    run(&Order { has_sheets: false, ..Order::new(attractor, radius, tolerance, true, budget) }, budget)
}

/// The dilation of a solid of triangles by a sheet around it; none where that does not serve it.
///
/// # Errors
/// A stop.
fn sheets_around(solid: &Attractor, radius: Radius, tolerance: Tolerance, budget: &Budget) -> Result<Option<Dilation>, DilationError> {
    let order = Order { attractor: solid, radius, tolerance, simplify: true, has_sheets: true, finer: None };
    unless_stopped(order.plan_of(solid, COARSE, budget).and_then(|plan| plan.run_in_sheets(budget)))
}

/// The share of what they may be off that sites, and triangles of trimmed surfaces, use: for as few of them as possible, and for some times as many, which may tell the topology where the first do not.
const COARSE: f64 = 1.0;
const FINER: [f64; 2] = [0.35, 0.125];

/// How many times as many leaf cells there are at least without frames where these serve, and where nothing else does; and how many of them are counted.
const FEWER_FRAMES: usize = 2;
const FAR_FEWER_FRAMES: usize = 16;
const MOST_COUNTED: usize = 1_000_000;
/// So few cells of what lies in a plane need no frames.
const FEW_IN_PLANE: usize = 256;

/// Few cells of a graph; few are those of products, too, that are split along one factor at a time.
const FEW_CELLS: usize = 20_000;

/// Cells that finer sites are made of at most, for each of the first: along curves and surfaces that are smooth they are three to eight times as many.
const MORE_CELLS: u64 = 10;

fn run(order: &Order<'_>, budget: &Budget) -> Result<Dilation, DilationError> {
    let framed = order.framed(budget)?;
    if let Some(framed) = &framed
        && let Some(dilation) = unless_stopped(order.plan_of(&framed.attractor, COARSE, budget)?.run_arranged(budget))?
    {
        return Ok(dilation);
    }
    if let Some(dilation) = order.in_sheets(budget, |plan| plan.run_in_sheets(budget))? {
        return Ok(dilation);
    }
    let graph = order.graph(budget)?;
    let by_rays = |cells: Cells| order.over_graph(graph.as_ref(), cells, budget, |plan, graph| plan.run_over(graph, budget));
    if let Some(dilation) = by_rays(Cells::Many)? {
        return Ok(dilation);
    }
    let on_lattice = |framed: &Framed| order.plan_of(&framed.attractor, COARSE, budget)?.run_on_lattice(budget);
    if let Some(framed) = framed.as_ref().filter(|framed| framed.are_far_fewer) {
        return on_lattice(framed);
    }
    let finer = |cells: u64| {
        let limits = Limits { cells: budget.limits.cells.min(MORE_CELLS * cells), ..budget.limits };
        let aside = Budget { limits, ..budget.aside() };
        for coarseness in FINER {
            let made = unless_stopped(order.planned(coarseness, &aside, |plan| plan.run_if_told(&aside)))?;
            if made.is_some() {
                return Ok(made);
            }
        }
        Ok(None)
    };
    let instead = || match (by_rays(Cells::Few)?, &framed) {
        (None, Some(framed)) => on_lattice(framed).map(Some),
        (made, _) => Ok(made),
    };
    let aside = budget.aside();
    if let Some(dilation) = order.by_fewer(&aside, |plan| plan.run_if_told(&aside))? {
        budget.prove(dilation.inner_mm.max(dilation.outer_mm));
        return Ok(dilation);
    }
    // What these leave in doubt the mesh itself may tell, unless that is too much.
    let made = order.planned(COARSE, budget, |plan| plan.run(finer, instead, budget));
    order.or_by_fewer(made, budget, |plan| plan.run_arranged(budget))
}

/// Cells of a graph. Many are left to rays at once; few serve better themselves, unless they need a lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cells {
    Few,
    Many,
}

/// A shape by frames, for points to stand for its cells: in a plane, and where a lattice is needed anyway.
struct Framed {
    attractor: Attractor,
    /// Whether a lattice of these serves better than all that is made of other sites, as these are so many.
    are_far_fewer: bool,
}

/// What is asked for.
struct Order<'a> {
    attractor: &'a Attractor,
    radius: Radius,
    tolerance: Tolerance,
    simplify: bool,
    /// Whether sheets along it may serve.
    has_sheets: bool,
    finer: Option<Finer>,
}

impl<'a> Order<'a> {
    fn new(attractor: &'a Attractor, radius: Radius, tolerance: Tolerance, simplify: bool, budget: &Budget) -> Self {
        let finer = if simplify { Finer::of(attractor, radius, tolerance, budget) } else { None };
        Self { attractor, radius, tolerance, simplify, has_sheets: true, finer }
    }

    /// What comes of the plan for a smooth surface, or a mesh that is finer than needed; none where it is none, or where sheets do not serve it.
    fn in_sheets<T>(
        &self,
        budget: &Budget,
        work: impl FnOnce(&Plan<'_>) -> Result<Option<T>, DilationError>,
    ) -> Result<Option<T>, DilationError> {
        if !self.has_sheets {
            return Ok(None);
        }
        let smooth = if self.simplify { Drawn::smooth(self.attractor, self.radius, self.tolerance, budget)? } else { None };
        let Some(smooth) = smooth else {
            // Where these serve all of a mesh that is finer than needed, fewer triangles are not asked for.
            return match self.finer {
                Some(_) => unless_stopped(self.plan_of(self.attractor, COARSE, budget).and_then(|plan| work(&plan))),
                None => Ok(None),
            };
        };
        unless_stopped(smooth.plan(self.simplify, COARSE, budget).and_then(|plan| work(&plan)))
    }

    /// What comes of the plan by fewer triangles for a mesh of few that are finer than needed: the nearest to it that serve.
    fn by_fewer<T>(
        &self,
        budget: &Budget,
        work: impl Fn(&Plan<'_>) -> Result<Option<T>, DilationError>,
    ) -> Result<Option<T>, DilationError> {
        let Some(finer) = self.finer.as_ref().filter(|finer| finer.has_few()) else { return Ok(None) };
        for share in SHARES_OF_FEW {
            let Some(fewer) = Drawn::decimated(finer, self.attractor, self.radius, self.tolerance, share, budget)? else { continue };
            let made = unless_stopped(fewer.plan(self.simplify, COARSE, budget).and_then(|plan| work(&plan)))?;
            if made.is_some() {
                return Ok(made);
            }
        }
        Ok(None)
    }

    /// What was made; or where there was too much of it, the same by fewer triangles, whether these tell the topology or not.
    fn or_by_fewer<T>(
        &self,
        made: Result<T, DilationError>,
        budget: &Budget,
        work: impl Fn(&Plan<'_>) -> Result<Option<T>, DilationError>,
    ) -> Result<T, DilationError> {
        match made {
            Err(error @ (DilationError::Triangles { .. } | DilationError::LeafCells { .. } | DilationError::Cells { .. })) => {
                self.by_fewer(budget, work)?.ok_or(error)
            }
            made => made,
        }
    }

    /// The same shape by frames; none where there are not far fewer cells of these.
    fn framed(&self, budget: &Budget) -> Result<Option<Framed>, DilationError> {
        if !self.simplify || !self.attractor.has_frames() {
            return Ok(None);
        }
        let own = self.plan_of(self.attractor, COARSE, budget)?;
        let few = if own.is_thin(budget) { FEW_IN_PLANE } else { FEW_CELLS };
        if own.leaves(few, budget)?.is_some() {
            return Ok(None);
        }
        let Some(attractor) = self.attractor.framed() else { return Ok(None) };
        // What frames are too coarse for, others may do.
        let Some(plan) = unless_stopped(self.plan_of(&attractor, COARSE, budget).map(Some))? else { return Ok(None) };
        let cells = plan.leaves(MOST_COUNTED, budget)?.unwrap_or(MOST_COUNTED);
        let are_fewer = |times: usize| own.leaves(times * cells, budget).map(|leaves| leaves.is_none());
        Ok(if are_fewer(FEWER_FRAMES)? { Some(Framed { attractor, are_far_fewer: are_fewer(FAR_FEWER_FRAMES)? }) } else { None })
    }

    /// What it is the graph of over a convex part of a plane, and of how many cells; none where it is none.
    fn graph(&self, budget: &Budget) -> Result<Option<(Graph, Cells)>, DilationError> {
        let Some(graph) = self.simplify.then(|| self.attractor.graph()).flatten() else { return Ok(None) };
        let plan = self.plan_of(self.attractor, COARSE, budget)?;
        let are_few = plan.leaves(FEW_CELLS, budget)?.is_some() || (graph.has_smooth_curves && plan.split(budget)?.is_some());
        Ok(Some((graph, if are_few { Cells::Few } else { Cells::Many })))
    }

    /// What comes of the plan for a graph, if it is made of as many cells; none where it is not, or where rays do not serve it.
    fn over_graph<T>(
        &self,
        graph: Option<&(Graph, Cells)>,
        cells: Cells,
        budget: &Budget,
        work: impl FnOnce(&Plan<'_>, &Graph) -> Result<Option<T>, DilationError>,
    ) -> Result<Option<T>, DilationError> {
        match graph {
            Some((graph, own)) if *own == cells => work(&self.plan_of(self.attractor, COARSE, budget)?, graph),
            _ => Ok(None),
        }
    }

    /// The plan of a shape with one radius, the attractor or what stands for it.
    fn plan_of<'b>(&self, attractor: &'b Attractor, coarseness: f64, budget: &Budget) -> Result<Plan<'b>, DilationError> {
        let balls = Balls { least: self.radius.mm(), most: self.radius.mm() };
        let plan = Plan::new(attractor, balls, self.tolerance, self.simplify, coarseness, budget)?;
        Ok(if self.has_sheets { plan } else { plan.without_sheets() })
    }

    /// What comes of the plan with sites of some coarseness.
    fn planned<T>(
        &self,
        coarseness: f64,
        budget: &Budget,
        work: impl FnOnce(&Plan<'_>) -> Result<T, DilationError>,
    ) -> Result<T, DilationError> {
        let Self { attractor, radius, tolerance, simplify, .. } = *self;
        let resolved = Drawn::resolved(attractor, radius, tolerance, coarseness, budget)?;
        let drawn = match (resolved, &self.finer) {
            (None, Some(finer)) if !finer.has_few() => {
                Drawn::decimated(finer, attractor, radius, tolerance, coarseness * finer.most_share(), budget)?
            }
            (resolved, _) => resolved,
        };
        match drawn {
            Some(drawn) => work(&drawn.plan(simplify, coarseness, budget)?),
            None => {
                let whole = self.plan_of(attractor, coarseness, budget)?;
                // Of a finer mesh these were asked first, see `in_sheets`.
                let whole = if self.finer.is_some() { whole.without_sheets() } else { whole };
                match whole.split(budget)? {
                    Some(split) => work(&self.plan_of(&split, coarseness, budget)?),
                    None => work(&whole),
                }
            }
        }
    }
}

/// What a dilation is predicted to cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Triangles that the limit of triangles is held against: those of the lattice as it is first.
    pub counted_triangles: f64,
    /// Triangles of the result without simplification: what is refined for the topology is in it, what is no more than rounding is not.
    pub triangles: f64,
    /// Memory that the surface takes at its peak, in bytes.
    pub memory_bytes: f64,
    /// Leaf cells that the blocks of the lattice meet, as [`Dilation::leaf_cells`] counts them.
    pub leaf_cells: f64,
    /// Memory that the simplification takes for each thread, in bytes; 0 without it.
    pub simplifying_bytes: f64,
    /// That of all blocks together, in bytes: what the simplification looks at, and so a measure of its work.
    pub looked_at_bytes: f64,
    /// Nodes and sites that the searches for the nearest sites look at: a measure of their work.
    pub searched: f64,
    /// Sites that searches find near points, for each point anew: all of these are compared there.
    pub found: f64,
    /// The result is nowhere thinner: 2 (r - i), with the least radius r and the most that the inner bound i may be.
    pub least_thickness_mm: f64,
    /// a, in mm, where there is a lattice.
    pub pitch_mm: Option<f64>,
}

/// Predicts what [`dilate`] will make, or without `simplify` [`dilate_unsimplified`], from a sample of the lattice. Where fewer triangles stand for a mesh, that is what comes of these if no set of sites is left in doubt; what comes of them where
/// all are too many is not foreseen.
///
/// # Errors
/// As [`dilate`], for what shows before the work.
pub fn predict(
    attractor: &Attractor,
    radius: Radius,
    tolerance: Tolerance,
    simplify: bool,
    budget: &Budget,
) -> Result<Prediction, DilationError> {
    let order = Order::new(attractor, radius, tolerance, simplify, budget);
    let framed = order.framed(budget)?;
    if let Some(framed) = &framed
        && let Some(prediction) = unless_stopped(order.plan_of(&framed.attractor, COARSE, budget)?.predict_arranged(budget))?
    {
        return Ok(prediction);
    }
    if let Some(prediction) = order.in_sheets(budget, |plan| plan.predict_in_sheets(budget))? {
        return Ok(prediction);
    }
    let graph = order.graph(budget)?;
    let by_rays = |cells: Cells| order.over_graph(graph.as_ref(), cells, budget, |plan, graph| plan.predict_over(graph, budget));
    if let Some(prediction) = by_rays(Cells::Many)? {
        return Ok(prediction);
    }
    let on_lattice = |framed: &Framed| order.plan_of(&framed.attractor, COARSE, budget)?.predict_on_lattice(budget);
    if let Some(framed) = framed.as_ref().filter(|framed| framed.are_far_fewer) {
        return on_lattice(framed);
    }
    let instead = || match (by_rays(Cells::Few)?, &framed) {
        (None, Some(framed)) => on_lattice(framed).map(Some),
        (made, _) => Ok(made),
    };
    if let Some(prediction) = order.by_fewer(budget, |plan| plan.predict_if_told(budget))? {
        return Ok(prediction);
    }
    order.planned(COARSE, budget, |plan| plan.predict(instead, budget))
}
