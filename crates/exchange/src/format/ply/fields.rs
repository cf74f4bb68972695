//! Meshes with numbers on them, as further properties of their vertices and faces.

use super::super::text::{CHUNK_BYTES, single};
use super::super::{Format, FormatError, Geometry, Metadata, fit_pieces};
use super::{Further, check_count, face, flush_full, header_of, push};
use lacuna_kernel::solid::TriMesh;
use std::io::Write;

/// Numbers on a mesh.
#[derive(Clone, Copy, Debug)]
pub struct ScalarField<'a> {
    /// Name of the property: one word.
    pub name: &'a str,
    /// What it is, for a comment.
    pub about: &'a str,
    /// One for every vertex, rounded to single precision; NaN where there is none.
    pub vertices: &'a [f64],
    /// One for every triangle, likewise.
    pub triangles: &'a [f64],
}

/// Writes a mesh with fields as a PLY file: every field is a property of type `float` of the vertices, and one of the faces. Infinities stay infinite. Memory
/// stays flat.
///
/// # Errors
/// As [`write()`](super::super::write()).
pub fn write_fields<W: Write>(
    mesh: &TriMesh,
    fields: &[ScalarField<'_>],
    metadata: &Metadata<'_>,
    sink: &mut W,
) -> Result<(), FormatError> {
    fit_pieces(Format::Ply, &Geometry::Polygons { mesh, polygons: &[], closed: true })?;
    let (vertices, triangles) = (mesh.vertices.len() as u64, mesh.triangles.len() as u64);
    check_count(vertices)?;
    let properties: String = fields.iter().map(|field| format!("property float {}\n", field.name)).collect();
    let further = Further {
        comments: fields.iter().map(|field| format!("{}: {}", field.name, field.about)).collect(),
        vertex: properties.clone(),
        face: properties,
    };
    let mut bytes = Vec::with_capacity(CHUNK_BYTES + 4096);
    bytes.extend_from_slice(header_of([vertices, triangles, 0], false, &further, metadata).as_bytes());
    let number = |bytes: &mut Vec<u8>, of: &[f64], index: usize| {
        let value = of.get(index).map_or(f32::NAN, |&value| single(value));
        bytes.extend_from_slice(&value.to_le_bytes());
    };
    for (index, vertex) in mesh.vertices.iter().enumerate() {
        push(vertex, &mut bytes);
        fields.iter().for_each(|field| number(&mut bytes, field.vertices, index));
        flush_full(&mut bytes, sink)?;
    }
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        bytes.extend_from_slice(&face(triangle, 0));
        fields.iter().for_each(|field| number(&mut bytes, field.triangles, index));
        flush_full(&mut bytes, sink)?;
    }
    sink.write_all(&bytes)?;
    sink.flush()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::super::{ReadLimits, read};
    use super::*;
    use glam::DVec3;

    #[test]
    fn a_field_is_a_property_and_the_mesh_stays_what_it_is() {
        let mesh = TriMesh {
            vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
        };
        let field =
            ScalarField { name: "depth", about: "how deep", vertices: &[0.5, f64::INFINITY, 2.0], triangles: &[1.0, 2.0, 3.0, 4.0] };
        // A title that looks like a part of the header is none.
        let metadata = Metadata { title: Some("property float z"), ..Metadata::default() };
        let mut file = Vec::new();
        write_fields(&mesh, &[field], &metadata, &mut file).unwrap();
        assert_eq!(read(&file, None, &ReadLimits::default()).unwrap().mesh, mesh);
        let end = b"end_header\n";
        let body = file.windows(end.len()).position(|words| words == end).unwrap() + end.len();
        let header = String::from_utf8(file[..body].to_vec()).unwrap();
        let expected = "comment property float z\ncomment depth: how deep\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty \
                        float depth\nelement face 4\nproperty list uchar int vertex_indices\nproperty float depth\nend_header\n";
        assert!(header.ends_with(expected), "{header}");
        let number = |at: usize| f32::from_le_bytes(file[body + at..body + at + 4].try_into().unwrap());
        assert_eq!([number(12), number(28), number(44)], [0.5, f32::INFINITY, 2.0]);
        assert!(number(60).is_nan());
        assert_eq!([0, 1, 2, 3].map(|face| number(64 + 17 * face + 13)), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(file.len(), body + 4 * 16 + 4 * 17);
    }

    #[test]
    fn what_is_no_mesh_is_refused() {
        let mut sink = Vec::new();
        let far = TriMesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::splat(1e300)], triangles: vec![[0, 1, 2]] };
        for (mesh, code) in [(TriMesh::default(), FormatError::Empty.code()), (far, "format.not-finite")] {
            assert_eq!(write_fields(&mesh, &[], &Metadata::default(), &mut sink).unwrap_err().code(), code);
            assert!(sink.is_empty());
        }
    }
}
