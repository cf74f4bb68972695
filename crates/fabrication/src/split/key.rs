//! The key that puts two parts together: a tapered peg over a pentagon like a house, which no turn takes into itself, and its socket.

use glam::{DVec2, DVec3};
use lacuna_kernel::budget::{Budget, Stopped};
use lacuna_kernel::measure::mass::volume;
use lacuna_kernel::measure::section::{PlaneFrame, Polygon};
use lacuna_kernel::solid::TriMesh;

/// A peg of a width w: w long, its sides inclined so that they come closer by w / 10, a clearance away from the faces of its socket everywhere.
pub(super) struct Key {
    pub(super) width: f64,
    /// How far the peg stands out.
    pub(super) length: f64,
    clearance: f64,
    /// Least thickness of what is around the socket and below the peg.
    wall: f64,
}

/// How much closer the sides are at the tip, as a share of the width.
const TAPER: f64 = 0.1;
/// The pentagon of width 1, counter-clockwise.
const HOUSE: [DVec2; 5] =
    [DVec2::new(-0.5, -0.5), DVec2::new(0.5, -0.5), DVec2::new(0.5, 0.1), DVec2::new(0.0, 0.5), DVec2::new(-0.5, 0.1)];
/// Points along each side of a face where a key may stand.
const PLACES: usize = 40;

impl Key {
    pub(super) fn new(width: f64, clearance: f64) -> Self {
        Self { width, length: width, clearance, wall: 0.5 * width }
    }

    /// The sides' distance inwards for each unit of height.
    fn slope(&self) -> f64 {
        TAPER * self.width / self.length
    }

    /// The pentagon with its sides moved inwards in their plane.
    fn ring(&self, inwards: f64, height: f64) -> [DVec3; 5] {
        let corner = |k: usize| HOUSE[k % 5] * self.width;
        // The line of side k: n . x = n . corner - inwards, n its unit normal outwards.
        let side = |k: usize| {
            let along = corner(k + 1) - corner(k);
            let normal = DVec2::new(along.y, -along.x).normalize();
            (normal, normal.dot(corner(k)) - inwards)
        };
        std::array::from_fn(|k| {
            let ((m, p), (n, q)) = (side(k + 4), side(k));
            let determinant = m.perp_dot(n);
            DVec3::new((p * n.y - q * m.y) / determinant, (m.x * q - n.x * p) / determinant, height)
        })
    }

    /// Between rings, from the lowest to the highest.
    fn between(rings: &[[DVec3; 5]]) -> TriMesh {
        let last = 5 * (rings.len() as u32 - 1);
        let mut triangles = Vec::new();
        for k in 1..4 {
            triangles.push([0, k + 1, k]);
            triangles.push([last, last + k, last + k + 1]);
        }
        for ring in 0..rings.len() as u32 - 1 {
            for k in 0..5 {
                let (a, b) = (5 * ring + k, 5 * ring + (k + 1) % 5);
                triangles.push([a, b, b + 5]);
                triangles.push([a, b + 5, a + 5]);
            }
        }
        TriMesh { vertices: rings.as_flattened().to_vec(), triangles }
    }

    fn beyond_its_part(&self) -> TriMesh {
        Self::between(&[self.ring(0.0, 0.0), self.ring(self.slope() * self.length, self.length)])
    }

    /// The peg, with a root within its part.
    pub(super) fn peg(&self) -> TriMesh {
        let tip = self.ring(self.slope() * self.length, self.length);
        Self::between(&[self.ring(0.0, -0.5 * self.wall), self.ring(0.0, 0.0), tip])
    }

    /// How far a side moves in its plane when its inclined face moves by the clearance.
    fn gap(&self) -> f64 {
        self.clearance * self.slope().hypot(1.0)
    }

    fn hole(&self, from: f64) -> TriMesh {
        let depth = self.length + self.clearance;
        let ring = |height: f64| self.ring(self.slope() * height - self.gap(), height);
        Self::between(&[ring(from), ring(depth)])
    }

    /// The socket, beginning before its part.
    pub(super) fn socket(&self) -> TriMesh {
        self.hole(-self.wall)
    }

    /// What must lie in the socket's part.
    pub(super) fn around_socket(&self) -> TriMesh {
        let outwards = -self.gap() - self.wall;
        Self::between(&[self.ring(outwards, 0.0), self.ring(outwards, self.depth())])
    }

    /// What a socket with its wall takes of its part, in mm.
    pub(super) fn depth(&self) -> f64 {
        self.length + self.clearance + self.wall
    }

    /// What must lie in the peg's part.
    pub(super) fn below_peg(&self) -> TriMesh {
        Self::between(&[self.ring(-self.wall, -self.wall), self.ring(-self.wall, 0.0)])
    }

    /// Volume of a peg beyond its part, in mm^3.
    pub(super) fn peg_volume(&self) -> f64 {
        volume(&self.beyond_its_part())
    }

    /// Volume of a socket, in mm^3.
    pub(super) fn socket_volume(&self) -> f64 {
        volume(&self.hole(0.0))
    }

    /// A body at a place of a plane, its height along the plane's normal.
    pub(super) fn placed(mut mesh: TriMesh, frame: &PlaneFrame, centre: DVec2, offset: f64) -> TriMesh {
        for vertex in &mut mesh.vertices {
            let (u, v) = (centre.x + vertex.x, centre.y + vertex.y);
            *vertex = frame.u() * u + frame.v() * v + frame.normal() * (offset + vertex.z);
        }
        mesh
    }

    /// Places in a face where the socket and its walls are within it: two far apart if there are, else the widest, then those far from all before.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn places(&self, face: &Polygon, budget: &Budget) -> Result<Vec<DVec2>, Stopped> {
        let outwards = -self.gap() - self.wall;
        let needed = self.ring(outwards, 0.0).iter().map(|corner| corner.truncate().length()).fold(0.0, f64::max);
        let low = face.outer.iter().copied().reduce(DVec2::min).unwrap_or_default();
        let high = face.outer.iter().copied().reduce(DVec2::max).unwrap_or_default();
        if (high - low).min_element() < 2.0 * needed {
            return Ok(Vec::new());
        }
        // The middle of the face, which is the best place of many, and a grid.
        let grid = (0..PLACES * PLACES).map(|k| [k % PLACES, k / PLACES].map(|n| (n as f64 + 0.5) / PLACES as f64));
        let candidates = std::iter::once([0.5, 0.5]).chain(grid).map(|share| low + (high - low) * DVec2::from_array(share));
        let mut wide: Vec<(DVec2, f64)> = Vec::new();
        for at in candidates {
            budget.cancel.check()?;
            let room = room(face, at);
            if room >= needed {
                wide.push((at, room));
            }
        }
        let mut places: Vec<DVec2> = Vec::new();
        // Two keys far apart hold best: the place farthest from the widest, and the one farthest from that, if both have room.
        let farthest = |from: DVec2| wide.iter().map(|(at, _)| *at).max_by(|a, b| a.distance(from).total_cmp(&b.distance(from)));
        let widest = wide.iter().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(at, _)| *at);
        if let Some(one) = widest.and_then(farthest)
            && let Some(other) = farthest(one).filter(|other| other.distance(one) >= 2.0 * needed)
        {
            places.extend([one, other]);
            wide.retain(|(at, _)| places.iter().all(|place| at.distance(*place) >= 2.0 * needed));
        }
        while !wide.is_empty() {
            let worth = |&(at, room): &(DVec2, f64)| places.iter().map(|other| at.distance(*other)).reduce(f64::min).unwrap_or(room);
            let best =
                wide.iter().map(worth).enumerate().fold((0, f64::NEG_INFINITY), |best, (k, x)| if x > best.1 { (k, x) } else { best }).0;
            let chosen = wide.swap_remove(best).0;
            places.push(chosen);
            // Keys do not share walls.
            wide.retain(|(at, _)| at.distance(chosen) >= 2.0 * needed);
        }
        Ok(places)
    }
}

/// Distance of a point within a face from its loops; negative outside.
fn room(face: &Polygon, at: DVec2) -> f64 {
    let (mut nearest, mut inside) = (f64::INFINITY, false);
    for points in face.loops() {
        for (k, &a) in points.iter().enumerate() {
            let b = points[(k + 1) % points.len()];
            let along = b - a;
            let share = ((at - a).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            nearest = nearest.min(at.distance(a + along * share));
            if (a.y > at.y) != (b.y > at.y) && at.x < a.x + (at.y - a.y) / (b.y - a.y) * along.x {
                inside = !inside;
            }
        }
    }
    if inside { nearest } else { -nearest }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lacuna_kernel::solid::{Crossings, Solid};

    #[test]
    fn bodies_are_solids_and_faces_are_a_clearance_apart() {
        let key = Key::new(6.0, 0.2);
        for mesh in [key.peg(), key.socket(), key.around_socket(), key.below_peg()] {
            assert_eq!(Crossings::of(&mesh, &Budget::default()).unwrap().count, 0);
            assert_eq!(Solid::new(mesh, &Budget::default()).unwrap().topology().euler, 2);
        }
        // Every inclined face of the socket is 0.2 from the peg's, and so is the tip.
        let (peg, hole) = (key.beyond_its_part(), key.hole(0.0));
        for triangle in &peg.triangles {
            let [a, b, c] = triangle.map(|corner| peg.vertices[corner as usize]);
            let normal = (b - a).cross(c - a).normalize();
            if normal.z > -0.5 {
                let reach = hole.vertices.iter().map(|vertex| (*vertex - a).dot(normal)).fold(f64::NEG_INFINITY, f64::max);
                assert!((reach - 0.2).abs() < 1e-12, "{reach}");
            }
        }
        // A frustum by Simpson's rule, exact for areas that are quadratic in the height: the pentagon's area is 0.8 w^2.
        let area = |ring: [DVec3; 5]| (0..5).map(|k| 0.5 * ring[k].truncate().perp_dot(ring[(k + 1) % 5].truncate())).sum::<f64>();
        let simpson = (area(key.ring(0.0, 0.0)) + 4.0 * area(key.ring(0.3, 0.0)) + area(key.ring(0.6, 0.0))) * key.length / 6.0;
        assert!((area(key.ring(0.0, 0.0)) - 0.8 * 36.0).abs() < 1e-12);
        assert!((key.peg_volume() - simpson).abs() < 1e-10);
    }
}
