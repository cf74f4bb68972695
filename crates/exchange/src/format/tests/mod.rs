//! Round trips, hostile files and determinism, through the public doors.

#![allow(clippy::unwrap_used)]

mod hostile;
mod polygons;
mod round_trip;

use super::*;
use glam::DVec3;
use lacuna_kernel::solid::TriMesh;
use std::io::Cursor;

/// Rounded to single precision, as a proven mesh is.
fn rounded(position: DVec3) -> DVec3 {
    DVec3::from_array(position.to_array().map(|value| f64::from(value as f32)))
}

/// A torus of radii 20 mm and 7 mm about `centre`.
fn torus(around: u32, across: u32, centre: DVec3) -> TriMesh {
    let mut mesh = TriMesh::default();
    for i in 0..around {
        let (sin, cos) = (f64::from(i) / f64::from(around) * std::f64::consts::TAU).sin_cos();
        for j in 0..across {
            let (up, out) = (f64::from(j) / f64::from(across) * std::f64::consts::TAU).sin_cos();
            let radius = 20.0 + 7.0 * out;
            mesh.vertices.push(rounded(centre + DVec3::new(radius * cos, radius * sin, 7.0 * up)));
            let at = |i: u32, j: u32| i % around * across + j % across;
            mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    mesh
}

/// A cube; an inward one bounds a cavity.
fn cube(low: DVec3, edge: f64, inward: bool) -> TriMesh {
    let corner = |bits: usize| DVec3::new((bits & 1) as f64, (bits >> 1 & 1) as f64, (bits >> 2) as f64);
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut mesh = TriMesh::default();
    mesh.vertices.extend((0..8).map(|bits| low + edge * corner(bits)));
    for [a, b, c, d] in faces {
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
    if inward {
        mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    mesh
}

fn join(meshes: &[TriMesh]) -> TriMesh {
    let mut all = TriMesh::default();
    for mesh in meshes {
        let first = all.vertices.len() as u32;
        all.vertices.extend(&mesh.vertices);
        all.triangles.extend(mesh.triangles.iter().map(|triangle| triangle.map(|index| first + index)));
    }
    all
}

/// Two components, one with a sealed cavity.
fn hollow_and_torus() -> TriMesh {
    let hollow = [cube(DVec3::splat(40.0), 12.0, false), cube(DVec3::splat(43.0), 5.5, true)];
    join(&[hollow[0].clone(), hollow[1].clone(), torus(24, 12, DVec3::ZERO)])
}

fn written<'a>(format: Format, geometry: impl Into<Geometry<'a>>, metadata: &Metadata<'_>) -> Vec<u8> {
    let mut sink = Cursor::new(Vec::new());
    write(format, geometry, metadata, &mut sink).unwrap();
    sink.into_inner()
}

/// The corners of every triangle, which do not depend on how vertices are numbered, in the
/// precision of files: a decimal reads as the nearest double.
fn corners(mesh: &TriMesh) -> Vec<[DVec3; 3]> {
    mesh.triangles.iter().map(|triangle| triangle.map(|index| rounded(mesh.vertices[index as usize]))).collect()
}
