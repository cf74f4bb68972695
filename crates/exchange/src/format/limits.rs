//! How much a file that somebody sent may ask for.

use super::error::{FormatError, Place};
use glam::DVec3;
use lacuna_kernel::model::polygon::{self, PolygonFault, PolygonRun};
use lacuna_kernel::solid::TriMesh;

/// Bounds on a file that is read. Each is checked before memory is taken for what it bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadLimits {
    /// Bytes of the file. Default 512 MiB: the largest meshes in daily use, in any format.
    pub file_bytes: u64,
    /// Vertices of the mesh that results. Default 50 million, 1.2 GB of coordinates.
    pub vertices: u64,
    /// Triangles of the mesh that results, all instances counted, or segments and points of a file without faces. Default 50 million.
    pub triangles: u64,
    /// Entries of an archive. Default 200: a 3MF file has a handful, and one for each part and picture.
    pub archive_entries: u64,
    /// Inflated bytes of an archive, counted while inflating because declared sizes lie.
    /// Default 1 GiB.
    pub inflated_bytes: u64,
    /// Inflated bytes for one byte of the archive. Default 100: vertices in XML deflate to about a
    /// tenth, a bomb reaches a thousand.
    pub inflation_ratio: u64,
    /// Nesting of elements in the XML of an archive. Default 32: a 3MF file has seven levels of its own.
    pub xml_depth: u64,
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
            archive_entries: 200,
            inflated_bytes: 1 << 30,
            inflation_ratio: 100,
            xml_depth: 32,
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

/// What a file's faces are.
#[derive(Default)]
pub(crate) struct Read {
    pub(crate) mesh: TriMesh,
    /// Which triangles are polygons.
    pub(crate) polygons: Vec<PolygonRun>,
    /// Polygons that no triangles fill, by the number of their face.
    pub(crate) unfilled: Vec<(u64, PolygonFault)>,
    /// What has one or two corners.
    pub(crate) segments: Vec<[u32; 2]>,
    pub(crate) points: Vec<u32>,
}

/// A mesh under construction, kept within the limits.
pub(crate) struct MeshBuilder<'a> {
    limits: &'a ReadLimits,
    read: Read,
    /// Triangles beyond the first of every polygon: those that are no faces of their own.
    beyond: u64,
    /// A polygon's corners and triangles, kept for their room.
    corners: Vec<u32>,
    triangles: Vec<[u32; 3]>,
}

impl<'a> MeshBuilder<'a> {
    pub(crate) fn new(limits: &'a ReadLimits) -> Self {
        Self { limits, read: Read::default(), beyond: 0, corners: Vec::new(), triangles: Vec::new() }
    }

    pub(crate) fn vertex_count(&self) -> usize {
        self.read.mesh.vertices.len()
    }

    /// Refuses announced counts over the limits; takes memory only for what the file has bytes for.
    pub(crate) fn announce(&mut self, vertices: u64, triangles: u64, bytes_left: u64, place: &Place) -> Result<(), FormatError> {
        within(place.clone(), "vertices", vertices, self.limits.vertices)?;
        within(place.clone(), "triangles", triangles, self.limits.triangles)?;
        // Neither a vertex nor a face is shorter than four bytes in any format read here.
        let backed = |count: u64| usize::try_from(count.min(bytes_left / 4)).unwrap_or(usize::MAX);
        reserve(&mut self.read.mesh.vertices, backed(vertices), place)?;
        reserve(&mut self.read.mesh.triangles, backed(triangles), place)
    }

    pub(crate) fn vertex(&mut self, position: DVec3, place: &dyn Fn() -> Place) -> Result<(), FormatError> {
        if !position.is_finite() {
            let value = position.to_array().into_iter().find(|value| !value.is_finite()).unwrap_or(f64::NAN);
            return Err(FormatError::NotFinite { place: place(), value });
        }
        let count = self.read.mesh.vertices.len() as u64 + 1;
        if count > self.limits.vertices {
            return Err(FormatError::limit(place(), "vertices", count, self.limits.vertices));
        }
        if self.read.mesh.vertices.len() == self.read.mesh.vertices.capacity() {
            reserve(&mut self.read.mesh.vertices, 1, &place())?;
        }
        self.read.mesh.vertices.push(position);
        Ok(())
    }

    /// Adds a polygon, cut into triangles; one that has no inside as a fan, and notes that. Faces with fewer than three corners
    /// are segments and points.
    pub(crate) fn polygon(&mut self, corners: &[i64], place: &dyn Fn() -> Place) -> Result<(), FormatError> {
        self.corners.clear();
        for &index in corners {
            let index = self.index(index, place)?;
            self.corners.push(index);
        }
        match *self.corners.as_slice() {
            [] => return Ok(()),
            [a] => return self.point(a, place),
            [a, b] => return self.segment([a, b], place),
            [a, b, c] => return self.triangle([a, b, c], place),
            _ => {}
        }
        let first = self.read.mesh.triangles.len();
        let count = corners.len() - 2;
        within(place(), "triangles", (first + count) as u64, self.limits.triangles)?;
        self.triangles.clear();
        reserve(&mut self.triangles, count, &place())?;
        if let Err(fault) = polygon::cut(&self.read.mesh.vertices, &self.corners, &mut self.triangles) {
            self.triangles.extend(polygon::fan(&self.corners));
            if self.read.unfilled.len() == self.read.unfilled.capacity() {
                reserve(&mut self.read.unfilled, 1, &place())?;
            }
            self.read.unfilled.push((first as u64 - self.beyond, fault));
        }
        reserve(&mut self.read.mesh.triangles, count, &place())?;
        self.read.mesh.triangles.extend_from_slice(&self.triangles);
        if self.read.polygons.len() == self.read.polygons.capacity() {
            reserve(&mut self.read.polygons, 1, &place())?;
        }
        self.read.polygons.push(PolygonRun { first: first as u32, count: count as u32 });
        self.beyond += count as u64 - 1;
        Ok(())
    }

    /// Adds the segments of a chain of vertices; a point if it is one alone.
    pub(crate) fn chain(&mut self, corners: &[i64], place: &dyn Fn() -> Place) -> Result<(), FormatError> {
        if corners.len() < 2 {
            return self.polygon(corners, place);
        }
        corners.windows(2).try_for_each(|ends| self.polygon(ends, place))
    }

    /// Makes every vertex a point.
    pub(crate) fn points_alone(&mut self, place: &dyn Fn() -> Place) -> Result<(), FormatError> {
        let count = self.read.mesh.vertices.len();
        within(place(), "triangles", count as u64, self.limits.triangles)?;
        reserve(&mut self.read.points, count, &place())?;
        self.read.points.extend(0..count as u32);
        Ok(())
    }

    fn segment(&mut self, ends: [u32; 2], place: &dyn Fn() -> Place) -> Result<(), FormatError> {
        self.one_more(place)?;
        if self.read.segments.len() == self.read.segments.capacity() {
            reserve(&mut self.read.segments, 1, &place())?;
        }
        self.read.segments.push(ends);
        Ok(())
    }

    fn point(&mut self, vertex: u32, place: &dyn Fn() -> Place) -> Result<(), FormatError> {
        self.one_more(place)?;
        if self.read.points.len() == self.read.points.capacity() {
            reserve(&mut self.read.points, 1, &place())?;
        }
        self.read.points.push(vertex);
        Ok(())
    }

    /// Whether there may be one more of whatever is thinner than a triangle.
    fn one_more(&self, place: &dyn Fn() -> Place) -> Result<(), FormatError> {
        let count = (self.read.segments.len() + self.read.points.len()) as u64 + 1;
        if count > self.limits.triangles { Err(FormatError::limit(place(), "triangles", count, self.limits.triangles)) } else { Ok(()) }
    }

    fn index(&self, index: i64, place: &dyn Fn() -> Place) -> Result<u32, FormatError> {
        let vertices = self.read.mesh.vertices.len() as u64;
        match u32::try_from(index) {
            Ok(index) if u64::from(index) < vertices => Ok(index),
            _ => Err(FormatError::IndexOutOfRange { place: place(), index, vertices }),
        }
    }

    /// Adds a triangle whose indices are known to be in range.
    pub(crate) fn triangle(&mut self, corners: [u32; 3], place: &dyn Fn() -> Place) -> Result<(), FormatError> {
        let count = self.read.mesh.triangles.len() as u64 + 1;
        if count > self.limits.triangles {
            return Err(FormatError::limit(place(), "triangles", count, self.limits.triangles));
        }
        if self.read.mesh.triangles.len() == self.read.mesh.triangles.capacity() {
            reserve(&mut self.read.mesh.triangles, 1, &place())?;
        }
        self.read.mesh.triangles.push(corners);
        Ok(())
    }

    /// What was built.
    pub(crate) fn finish(self) -> Read {
        self.read
    }
}
