//! Half-edges: adjacency against brute force on the faces, and every kind of mesh that has none.

use lacuna_kernel::model::{HalfEdgeMesh, MeshFault};
use std::collections::{BTreeMap, BTreeSet};

fn cube() -> Vec<Vec<u32>> {
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]].map(|face| face.to_vec()).to_vec()
}

/// A grid of quads, closed along u if asked; with both, a torus.
fn grid(columns: u32, rows: u32, close_u: bool, close_v: bool) -> (usize, Vec<Vec<u32>>) {
    let (width, height) = (columns + u32::from(!close_u), rows + u32::from(!close_v));
    let at = |i: u32, j: u32| (j % height) * width + i % width;
    let quad = |i, j| vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
    let faces = (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j))).map(|(i, j)| quad(i, j)).collect();
    ((width * height) as usize, faces)
}

/// Every answer, against what the list of faces says.
fn check(vertices: usize, faces: &[Vec<u32>]) -> HalfEdgeMesh {
    let mesh = HalfEdgeMesh::new(vertices, faces).unwrap();
    let mut sides: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    for (index, face) in faces.iter().enumerate() {
        assert_eq!(mesh.corners(index), face);
        for k in 0..face.len() {
            sides.insert((face[k], face[(k + 1) % face.len()]), index);
        }
    }
    let edges: BTreeSet<(u32, u32)> = sides.keys().map(|&(a, b)| (a.min(b), a.max(b))).collect();
    assert_eq!((mesh.edge_count(), mesh.face_count(), mesh.vertex_count()), (edges.len(), faces.len(), vertices));
    for half_edge in mesh.half_edges() {
        let (a, b) = (mesh.origin(half_edge), mesh.target(half_edge));
        assert_eq!(sides[&(a, b)], mesh.face(half_edge));
        assert_eq!(mesh.neighbour(half_edge), sides.get(&(b, a)).copied());
        assert_eq!(mesh.twin(half_edge).and_then(|twin| mesh.twin(twin)), mesh.twin(half_edge).map(|_| half_edge));
        assert_eq!(mesh.previous(mesh.next(half_edge)), half_edge);
        assert_eq!(mesh.find(a, b), Some(half_edge));
        assert!(mesh.sides(mesh.face(half_edge)).any(|side| side == half_edge));
    }
    for vertex in 0..vertices as u32 {
        let around: BTreeSet<usize> = mesh.around(vertex).map(|half_edge| mesh.face(half_edge)).collect();
        let expected: BTreeSet<usize> = (0..faces.len()).filter(|&face| faces[face].contains(&vertex)).collect();
        assert_eq!(around, expected, "faces at vertex {vertex}");
        let neighbours: Vec<u32> = mesh.neighbours(vertex).collect();
        let at: BTreeSet<u32> = edges.iter().filter_map(|&(a, b)| if a == vertex { Some(b) } else { (b == vertex).then_some(a) }).collect();
        assert_eq!(neighbours.iter().copied().collect::<BTreeSet<_>>(), at);
        assert_eq!((neighbours.len(), mesh.valence(vertex)), (at.len(), at.len()));
        let on_boundary = at.iter().any(|&other| sides.contains_key(&(vertex, other)) != sides.contains_key(&(other, vertex)));
        assert_eq!(mesh.is_boundary(vertex), on_boundary);
        // Counter-clockwise: successive neighbours have a face between them, which runs vertex, this one, ..., next one.
        for (half_edge, pair) in mesh.around(vertex).zip(neighbours.windows(2)) {
            assert_eq!((mesh.target(half_edge), mesh.origin(mesh.previous(half_edge))), (pair[0], pair[1]));
        }
    }
    let boundary: BTreeSet<_> = mesh.half_edges().filter(|&half_edge| mesh.twin(half_edge).is_none()).collect();
    let mut walked = BTreeSet::new();
    for one in mesh.boundary_loops() {
        for k in 0..one.len() {
            assert_eq!(mesh.target(one[k]), mesh.origin(one[(k + 1) % one.len()]));
            assert!(walked.insert(one[k]));
        }
    }
    assert_eq!(walked, boundary);
    mesh
}

#[test]
fn closed_and_open_meshes_answer_as_their_faces_do() {
    let mesh = check(8, &cube());
    assert_eq!((mesh.euler(), mesh.boundary_loops().len()), (2, 0));
    for (close_u, close_v, euler, loops) in [(true, true, 0, 0), (true, false, 0, 2), (false, false, 1, 1)] {
        let (vertices, faces) = grid(7, 5, close_u, close_v);
        let mesh = check(vertices, &faces);
        assert_eq!((mesh.euler(), mesh.boundary_loops().len()), (euler, loops));
    }
    let (vertices, mut faces) = grid(5, 5, false, false);
    faces.remove(12);
    let mesh = check(vertices, &faces);
    assert_eq!(mesh.boundary_loops().iter().map(Vec::len).collect::<Vec<_>>(), [20, 4]);
    // Two triangles back to back, a fan of valence 360, a face of 1000 corners: all legal.
    assert_eq!(check(3, &[vec![0, 1, 2], vec![2, 1, 0]]).euler(), 2);
    let fan: Vec<Vec<u32>> = (0..360).map(|k| vec![0, 1 + k, 1 + (k + 1) % 360]).collect();
    assert_eq!(check(361, &fan).valence(0), 360);
    assert_eq!(check(1000, &[(0..1000).collect()]).boundary_loops()[0].len(), 1000);
}

#[test]
fn removing_faces_at_random_gives_a_checked_mesh_or_a_named_bow_tie() {
    let mut seed: u64 = 1;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        seed >> 33
    };
    let (mut legal, mut bow_ties) = (0, 0);
    for _ in 0..300 {
        let (vertices, all) = grid(4, 4, true, false);
        let kept = random() % 60 + 40;
        let faces: Vec<Vec<u32>> = all.into_iter().filter(|_| random() % 100 < kept).collect();
        // Number the used vertices anew.
        let used: BTreeSet<u32> = faces.iter().flatten().copied().collect();
        let number: BTreeMap<u32, u32> = used.iter().copied().zip(0..).collect();
        let faces: Vec<Vec<u32>> = faces.iter().map(|face| face.iter().map(|vertex| number[vertex]).collect()).collect();
        assert!(used.len() <= vertices);
        match HalfEdgeMesh::new(used.len(), &faces) {
            Ok(_) => {
                check(used.len(), &faces);
                legal += 1;
            }
            Err(faults) if faces.is_empty() => assert_eq!(faults, [MeshFault::Empty]),
            Err(faults) => {
                for fault in faults {
                    let MeshFault::BowTie { vertex, faces: [first, second] } = fault else { panic!("{fault}") };
                    let common: Vec<&u32> = faces[first].iter().filter(|corner| faces[second].contains(corner)).collect();
                    assert_eq!(common, [&vertex]);
                }
                bow_ties += 1;
            }
        }
    }
    assert!(legal > 50 && bow_ties > 50, "{legal} legal, {bow_ties} with bow-ties");
}

#[track_caller]
fn refused(vertices: usize, faces: &[Vec<u32>]) -> Vec<(&'static str, String, String)> {
    let faults = HalfEdgeMesh::new(vertices, faces).unwrap_err();
    faults.iter().map(|fault| (fault.code(), fault.pointer(), fault.to_string())).collect()
}

#[track_caller]
fn assert_refused(vertices: usize, faces: &[&[u32]], code: &str, pointer: &str, words: &str) {
    let faces: Vec<Vec<u32>> = faces.iter().map(|face| face.to_vec()).collect();
    let found = refused(vertices, &faces);
    let (found_code, found_pointer, found_words) = &found[0];
    assert_eq!((*found_code, found_pointer.as_str()), (code, pointer));
    assert!(found_words.contains(words), "{found_words}");
}

#[test]
fn what_is_no_manifold_is_named() {
    assert_refused(3, &[], "mesh.empty", "/faces", "no face");
    assert_refused(3, &[&[0, 1, 2], &[0, 1]], "mesh.face-corners", "/faces/1", "2 corners");
    assert_refused(3, &[&[0, 1, 3]], "mesh.index", "/faces/0", "vertex 3");
    assert_refused(4, &[&[0, 1, 2, 1]], "mesh.repeated-vertex", "/faces/0", "vertex 1 twice");
    assert_refused(5, &[&[0, 1, 2], &[1, 0, 3], &[0, 1, 4]], "mesh.non-manifold-edge", "/faces/2", "edge 0 - 1 has 3 faces");
    assert_refused(4, &[&[0, 1, 2], &[0, 1, 3]], "mesh.inconsistent-orientation", "/faces/1", "from 0 to 1");
    assert_refused(5, &[&[0, 1, 2], &[0, 3, 4]], "mesh.bow-tie", "/vertices/0", "faces 0 and 1 meet in vertex 0");
    assert_refused(4, &[&[0, 1, 2]], "mesh.isolated-vertex", "/vertices/3", "vertex 3");
    // A pinched sphere: two closed fans at one vertex.
    let mut pinched = cube();
    pinched.extend(cube().iter().map(|face| face.iter().map(|&vertex| if vertex == 0 { 0 } else { vertex + 7 }).collect()));
    assert_eq!(refused(15, &pinched)[0].0, "mesh.bow-tie");
    // No more than 20 faults, however many there are.
    let many: Vec<Vec<u32>> = (0..1000).map(|k| vec![k, k, k + 1]).collect();
    assert_eq!(refused(1001, &many).len(), 20);
}

#[test]
fn a_million_faces_connect_in_linear_time() {
    let (vertices, faces) = grid(1000, 1000, true, true);
    let start = std::time::Instant::now();
    let mesh = HalfEdgeMesh::new(vertices, &faces).unwrap();
    assert_eq!((mesh.euler(), mesh.edge_count()), (0, 2_000_000));
    // A second in a debug build on a busy machine; quadratic work would take hours.
    assert!(start.elapsed().as_secs() < 30, "{:?}", start.elapsed());
}
