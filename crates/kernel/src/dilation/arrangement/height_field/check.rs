//! The triangles of a graph, and whether others are between two distances from it.

use super::super::between::Memory;
use super::field::Field;
use super::ground::Ground;
use crate::attractor::cell::{dot, subtract};
use crate::dilation::arrangement::faces::{Face, Faces, Fault, Question};
use crate::groups::Groups;
use crate::solid::half_edges::{NONE, previous};

/// Triangles that tell how many parts are near to each other, and how many near to one are asked for.
const SAMPLE: usize = 256;
const MOST_NEAR: usize = 4_096;

impl Faces {
    /// The triangles of a graph; upside down if `sign` is -1.
    pub(super) fn of(ground: &Ground, sign: f64) -> Self {
        Self::new(ground.triangles().map(|corners| corners.map(|[x, y, z]| [x, y, sign * z])))
    }

    /// How far above the plane of a half-edge's face the corner beyond its other half is.
    #[inline]
    pub(super) fn above(&self, half: u32, twin: u32) -> f64 {
        let [Face { corners, normal, .. }, other] = [half, twin].map(|half| &self.all[(half / 3) as usize]);
        dot(normal, &subtract(&other.corners[(previous(twin) % 3) as usize], &corners[(half % 3) as usize]))
    }

    /// The largest height of all.
    pub(super) fn highest(&self) -> f64 {
        self.all.iter().flat_map(|face| face.corners).map(|corner| corner[2]).fold(f64::NEG_INFINITY, f64::max)
    }

    /// How many parts, of triangles in one plane each, are near to a triangle in the mean, from a sample; given how far off a plane corners may be, and how far what is near is.
    pub(super) fn crowding(&self, ground: &Ground, flatness: f64, distance: f64) -> f64 {
        let (count, mesh) = (self.all.len(), &ground.mesh);
        let mut groups = Groups::new(count);
        let pairs = (0..3 * mesh.triangles()).map(|half| (half, mesh.twin(half)));
        for (half, twin) in pairs.filter(|&(half, twin)| twin != NONE && twin > half) {
            if self.above(half, twin).abs() <= flatness {
                groups.join((half / 3) as usize, (twin / 3) as usize);
            }
        }
        let (step, mut near, mut total) = (count.div_ceil(SAMPLE), Vec::new(), 0);
        for face in (0..count).step_by(step) {
            near.clear();
            self.around(&self.all[face].corners, distance, |other| {
                near.push(groups.of(other as usize));
                near.len() < MOST_NEAR
            });
            near.sort_unstable();
            near.dedup();
            total += near.len();
        }
        total as f64 / count.div_ceil(step) as f64
    }

    /// Where a triangle is nearer or farther than it has to be from the graph of a field.
    pub(super) fn fault(&self, field: &Field, question: &Question, memory: &mut Memory) -> Option<Fault> {
        let between = 0.5 * (question.inner + question.outer);
        self.fault_with(|at| field.top([at[0], at[1]], between).map(|top| top.owner), question, memory)
    }
}
