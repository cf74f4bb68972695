//! The places of a plane that are as far from some points and segments as a length: a contour of straight pieces beside segments and of arcs around their ends.
//!
//! Each curve, a side of a segment or an arc around a vertex, is on the contour where no other body is nearer. The dilations of convex bodies by the same radius are pseudo-discs: their boundaries meet twice at most, so that each covers an interval of a curve (Kedem, Livne, Pach,
//! Sharir, "On the union of Jordan regions and collision-free translational motion amidst polygonal obstacles", 1986). What all leave open are the contour's pieces, which are joined where they meet.
//!
//! Where two ends on a curve are closer to each other than a margin, and no body covers both with room, or dilations touch, the contour's topology is in doubt: then there is none. The margin is far above what rounding does to such ends.

use super::Place;
use super::wires::{Body, NONE, Wires, cross, dot, minus, plus};
use crate::budget::{Budget, Stopped};
use crate::dilation::surface::NameMap;
use std::f64::consts::{PI, TAU};

/// Segments turn into each other if they turn by less than this.
pub(super) const STRAIGHT: f64 = 1e-4;
/// Parts of a curve that are asked for one body that covers all of each are no longer than this, in units of the radius; and with what room it has to, in units of the margin.
const PART: f64 = 0.5;
const ROOM: f64 = 4.0;
/// What a piece ends at that ends where its curve does.
const NATURAL: u32 = NONE;

/// A curve: a half-edge's side, or an arc around a vertex, by the angle beyond its begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Curve {
    Side(u32),
    Arc { vertex: u32, is_second: bool },
}

/// A part of a curve, from and to which length or angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) curve: Curve,
    pub(super) from: f64,
    pub(super) to: f64,
    /// What it meets at its ends.
    meets: [u32; 2],
}

impl Piece {
    /// Whether it goes on smoothly where it ends.
    pub(super) fn is_smooth_after(&self) -> bool {
        self.meets[1] == NATURAL
    }
}

/// The contour: loops of pieces with all that is nearer on their left.
pub(super) struct Contour {
    pub(super) radius: f64,
    pub(super) pieces: Vec<Piece>,
    pub(super) loops: Vec<Vec<u32>>,
    /// Loops around what is nearer, and around what is farther.
    pub(super) components: u64,
    pub(super) holes: u64,
}

/// What a piece of a curve ends at: where, at which curve, and how far off that may be by what is moved and rounded.
#[derive(Clone, Copy, Debug)]
struct End {
    at: f64,
    with: u32,
    error: f64,
}

impl End {
    /// Whether it cannot be told from another.
    fn is_like(&self, other: &Self) -> bool {
        (self.at - other.at).abs() <= self.error + other.error
    }

    /// Whether it is before another for sure.
    fn is_before(&self, other: &Self) -> bool {
        self.at + self.error < other.at - other.error
    }
}

/// What a body covers of a curve, or what is left of it.
#[derive(Clone, Copy, Debug)]
struct Span([End; 2]);

/// What is left of a curve.
#[derive(Default)]
struct Left {
    open: Vec<Span>,
    after: Vec<Span>,
    spans: Vec<Span>,
    ties: Vec<End>,
    length: f64,
}

impl Left {
    fn start(&mut self, to: f64, error: f64) {
        self.open.clear();
        self.spans.clear();
        self.ties.clear();
        self.length = to;
        self.open.push(Span([0.0, to].map(|at| End { at, with: NATURAL, error })));
    }

    /// Takes out what a body covers.
    fn cover(&mut self, span: &Span) {
        let Span([from, to]) = *span;
        self.spans.push(*span);
        self.after.clear();
        for piece in &self.open {
            let Span([start, end]) = *piece;
            // Bodies with a vertex in common end at the same arc.
            for (own, like, other) in [(start, to, from), (end, from, to)] {
                if own.is_like(&like) && like.with != own.with || own.is_like(&other) {
                    self.ties.push(End { error: own.error.max(like.error).max(other.error), ..own });
                }
            }
            if to.at <= start.at || from.at >= end.at {
                self.after.push(*piece);
                continue;
            }
            if from.at > start.at {
                self.after.push(Span([start, from]));
            }
            if to.at < end.at {
                self.after.push(Span([to, end]));
            }
        }
        std::mem::swap(&mut self.open, &mut self.after);
    }

    /// Whether nothing is left for sure.
    fn is_closed(&self) -> bool {
        self.open.is_empty() && self.is_certain()
    }

    /// Whether all ties are covered with room, or beyond the curve.
    fn is_certain(&self) -> bool {
        self.ties.iter().all(|tie| {
            let is_beyond = tie.at + tie.error < 0.0 || tie.at - tie.error > self.length;
            is_beyond || self.spans.iter().any(|Span([from, to])| from.is_before(tie) && tie.is_before(to))
        })
    }
}

/// The contour at a distance from all bodies; none where its topology is in doubt.
///
/// # Errors
/// [`Stopped`].
pub(super) fn contour(wires: &Wires, radius: f64, gap: f64, budget: &Budget) -> Result<Option<Contour>, Stopped> {
    let mut pieces: Vec<Piece> = Vec::new();
    let mut left = Left::default();
    let mut add = |left: &Left, curve: Curve| {
        for Span([from, to]) in &left.open {
            let is_whole = from.with == NATURAL && to.with == NATURAL;
            if !is_whole && from.is_like(to) {
                return false;
            }
            pieces.push(Piece { curve, from: from.at, to: to.at, meets: [from.with, to.with] });
        }
        left.is_certain()
    };
    for half in 0..2 * wires.segments as u32 {
        if half.is_multiple_of(32) {
            budget.cancel.check()?;
        }
        let side = Side::new(wires, half, radius);
        let stretch = Stretch { owner: half / 2, length: side.length, at: |length| plus(side.from, length, side.along) };
        if stretch.is_buried(wires, [radius, gap]) {
            continue;
        }
        left.start(side.length, gap);
        let own = &wires.bodies[(half / 2) as usize];
        for (other, body) in stretch.near(wires, [radius, gap]) {
            let leans = |along: Place| dot(along, side.right) > STRAIGHT;
            let is_apart = (body.ends[0] == own.ends[0] || body.ends[0] == own.ends[1]) && !leans(body.along)
                || (body.ends[1] == own.ends[0] || body.ends[1] == own.ends[1]) && !leans(body.along.map(|x| -x));
            if is_apart && body.length > 0.0 {
                continue;
            }
            if let Some(span) = side.covered(other, body, radius, gap, &mut left.ties) {
                left.cover(&span);
                if left.is_closed() {
                    break;
                }
            }
        }
        if !add(&left, Curve::Side(half)) {
            return Ok(None);
        }
    }
    for vertex in 0..wires.places.len() as u32 {
        if vertex.is_multiple_of(32) {
            budget.cancel.check()?;
        }
        let owner = wires.owner[vertex as usize];
        for (curve, start, width) in arcs(wires, vertex) {
            let arc = Around { place: wires.places[vertex as usize], start, width };
            let at = |length: f64| plus(arc.place, radius, towards(start + length / radius));
            let stretch = Stretch { owner, length: radius * width, at };
            if stretch.is_buried(wires, [radius, gap]) {
                continue;
            }
            left.start(width, gap / radius);
            for (other, body) in stretch.near(wires, [radius, gap]) {
                if body.ends.contains(&vertex) {
                    continue;
                }
                for span in arc.covered(other, body, radius, gap, &mut left.ties).into_iter().flatten() {
                    left.cover(&span);
                }
                if left.is_closed() {
                    break;
                }
            }
            if !add(&left, curve) {
                return Ok(None);
            }
        }
    }
    Ok(joined(wires, radius, pieces))
}

/// A curve of some length, by what is as far along it, and the body that it is beside.
struct Stretch<F> {
    owner: u32,
    length: f64,
    at: F,
}

impl<F: Fn(f64) -> Place> Stretch<F> {
    /// Whether each part is within the dilation of one body, with room: no place of a part is farther from its middle than half its length, and so all of it is as much nearer to the body. Nothing is left of the curve then, and all that it meets is covered with room, too.
    fn is_buried(&self, wires: &Wires, [radius, gap]: [f64; 2]) -> bool {
        let parts = (self.length / (PART * radius)).ceil().max(1.0);
        let half = 0.5 * self.length / parts;
        let most = radius - half - ROOM * gap;
        most > 0.0
            && (0..parts as u32).all(|part| {
                let middle = (self.at)((2.0 * f64::from(part) + 1.0) * half);
                wires.near(self.owner, radius + most).any(|other| wires.bodies[other as usize].square(middle) < most * most)
            })
    }

    /// The bodies whose dilations may meet it: others are farther from all of it, with room.
    fn near<'a>(&self, wires: &'a Wires, [radius, gap]: [f64; 2]) -> impl Iterator<Item = (u32, &'a Body)> + use<'a, F> {
        let half = 0.5 * self.length;
        let (middle, most) = ((self.at)(half), radius + half + ROOM * gap);
        let all = wires.near(self.owner, 2.0 * radius + gap).map(|other| (other, &wires.bodies[other as usize]));
        all.filter(move |(_, body)| body.square(middle) <= most * most)
    }
}

/// The unit vector at an angle.
fn towards(angle: f64) -> Place {
    let (sine, cosine) = angle.sin_cos();
    [cosine, sine]
}

/// The arcs around a vertex, with the angle at which each begins and how wide it is.
fn arcs(wires: &Wires, vertex: u32) -> impl Iterator<Item = (Curve, f64, f64)> {
    let half = wires.convex[vertex as usize];
    let owner = wires.owner[vertex as usize];
    // None has those that are as good as others.
    let is_loose = owner != NONE && owner as usize >= wires.segments;
    let first = if half != NONE {
        let (_, right) = wires.way(half);
        Some((Curve::Arc { vertex, is_second: false }, right[1].atan2(right[0]), wires.turns[half as usize]))
    } else {
        is_loose.then_some((Curve::Arc { vertex, is_second: false }, 0.0, PI))
    };
    let second = is_loose.then_some((Curve::Arc { vertex, is_second: true }, PI, PI));
    first.into_iter().chain(second)
}

/// A half-edge's side.
struct Side {
    ends: [u32; 2],
    from: Place,
    along: Place,
    right: Place,
    length: f64,
}

impl Side {
    fn new(wires: &Wires, half: u32, radius: f64) -> Self {
        let (along, right) = wires.way(half);
        let ends = wires.ends(half);
        let start = wires.places[ends[0] as usize];
        Self { ends, from: plus(start, radius, right), along, right, length: wires.bodies[(half / 2) as usize].length }
    }

    /// What a body covers of the line.
    fn covered(&self, number: u32, body: &Body, radius: f64, gap: f64, ties: &mut Vec<End>) -> Option<Span> {
        let local = |at: Place| -> Place {
            let way = minus(at, self.from);
            [dot(way, self.along), dot(way, self.right)]
        };
        let (c, u) = (local(body.from), [dot(body.along, self.along), dot(body.along, self.right)]);
        let d = plus(c, body.length, u);
        let mut ends = [f64::INFINITY, f64::NEG_INFINITY].map(|at| End { at, with: NONE, error: 0.0 });
        let mut meet = |own: End| {
            if own.at < ends[0].at {
                ends[0] = own;
            }
            if own.at > ends[1].at {
                ends[1] = own;
            }
        };
        let square = radius * radius;
        for (end, at, sign) in [(0, c, 1.0), (1, d, -1.0)] {
            let rest = square - at[1] * at[1];
            if rest > 2.0 * radius * gap {
                let half = rest.sqrt();
                for s in [at[0] - half, at[0] + half] {
                    if sign * ((s - at[0]) * u[0] - at[1] * u[1]) <= 0.0 {
                        meet(End { at: s, with: vertex_curve(body.ends[end]), error: gap * (1.0 + radius / half) });
                    }
                }
            } else if rest > -2.0 * radius * gap && !self.ends.contains(&body.ends[end]) {
                // They may touch, as far around as this. What is around its own ends does where it ends.
                ties.push(End { at: at[0], with: NONE, error: 2.0 * (radius * gap).sqrt() });
            }
        }
        if u[1] != 0.0 {
            // What is on the right has a positive second coordinate here.
            for (sign, half) in [(1.0, 2 * number), (-1.0, 2 * number + 1)] {
                let s = c[0] - (sign * radius + u[0] * c[1]) / u[1];
                let at = (s - c[0]) * u[0] - c[1] * u[1];
                if at > 0.0 && at < body.length {
                    meet(End { at: s, with: half, error: gap * (1.0 + 1.0 / u[1].abs()) });
                }
            }
        }
        (ends[0].at < ends[1].at).then_some(Span(ends))
    }
}

/// What a vertex's arcs are called, beside the sides of half-edges.
fn vertex_curve(vertex: u32) -> u32 {
    vertex | 1 << 31
}

/// An arc around a place, from an angle on.
struct Around {
    place: Place,
    start: f64,
    width: f64,
}

impl Around {
    /// What a body covers of the arc, by angles beyond its begin.
    fn covered(&self, number: u32, body: &Body, radius: f64, gap: f64, ties: &mut Vec<End>) -> [Option<Span>; 2] {
        let way = minus(body.closest(self.place), self.place);
        let square = dot(way, way);
        if square >= (2.0 * radius + gap).powi(2) {
            return [None; 2];
        }
        let middle = (way[1].atan2(way[0]) - self.start).rem_euclid(TAU);
        // They may touch, as far around as this.
        let touch = End { at: middle, with: NONE, error: 2.0 * (gap / radius).sqrt() };
        if square > (2.0 * radius - gap).powi(2) {
            ties.push(touch);
            return [None; 2];
        }
        let distance = square.sqrt();
        let x = way.map(|part| part / distance);
        let local = |way: Place| -> Place { [dot(way, x), cross(x, way)] };
        let (c, u) = (local(minus(body.from, self.place)), local(body.along));
        let d = plus(c, body.length, u);
        let mut ends = [f64::NEG_INFINITY, f64::INFINITY].map(|at| End { at, with: NONE, error: 0.0 });
        // Half of the chord that both have in common tells how far off it may be.
        let mut meet = |at: Place, with: u32, chord: f64| {
            let own = End { at: at[1].atan2(at[0]), with, error: gap * (1.0 / radius + 1.0 / chord) };
            if own.at < 0.0 && own.at > ends[0].at {
                ends[0] = own;
            }
            if own.at > 0.0 && own.at < ends[1].at {
                ends[1] = own;
            }
        };
        for (end, at, sign) in [(0, c, 1.0), (1, d, -1.0)] {
            let far = dot(at, at);
            let rest = radius * radius - 0.25 * far;
            if rest > 0.0 {
                let side = (rest / far).sqrt();
                for side in [-side, side] {
                    let meeting = [0.5 * at[0] - side * at[1], 0.5 * at[1] + side * at[0]];
                    if sign * dot(minus(meeting, at), u) <= 0.0 {
                        // Close circles meet at a flat angle.
                        meet(meeting, vertex_curve(body.ends[end]), rest.sqrt().min(0.5 * far.sqrt()));
                    }
                }
            }
        }
        if body.length > 0.0 {
            let normal = [-u[1], u[0]];
            let height = -dot(normal, c);
            for (sign, half) in [(1.0, 2 * number + 1), (-1.0, 2 * number)] {
                let off = sign * radius - height;
                let rest = radius * radius - off * off;
                if rest > 0.0 {
                    let along = rest.sqrt();
                    for along in [-along, along] {
                        let meeting = plus(normal.map(|part| off * part), along, u);
                        let at = dot(minus(meeting, c), u);
                        if at > 0.0 && at < body.length {
                            meet(meeting, half, along.abs());
                        }
                    }
                }
            }
        }
        if ends.iter().any(|end| end.with == NONE) {
            ties.push(touch);
            return [None; 2];
        }
        let span = |turn: f64| Span(ends.map(|end| End { at: middle + turn + end.at, ..end }));
        let reaches = |Span([from, to]): &Span| to.at > -to.error && from.at < self.width + from.error;
        [0.0, -TAU].map(|turn| Some(span(turn)).filter(reaches))
    }
}

/// The contour of pieces, joined where they meet; none where one has no other to go on with.
fn joined(wires: &Wires, radius: f64, pieces: Vec<Piece>) -> Option<Contour> {
    let id = |curve: Curve| match curve {
        Curve::Side(half) => half,
        Curve::Arc { vertex, .. } => vertex_curve(vertex),
    };
    let mut starts: NameMap<[u32; 2], u32> = NameMap::default();
    for (number, piece) in (0..).zip(&pieces) {
        // A second arc begins where the first ends.
        let own =
            if piece.meets[0] == NATURAL && matches!(piece.curve, Curve::Arc { is_second: true, .. }) { NONE - 1 } else { piece.meets[0] };
        if starts.insert([id(piece.curve), own], number).is_some() {
            return None;
        }
    }
    let after = |piece: &Piece| -> Option<u32> {
        let key = match (piece.meets[1], piece.curve) {
            (NATURAL, Curve::Side(half)) => {
                let vertex = wires.ends(half)[1];
                if wires.convex[vertex as usize] == half { [vertex_curve(vertex), NATURAL] } else { [wires.next[half as usize], NATURAL] }
            }
            (NATURAL, Curve::Arc { vertex, is_second }) => match wires.convex[vertex as usize] {
                NONE if is_second => [vertex_curve(vertex), NATURAL],
                NONE => [vertex_curve(vertex), NONE - 1],
                half => [wires.next[half as usize], NATURAL],
            },
            (with, curve) => [with, id(curve)],
        };
        starts.get(&key).copied()
    };
    let mut is_taken = vec![false; pieces.len()];
    let mut contour = Contour { radius, loops: Vec::new(), components: 0, holes: 0, pieces };
    for first in 0..contour.pieces.len() as u32 {
        if is_taken[first as usize] {
            continue;
        }
        let (mut own, mut at) = (Vec::new(), first);
        loop {
            if std::mem::replace(&mut is_taken[at as usize], true) {
                return None;
            }
            own.push(at);
            at = after(&contour.pieces[at as usize])?;
            if at == first {
                break;
            }
        }
        if contour.area(wires, &own) > 0.0 {
            contour.components += 1;
        } else {
            contour.holes += 1;
        }
        contour.loops.push(own);
    }
    Some(contour)
}

impl Contour {
    /// A piece's place at a length or angle, and the unit vector out of the dilation there.
    #[inline]
    pub(super) fn place(&self, wires: &Wires, piece: &Piece, at: f64) -> (Place, Place) {
        match piece.curve {
            Curve::Side(half) => {
                let (along, right) = wires.way(half);
                let start = plus(wires.places[wires.ends(half)[0] as usize], at, along);
                (plus(start, self.radius, right), right)
            }
            Curve::Arc { vertex, is_second } => {
                let begin = match wires.convex[vertex as usize] {
                    NONE if is_second => [-1.0, 0.0],
                    NONE => [1.0, 0.0],
                    half => wires.way(half).1,
                };
                let (sine, cosine) = at.sin_cos();
                let out = [begin[0] * cosine - begin[1] * sine, begin[0] * sine + begin[1] * cosine];
                (plus(wires.places[vertex as usize], self.radius, out), out)
            }
        }
    }

    /// The body that a curve is beside.
    pub(super) fn body(&self, wires: &Wires, piece: &Piece) -> u32 {
        match piece.curve {
            Curve::Side(half) => half / 2,
            Curve::Arc { vertex, .. } => wires.owner[vertex as usize],
        }
    }

    /// The area on the left of a loop.
    fn area(&self, wires: &Wires, own: &[u32]) -> f64 {
        let piece = |number: u32| &self.pieces[number as usize];
        let origin = self.place(wires, piece(own[0]), piece(own[0]).from).0;
        let mut double = 0.0;
        let mut last = [0.0; 2];
        for &number in own {
            let piece = piece(number);
            let [from, to] = [piece.from, piece.to].map(|at| minus(self.place(wires, piece, at).0, origin));
            double += cross(last, from) + cross(from, to);
            last = to;
            if matches!(piece.curve, Curve::Arc { .. }) {
                let wide = piece.to - piece.from;
                double += self.radius * self.radius * (wide - wide.sin());
            }
        }
        double
    }
}
