//! Parts of a shape that are alike but for where they are, as those of dusts and of plates full of pieces: one of each kind is thickened, and its surface put where the others are.
//!
//! Two figures belong to one part where what stands for their dilations may meet, after all rounding and mending. So no surface depends on what another part has, and none of two parts meet. Let part B have the figures of A, each moved by t but for e at most: then |d_B(x + t) - d_A(x)| <= e, and a surface of A between
//! d = s and d = outer is one of B, moved by t, between s - e and outer + e. The topology is that of B where rounding alone makes e, or where that of A's dilation does not change by as much, see `steady`. Of both the same faces belong to solids, and as many solids are around them: those do not end anywhere near, so that they are
//! around all of it.
//!
//! All coordinates are whole multiples of one unit, and so are ways between parts, but for half a unit along each axis that e has, too: up to the shape's extent single precision holds such numbers exactly. So what is put elsewhere is congruent with what was made, and meets itself where that does.

use super::figure::{self, Figure};
use super::pieces::are_apart;
use crate::attractor::cell::{Point, distance_squared, subtract};
use crate::budget::{Budget, Stopped};
use crate::dilation::convex::Convex;
use crate::dilation::setting::Setting;
use crate::dilation::surface::{BlockSurface, NameMap};
use crate::groups::Groups;
use crate::solid::box_tree::{Box32, BoxTree};
use crate::solid::{Inside, TriMesh, mend};
use glam::DVec3;

/// Parts with as many figures, about as long, that one is held against at most.
const MOST_COMPARED: usize = 64;
/// Looks at boxes of figures on average, and for how many of them a look at two figures counts: where it takes more, hardly anything is apart.
const MOST_LOOKS: usize = 1_024;
const LOOKS_OF_A_PAIR: usize = 32;
/// What rounding to single precision may move, and mending, and once more to be put elsewhere, where a part may have noise, too: in units of rounding, with one to spare.
const MARGIN: f64 = mend::NUDGE + 4.0;
/// How long parts are is told in units of so many allowed deviations: few of those that are alike are told apart.
const LENGTH_UNIT: f64 = 1024.0;
/// An offset in these units, as lengths that are given are often round.
const LENGTH_OFFSET: f64 = std::f64::consts::FRAC_1_PI;

/// Where parts like those that are left were.
#[derive(Default)]
pub(in crate::dilation) struct Copies {
    /// The figures of parts that there were others like, and of each its part, and the box of its dilation.
    pub(super) figures: Vec<Figure>,
    parts: Vec<u32>,
    boxes: BoxTree,
    reach: Reach,
    /// Of each of these parts, how far from it the others are.
    shifts: Vec<Vec<Point>>,
    /// What coordinates and ways are multiples of.
    unit: f64,
    /// How far a place of one of them is from that of the part that stands for it, at most, but for this unit.
    pub(super) moved: f64,
}

/// How far surfaces may be from the figures that they are around.
#[derive(Clone, Copy, Default)]
struct Reach {
    /// The band's outer end, and what is added for rounding, mending and being put elsewhere.
    outer: f64,
    margin: f64,
}

impl Reach {
    fn of(self, figure: &Figure) -> f64 {
        figure.in_space(self.outer) + self.margin
    }
}

/// What parts are looked for in.
struct Given<'a> {
    figures: &'a [Figure],
    /// Of every figure, whether it belongs to the surface of a solid.
    is_of_solid: &'a [bool],
    solids: Vec<Inside<'a>>,
}

impl Copies {
    /// Leaves out figures of parts that are like others but for a deviation; of every figure it is told whether it belongs to the surface of a solid, and these are given.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn leave_out(
        figures: &mut Vec<Figure>,
        is_of_solid: &[bool],
        surfaces: &[TriMesh],
        setting: &Setting,
        deviation: f64,
        budget: &Budget,
    ) -> Result<Self, Stopped> {
        let reach = Reach { outer: setting.outer, margin: setting.slack + MARGIN * setting.rounding };
        let Some(parts) = parts(figures, reach, budget)? else { return Ok(Self::default()) };
        let unit = setting.unit;
        let given = Given { figures, is_of_solid, solids: surfaces.iter().map(Inside::new).collect() };
        let mut kinds: NameMap<[i64; 5], Vec<u32>> = NameMap::default();
        let mut shifts: Vec<Vec<Point>> = vec![Vec::new(); parts.len()];
        let (mut moved, mut gone) = (0.0_f64, vec![false; given.figures.len()]);
        for (number, part) in (0..).zip(&parts) {
            budget.cancel.check()?;
            let Some(kind) = given.kind(part, reach, LENGTH_UNIT * deviation) else { continue };
            let others = kinds.entry(kind).or_default();
            let like = others.iter().find_map(|&other| {
                let (shift, off) = given.shift(&parts[other as usize], part, deviation)?;
                Some((other, shift, off))
            });
            if let Some((other, shift, off)) = like {
                shifts[other as usize].push(shift.map(|x| whole(x, unit)));
                moved = moved.max(off);
                part.iter().for_each(|&figure| gone[figure as usize] = true);
            } else if others.len() < MOST_COMPARED {
                others.push(number);
            }
        }
        let mut copies = Self { reach, unit, moved, ..Self::default() };
        for (part, shifts) in parts.iter().zip(shifts).filter(|(_, shifts)| !shifts.is_empty()) {
            copies.figures.extend(part.iter().map(|&figure| given.figures[figure as usize].clone()));
            copies.parts.resize(copies.figures.len(), copies.shifts.len() as u32);
            copies.shifts.push(shifts);
        }
        figure::leave_out(figures, gone);
        let mut boxes = BoxTree::default();
        let box_of = |figure: &Figure| figure.box_within(reach.of(figure));
        boxes.build(copies.figures.len(), |index| Some(box_of(&copies.figures[index as usize])), false);
        Ok(Self { boxes, ..copies })
    }

    /// Whether no part is like another.
    pub(in crate::dilation) fn is_empty(&self) -> bool {
        self.shifts.is_empty()
    }

    /// How often there is a part that has a figure.
    pub(super) fn times(&self, figure: &Figure) -> u64 {
        1 + figure.corners().first().map_or(0, |corner| self.at(corner).len() as u64)
    }

    /// How far the parts are that are like the one whose dilation has a place.
    fn at(&self, x: &Point) -> &[Point] {
        let mut found: &[Point] = &[];
        if !self.is_empty() {
            let place = Box32::of(&[*x]);
            self.boxes.query(&place, 0, |leaf| {
                let near = self.boxes.items(leaf).iter().zip(self.boxes.boxes(leaf)).filter(|(_, own)| own.meets(&place));
                for (&index, _) in near {
                    let figure = &self.figures[index as usize];
                    if distance_squared(x, &figure.closest(x)).sqrt() <= self.reach.of(figure) {
                        found = &self.shifts[self.parts[index as usize] as usize];
                    }
                }
                found.is_empty()
            });
        }
        found
    }

    /// Of every vertex of a surface the group that it hangs together with, and of every group, by its least vertex, how far the parts are that are like its own.
    fn surfaces(&self, surface: &BlockSurface) -> (Vec<u32>, Vec<&[Point]>) {
        let groups = Groups::of_triangles(surface.vertices.len(), &surface.triangles).all();
        let of = |(vertex, &group): (u32, &u32)| if vertex == group { self.at(&surface.vertices[vertex as usize]) } else { &[] };
        let shifts = (0..).zip(&groups).map(of).collect();
        (groups, shifts)
    }

    /// Rounds coordinates to single precision, and to multiples of the unit where surfaces are put elsewhere.
    pub(in crate::dilation) fn round(&self, surface: &mut BlockSurface) {
        surface.vertices.iter_mut().flatten().for_each(|x| *x = self.rounded(*x));
    }

    /// A coordinate, rounded so.
    pub(super) fn rounded(&self, x: f64) -> f64 {
        if self.is_empty() { f64::from(x as f32) } else { whole(x, self.unit) }
    }

    /// Whether all coordinates still are multiples of the unit.
    pub(in crate::dilation) fn are_whole(&self, surface: &BlockSurface) -> bool {
        surface.vertices.iter().flatten().all(|&x| x == whole(x, self.unit))
    }

    /// How many triangles a surface has with those of the parts that were left out.
    pub(in crate::dilation) fn triangles(&self, surface: &BlockSurface) -> u64 {
        if self.is_empty() {
            return surface.triangles.len() as u64;
        }
        let (groups, shifts) = self.surfaces(surface);
        surface.triangles.iter().map(|triangle| 1 + shifts[groups[triangle[0] as usize] as usize].len() as u64).sum()
    }

    /// Puts the surfaces of parts where the others like them are, too.
    pub(in crate::dilation) fn put(&self, surface: &mut BlockSurface) {
        if self.is_empty() {
            return;
        }
        let (groups, shifts) = self.surfaces(surface);
        let group = |vertex: u32| groups[vertex as usize];
        let has_others = |vertex: u32| !shifts[group(vertex) as usize].is_empty();
        let mut vertices: Vec<u32> = (0..groups.len() as u32).filter(|&vertex| has_others(vertex)).collect();
        let mut triangles: Vec<[u32; 3]> = surface.triangles.iter().copied().filter(|triangle| has_others(triangle[0])).collect();
        vertices.sort_by_key(|&vertex| group(vertex));
        triangles.sort_by_key(|triangle| group(triangle[0]));
        let (mut numbers, mut rest) = (vec![0; groups.len()], &triangles[..]);
        for own in vertices.chunk_by(|&a, &b| group(a) == group(b)) {
            (0..).zip(own).for_each(|(number, &vertex)| numbers[vertex as usize] = number);
            let (now, later) = rest.split_at(rest.partition_point(|triangle| group(triangle[0]) <= group(own[0])));
            rest = later;
            for shift in shifts[group(own[0]) as usize] {
                let first = surface.vertices.len() as u32;
                for &vertex in own {
                    let from = surface.vertices[vertex as usize];
                    surface.vertices.push(std::array::from_fn(|axis| f64::from((from[axis] + shift[axis]) as f32)));
                }
                surface.triangles.extend(now.iter().map(|triangle| triangle.map(|corner| first + numbers[corner as usize])));
            }
        }
    }
}

/// The nearest multiple of a unit.
fn whole(x: f64, unit: f64) -> f64 {
    (x / unit).round() * unit
}

/// The figures of every part, each in ascending order; none where there is one part only, or it would take long to tell.
fn parts(figures: &[Figure], reach: Reach, budget: &Budget) -> Result<Option<Vec<Vec<u32>>>, Stopped> {
    let mut groups = Groups::new(figures.len());
    let mut left = figures.len();
    // Most shapes hang together by their corners.
    let mut corners: NameMap<[u64; 3], usize> = NameMap::default();
    for (index, figure) in figures.iter().enumerate() {
        for corner in figure.corners() {
            let first = *corners.entry(corner.map(f64::to_bits)).or_insert(index);
            left -= usize::from(groups.join(first, index));
        }
    }
    if left < 2 {
        return Ok(None);
    }
    let boxes: Vec<Box32> = figures.iter().map(|figure| figure.box_within(reach.of(figure))).collect();
    let mut tree = BoxTree::default();
    tree.build(boxes.len(), |index| Some(boxes[index as usize]), true);
    let mut looks = MOST_LOOKS * figures.len();
    for (index, (figure, own)) in figures.iter().zip(&boxes).enumerate() {
        budget.cancel.check()?;
        // Those of leaves before have asked already.
        tree.query(own, tree.leaf_with(index as u32), |leaf| {
            for (&item, theirs) in tree.items(leaf).iter().zip(tree.boxes(leaf)) {
                looks = looks.saturating_sub(1);
                let (item, other) = (item as usize, &figures[item as usize]);
                if own.meets(theirs) && groups.of(item) != groups.of(index) {
                    looks = looks.saturating_sub(LOOKS_OF_A_PAIR);
                    if !are_apart(figure, other, reach.of(figure) + reach.of(other)) {
                        left -= usize::from(groups.join(item, index));
                    }
                }
            }
            looks > 0
        });
        if left < 2 || looks == 0 {
            return Ok(None);
        }
    }
    let mut parts: Vec<Vec<u32>> = Vec::with_capacity(left);
    let mut numbers = vec![0; figures.len()];
    for (index, group) in groups.all().into_iter().enumerate() {
        // The least of a group comes first.
        if group as usize == index {
            numbers[index] = parts.len();
            parts.push(Vec::new());
        }
        parts[numbers[group as usize]].push(index as u32);
    }
    Ok(Some(parts))
}

impl Given<'_> {
    fn corners(&self, figure: u32) -> &[Point] {
        self.figures[figure as usize].corners()
    }

    /// What parts that are alike have in common: their number of figures, how many solids are around them, and how far it is from their first corner to their last, in units of `unit`. None where a solid's surface crosses itself.
    fn kind(&self, part: &[u32], reach: Reach, unit: f64) -> Option<[i64; 5]> {
        let (&first, &last) = part.first().zip(part.last())?;
        let way = self.corners(first).first().zip(self.corners(last).last()).map(|(from, to)| subtract(to, from))?;
        let length = |axis: usize| (way[axis] / unit + LENGTH_OFFSET).floor() as i64;
        Some([part.len() as i64, self.around(part, reach)?, length(0), length(1), length(2)])
    }

    /// How many solids are around a part: of the place beside its lowest corner along the first axis, which is as far from it as its surface may be.
    fn around(&self, part: &[u32], reach: Reach) -> Option<i64> {
        if self.solids.is_empty() {
            return Some(0);
        }
        let low = |&figure: &u32| {
            let far = reach.of(&self.figures[figure as usize]);
            self.corners(figure).iter().map(move |&[x, y, z]| DVec3::new(x - far, y, z))
        };
        let beside = part.iter().flat_map(low).min_by(|a, b| a.x.total_cmp(&b.x))?;
        self.solids.iter().try_fold(0, |number, solid| match solid.winding(beside) {
            winding @ (0 | 1) => Some(number + winding),
            _ => None,
        })
    }

    /// How far a part is from another with as many figures, like its own one by one but for a deviation, and for what deviation.
    fn shift(&self, from: &[u32], to: &[u32], deviation: f64) -> Option<(Point, f64)> {
        let way = |from: u32, to: u32| Some(subtract(self.corners(to).first()?, self.corners(from).first()?));
        let shift = from.first().zip(to.first()).and_then(|(&from, &to)| way(from, to))?;
        let mut off = 0.0_f64;
        for (&own, &theirs) in from.iter().zip(to) {
            let traits = |figure: u32| {
                let index = figure as usize;
                (self.corners(figure).len(), self.figures[index].deficit.to_bits(), self.is_of_solid[index])
            };
            if traits(own) != traits(theirs) {
                return None;
            }
            for (own, theirs) in self.corners(own).iter().zip(self.corners(theirs)) {
                off = off.max(distance_squared(&subtract(theirs, &shift), own).sqrt());
            }
            if off > deviation {
                return None;
            }
        }
        Some((shift, off))
    }
}

#[cfg(test)]
mod tests {
    use super::super::Arrangement;
    use super::super::testing::{arranged, lowered_as, plan, topology};
    use super::super::tests::block;
    use super::*;
    use crate::dilation::{Dilation, DilationError, dilate};
    use crate::model::{self, Group, Interior, Model, Part, PartRadius, PolygonMesh};
    use crate::solid::Inside;
    use crate::split_mix::Random;
    use crate::tolerance::{Radius, Tolerance};
    use glam::DVec3;

    const RADIUS: f64 = 1.0;

    /// Cells over vertices of their own.
    #[derive(Clone, Default)]
    struct Shape {
        vertices: Vec<DVec3>,
        faces: Vec<Vec<u32>>,
        interior: Interior,
    }

    impl Shape {
        /// Some points, segments or triangles in a cube of 3 mm, or a block.
        fn random(random: &mut Random) -> Self {
            let mut shape = Self::default();
            let kind = random.next() % 4;
            if kind == 3 {
                let high = DVec3::from_array(std::array::from_fn(|_| 1.0 + 2.0 * random.share()));
                let (vertices, faces) = block(0, DVec3::ZERO, high);
                return Self { vertices, faces, interior: Interior::Solid };
            }
            for _ in 0..1 + random.next() % 5 {
                let first = shape.vertices.len() as u32;
                shape.faces.push((0..=kind as u32).map(|corner| first + corner).collect());
                shape.vertices.extend((0..=kind).map(|_| 3.0 * DVec3::from_array(std::array::from_fn(|_| random.share()))));
            }
            shape
        }

        fn add(&mut self, other: &Self, mut to: impl FnMut(DVec3) -> DVec3) {
            let first = self.vertices.len() as u32;
            self.vertices.extend(other.vertices.iter().map(|&vertex| to(vertex)));
            self.faces.extend(other.faces.iter().map(|face| face.iter().map(|corner| first + corner).collect()));
        }

        fn attractor(&self) -> crate::attractor::Attractor {
            lowered_as(self.interior, &self.vertices, self.faces.clone()).unwrap()
        }

        /// How many sites are left without copies, and how far these are from each other.
        fn left(&self) -> (usize, f64) {
            let attractor = self.attractor();
            let (plan, budget) = (plan(&attractor, RADIUS, 0.1), Budget::default());
            let setting = plan.setting(plan.pitch(), &budget);
            let made = Arrangement::new(&setting, plan.rule(), plan.space(&setting).candidates(), &budget).unwrap().unwrap();
            (made.sites.list.len(), made.copies.moved)
        }

        fn distance(&self, x: &Point) -> f64 {
            let corner = |&corner: &u32| self.vertices[corner as usize].to_array();
            let of = |face: &Vec<u32>| {
                let corners: Vec<Point> = face.iter().map(corner).collect();
                // Faces of blocks are rectangles.
                (2..corners.len().max(3))
                    .map(|k| {
                        let triangle = [0, k - 1, k].map(|k| corners[k.min(corners.len() - 1)]);
                        let [a, b, c] = &triangle;
                        distance_squared(x, &crate::measure::triangle::closest_on_triangle(x, a, b, c))
                    })
                    .fold(f64::INFINITY, f64::min)
            };
            self.faces.iter().map(of).fold(f64::INFINITY, f64::min).sqrt()
        }
    }

    /// Asserts that vertices and places near the sites are where the bounds say.
    fn assert_bounds(case: &str, shape: &Shape, made: &Dilation, random: &mut Random) {
        let (least, most) = (RADIUS - made.inner_mm, RADIUS + made.outer_mm);
        for vertex in &made.solid.mesh().vertices {
            let d = shape.distance(&vertex.to_array());
            assert!(least <= d && d <= most, "{case}: {vertex} is {d} from the sites");
        }
        let inside = Inside::new(made.solid.mesh());
        for _ in 0..200 {
            let near = shape.vertices[(random.next() % shape.vertices.len() as u64) as usize];
            let x = near + 2.0 * DVec3::from_array(std::array::from_fn(|_| 2.0 * random.share() - 1.0));
            let d = shape.distance(&x.to_array());
            assert!(d > least || inside.winding(x) == 1, "{case}: {x} is {d} from the sites");
            assert!(d < most || shape.interior == Interior::Solid || inside.winding(x) == 0, "{case}: {x} is {d} from the sites");
        }
    }

    /// Points, wires, panels and blocks, several times each: exactly, rounded to single precision, and with noise. As many pieces, handles and voids as all of them alone, within the bounds of what was given; one of each is thickened but where noise is more than may be taken for it.
    #[test]
    fn parts_that_are_alike_are_thickened_once() {
        let mut random = Random(5);
        let (mut left_out, mut noisy) = (0, 0);
        for round in 0..40 {
            let (mut all, mut expected, mut sites) = (Shape::default(), (0, 0, 0), 0);
            let origin = [0.0, -200.0, 60.0][round / 4 % 3];
            for kind in 0..2 {
                let one = Shape::random(&mut random);
                if kind > 0 && one.interior != all.interior {
                    continue;
                }
                all.interior = one.interior;
                let (components, cavities, euler) = topology(&arranged(&one.attractor(), RADIUS, 0.1));
                sites += one.left().0;
                for _ in 0..2 + random.next() % 4 {
                    let number = (all.vertices.len() + kind) as f64;
                    let to = DVec3::new(6.0 * number, 3.0 * random.share(), 5.0 * random.share()) + 0.1 + origin;
                    let mut by = |most: f64| most * (2.0 * random.share() - 1.0);
                    all.add(&one, |x| match round % 4 {
                        0 => x + to,
                        1 => (x + to).as_vec3().as_dvec3(),
                        2 => x + to + DVec3::new(by(3e-5), by(3e-5), by(3e-5)),
                        _ => x + to + DVec3::new(by(0.01), by(0.01), by(0.01)),
                    });
                    expected = (expected.0 + components, expected.1 + cavities, expected.2 + euler);
                }
            }
            let made = arranged(&all.attractor(), RADIUS, 0.1);
            if round % 4 < 3 {
                assert_eq!((topology(&made), made.topology_exact, made.crossings), (expected, true, 0), "{round}");
                let (left, moved) = all.left();
                left_out += usize::from(left == sites);
                noisy += usize::from(moved > 1e-8);
                assert!(moved < 2e-4, "{round}: {moved}");
            } else {
                assert!(all.left().1 < 2e-4, "{round}");
            }
            assert!(made.inner_mm.max(made.outer_mm) <= 0.1);
            assert_bounds(&round.to_string(), &all, &made, &mut random);
        }
        assert!(left_out > 25 && noisy > 12, "{left_out} of 30 left out, {noisy} with noise");
    }

    fn part(interior: Interior, (vertices, faces): (Vec<DVec3>, Vec<Vec<u32>>), radius: Option<f64>) -> Part {
        let shape = model::Shape::Mesh(PolygonMesh { vertices, faces, interior });
        Part { name: None, transform: None, shape, radius: radius.map(PartRadius::Constant) }
    }

    fn dilated(parts: Vec<Part>) -> Dilation {
        let shape = model::Shape::Group(Group { parts, joins: Vec::new() });
        let attractor = Model { name: None, shape }.lower().unwrap().attractor;
        dilate(&attractor, Radius::new(RADIUS).unwrap(), Tolerance::new(0.1).unwrap(), &Budget::default()).unwrap()
    }

    fn wire(at: DVec3) -> (Vec<DVec3>, Vec<Vec<u32>>) {
        (vec![at, at + DVec3::X], vec![vec![0, 1]])
    }

    /// A wire inside of a block, and others like it beside: what is inside is filled, what is beside stays, and no lattice is needed.
    #[test]
    fn parts_inside_of_others_are_no_copies() {
        for (places, expected) in [([6.0, 30.0, 40.0], 3), ([30.0, 6.0, 40.0], 3), ([20.0, 30.0, -40.0], 4)] {
            let wires = places.map(|x| part(Interior::Surface, wire(DVec3::splat(x)), None));
            let around = part(Interior::Solid, block(0, DVec3::ZERO, DVec3::splat(12.0)), None);
            let made = dilated(wires.into_iter().chain([around]).collect());
            assert_eq!((topology(&made), made.topology_exact, made.crossings), ((expected, 0, 2 * expected as i64), true, 0));
            assert_eq!(made.pitch_mm, None);
        }
    }

    /// A block that is filled and the same faces that are not, in either order, and thin ones: the void is there once.
    #[test]
    fn solids_are_no_copies_of_surfaces() {
        for height in [2.0001, 2.002, 2.006, 2.2, 3.0] {
            for order in [[Interior::Solid, Interior::Surface], [Interior::Surface, Interior::Solid]] {
                let parts = [0.0, 30.0].into_iter().zip(order).map(|(x, interior)| {
                    let low = DVec3::new(x, 0.0, 0.0);
                    part(interior, block(0, low, low + DVec3::new(12.0, 12.0, height)), None)
                });
                let made = dilated(parts.collect());
                let expected = if made.topology_exact { vec![(2, 1, 6)] } else { vec![(2, 0, 4), (2, 1, 6)] };
                assert!(expected.contains(&topology(&made)), "{height}, {order:?}: {:?}", topology(&made));
                assert!(made.topology_exact || height < 2.1);
            }
        }
    }

    /// Wires that are alike, one of which is thicker.
    #[test]
    fn parts_of_other_radii_are_no_copies() {
        let wires = [(0.0, None), (10.0, Some(0.5)), (20.0, None), (30.0, Some(0.5))];
        let made = dilated(wires.map(|(y, radius)| part(Interior::Surface, wire(DVec3::Y * y), radius)).to_vec());
        assert_eq!((topology(&made), made.crossings), ((4, 0, 8), 0));
        for (y, radius) in wires {
            let own = made.solid.mesh().vertices.iter().filter(|vertex| (vertex.y - y).abs() < 5.0);
            let far = own.map(|vertex| vertex.distance(DVec3::new(vertex.x.clamp(0.0, 1.0), y, 0.0)));
            let [low, high] = far.fold([f64::INFINITY, 0.0_f64], |[low, high], d| [low.min(d), high.max(d)]);
            let radius = radius.unwrap_or(RADIUS);
            assert!(radius - 0.1 <= low && high <= radius + 0.1, "{y}: {low} to {high}");
        }
    }

    /// Parts that are hardly farther apart than dilations reach, far from the origin, where positions are rounded by as much: none meet, for any number of threads.
    #[test]
    fn parts_that_nearly_touch_do_not_meet() {
        for origin in [-16_500.0, 0.0, 1_023.0, 16_380.0] {
            for gap in [2.2, 2.2002, 2.201, 2.21, 2.4] {
                let mut shape = Shape::default();
                let one = Shape { vertices: vec![DVec3::ZERO], faces: vec![vec![0]], ..Shape::default() };
                (0..27)
                    .for_each(|k| shape.add(&one, |_| DVec3::new(f64::from(k % 3), f64::from(k / 3 % 3), f64::from(k / 9)) * gap + origin));
                let attractor = shape.attractor();
                let of = |threads: usize| {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                    pool.install(|| arranged(&attractor, RADIUS, 0.1))
                };
                let made = of(1);
                assert_eq!((topology(&made), made.topology_exact, made.crossings), ((27, 0, 54), true, 0), "{origin}, {gap}");
                assert_eq!(made.solid.mesh(), of(3).solid.mesh());
            }
        }
    }

    /// What is put elsewhere counts.
    #[test]
    fn copies_count_against_the_limit() {
        let mut shape = Shape::default();
        let one = Shape { vertices: vec![DVec3::ZERO], faces: vec![vec![0]], ..Shape::default() };
        (0..100).for_each(|k| shape.add(&one, |_| DVec3::new(f64::from(k % 10), f64::from(k / 10), 0.0) * 4.0));
        let attractor = shape.attractor();
        let mut budget = Budget::default();
        let made = arranged(&attractor, RADIUS, 0.1);
        assert_eq!(topology(&made), (100, 0, 200));
        let triangles = made.solid.mesh().triangles.len() as u64;
        let limited = |allowed: u64| {
            budget.limits.triangles = allowed;
            let plan = plan(&attractor, RADIUS, 0.1);
            plan.run_arranged(&budget).map(|made| made.is_some())
        };
        assert!(matches!([triangles - 1, triangles].map(limited), [Err(DilationError::Triangles { .. }), Ok(true)]));
    }
}
