//! What hangs together in a complex: orientation, components, boundaries.
//!
//! Every shard looks at its own edges; the sides of edges that several may see are compared at the end.

use super::merge::Merged;
use super::{CellComplex, NONE, Side};

/// The leaf edges around every face of a shard, one face after the other.
pub(super) struct Loops {
    pub(super) starts: Vec<u32>,
    pub(super) sides: Vec<Side>,
    /// Where each side starts.
    pub(super) corners: Vec<u32>,
    /// Which corner of its face that is, or [`NONE`] between corners; empty unless asked for.
    pub(super) own: Vec<u32>,
}

impl Loops {
    pub(super) fn of(merged: &Merged, shard: usize, corners: bool) -> Self {
        let grown = &merged.shards[shard];
        let mut loops = Self {
            starts: Vec::with_capacity(grown.faces.len() + 1),
            sides: Vec::with_capacity(grown.outlines.len()),
            corners: Vec::with_capacity(grown.outlines.len()),
            own: Vec::new(),
        };
        loops.starts.push(0);
        for (index, face) in grown.faces.iter().enumerate() {
            let end = grown.faces.get(index + 1).map_or(grown.outlines.len(), |next| next.outline as usize);
            for (corner, &side) in grown.outlines[face.outline as usize..end].iter().enumerate() {
                let before = loops.sides.len();
                merged.leaf_edges_in(shard + 1, side, &mut |side, corner| {
                    loops.sides.push(side);
                    loops.corners.push(corner);
                });
                if corners {
                    let own = |place: usize| if place == before { corner as u32 } else { NONE };
                    loops.own.extend((before..loops.sides.len()).map(own));
                }
            }
            loops.starts.push(loops.sides.len() as u32);
        }
        loops
    }

    pub(super) fn faces(&self) -> usize {
        self.starts.len() - 1
    }

    pub(super) fn range(&self, face: usize) -> std::ops::Range<usize> {
        self.starts[face] as usize..self.starts[face + 1] as usize
    }

    pub(super) fn corners_of(&self, face: usize) -> &[u32] {
        &self.corners[self.range(face)]
    }
}

/// What a shard finds of itself.
pub(super) struct Pieces {
    /// For every face the piece it belongs to, and whether it is turned round there. The first face of a piece is not.
    pub(super) faces: Vec<(u32, bool)>,
    count: u32,
    /// For every own vertex a piece that touches it.
    pub(super) touched: Vec<u32>,
    /// Pieces with a common vertex.
    unions: Vec<[u32; 2]>,
    /// Sides of edges that others may see, with their faces.
    sides: Vec<(Side, u32)>,
    /// Vertices of other parts, with pieces that touch them.
    vertices: Vec<(u32, u32)>,
    edges: u64,
    boundary: Vec<Side>,
    /// Wires that are points.
    points: Vec<u32>,
}

impl Pieces {
    /// Finds the pieces of a shard's faces that hang together through its own edges, and puts wires' leaves beside them.
    pub(super) fn of(merged: &Merged, shard: usize, loops: &Loops, wires: &[Side]) -> Self {
        let part = shard + 1;
        let store = &merged.stores[part];
        let (first, vertices) = (merged.edges.start(part), merged.vertices.start(part));
        let own = |side: Side| {
            (side.edge() as u32)
                .checked_sub(first)
                .map(|index| index as usize)
                .filter(|&index| index < store.edges.len() && !store.edges[index].shared)
        };
        // The two faces of every edge, with their directions; edges with more are no hinge.
        let mut hinges = vec![[NONE; 2]; store.edges.len()];
        let mut count = vec![0_u8; store.edges.len()];
        let mut pieces = Self {
            faces: vec![(NONE, false); loops.faces()],
            count: 0,
            touched: vec![NONE; store.vertices.len()],
            unions: Vec::new(),
            sides: Vec::new(),
            vertices: Vec::new(),
            edges: 0,
            boundary: Vec::new(),
            points: Vec::new(),
        };
        for face in 0..loops.faces() {
            for &side in &loops.sides[loops.range(face)] {
                let Some(edge) = own(side) else {
                    pieces.sides.push((side, face as u32));
                    continue;
                };
                if let Some(place) = hinges[edge].get_mut(count[edge] as usize) {
                    *place = (face as u32) << 1 | u32::from(side.backwards());
                }
                count[edge] = count[edge].saturating_add(1);
            }
        }
        pieces.edges = count.iter().filter(|&&count| count > 0).count() as u64;
        let alone = count.iter().enumerate().filter(|(_, count)| **count == 1);
        pieces.boundary = alone.map(|(edge, _)| Side::new(first + edge as u32, false)).collect();
        pieces.orient(loops, &|side| own(side).filter(|&edge| count[edge] == 2).map(|edge| hinges[edge]));
        for face in 0..loops.faces() {
            for &vertex in loops.corners_of(face) {
                pieces.touch(vertex, pieces.faces[face].0, vertices);
            }
        }
        for &side in wires {
            let mut ends = merged.vertices_of(side.edge() as u32);
            let (Some(start), arms) = (ends.next(), ends) else { continue };
            let piece = pieces.count;
            let before = pieces.edges;
            for end in arms {
                pieces.touch(end, piece, vertices);
                pieces.edges += 1;
            }
            if pieces.edges > before {
                pieces.touch(start, piece, vertices);
                pieces.count += 1;
            } else {
                pieces.points.push(start);
            }
        }
        pieces
    }

    /// Turns faces so that neighbours run along their common edge in opposite directions, as far as that is possible.
    fn orient(&mut self, loops: &Loops, hinge: &dyn Fn(Side) -> Option<[u32; 2]>) {
        let mut stack = Vec::new();
        for seed in 0..loops.faces() {
            if self.faces[seed].0 != NONE {
                continue;
            }
            self.faces[seed] = (self.count, false);
            stack.push(seed);
            while let Some(face) = stack.pop() {
                let turned = self.faces[face].1;
                for &side in &loops.sides[loops.range(face)] {
                    let Some([first, second]) = hinge(side) else { continue };
                    let other = if first >> 1 == face as u32 { second } else { first };
                    let (neighbour, backwards) = ((other >> 1) as usize, other & 1 == 1);
                    if self.faces[neighbour].0 == NONE {
                        self.faces[neighbour] = (self.count, turned != (backwards == side.backwards()));
                        stack.push(neighbour);
                    }
                }
            }
            self.count += 1;
        }
    }

    #[inline]
    fn touch(&mut self, vertex: u32, piece: u32, first: u32) {
        match vertex.checked_sub(first).and_then(|index| self.touched.get_mut(index as usize)) {
            Some(place) if *place == NONE => *place = piece,
            Some(place) if *place == piece => {}
            Some(place) => self.unions.push([*place, piece]),
            None => self.vertices.push((vertex, piece)),
        }
    }
}

/// Sets with parity: whether an element is turned round as seen from the first of its set.
struct Sets(Vec<(u32, bool)>);

impl Sets {
    fn find(&mut self, element: u32) -> (u32, bool) {
        let (mut path, mut top) = (Vec::new(), element);
        while self.0[top as usize].0 != top {
            path.push(top);
            top = self.0[top as usize].0;
        }
        // Shorten the way, so that the next is quick.
        let mut turned = false;
        for &below in path.iter().rev() {
            turned ^= self.0[below as usize].1;
            self.0[below as usize] = (top, turned);
        }
        (top, turned)
    }

    /// Makes two sets one, with the second element turned against the first or not.
    fn unite(&mut self, a: u32, b: u32, turned: bool) {
        let ((p, s), (q, t)) = (self.find(a), self.find(b));
        if p != q {
            self.0[p.max(q) as usize] = (p.min(q), (s != t) != turned);
        }
    }
}

/// What the shards are together.
pub(super) struct Tally {
    pub(super) complex: CellComplex,
    /// For every shard and piece, whether its faces are turned round.
    pub(super) turned: Vec<Vec<bool>>,
    /// For every part and vertex, whether it is used.
    pub(super) used: Vec<Vec<bool>>,
}

impl Tally {
    /// Cost: linear in what the shards have in common.
    pub(super) fn new(merged: &Merged, loops: &[Loops], mut shards: Vec<Pieces>) -> Self {
        let mut first = vec![0];
        shards.iter().for_each(|shard| first.push(first[first.len() - 1] + shard.count));
        let all = first[shards.len()];
        // Orientation first: pieces that touch in a vertex alone do not turn each other.
        let mut oriented = Sets((0..all).map(|piece| (piece, false)).collect());
        let mut sides: Vec<(u32, u32, u32, bool)> = Vec::new();
        for (shard, pieces) in shards.iter_mut().enumerate() {
            let list = std::mem::take(&mut pieces.sides);
            sides.extend(list.into_iter().map(|(side, face)| (side.edge() as u32, shard as u32, face, side.backwards())));
        }
        sides.sort_unstable();
        let mut edges: u64 = shards.iter().map(|shard| shard.edges).sum();
        let mut boundary: Vec<Side> = shards.iter().flat_map(|shard| shard.boundary.iter().copied()).collect();
        for group in sides.chunk_by(|a, b| a.0 == b.0) {
            edges += 1;
            match *group {
                [(edge, ..)] => boundary.push(Side::new(edge, false)),
                [a, b] => {
                    let place = |(_, shard, face, _): (u32, u32, u32, bool)| {
                        let (piece, turned) = shards[shard as usize].faces[face as usize];
                        (first[shard as usize] + piece, turned)
                    };
                    let ((p, s), (q, t)) = (place(a), place(b));
                    oriented.unite(p, q, (s != t) != (a.3 == b.3));
                }
                _ => {}
            }
        }
        let turned = shards
            .iter()
            .zip(&first)
            .map(|(shard, &first)| (first..first + shard.count).map(|piece| oriented.find(piece).1).collect())
            .collect();
        let mut sets = oriented;
        // Edges of three faces and more connect too.
        for group in sides.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() > 2) {
            let piece = |k: usize| first[group[k].1 as usize] + shards[group[k].1 as usize].faces[group[k].2 as usize].0;
            (1..group.len()).for_each(|k| sets.unite(piece(0), piece(k), false));
        }
        let mut touched: Vec<Vec<u32>> = vec![vec![NONE; merged.stores[0].vertices.len()]];
        for (shard, &first) in shards.iter_mut().zip(&first) {
            shard.unions.iter().for_each(|&[a, b]| sets.unite(first + a, first + b, false));
            touched.push(
                std::mem::take(&mut shard.touched).into_iter().map(|piece| if piece == NONE { NONE } else { first + piece }).collect(),
            );
        }
        for (shard, &first) in shards.iter().zip(&first) {
            for &(vertex, piece) in &shard.vertices {
                let (part, index) = merged.vertices.find(vertex);
                match &mut touched[part][index] {
                    place if *place == NONE => *place = first + piece,
                    place => sets.unite(*place, first + piece, false),
                }
            }
        }
        let mut used: Vec<Vec<bool>> = touched.iter().map(|list| list.iter().map(|&piece| piece != NONE).collect()).collect();
        for &vertex in shards.iter().flat_map(|shard| &shard.points) {
            let (part, index) = merged.vertices.find(vertex);
            used[part][index] = true;
        }
        let vertices = used.iter().flatten().filter(|&&used| used).count() as u64;
        let components = (0..all).filter(|&piece| sets.find(piece).0 == piece).count() as u64;
        let faces = loops.iter().map(|loops| loops.faces() as u64).sum::<u64>();
        let ends: Vec<[u32; 2]> = boundary.iter().map(|&side| merged.ends(side)).collect();
        let complex = CellComplex {
            faces,
            edges,
            vertices,
            components,
            boundary_edges: boundary.len() as u64,
            boundary_loops: curves(ends),
            euler: vertices as i64 - edges as i64 + faces as i64,
            ..CellComplex::default()
        };
        Self { complex, turned, used }
    }
}

/// Connected pieces of a graph.
fn curves(edges: Vec<[u32; 2]>) -> u64 {
    let mut vertices: Vec<u32> = edges.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let mut sets = Sets((0..vertices.len() as u32).map(|vertex| (vertex, false)).collect());
    let place = |vertex: u32| vertices.binary_search(&vertex).unwrap_or(0) as u32;
    edges.into_iter().for_each(|[a, b]| sets.unite(place(a), place(b), false));
    (0..vertices.len() as u32).filter(|&vertex| sets.find(vertex).0 == vertex).count() as u64
}

/// Counts of the complex that triangles make, which use all of `vertices`.
pub(super) fn count_complex(vertices: usize, triangles: &[[u32; 3]]) -> CellComplex {
    let mut edges: Vec<[u32; 2]> = Vec::with_capacity(3 * triangles.len());
    for &[a, b, c] in triangles {
        edges.extend([[a, b], [b, c], [c, a]].map(|[p, q]| [p.min(q), p.max(q)]));
    }
    edges.sort_unstable();
    let mut boundary = Vec::new();
    let mut all = Vec::new();
    for run in edges.chunk_by(|a, b| a == b) {
        all.push(run[0]);
        if run.len() == 1 {
            boundary.push(run[0]);
        }
    }
    let count = all.len();
    CellComplex {
        faces: triangles.len() as u64,
        edges: count as u64,
        vertices: vertices as u64,
        components: curves(all),
        boundary_edges: boundary.len() as u64,
        boundary_loops: curves(boundary),
        euler: vertices as i64 - count as i64 + triangles.len() as i64,
        ..CellComplex::default()
    }
}
