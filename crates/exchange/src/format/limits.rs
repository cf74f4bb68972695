//! How much a file that somebody sent may ask for.

use super::error::{FormatError, Place};
use super::read::Fan;
use glam::DVec3;
use lacuna_kernel::solid::TriMesh;

/// Bounds on a file that is read. Each is checked before memory is taken for what it bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadLimits {
    /// Bytes of the file. Default 512 MiB: the largest meshes in daily use, in any format.
    pub file_bytes: u64,
    /// Vertices of the mesh that results. Default 50 million, 1.2 GB of coordinates.
    pub vertices: u64,
    /// Triangles of the mesh that results, all instances counted. Default 50 million.
    pub triangles: u64,
    /// Entries of an archive. Default 4096: a 3MF file of many parts has a few hundred.
    pub archive_entries: u64,
    /// Inflated bytes of an archive, counted while inflating because declared sizes lie.
    /// Default 4 GiB.
    pub inflated_bytes: u64,
    /// Inflated bytes for one byte of the archive. Default 200: vertices in XML deflate to about a
    /// tenth, a bomb reaches a thousand.
    pub inflation_ratio: u64,
    /// Nesting of components in a 3MF file. Default 32.
    pub component_depth: u64,
    /// Placed objects of a 3MF file, components followed. Default 100 000.
    pub instances: u64,
}

impl Default for ReadLimits {
    fn default() -> Self {
        Self {
            file_bytes: 512 << 20,
            vertices: 50_000_000,
            triangles: 50_000_000,
            archive_entries: 4096,
            inflated_bytes: 4 << 30,
            inflation_ratio: 200,
            component_depth: 32,
            instances: 100_000,
        }
    }
}

/// `Ok` if `asked` is at most `allowed`.
pub(crate) fn within(place: Place, limit: &'static str, asked: u64, allowed: u64) -> Result<(), FormatError> {
    if asked > allowed { Err(FormatError::limit(place, limit, asked, allowed)) } else { Ok(()) }
}

/// Reserves room for `count` more elements, or says that there is none.
pub(crate) fn reserve<T>(vector: &mut Vec<T>, count: usize, place: &Place) -> Result<(), FormatError> {
    vector
        .try_reserve(count)
        .map_err(|_| FormatError::OutOfMemory { place: place.clone(), bytes: (count as u64).saturating_mul(size_of::<T>() as u64) })
}

/// A mesh under construction, kept within the limits.
pub(crate) struct MeshBuilder<'a> {
    limits: &'a ReadLimits,
    mesh: TriMesh,
    fans: Vec<Fan>,
}

impl<'a> MeshBuilder<'a> {
    pub(crate) fn new(limits: &'a ReadLimits) -> Self {
        Self { limits, mesh: TriMesh::default(), fans: Vec::new() }
    }

    pub(crate) fn vertex_count(&self) -> usize {
        self.mesh.vertices.len()
    }

    /// Refuses announced counts over the limits; takes memory only for what the file has bytes for.
    pub(crate) fn announce(&mut self, vertices: u64, triangles: u64, bytes_left: u64, place: &Place) -> Result<(), FormatError> {
        within(place.clone(), "vertices", vertices, self.limits.vertices)?;
        within(place.clone(), "triangles", triangles, self.limits.triangles)?;
        // Neither a vertex nor a face is shorter than four bytes in any format read here.
        let backed = |count: u64| usize::try_from(count.min(bytes_left / 4)).unwrap_or(usize::MAX);
        reserve(&mut self.mesh.vertices, backed(vertices), place)?;
        reserve(&mut self.mesh.triangles, backed(triangles), place)
    }

    pub(crate) fn vertex(&mut self, position: DVec3, place: &dyn Fn() -> Place) -> Result<(), FormatError> {
        if !position.is_finite() {
            let value = position.to_array().into_iter().find(|value| !value.is_finite()).unwrap_or(f64::NAN);
            return Err(FormatError::NotFinite { place: place(), value });
        }
        let count = self.mesh.vertices.len() as u64 + 1;
        if count > self.limits.vertices {
            return Err(FormatError::limit(place(), "vertices", count, self.limits.vertices));
        }
        if self.mesh.vertices.len() == self.mesh.vertices.capacity() {
            reserve(&mut self.mesh.vertices, 1, &place())?;
        }
        self.mesh.vertices.push(position);
        Ok(())
    }

    /// Adds a polygon as a fan about its first corner. Faces with fewer than three corners hold no
    /// area and are left out.
    pub(crate) fn polygon(&mut self, corners: &[i64], place: &dyn Fn() -> Place) -> Result<(), FormatError> {
        for &index in corners {
            self.index(index, place)?;
        }
        let first = self.mesh.triangles.len() as u32;
        for pair in corners.get(1..).unwrap_or_default().windows(2) {
            self.triangle([self.index(corners[0], place)?, self.index(pair[0], place)?, self.index(pair[1], place)?], place)?;
        }
        if corners.len() > 3 {
            if self.fans.len() == self.fans.capacity() {
                reserve(&mut self.fans, 1, &place())?;
            }
            self.fans.push(Fan { first, count: self.mesh.triangles.len() as u32 - first });
        }
        Ok(())
    }

    fn index(&self, index: i64, place: &dyn Fn() -> Place) -> Result<u32, FormatError> {
        let vertices = self.mesh.vertices.len() as u64;
        match u32::try_from(index) {
            Ok(index) if u64::from(index) < vertices => Ok(index),
            _ => Err(FormatError::IndexOutOfRange { place: place(), index, vertices }),
        }
    }

    /// Adds a triangle whose indices are known to be in range.
    pub(crate) fn triangle(&mut self, corners: [u32; 3], place: &dyn Fn() -> Place) -> Result<(), FormatError> {
        let count = self.mesh.triangles.len() as u64 + 1;
        if count > self.limits.triangles {
            return Err(FormatError::limit(place(), "triangles", count, self.limits.triangles));
        }
        if self.mesh.triangles.len() == self.mesh.triangles.capacity() {
            reserve(&mut self.mesh.triangles, 1, &place())?;
        }
        self.mesh.triangles.push(corners);
        Ok(())
    }

    /// The mesh, and which of its triangles are polygons.
    pub(crate) fn finish(self) -> (TriMesh, Vec<Fan>) {
        (self.mesh, self.fans)
    }
}
