//! Writes models and jobs as canonical documents: one text for one model, to be hashed and read again.
//!
//! Canonical means: no unit (mm), maps as `linear` and `translation`, members in the grammar's order,
//! defaults left out, parameters in their own order, every number the shortest that reads back to the
//! same double, and no negative zero.

use std::io::{self, Write};

use super::join::SIDES;
use glam::{DMat3, DVec2, DVec3, DVec4};
use lacuna_fabrication::job::{Input, Job, With};
use lacuna_kernel::budget::Limits;
use lacuna_kernel::model::{
    Adjacency, AffineMap, Bcifs, BcifsState, BezierCurve, Border, BorderPath, BoundaryRule, CellKind, Coefficients, ControlNet, Corner,
    CornerCutting, Crease, Curve, CurveScheme, Entry, Glue, Group, Ifs, Incidence, Interior, Join, Matrix, Model, Parametrization, Part,
    PartRadius, PolygonMesh, Primitive, Relation, RootCell, Shape, Side, Subdivision, Sum, TensorProduct, Terrain, TerrainBase, Trim,
    TrimCurve,
};
use serde::ser::{Serialize, SerializeMap, SerializeSeq, Serializer};

/// The canonical document of a model: `read_model` gives the same model back.
///
/// A number that is not finite has no place in a document; it is written as a string, which no
/// document may have there, so that reading refuses it.
#[must_use]
pub fn write_model(model: &Model) -> String {
    text(&Wire(model), false)
}

/// The canonical document of a model, indented for people.
#[must_use]
pub fn write_model_indented(model: &Model) -> String {
    text(&Wire(model), true)
}

/// The canonical document of a model as a value, to stand in another one.
#[must_use]
pub fn model_value(model: &Model) -> impl Serialize + '_ {
    Wire(model)
}

/// The canonical document of a job, models in full and limits complete: what `input_digest` hashes.
#[must_use]
pub fn write_job(job: &Job) -> String {
    write_order(job, &[])
}

/// The canonical document of a job under other limits than its own, written piece by piece: for digests of jobs whose
/// meshes are large.
///
/// # Errors
/// When the sink fails.
pub fn write_job_to(job: &Job, limits: &Limits, sink: &mut impl Write) -> io::Result<()> {
    Ok(serde_json::to_writer(sink, &Order { job, references: &[], limits })?)
}

/// The document of a job in which an input that has a reference is written as its `model_ref` instead of its model.
#[must_use]
pub fn write_order(job: &Job, references: &[Option<String>]) -> String {
    text(&Order { job, references, limits: &job.limits }, false)
}

/// A job with references.
struct Order<'m> {
    job: &'m Job,
    references: &'m [Option<String>],
    limits: &'m Limits,
}

/// An input, and its reference if it has one.
struct Referred<'m>(&'m Input, Option<&'m String>);

impl Serialize for Order<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { job, references, limits } = self;
        let reference = |index: usize| references.get(index).and_then(Option::as_ref);
        let inputs: Vec<Referred<'_>> = job.inputs.iter().enumerate().map(|(index, input)| Referred(input, reference(index))).collect();
        let mut map = Members(serializer.serialize_map(None)?);
        map.put("lacuna", &1)?
            .put("kind", &job.kind)?
            .put("inputs", &inputs)?
            .put("params", &Wire(&job.params))?
            .put("outputs", &job.outputs)?
            .put("limits", &Wire(*limits))?;
        map.0.end()
    }
}

impl Serialize for Referred<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self(input, Some(reference)) = self else { return Wire(self.0).serialize(serializer) };
        let mut map = Members(serializer.serialize_map(None)?);
        map.put("name", &input.name)?.put("model_ref", reference)?.put_some("radius_mm", input.radius_mm.map(Number).as_ref())?;
        map.0.end()
    }
}

fn text(document: &impl Serialize, indented: bool) -> String {
    let text = if indented { serde_json::to_string_pretty(document) } else { serde_json::to_string(document) };
    // why: writing to memory fails only for keys that are not strings, and all keys here are literals or names
    text.expect("a document has string keys")
}

/// A kernel type on its way out: the kernel itself knows no JSON.
struct Wire<'m, T: ?Sized>(&'m T);

/// Numbers, all of them written by this type.
struct Number(f64);

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        // why: adding zero turns -0 into 0 and changes nothing else
        if self.0.is_finite() { serializer.serialize_f64(self.0 + 0.0) } else { serializer.serialize_str(&self.0.to_string()) }
    }
}

/// A sharpness: a number, or for ever.
struct Sharpness(f64);

impl Serialize for Sharpness {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0 == f64::INFINITY { serializer.serialize_str("infinite") } else { Number(self.0).serialize(serializer) }
    }
}

/// A list of things that can be written.
fn list<'m, T>(items: &'m [T]) -> Vec<Wire<'m, T>> {
    items.iter().map(Wire).collect()
}

/// Writes an object member by member, leaving out what is absent.
struct Members<M>(M);

impl<M: SerializeMap> Members<M> {
    fn put(&mut self, name: &'static str, value: &impl Serialize) -> Result<&mut Self, M::Error> {
        self.0.serialize_entry(name, value)?;
        Ok(self)
    }

    fn put_if(&mut self, present: bool, name: &'static str, value: &impl Serialize) -> Result<&mut Self, M::Error> {
        if present { self.put(name, value) } else { Ok(self) }
    }

    fn put_radius(&mut self, radius: Option<&PartRadius>) -> Result<&mut Self, M::Error> {
        match radius {
            None => Ok(self),
            Some(PartRadius::Constant(radius)) => self.put("radius_mm", &Number(*radius)),
            Some(PartRadius::AtPoints(radii)) => self.put("radii_mm", &radii.iter().copied().map(Number).collect::<Vec<_>>()),
            Some(levels @ PartRadius::ByLevel { .. }) => self.put("radius_by_level", &Wire(levels)),
        }
    }

    fn put_some(&mut self, name: &'static str, value: Option<&impl Serialize>) -> Result<&mut Self, M::Error> {
        match value {
            Some(value) => self.put(name, value),
            None => Ok(self),
        }
    }
}

impl<M: SerializeMap> Members<M> {
    /// The members of a curve scheme in the grammar's order, the points among them where there are any.
    fn scheme(&mut self, scheme: &CurveScheme, net: Option<&ControlNet>) -> Result<&mut Self, M::Error> {
        let family = match scheme {
            CurveScheme::Bezier => "bezier_curve",
            CurveScheme::Nurbs { .. } => "nurbs_curve",
            CurveScheme::CornerCutting { .. } => "corner_cutting",
            CurveScheme::CatmullRom { .. } => "catmull_rom",
            CurveScheme::BetaSpline { .. } => "beta_spline",
            CurveScheme::FourPoint { .. } => "four_point",
            CurveScheme::Interpolation { .. } | CurveScheme::AffineInterpolation { .. } => "interpolation",
            CurveScheme::Bcifs { .. } => "bcifs",
            CurveScheme::Ifs { .. } => "ifs",
        };
        self.put("family", &family)?;
        if let CurveScheme::Nurbs { degree, knots } = scheme {
            self.put("degree", degree)?.put("knots", &numbers(knots))?;
        }
        let name = if family == "interpolation" { "points" } else { "control_points" };
        self.put_some(name, net.map(points_of).as_ref())?;
        match scheme {
            CurveScheme::Bezier | CurveScheme::Nurbs { .. } => Ok(self),
            CurveScheme::CornerCutting { a, b, closed } => {
                self.put("a", &Number(*a))?.put("b", &Number(*b))?.put_if(*closed, "closed", &true)
            }
            CurveScheme::CatmullRom { parametrization, closed } => {
                let word = match parametrization {
                    Parametrization::Uniform => None,
                    Parametrization::Centripetal => Some(&"centripetal"),
                    Parametrization::Chordal => Some(&"chordal"),
                };
                self.put_some("parametrization", word)?.put_if(*closed, "closed", &true)
            }
            CurveScheme::BetaSpline { beta1, beta2, closed } => {
                self.put("beta1", &Number(*beta1))?.put("beta2", &Number(*beta2))?.put_if(*closed, "closed", &true)
            }
            CurveScheme::FourPoint { tension, closed } => self.put("w", &Number(*tension))?.put_if(*closed, "closed", &true),
            CurveScheme::Interpolation { vertical_scaling } => self.put("vertical_scaling", &numbers(vertical_scaling)),
            CurveScheme::AffineInterpolation { maps } | CurveScheme::Ifs { maps } => self.put("maps", &list(maps)),
            CurveScheme::Bcifs { states, start } => self.put("states", &list(states))?.put("start", start),
        }
    }

    fn weights(&mut self, net: &ControlNet) -> Result<&mut Self, M::Error> {
        let nested = net.weights.as_ref().map(|weights| Nested { size: &net.size, items: numbers(weights) });
        self.put_some("weights", nested.as_ref())
    }
}

fn numbers(values: &[f64]) -> Vec<Number> {
    values.iter().map(|&value| Number(value)).collect()
}

/// The points of a net as nested lists.
fn points_of(net: &ControlNet) -> Nested<'_, Wire<'_, DVec3>> {
    Nested { size: &net.size, items: list(&net.points) }
}

/// A list, or a list of lists and so on: as many levels as sizes, the last index fastest.
struct Nested<'m, T> {
    size: &'m [usize],
    items: Vec<T>,
}

impl<T: Serialize> Serialize for Nested<'_, T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Level { size: self.size, items: &self.items }.serialize(serializer)
    }
}

struct Level<'m, T> {
    size: &'m [usize],
    items: &'m [T],
}

impl<T: Serialize> Serialize for Level<'_, T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Some((_, inner)) = self.size.split_first().filter(|(_, inner)| !inner.is_empty()) else {
            return serializer.collect_seq(self.items);
        };
        let each = inner.iter().product::<usize>().max(1);
        serializer.collect_seq(self.items.chunks(each).map(|items| Level { size: inner, items }))
    }
}

macro_rules! object {
    ($($kind:ty: |$value:ident, $members:ident| $body:expr;)+) => {$(
        impl Serialize for Wire<'_, $kind> {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                let $value = self.0;
                let mut map = Members(serializer.serialize_map(None)?);
                let $members = &mut map;
                $body;
                map.0.end()
            }
        }
    )+};
}

object! {
    Model: |model, members| members
        .put("lacuna", &1)?
        .put_some("name", model.name.as_ref())?
        .put("shape", &Wire(&model.shape))?;
    Part: |part, members| members
        .put_some("name", part.name.as_ref())?
        .put_some("transform", part.transform.as_ref().map(Wire).as_ref())?
        .put_radius(part.radius.as_ref())?
        .put("shape", &Wire(&part.shape))?;
    PartRadius: |radius, members| match radius {
        PartRadius::ByLevel { first, ratio, least } => {
            members.put("first_mm", &Number(*first))?.put("ratio", &Number(*ratio))?.put("least_mm", &Number(*least))?
        }
        other => members.put_radius(Some(other))?,
    };
    AffineMap: |map, members| members.put("linear", &Wire(&map.linear))?.put("translation", &Wire(&map.translation))?;
    Primitive: |primitive, members| match primitive {
        Primitive::Points(points) => members.put("points", &list(points))?,
        Primitive::Polyline { points, closed } => members.put("polyline", &list(points))?.put_if(*closed, "closed", closed)?,
        Primitive::Mesh { vertices, faces } => members.put("mesh", &MeshData { vertices, faces })?,
        Primitive::Solid { vertices, faces } => members.put("solid", &MeshData { vertices, faces })?,
    };
    BcifsState: |state, members| members
        .put("name", &state.name)?
        .put("cell", match state.cell {
            CellKind::Vertex => &"vertex",
            CellKind::Edge => &"edge",
            CellKind::Face => &"face",
            CellKind::Volume => &"volume",
        })?
        .put("dimension", &state.dimension)?
        .put("transitions", &list(&state.transitions))?
        .put_if(!state.boundaries.is_empty(), "boundaries", &list(&state.boundaries))?;
    lacuna_kernel::model::TransitionSpec: |transition, members| members
        .put("to", &transition.to)?
        .put("operator", &Wire(&transition.operator))?;
    lacuna_kernel::model::BoundarySpec: |boundary, members| members
        .put("state", &boundary.state)?
        .put("incidence", &Wire(&boundary.incidence))?;
    Incidence: |incidence, members| members
        .put("state", &incidence.state)?
        .put("boundary", &incidence.boundary)?
        .put("children", &incidence.children)?;
    Adjacency: |adjacency, members| members
        .put("state", &adjacency.state)?
        .put("between", &adjacency.between)?
        .put_if(adjacency.reversed, "reversed", &true)?
        .put_some("permutation", adjacency.permutation.as_ref())?;
    Relation: |relation, members| members.put("state", &relation.state)?.put("equal", &list(&relation.equal))?;
    Side: |side, members| members
        .put_if(!side.path.is_empty(), "path", &side.path)?
        .put_if(!side.boundary.is_empty(), "boundary", &side.boundary)?;
    RootCell: |cell, members| members.put("state", &cell.state)?.put("control_points", &PlacedPoints(&cell.control_points))?;
    Glue: |glue, members| members
        .put("between", &glue.between)?
        .put_if(glue.reversed, "reversed", &true)?
        .put_some("permutation", glue.permutation.as_ref())?;
    Input: |input, members| members
        .put("name", &input.name)?
        .put("model", &Wire(&input.model))?
        .put_some("radius_mm", input.radius_mm.map(Number).as_ref())?;
    lacuna_fabrication::job::Params: |params, members| members
        .put_if(params.level.is_none() || params.tolerance_mm > 0.0, "tolerance_mm", &Number(params.tolerance_mm))?
        .put_if(params.preview, "preview", &true)?
        .put_some("level", params.level.as_ref())?
        .put_if(params.repair, "repair", &true)?
        .put_some("radius_mm", params.radius_mm.map(Number).as_ref())?
        .put_some("closing_mm", params.closing_mm.map(Number).as_ref())?
        .put_some("wall_mm", params.wall.map(|wall| Number(wall.thickness_mm)).as_ref())?
        .put_some("side", params.wall.map(|wall| wall.side).as_ref())?
        .put_some("operation", params.operation.as_ref())?
        .put_some("with", params.with.as_ref().map(Wire).as_ref())?
        .put_some("plane", params.plane.map(|plane| plane.normal.extend(plane.offset_mm).to_array().map(Number)).as_ref())?
        .put_some("volume_mm", params.split.as_ref().and_then(|split| split.volume_mm).map(|volume| volume.map(Number)).as_ref())?
        .put_some("cuts_mm", params.split.as_ref().filter(|split| split.cuts_mm.iter().any(|cuts| !cuts.is_empty())).map(|split| split.cuts_mm.each_ref().map(|cuts| cuts.iter().copied().map(Number).collect::<Vec<_>>())).as_ref())?
        .put_some("key_mm", params.split.as_ref().and_then(|split| split.key).map(|key| Number(key.width_mm)).as_ref())?
        .put_some("clearance_mm", params.split.as_ref().and_then(|split| split.key).map(|key| Number(key.clearance_mm)).as_ref())?
        .put_some("normal", params.planes.as_ref().map(|planes| planes.normal.to_array().map(Number)).as_ref())?
        .put_some("offsets_mm", params.planes.as_ref().filter(|planes| planes.step_mm.is_none()).map(|planes| planes.offsets_mm.iter().copied().map(Number).collect::<Vec<_>>()).as_ref())?
        .put_some("step_mm", params.planes.as_ref().and_then(|planes| planes.step_mm).map(Number).as_ref())?
        .put_some("direction", params.direction.map(|direction| direction.to_array().map(Number)).as_ref())?
        .put_if(params.oriented_box, "oriented_box", &true)?
        .put_if(params.thickness, "thickness", &true)?
        .put_some("density_g_cm3", params.density_g_cm3.map(Number).as_ref())?
        .put_if(params.normals, "normals", &true)?
        .put_if(!params.simplify, "simplify", &false)?
        .put_if(params.stability, "stability", &true)?;
    Limits: |limits, members| members
        .put("seconds", &Number(limits.seconds))?
        .put("triangles", &limits.triangles)?
        .put("cells", &limits.cells)?
        .put("memory_bytes", &limits.memory_bytes)?
        .put("depth", &limits.depth)?
        // Where it is the usual one, documents, and so their digests, are as they were before there was this limit.
        .put_if(limits.output_bytes != Limits::default().output_bytes, "output_bytes", &limits.output_bytes)?;
    Ifs: |ifs, members| members
        .put("family", &"ifs")?
        .put("maps", &list(&ifs.maps))?
        .put_some("primitive", ifs.primitive.as_ref().map(Wire).as_ref())?
        .put_some("graph", ifs.graph.as_ref())?;
    Bcifs: |bcifs, members| members
        .put("family", &"bcifs")?
        .put("states", &list(&bcifs.states))?
        .put_if(!bcifs.incidences.is_empty(), "incidences", &list(&bcifs.incidences))?
        .put_if(!bcifs.adjacencies.is_empty(), "adjacencies", &list(&bcifs.adjacencies))?
        .put_if(!bcifs.relations.is_empty(), "relations", &list(&bcifs.relations))?
        .put("cells", &list(&bcifs.cells))?
        .put_if(!bcifs.glue.is_empty(), "glue", &list(&bcifs.glue))?
        .put_if(!bcifs.parameters.is_empty(), "parameters", &Parameters(&bcifs.parameters))?;
    BezierCurve: |curve, members| members
        .put("family", &"bezier_curve")?
        .put("control_points", &list(&curve.control_points))?
        .put_some("weights", curve.weights.as_ref().map(|weights| weights.iter().map(|weight| Number(*weight)).collect::<Vec<_>>()).as_ref())?;
    CornerCutting: |curve, members| members
        .put("family", &"corner_cutting")?
        .put("control_points", &list(&curve.control_points))?
        .put("a", &Number(curve.a))?
        .put("b", &Number(curve.b))?
        .put_if(curve.closed, "closed", &true)?;
    Subdivision: |surface, members| members
        .put("family", &"subdivision")?
        .put("scheme", &surface.scheme.name())?
        .put("mesh", &MeshData { vertices: &surface.vertices, faces: &surface.faces })?
        .put_if(!surface.creases.is_empty(), "creases", &list(&surface.creases))?
        .put_if(!surface.corners.is_empty(), "corners", &list(&surface.corners))?
        .put_if(surface.boundary == BoundaryRule::SharpCorners, "boundary", &"sharp_corners")?
        .put_if(!surface.coefficients.is_empty(), "coefficients", &list(&surface.coefficients))?;
    Crease: |crease, members| members.put("edge", &crease.edge)?.put("sharpness", &Sharpness(crease.sharpness))?;
    Corner: |corner, members| members.put("vertex", &corner.vertex)?.put("sharpness", &Sharpness(corner.sharpness))?;
    Coefficients: |own, members| members
        .put_some("faces", own.faces.as_ref())?
        .put("weights", &own.weights.iter().map(|list| list.iter().map(|weight| Number(*weight)).collect::<Vec<_>>()).collect::<Vec<_>>())?;
    Curve: |curve, members| {
        members.scheme(&curve.scheme, Some(&curve.control_points))?;
        members.weights(&curve.control_points)?
    };
    TensorProduct: |product, members| {
        match product.schemes.as_slice() {
            schemes if product.separate => {
                members.put("family", &"tensor")?;
                for (name, scheme) in ["u", "v", "w"].into_iter().zip(schemes) {
                    members.put(name, &Wire(scheme))?;
                }
            }
            [CurveScheme::Bezier, ..] => {
                members.put("family", &"bezier_surface")?;
            }
            schemes => {
                let nurbs = |scheme: &CurveScheme| match scheme {
                    CurveScheme::Nurbs { degree, knots } => Some((*degree, numbers(knots))),
                    _ => None,
                };
                let (degrees, knots): (Vec<usize>, Vec<Vec<Number>>) = schemes.iter().filter_map(nurbs).unzip();
                let family = if schemes.len() == 2 { "nurbs_surface" } else { "nurbs_volume" };
                members.put("family", &family)?.put("degree", &degrees)?.put("knots", &knots)?;
            }
        }
        members
            .put("control_points", &points_of(&product.control_points))?
            .weights(&product.control_points)?
            .put_some("trim", product.trim.as_ref().map(Wire).as_ref())?
    };
    Trim: |trim, members| members
        .put_some("outer", trim.outer.as_ref().map(|curves| list(curves)).as_ref())?
        .put_if(!trim.inner.is_empty(), "inner", &trim.inner.iter().map(|curves| list(curves)).collect::<Vec<_>>())?;
    TrimCurve: |curve, members| match curve {
        TrimCurve::Polyline(points) => members.put("family", &"polyline")?.put("points", &list(points))?,
        TrimCurve::Spline { scheme, control_points, weights } => members
            .scheme(scheme, None)?
            .put("control_points", &list(control_points))?
            .put_some("weights", weights.as_ref().map(|weights| numbers(weights)).as_ref())?,
    };
    Sum: |sum, members| members.put("family", &"sum")?.put("u", &Wire(&sum.u))?.put("v", &Wire(&sum.v))?;
    CurveScheme: |scheme, members| members.scheme(scheme, None)?;
    PolygonMesh: |mesh, members| members
        .put("family", &"mesh")?
        .put("vertices", &list(&mesh.vertices))?
        .put("faces", &mesh.faces)?
        .put_some("interior", match mesh.interior {
            Interior::Auto => None,
            Interior::Solid => Some(&"solid"),
            Interior::Surface => Some(&"surface"),
        })?;
    Terrain: |terrain, members| {
        members.put("family", &"terrain")?;
        match &terrain.base {
            TerrainBase::Triangle(corners) => members.put("triangle", &list(corners))?,
            TerrainBase::Grid(rows) => members.put("grid", &rows.iter().map(|row| list(row)).collect::<Vec<_>>())?,
        };
        members
            .put("roughness", &Number(terrain.roughness))?
            .put("levels", &terrain.levels)?
            .put_if(terrain.random_seed != 0, "random_seed", &terrain.random_seed)?
    };
    Group: |group, members| members
        .put("family", &"group")?
        .put("parts", &list(&group.parts))?
        .put_if(!group.joins.is_empty(), "joins", &list(&group.joins))?;
    Join: |join, members| members.put("between", &list(&join.between))?.put_if(join.strip, "strip", &true)?;
    Border: |border, members| {
        members.put("part", &border.part)?;
        match &border.path {
            BorderPath::Side { direction, last } => {
                let side = SIDES.iter().find(|(_, side)| *side == (*direction, *last));
                members.put_some("side", side.map(|(name, _)| name))?
            }
            BorderPath::Vertices(vertices) => members.put("vertices", vertices)?,
            BorderPath::Boundaries(boundaries) => members.put("boundaries", boundaries)?,
        }
    };
}

impl Serialize for Wire<'_, Shape> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Shape::Ifs(ifs) => Wire(ifs).serialize(serializer),
            Shape::Bcifs(bcifs) => Wire(bcifs).serialize(serializer),
            Shape::BezierCurve(curve) => Wire(curve).serialize(serializer),
            Shape::CornerCutting(curve) => Wire(curve).serialize(serializer),
            Shape::Subdivision(surface) => Wire(surface).serialize(serializer),
            Shape::Curve(curve) => Wire(curve).serialize(serializer),
            Shape::TensorProduct(product) => Wire(product).serialize(serializer),
            Shape::Sum(sum) => Wire(sum).serialize(serializer),
            Shape::Mesh(mesh) => Wire(mesh).serialize(serializer),
            Shape::Terrain(terrain) => Wire(terrain).serialize(serializer),
            Shape::Group(group) => Wire(group).serialize(serializer),
        }
    }
}

/// Vertices and faces of a primitive or of a control mesh.
struct MeshData<'m> {
    vertices: &'m [DVec3],
    faces: &'m [Vec<u32>],
}

impl Serialize for MeshData<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = Members(serializer.serialize_map(Some(2))?);
        map.put("vertices", &list(self.vertices))?.put("faces", &self.faces)?;
        map.0.end()
    }
}

/// Control points of a root cell; null for one that is to be placed.
struct PlacedPoints<'m>(&'m [Option<DVec4>]);

impl Serialize for PlacedPoints<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.iter().map(|point| point.as_ref().map(Wire)))
    }
}

/// Named values in their own order.
struct Parameters<'m>(&'m [(String, f64)]);

impl Serialize for Parameters<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, Number(*value))))
    }
}

impl Serialize for Wire<'_, DVec2> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.to_array().map(Number))
    }
}

impl Serialize for Wire<'_, DVec3> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.to_array().map(Number))
    }
}

/// A control point; the weight only when it is not 1.
impl Serialize for Wire<'_, DVec4> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let [x, y, z, w] = self.0.to_array();
        if w == 1.0 { serializer.collect_seq([x, y, z].map(Number)) } else { serializer.collect_seq([x, y, z, w].map(Number)) }
    }
}

impl Serialize for Wire<'_, DMat3> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.transpose().to_cols_array_2d().map(|row| row.map(Number)))
    }
}

impl Serialize for Wire<'_, Matrix> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut rows = serializer.serialize_seq(Some(self.0.rows.len()))?;
        for row in &self.0.rows {
            rows.serialize_element(&list(row))?;
        }
        rows.end()
    }
}

impl Serialize for Wire<'_, Entry> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Entry::Number(number) => Number(*number).serialize(serializer),
            Entry::Unknown => serializer.serialize_unit(),
            Entry::Parameter(name) => serializer.serialize_str(name),
        }
    }
}

impl Serialize for Wire<'_, With> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut members = serializer.serialize_map(Some(1))?;
        match self.0 {
            With::Itself => members.serialize_entry(super::with::ITSELF, &true)?,
            With::Primitive(primitive) => {
                let (word, numbers) = super::with::numbers(primitive);
                members.serialize_entry(word, &numbers.into_iter().map(Number).collect::<Vec<_>>())?;
            }
        }
        members.end()
    }
}
