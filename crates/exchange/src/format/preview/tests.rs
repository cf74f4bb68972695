//! Pictures show the shape where it is, and the same one for any number of threads.

#![allow(clippy::unwrap_used)]

use super::*;
use lacuna_kernel::tessellation::Tessellation;

fn picture(sample: &Tessellation, options: &PreviewOptions) -> Vec<[u8; 3]> {
    let mut bytes = Vec::new();
    write(sample, options, &mut bytes).unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    pixels.as_chunks::<3>().0.to_vec()
}

/// Whether a pixel is clay rather than background: warm.
fn is_clay([red, _, blue]: [u8; 3]) -> bool {
    red > blue.saturating_add(20)
}

fn options(pixels: u32) -> PreviewOptions {
    PreviewOptions { pixels, annotated: false, ..PreviewOptions::default() }
}

#[test]
fn triangles_wires_and_points_are_seen() {
    let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let empty = Tessellation { vertices, ..Tessellation::default() };
    let surface = Tessellation { triangles: vec![[0, 1, 2], [0, 1, 3]], ..empty.clone() };
    let wires = Tessellation { segments: vec![[0, 1], [2, 3]], ..empty.clone() };
    let points = Tessellation { points: vec![0, 1, 2, 3], ..empty.clone() };
    let mut seen = [&surface, &wires, &points].map(|sample| {
        let pixels = picture(sample, &options(200));
        pixels.into_iter().filter(|pixel| is_clay(*pixel)).count()
    });
    assert!(seen.iter().all(|count| *count > 20), "{seen:?}");
    seen.reverse();
    assert!(seen.is_sorted(), "{seen:?}");
    let error = write(&empty, &options(200), &mut Vec::new()).unwrap_err();
    assert_eq!(error.code(), "format.empty-geometry");
}

#[test]
fn the_nearer_triangle_hides_the_other() {
    // Two squares, one above the other, seen from straight above.
    let square = |z: f64, half: f64| [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(half * x, half * y, z));
    let mut sample = Tessellation { vertices: [square(0.0, 1.0), square(1.0, 0.5)].concat(), ..Tessellation::default() };
    sample.triangles = vec![[4, 5, 6], [4, 6, 7], [0, 1, 2], [0, 2, 3]];
    let above = PreviewOptions { elevation_rad: Some(std::f64::consts::FRAC_PI_2), azimuth_rad: Some(0.0), ..options(100) };
    let pixels = picture(&sample, &above);
    let [middle, border] = [[50, 50], [50, 12]].map(|[row, column]: [usize; 2]| pixels[row * 100 + column]);
    assert!(is_clay(middle) && is_clay(border));
    // What is nearer has less of the background in it.
    assert!(middle[2] < border[2], "{middle:?} {border:?}");
}

#[test]
fn shapes_without_extent_are_drawn_all_the_same() {
    let point = Tessellation { vertices: vec![DVec3::splat(7.0)], points: vec![0], ..Tessellation::default() };
    assert!(picture(&point, &PreviewOptions::default()).into_iter().any(is_clay));
    let needle = Tessellation {
        vertices: vec![DVec3::ZERO, DVec3::X * 1e-9, DVec3::X * 1e-9],
        triangles: vec![[0, 1, 2], [0, 0, 0]],
        segments: vec![[0, 1]],
        ..Tessellation::default()
    };
    assert!(picture(&needle, &PreviewOptions::default()).into_iter().any(is_clay));
}

#[test]
fn sides_out_of_range_are_refused() {
    let point = Tessellation { vertices: vec![DVec3::ZERO], points: vec![0], ..Tessellation::default() };
    for pixels in [0, 63, 4097] {
        assert_eq!(write(&point, &options(pixels), &mut Vec::new()).unwrap_err().code(), "format.limit");
    }
}

#[test]
fn layers_over_layers_are_refused() {
    let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    let triangles = vec![[0, 1, 2]; 100_000];
    let sample = Tessellation { vertices, triangles, ..Tessellation::default() };
    let error = write(&sample, &PreviewOptions::default(), &mut Vec::new()).unwrap_err();
    assert_eq!(error.limit_facts().unwrap().limit, "preview_samples");
}
