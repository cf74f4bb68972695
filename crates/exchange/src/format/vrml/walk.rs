//! From a scene to one mesh: every face set where the transforms above it, or before it, put it.

use super::super::error::{FormatError, Place};
use super::super::limits::{MeshBuilder, within};
use super::super::read::MeshFacts;
use super::super::{Format, ReadLimits};
use super::Dialect;
use super::scene::{Kind, NOTHING, Node, Scene, most_indices};
use glam::{DAffine3, DVec3};
use std::collections::HashMap;

/// Nodes within nodes, those used by name followed.
const MOST_DEPTH: u64 = 64;

/// What a node leaves for those that follow it in version 1.0.
#[derive(Clone, Copy)]
struct State {
    transform: DAffine3,
    /// A node of coordinates, or [`NOTHING`].
    coordinates: u32,
    clockwise: bool,
}

struct Walk<'a, 'b> {
    scene: &'a Scene,
    dialect: Dialect,
    limits: &'a ReadLimits,
    builder: &'a mut MeshBuilder<'b>,
    facts: &'a mut MeshFacts,
    /// First vertices of coordinates by where they are placed.
    placed: HashMap<(u32, [u64; 12]), u32>,
    visits: u64,
    indices: u64,
}

/// Places everything of a scene.
pub(super) fn place(
    scene: &Scene,
    dialect: Dialect,
    limits: &ReadLimits,
    builder: &mut MeshBuilder<'_>,
    facts: &mut MeshFacts,
) -> Result<(), FormatError> {
    let mut walk = Walk { scene, dialect, limits, builder, facts, placed: HashMap::new(), visits: 0, indices: 0 };
    let mut state = State { transform: DAffine3::IDENTITY, coordinates: NOTHING, clockwise: false };
    walk.all(&scene.top, &mut state, 1)
}

impl Walk<'_, '_> {
    fn all(&mut self, nodes: &[u32], state: &mut State, depth: u64) -> Result<(), FormatError> {
        nodes.iter().try_for_each(|&node| self.visit(node, state, depth))
    }

    fn visit(&mut self, number: u32, state: &mut State, depth: u64) -> Result<(), FormatError> {
        let scene = self.scene;
        let Some(node) = scene.nodes.get(number as usize) else { return Ok(()) };
        // What is used once is bounded by the file; what is used by name again is an instance.
        self.visits += 1;
        let instances = self.visits.saturating_sub(scene.nodes.len() as u64);
        within(Place::File, "instances", instances, self.limits.instances)?;
        within(Place::File, "scene_nesting", depth, MOST_DEPTH)?;
        let mut inner = *state;
        match &node.kind {
            Kind::Group => self.all(&node.children, state, depth + 1),
            Kind::Separator => self.all(&node.children, &mut inner, depth + 1),
            Kind::TransformSeparator => {
                let before = state.transform;
                self.all(&node.children, state, depth + 1)?;
                state.transform = before;
                Ok(())
            }
            Kind::Transform(map) if self.dialect == Dialect::Nested => {
                inner.transform = state.transform * *map;
                self.all(&node.children, &mut inner, depth + 1)
            }
            Kind::Transform(map) => {
                state.transform *= *map;
                self.all(&node.children, state, depth + 1)
            }
            Kind::Coordinates(_) => {
                state.coordinates = number;
                Ok(())
            }
            Kind::Hints(clockwise) => {
                state.clockwise = *clockwise;
                Ok(())
            }
            Kind::Choice(-3) => self.all(&node.children, state, depth + 1),
            Kind::Choice(which) => {
                let chosen = usize::try_from(*which).ok().and_then(|which| node.children.get(which));
                chosen.map_or(Ok(()), |&child| self.visit(child, state, depth + 1))
            }
            Kind::Detail => node.children.first().map_or(Ok(()), |&child| self.visit(child, state, depth + 1)),
            Kind::Faces { indices, line, clockwise } => self.faces(node, indices, *line, *clockwise, *state),
            Kind::Shape(word) => {
                self.leave_out(word);
                Ok(())
            }
        }
    }

    fn leave_out(&mut self, word: &'static str) {
        match self.facts.left_out.iter_mut().find(|(known, _)| *known == word) {
            Some((_, count)) => *count += 1,
            None => self.facts.left_out.push((word, 1)),
        }
    }

    fn faces(&mut self, node: &Node, indices: &[i32], line: u64, clockwise: bool, state: State) -> Result<(), FormatError> {
        let at = || Place::Line(line);
        let scene = self.scene;
        let points_of = |number: u32| match scene.nodes.get(number as usize).map(|node| &node.kind) {
            Some(Kind::Coordinates(points)) => Some((number, points)),
            _ => None,
        };
        let own = node.children.iter().find_map(|&child| points_of(child));
        if indices.is_empty() {
            return Ok(());
        }
        let Some((number, points)) = own.or_else(|| points_of(state.coordinates)) else {
            return Err(FormatError::malformed(Format::Vrml, at(), "coordinates for the face set", b"none"));
        };
        self.indices += indices.len() as u64;
        within(at(), "triangles", self.indices / 4, most_indices(self.limits) / 4)?;
        let first = self.vertices(number, points, state.transform, &at)?;
        let mirrored = state.transform.matrix3.determinant() < 0.0;
        // Version 2.0 says it of the set, version 1.0 before it.
        let reversed = (clockwise || state.clockwise) != mirrored;
        let mut corners: Vec<i64> = Vec::new();
        for polygon in indices.split(|&index| index == -1) {
            if let Some(&index) = polygon.iter().find(|&&index| index as usize >= points.len()) {
                return Err(FormatError::IndexOutOfRange { place: at(), index: i64::from(index), vertices: points.len() as u64 });
            }
            corners.clear();
            corners.extend(polygon.iter().map(|&index| i64::from(first) + i64::from(index)));
            if reversed {
                corners.reverse();
            }
            self.builder.polygon(&corners, &at)?;
        }
        Ok(())
    }

    /// The number of the first of these points where they are placed.
    fn vertices(&mut self, number: u32, points: &[DVec3], transform: DAffine3, at: &dyn Fn() -> Place) -> Result<u32, FormatError> {
        let key = (number, transform.to_cols_array().map(f64::to_bits));
        if let Some(&first) = self.placed.get(&key) {
            return Ok(first);
        }
        let first = u32::try_from(self.builder.vertex_count()).unwrap_or(u32::MAX);
        points.iter().try_for_each(|point| self.builder.vertex(transform.transform_point3(*point), at))?;
        self.placed.insert(key, first);
        Ok(first)
    }
}
