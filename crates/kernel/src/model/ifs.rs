//! Iterated function systems of affine maps of space.

use super::lower::Draft;
use crate::attractor::Root;
use crate::automaton::{Drawing, LeafPrimitive, State, StateId, SubdivisionOperator, Transition};
use glam::{DMat3, DVec3};

/// The affine map x -> A x + t of space, t in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AffineMap {
    /// A.
    pub linear: DMat3,
    /// t, in mm.
    pub translation: DVec3,
}

/// The compact drawn at the leaves of an [`Ifs`], in mm.
#[derive(Clone, Debug, PartialEq)]
pub enum Primitive {
    /// Points.
    Points(Vec<DVec3>),
    /// An open or closed polyline.
    Polyline {
        /// The corners in order.
        points: Vec<DVec3>,
        /// Whether the last corner is joined to the first.
        closed: bool,
    },
    /// A polygon mesh, taken as a surface.
    Mesh {
        /// Corner points.
        vertices: Vec<DVec3>,
        /// Corner indices of each face.
        faces: Vec<Vec<u32>>,
    },
    /// A closed, outward polygon mesh, taken with its interior.
    Solid {
        /// Corner points.
        vertices: Vec<DVec3>,
        /// Corner indices of each face.
        faces: Vec<Vec<u32>>,
    },
}

/// An iterated function system: maps T_i, and the attractor A = union of T_i A.
#[derive(Clone, Debug, PartialEq)]
pub struct Ifs {
    /// The maps.
    pub maps: Vec<AffineMap>,
    /// What is drawn at the leaves; a point of each leaf cell when absent.
    pub primitive: Option<Primitive>,
    /// `graph[i]` lists the maps that may follow map i in an address (a graph-directed system);
    /// all when absent.
    pub graph: Option<Vec<Vec<usize>>>,
}

impl AffineMap {
    /// The identity.
    pub const IDENTITY: Self = Self { linear: DMat3::IDENTITY, translation: DVec3::ZERO };

    fn is_finite(&self) -> bool {
        self.linear.is_finite() && self.translation.is_finite()
    }

    /// The operator on a frame: column j holds the frame coordinates of the image of frame point j.
    fn operator(&self, frame: &Frame) -> SubdivisionOperator {
        let barycentric = |x: DVec3| [1.0 - (x.x + x.y + x.z), x.x, x.y, x.z];
        let translation = (self.linear * frame.origin - frame.origin + self.translation) / frame.unit;
        let mut columns = Vec::with_capacity(16);
        columns.extend(barycentric(translation));
        for axis in 0..3 {
            columns.extend(barycentric(translation + self.linear.col(axis)));
        }
        SubdivisionOperator::exact(4, columns)
    }
}

/// The affine frame (origin, origin + unit e1, ...) in which a system is iterated: near the attractor and of its
/// size, so that coordinates in it are of order 1 and lose no digits, wherever the shape lies.
struct Frame {
    origin: DVec3,
    unit: f64,
}

impl Frame {
    fn of(maps: &[AffineMap]) -> Self {
        let mut origin = DVec3::ZERO;
        for _ in 0..200 {
            origin = maps.iter().map(|map| map.linear * origin + map.translation).sum::<DVec3>() / maps.len() as f64;
        }
        if !origin.is_finite() {
            // Maps that do not contract are refused later, in any frame.
            origin = DVec3::ZERO;
        }
        let step = |map: &AffineMap| (map.linear * origin - origin + map.translation).length();
        let unit = maps.iter().map(step).fold(0.0, f64::max);
        Self { origin, unit: if unit > 0.0 && unit.is_finite() { unit } else { 1.0 } }
    }
}

impl Ifs {
    pub(super) fn lower(&self, draft: &mut Draft) {
        if self.maps.is_empty() {
            return draft.error("/maps", "automaton.empty", "the system has no map, so it has no attractor".into());
        }
        let mut finite = true;
        for (index, map) in self.maps.iter().enumerate().filter(|(_, map)| !map.is_finite()) {
            finite = false;
            draft.error(&format!("/maps/{index}"), "model.not-finite", format!("map {index} has an entry that is not finite: {map:?}"));
        }
        let frame = Frame::of(&self.maps);
        let Some(drawing) = self.drawing(&frame, draft) else { return };
        if !finite {
            return;
        }
        let Some(follow) = self.follow(draft) else { return };
        let leaf = |drawing: &Option<Drawing>| drawing.clone().map_or(LeafPrimitive::Centre, LeafPrimitive::Drawn);
        let offset = draft.states.len();
        // One state per different set of maps that may come next; the root's set is the first.
        let sets = follow.sets();
        for (index, set) in sets.iter().enumerate() {
            let transitions = set
                .iter()
                .map(|&map| Transition {
                    to: StateId::new(offset + follow.set_after[map]),
                    operator: self.maps[map].operator(&frame),
                    label: map,
                })
                .collect();
            let state = State {
                name: if sets.len() == 1 { "attractor".into() } else { format!("after set {index}") },
                kind: None,
                dimension: 4,
                transitions,
                boundaries: Vec::new(),
                leaf: leaf(&drawing),
                frame: true,
            };
            draft.state_from(state, "/maps");
        }
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|corner| frame.origin + frame.unit * corner);
        let points = corners.iter().map(|p| [p.x, p.y, p.z, 1.0]).collect();
        draft.roots.push(Root { state: StateId::new(offset), points, rational: false, solid: None });
    }

    /// The primitive as a drawing: `None` after an error, `Some(None)` when the model has no primitive.
    fn drawing(&self, frame: &Frame, draft: &mut Draft) -> Option<Option<Drawing>> {
        let Some(primitive) = &self.primitive else { return Some(None) };
        let mut drawing = Drawing::default();
        let vertices = match primitive {
            Primitive::Points(points) | Primitive::Polyline { points, .. } => points,
            Primitive::Mesh { vertices, .. } | Primitive::Solid { vertices, .. } => vertices,
        };
        let count = u32::try_from(vertices.len()).ok().filter(|&count| count > 0);
        let Some(count) = count.filter(|_| vertices.iter().all(|vertex| vertex.is_finite())) else {
            draft.error(
                "/primitive",
                "ifs.primitive",
                format!("the primitive has {} points, and needs at least one, all finite", vertices.len()),
            );
            return None;
        };
        drawing.vertices = vertices.iter().map(|vertex| ((*vertex - frame.origin) / frame.unit).to_array()).collect();
        match primitive {
            Primitive::Points(_) => drawing.points = (0..count).collect(),
            Primitive::Polyline { points, closed } => {
                drawing.segments = (1..count).map(|end| [end - 1, end]).collect();
                if *closed && points.len() > 2 {
                    drawing.segments.push([count - 1, 0]);
                }
                if drawing.segments.is_empty() {
                    drawing.points.push(0);
                }
            }
            // The surface of a solid leaf stands for it: the leaf is no larger than the tolerance.
            Primitive::Mesh { vertices, faces } | Primitive::Solid { vertices, faces } => {
                let place = draft.place.clone();
                draft.place = format!("{place}/primitive");
                let elements = super::mesh::elements(vertices, faces, draft);
                draft.place = place;
                let elements = elements?;
                (drawing.points, drawing.segments, drawing.triangles) = (elements.points, elements.segments, elements.triangles);
                if drawing.points.is_empty() && drawing.segments.is_empty() && drawing.triangles.is_empty() {
                    drawing.points = (0..count).collect();
                }
            }
        }
        Some(Some(drawing))
    }

    /// Which maps may come next, after dropping repeated maps and maps that nothing can follow.
    fn follow(&self, draft: &mut Draft) -> Option<Follow> {
        let Some(graph) = &self.graph else {
            // A map that repeats another adds nothing to the union.
            let distinct = (0..self.maps.len()).filter(|&i| self.maps[..i].iter().all(|map| map != &self.maps[i])).collect();
            return Some(Follow { next: vec![distinct], set_after: vec![0; self.maps.len()] });
        };
        let count = self.maps.len();
        if graph.len() != count {
            draft.error("/graph", "ifs.graph", format!("the graph has {} rows, and needs one for each of the {count} maps", graph.len()));
            return None;
        }
        if let Some((row, &entry)) = graph.iter().enumerate().find_map(|(row, list)| Some((row, list.iter().find(|&&map| map >= count)?))) {
            draft.error(&format!("/graph/{row}"), "ifs.graph", format!("map {entry} does not exist: maps are numbered 0 to {}", count - 1));
            return None;
        }
        // Addresses are infinite: a map that leads nowhere is never used.
        let mut alive = vec![true; count];
        loop {
            let dead: Vec<usize> = (0..count).filter(|&map| alive[map] && !graph[map].iter().any(|&next| alive[next])).collect();
            if dead.is_empty() {
                break;
            }
            for map in dead {
                alive[map] = false;
                draft.warn(
                    &format!("/graph/{map}"),
                    "ifs.dead-end",
                    format!("map {map} is never used: no infinite address continues after it"),
                );
            }
        }
        let living = |list: &mut dyn Iterator<Item = usize>| {
            let mut set: Vec<usize> = list.filter(|&map| alive[map]).collect();
            set.sort_unstable();
            set.dedup();
            set
        };
        let root = living(&mut (0..count));
        if root.is_empty() {
            draft.error("/graph", "automaton.empty", "no infinite address exists: every chain of maps ends".into());
            return None;
        }
        let mut next = vec![root];
        let set_after = (0..count)
            .map(|map| {
                let set = living(&mut graph[map].iter().copied());
                next.iter().position(|known| *known == set).unwrap_or_else(|| {
                    next.push(set);
                    next.len() - 1
                })
            })
            .collect();
        // Sets after dead maps are empty; nothing leads to them, but a state needs a transition.
        Some(Follow { next, set_after }.without_empty())
    }
}

/// Sets of maps that may come next: `next[set_after[i]]` after map i, `next[0]` at the root.
struct Follow {
    next: Vec<Vec<usize>>,
    set_after: Vec<usize>,
}

impl Follow {
    fn sets(&self) -> &[Vec<usize>] {
        &self.next
    }

    fn without_empty(self) -> Self {
        let kept: Vec<usize> = (0..self.next.len()).filter(|&set| !self.next[set].is_empty()).collect();
        let set_after = self.set_after.iter().map(|set| kept.iter().position(|known| known == set).unwrap_or(0)).collect();
        Self { next: kept.iter().map(|&set| self.next[set].clone()).collect(), set_after }
    }
}
