//! A picture of a geometry, so that a reader sees what a file holds before a slicer does.
//!
//! A software rasteriser: triangles, wires as tubes and points as balls go into one depth buffer
//! with 2 x 2 samples to a pixel, which remembers which element is nearest; light is computed
//! afterwards, once for each sample that is seen. Obscurance (after Loos and Sloan, Volumetric
//! Obscurance, 2010) darkens what lies deep among other parts, which is what makes lacunar shapes
//! legible; distance fades towards the background. The box around the shape carries its
//! dimensions in mm. No graphics device is used, and the picture does not depend on the number of
//! threads.

mod annotation;
mod camera;
mod lettering;
mod light;
mod raster;

use super::error::{FormatError, Place};
use super::geometry::{self, Counts, Geometry, Piece};
use camera::Camera;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::borrow::Cow;
use std::io::Write;

/// How a picture is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreviewOptions {
    /// Width and height in pixels. Default 1024; 64 to 4096, because a smaller one shows nothing
    /// and a larger one is no preview.
    pub pixels: u32,
    /// Direction of the eye about the Z axis, from X towards Y. Default: chosen by the shape, -1.05
    /// (60 degrees from the X axis towards the front) for what is not flat.
    pub azimuth_rad: Option<f64>,
    /// Height of the eye above the XY plane. Default: chosen by the shape, 0.5 (29 degrees, near
    /// the isometric view) for what is not flat; what is flat is seen straight on.
    pub elevation_rad: Option<f64>,
    /// Whether box, dimensions and scale bar are drawn. Default true.
    pub annotated: bool,
}

impl PreviewOptions {
    /// Smallest and largest side in pixels.
    pub const PIXELS: [u32; 2] = [64, 4096];
}

impl Default for PreviewOptions {
    fn default() -> Self {
        Self { pixels: 1024, azimuth_rad: None, elevation_rad: None, annotated: true }
    }
}

/// Samples along a pixel's side.
const SAMPLES: usize = 2;

/// Linear light, red, green and blue.
type Light = Vec3;

/// An image in linear light, rows from the top.
struct Image {
    side: usize,
    pixels: Vec<Light>,
}

/// Elements over projected vertices: x to the right and y down in samples, z towards the eye in
/// the same unit.
struct Scene<'a> {
    vertices: Vec<Vec3>,
    triangles: Cow<'a, [[u32; 3]]>,
    segments: Cow<'a, [[u32; 2]]>,
    points: Cow<'a, [u32]>,
    /// Radius of a wire, in samples.
    wire_radius: f32,
    /// Radius of a point, in samples.
    point_radius: f32,
}

/// Draws `geometry` and writes it as a PNG file.
///
/// # Errors
/// [`FormatError::Empty`] if there is nothing to see, [`FormatError::NotFinite`] and
/// [`FormatError::IndexOutOfRange`] for an unfit geometry, [`FormatError::Limit`] for a side out of
/// range, more than 4 thousand million elements, or layers over layers of them, [`FormatError::Stream`] if the sink fails.
pub fn write<'a, W: Write>(geometry: impl Into<Geometry<'a>>, options: &PreviewOptions, sink: &mut W) -> Result<(), FormatError> {
    let geometry = geometry.into();
    let pieces = geometry.pieces();
    let counts = geometry::counts(&pieces);
    let [fewest, most] = PreviewOptions::PIXELS;
    if !(fewest..=most).contains(&options.pixels) {
        return Err(FormatError::limit(Place::File, "pixels", u64::from(options.pixels), u64::from(most)));
    }
    let elements = counts.triangles + counts.segments + counts.points;
    if elements >= u64::from(u32::MAX) || counts.vertices > u64::from(u32::MAX) {
        return Err(FormatError::limit(Place::File, "elements", elements, u64::from(u32::MAX) - 1));
    }
    geometry::check(&pieces)?;
    let [low, high] = bounds(&pieces).ok_or(FormatError::Empty)?;
    let camera = Camera::new(options, low, high);
    let scene = Scene::new(&pieces, counts, &camera, options);
    let samples = raster::rasterise(&scene, options.pixels as usize * SAMPLES)?;
    let mut image = light::shade(&scene, &samples, &camera);
    if options.annotated {
        annotation::draw(&mut image, &samples, &camera, low, high);
    }
    encode(&image, sink)
}

/// The box of all vertices that are used.
fn bounds(pieces: &[Piece<'_>]) -> Option<[DVec3; 2]> {
    const CHUNK: usize = 1 << 16;
    let join = |a: Option<[DVec3; 2]>, b: Option<[DVec3; 2]>| match (a, b) {
        (Some([a, b]), Some([c, d])) => Some([a.min(c), b.max(d)]),
        (some, None) | (None, some) => some,
    };
    pieces
        .iter()
        .map(|piece| {
            let of = |indices: &[u32]| {
                indices.iter().fold(None, |so_far, &index| {
                    let vertex = piece.vertices[index as usize];
                    join(so_far, Some([vertex, vertex]))
                })
            };
            let of_all = |indices: &[u32]| indices.par_chunks(CHUNK).map(of).reduce(|| None, join);
            let runs = [piece.triangles.as_flattened(), piece.segments.as_flattened(), piece.points];
            runs.into_iter().map(of_all).fold(None, join)
        })
        .fold(None, join)
}

impl<'a> Scene<'a> {
    fn new(pieces: &[Piece<'a>], counts: Counts, camera: &Camera, options: &PreviewOptions) -> Self {
        let mut vertices = Vec::with_capacity(usize::try_from(counts.vertices).unwrap_or(0));
        for piece in pieces {
            vertices.par_extend(piece.vertices.par_iter().map(|vertex| camera.project(*vertex)));
        }
        // Many elements are drawn finer, so that they do not run into one another.
        let pixel = (SAMPLES as f64 * f64::from(options.pixels) / 1024.0).max(1.0);
        let finer = |most: f64, least: f64, half_at: f64, count: u64| {
            ((most * (half_at / (half_at + count as f64)).sqrt()).max(least) * pixel) as f32
        };
        Self {
            vertices,
            triangles: joined(pieces, |piece| piece.triangles, |triangle, first| triangle.map(|index| first + index)),
            segments: joined(pieces, |piece| piece.segments, |segment, first| segment.map(|index| first + index)),
            points: joined(pieces, |piece| piece.points, |index, first| first + index),
            wire_radius: finer(2.6, 0.7, 2000.0, counts.segments),
            point_radius: finer(4.5, 0.7, 1000.0, counts.points),
        }
    }
}

/// The elements of all pieces over one run of vertices; a single piece's are borrowed.
fn joined<'a, T: Copy>(pieces: &[Piece<'a>], elements: impl Fn(&Piece<'a>) -> &'a [T], shift: impl Fn(T, u32) -> T) -> Cow<'a, [T]> {
    if let [piece] = pieces {
        return Cow::Borrowed(elements(piece));
    }
    let mut all = Vec::new();
    let mut first = 0;
    for piece in pieces {
        all.extend(elements(piece).iter().map(|&element| shift(element, first)));
        first += piece.vertices.len() as u32;
    }
    Cow::Owned(all)
}

/// Bytes of the sRGB transfer curve.
fn encode<W: Write>(image: &Image, sink: &mut W) -> Result<(), FormatError> {
    let encoded = |light: f32| {
        let light = light.clamp(0.0, 1.0);
        let value = if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
        (value * 255.0 + 0.5) as u8
    };
    let bytes: Vec<u8> = image.pixels.par_iter().flat_map_iter(|light| light.to_array().map(encoded)).collect();
    let side = image.side as u32;
    let mut encoder = png::Encoder::new(sink, side, side);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&bytes)?;
    writer.finish()?;
    Ok(())
}

#[cfg(test)]
mod tests;
