//! The depth buffer: for each sample, how near the nearest element is and which one it is.
//!
//! The picture is cut into bands of rows. Elements are first sorted into the bands they touch,
//! then the bands are filled independently, each in the order of the elements, so that the result
//! is the same for any number of threads.

use super::super::error::{FormatError, Place};
use super::Scene;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// No element.
pub(super) const NOTHING: u32 = u32::MAX;

/// Rows of samples in a band: enough bands to share out, few enough that most elements touch one.
const BAND_ROWS: usize = 64;
/// Elements that are sorted at a time.
const CHUNK: usize = 1 << 15;
/// Samples that all elements together may cover: about a thousand layers over the default
/// picture, some seconds of work. Fabricable shapes have a few layers; a file made to keep a server
/// busy has millions.
const MOST_SAMPLES: u64 = 4_000_000_000;
/// Rows of a triangle that are wider than this many samples are cut to it first.
const WIDE: usize = 16;

/// What is nearest, sample by sample, rows from the top.
pub(super) struct Samples {
    pub(super) side: usize,
    /// z of the nearest surface; minus infinity where nothing is.
    pub(super) depths: Vec<f32>,
    /// Index of the element, triangles first, then segments, then points.
    pub(super) elements: Vec<u32>,
}

/// An element by its index.
pub(super) enum Element {
    Triangle([Vec3; 3]),
    Segment([Vec3; 2]),
    Point(Vec3),
}

impl Scene<'_> {
    pub(super) fn element(&self, index: u32) -> Element {
        let vertex = |index: u32| self.vertices[index as usize];
        let index = index as usize;
        if let Some(triangle) = self.triangles.get(index) {
            return Element::Triangle(triangle.map(vertex));
        }
        let index = index - self.triangles.len();
        if let Some(segment) = self.segments.get(index) {
            return Element::Segment(segment.map(vertex));
        }
        Element::Point(vertex(self.points[index - self.segments.len()]))
    }

    fn element_count(&self) -> usize {
        self.triangles.len() + self.segments.len() + self.points.len()
    }

    /// Least and greatest coordinates that an element covers.
    fn reach(&self, element: &Element) -> [Vec2; 2] {
        let (low, high, radius) = match element {
            Element::Triangle([a, b, c]) => (a.min(*b).min(*c), a.max(*b).max(*c), 0.0),
            Element::Segment([a, b]) => (a.min(*b), a.max(*b), self.wire_radius),
            Element::Point(centre) => (*centre, *centre, self.point_radius),
        };
        [low.truncate() - radius, high.truncate() + radius]
    }
}

/// The samples whose centres lie between two coordinates, cut to the picture.
fn covered(low: f32, high: f32, side: usize) -> std::ops::Range<usize> {
    let first = (low - 0.5).ceil().max(0.0) as usize;
    let end = ((high - 0.5).floor() + 1.0).clamp(0.0, side as f32) as usize;
    first..end
}

/// Fills the depth buffer of `side` x `side` samples.
pub(super) fn rasterise(scene: &Scene<'_>, side: usize) -> Result<Samples, FormatError> {
    let bands = side.div_ceil(BAND_ROWS);
    let sorted = sort_into_bands(scene, side, bands);
    let work: u64 = sorted.iter().map(|chunk| chunk.work).sum();
    if work > MOST_SAMPLES {
        return Err(FormatError::limit(Place::File, "preview_samples", work, MOST_SAMPLES));
    }
    let mut samples = Samples { side, depths: vec![f32::NEG_INFINITY; side * side], elements: vec![NOTHING; side * side] };
    let depths = samples.depths.par_chunks_mut(side * BAND_ROWS);
    let elements = samples.elements.par_chunks_mut(side * BAND_ROWS);
    depths.zip(elements).enumerate().for_each(|(band, (depths, elements))| {
        let mut filling = Band { side, first_row: band * BAND_ROWS, depths, elements };
        for &index in sorted.iter().flat_map(|chunk| &chunk.touched[band]) {
            filling.draw(scene, index);
        }
    });
    Ok(samples)
}

/// A chunk of elements, sorted.
struct Sorted {
    /// For each band, the elements that touch it, in their order.
    touched: Vec<Vec<u32>>,
    /// Samples that they cover, roughly.
    work: u64,
}

/// Samples that an element covers within its rows and columns, roughly and rather too many.
fn work(scene: &Scene<'_>, element: &Element, rows: usize, columns: usize) -> u64 {
    let area = match element {
        Element::Triangle([a, b, c]) => 0.5 * (b - a).truncate().perp_dot((c - a).truncate()).abs(),
        Element::Segment([a, b]) => 2.0 * scene.wire_radius * (b - a).truncate().length(),
        Element::Point(_) => 0.0,
    };
    ((area as u64) + 2 * (rows + columns) as u64).min((rows * columns) as u64)
}

fn sort_into_bands(scene: &Scene<'_>, side: usize, bands: usize) -> Vec<Sorted> {
    let count = scene.element_count();
    let sort = |chunk: usize| {
        let mut sorted = Sorted { touched: vec![Vec::new(); bands], work: 0 };
        for index in chunk * CHUNK..count.min((chunk + 1) * CHUNK) {
            let index = index as u32;
            let element = scene.element(index);
            let [low, high] = scene.reach(&element);
            let (rows, columns) = (covered(low.y, high.y, side), covered(low.x, high.x, side));
            // Most triangles of a fine mesh lie between the samples.
            if rows.is_empty() || columns.is_empty() {
                continue;
            }
            for band in &mut sorted.touched[rows.start / BAND_ROWS..=(rows.end - 1) / BAND_ROWS] {
                band.push(index);
            }
            sorted.work += work(scene, &element, rows.len(), columns.len());
        }
        sorted
    };
    (0..count.div_ceil(CHUNK)).into_par_iter().map(sort).collect()
}

/// A band while it is filled.
struct Band<'a> {
    side: usize,
    first_row: usize,
    depths: &'a mut [f32],
    elements: &'a mut [u32],
}

impl Band<'_> {
    fn draw(&mut self, scene: &Scene<'_>, index: u32) {
        let element = scene.element(index);
        let reach = scene.reach(&element);
        match element {
            Element::Triangle(corners) => self.draw_triangle(corners, reach, index),
            Element::Segment(ends) => self.draw_round(ends, scene.wire_radius, reach, index),
            Element::Point(centre) => self.draw_round([centre; 2], scene.point_radius, reach, index),
        }
    }

    /// The band's rows between two coordinates.
    fn rows(&self, low: f32, high: f32) -> std::ops::Range<usize> {
        let rows = covered(low, high, self.side);
        let end = self.first_row + self.depths.len() / self.side;
        rows.start.max(self.first_row)..rows.end.min(end)
    }

    #[inline]
    fn put(&mut self, row: usize, column: usize, depth: f32, index: u32) {
        let at = (row - self.first_row) * self.side + column;
        if depth > self.depths[at] {
            self.depths[at] = depth;
            self.elements[at] = index;
        }
    }

    fn draw_triangle(&mut self, [a, b, c]: [Vec3; 3], [low, high]: [Vec2; 2], index: u32) {
        /// Samples this far outside still count, so that rounding leaves no pinhole between
        /// neighbours; in samples.
        const SLACK: f32 = 1e-3;
        let (ab, ac) = ((b - a).truncate(), (c - a).truncate());
        let area = ab.perp_dot(ac);
        if area == 0.0 {
            return;
        }
        // Barycentric coordinates are affine in the sample: their steps are computed once.
        let to_b = Vec2::new(ac.y, -ac.x) / area;
        let to_c = Vec2::new(-ab.y, ab.x) / area;
        let slack_b = SLACK * to_b.length();
        let slack_c = SLACK * to_c.length();
        let slack_a = SLACK * (to_b + to_c).length();
        let columns = covered(low.x, high.x, self.side);
        // A sliver's plane is steep: its depth must not leave the triangle's own range.
        let (nearest, farthest) = (a.z.max(b.z).max(c.z), a.z.min(b.z).min(c.z));
        for row in self.rows(low.y, high.y) {
            let down = row as f32 + 0.5 - a.y;
            let mut span = columns.clone();
            if columns.len() > WIDE {
                // The shares are affine along the row: each sign gives a bound on x.
                let bounds = [(down * to_b.y, to_b.x), (down * to_c.y, to_c.x), (1.0 - down * (to_b.y + to_c.y), -to_b.x - to_c.x)];
                span = within_bounds(span, a.x, bounds);
            }
            for column in span {
                let at = Vec2::new(column as f32 + 0.5 - a.x, down);
                let (share_b, share_c) = (at.dot(to_b), at.dot(to_c));
                if share_b >= -slack_b && share_c >= -slack_c && share_b + share_c <= 1.0 + slack_a {
                    let depth = a.z + share_b * (b.z - a.z) + share_c * (c.z - a.z);
                    self.put(row, column, depth.clamp(farthest, nearest), index);
                }
            }
        }
    }

    fn draw_round(&mut self, [a, b]: [Vec3; 2], radius: f32, [low, high]: [Vec2; 2], index: u32) {
        let along = b - a;
        for row in self.rows(low.y, high.y) {
            // The stretch of the axis that is near enough to the row, and the samples about it.
            let shares = if along.y.abs() > radius {
                let middle = row as f32 + 0.5 - a.y;
                let [one, other] = [(middle - radius) / along.y, (middle + radius) / along.y];
                [one.clamp(0.0, 1.0), other.clamp(0.0, 1.0)]
            } else {
                [0.0, 1.0]
            };
            let [one, other] = shares.map(|share| a.x + share * along.x);
            for column in covered(one.min(other) - radius, one.max(other) + radius, self.side) {
                if let Some((depth, _)) = tube([a, b], radius, Vec2::new(column as f32 + 0.5, row as f32 + 0.5)) {
                    self.put(row, column, depth, index);
                }
            }
        }
    }
}

/// The columns at which every `at_start + slope * (x - start)` is positive, one more at each end.
fn within_bounds(columns: std::ops::Range<usize>, start: f32, bounds: [(f32, f32); 3]) -> std::ops::Range<usize> {
    let (mut low, mut high) = (columns.start as f32, columns.end as f32);
    for (at_start, slope) in bounds {
        let zero = start - at_start / slope;
        if slope > 0.0 {
            low = low.max(zero - 1.5);
        } else if slope < 0.0 {
            high = high.min(zero + 1.5);
        }
    }
    low as usize..(high.max(0.0) as usize).min(columns.end)
}

/// Depth and normal, in the picture's axes with y down, of a tube with round ends, where it is
/// seen. The bulge towards the eye is that of a tube in the picture's plane.
pub(super) fn tube([a, b]: [Vec3; 2], radius: f32, at: Vec2) -> Option<(f32, Vec3)> {
    let (start, along) = (a.truncate(), (b - a).truncate());
    let length_squared = along.length_squared();
    let share = if length_squared > 0.0 { ((at - start).dot(along) / length_squared).clamp(0.0, 1.0) } else { 0.5 };
    let aside = (at - start - share * along) / radius;
    let bulge_squared = 1.0 - aside.length_squared();
    if bulge_squared < 0.0 {
        return None;
    }
    let bulge = bulge_squared.sqrt();
    Some((a.z + share * (b.z - a.z) + radius * bulge, aside.extend(bulge)))
}
