//! Laws: what is written is read back the same, and nothing that is sent makes the reader panic.

use glam::{DMat3, DVec3, DVec4};
use lacuna_kernel::model::{
    Adjacency, AffineMap, Bcifs, BcifsState, BezierCurve, Border, BorderPath, BoundaryRule, BoundarySpec, CellKind, Coefficients, Corner,
    CornerCutting, Crease, Entry, Glue, Group, Ifs, Incidence, Interior, Join, Matrix, Model, Part, PartRadius, PolygonMesh, Primitive,
    Relation, RootCell, Scheme, Shape, Side, Subdivision, Terrain, TerrainBase, TransitionSpec,
};
use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;

use crate::diagnostic::code;
use crate::document::{DocumentLimits, read_job, read_model, write_model};

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![(-4.0..4.0_f64), any::<f64>().prop_filter("finite", |number| number.is_finite()), Just(0.0), Just(1.0)]
}

fn positive() -> impl Strategy<Value = f64> {
    number().prop_map(|number| if number == 0.0 { 1.0 } else { number.abs() })
}

fn point() -> impl Strategy<Value = DVec3> {
    [number(), number(), number()].prop_map(DVec3::from_array)
}

fn map() -> impl Strategy<Value = AffineMap> {
    ([point(), point(), point()], point()).prop_map(|([x, y, z], translation)| AffineMap { linear: DMat3::from_cols(x, y, z), translation })
}

fn name() -> impl Strategy<Value = String> {
    "\\PC{1,12}"
}

fn mesh_data() -> impl Strategy<Value = (Vec<DVec3>, Vec<Vec<u32>>)> {
    vec(point(), 1..6).prop_flat_map(|vertices| {
        let count = u32::try_from(vertices.len()).unwrap();
        (Just(vertices), vec(vec(0..count, 1..5), 1..4))
    })
}

fn primitive() -> impl Strategy<Value = Primitive> {
    prop_oneof![
        vec(point(), 1..4).prop_map(Primitive::Points),
        (vec(point(), 1..4), any::<bool>()).prop_map(|(points, closed)| Primitive::Polyline { points, closed }),
        mesh_data().prop_map(|(vertices, faces)| Primitive::Mesh { vertices, faces }),
        mesh_data().prop_map(|(vertices, faces)| Primitive::Solid { vertices, faces }),
    ]
}

fn ifs() -> impl Strategy<Value = Shape> {
    (vec(map(), 1..5), option::of(primitive())).prop_flat_map(|(maps, primitive)| {
        let count = maps.len();
        let row = proptest::sample::subsequence((0..count).collect::<Vec<_>>(), 0..=count);
        option::of(vec(row, count)).prop_map(move |graph| Shape::Ifs(Ifs { maps: maps.clone(), primitive: primitive.clone(), graph }))
    })
}

fn matrix(parameters: Vec<String>) -> impl Strategy<Value = Matrix> {
    (1..4_usize).prop_flat_map(move |columns| {
        let parameter = if parameters.is_empty() {
            Just(Entry::Unknown).boxed()
        } else {
            proptest::sample::select(parameters.clone()).prop_map(Entry::Parameter).boxed()
        };
        let entry = prop_oneof![4 => number().prop_map(Entry::Number), 1 => Just(Entry::Unknown), 1 => parameter];
        vec(vec(entry, columns), 1..4).prop_map(|rows| Matrix { rows })
    })
}

const STATES: usize = 3;
const CHILDREN: usize = 2;
const BOUNDARIES: usize = 2;

fn state_name(index: usize) -> String {
    format!("état {index}")
}

fn state(index: usize, parameters: &[String]) -> impl Strategy<Value = BcifsState> + use<> {
    let kinds = [CellKind::Vertex, CellKind::Edge, CellKind::Face, CellKind::Volume];
    let links = || (0..STATES, matrix(parameters.to_vec()));
    (proptest::sample::select(kinds.to_vec()), 1..9_usize, vec(links(), CHILDREN), vec(links(), BOUNDARIES)).prop_map(
        move |(cell, dimension, children, boundaries)| BcifsState {
            name: state_name(index),
            cell,
            dimension,
            transitions: children.into_iter().map(|(to, operator)| TransitionSpec { to: state_name(to), operator }).collect(),
            boundaries: boundaries.into_iter().map(|(state, incidence)| BoundarySpec { state: state_name(state), incidence }).collect(),
        },
    )
}

fn bcifs() -> impl Strategy<Value = Shape> {
    vec(number(), 0..3).prop_flat_map(|values| {
        let parameters: Vec<(String, f64)> =
            values.into_iter().enumerate().map(|(index, value)| (format!("p{}", 9 - index), value)).collect();
        let names: Vec<String> = parameters.iter().map(|(name, _)| name.clone()).collect();
        let states = [state(0, &names), state(1, &names), state(2, &names)];
        let child = || (0..CHILDREN, 0..BOUNDARIES);
        let placed = (option::weighted(0.8, point()), prop_oneof![Just(1.0), positive()])
            .prop_map(|(point, weight): (Option<DVec3>, f64)| -> Option<DVec4> { point.map(|point| point.extend(weight)) });
        let cell = (0..STATES, vec(placed, 1..4)).prop_map(|(state, control_points)| RootCell { state: state_name(state), control_points });
        let incidence = (0..STATES, 0..BOUNDARIES, vec(child(), 0..3)).prop_map(|(state, boundary, children)| Incidence {
            state: state_name(state),
            boundary,
            children,
        });
        let adjacency = (0..STATES, [child(), child()], orientation()).prop_map(|(state, between, (reversed, permutation))| Adjacency {
            state: state_name(state),
            between,
            reversed,
            permutation,
        });
        let side = || (vec(0..CHILDREN, 0..4), vec(0..BOUNDARIES, 0..3)).prop_map(|(path, boundary)| Side { path, boundary });
        let relation = (0..STATES, [side(), side()]).prop_map(|(state, equal)| Relation { state: state_name(state), equal });
        let glue = ([(0..2_usize, 0..BOUNDARIES), (0..2_usize, 0..BOUNDARIES)], orientation())
            .prop_map(|(between, (reversed, permutation))| Glue { between, reversed, permutation });
        let constraints = (vec(incidence, 0..3), vec(adjacency, 0..3), vec(relation, 0..3), vec(glue, 0..3));
        (states, vec(cell, 2), constraints).prop_map(move |(states, cells, (incidences, adjacencies, relations, glue))| {
            let parameters = parameters.clone();
            let mut bcifs = Bcifs { states: states.to_vec(), incidences, adjacencies, relations, cells, glue, parameters };
            fit_permutations(&mut bcifs);
            Shape::Bcifs(bcifs)
        })
    })
}

/// Reversed or not, or a rotation by so many control points; its length is set by [`fit_permutations`].
fn orientation() -> impl Strategy<Value = (bool, Option<Vec<usize>>)> {
    prop_oneof![any::<bool>().prop_map(|reversed| (reversed, None)), (0..9_usize).prop_map(|turn| (false, Some(vec![turn])))]
}

/// Makes permutations of the rotations that were drawn, as long as the boundaries have control points.
fn fit_permutations(bcifs: &mut Bcifs) {
    let find = |name: &str| bcifs.states.iter().find(|state| state.name == name).unwrap();
    let size = |state: &BcifsState, boundary: usize| find(&state.boundaries[boundary].state).dimension;
    let fit = |permutation: &mut Option<Vec<usize>>, size: usize| {
        *permutation = permutation.take().map(|turn| (0..size).map(|index| (index + turn[0]) % size).collect());
    };
    for adjacency in &mut bcifs.adjacencies {
        let (child, boundary) = adjacency.between[0];
        fit(&mut adjacency.permutation, size(find(&find(&adjacency.state).transitions[child].to), boundary));
    }
    for glue in &mut bcifs.glue {
        let (cell, boundary) = glue.between[0];
        fit(&mut glue.permutation, size(find(&bcifs.cells[cell].state), boundary));
    }
}

fn bezier() -> impl Strategy<Value = Shape> {
    vec((point(), positive()), 1..5).prop_flat_map(|points| {
        any::<bool>().prop_map(move |rational| {
            Shape::BezierCurve(BezierCurve {
                control_points: points.iter().map(|(point, _)| *point).collect(),
                weights: rational.then(|| points.iter().map(|(_, weight)| *weight).collect()),
            })
        })
    })
}

fn subdivision() -> impl Strategy<Value = Shape> {
    let scheme = proptest::sample::select(vec![Scheme::CatmullClark, Scheme::DooSabin, Scheme::Loop]);
    let boundary = proptest::sample::select(vec![BoundaryRule::Smooth, BoundaryRule::SharpCorners]);
    let sharpness = || prop_oneof![number(), Just(f64::INFINITY)];
    let coefficients =
        (option::of(vec(0..1_u32, 0..3)), vec(vec(number(), 3..5), 1..3)).prop_map(|(faces, weights)| Coefficients { faces, weights });
    (mesh_data(), scheme, boundary, vec(sharpness(), 0..3), vec(sharpness(), 0..3), vec(coefficients, 0..2)).prop_map(
        |((vertices, faces), scheme, boundary, creases, corners, coefficients)| {
            let last = vertices.len() as u32 - 1;
            Shape::Subdivision(Subdivision {
                scheme,
                vertices,
                faces,
                creases: creases.into_iter().map(|sharpness| Crease { edge: [0, last], sharpness }).collect(),
                corners: corners.into_iter().map(|sharpness| Corner { vertex: last, sharpness }).collect(),
                boundary,
                coefficients,
            })
        },
    )
}

fn terrain() -> impl Strategy<Value = Shape> {
    let triangle = [point(), point(), point()].prop_map(TerrainBase::Triangle);
    let grid = (2..4_usize).prop_flat_map(|columns| vec(vec(point(), columns), 2..4)).prop_map(TerrainBase::Grid);
    let base = prop_oneof![triangle, grid];
    (base, number(), 0..12_u32, 0..1_u64 << 53)
        .prop_map(|(base, roughness, levels, random_seed)| Shape::Terrain(Terrain { base, roughness, levels, random_seed }))
}

fn radius() -> impl Strategy<Value = PartRadius> {
    prop_oneof![
        positive().prop_map(PartRadius::Constant),
        vec(positive(), 1..4).prop_map(PartRadius::AtPoints),
        [positive(), positive(), positive()].prop_map(|[first, ratio, least]| PartRadius::ByLevel { first, ratio, least }),
    ]
}

fn shape() -> impl Strategy<Value = Shape> {
    let corner_cutting = (vec(point(), 3..6), number(), number(), any::<bool>())
        .prop_map(|(control_points, a, b, closed)| Shape::CornerCutting(CornerCutting { control_points, a, b, closed }));
    let interior = proptest::sample::select(vec![Interior::Auto, Interior::Solid, Interior::Surface]);
    let mesh = (mesh_data(), interior).prop_map(|((vertices, faces), interior)| Shape::Mesh(PolygonMesh { vertices, faces, interior }));
    prop_oneof![ifs(), bcifs(), bezier(), corner_cutting, subdivision(), mesh, terrain()].prop_recursive(3, 8, 3, |shape| {
        let part = (option::of(name()), option::of(map()), shape, option::of(radius())).prop_map(|(name, transform, shape, radius)| Part {
            name,
            transform,
            shape,
            radius,
        });
        let side = (0..2_usize, any::<bool>()).prop_map(|(direction, last)| BorderPath::Side { direction, last });
        let vertices = vec(0..99_u32, 1..4).prop_map(BorderPath::Vertices);
        let boundaries = vec((0..9_usize, 0..4_usize), 1..4).prop_map(BorderPath::Boundaries);
        // There is at least one part.
        let border = prop_oneof![side, vertices, boundaries].prop_map(|path| Border { part: 0, path });
        let join = ([border.clone(), border], any::<bool>()).prop_map(|(between, strip)| Join { between, strip });
        (vec(part, 1..4), vec(join, 0..2)).prop_map(|(parts, joins)| Shape::Group(Group { parts, joins }))
    })
}

fn model() -> impl Strategy<Value = Model> {
    (option::of(name()), shape()).prop_map(|(name, shape)| Model { name, shape })
}

/// Changes of a document's bytes: replaced, removed, doubled, cut off.
fn mutated(mut bytes: Vec<u8>, changes: &[(usize, u8, u8)]) -> Vec<u8> {
    for (place, kind, byte) in changes {
        if bytes.is_empty() {
            break;
        }
        let at = place % bytes.len();
        match kind % 5 {
            0 => bytes[at] = *byte,
            1 => drop(bytes.remove(at)),
            2 => bytes.insert(at, b"{}[],:\"\\0e-.n"[usize::from(*byte) % 13]),
            3 => {
                let end = (at + usize::from(*byte)).min(bytes.len());
                let copy = bytes[at..end].to_vec();
                bytes.splice(at..at, copy);
            }
            _ if place % 7 == 0 => bytes.truncate(at),
            _ => bytes[at] = bytes[(at + 1) % bytes.len()],
        }
    }
    bytes
}

const SYNTACTIC: [&str; 6] =
    [code::SYNTAX, code::TRUNCATED, code::TRAILING_CONTENT, code::NO_CONTENT, code::NOT_UTF8, code::BYTE_ORDER_MARK];

proptest! {
    #![proptest_config(ProptestConfig { cases: 192, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_is_read_back(model in model()) {
        let canonical = write_model(&model);
        let again = read_model(canonical.as_bytes(), &DocumentLimits::default());
        prop_assert_eq!(again.as_ref(), Ok(&model));
        prop_assert_eq!(write_model(&again.unwrap()), canonical);
    }

    #[test]
    fn mutated_documents_never_panic(
        model in model(),
        changes in vec((any::<usize>(), any::<u8>(), any::<u8>()), 1..6),
    ) {
        let bytes = mutated(write_model(&model).into_bytes(), &changes);
        let job = [br#"{"lacuna": 1, "kind": "measure", "params": {"tolerance_mm": 1}, "model": "#, bytes.as_slice(), b"}"].concat();
        let found = read_job(&job, &DocumentLimits::default()).err();
        prop_assert!(found.is_none_or(|found| !found.is_empty() && found.len() <= 101));
        // an independent parser agrees on what is JSON
        let is_json = serde_json::from_slice::<serde_json::Value>(&bytes).is_ok();
        match read_model(&bytes, &DocumentLimits::default()) {
            Ok(_) => prop_assert!(is_json),
            Err(found) => {
                prop_assert!(!found.is_empty() && found.len() <= 101);
                prop_assert!(!is_json || !found.iter().any(|fault| SYNTACTIC.contains(&fault.code)), "{:?}", found);
            }
        }
    }

    #[test]
    fn any_bytes_never_panic(bytes in vec(any::<u8>(), 0..200)) {
        prop_assert!(read_model(&bytes, &DocumentLimits::default()).is_err());
        prop_assert!(read_job(&bytes, &DocumentLimits::default()).is_err());
    }
}
