//! Levels of systems as solids: closed forms of volume, area and genus, the exactness of what is joined, refusals.

use glam::{DMat3, DVec3};
use lacuna_kernel::budget::{Budget, CancelToken, Limits, StopReason};
use lacuna_kernel::levels::{LevelError, LevelPrimitive, SolidLevel, predict, solid_level};
use lacuna_kernel::measure::{AxisBox, Interval};
use lacuna_kernel::model::{AffineMap, Ifs, Primitive};

fn scaled(scale: f64, translation: DVec3) -> AffineMap {
    AffineMap { linear: DMat3::from_diagonal(DVec3::splat(scale)), translation }
}

fn cube(low: DVec3, side: f64) -> Primitive {
    let corner = |code: usize| low + side * DVec3::new((code & 1) as f64, (code >> 1 & 1) as f64, (code >> 2 & 1) as f64);
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    Primitive::Solid { vertices: (0..8).map(corner).collect(), faces: faces.map(|face| face.to_vec()).to_vec() }
}

/// Maps onto the cells of the division of a cube by `parts` that `keep` keeps.
fn cells(size: f64, parts: u32, keep: impl Fn([u32; 3]) -> bool) -> Vec<AffineMap> {
    let all = (0..parts.pow(3)).map(|k| [k % parts, k / parts % parts, k / parts / parts]);
    let step = 1.0 / f64::from(parts);
    all.filter(|cell| keep(*cell)).map(|cell| scaled(step, size * step * DVec3::from(cell.map(f64::from)))).collect()
}

fn menger(size: f64) -> Ifs {
    let maps = cells(size, 3, |cell| cell.iter().filter(|&&x| x == 1).count() < 2);
    Ifs { maps, primitive: Some(cube(DVec3::ZERO, size)), graph: None }
}

fn nowhere() -> AxisBox {
    AxisBox { low: [Interval { low: 0.0, high: 0.0 }; 3], high: [Interval { low: 0.0, high: 0.0 }; 3] }
}

fn solid(ifs: &Ifs, level: u32) -> SolidLevel {
    solid_level(ifs, &nowhere(), level, &Budget::default()).unwrap()
}

#[track_caller]
fn assert_in(interval: Interval, exact: f64) {
    assert!(interval.low <= exact && exact <= interval.high, "{exact} is not in [{}, {}]", interval.low, interval.high);
    assert!(interval.width() <= 1e-10 * exact, "[{}, {}] is wide", interval.low, interval.high);
}

/// The genus of the sponge's surface by counting: 1 less the number of corners, less edges, plus faces, less cubes of the cells with fewer than two middle
/// digits at every level. In doubled coordinates a cell of the complex is a point, the parity of which tells its dimension.
fn counted_genus(level: u32) -> i64 {
    let mut cubes = vec![[0_i64; 3]];
    for _ in 0..level {
        let digits = || (0..27).map(|k| [k % 3, k / 3 % 3, k / 9]).filter(|cell| cell.iter().filter(|x| **x == 1).count() < 2);
        cubes = cubes.iter().flat_map(|cube| digits().map(|digit| std::array::from_fn(|axis| 3 * cube[axis] + digit[axis]))).collect();
    }
    let around =
        cubes.iter().flat_map(|cube| (0..27).map(|k| [k % 3, k / 3 % 3, k / 9]).map(|d| [0, 1, 2].map(|axis| 2 * cube[axis] + d[axis])));
    let complex: std::collections::HashSet<[i64; 3]> = around.collect();
    1 - complex.iter().map(|cell| if cell.iter().filter(|x| **x % 2 != 0).count() % 2 == 0 { 1 } else { -1 }).sum::<i64>()
}

#[test]
fn menger_sponges() {
    for (level, genus) in [(0, 0), (1, 5), (2, 81), (3, 1409), (4, 26433)] {
        assert_eq!(counted_genus(level), genus);
        let found = solid(&menger(1.0), level);
        let n = level as i32;
        assert_eq!(found.solid.topology().genus, genus, "level {level}");
        assert_eq!((found.solid.topology().components, found.solid.topology().cavities), (1, 0));
        assert_eq!((found.contacts, found.doubled_vertices), (0, 0));
        assert_in(found.volume, (20.0_f64 / 27.0).powi(n));
        assert_in(found.area, 2.0 * (20.0_f64 / 9.0).powi(n) + 4.0 * (8.0_f64 / 9.0).powi(n));
        assert_eq!(found.copies, 20.0_f64.powi(n));
        assert!(found.moved_mm < 1.2e-7, "{}", found.moved_mm);
        // Two triangles for each of the small faces: the area counts them.
        let faces = (2.0 * 20.0_f64.powi(n) * 1.0 + 4.0 * 8.0_f64.powi(n)).round() as u64;
        assert_eq!(found.solid.topology().triangles, 2 * faces);
    }
}

#[test]
fn thirds_that_are_written_in_decimals_join() {
    // As in documents: 90 / 3 is exact, 0.3333333333333333 is not.
    let mut ifs = menger(90.0);
    for map in &mut ifs.maps {
        map.linear = DMat3::from_diagonal(DVec3::splat(0.3333333333333333));
        map.translation = (map.translation / 30.0).round() * 30.0;
    }
    let found = solid(&ifs, 2);
    assert_eq!(found.solid.topology().genus, 81);
    assert!(found.moved_mm < 1e-5);
    // With fewer digits the cubes are apart: nothing is welded.
    for map in &mut ifs.maps {
        map.linear = DMat3::from_diagonal(DVec3::splat(0.333));
    }
    assert_eq!(solid(&ifs, 1).solid.topology().components, 20);
}

#[test]
fn the_box_stands_for_a_missing_primitive() {
    let ifs = Ifs { primitive: None, ..menger(90.0) };
    let near = |x: f64| Interval { low: x - 1e-9, high: x + 1e-9 };
    let bounds = AxisBox { low: [near(0.0); 3], high: [near(90.0); 3] };
    let found = solid_level(&ifs, &bounds, 2, &Budget::default()).unwrap();
    assert_eq!(found.primitive, LevelPrimitive::Box);
    assert_in(found.volume, 90.0_f64.powi(3) * (20.0_f64 / 27.0).powi(2));
    let flat = solid_level(&ifs, &nowhere(), 2, &Budget::default());
    assert!(matches!(flat, Err(LevelError::NoPrimitive { .. })));
}

fn tetrahedron() -> Ifs {
    // Edge 100; irrational coordinates.
    let corners = [
        DVec3::ZERO,
        DVec3::new(100.0, 0.0, 0.0),
        DVec3::new(50.0, 50.0 * 3.0_f64.sqrt(), 0.0),
        DVec3::new(50.0, 50.0 / 3.0_f64.sqrt(), 100.0 * (2.0_f64 / 3.0).sqrt()),
    ];
    let maps = corners.map(|corner| scaled(0.5, 0.5 * corner)).to_vec();
    let faces = vec![vec![0, 2, 1], vec![0, 1, 3], vec![1, 2, 3], vec![0, 3, 2]];
    Ifs { maps, primitive: Some(Primitive::Solid { vertices: corners.to_vec(), faces }), graph: None }
}

#[test]
fn tetrahedra_that_touch_at_corners_stay_apart() {
    let whole = 100.0_f64.powi(3) / (6.0 * 2.0_f64.sqrt());
    for level in 0..5 {
        let found = solid(&tetrahedron(), level);
        let count = 4_u64.pow(level);
        assert_eq!(found.solid.topology().components, count);
        assert_eq!(found.solid.topology().triangles, 4 * count);
        // Every corner but the four outermost ones belongs to two tetrahedra.
        assert_eq!(found.doubled_vertices, 2 * count - 2);
        assert_in(found.volume, whole * 0.5_f64.powi(level as i32));
        assert_in(found.area, 3.0_f64.sqrt() * 1e4);
        if level > 0 {
            // Nine pairs of triangles at each common corner.
            assert_eq!(found.contacts, 9 * (2 * count - 2));
        }
    }
}

#[test]
fn eight_cubes_are_a_cube() {
    // All faces within cancel; turned and mirrored copies as well.
    let mut maps = cells(2.0, 2, |_| true);
    for (index, map) in maps.iter_mut().enumerate() {
        let turn = if index % 2 == 0 {
            DMat3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::Z)
        } else {
            DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0))
        };
        let linear = 0.5 * turn;
        // The copy's lower corner stays where it was.
        let low = (0..3).fold(DVec3::ZERO, |low, column| low + (2.0 * linear.col(column)).min(DVec3::ZERO));
        *map = AffineMap { linear, translation: map.translation - low };
    }
    let ifs = Ifs { maps, primitive: Some(cube(DVec3::ZERO, 2.0)), graph: None };
    for level in 1..4 {
        let found = solid(&ifs, level);
        assert_eq!(found.solid.topology().euler, 2);
        assert_in(found.volume, 8.0);
        assert_in(found.area, 24.0);
    }
}

#[test]
fn cubes_along_an_edge_are_parted() {
    // Two cubes along an edge, and as many of them.
    let maps = cells(1.0, 2, |cell| cell == [0, 0, 0] || cell == [1, 1, 0]);
    let ifs = Ifs { maps, primitive: Some(cube(DVec3::ZERO, 1.0)), graph: None };
    let found = solid(&ifs, 1);
    assert_eq!(found.solid.topology().components, 2);
    assert_eq!(found.doubled_vertices, 2);
    assert!(found.contacts > 0);
    assert_in(found.volume, 0.25);
    assert_in(solid(&ifs, 3).volume, 4.0_f64.powi(-3));
}

#[test]
fn graphs_follow_their_arrows() {
    // Two half cubes side by side, each followed by itself alone: two rows of one cell.
    let maps = vec![scaled(0.5, DVec3::ZERO), scaled(0.5, 0.5 * DVec3::X)];
    let ifs = Ifs { maps, primitive: Some(cube(DVec3::ZERO, 1.0)), graph: Some(vec![vec![0], vec![1]]) };
    let found = solid(&ifs, 2);
    assert_eq!((found.copies, found.solid.topology().components), (2.0, 2));
    assert_in(found.volume, 2.0 / 64.0);
}

#[test]
fn overlaps_and_open_primitives_are_refused() {
    let refusal = |ifs: &Ifs, level| solid_level(ifs, &nowhere(), level, &Budget::default()).unwrap_err();
    let unit = || Some(cube(DVec3::ZERO, 1.0));
    let of = |maps| Ifs { maps, primitive: unit(), graph: None };
    assert_eq!(refusal(&of(vec![scaled(0.6, DVec3::ZERO), scaled(0.6, 0.4 * DVec3::X)]), 1), LevelError::Overlaps { first: 0, second: 1 });
    assert_eq!(refusal(&of(vec![scaled(0.5, DVec3::ZERO), scaled(0.5, DVec3::X)]), 1), LevelError::Leaves { map: 1 });
    let flat = AffineMap { linear: DMat3::from_diagonal(DVec3::new(0.5, 0.5, 0.0)), translation: DVec3::ZERO };
    assert_eq!(refusal(&of(vec![flat]), 1), LevelError::Flattens { map: 0 });
    let turned = AffineMap { linear: DMat3::from_rotation_z(1.0) * 0.5, translation: DVec3::splat(0.5) };
    assert_eq!(refusal(&of(vec![turned]), 1), LevelError::NoLattice { map: 0 });
    // A half and two quarters beside it: faces touch in part.
    let mixed = vec![scaled(0.5, DVec3::ZERO), scaled(0.25, 0.5 * DVec3::X)];
    assert!(matches!(refusal(&of(mixed), 1), LevelError::PartialFaces { .. }));
    let Some(Primitive::Solid { vertices, mut faces }) = unit() else { panic!() };
    faces.pop();
    let open = Ifs { primitive: Some(Primitive::Solid { vertices, faces }), ..of(vec![scaled(0.5, DVec3::ZERO)]) };
    assert!(matches!(refusal(&open, 1), LevelError::OpenPrimitive(_)));
    let points = Ifs { primitive: Some(Primitive::Points(vec![DVec3::ZERO])), ..of(vec![scaled(0.5, DVec3::ZERO)]) };
    assert!(matches!(refusal(&points, 1), LevelError::NoPrimitive { .. }));
}

#[test]
fn limits_name_the_level_that_passes() {
    let at_most = |triangles, memory_bytes| Budget { limits: Limits { triangles, memory_bytes, ..Limits::default() }, ..Budget::default() };
    for (triangles, passes) in [(5_000_000, 4), (500_000, 3), (3_000, 2)] {
        match solid_level(&menger(1.0), &nowhere(), 8, &at_most(triangles, 4 << 30)).unwrap_err() {
            error @ LevelError::Triangles { passes: found, .. } => {
                assert_eq!(found, passes);
                assert_eq!(error.limit().unwrap().remedy, Some(("level", f64::from(passes))));
            }
            other => panic!("{other:?}"),
        }
        // That level does pass, and the next does not.
        assert!(solid_level(&menger(1.0), &nowhere(), passes, &at_most(triangles, 4 << 30)).is_ok());
        assert!(solid_level(&menger(1.0), &nowhere(), passes + 1, &at_most(triangles, 4 << 30)).is_err());
    }
    let held = solid_level(&menger(1.0), &nowhere(), 5, &at_most(u64::MAX, 1 << 20));
    assert!(matches!(held, Err(LevelError::Memory { passes: 2, .. })), "{held:?}");
    let fine = solid_level(&menger(1.0), &nowhere(), 60, &Budget::default());
    assert!(matches!(fine, Err(LevelError::TooFine { passes, .. }) if passes > 20), "{fine:?}");
    let exact = predict(&menger(1.0), &nowhere(), 2, &Budget::default()).unwrap();
    assert_eq!(exact.triangles, 2.0 * (2.0 * 400.0 + 4.0 * 64.0));
    let far = predict(&menger(1.0), &nowhere(), 6, &Budget::default()).unwrap();
    let counted = 2.0 * (2.0 * 20.0_f64.powi(6) + 4.0 * 8.0_f64.powi(6));
    assert!((0.5..2.0).contains(&(far.triangles / counted)), "{far:?}");
}

#[test]
fn a_stopped_level_ends() {
    let cancel = CancelToken::new();
    cancel.fire(StopReason::Cancelled);
    let stopped = solid_level(&menger(1.0), &nowhere(), 3, &Budget { cancel, ..Budget::default() });
    assert!(matches!(stopped, Err(LevelError::Stopped(_))));
}
