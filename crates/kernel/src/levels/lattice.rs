//! The lattice that corners of all copies lie on: maps read as fractions in the frame of the primitive.

use super::LevelError;
use crate::model::AffineMap;
use crate::solid::TriMesh;
use glam::{DMat3, DVec3};

/// Integer coordinates.
pub(super) type Point = [i64; 3];

/// The map X -> linear X + shift q^(k+1) from the lattice of level k to that of level k + 1, see [`Lattice`].
pub(super) struct LatticeMap {
    /// Numerators over q.
    pub(super) linear: [[i64; 3]; 3],
    /// Numerators over D.
    pub(super) shift: Point,
    /// Of the linear part.
    pub(super) determinant: f64,
}

/// Level k has the points origin + frame X / (D q^k), X integers.
pub(super) struct Lattice {
    origin: DVec3,
    frame: DMat3,
    /// D.
    pub(super) denominator: i64,
    /// q.
    pub(super) ratio: i64,
    pub(super) maps: Vec<LatticeMap>,
    /// As the model states them.
    written: Vec<AffineMap>,
    /// How far a corner of the primitive is from its fractions, in mm.
    corner_error: f64,
    /// Largest absolute coordinate of the primitive in its frame.
    reach: f64,
}

/// Largest denominator of a fraction that a number is read as.
pub(super) const MOST_DENOMINATOR: i64 = 1 << 20;
/// Numbers in the frame are read as the simplest fraction this close, relative to 1 or themselves. Whatever is read, it is compared with what was written.
const READING: f64 = 1e-11;
/// Coordinates stay below this: numbers of double precision tell all integers apart.
const MOST_COORDINATE: f64 = (1_u64 << 52) as f64;

impl Lattice {
    /// Reads the maps, and the corners of the primitive with them: those are numerators over D.
    pub(super) fn read(maps: &[AffineMap], mesh: &TriMesh, faces: &[Vec<u32>]) -> Result<(Self, Vec<Point>), LevelError> {
        let origin = mesh.vertices.first().copied().unwrap_or_default();
        let frame = frame(&mesh.vertices, faces).ok_or(LevelError::NoPrimitive { reason: "its solid is flat" })?;
        let inverse = frame.inverse();
        let mut read = Vec::with_capacity(maps.len());
        for (index, map) in maps.iter().enumerate() {
            let linear = inverse * map.linear * frame;
            let shift = inverse * (map.linear * origin + map.translation - origin);
            let fractions = || {
                let mut rows = [[(0, 1); 3]; 3];
                for (row, column) in (0..9).map(|k| (k / 3, k % 3)) {
                    rows[row][column] = fraction(linear.col(column)[row])?;
                }
                let [x, y, z] = shift.to_array().map(fraction);
                Some((rows, [x?, y?, z?]))
            };
            read.push(fractions().ok_or(LevelError::NoLattice { map: index })?);
        }
        let corners: Option<Vec<[(i64, i64); 3]>> = mesh
            .vertices
            .iter()
            .map(|&vertex| {
                let [x, y, z] = (inverse * (vertex - origin)).to_array().map(fraction);
                Some([x?, y?, z?])
            })
            .collect();
        let corners =
            corners.ok_or(LevelError::NoPrimitive { reason: "the corners of its solid are no fractions of three of its edges" })?;
        let ratio = common(read.iter().flat_map(|(rows, _)| rows.as_flattened().iter().copied()));
        let denominator = common(read.iter().flat_map(|(_, shift)| *shift).chain(corners.iter().flatten().copied()));
        let (Some(ratio), Some(denominator)) = (ratio, denominator) else { return Err(LevelError::NoLattice { map: 0 }) };
        let over = |(p, q): (i64, i64), whole: i64| p * (whole / q);
        let mut lattice_maps = Vec::with_capacity(maps.len());
        for (index, (rows, shift)) in read.iter().enumerate() {
            let linear = rows.map(|row| row.map(|entry| over(entry, ratio)));
            let determinant = determinant(&linear);
            if determinant == 0 {
                return Err(LevelError::Flattens { map: index });
            }
            let determinant = determinant as f64 / (ratio as f64).powi(3);
            lattice_maps.push(LatticeMap { linear, shift: shift.map(|entry| over(entry, denominator)), determinant });
        }
        let corners: Vec<Point> = corners.iter().map(|corner| corner.map(|entry| over(entry, denominator))).collect();
        let largest = corners.as_flattened().iter().map(|x| x.abs()).max().unwrap_or(1).max(denominator);
        let mut lattice = Self {
            origin,
            frame,
            denominator,
            ratio,
            maps: lattice_maps,
            written: maps.to_vec(),
            corner_error: 0.0,
            reach: largest as f64 / denominator as f64,
        };
        let unit = lattice.unit(0);
        let error = |(corner, vertex): (&Point, &DVec3)| lattice.place(corner, unit).distance(*vertex);
        lattice.corner_error = corners.iter().zip(&mesh.vertices).map(error).fold(0.0, f64::max);
        Ok((lattice, corners))
    }

    /// D q^k.
    pub(super) fn unit(&self, level: u32) -> f64 {
        self.denominator as f64 * (self.ratio as f64).powi(level as i32)
    }

    /// A lattice point in mm.
    pub(super) fn place(&self, point: &Point, unit: f64) -> DVec3 {
        let [x, y, z] = point.map(|x| x as f64 / unit);
        self.origin + (self.frame.x_axis * x + self.frame.y_axis * y + self.frame.z_axis * z)
    }

    /// Whether the frame's axes are those of space, so that every coordinate depends on one integer, and grows or falls with it.
    pub(super) fn is_parallel(&self) -> bool {
        (0..3).all(|column| self.frame.col(column).to_array().iter().filter(|x| **x != 0.0).count() == 1)
    }

    /// For a grid of cells along the axes: whether single precision tells its planes apart.
    pub(super) fn is_told_apart(&self, level: u32) -> bool {
        // Cells of a grid have the frame's edges divided by the ratio's power; corners lie between 0 and 1 in the frame.
        let cells =
            (self.ratio as f64 / self.maps[0].linear.as_flattened().iter().map(|x| x.abs()).max().unwrap_or(1) as f64).powi(level as i32);
        (0..3).all(|column| {
            let edge = self.frame.col(column);
            let axis = (0..3).find(|&axis| edge[axis] != 0.0).unwrap_or(0);
            let single = |k: f64| (self.origin[axis] + edge[axis] * (k / cells)) as f32;
            let count = cells.min(1e7) as u64;
            cells <= 1e7 && (0..count).all(|k| single(k as f64) != single(k as f64 + 1.0))
        })
    }

    /// Refuses levels whose coordinates are too large for exact comparisons.
    pub(super) fn check_depth(&self, level: u32) -> Result<(), LevelError> {
        let entry = self.maps.iter().flat_map(|map| map.linear.as_flattened()).map(|x| x.abs()).max().unwrap_or(1) as f64;
        let fits = |level: u32| {
            let largest = self.unit(level) * self.reach;
            // The sum of three products and a shift stays below 2^63.
            largest <= MOST_COORDINATE && 4.0 * entry * largest < 9e18
        };
        if fits(level) {
            return Ok(());
        }
        let passes = (0..level).take_while(|&k| fits(k)).count().saturating_sub(1) as u32;
        Err(LevelError::TooFine { level, digits: "double precision", passes })
    }

    /// The refusal of a level that single precision cannot carry.
    pub(super) fn too_fine_for_singles(&self, level: u32) -> LevelError {
        let size = (0..3).map(|column| self.frame.col(column).length()).fold(f64::INFINITY, f64::min);
        let extent = self.origin.abs().max_element() + (0..3).map(|column| self.frame.col(column).length()).fold(0.0, f64::max);
        let step = |k: u32| size / (self.ratio as f64).powi(k as i32);
        let told = |k: &u32| step(*k) > 4.0 * extent * f64::from(f32::EPSILON);
        let passes = (0..level).take_while(told).last().unwrap_or(0);
        LevelError::TooFine { level, digits: "single precision", passes }
    }

    /// How far reading the numbers as fractions moves a point of a level at most, in mm, where all copies are within the convex hull of `body` (over D).
    ///
    /// Let e be the largest distance between the images of a point of the body under a map as written and as read: affine, so it is largest in a corner. By
    /// induction along an address, copies of level n differ by e (1 + s + ... + s^(n-1)) + s^n c, where s bounds how maps as written stretch and c is
    /// that of the primitive's corners.
    pub(super) fn moved_mm(&self, body: &[Point], level: u32) -> f64 {
        let (unit, next) = (self.unit(0), self.unit(1));
        let mut error = 0.0_f64;
        let mut extent = 0.0_f64;
        for corner in body {
            let at = self.place(corner, unit);
            extent = extent.max(at.abs().max_element());
            for (map, written) in self.maps.iter().zip(&self.written) {
                let image = self.place(&Self::image(map, corner, self.ratio), next);
                error = error.max(image.distance(written.linear * at + written.translation));
            }
        }
        // Both images are sums of a few products.
        error += 32.0 * f64::EPSILON * extent;
        let frobenius = |map: &AffineMap| (0..3).map(|column| map.linear.col(column).length_squared()).sum::<f64>().sqrt();
        let stretch = self.written.iter().map(frobenius).fold(0.0, f64::max);
        let geometric: f64 = (0..level).map(|k| stretch.powi(k as i32)).sum();
        error * geometric + (self.corner_error + 8.0 * f64::EPSILON * extent) * stretch.powi(level as i32)
    }

    /// The image of a point of level k, on level k + 1; `scale` is q^(k + 1).
    #[inline]
    pub(super) fn image(map: &LatticeMap, point: &Point, scale: i64) -> Point {
        std::array::from_fn(|row| {
            let [a, b, c] = map.linear[row];
            a * point[0] + b * point[1] + c * point[2] + map.shift[row] * scale
        })
    }
}

/// Three edges of the solid at its first corner that span space, or such edges anywhere.
fn frame(vertices: &[DVec3], faces: &[Vec<u32>]) -> Option<DMat3> {
    let mut edges: Vec<DVec3> = Vec::new();
    for face in faces {
        for (k, &corner) in face.iter().enumerate() {
            let next = face[(k + 1) % face.len()];
            let edge = vertices[next as usize] - vertices[corner as usize];
            if corner == 0 {
                edges.insert(0, edge);
            } else {
                edges.push(edge);
            }
        }
    }
    let size = edges.iter().map(|edge| edge.length()).fold(0.0, f64::max);
    let first = *edges.iter().find(|edge| edge.length() > 1e-6 * size)?;
    let second = *edges.iter().find(|edge| first.cross(**edge).length() > 1e-6 * size * size)?;
    let normal = first.cross(second);
    let third = *edges.iter().find(|edge| normal.dot(**edge).abs() > 1e-6 * size.powi(3))?;
    let frame = DMat3::from_cols(first, second, third);
    // A frame of positive orientation: outward faces stay outward.
    Some(if frame.determinant() > 0.0 { frame } else { DMat3::from_cols(second, first, third) })
}

/// The simplest fraction that is as close as [`READING`] asks, if its denominator is small.
fn fraction(value: f64) -> Option<(i64, i64)> {
    let reading = READING * value.abs().max(1.0);
    if !value.is_finite() || value.abs() > 1e9 {
        return None;
    }
    let negative = value < 0.0;
    let (p, q) = simplest((value.abs() - reading).max(0.0), value.abs() + reading, 40)?;
    (q <= MOST_DENOMINATOR).then_some((if negative { -p } else { p }, q))
}

/// The fraction of least denominator in an interval of numbers that are not negative (the Stern-Brocot tree, by continued fractions).
fn simplest(low: f64, high: f64, depth: u32) -> Option<(i64, i64)> {
    let floor = low.floor();
    if floor >= low {
        return Some((floor as i64, 1));
    }
    if floor + 1.0 <= high {
        return Some((floor as i64 + 1, 1));
    }
    let (p, q) = simplest(1.0 / (high - floor), 1.0 / (low - floor), depth.checked_sub(1)?)?;
    // floor + q / p.
    let numerator = (floor as i64).checked_mul(p)?.checked_add(q)?;
    (p <= MOST_DENOMINATOR).then_some((numerator, p))
}

/// The least common multiple of denominators, if it is small enough for a lattice.
fn common(mut fractions: impl Iterator<Item = (i64, i64)>) -> Option<i64> {
    fractions.try_fold(1, |all, (_, q)| multiple(all, q))
}

/// The least common multiple, if it is small enough for a lattice.
fn multiple(a: i64, b: i64) -> Option<i64> {
    let (mut x, mut y) = (a, b);
    while y != 0 {
        (x, y) = (y, x % y);
    }
    (a / x).checked_mul(b).filter(|all| *all <= 1 << 40)
}

fn determinant(m: &[[i64; 3]; 3]) -> i128 {
    let m = m.map(|row| row.map(i128::from));
    m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
        + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_the_simplest_fractions() {
        for (value, expected) in [
            (0.3333333333333333, Some((1, 3))),
            (-2.0 / 7.0, Some((-2, 7))),
            (0.0, Some((0, 1))),
            (5.0, Some((5, 1))),
            (0.1, Some((1, 10))),
            // k / (3 k + 1) is near enough from this k on: no smaller denominator is.
            (0.333333, Some((333_324, 999_973))),
            (1e-13, Some((0, 1))),
        ] {
            assert_eq!(fraction(value), expected, "{value}");
        }
        // Every number is near some fraction: what the reading moves is part of the bound, and what has no small common denominator is refused later.
        let root = 2.0_f64.sqrt();
        let (p, q) = fraction(root).expect("a fraction is near");
        assert!((p as f64 / q as f64 - root).abs() <= READING * root && q <= MOST_DENOMINATOR);
        assert_eq!(fraction(f64::NAN), None);
    }
}
