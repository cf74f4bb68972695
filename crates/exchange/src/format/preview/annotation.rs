//! The box around the shape, its dimensions in mm, and a scale bar.

use super::camera::Camera;
use super::light::background;
use super::raster::Samples;
use super::{Image, Light, SAMPLES, lettering};
use glam::{DVec3, Vec2, Vec3};

const INK: Light = Vec3::new(0.035, 0.045, 0.065);
const BOX_INK: Light = Vec3::new(0.12, 0.15, 0.20);
/// Share of the ink where an edge is before the shape, at the back of the box, and behind the shape.
const FRONT_EDGE: f32 = 0.75;
const BACK_EDGE: f32 = 0.42;
const COVERED_EDGE: f32 = 0.10;
/// Height of digits as a share of the picture's side.
const LETTER_HEIGHT: f32 = 0.0195;
/// Greatest length of the scale bar as a share of the picture's side.
const BAR_LENGTH: f64 = 0.22;

/// Draws over the lit image.
pub(super) fn draw(image: &mut Image, samples: &Samples, camera: &Camera, low: DVec3, high: DVec3) {
    let mut drawing = Drawing { image, samples };
    let corners: Vec<DVec3> = (0..8).map(|bits| corner(low, high, bits)).collect();
    let seen: Vec<Vec3> = corners.iter().map(|corner| camera.project(*corner)).collect();
    let farthest = (0..8).min_by(|&a, &b| seen[a].z.total_cmp(&seen[b].z)).unwrap_or(0);
    for bits in 0..8_usize {
        for axis in 0..3 {
            let other = bits | 1 << axis;
            if other == bits || low[axis] == high[axis] {
                continue;
            }
            let at_back = bits == farthest || other == farthest;
            drawing.edge(seen[bits], seen[other], at_back);
        }
    }
    for axis in 0..3 {
        drawing.dimension(axis, high[axis] - low[axis], &seen);
    }
    drawing.scale_bar(camera);
}

/// A corner of the box: bit k chooses the upper end of axis k.
fn corner(low: DVec3, high: DVec3, bits: usize) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|axis| if bits >> axis & 1 == 0 { low[axis] } else { high[axis] }))
}

struct Drawing<'a> {
    image: &'a mut Image,
    samples: &'a Samples,
}

impl Drawing<'_> {
    fn side(&self) -> f32 {
        self.image.side as f32
    }

    /// Lines are drawn thicker in larger pictures.
    fn pixel(&self) -> f32 {
        (self.side() / 1024.0).max(0.6)
    }

    /// Blends ink over the pixels near a segment; `share` says how much of it, from the pixel and
    /// the place along the segment.
    fn stroke(&mut self, a: Vec2, b: Vec2, width: f32, ink: Light, share: impl Fn(&Self, [usize; 2], f32) -> f32) {
        let reach = 0.5 * width + 1.0;
        let (low, high) = (a.min(b) - reach, a.max(b) + reach);
        let last = self.image.side as f32;
        let range = |low: f32, high: f32| low.floor().clamp(0.0, last) as usize..high.ceil().clamp(0.0, last) as usize;
        let along = b - a;
        let length_squared = along.length_squared().max(f32::MIN_POSITIVE);
        for row in range(low.y, high.y) {
            for column in range(low.x, high.x) {
                let at = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                let place = ((at - a).dot(along) / length_squared).clamp(0.0, 1.0);
                let covered = (0.5 * width + 0.5 - at.distance(a + place * along)).clamp(0.0, 1.0);
                if covered > 0.0 {
                    let strength = covered * share(self, [row, column], place);
                    let pixel = &mut self.image.pixels[row * self.image.side + column];
                    *pixel = pixel.lerp(ink, strength);
                }
            }
        }
    }

    /// An edge of the box: full before the shape, dashed at the back, faint behind the shape.
    fn edge(&mut self, a: Vec3, b: Vec3, at_back: bool) {
        const DASH_PIXELS: f32 = 7.0;
        let (start, end) = (a.truncate() / SAMPLES as f32, b.truncate() / SAMPLES as f32);
        let dashes = (start.distance(end) / (2.0 * DASH_PIXELS * self.pixel())).round().max(1.0);
        let width = 1.25 * self.pixel();
        self.stroke(start, end, width, BOX_INK, |drawing, pixel, place| {
            let depth = a.z + place * (b.z - a.z);
            let hidden = drawing.hidden(pixel, depth);
            let dashed = at_back || hidden > 0.0;
            // Half a dash at both ends, so that corners are drawn.
            let gap = dashed && (place * dashes + 0.25).fract() > 0.5;
            let bare = if at_back { BACK_EDGE } else { FRONT_EDGE };
            if gap { (1.0 - hidden) * if at_back { 0.0 } else { bare } } else { bare + hidden * (COVERED_EDGE - bare) }
        });
    }

    /// Share of a pixel in which the shape is before `depth`.
    fn hidden(&self, [row, column]: [usize; 2], depth: f32) -> f32 {
        // An edge that a face of the shape runs along belongs before it.
        let depth = depth + SAMPLES as f32;
        let before = |(y, x): &(usize, usize)| self.samples.depths[(row * SAMPLES + y) * self.samples.side + column * SAMPLES + x] > depth;
        [(0, 0), (0, 1), (1, 0), (1, 1)].iter().filter(|sample| before(sample)).count() as f32 / 4.0
    }

    /// The length of an axis beside the edge of the box that is outermost in the picture.
    fn dimension(&mut self, axis: usize, length_mm: f64, seen: &[Vec3]) {
        if length_mm <= 0.0 {
            return;
        }
        let at = |bits: usize| seen[bits].truncate() / SAMPLES as f32;
        let middle = |bits: &usize| at(*bits).midpoint(at(bits | 1 << axis));
        // Lengths stand below the box, the height at its left.
        // Of two edges as low as one another, the left one, where there is room.
        let rank = |bits: &usize| if axis == 2 { -middle(bits).x } else { middle(bits).y - 1e-3 * middle(bits).x };
        let candidates = (0..8_usize).filter(|bits| bits >> axis & 1 == 0);
        let Some(bits) = candidates.max_by(|a, b| rank(a).total_cmp(&rank(b))) else { return };
        let centre = at(0).midpoint(at(7));
        let middle = middle(&bits);
        let along = (at(bits | 1 << axis) - at(bits)).normalize_or(Vec2::X);
        let mut outward = Vec2::new(along.y, -along.x);
        if outward.dot(middle - centre) < 0.0 {
            outward = -outward;
        }
        let text = format!("{} {} mm", ["X", "Y", "Z"][axis], number(length_mm));
        let half = 0.5 * self.text_size(&text);
        // The text's own extent along the way out, so that it clears the edge at any angle.
        let clearance = outward.abs().dot(half) + 0.012 * self.side();
        let size = Vec2::splat(self.side());
        let margin = half + 0.006 * self.side();
        let place = (middle + clearance * outward).clamp(margin, size - margin);
        self.text(&text, place - half);
    }

    fn text_size(&self, text: &str) -> Vec2 {
        let unit = LETTER_HEIGHT * self.side() / lettering::HEIGHT;
        Vec2::new(lettering::width(text), lettering::HEIGHT) * unit
    }

    /// A text with its upper left corner at a place, over a halo of the background.
    fn text(&mut self, text: &str, upper_left: Vec2) {
        let unit = LETTER_HEIGHT * self.side() / lettering::HEIGHT;
        let lines = lettering::lines(text);
        let placed = |point: &Vec2| upper_left + Vec2::new(point.x, lettering::HEIGHT - point.y) * unit;
        let halo = background(upper_left.y / self.side());
        let weight = (0.72 * unit).max(1.0);
        for (width, ink, strength) in [(weight + 2.6 * unit, halo, 0.5), (weight, INK, 1.0)] {
            for line in &lines {
                for pair in line.windows(2) {
                    self.stroke(placed(&pair[0]), placed(&pair[1]), width, ink, |_, _, _| strength);
                }
            }
        }
    }

    /// A bar of a round length at the lower left.
    fn scale_bar(&mut self, camera: &Camera) {
        let pixels_per_mm = camera.scale / SAMPLES as f64;
        let length_mm = round_length(BAR_LENGTH * f64::from(self.side()) / pixels_per_mm);
        let length = (length_mm * pixels_per_mm) as f32;
        let start = Vec2::new(0.045, 0.955) * self.side();
        let end = start + Vec2::X * length;
        let tick = Vec2::Y * 0.007 * self.side();
        let width = 2.0 * self.pixel();
        for (a, b) in [(start, end), (start - tick, start + tick), (end - tick, end + tick)] {
            self.stroke(a, b, width, INK, |_, _, _| 1.0);
        }
        let text = format!("{} mm", number(length_mm));
        let size = self.text_size(&text);
        self.text(&text, start + Vec2::new(0.5 * (length - size.x), -size.y - 0.012 * self.side()));
    }
}

/// The greatest of 1, 2 and 5 times a power of ten that is at most `most`.
fn round_length(most: f64) -> f64 {
    let decade = 10_f64.powf(most.log10().floor());
    let steps = [5.0, 2.0, 1.0];
    // A power that rounding put above `most` is caught by the last step down.
    steps.into_iter().map(|step| step * decade).find(|length| *length <= most).unwrap_or(0.5 * decade)
}

/// Four significant digits at most, without trailing zeros.
fn number(value: f64) -> String {
    if !(1e-4..1e7).contains(&value) {
        return format!("{value:.2e}");
    }
    let whole_digits = value.log10().floor() as i32 + 1;
    let decimals = usize::try_from(4 - whole_digits).unwrap_or(0);
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::float_cmp, reason = "round lengths are exact")]
    fn scale_bars_have_round_lengths() {
        for (most, expected) in [(27.0, 20.0), (50.0, 50.0), (9.99, 5.0), (1.0, 1.0), (0.7, 0.5)] {
            assert_eq!(round_length(most), expected);
        }
    }

    #[test]
    fn dimensions_have_four_digits_at_most() {
        for (value, expected) in [(54.0, "54"), (53.987_6, "53.99"), (0.125, "0.125"), (1234.56, "1235"), (120.0, "120"), (1e-7, "1.00e-7")]
        {
            assert_eq!(number(value), expected);
        }
    }
}
