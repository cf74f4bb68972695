//! Light on what is seen: a lamp over the viewer's shoulder, the sky, and what obscures it.

use super::camera::Camera;
use super::raster::{Element, NOTHING, Samples, tube};
use super::{Image, Light, SAMPLES, Scene};
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

/// Colour of the background at the top and at the bottom.
const BACKGROUND: [Light; 2] = [Vec3::new(0.93, 0.945, 0.965), Vec3::new(0.80, 0.825, 0.86)];
/// What the material throws back of red, green and blue: fired clay, warm against the background.
const CLAY: Light = Vec3::new(0.72, 0.29, 0.13);
/// Towards the lamp in the picture's axes, a unit vector: from above, a little to the left, so that
/// the three faces of a cube that are seen differ.
const LAMP: Vec3 = Vec3::new(-0.2, 0.66, 0.724_154);
const LAMP_LIGHT: Light = Vec3::new(0.82, 0.79, 0.74);
const SKY_LIGHT: Light = Vec3::new(0.38, 0.41, 0.46);
const GROUND_LIGHT: Light = Vec3::new(0.17, 0.15, 0.14);
/// Share of the lamp that glances off at the best angle.
const GLOSS: f32 = 0.10;
/// How much of the background the farthest part takes on.
const HAZE: f32 = 0.16;

/// Radii of obscurance as shares of the picture's side: crevices, holes, and whole hollows.
const OBSCURANCE_RADII: [f32; 3] = [0.010, 0.032, 0.090];
/// Samples taken in each radius.
const OBSCURANCE_SAMPLES: usize = 13;
/// The sunflower's turn from seed to seed, which spreads them evenly.
const GOLDEN_TURN: f32 = 2.399_963;

pub(super) fn background(height: f32) -> Light {
    BACKGROUND[0].lerp(BACKGROUND[1], height)
}

/// Lights every sample and joins them to pixels.
pub(super) fn shade(scene: &Scene<'_>, samples: &Samples, camera: &Camera) -> Image {
    let side = samples.side / SAMPLES;
    let near = nearest(samples);
    let openness = smoothed(&openness(&near, side), &near, side);
    let sky = camera.direction(DVec3::Z);
    let mut pixels = vec![Light::ZERO; side * side];
    pixels.par_chunks_mut(side).enumerate().for_each(|(row, pixels)| {
        let behind = background(row as f32 / side as f32);
        for (column, pixel) in pixels.iter_mut().enumerate() {
            if near[row * side + column] == f32::NEG_INFINITY {
                *pixel = behind;
                continue;
            }
            let open = openness[row * side + column];
            let mut sum = Light::ZERO;
            for (y, x) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let at = [row * SAMPLES + y, column * SAMPLES + x];
                let lit = lit_sample(scene, samples, at, sky, open);
                sum += lit.map_or(behind, |(light, depth)| {
                    let [farthest, closest] = camera.depths;
                    let distance = (closest - depth) / (closest - farthest).max(f32::MIN_POSITIVE);
                    light.lerp(behind, HAZE * distance.clamp(0.0, 1.0))
                });
            }
            *pixel = sum / (SAMPLES * SAMPLES) as f32;
        }
    });
    Image { side, pixels }
}

/// The light that comes from a sample, and its depth.
fn lit_sample(scene: &Scene<'_>, samples: &Samples, [row, column]: [usize; 2], sky: Vec3, open: f32) -> Option<(Light, f32)> {
    let index = row * samples.side + column;
    let element = samples.elements[index];
    if element == NOTHING {
        return None;
    }
    let at = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
    let across = |ends, radius| tube(ends, radius, at).map_or(Vec3::Z, |(_, normal)| normal);
    let seen = match scene.element(element) {
        Element::Triangle([a, b, c]) => (b - a).cross(c - a).normalize_or(Vec3::Z),
        Element::Segment(ends) => across(ends, scene.wire_radius),
        Element::Point(centre) => across([centre; 2], scene.point_radius),
    };
    // From y down to y up, and towards the eye: an open surface is seen from both sides.
    let normal = Vec3::new(seen.x, -seen.y, seen.z);
    let normal = if normal.z < 0.0 { -normal } else { normal };
    let lamp = normal.dot(LAMP).max(0.0);
    let upward = 0.5 + 0.5 * normal.dot(sky);
    // Light that comes from everywhere is what obscurance keeps off; the lamp a little.
    let around = GROUND_LIGHT.lerp(SKY_LIGHT, upward) * open;
    let direct = LAMP_LIGHT * lamp * (0.2 + 0.8 * open);
    let halfway = (LAMP + Vec3::Z).normalize();
    let glance = GLOSS * normal.dot(halfway).max(0.0).powi(24) * open;
    Some((CLAY * (around + direct) + Light::splat(glance), samples.depths[index]))
}

/// The nearest depth in each pixel, in pixels.
fn nearest(samples: &Samples) -> Vec<f32> {
    let side = samples.side / SAMPLES;
    let row = |row: usize| {
        (0..side).map(move |column| {
            let depth = |y: usize, x: usize| samples.depths[(row * SAMPLES + y) * samples.side + column * SAMPLES + x];
            depth(0, 0).max(depth(0, 1)).max(depth(1, 0)).max(depth(1, 1)) / SAMPLES as f32
        })
    };
    (0..side).into_par_iter().flat_map_iter(row).collect()
}

/// Pixels along the side of the square in which each pixel takes other samples.
const PATTERN: usize = 4;

/// Offsets in the unit disc for each pixel of a square of [`PATTERN`]: sunflowers, each turned by
/// another angle, so that averaging over the square counts many directions.
fn sunflowers() -> Vec<[Vec2; OBSCURANCE_SAMPLES]> {
    let turns = (PATTERN * PATTERN) as f32;
    let flower = |pixel: usize| {
        // Neighbours differ by a large turn: 7 runs through all sixteen.
        let turn = (pixel * 7 % (PATTERN * PATTERN)) as f32 / turns;
        std::array::from_fn(|seed| {
            let share = (seed as f32 + 0.25 + 0.5 * turn) / OBSCURANCE_SAMPLES as f32;
            Vec2::from_angle(seed as f32 * GOLDEN_TURN + turn * std::f32::consts::TAU) * share.sqrt()
        })
    };
    (0..PATTERN * PATTERN).map(flower).collect()
}

/// How open the surroundings of each pixel are, from 0 to 1.
fn openness(near: &[f32], side: usize) -> Vec<f32> {
    let sunflowers = sunflowers();
    let mut open = vec![1.0; side * side];
    open.par_chunks_mut(side).enumerate().for_each(|(row, open)| {
        for (column, open) in open.iter_mut().enumerate() {
            if near[row * side + column] > f32::NEG_INFINITY {
                let sunflower = &sunflowers[row % PATTERN * PATTERN + column % PATTERN];
                *open = pixel_openness(near, side, [row, column], sunflower);
            }
        }
    });
    open
}

/// A ball about the surface is half full on a plane; what fills more of it obscures. A surface far
/// before the ball is another part of the shape and tells nothing of the ball.
fn pixel_openness(near: &[f32], side: usize, [row, column]: [usize; 2], sunflower: &[Vec2]) -> f32 {
    let here = near[row * side + column];
    let last = side as f32 - 1.0;
    let mut open = 1.0;
    for share in OBSCURANCE_RADII {
        let radius = share * side as f32;
        let (mut filled, mut weights) = (0.0, 0.0);
        for offset in sunflower {
            let half_chord = radius * (1.0 - offset.length_squared()).max(0.0).sqrt();
            let x = (column as f32 + 0.5 + radius * offset.x).clamp(0.0, last) as usize;
            let y = (row as f32 + 0.5 + radius * offset.y).clamp(0.0, last) as usize;
            let before = near[y * side + x] - here;
            let far_before = ((before - 2.5 * radius) / (3.0 * radius)).clamp(0.0, 1.0);
            let share = ((before + half_chord) / (2.0 * half_chord)).clamp(0.0, 1.0);
            filled += half_chord * (share + (0.5 - share) * far_before);
            weights += half_chord;
        }
        let excess = (filled / weights - 0.5).max(0.0);
        open *= 1.0 - (1.6 * excess).min(0.8);
    }
    open
}

/// The mean over a square of [`PATTERN`] of what lies about as deep.
fn smoothed(open: &[f32], near: &[f32], side: usize) -> Vec<f32> {
    let reach = 0.02 * side as f32;
    let mut smooth = vec![1.0; side * side];
    smooth.par_chunks_mut(side).enumerate().for_each(|(row, smooth)| {
        for (column, smooth) in smooth.iter_mut().enumerate() {
            let here = near[row * side + column];
            if here == f32::NEG_INFINITY {
                continue;
            }
            let window = |at: usize| at.saturating_sub(PATTERN / 2)..(at + PATTERN / 2).min(side);
            let (mut sum, mut count) = (open[row * side + column], 1.0);
            for y in window(row) {
                for at in y * side + window(column).start..y * side + window(column).end {
                    if (near[at] - here).abs() < reach {
                        sum += open[at];
                        count += 1.0;
                    }
                }
            }
            *smooth = sum / count;
        }
    });
    smooth
}
