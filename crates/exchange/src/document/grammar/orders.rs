//! The members of jobs and of questions about models.

use serde_json::json;

use lacuna_fabrication::job::{Operation, WallSide};

use super::super::address::{CELLS_LISTED, MOST_CELLS_LISTED};
use super::{
    MODEL, Member, Object, count, flag, list, number, one_of_words, optional, positive, reference, required, text, tuple, vector, version,
};
use crate::format::FORMATS;

/// Levels beyond this have more copies than could ever be held, unless there is but one map.
pub(in super::super) const MOST_LEVEL: u64 = 64;

/// Operations by their words.
pub(in super::super) const OPERATIONS: [(&str, Operation); 6] = [
    ("union", Operation::Union),
    ("intersection", Operation::Intersection),
    ("difference", Operation::Difference),
    ("hull", Operation::Hull),
    ("trim", Operation::Trim),
    ("split", Operation::Split),
];

/// Sides of walls by their words.
pub(in super::super) const WALL_SIDES: [(&str, WallSide); 2] = [("inward", WallSide::Inward), ("outward", WallSide::Outward)];

/// The members that name a model.
const SOURCE: [Member; 2] = [
    optional("model", "The model, in full.", || reference("EmbeddedModel")),
    optional("model_ref", "The id of a stored model or of an uploaded mesh file.", text),
];

/// Kinds of jobs of the grammar that cannot be done yet.
pub(in super::super) const LATER_KINDS: [&str; 4] = ["check", "sla", "cast", "panels"];

pub(in super::super) const JOB: Object = Object {
    title: "a job",
    about: "An order: what to do, with which model, how precisely, and what to deliver. Exactly one of model, model_ref and inputs is given.",
    members: &[
        required("lacuna", "The version of the grammar: 1.", version),
        required(
            "kind",
            "What to do: evaluate (points, wires or surface to the tolerance), solidify (a printable solid: the shape dilated by a ball, a wall, or a level of an ifs), measure (box, area and volume as intervals), intersect (a printable solid: what an operation leaves of several), slice (plane sections of a solid), or convert (a mesh as it is, in other formats; any other model is evaluated).",
            || one_of_words(&["evaluate", "solidify", "measure", "intersect", "slice", "convert"]),
        ),
        SOURCE[0],
        SOURCE[1],
        optional("inputs", "Named models, for kinds of jobs with several.", || list(reference("JobInput"), 1)),
        required("params", "How to do it.", || reference("JobParams")),
        optional(
            "outputs",
            "Names of the formats wanted, for example 3mf and stl. A measure makes none, but ply with thickness.",
            || json!({ "type": "array", "items": one_of_words(&FORMATS.map(|format| format.ending)), "uniqueItems": true }),
        ),
        optional("limits", "What the job may use; the service's defaults when absent.", || reference("JobLimits")),
        optional(
            "supersedes",
            "For a service: the id of a job that is stopped once this one is accepted, because nobody wants it any more.",
            text,
        ),
    ],
};

pub(in super::super) const SOLVE: Object = Object {
    title: "a solve request",
    about: "A model with unknown entries, and the values chosen for what its constraints leave free. Exactly one of model and model_ref is given.",
    members: &[
        Member { required: false, ..MODEL.members[0] },
        SOURCE[0],
        SOURCE[1],
        optional(
            "values",
            "Values of free parameters by their names; those that are absent keep the value that the solver chooses.",
            || json!({ "type": "object", "additionalProperties": number(), "propertyNames": text() }),
        ),
    ],
};

pub(in super::super) const JOB_INPUT: Object = Object {
    title: "an input",
    about: "A named model. Exactly one of model and model_ref is given.",
    members: &[
        required("name", "What the job calls the model.", text),
        SOURCE[0],
        SOURCE[1],
        optional(
            "radius_mm",
            "For intersect alone: the radius of the ball that dilates this input, in mm; 0 takes the solids that its closed surfaces bound as they are; the radius_mm of params when absent, and 0 without one.",
            || json!({ "type": "number", "minimum": 0 }),
        ),
    ],
};

/// The schema of so many numbers.
macro_rules! numbers {
    ($count:literal) => {
        || json!({ "type": "array", "items": number(), "minItems": $count, "maxItems": $count })
    };
}

pub(in super::super) const WITH: Object = Object {
    title: "what a shape is held against",
    about: "Exactly one of these, in mm whatever the unit of the model.",
    members: &[
        optional("point", "x, y, z: does it belong to the shape?", numbers!(3)),
        optional("segment", "Its two ends.", numbers!(6)),
        optional("ray", "Where it begins, and its direction of any length.", numbers!(6)),
        optional("line", "A point of it, and its direction of any length.", numbers!(6)),
        optional("plane", "Its normal of any length, and its distance from the origin along that.", numbers!(4)),
        optional("box", "Its lower and its upper corner: with all points within.", numbers!(6)),
        optional("ball", "Its centre and its radius: with all points within.", numbers!(4)),
        optional(
            "self",
            "true: the shape itself. Where does it come near itself although no boundary that the model declares joins it there?",
            || json!({ "const": true }),
        ),
    ],
};

pub(in super::super) const JOB_PARAMS: Object = Object {
    title: "params",
    about: "Settings of a job. What a kind does not use must be absent.",
    members: &[
        optional(
            "tolerance_mm",
            "The Hausdorff bound on the result, in mm, above zero. Required but with level, which is exact but for the single precision of the files.",
            positive,
        ),
        optional(
            "preview",
            "Whether a preview is enough, which takes a second or two and is written as glb alone: for solidify the dilation as coarse as its ball allows, or where that is too much the shape without its ball, for evaluate the shape at the finest tolerance of which it has few enough cells. The certificate's preview says which, and with which tolerance; everything else in the certificate is of what is shown. For evaluate, and for solidify without level, closing_mm, wall_mm and stability; false when absent.",
            flag,
        ),
        optional(
            "level",
            "For solidify of a model of the family ifs, instead of radius_mm: the union of all copies of the primitive along addresses of this length, as an exact solid; the primitive is the model's solid, or else the box of its attractor.",
            || json!({ "type": "integer", "minimum": 0, "maximum": MOST_LEVEL }),
        ),
        optional(
            "repair",
            "Whether inputs of the family mesh are made solids first, the certificate telling what was done to each: vertices at the same place are joined, triangles without area and copies are taken away, corners are doubled where parts meet in edges or corners only, and triangles are turned so that material is behind them. No point is moved. Holes of up to 64 edges, of at most a quarter of the area of the surface, are closed by triangles between their corners that meet nothing else; other open meshes are refused with the place. Absent for evaluate; false when absent.",
            flag,
        ),
        optional(
            "radius_mm",
            "The radius of the dilating ball, in mm, above zero: required by solidify unless wall_mm or level is there, optional for measure, intersect and slice, absent for evaluate and convert.",
            positive,
        ),
        optional(
            "closing_mm",
            "Gaps of the dilated shape that are narrower than this are filled, in mm, above zero: by closing it with a ball of half the size. For solidify with radius_mm alone.",
            positive,
        ),
        optional(
            "wall_mm",
            "The thickness of a wall along the surface of the solid, in mm, above zero, which is made instead of the solid: of the dilation where there is a radius_mm, else of what the model's closed surface bounds. For solidify alone.",
            positive,
        ),
        optional(
            "side",
            "On which side of that surface the wall is: inward (the solid becomes hollow) or outward (what the surface bounds becomes the hollow); inward when absent.",
            || one_of_words(&WALL_SIDES.map(|(word, _)| word)),
        ),
        optional(
            "operation",
            "What intersect leaves of the solids of its inputs: what lies in any of them (union), in all of them (intersection), in the first and in none of the others (difference), or their convex hull (hull); of one input, what lies behind a plane (trim), or its parts between planes (split). For intersect alone; without it intersect tells where two shapes come within the tolerance of each other, and makes no file.",
            || one_of_words(&OPERATIONS.map(|(word, _)| word)),
        ),
        optional("with", "What the one input of intersect is held against, where there is neither a second one nor an operation.", || {
            reference("With")
        }),
        optional(
            "plane",
            "For trim: the normal of a plane, of any length, and its distance from the origin along that, in mm. What the normal points to is taken away.",
            numbers!(4),
        ),
        optional(
            "volume_mm",
            "For split: the build volume along x, y and z, in mm, which every part fits; along axes without cuts of their own the job cuts as rarely as it can.",
            || tuple(positive(), 3),
        ),
        optional(
            "cuts_mm",
            "For split: where to cut across x, y and z, in mm: three arrays, empty where the volume tells or nothing is cut.",
            || tuple(list(number(), 0), 3),
        ),
        optional(
            "key_mm",
            "For split: the width and length of pegs that stand in sockets of the neighbouring parts, in mm; walls are half of that. No keys when absent.",
            positive,
        ),
        optional(
            "clearance_mm",
            "For split, with key_mm and only with it: the distance between the faces of a peg and of its socket, in mm.",
            || json!({ "type": "number", "minimum": 0 }),
        ),
        optional("normal", "What the planes of slice are perpendicular to, of any length; [0, 0, 1] when absent.", vector),
        optional(
            "offsets_mm",
            "Where the planes of slice are along the normal, in mm. Exactly one of offsets_mm and step_mm is given.",
            || json!({ "type": "array", "items": number(), "minItems": 1 }),
        ),
        optional(
            "step_mm",
            "The height of layers, in mm, above zero: planes of slice are in their middles, from the bottom of the solid to its top.",
            positive,
        ),
        optional(
            "direction",
            "Along which the extent of the shape is told, as by planes that touch it on both sides, of any length: for measure alone.",
            vector,
        ),
        optional(
            "oriented_box",
            "Whether the smallest box around the shape is found, whatever way it is turned: for measure alone; false when absent.",
            flag,
        ),
        optional(
            "thickness",
            "Whether the least thickness of walls and gaps is found, along the normals of faces: for measure of a solid alone; false when absent. With the output ply its map is made too: the mesh that is measured, with the thickness over every face as the property wall_mm (inwards) and gap_mm (outwards), and at every vertex the least of the faces around it; inf where no face lies across.",
            flag,
        ),
        optional("density_g_cm3", "The density of the material, in g/cm3, above zero, for the mass: for measure alone.", positive),
        optional(
            "normals",
            "Whether an evaluation carries the normals of the limit surface into PLY, OBJ, GLB and VRML: for evaluate alone; false when absent.",
            flag,
        ),
        optional("simplify", "Whether triangles are saved within the bound: for solidify alone; true when absent.", flag),
        optional(
            "stability",
            "Whether the certificate says at which radii from half to twice radius_mm the topology changes, and from which on the shape is one piece: for solidify alone; false when absent.",
            flag,
        ),
    ],
};

pub(in super::super) const JOB_LIMITS: Object = Object {
    title: "limits",
    about: "What a job may use. Each limit that is absent is the service's default.",
    members: &[
        optional("seconds", "Wall time in seconds.", positive),
        optional("triangles", "Triangles of the result.", count),
        optional(
            "cells",
            "Leaf cells that may be expanded: of an evaluation all of the shape's, of each dilation those that its surface needs, one again in every block of its lattice. A comparison of shapes looks at no more nodes than this, and ends there with what it knows.",
            count,
        ),
        optional("memory_bytes", "Accounted memory in bytes.", count),
        optional("depth", "Length of the longest address.", || json!({ "type": "integer", "minimum": 1, "maximum": u32::MAX })),
        optional("output_bytes", "Bytes of all files of the result, the certificate aside.", count),
    ],
};

/// Jobs that a batch has at most.
pub const MOST_JOBS: usize = 100;

pub(in super::super) const BATCH: Object = Object {
    title: "a batch",
    about: "Several jobs that are accepted together, or not at all, and done in any order; each ends for itself, well or not.",
    members: &[
        required("lacuna", "The version of the grammar: 1.", version),
        required(
            "jobs",
            "The jobs.",
            || json!({ "type": "array", "items": reference("BatchEntry"), "minItems": 1, "maxItems": MOST_JOBS }),
        ),
    ],
};

pub(in super::super) const BATCH_ENTRY: Object = Object {
    title: "a job of a batch",
    about: "A job document, and what the batch calls it.",
    members: &[
        optional("name", "What to call it; no two jobs of a batch are called the same.", text),
        required("job", "The job document, without supersedes.", || reference("Job")),
    ],
};

pub(in super::super) const ADDRESS_QUESTION: Object = Object {
    title: "a question about addresses",
    about: "Where an address leads (at), or which addresses lead near a point (near). Exactly one of model and model_ref is given, and exactly one of at and near.",
    members: &[
        Member { required: false, ..MODEL.members[0] },
        SOURCE[0],
        SOURCE[1],
        optional(
            "at",
            "An address: the root cell, a colon, the indices of transitions, and in parentheses those that repeat without end, for example `0: 1 2 (0 3)`.",
            || json!({ "type": "string" }),
        ),
        optional("near", "A point, in mm whatever the unit of the model.", vector),
        optional(
            "within_mm",
            "With `near`: cells as far as this are listed; those that may hold the closest point of the shape when absent.",
            || json!({ "type": "number", "minimum": 0 }),
        ),
        optional("tolerance_mm", "With `near`: radius to which cells are refined; a thousandth of the shape's when absent.", positive),
        optional(
            "most",
            "With `near`: cells to list at most.",
            || json!({ "type": "integer", "minimum": 1, "maximum": MOST_CELLS_LISTED, "default": CELLS_LISTED }),
        ),
    ],
};
