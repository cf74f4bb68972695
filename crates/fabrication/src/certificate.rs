//! The statement of bounds, counts and digests that comes with every result.

/// A verdict that may not have been sought: what was not checked never reads as a pass.
#[derive(Clone, Debug, PartialEq)]
pub enum Checked<T> {
    /// Nobody looked.
    NotChecked,
    /// What was found.
    Found(T),
}

/// How many pairs of triangles intersect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SelfIntersections {
    /// Proven or checked to be none.
    None,
    /// So many pairs.
    Count(u64),
}

/// [lo, hi] with lo <= hi: the exact value lies between.
pub type Interval = [f64; 2];

/// What is proven of a result. Lengths in mm; the same JSON everywhere.
///
/// Members that do not apply to a result (the genus of a wire) are absent.
#[derive(Clone, Debug, PartialEq, Default)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema))]
#[cfg_attr(feature = "wire", serde(deny_unknown_fields))]
pub struct Certificate {
    /// The Hausdorff bound that was asked.
    pub requested_tolerance_mm: f64,
    /// The Hausdorff bound that is proven, single-precision rounding of the file included; never
    /// above the request.
    pub achieved_bound_mm: f64,
    /// Every point of the exact shape eroded by this much lies in the result:
    /// D(r - inner) is inside the solid.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub inner_bound_mm: Option<f64>,
    /// The solid is inside D(r + outer).
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub outer_bound_mm: Option<f64>,
    /// Every point of D(r - inner) lies in a ball of this diameter inside the solid.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub thickness_min_mm: Option<f64>,
    /// Leaf cells (sites) that were evaluated, each counted once.
    pub leaf_cells: u64,
    /// Vertices of the result.
    pub vertices: u64,
    /// Edges of the result.
    pub edges: u64,
    /// Triangles of the result.
    pub triangles: u64,
    /// Connected pieces.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub components: Option<u64>,
    /// Connected boundary surfaces: components and cavities.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub shells: Option<u64>,
    /// Sealed voids.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub cavities: Option<u64>,
    /// Sum of the shells' genera.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub genus: Option<i64>,
    /// vertices - edges + triangles.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub euler: Option<i64>,
    /// Edges with one triangle.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub boundary_edges: Option<u64>,
    /// Edges with three triangles or more.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub nonmanifold_edges: Option<u64>,
    /// Vertices whose triangles form several fans.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub nonmanifold_vertices: Option<u64>,
    /// Pairs of triangles that run along their edge in the same direction.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub flipped_pairs: Option<u64>,
    /// Triangles without area.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub degenerate_triangles: Option<u64>,
    /// `"none"`, a count, or `"not_checked"`.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::count_schema))]
    pub self_intersections: Checked<SelfIntersections>,
    /// `true`, `false` or `"not_checked"`: the same topology at radius r - bound and r + bound.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::flag_schema))]
    pub topology_stable: Checked<bool>,
    /// `[[x, y, z] of the lower corner, [x, y, z] of the upper corner]`, each number an interval
    /// that contains the exact shape's.
    #[cfg_attr(feature = "wire", schema(schema_with = wire::box_schema))]
    pub bbox_mm: [[Interval; 3]; 2],
    /// Volume of the exact shape.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    #[cfg_attr(feature = "wire", schema(schema_with = wire::interval_schema))]
    pub volume_mm3: Option<Interval>,
    /// Area of the exact shape's boundary.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    #[cfg_attr(feature = "wire", schema(schema_with = wire::interval_schema))]
    pub area_mm2: Option<Interval>,
    /// Volume that the written mesh encloses.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub mesh_volume_mm3: Option<f64>,
    /// Area of the written mesh.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub mesh_area_mm2: Option<f64>,
    /// Edge of the lattice's cubes.
    #[cfg_attr(feature = "wire", serde(skip_serializing_if = "Option::is_none", default))]
    pub lattice_pitch_mm: Option<f64>,
    /// Version of the kernel that made it.
    pub kernel_version: String,
    /// `sha256:` and the digest of the canonical job document; filled in by the service or the command.
    pub input_digest: String,
    /// Digests of the files, by format; filled in after writing.
    pub output_digests: std::collections::BTreeMap<String, String>,
    /// What the user should know, in words.
    pub warnings: Vec<String>,
}

impl<T> Default for Checked<T> {
    fn default() -> Self {
        Self::NotChecked
    }
}

#[cfg(feature = "wire")]
mod wire {
    use super::{Checked, SelfIntersections};
    use serde::de::Error as _;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, OneOfBuilder, Type};
    use utoipa::openapi::{RefOr, Schema};

    const NOT_CHECKED: &str = "not_checked";

    fn words(words: &[&str]) -> ObjectBuilder {
        ObjectBuilder::new().schema_type(Type::String).enum_values(Some(words.to_vec()))
    }

    fn array_of(items: impl Into<RefOr<Schema>>, length: usize) -> ArrayBuilder {
        ArrayBuilder::new().items(items.into()).min_items(Some(length)).max_items(Some(length))
    }

    fn interval() -> ArrayBuilder {
        array_of(ObjectBuilder::new().schema_type(Type::Number), 2)
    }

    pub(super) fn interval_schema() -> RefOr<Schema> {
        interval().into()
    }

    pub(super) fn box_schema() -> RefOr<Schema> {
        array_of(array_of(interval(), 3), 2).into()
    }

    pub(super) fn count_schema() -> RefOr<Schema> {
        OneOfBuilder::new()
            .item(words(&["none", NOT_CHECKED]))
            .item(ObjectBuilder::new().schema_type(Type::Integer).minimum(Some(1.0)))
            .into()
    }

    pub(super) fn flag_schema() -> RefOr<Schema> {
        OneOfBuilder::new().item(words(&[NOT_CHECKED])).item(ObjectBuilder::new().schema_type(Type::Boolean)).into()
    }

    impl Serialize for Checked<bool> {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            match self {
                Self::NotChecked => serializer.serialize_str(NOT_CHECKED),
                Self::Found(verdict) => serializer.serialize_bool(*verdict),
            }
        }
    }

    impl Serialize for Checked<SelfIntersections> {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            match self {
                Self::NotChecked => serializer.serialize_str(NOT_CHECKED),
                Self::Found(SelfIntersections::None) => serializer.serialize_str("none"),
                Self::Found(SelfIntersections::Count(count)) => serializer.serialize_u64(*count),
            }
        }
    }

    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Scalar {
        Flag(bool),
        Count(u64),
        Word(String),
    }

    impl<'de> Deserialize<'de> for Checked<bool> {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            match Scalar::deserialize(deserializer)? {
                Scalar::Flag(verdict) => Ok(Self::Found(verdict)),
                Scalar::Word(word) if word == NOT_CHECKED => Ok(Self::NotChecked),
                _ => Err(D::Error::custom("expected true, false or \"not_checked\"")),
            }
        }
    }

    impl<'de> Deserialize<'de> for Checked<SelfIntersections> {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            match Scalar::deserialize(deserializer)? {
                Scalar::Count(count) => Ok(Self::Found(SelfIntersections::Count(count))),
                Scalar::Word(word) if word == "none" => Ok(Self::Found(SelfIntersections::None)),
                Scalar::Word(word) if word == NOT_CHECKED => Ok(Self::NotChecked),
                _ => Err(D::Error::custom("expected \"none\", a count or \"not_checked\"")),
            }
        }
    }
}
