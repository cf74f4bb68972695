//! Subdivision surfaces against OpenSubdiv (Debian's libosd-dev): limit points and normals on random cages with creases,
//! corners and boundaries. Skipped with a message where it is not installed.

use crate::cages;
use crate::cages::{attractor, cube, evaluated, grid, inset_torus, patches, tetrahedron, torus};
use glam::DVec3;
use lacuna_kernel::attractor::{refine, refine_with_normals};
use lacuna_kernel::budget::Budget;
use lacuna_kernel::model::{BoundaryRule, Corner, Crease, Scheme, Subdivision};
use lacuna_kernel::tolerance::Tolerance;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::OnceLock;

/// The compiled peer, or why there is none: compiled once, whichever test asks first.
fn peer() -> Result<PathBuf, String> {
    static PEER: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    PEER.get_or_init(compiled).clone()
}

fn compiled() -> Result<PathBuf, String> {
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/opensubdiv/limits.cpp");
    let binary = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("opensubdiv-limits");
    let made = Command::new("g++").args(["-O2", "-o"]).arg(&binary).arg(source).arg("-losdCPU").output();
    match made {
        Err(error) => Err(format!("no compiler: {error}")),
        Ok(output) if !output.status.success() => Err("OpenSubdiv is not installed (apt-get install libosd-dev)".into()),
        Ok(_) => Ok(binary),
    }
}

/// What the peer says of a surface.
fn ask(peer: &PathBuf, surface: &Subdivision, level: usize, arguments: &[&str]) -> String {
    let mut text = String::new();
    let scheme = if surface.scheme == Scheme::Loop { "loop" } else { "catmark" };
    let _ = writeln!(text, "{scheme} {} {level}", i32::from(surface.boundary == BoundaryRule::SharpCorners));
    let _ = writeln!(text, "{}", surface.vertices.len());
    surface.vertices.iter().for_each(|p| writeln!(text, "{:e} {:e} {:e}", p.x, p.y, p.z).expect("text"));
    let _ = writeln!(text, "{}", surface.faces.len());
    for face in &surface.faces {
        let _ = write!(text, "{}", face.len());
        face.iter().for_each(|v| write!(text, " {v}").expect("text"));
        text.push('\n');
    }
    let _ = writeln!(text, "{}", surface.creases.len());
    surface.creases.iter().for_each(|c| writeln!(text, "{} {} {}", c.edge[0], c.edge[1], c.sharpness.min(10.0)).expect("text"));
    let _ = writeln!(text, "{}", surface.corners.len());
    surface.corners.iter().for_each(|c| writeln!(text, "{} {}", c.vertex, c.sharpness.min(10.0)).expect("text"));
    let mut child = Command::new(peer).args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("runs");
    let mut stdin = child.stdin.take().expect("piped");
    let writer = std::thread::spawn(move || stdin.write_all(text.as_bytes()));
    let output = child.wait_with_output().expect("ends");
    writer.join().expect("no panic").expect("written");
    assert!(output.status.success());
    String::from_utf8(output.stdout).expect("text")
}

/// The peer's limit points and normals at a level.
fn limits(peer: &PathBuf, surface: &Subdivision, level: usize) -> Vec<[DVec3; 2]> {
    let text = ask(peer, surface, level, &[]);
    let line = |line: &str| -> [DVec3; 2] {
        let numbers: Vec<f64> = line.split_whitespace().map(|word| word.parse().expect("a number")).collect();
        [0, 3].map(|k| DVec3::new(numbers[k], numbers[k + 1], numbers[k + 2]))
    };
    text.lines().map(line).collect()
}

/// A small generator (splitmix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound as u64) as usize
    }

    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Points of one set that are farther than `allowed` from the other.
fn unmatched(a: &[DVec3], b: &[DVec3], allowed: f64) -> usize {
    a.iter().filter(|p| b.iter().all(|q| p.distance(*q) > allowed)).count()
}

/// Vertices at which one edge ends that is sharp for ever. There OpenSubdiv takes the limit mask of smooth vertices,
/// which is not the scheme's: its limit points move from level to level, towards ours.
fn darts(surface: &Subdivision) -> usize {
    let ends = |vertex: u32| surface.creases.iter().filter(|c| c.sharpness >= 10.0 && c.edge.contains(&vertex)).count();
    (0..surface.vertices.len() as u32).filter(|&vertex| ends(vertex) == 1).count()
}

/// The surface with sharpness on some of its edges and vertices; vertices are moved a little.
fn sharpened(mut surface: Subdivision, random: &mut Random, share: usize) -> Subdivision {
    // Fractions that single precision holds exactly, since the peer's sharpness has it.
    const SHARPNESS: [f64; 6] = [0.5, 0.25, 1.0, 2.0, 2.75, f64::INFINITY];
    surface.vertices.iter_mut().for_each(|v| *v += 0.2 * DVec3::new(random.unit(), random.unit(), random.unit()));
    let mut edges = std::collections::BTreeSet::new();
    for face in &surface.faces {
        for k in 0..face.len() {
            let (a, b) = (face[k], face[(k + 1) % face.len()]);
            edges.insert((a.min(b), a.max(b)));
        }
    }
    for (a, b) in edges {
        if random.below(100) < share {
            surface.creases.push(Crease { edge: [a, b], sharpness: SHARPNESS[random.below(6)] });
        }
    }
    for vertex in 0..surface.vertices.len() as u32 {
        if random.below(100) < share / 3 {
            surface.corners.push(Corner { vertex, sharpness: SHARPNESS[random.below(6)] });
        }
    }
    if random.below(2) == 0 {
        surface.boundary = BoundaryRule::SharpCorners;
    }
    surface
}

/// A random surface and its Euler number.
fn surface(round: usize, scheme: Scheme, random: &mut Random) -> (Subdivision, i64) {
    let (cage, euler) = match round / 2 % 5 {
        0 => (cube(scheme), 2),
        1 => (grid(scheme, 2, 3, |x, y| x * y), 1),
        2 => (tetrahedron(scheme), 2),
        3 => (torus(scheme, 4, 3), 0),
        _ if scheme == Scheme::Loop => (grid(scheme, 1, 1, |x, _| x), 1),
        _ => (inset_torus(3, 4, 5), 0),
    };
    (sharpened(cage, random, [0, 10, 30, 60][round / 10 % 4]), euler)
}

#[test]
fn creases_and_corners_leave_no_crack() {
    let mut random = Random(11);
    for round in 0..40 {
        let scheme = if round % 2 == 0 { Scheme::CatmullClark } else { Scheme::Loop };
        let (surface, euler) = surface(round, scheme, &mut random);
        let scale = surface.vertices.iter().map(|v| v.length()).fold(0.0, f64::max);
        let tessellation = evaluated(&attractor(surface.clone()), 0.1 * scale);
        let complex = tessellation.complex.as_ref().unwrap_or_else(|| panic!("round {round}: no B-rep: {surface:?}"));
        assert_eq!(complex.euler, euler, "round {round}: {surface:?}");
        assert_eq!(complex.boundary_loops, u64::from(euler == 1), "round {round}: {surface:?}");
        assert_eq!(complex.components, 1, "round {round}: {surface:?}");
    }
}

#[test]
fn limit_points_are_opensubdivs() {
    let peer = match peer() {
        Ok(peer) => peer,
        Err(reason) => return eprintln!("skipped: {reason}"),
    };
    let mut random = Random(7);
    let mut compared = 0;
    for round in 0..60 {
        let scheme = if round % 2 == 0 { Scheme::CatmullClark } else { Scheme::Loop };
        let surface = surface(round, scheme, &mut random).0;
        let scale = surface.vertices.iter().map(|v| v.length()).fold(0.0, f64::max);
        let level = 4;
        let theirs: Vec<DVec3> = limits(&peer, &surface, level).into_iter().map(|[point, _]| point).collect();
        let ours: Vec<DVec3> = patches(&attractor(surface.clone()), level).into_iter().flatten().collect();
        let (allowed, darts) = (1e-6 * scale, darts(&surface));
        let missing = [unmatched(&ours, &theirs, allowed), unmatched(&theirs, &ours, allowed)];
        assert!(missing[1] <= darts, "round {round}: {missing:?} points, {darts} darts: {surface:?}");
        // Ours are listed with every patch around them.
        assert!(darts > 0 || missing[0] == 0, "round {round}: {missing:?} points: {surface:?}");
        compared += theirs.len();
    }
    eprintln!("{compared} limit points compared");
}

/// Vertices that stay, for which OpenSubdiv takes the plane of two neighbouring edges, whatever the faces do; darts; and
/// vertices of a smooth boundary with one face, which have no tangent plane.
fn corners(surface: &Subdivision) -> usize {
    let mut sharp = vec![0; surface.vertices.len()];
    let mut edges = std::collections::BTreeMap::new();
    for face in &surface.faces {
        for k in 0..face.len() {
            let (a, b) = (face[k], face[(k + 1) % face.len()]);
            *edges.entry((a.min(b), a.max(b))).or_insert(0) += 1;
        }
    }
    edges.retain(|&(a, b), count| {
        *count == 1 || surface.creases.iter().any(|c| c.sharpness >= 10.0 && c.edge.contains(&a) && c.edge.contains(&b))
    });
    edges.keys().for_each(|&(a, b)| [a, b].iter().for_each(|&v| sharp[v as usize] += 1));
    surface.corners.iter().filter(|c| c.sharpness >= 10.0).for_each(|c| sharp[c.vertex as usize] = 3);
    let faces = |vertex: u32| surface.faces.iter().filter(|face| face.contains(&vertex)).count();
    sharp.iter().enumerate().filter(|&(vertex, &count)| count == 1 || count > 2 || (count == 2 && faces(vertex as u32) == 1)).count()
}

#[test]
fn limit_normals_are_opensubdivs() {
    let peer = match peer() {
        Ok(peer) => peer,
        Err(reason) => return eprintln!("skipped: {reason}"),
    };
    let mut random = Random(13);
    let (mut compared, mut astray, mut without, mut surfaces) = (0, 0, 0, 0);
    for round in 0..60 {
        let scheme = if round % 2 == 0 { Scheme::CatmullClark } else { Scheme::Loop };
        let surface = surface(round, scheme, &mut random).0;
        let attractor = attractor(surface.clone());
        let planes = attractor.tangent_planes().unwrap_or_else(|reason| panic!("round {round}: {reason}: {surface:?}"));
        let scale = surface.vertices.iter().map(|v| v.length()).fold(0.0, f64::max);
        let drawn =
            refine_with_normals(&attractor, &planes, Tolerance::new(0.02 * scale).expect("positive"), &Budget::default()).expect("refines");
        let normals = drawn.normals.as_ref().expect("asked for");
        // All normals of a vertex.
        let mut own: Vec<Vec<DVec3>> = vec![Vec::new(); drawn.vertices.len()];
        for (triangle, corners) in drawn.triangles.iter().zip(&normals.triangles) {
            triangle.iter().zip(corners).for_each(|(&vertex, &normal)| own[vertex as usize].push(normals.vectors[normal as usize]));
        }
        let (mut found, mut off) = (0, 0);
        for [point, normal] in limits(&peer, &surface, 4) {
            let Some(vertex) = drawn.vertices.iter().position(|vertex| vertex.distance(point) < 1e-7 * scale) else { continue };
            // Where its tangents are parallel the peer has no normal: that proves nothing.
            if !normal.is_finite() {
                without += 1;
                continue;
            }
            found += 1;
            off += usize::from(!own[vertex].iter().any(|own| own.distance(normal) <= 1e-6));
        }
        assert!(off <= corners(&surface), "round {round}: {off} of {found} normals, {} corners: {surface:?}", corners(&surface));
        (compared, astray, surfaces) = (compared + found, astray + off, surfaces + 1);
    }
    assert!(surfaces >= 20, "{surfaces} surfaces have normals");
    assert!(without < compared / 100 && compared > 10_000, "{without} without, {compared} compared");
    eprintln!("{compared} limit normals compared on {surfaces} surfaces, {astray} astray at corners, {without} unknown to the peer");
}

#[test]
fn a_crease_has_one_normal_for_each_side() {
    // Two squares, folded along an edge that is sharp: flat sides in the planes of the squares.
    let mut folded = grid(Scheme::CatmullClark, 4, 2, |x, _| (x - 2.0).abs());
    folded.boundary = BoundaryRule::SharpCorners;
    folded.creases.extend([[6, 7], [7, 8]].map(|edge| Crease { edge, sharpness: f64::INFINITY }));
    // One side is curved, so that it is finer.
    folded.vertices[13].z += 0.7;
    let attractor = attractor(folded);
    let planes = attractor.tangent_planes().expect("smooth but for the crease");
    let drawn = refine_with_normals(&attractor, &planes, Tolerance::new(0.01).expect("positive"), &Budget::default()).expect("refines");
    let normals = drawn.normals.expect("asked for");
    assert_eq!(normals.degenerate, 0);
    let flat = DVec3::new(1.0, 0.0, 1.0).normalize();
    let (mut seen, mut hanging) = (0, 0);
    for (triangle, corners) in drawn.triangles.iter().zip(&normals.triangles) {
        let at = triangle.map(|vertex| drawn.vertices[vertex as usize]);
        if at.iter().all(|p| p.x < 2.0 + 1e-12) {
            for (p, &normal) in at.iter().zip(corners) {
                assert!(normals.vectors[normal as usize].cross(flat).length() < 1e-12, "{p}: {}", normals.vectors[normal as usize]);
                hanging += usize::from(p.x > 2.0 - 1e-12);
            }
            seen += 1;
        }
    }
    assert!(seen >= 4 && hanging > 10, "{seen} {hanging}");
}

/// CPU seconds of this process so far, in hundredths; `None` where there is no /proc.
fn cpu_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    let fields: Vec<&str> = text.rsplit(')').next()?.split_whitespace().collect();
    Some((fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?) / 100.0)
}

/// Level 6 of a cage of 468 quads: the tolerance is the one at which as many faces are drawn. Alone in its process the CPU
/// time is this evaluation's: `cargo test -p lacuna-kernel --test kernel subdivision_peer:: -- --ignored --nocapture --test-threads 1`.
#[test]
#[ignore = "a measurement, to be run alone"]
fn speed_beside_opensubdiv() {
    let surface = cages::head();
    let attractor = attractor(surface.clone());
    let budget = Budget::default();
    let evaluate = || {
        let (clock, cpu) = (std::time::Instant::now(), cpu_seconds());
        let drawn = refine(&attractor, Tolerance::new(5e-4).expect("positive"), &budget).expect("refines");
        let cpu = cpu.zip(cpu_seconds()).map_or(f64::NAN, |(before, after)| after - before);
        (cpu, clock.elapsed().as_secs_f64(), drawn.vertices.len())
    };
    let peer = peer();
    for _ in 0..3 {
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let (cpu, wall, vertices) = pool.install(evaluate);
            eprintln!(
                "{threads} threads: {cpu:.2} s CPU, {wall:.2} s, {vertices} vertices, {:.3} us CPU a vertex",
                1e6 * cpu / vertices as f64
            );
        }
        match &peer {
            Ok(peer) => {
                let text = ask(peer, &surface, 6, &["time"]);
                let numbers: Vec<f64> = text.split_whitespace().map(|word| word.parse().expect("a number")).collect();
                eprintln!(
                    "OpenSubdiv: {} s CPU, {} vertices, {:.3} us CPU a vertex",
                    numbers[0],
                    numbers[1],
                    1e6 * numbers[0] / numbers[1]
                );
            }
            Err(reason) => eprintln!("skipped: {reason}"),
        }
    }
}
