//! The members of every object of the grammar, once: the reader takes the names from here, the JSON
//! Schema its properties and descriptions, so that the two cannot disagree on a name.

mod orders;

pub use orders::MOST_JOBS;
pub(super) use orders::{
    ADDRESS_QUESTION, BATCH, BATCH_ENTRY, JOB, JOB_INPUT, JOB_LIMITS, JOB_PARAMS, LATER_KINDS, MOST_LEVEL, OPERATIONS, SOLVE, WALL_SIDES,
    WITH,
};
use serde_json::{Value, json};

use super::join::SIDES;

/// A kind of object.
pub(super) struct Object {
    /// What messages and schemas call it.
    pub(super) title: &'static str,
    /// What it is, for people.
    pub(super) about: &'static str,
    /// Its members.
    pub(super) members: &'static [Member],
}

/// A member of a kind of object.
#[derive(Clone, Copy)]
pub(super) struct Member {
    pub(super) name: &'static str,
    pub(super) required: bool,
    /// What it is, for people: in the schema, and in the message when it is missing.
    pub(super) about: &'static str,
    /// The schema of its value.
    pub(super) schema: fn() -> Value,
}

const fn required(name: &'static str, about: &'static str, schema: fn() -> Value) -> Member {
    Member { name, required: true, about, schema }
}

const fn optional(name: &'static str, about: &'static str, schema: fn() -> Value) -> Member {
    Member { name, required: false, about, schema }
}

/// A reference to another schema by its bare name; [`super::schema`] adds where schemas live.
pub(super) fn reference(name: &str) -> Value {
    json!({ "$ref": name })
}

fn number() -> Value {
    json!({ "type": "number" })
}

fn positive() -> Value {
    json!({ "type": "number", "exclusiveMinimum": 0 })
}

fn count() -> Value {
    json!({ "type": "integer", "minimum": 1 })
}

fn index() -> Value {
    json!({ "type": "integer", "minimum": 0 })
}

fn flag() -> Value {
    json!({ "type": "boolean", "default": false })
}

fn text() -> Value {
    json!({ "type": "string", "minLength": 1, "maxLength": 256, "pattern": "^[^\\u0000-\\u001f\\u007f-\\u009f]*$" })
}

fn file_name() -> Value {
    json!({ "type": "string", "minLength": 1, "maxLength": 256, "pattern": "^[^\\u0000-\\u001f\\u007f-\\u009f\\\\:]*$" })
}

fn list(items: Value, least: usize) -> Value {
    json!({ "type": "array", "items": items, "minItems": least })
}

fn tuple(items: Value, length: usize) -> Value {
    json!({ "type": "array", "items": items, "minItems": length, "maxItems": length })
}

fn vector() -> Value {
    tuple(number(), 3)
}

fn points(least: usize) -> Value {
    list(vector(), least)
}

fn rational_points(least: usize) -> Value {
    list(reference("ControlPoint"), least)
}

/// Control points of a root cell, some of them to be placed.
fn placed_points() -> Value {
    list(json!({ "anyOf": [reference("ControlPoint"), { "type": "null" }] }), 1)
}

fn permutation() -> Value {
    json!({ "type": "array", "items": index(), "minItems": 1, "uniqueItems": true })
}

fn path() -> Value {
    json!({ "type": "array", "items": index(), "maxItems": 64 })
}

fn faces(least: usize) -> Value {
    list(list(index(), 1), least)
}

fn index_pair() -> Value {
    tuple(index(), 2)
}

fn one_of_words(words: &[&str]) -> Value {
    json!({ "type": "string", "enum": words })
}

fn version() -> Value {
    json!({ "type": "integer", "const": 1 })
}

/// A point in space with an optional weight, as a schema without members.
pub(super) fn control_point_schema() -> Value {
    json!({
        "description": "A point [x, y, z], or [x, y, z, w] with a positive weight w (1 when absent). The coordinates are those of the point, not multiplied by w.",
        "type": "array", "items": number(), "minItems": 3, "maxItems": 4
    })
}

/// A matrix, as a schema without members.
pub(super) fn matrix_schema() -> Value {
    json!({
        "description": "An array of rows of one length. An entry is a number, null (unknown, to be solved) or the name of one of the model's parameters.",
        "type": "array", "minItems": 1,
        "items": { "type": "array", "minItems": 1, "items": { "type": ["number", "null", "string"] } }
    })
}

macro_rules! family {
    ($word:literal) => {
        required("family", "The family of the shape.", || json!({ "type": "string", "const": $word }))
    };
}

pub(super) const MODEL: Object = Object {
    title: "a model",
    about: "A shape with its unit. Lengths without a unit are mm.",
    members: &[
        required("lacuna", "The version of the grammar: 1.", version),
        optional("name", "What the author calls the model.", text),
        optional(
            "units",
            "The unit of every length of the model; converted to mm on reading. Weights, linear parts and operators have no unit.",
            || json!({ "type": "string", "enum": ["um", "mm", "cm", "m", "in"], "default": "mm" }),
        ),
        required("shape", "The shape, of one of the families.", || reference("Shape")),
    ],
};

/// A model inside a job, whose version is the job's.
pub(super) const EMBEDDED_MODEL: Object = Object {
    title: "a model",
    about: "A model inside a job: as a model on its own, but the version may be left to the job.",
    members: &[Member { required: false, ..MODEL.members[0] }, MODEL.members[1], MODEL.members[2], MODEL.members[3]],
};

pub(super) const LINEAR_MAP: Object = Object {
    title: "an affine map",
    about: "The map x -> A x + t.",
    members: &[
        required("linear", "A, three rows of three numbers.", || tuple(vector(), 3)),
        optional("translation", "t, a length; the origin when absent.", vector),
    ],
};

pub(super) const TURNED_MAP: Object = Object {
    title: "an affine map",
    about: "The map x -> R S x + t: scaled along x, y and z, then turned about an axis through the origin, then moved.",
    members: &[
        optional(
            "scale",
            "One factor, or one for each of x, y and z; 1 when absent. Zero and negative factors are legal.",
            || json!({ "anyOf": [number(), vector()], "default": 1 }),
        ),
        optional("axis", "Direction of the axis of rotation, of any length above zero; z when absent.", vector),
        optional("angle_deg", "Angle of the rotation in degrees, counter-clockwise seen from the axis's tip; 0 when absent.", number),
        optional("translation", "t, a length; the origin when absent.", vector),
    ],
};

/// `linear` as a member that may be absent: known wherever a map is read.
pub(super) const LINEAR_IF_ANY: &[Member] = &[Member { required: false, ..LINEAR_MAP.members[0] }];

/// The members of [`TURNED_MAP`] that exclude `linear`.
pub(super) const TURNS: &[Member] = &[TURNED_MAP.members[0], TURNED_MAP.members[1], TURNED_MAP.members[2]];

pub(super) const IFS: Object = Object {
    title: "an ifs",
    about: "An iterated function system: the compact set A with A = union of T_i A, for affine maps T_i of space.",
    members: &[
        family!("ifs"),
        required("maps", "The maps T_i.", || list(reference("AffineMap"), 1)),
        optional("primitive", "The compact drawn at the leaves; a point of each leaf cell when absent.", || reference("Primitive")),
        optional(
            "graph",
            "Which maps may follow which in an address: one list of indices of maps per map, or a square matrix of booleans. All may follow all when absent.",
            || {
                json!({ "anyOf": [
                    list(json!({ "type": "array", "items": index(), "uniqueItems": true }), 1),
                    list(list(json!({ "type": "boolean" }), 1), 1),
                ] })
            },
        ),
    ],
};

pub(super) const PRIMITIVE: Object = Object {
    title: "a primitive",
    about: "A compact set: exactly one of points, a polyline, a mesh taken as a surface, or a solid.",
    members: &[
        optional("points", "Points.", || points(1)),
        optional("polyline", "The corners of a polyline, in order.", || points(1)),
        optional("closed", "Whether the polyline's last corner is joined to its first; only with `polyline`.", flag),
        optional("mesh", "A polygon mesh, taken as a surface.", || reference("MeshData")),
        optional("solid", "A closed polygon mesh with outward faces, taken with its interior.", || reference("MeshData")),
    ],
};

pub(super) const MESH_DATA: Object = Object {
    title: "a polygon mesh",
    about: "Corner points, and the indices of each face's corners.",
    members: &[
        required("vertices", "The corner points.", || points(1)),
        required("faces", "The corner indices of each face, counter-clockwise seen from outside.", || faces(1)),
    ],
};

pub(super) const BCIFS: Object = Object {
    title: "a bcifs",
    about: "A boundary controlled iterated function system, stated in full: states, operators, boundaries, constraints and root cells.",
    members: &[
        family!("bcifs"),
        required("states", "The kinds of cells.", || list(reference("State"), 1)),
        optional("incidences", "Incidence constraints: how a boundary's subdivision lies in the subdivision.", || {
            list(reference("Incidence"), 0)
        }),
        optional("adjacencies", "Adjacency constraints: boundaries that two children share.", || list(reference("Adjacency"), 0)),
        optional("relations", "Further equations between products of operators and embeddings.", || list(reference("Relation"), 0)),
        required("cells", "The root cells.", || list(reference("RootCell"), 1)),
        optional("glue", "Boundaries of root cells that are one; as objects or as bare pairs.", || {
            list(json!({ "anyOf": [reference("Glue"), tuple(index_pair(), 2)] }), 0)
        }),
        optional(
            "parameters",
            "Named values that entries of matrices may use.",
            || json!({ "type": "object", "additionalProperties": number(), "propertyNames": text() }),
        ),
    ],
};

pub(super) const STATE: Object = Object {
    title: "a state",
    about: "A kind of cell.",
    members: &[
        required("name", "The state's name, unique in the model.", text),
        required("cell", "The topological kind of the cell.", || one_of_words(&["vertex", "edge", "face", "volume"])),
        required("dimension", "The number of control points.", count),
        required("transitions", "How the cell subdivides.", || list(reference("Transition"), 0)),
        optional("boundaries", "The cell's boundary cells, in order.", || list(reference("Boundary"), 0)),
    ],
};

pub(super) const TRANSITION: Object = Object {
    title: "a transition",
    about: "A child of a cell.",
    members: &[
        required("to", "Name of the child's state.", text),
        required("operator", "T: its columns are the child's control points in the parent's barycentric space.", || reference("Matrix")),
    ],
};

pub(super) const BOUNDARY: Object = Object {
    title: "a boundary",
    about: "A boundary cell of a cell.",
    members: &[
        required("state", "Name of the boundary's state.", text),
        required("incidence", "Its columns are the boundary's control points in the cell's barycentric space.", || reference("Matrix")),
    ],
};

pub(super) const INCIDENCE: Object = Object {
    title: "an incidence",
    about: "The j-th child of boundary `boundary` is boundary m of child i, with [i, m] = children[j].",
    members: &[
        required("state", "Name of the state.", text),
        required("boundary", "Index of the boundary.", index),
        required("children", "Pairs [child, boundary of that child].", || list(index_pair(), 0)),
    ],
};

const PERMUTATION: &str = "The order in which the second's control points are taken: the k-th of the first is number permutation[k] of the second. Excludes reversed.";

pub(super) const ADJACENCY: Object = Object {
    title: "an adjacency",
    about: "Two children share a boundary.",
    members: &[
        required("state", "Name of the state.", text),
        required("between", "Two pairs [child, boundary of that child].", || tuple(index_pair(), 2)),
        optional("reversed", "Whether the second is seen from its other end.", flag),
        optional("permutation", PERMUTATION, permutation),
    ],
};

pub(super) const RELATION: Object = Object {
    title: "a relation",
    about: "Two products of a state's operators and embeddings that are equal.",
    members: &[required("state", "Name of the state.", text), required("equal", "The two products.", || tuple(reference("Side"), 2))],
};

pub(super) const SIDE: Object = Object {
    title: "a side of a relation",
    about: "The product T_i T_j ... b_m b_p ...: a child, a child of that child and so on, then a boundary of the last, a boundary of that boundary and so on.",
    members: &[
        optional("path", "Children i, j, ...; none when absent.", path),
        optional("boundary", "Boundaries m, p, ...; none when absent.", path),
    ],
};

pub(super) const ROOT_CELL: Object = Object {
    title: "a root cell",
    about: "A cell that the shape starts from.",
    members: &[
        required("state", "Name of the cell's state.", text),
        required("control_points", "As many points as the state's dimension; null for one that is to be placed.", placed_points),
    ],
};

pub(super) const GLUE: Object = Object {
    title: "a glue",
    about: "Two boundaries of root cells that are one.",
    members: &[
        required("between", "Two pairs [root cell, boundary of its state].", || tuple(index_pair(), 2)),
        optional("reversed", "Whether the second is seen from its other end.", flag),
        optional("permutation", PERMUTATION, permutation),
    ],
};

pub(super) const BEZIER_CURVE: Object = Object {
    title: "a bezier_curve",
    about: "A polynomial or rational Bezier curve; n control points make degree n - 1.",
    members: &[
        family!("bezier_curve"),
        required("control_points", "The control points, in order.", || rational_points(1)),
        optional("weights", "One positive weight per control point, unless the points carry theirs.", || list(positive(), 1)),
    ],
};

pub(super) const CORNER_CUTTING: Object = Object {
    title: "a corner_cutting",
    about: "The limit of the corner-cutting scheme (a, b) on a control polygon; a = b = 1/4 is Chaikin's.",
    members: &[
        family!("corner_cutting"),
        required("control_points", "The control polygon.", || points(3)),
        optional("a", "First parameter; 1/4 when absent.", || json!({ "type": "number", "default": 0.25 })),
        optional("b", "Second parameter; 1/4 when absent.", || json!({ "type": "number", "default": 0.25 })),
        optional("closed", "Whether the polygon is closed.", flag),
    ],
};

fn degree() -> Value {
    json!({ "type": "integer", "minimum": 1, "maximum": 9 })
}

fn degrees(directions: usize) -> Value {
    json!({ "anyOf": [degree(), tuple(degree(), directions)] })
}

fn knots() -> Value {
    list(number(), 4)
}

/// Lists of lists, one level per direction.
fn nested(item: fn() -> Value, directions: usize) -> Value {
    (0..directions).fold(item(), |inner, _| list(inner, 1))
}

fn net_point() -> Value {
    reference("ControlPoint")
}

fn curve_scheme() -> Value {
    reference("CurveScheme")
}

fn curve_shape() -> Value {
    reference("CurveShape")
}

fn factors() -> Value {
    list(json!({ "type": "number", "exclusiveMinimum": -1, "exclusiveMaximum": 1 }), 1)
}

const WEIGHTS: Member =
    optional("weights", "One positive weight per control point, unless the points carry theirs.", || list(positive(), 1));
const POLYGON: Member = required("control_points", "The control polygon.", || points(3));
const CLOSED: Member = optional("closed", "Whether the polygon is closed.", flag);

pub(super) const BEZIER_SCHEME: Object = Object {
    title: "a bezier_curve without control points",
    about: "A Bezier curve of as many points as the net has in this direction.",
    members: &[family!("bezier_curve")],
};

pub(super) const NURBS_SCHEME: Object = Object {
    title: "a nurbs_curve without control points",
    about: "A spline of any degree on any knots.",
    members: &[
        family!("nurbs_curve"),
        required("degree", "The degree d, from 1 to 9.", degree),
        required(
            "knots",
            "The full knot vector: as many as control points, plus d + 1; not decreasing, multiplicities up to d + 1. The curve is defined from knot d to knot n, n being the number of control points.",
            knots,
        ),
    ],
};

pub(super) const NURBS_CURVE: Object = Object {
    title: "a nurbs_curve",
    about: "A polynomial or rational spline of any degree from 1 to 9 on any knots: clamped, periodic, with multiple knots.",
    members: &[
        NURBS_SCHEME.members[0],
        NURBS_SCHEME.members[1],
        NURBS_SCHEME.members[2],
        required("control_points", "The control points, in order.", || rational_points(2)),
        WEIGHTS,
    ],
};

fn parameter() -> Value {
    tuple(number(), 2)
}

fn trim() -> Value {
    reference("Trim")
}

fn trim_loop() -> Value {
    list(reference("TrimCurve"), 1)
}

/// A parameter with an optional weight, as a schema without members.
pub(super) fn trim_point_schema() -> Value {
    json!({
        "description": "A parameter [u, v], or [u, v, w] with a positive weight w (1 when absent). Parameters have no unit and are not multiplied by w.",
        "type": "array", "items": number(), "minItems": 2, "maxItems": 3
    })
}

fn trim_points() -> Value {
    list(reference("TrimPoint"), 2)
}

const TRIM_MEMBER: Member = optional("trim", "Loops that cut the surface in its parameter plane; the whole surface when absent.", trim);

pub(super) const TRIM: Object = Object {
    title: "a trim",
    about: "What is kept of a surface: the closed region of its parameter plane between an outer loop and inner loops. u is the first direction of the control points and v the second; the domain is that of the knots, or [0, 1] for Bezier surfaces. A loop is a closed chain of curves, either way round, within the domain; loops neither cross nor touch themselves or each other. Ends of curves that miss each other by 1e-6 of the domain or less are joined.",
    members: &[
        optional(
            "outer",
            "The curves of the outer loop, in order; the border of the domain when absent. It may run along that border.",
            trim_loop,
        ),
        optional("inner", "Loops around holes: inside the outer loop, and not inside each other.", || list(trim_loop(), 0)),
    ],
};

pub(super) const TRIM_POLYLINE: Object = Object {
    title: "a polyline",
    about: "Segments between successive parameters.",
    members: &[family!("polyline"), required("points", "Parameters [u, v], in order.", || list(parameter(), 2))],
};

pub(super) const TRIM_BEZIER: Object = Object {
    title: "a bezier_curve of parameters",
    about: "A polynomial or rational Bezier curve in the parameter plane.",
    members: &[
        family!("bezier_curve"),
        required("control_points", "The control points [u, v] or [u, v, w], in order.", trim_points),
        WEIGHTS,
    ],
};

pub(super) const TRIM_NURBS: Object = Object {
    title: "a nurbs_curve of parameters",
    about: "A polynomial or rational spline in the parameter plane.",
    members: &[
        NURBS_SCHEME.members[0],
        NURBS_SCHEME.members[1],
        NURBS_SCHEME.members[2],
        required("control_points", "The control points [u, v] or [u, v, w], in order.", trim_points),
        WEIGHTS,
    ],
};

/// Curves that trim loops are made of, with the schema's name.
pub(super) const TRIM_CURVES: [(&str, &str, &Object); 3] =
    [("polyline", "TrimPolyline", &TRIM_POLYLINE), ("bezier_curve", "TrimBezier", &TRIM_BEZIER), ("nurbs_curve", "TrimNurbs", &TRIM_NURBS)];

pub(super) const NURBS_SURFACE: Object = Object {
    title: "a nurbs_surface",
    about: "A polynomial or rational spline surface. Directions whose ends meet are closed; sides that are single points are poles.",
    members: &[
        family!("nurbs_surface"),
        required("degree", "The degree, from 1 to 9, or one for each direction.", || degrees(2)),
        required("knots", "A full knot vector for each direction.", || tuple(knots(), 2)),
        required("control_points", "control_points[i][j], i along the first direction.", || nested(net_point, 2)),
        optional("weights", "Positive weights of the same shape, unless the points carry theirs.", || nested(positive, 2)),
        TRIM_MEMBER,
    ],
};

pub(super) const NURBS_VOLUME: Object = Object {
    title: "a nurbs_volume",
    about: "A polynomial or rational spline volume.",
    members: &[
        family!("nurbs_volume"),
        required("degree", "The degree, from 1 to 9, or one for each direction.", || degrees(3)),
        required("knots", "A full knot vector for each direction.", || tuple(knots(), 3)),
        required("control_points", "control_points[i][j][k], i along the first direction.", || nested(net_point, 3)),
        optional("weights", "Positive weights of the same shape, unless the points carry theirs.", || nested(positive, 3)),
    ],
};

pub(super) const BEZIER_SURFACE: Object = Object {
    title: "a bezier_surface",
    about: "A polynomial or rational Bezier patch.",
    members: &[
        family!("bezier_surface"),
        required("control_points", "control_points[i][j], i along the first direction.", || nested(net_point, 2)),
        optional("weights", "Positive weights of the same shape, unless the points carry theirs.", || nested(positive, 2)),
        TRIM_MEMBER,
    ],
};

pub(super) const CATMULL_ROM_SCHEME: Object = Object {
    title: "a catmull_rom without control points",
    about: "A Catmull-Rom spline.",
    members: &[
        family!("catmull_rom"),
        optional(
            "parametrization",
            "Intervals of the parameter: all equal, or as the square roots of the distances of the points, or as the distances.",
            || json!({ "type": "string", "enum": ["uniform", "centripetal", "chordal"], "default": "uniform" }),
        ),
        CLOSED,
    ],
};

pub(super) const CATMULL_ROM: Object = Object {
    title: "a catmull_rom",
    about: "A Catmull-Rom spline. Four points make the span between the second and the third, which it interpolates: an open one goes from the second point to the last but one.",
    members: &[CATMULL_ROM_SCHEME.members[0], POLYGON, CATMULL_ROM_SCHEME.members[1], CLOSED],
};

pub(super) const BETA_SPLINE_SCHEME: Object = Object {
    title: "a beta_spline without control points",
    about: "A uniformly shaped beta-spline.",
    members: &[
        family!("beta_spline"),
        optional(
            "beta1",
            "Bias, above zero; 1, no bias, when absent.",
            || json!({ "type": "number", "exclusiveMinimum": 0, "default": 1 }),
        ),
        optional("beta2", "Tension; 0, none, when absent.", || json!({ "type": "number", "default": 0 })),
        CLOSED,
    ],
};

pub(super) const BETA_SPLINE: Object = Object {
    title: "a beta_spline",
    about: "A uniformly shaped cubic beta-spline (Barsky); beta1 = 1 and beta2 = 0 make the uniform B-spline.",
    members: &[BETA_SPLINE_SCHEME.members[0], POLYGON, BETA_SPLINE_SCHEME.members[1], BETA_SPLINE_SCHEME.members[2], CLOSED],
};

pub(super) const CORNER_CUTTING_SCHEME: Object = Object {
    title: "a corner_cutting without control points",
    about: "The corner-cutting scheme (a, b).",
    members: &[CORNER_CUTTING.members[0], CORNER_CUTTING.members[2], CORNER_CUTTING.members[3], CLOSED],
};

pub(super) const FOUR_POINT_SCHEME: Object = Object {
    title: "a four_point without control points",
    about: "The four-point scheme.",
    members: &[
        family!("four_point"),
        optional(
            "w",
            "Tension; 1/16, which reproduces cubics, when absent; 0 gives the polygon.",
            || json!({ "type": "number", "default": 0.0625 }),
        ),
        CLOSED,
    ],
};

pub(super) const FOUR_POINT: Object = Object {
    title: "a four_point",
    about: "The interpolating four-point scheme. Six points make the span between the third and the fourth: an open one goes from the third point to the last but two.",
    members: &[FOUR_POINT_SCHEME.members[0], POLYGON, FOUR_POINT_SCHEME.members[1], CLOSED],
};

pub(super) const INTERPOLATION_SCHEME: Object = Object {
    title: "an interpolation without points",
    about: "A fractal interpolation function at equal distances.",
    members: &[family!("interpolation"), required("vertical_scaling", "One factor per interval, between -1 and 1.", factors)],
};

pub(super) const INTERPOLATION: Object = Object {
    title: "an interpolation",
    about: "The graph of a fractal interpolation function: exactly one of vertical_scaling and maps.",
    members: &[
        INTERPOLATION_SCHEME.members[0],
        required("points", "The points that the graph goes through, x increasing; in any order with maps.", || points(3)),
        optional(
            "vertical_scaling",
            "One factor per interval, between -1 and 1: over the interval stands the whole graph, scaled by it, plus what is linear along x.",
            factors,
        ),
        optional("maps", "One affine map per interval: it takes the first and the last point to the interval's.", || {
            list(reference("AffineMap"), 2)
        }),
    ],
};

pub(super) const BCIFS_SCHEME: Object = Object {
    title: "the states of a curve",
    about: "A curve of one's own states: edges between two vertices. As many control points as the first state has.",
    members: &[
        family!("bcifs"),
        required("states", "The kinds of cells: the curve's, those that it reaches, and their vertices.", || list(reference("State"), 1)),
        optional("start", "The name of the curve's state; the first when absent.", text),
    ],
};

pub(super) const IFS_SCHEME: Object = Object {
    title: "the maps of a curve",
    about: "The curve of affine maps whose images follow each other, drawn in the affine frame of four control points: o, o + x, o + y, o + z.",
    members: &[family!("ifs"), required("maps", "The maps, in order along the curve.", || list(reference("AffineMap"), 2))],
};

pub(super) const TENSOR: Object = Object {
    title: "a tensor",
    about: "The tensor product of two or three curve schemes on a net of control points.",
    members: &[
        family!("tensor"),
        required("u", "The first direction: a curve shape without control points.", curve_scheme),
        required("v", "The second direction.", curve_scheme),
        optional("w", "The third direction, of a volume.", curve_scheme),
        required(
            "control_points",
            "control_points[i][j], or [i][j][k] with w; i along u.",
            || json!({ "anyOf": [nested(net_point, 2), nested(net_point, 3)] }),
        ),
        optional(
            "weights",
            "Positive weights of the same shape, unless the points carry theirs.",
            || json!({ "anyOf": [nested(positive, 2), nested(positive, 3)] }),
        ),
    ],
};

pub(super) const SUM: Object = Object {
    title: "a sum",
    about: "The surface u(s) + v(t): one curve moved along another. Its quadrilateral cells are parallelograms.",
    members: &[family!("sum"), required("u", "A curve in space.", curve_shape), required("v", "A curve in space.", curve_shape)],
};

/// Curve schemes that products are made of, with the schema's name.
pub(super) const SCHEMES: [(&str, &str, &Object); 9] = [
    ("bezier_curve", "BezierScheme", &BEZIER_SCHEME),
    ("nurbs_curve", "NurbsScheme", &NURBS_SCHEME),
    ("catmull_rom", "CatmullRomScheme", &CATMULL_ROM_SCHEME),
    ("beta_spline", "BetaSplineScheme", &BETA_SPLINE_SCHEME),
    ("corner_cutting", "CornerCuttingScheme", &CORNER_CUTTING_SCHEME),
    ("four_point", "FourPointScheme", &FOUR_POINT_SCHEME),
    ("interpolation", "InterpolationScheme", &INTERPOLATION_SCHEME),
    ("bcifs", "BcifsScheme", &BCIFS_SCHEME),
    ("ifs", "IfsScheme", &IFS_SCHEME),
];

/// Curves that sums are made of, with the schema's name.
pub(super) const CURVES: [(&str, &str, &Object); 7] = [
    ("bezier_curve", "BezierCurveShape", &BEZIER_CURVE),
    ("nurbs_curve", "NurbsCurveShape", &NURBS_CURVE),
    ("catmull_rom", "CatmullRomShape", &CATMULL_ROM),
    ("beta_spline", "BetaSplineShape", &BETA_SPLINE),
    ("corner_cutting", "CornerCuttingShape", &CORNER_CUTTING),
    ("four_point", "FourPointShape", &FOUR_POINT),
    ("interpolation", "InterpolationShape", &INTERPOLATION),
];

pub(super) const MESH: Object = Object {
    title: "a mesh",
    about: "A polygon mesh: faces of one corner are points, of two segments, of three and more polygons.",
    members: &[
        family!("mesh"),
        optional("vertices", "The corner points; unless there is a file.", || points(1)),
        optional("faces", "The corner indices of each face, counter-clockwise seen from outside; unless there is a file.", || faces(1)),
        optional(
            "file",
            "Instead of vertices and faces: an STL, 3MF, OBJ, PLY, OFF or VRML file, by its path in the document's folder. Polygons stay polygons; lengths are in the file's unit, or in the document's if the file names none. Only for documents that are read from a folder.",
            file_name,
        ),
        optional(
            "interior",
            "Whether the mesh stands for the solid that it bounds or for its surface; `auto`: the solid if it is closed.",
            || json!({ "type": "string", "enum": ["auto", "solid", "surface"], "default": "auto" }),
        ),
    ],
};

/// A sharpness, as a schema.
fn sharpness() -> Value {
    json!({ "anyOf": [{ "type": "number", "minimum": 0 }, { "type": "string", "const": "infinite" }] })
}

pub(super) const SUBDIVISION: Object = Object {
    title: "a subdivision",
    about: "The limit surface of a subdivision scheme on a polygon mesh that is a manifold, with or without boundary.",
    members: &[
        family!("subdivision"),
        required("scheme", "The scheme; loop takes triangles.", || one_of_words(&["catmull_clark", "doo_sabin", "loop"])),
        required("mesh", "The control mesh.", || reference("ControlMesh")),
        optional("creases", "Sharp edges; not with doo_sabin.", || list(reference("Crease"), 0)),
        optional("corners", "Sharp vertices; not with doo_sabin.", || list(reference("Corner"), 0)),
        optional(
            "boundary",
            "What happens at vertices of the boundary that belong to one face alone: the boundary is smooth there, or passes through them.",
            || json!({ "type": "string", "enum": ["smooth", "sharp_corners"], "default": "smooth" }),
        ),
        optional("coefficients", "Masks of one's own, by region of faces; with doo_sabin only.", || list(reference("Coefficients"), 0)),
    ],
};

pub(super) const CONTROL_MESH: Object = Object {
    title: "a control mesh",
    about: "A polygon mesh whose neighbouring faces run along their common edge in opposite directions.",
    members: &[
        required("vertices", "The vertices.", || points(1)),
        required("faces", "The vertices of each face, counter-clockwise seen from outside.", || faces(1)),
    ],
};

pub(super) const CREASE: Object = Object {
    title: "a crease",
    about: "An edge that is sharp for some steps of the scheme or for ever.",
    members: &[
        required("edge", "The two vertices of the edge.", index_pair),
        required("sharpness", "Number of steps, fractions allowed; 10 and more is \"infinite\", as in OpenSubdiv.", sharpness),
    ],
};

pub(super) const CORNER: Object = Object {
    title: "a corner",
    about: "A vertex that is sharp for some steps of the scheme or for ever.",
    members: &[
        required("vertex", "The vertex.", index),
        required("sharpness", "Number of steps, fractions allowed; 10 and more is \"infinite\", as in OpenSubdiv.", sharpness),
    ],
};

pub(super) const COEFFICIENTS: Object = Object {
    title: "coefficients",
    about: "Masks of the faces of a region: a geometric texture. Faces that arise between faces of one region belong to it.",
    members: &[
        optional("faces", "The faces of the region; all when absent.", || list(index(), 0)),
        required(
            "weights",
            "Lists of n weights that sum to 1, for faces of n sides: of the corner itself, of the next vertex, and so on. Faces of other numbers of sides keep the scheme's.",
            || list(list(number(), 3), 1),
        ),
    ],
};

pub(super) const TERRAIN: Object = Object {
    title: "a terrain",
    about: "A surface of random midpoint displacement (Fournier, Fussell, Carpenter): triangles are cut in four `levels` times, and every new midpoint moves along z.",
    members: &[
        family!("terrain"),
        optional("triangle", "The three corners to start from; or a grid.", || tuple(vector(), 3)),
        optional("grid", "Rows of points to start from, two or more of two or more; or a triangle.", || list(points(2), 2)),
        required(
            "roughness",
            "r: a midpoint that is new at level k moves by at most half the longest given edge times r^k. 0 is flat; 1/2 halves with the edges; below 1.",
            || json!({ "type": "number", "minimum": 0, "exclusiveMaximum": 1 }),
        ),
        required("levels", "How often triangles are cut in four.", index),
        optional(
            "random_seed",
            "Which of the terrains; 0 when absent. The same seed gives the same terrain.",
            || json!({ "type": "integer", "minimum": 0, "maximum": 9_007_199_254_740_991_u64, "default": 0 }),
        ),
    ],
};

pub(super) const GROUP: Object = Object {
    title: "a group",
    about: "The union of several shapes.",
    members: &[
        family!("group"),
        required("parts", "The shapes, each with an optional name and place.", || list(reference("Part"), 1)),
        optional(
            "joins",
            "Borders of parts that become one, so that the parts share the edges and vertices there, or that a strip joins.",
            || list(reference("Join"), 0),
        ),
    ],
};

pub(super) const JOIN: Object = Object {
    title: "a join",
    about: "Two borders of parts that become one: they are the same curve, span by span, whichever way each runs.",
    members: &[
        required("between", "The two borders.", || tuple(reference("Border"), 2)),
        optional(
            "strip",
            "Whether a strip fills the space between the borders, of a bicubic and a biquadratic surface (NURBS with knots that are uniform along the border, regular Catmull-Clark and Doo-Sabin), and meets both with their tangent planes.",
            flag,
        ),
    ],
};

pub(super) const BORDER: Object = Object {
    title: "a border",
    about: "A border of a part, or a piece of it. Exactly one of side, vertices and boundaries is given.",
    members: &[
        required("part", "Index of the part.", index),
        optional("side", "Of a NURBS, Bezier, tensor or sum surface: the first or last value of u or v.", || {
            one_of_words(&SIDES.map(|(name, _)| name))
        }),
        optional(
            "vertices",
            "Of a subdivision surface: the mesh's vertices along the border, in either direction; the first again at the end of a border that is taken all round. With catmull_clark and loop the edges between them are the spans, with doo_sabin the vertices.",
            || list(index(), 1),
        ),
        optional("boundaries", "Of a BC-IFS: pairs [root cell, boundary of its state] along the border.", || list(index_pair(), 1)),
    ],
};

/// What a part has besides its shape.
pub(super) const PART_MEMBERS: &[Member] = &[
    optional("name", "What the author calls the part.", text),
    optional("transform", "Where the part is put; as it is when absent.", || reference("AffineMap")),
    optional(
        "radius_mm",
        "The radius of the ball that dilates the part, in mm, above zero, instead of the job's. At most one of radius_mm, radii_mm and radius_by_level is given.",
        positive,
    ),
    optional(
        "radii_mm",
        "Radii in mm, above zero, at the control points or vertices of the part's shape, one for each in their order. Between them the radius is what the shape makes of such numbers, and nowhere less than the least of them.",
        || json!({ "type": "array", "items": positive(), "minItems": 1 }),
    ),
    optional("radius_by_level", "Radii that shrink along the part's recursion.", || reference("RadiusByLevel")),
];

pub(super) const RADIUS_BY_LEVEL: Object = Object {
    title: "a radius by level",
    about: "r = max(least_mm, first_mm ratio^k) for cells that leave the recursion of the part's root cells at level k, the number of transitions taken within it; least_mm for the limit of the recursion itself.",
    members: &[
        required("first_mm", "The radius at level 0, above zero.", positive),
        required(
            "ratio",
            "From one level to the next: between 0 and 1.",
            || json!({ "type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1 }),
        ),
        required("least_mm", "No radius is less: above zero.", positive),
    ],
};

pub(super) const PART: Object = Object {
    title: "a part",
    about: "A shape with an optional name and place, the shape as a member.",
    members: &[
        PART_MEMBERS[0],
        PART_MEMBERS[1],
        PART_MEMBERS[2],
        PART_MEMBERS[3],
        PART_MEMBERS[4],
        required("shape", "The shape of the part.", || reference("Shape")),
    ],
};

/// The families, with the schema's name.
pub(super) const FAMILIES: [(&str, &str, &Object); 18] = [
    ("ifs", "IfsShape", &IFS),
    ("bcifs", "BcifsShape", &BCIFS),
    ("bezier_curve", "BezierCurveShape", &BEZIER_CURVE),
    ("corner_cutting", "CornerCuttingShape", &CORNER_CUTTING),
    ("subdivision", "SubdivisionShape", &SUBDIVISION),
    ("bezier_surface", "BezierSurfaceShape", &BEZIER_SURFACE),
    ("nurbs_curve", "NurbsCurveShape", &NURBS_CURVE),
    ("nurbs_surface", "NurbsSurfaceShape", &NURBS_SURFACE),
    ("nurbs_volume", "NurbsVolumeShape", &NURBS_VOLUME),
    ("catmull_rom", "CatmullRomShape", &CATMULL_ROM),
    ("beta_spline", "BetaSplineShape", &BETA_SPLINE),
    ("four_point", "FourPointShape", &FOUR_POINT),
    ("interpolation", "InterpolationShape", &INTERPOLATION),
    ("tensor", "TensorShape", &TENSOR),
    ("sum", "SumShape", &SUM),
    ("mesh", "MeshShape", &MESH),
    ("terrain", "TerrainShape", &TERRAIN),
    ("group", "GroupShape", &GROUP),
];
