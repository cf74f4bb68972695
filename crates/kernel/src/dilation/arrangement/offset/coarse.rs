//! Fewer triangles for a surface: such that its sheets, as far out as the radius, follow it.

use super::seams::{Corner, Hidden, Valleys};
use super::skin::Skin;
use crate::attractor::cell::{Point, between, cross, distance_squared, dot, subtract, unit};
use crate::budget::{Budget, Stopped};
use crate::dilation::removed::Removed;
use crate::solid::half_edges::{HalfEdges, kept};
use crate::solid::mend::{MOST_AROUND, Mender};

/// How far off a sheet places may be that it goes by, in units of what may be, pass by pass.
const PASSES: [f64; 4] = [0.05, 0.2, 0.5, 1.0];
/// The same for what is hidden, which goes first: as it must go, sheets are asked afterwards whether they may be off by more; and what it is for corners of seams in its way, as a share of that.
const HIDDEN: [f64; 6] = [0.5, 0.8, 1.0, 1.2, 1.2, 1.2];
const ALONG_SEAMS: f64 = 0.25;
/// The least cosine of the angle between a triangle and its corners' normals, or its sheets.
const LEAST_COSINE: f64 = 0.8;
/// What strips may be off, as a share of what sheets may: they are flat from row to row, too.
const STRIP: f64 = 0.6;
/// The least height of a triangle, as a share of its longest side, and while what is hidden goes.
const LEAST_HEIGHT: f64 = 0.02;
const LEAST_WHILE_HIDDEN: f64 = 1e-4;
/// Sides that are shorter than this, as a share of the longest one around a vertex, go before others: noise and marching cubes leave such, which would end up between slivers.
const SHORT: f64 = 0.2;
/// Vertices that are looked at before a stop is noticed.
const IN_A_ROW: u32 = 256;

/// Which vertices are left of a surface.
pub(super) struct Coarse<'a> {
    skin: &'a Skin,
    hidden: &'a Hidden,
    tops: Tops<'a>,
    /// The cosine of the angle by which the border turns at most at vertices that may go.
    turn: f64,
    /// The least height of a triangle that may come to be, as a share of its longest side, unless one was as low before; and how long sides may be that go, as a share of the longest one around a vertex.
    height: f64,
    short: f64,
    mesh: HalfEdges,
    mender: Mender,
    /// Triangles one of whose sheets looks the other way, as a surface has where it bends by more than the distance over less than may be off: they may become such ones, until they are gone.
    inverted: Vec<[bool; 2]>,
    removed: Removed,
    /// What may come to be of a star, and whether it has hidden corners.
    fresh: Vec<(Fresh, bool)>,
    /// The normals of the star's triangles, and their heights as shares of their longest sides.
    normals: Vec<Point>,
    heights: Vec<f64>,
    lengths: Vec<(f64, usize)>,
}

/// Where sheets as far out as the radius are over vertices: along the normals, or where those of parts meet, if that is told. Then they need not go by what is hidden.
struct Tops<'a> {
    skin: &'a Skin,
    valleys: Option<&'a Valleys>,
    radius: f64,
}

/// What may come to be: a triangle, or a side of the border.
enum Fresh {
    Triangle(Triangle),
    Side(Side),
}

impl Tops<'_> {
    /// The place over a vertex on a side, and the normal.
    fn over(&self, corner: Corner) -> (Point, Point) {
        let Self { skin, valleys, radius } = self;
        let (at, up) = (&skin.places[corner.0 as usize], skin.up(corner));
        let valleys = if skin.is_border(corner.0) { *valleys } else { None };
        let valley = |valleys: &'_ Valleys| valleys[*skin.seams.ring_of.get(&corner)?];
        let top = match valleys.and_then(valley) {
            Some(valley) => lifted(at, &valley, 1.0),
            None => lifted(at, &up, *radius),
        };
        (top, up)
    }
}

impl Fresh {
    fn new(tops: &Tops<'_>, height: f64, corners: [u32; 3]) -> Option<Self> {
        match corners.iter().position(|&corner| corner == tops.skin.beyond()) {
            None => Triangle::new(tops, height, corners).map(Self::Triangle),
            Some(k) => Side::new(tops, [corners[(k + 2) % 3], corners[(k + 1) % 3]]).map(Self::Side),
        }
    }

    /// How well it stands for a vertex that is gone: for those of the border that is a side.
    fn depth(&self, skin: &Skin, vertex: u32) -> f64 {
        match self {
            Self::Triangle(_) if skin.is_border(vertex) => f64::NEG_INFINITY,
            Self::Triangle(own) => own.depth(&skin.places[vertex as usize]),
            Self::Side(_) if skin.is_border(vertex) => f64::INFINITY,
            Self::Side(_) => f64::NEG_INFINITY,
        }
    }

    fn error(&self, tops: &Tops<'_>, is_open: impl Fn(Corner) -> bool, vertex: u32) -> f64 {
        match self {
            Self::Triangle(own) => own.error(tops, is_open, vertex),
            Self::Side(own) => own.error(tops, is_open, vertex),
        }
    }

    fn is_inverted(&self) -> [bool; 2] {
        match self {
            Self::Triangle(own) => own.is_inverted,
            Self::Side(_) => [false; 2],
        }
    }

    fn sag(&self) -> f64 {
        match self {
            Self::Triangle(own) => own.sag,
            Self::Side(own) => own.sag,
        }
    }
}

/// A side of the border: its ends, and the ends of the strip over it: on the sides of the surface, and beyond the border. How far it is off a strip that turns evenly.
struct Side {
    ends: [Point; 2],
    along: Point,
    /// The normal at the first end.
    up: Point,
    strips: [[Point; 2]; 3],
    is_seam: bool,
    sag: f64,
}

impl Side {
    /// None where both ends are hardly alike.
    fn new(tops: &Tops<'_>, ends: [u32; 2]) -> Option<Self> {
        let skin = tops.skin;
        let [up, other] = ends.map(|end| skin.ups[end as usize]);
        let is_turned = dot(&up, &other) < 0.0;
        // Along seams there are sheets alone.
        let is_seam = ends.iter().all(|&end| skin.seams.copies(end).is_some());
        let outs = ends.map(|end| skin.outs[end as usize]);
        if dot(&up, &other).abs() < LEAST_COSINE || (!is_seam && dot(&outs[0], &outs[1]) < LEAST_COSINE) {
            return None;
        }
        let places = ends.map(|end| skin.places[end as usize]);
        let (mut strips, mut sag) = ([[[0.0; 3]; 2]; 3], 0.0_f64);
        let beyond = [0, 1].map(|k| (lifted(&places[k], &outs[k], tops.radius), outs[k]));
        let over = |side: &f64| [(ends[0], *side > 0.0), (ends[1], (*side > 0.0) != is_turned)].map(|corner| tops.over(corner));
        let all = skin.sides.iter().map(over).chain((!is_seam).then_some(beyond));
        for (strip, [(from, up), (to, other)]) in strips.iter_mut().zip(all) {
            *strip = [from, to];
            sag = sag.max(dot(&subtract(&to, &from), &subtract(&other, &up)).abs() / 8.0);
        }
        Some(Self { ends: places, along: unit(&subtract(&places[1], &places[0])), up, strips, is_seam, sag: sag / STRIP })
    }

    /// How far a vertex is off the strips that go by it, over the side and beyond it.
    fn error(&self, tops: &Tops<'_>, is_open: impl Fn(Corner) -> bool, vertex: u32) -> f64 {
        let skin = tops.skin;
        let x = &skin.places[vertex as usize];
        let way = subtract(&self.ends[1], &self.ends[0]);
        let share = dot(&subtract(x, &self.ends[0]), &self.along) / dot(&way, &self.along);
        let is_turned = dot(&skin.ups[vertex as usize], &self.up) < 0.0;
        let over = |side: &f64| {
            let corner = (vertex, (*side > 0.0) != is_turned);
            is_open(corner).then(|| tops.over(corner).0)
        };
        let beyond = (!self.is_seam).then(|| Some(lifted(x, &skin.outs[vertex as usize], tops.radius)));
        let across = |(own, [from, to]): (Option<Point>, &[Point; 2])| {
            let off = own.map_or([0.0; 3], |own| subtract(&own, &between(from, to, share)));
            (dot(&off, &off) - dot(&off, &self.along).powi(2)).max(0.0).sqrt()
        };
        skin.sides.iter().map(over).chain(beyond).zip(&self.strips).map(across).fold(0.0, f64::max) / STRIP
    }
}

/// A triangle: its corners as places on it, and of its sheets a place and the normal, and how far sides are off sheets that turn evenly.
struct Triangle {
    corners: [Point; 3],
    normal: Point,
    sheets: [(Point, Point); 2],
    sag: f64,
    /// Which of these are not along it.
    is_inverted: [bool; 2],
}

impl Triangle {
    /// None where it is a sliver, lower than a share of its longest side, or leans from its corners' normals.
    fn new(tops: &Tops<'_>, height: f64, corners: [u32; 3]) -> Option<Self> {
        let skin = tops.skin;
        let places = corners.map(|corner| skin.places[corner as usize]);
        let across = |[a, b, c]: &[Point; 3]| cross(&subtract(b, a), &subtract(c, a));
        let raw = across(&places);
        let longest = (0..3).map(|k| distance_squared(&places[k], &places[(k + 1) % 3])).fold(0.0, f64::max);
        let double = dot(&raw, &raw).sqrt();
        if double <= height * longest {
            return None;
        }
        let normal = raw.map(|part| part / double);
        let cosines = corners.map(|corner| dot(&normal, &skin.ups[corner as usize]));
        if cosines.iter().any(|cosine| cosine.abs() < LEAST_COSINE) {
            return None;
        }
        let mut sheets = [([0.0; 3], [0.0; 3]); 2];
        let (mut sag, mut is_inverted) = (0.0_f64, [false; 2]);
        for ((sheet, is_inverted), side) in sheets.iter_mut().zip(&mut is_inverted).zip(skin.sides) {
            let over: [(Point, Point); 3] = std::array::from_fn(|k| tops.over((corners[k], side * cosines[k] > 0.0)));
            let out = over.map(|own| own.0);
            let own = unit(&across(&out));
            let cosine = dot(&own, &normal);
            *is_inverted = cosine < LEAST_COSINE;
            *sheet = (out[0], own);
            if cosine < 0.0 {
                continue;
            }
            // Of a curve with these normals at its ends, or about these where parts meet.
            for ((from, up), (to, other)) in (0..3).map(|k| (over[k], over[(k + 1) % 3])) {
                sag = sag.max(dot(&subtract(&to, &from), &subtract(&other, &up)).abs() / 8.0);
            }
        }
        Some(Self { corners: places, normal, sheets, sag, is_inverted })
    }

    /// How far inside a place is, seen along the normal: the least of its shares in the corners.
    fn depth(&self, x: &Point) -> f64 {
        let side = |k: usize| {
            let (a, b) = (&self.corners[k], &self.corners[(k + 1) % 3]);
            dot(&self.normal, &cross(&subtract(b, a), &subtract(x, a)))
        };
        let all: Point = std::array::from_fn(side);
        all.iter().fold(f64::INFINITY, |least, &own| least.min(own)) / all.iter().sum::<f64>()
    }

    /// How far a vertex is off the sheets that go by it.
    fn error(&self, tops: &Tops<'_>, is_open: impl Fn(Corner) -> bool, vertex: u32) -> f64 {
        let above = dot(&self.normal, &tops.skin.ups[vertex as usize]);
        // Sheets that look the other way are cut away.
        let off = |((at, normal), side): (&(Point, Point), &f64)| {
            let corner = (vertex, side * above > 0.0);
            let goes_by = dot(normal, &self.normal) >= 0.0 && is_open(corner);
            if goes_by { dot(normal, &subtract(&tops.over(corner).0, at)).abs() } else { 0.0 }
        };
        self.sheets.iter().zip(tops.skin.sides).map(off).fold(0.0, f64::max)
    }
}

/// A place moved along a unit vector.
pub(super) fn lifted(x: &Point, up: &Point, by: f64) -> Point {
    std::array::from_fn(|axis| x[axis] + by * up[axis])
}

impl<'a> Coarse<'a> {
    pub(super) fn new(skin: &'a Skin, valleys: Option<&'a Valleys>, hidden: &'a Hidden, radius: f64, turn: f64) -> Self {
        let mesh = skin.mesh.clone();
        let mut mender = Mender::default();
        mender.start(&mesh);
        let count = mesh.triangles() as usize;
        let tops = Tops { skin, valleys, radius };
        let is_inverted = |&corners: &[u32; 3]| Triangle::new(&tops, 0.0, corners).map_or([false; 2], |own| own.is_inverted);
        let mut inverted: Vec<[bool; 2]> = skin.triangles.iter().map(is_inverted).collect();
        inverted.resize(count, [false; 2]);
        let (fresh, normals, heights, lengths) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self {
            skin,
            hidden,
            tops,
            turn,
            height: LEAST_HEIGHT,
            short: 1.0,
            mesh,
            mender,
            inverted,
            removed: Removed::new(count, skin.places.len()),
            fresh,
            normals,
            heights,
            lengths,
        }
    }

    /// Removes vertices as long as no vertex that is gone is farther off a sheet than it may be: first those that are hidden, given what that may be at first. False where one of these stays.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn run(&mut self, first: &[f64], most: &[f64], budget: &Budget) -> Result<bool, Stopped> {
        // What is hidden goes to seams, row by row; where many of their corners are in the way, these have to go before.
        for share in HIDDEN {
            self.height = LEAST_WHILE_HIDDEN;
            for (&vertex, number) in self.hidden.all.iter().zip(0..) {
                check(number, budget)?;
                self.remove(vertex, share, first, true);
            }
            if !self.shows() {
                break;
            }
            for &[vertex, _] in self.skin.seams.places.values().filter_map(|copies| copies.first_chunk()) {
                self.remove(vertex, ALONG_SEAMS * share, first, false);
            }
        }
        if self.shows() {
            return Ok(false);
        }
        let short = self.skin.seams.all.is_empty().then_some((1.0, LEAST_WHILE_HIDDEN, SHORT));
        for (share, height, length) in short.into_iter().chain(PASSES.map(|share| (share, LEAST_HEIGHT, 1.0))) {
            (self.height, self.short) = (height, length);
            for vertex in 0..self.skin.beyond() {
                check(vertex, budget)?;
                self.remove(vertex, share, most, false);
            }
        }
        Ok(true)
    }

    /// Whether a vertex is left that is hidden.
    fn shows(&self) -> bool {
        self.hidden.all.iter().any(|&vertex| self.mesh.is_used(vertex))
    }

    /// Moves a vertex to the nearest neighbour that serves, if it is to be so on a seam before others, and with it the other one of a seam.
    fn remove(&mut self, vertex: u32, share: f64, most: &[f64], to_seams: bool) {
        let mate = match self.skin.seams.copies(vertex) {
            None => None,
            Some(&[one, other]) if one == vertex => Some(other),
            Some(_) => return,
        };
        let may_turn = |vertex: u32| self.skin.turns[vertex as usize] >= self.turn;
        if !may_turn(vertex) || !mate.is_none_or(may_turn) || !self.begin(vertex, to_seams) {
            return;
        }
        let longest = self.lengths.iter().map(|length| length.0).fold(0.0, f64::max);
        for index in 0..self.lengths.len() {
            let (length, m) = self.lengths[index];
            if length > self.short * self.short * longest {
                break;
            }
            if !self.serves(m, share, most) || !self.mender.keeps_manifold(&self.mesh, m) {
                continue;
            }
            if let Some(mate) = mate {
                let end = self.skin.seams.first(self.mender.star.ring[m]);
                let is_done = self.begin(mate, to_seams) && self.follow(mate, end, share, most);
                let is_back = self.begin(vertex, to_seams) && self.lengths.get(index).is_some_and(|length| length.1 == m);
                if !is_done {
                    continue;
                }
                // Nothing but what is beyond the seam has changed.
                if !is_back || !self.serves(m, share, most) {
                    return;
                }
            }
            self.collapse(vertex, m);
            return;
        }
    }

    /// Moves a vertex, which was begun with, to the end of a seam if that serves; whether it does.
    fn follow(&mut self, vertex: u32, end: u32, share: f64, most: &[f64]) -> bool {
        let is_end = |&&(_, m): &&(f64, usize)| {
            let other = self.mender.star.ring[m];
            other != self.skin.beyond() && self.skin.seams.first(other) == end
        };
        let Some(&(_, m)) = self.lengths.iter().find(is_end) else { return false };
        let serves = self.serves(m, share, most) && self.mender.keeps_manifold(&self.mesh, m);
        if serves {
            self.collapse(vertex, m);
        }
        serves
    }

    /// Looks at what is around a vertex, and where it may move, first to what is near; or to seams, then to what is near and not hidden. False where it is gone, or its triangles are no star.
    fn begin(&mut self, vertex: u32, to_seams: bool) -> bool {
        if !self.mesh.star(vertex, MOST_AROUND, &mut self.mender.star) {
            return false;
        }
        let Self { skin, hidden, mesh, mender, removed, normals, heights, lengths, .. } = self;
        let ring = &mender.star.ring;
        removed.look(vertex, &mender.star);
        let at = |corner: u32| &mesh.points[corner as usize];
        let count = ring.len();
        normals.clear();
        normals.extend((0..count).map(|k| {
            let (a, b) = (at(ring[k]), at(ring[(k + 1) % count]));
            cross(&subtract(a, at(vertex)), &subtract(b, at(vertex)))
        }));
        heights.clear();
        heights.extend((0..count).map(|k| {
            let (a, b) = (at(ring[k]), at(ring[(k + 1) % count]));
            let longest = distance_squared(a, b).max(distance_squared(a, at(vertex))).max(distance_squared(b, at(vertex)));
            dot(&normals[k], &normals[k]).sqrt() / longest
        }));
        lengths.clear();
        // What is on the border goes along it.
        let beyond = ring.iter().position(|&other| other == skin.beyond());
        let may_go = |m: usize| beyond.is_none_or(|beyond| (m + 1) % count == beyond || (beyond + 1) % count == m);
        let all = ring.iter().enumerate().filter(|&(m, _)| may_go(m));
        lengths.extend(all.map(|(m, &other)| (distance_squared(at(vertex), at(other)), m)));
        lengths.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        if to_seams {
            // Joined to each other they would be in each other's way.
            lengths.retain(|&(_, m)| ring[m] == skin.beyond() || !hidden.is_so(ring[m]));
            lengths.sort_by_key(|&(_, m)| skin.seams.copies(ring[m]).is_none());
        }
        true
    }

    /// Whether the star's vertex may move to ring m.
    fn serves(&mut self, m: usize, share: f64, most: &[f64]) -> bool {
        let Self { skin, hidden, tops, height, mender, inverted, removed, fresh, normals, heights, .. } = self;
        let ring = &mender.star.ring;
        let count = ring.len();
        fresh.clear();
        for k in kept(Some(m), count) {
            let corners = [ring[m], ring[k], ring[(k + 1) % count]];
            let Some(own) = Fresh::new(tops, height.min(heights[k]), corners) else { return false };
            let is_turned = matches!(&own, Fresh::Triangle(own) if dot(&own.normal, &normals[k]) <= 0.0);
            // What has a hidden corner will not be left as it is.
            let has_hidden = corners.iter().any(|&corner| corner != skin.beyond() && hidden.is_so(corner));
            let before = inverted[(mender.star.halves[k] / 3) as usize];
            let is_new = (0..2).any(|side| own.is_inverted()[side] && !before[side]);
            if is_turned || (is_new && !has_hidden) {
                return false;
            }
            let is_off = |&corner: &u32| corner != skin.beyond() && own.sag() > share * most[corner as usize];
            if !has_hidden && corners.iter().any(is_off) {
                return false;
            }
            fresh.push((own, has_hidden));
        }
        let Removed { around, owners, .. } = removed;
        let is_open = |corner: Corner| tops.valleys.is_none() || !hidden.is_over(corner);
        owners.clear();
        around.iter().all(|&vertex| {
            let depths = fresh.iter().map(|(own, _)| own.depth(skin, vertex)).enumerate();
            let Some((owner, _)) = depths.max_by(|a, b| a.1.total_cmp(&b.1)) else { return false };
            owners.push(owner);
            let (own, has_hidden) = &fresh[owner];
            *has_hidden || own.error(tops, is_open, vertex) <= share * most[vertex as usize]
        })
    }

    fn collapse(&mut self, vertex: u32, m: usize) {
        let Self { mesh, mender, inverted, removed, fresh, .. } = self;
        mesh.collapse(vertex, &mender.star, m);
        removed.remove(&mender.star, m);
        let halves = &mender.star.halves;
        kept(Some(m), halves.len()).zip(fresh).for_each(|(k, (own, _))| inverted[(halves[k] / 3) as usize] = own.is_inverted());
    }

    /// The triangles that are left, with what they are called.
    pub(super) fn triangles(&self) -> (Vec<u32>, Vec<[u32; 3]>) {
        let all = (0..self.mesh.triangles()).filter_map(|name| Some((name, self.mesh.triangle(name)?)));
        all.filter(|(_, corners)| !corners.contains(&self.skin.beyond())).unzip()
    }

    /// Halves what may be off at the corners of a triangle and the vertices that it stands for.
    pub(super) fn halve(&self, name: u32, most: &mut [f64]) {
        for corner in self.mesh.triangle(name).into_iter().flatten() {
            most[corner as usize] *= 0.5;
        }
        self.removed.each(name, |own| most[own as usize] *= 0.5);
    }
}

/// Notices a stop every now and then.
fn check(number: u32, budget: &Budget) -> Result<(), Stopped> {
    if number.is_multiple_of(IN_A_ROW) { budget.cancel.check() } else { Ok(()) }
}
