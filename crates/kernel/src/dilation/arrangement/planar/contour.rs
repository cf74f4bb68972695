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

/// Lengths below which nothing is told apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Margins {
    /// Of what is between dilations.
    pub(super) gap: f64,
    /// Of what is between ends on a curve: about the square root of twice the gap times the radius, as where circles touch.
    pub(super) along: f64,
}

/// What a body covers of a curve, and the curves that bound that.
#[derive(Clone, Copy, Debug)]
struct Span {
    ends: [(f64, u32); 2],
}

/// What is left of a curve.
#[derive(Default)]
struct Left {
    open: Vec<Span>,
    after: Vec<Span>,
    spans: Vec<[f64; 2]>,
    ties: Vec<f64>,
    length: f64,
    margin: f64,
}

impl Left {
    fn start(&mut self, to: f64, margin: f64) {
        self.open.clear();
        self.spans.clear();
        self.ties.clear();
        (self.length, self.margin) = (to, margin);
        self.open.push(Span { ends: [(0.0, NATURAL), (to, NATURAL)] });
    }

    /// Takes out what a body covers.
    fn cover(&mut self, span: &Span) {
        let [from, to] = span.ends;
        self.spans.push([from.0, to.0]);
        self.after.clear();
        for piece in &self.open {
            let [start, end] = piece.ends;
            // Bodies with a vertex in common end at the same arc.
            for (own, like, other) in [(start, to, from), (end, from, to)] {
                let is_close = |to: (f64, u32)| (to.0 - own.0).abs() < self.margin;
                if is_close(like) && like.1 != own.1 || is_close(other) {
                    self.ties.push(own.0);
                }
            }
            if to.0 <= start.0 || from.0 >= end.0 {
                self.after.push(*piece);
                continue;
            }
            if from.0 > start.0 {
                self.after.push(Span { ends: [start, from] });
            }
            if to.0 < end.0 {
                self.after.push(Span { ends: [to, end] });
            }
        }
        std::mem::swap(&mut self.open, &mut self.after);
    }

    /// Whether nothing is left for sure.
    fn is_closed(&self) -> bool {
        self.open.is_empty() && self.is_certain()
    }

    /// Whether all ties are covered with room.
    fn is_certain(&self) -> bool {
        let has_room = |tie: &f64| self.spans.iter().any(|span| span[0] < tie - self.margin && span[1] > tie + self.margin);
        let is_beyond = |&tie: &f64| tie < -self.margin || tie > self.length + self.margin;
        self.ties.iter().all(|tie| is_beyond(tie) || has_room(tie))
    }
}

/// The contour at a distance from all bodies; none where its topology is in doubt.
///
/// # Errors
/// [`Stopped`].
pub(super) fn contour(wires: &Wires, radius: f64, margins: Margins, budget: &Budget) -> Result<Option<Contour>, Stopped> {
    let mut pieces: Vec<Piece> = Vec::new();
    let mut left = Left::default();
    let mut add = |left: &Left, curve: Curve, scale: f64| {
        for Span { ends: [from, to] } in &left.open {
            let is_whole = from.1 == NATURAL && to.1 == NATURAL;
            if !is_whole && (to.0 - from.0) * scale < margins.along {
                return false;
            }
            pieces.push(Piece { curve, from: from.0, to: to.0, meets: [from.1, to.1] });
        }
        left.is_certain()
    };
    let (halves, reach) = (2 * wires.segments as u32, 2.0 * radius + margins.gap);
    for half in 0..halves {
        if half.is_multiple_of(128) {
            budget.cancel.check()?;
        }
        let side = Side::new(wires, half, radius);
        left.start(side.length, margins.along);
        let own = &wires.bodies[(half / 2) as usize];
        for other in wires.near(half / 2, reach) {
            let body = &wires.bodies[other as usize];
            let leans = |along: Place| dot(along, side.right) > margins.along / radius;
            let is_apart = (body.ends[0] == own.ends[0] || body.ends[0] == own.ends[1]) && !leans(body.along)
                || (body.ends[1] == own.ends[0] || body.ends[1] == own.ends[1]) && !leans(body.along.map(|x| -x));
            if is_apart && body.length > 0.0 {
                continue;
            }
            if let Some(span) = side.covered(other, body, radius, margins, &mut left.ties) {
                left.cover(&span);
                if left.is_closed() {
                    break;
                }
            }
        }
        if !add(&left, Curve::Side(half), 1.0) {
            return Ok(None);
        }
    }
    for vertex in 0..wires.places.len() as u32 {
        if vertex.is_multiple_of(128) {
            budget.cancel.check()?;
        }
        for (curve, start, width) in arcs(wires, vertex) {
            let owner = wires.owner[vertex as usize];
            left.start(width, margins.along / radius);
            for other in wires.near(owner, reach) {
                let body = &wires.bodies[other as usize];
                if body.ends.contains(&vertex) {
                    continue;
                }
                for span in around(wires.places[vertex as usize], start, width, other, body, wires, radius, margins, &mut left.ties).into_iter().flatten() {
                    left.cover(&span);
                }
                if left.is_closed() {
                    break;
                }
            }
            if !add(&left, curve, radius) {
                return Ok(None);
            }
        }
    }
    Ok(joined(wires, radius, pieces))
}

/// The arcs around a vertex, with the angle at which each begins and how wide it is.
fn arcs(wires: &Wires, vertex: u32) -> impl Iterator<Item = (Curve, f64, f64)> {
    let half = wires.convex[vertex as usize];
    let is_loose = wires.owner[vertex as usize] as usize >= wires.segments;
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
    from: Place,
    along: Place,
    right: Place,
    length: f64,
}

impl Side {
    fn new(wires: &Wires, half: u32, radius: f64) -> Self {
        let (along, right) = wires.way(half);
        let start = wires.places[wires.ends(half)[0] as usize];
        Self { from: plus(start, radius, right), along, right, length: wires.bodies[(half / 2) as usize].length }
    }

    /// What a body covers of the line.
    fn covered(&self, number: u32, body: &Body, radius: f64, margins: Margins, ties: &mut Vec<f64>) -> Option<Span> {
        let local = |at: Place| -> Place {
            let way = minus(at, self.from);
            [dot(way, self.along), dot(way, self.right)]
        };
        let (c, u) = (local(body.from), [dot(body.along, self.along), dot(body.along, self.right)]);
        let d = plus(c, body.length, u);
        let mut ends = [(f64::INFINITY, NONE), (f64::NEG_INFINITY, NONE)];
        let mut meet = |at: f64, with: u32| {
            if at < ends[0].0 {
                ends[0] = (at, with);
            }
            if at > ends[1].0 {
                ends[1] = (at, with);
            }
        };
        let square = radius * radius;
        for (end, at, sign) in [(0, c, 1.0), (1, d, -1.0)] {
            let rest = square - at[1] * at[1];
            if rest > 0.0 {
                let half = rest.sqrt();
                for s in [at[0] - half, at[0] + half] {
                    if sign * ((s - at[0]) * u[0] - at[1] * u[1]) <= 0.0 {
                        meet(s, vertex_curve(body.ends[end]));
                    }
                }
            } else if rest > -2.0 * radius * margins.gap {
                ties.push(at[0]);
            }
        }
        if u[1] != 0.0 {
            // What is on the right has a positive second coordinate here.
            for (sign, half) in [(1.0, 2 * number), (-1.0, 2 * number + 1)] {
                let s = c[0] - (sign * radius + u[0] * c[1]) / u[1];
                let at = (s - c[0]) * u[0] - c[1] * u[1];
                if at > 0.0 && at < body.length {
                    meet(s, half);
                }
            }
        }
        (ends[0].0 < ends[1].0).then_some(Span { ends })
    }
}

/// What a vertex's arcs are called, beside the sides of half-edges.
fn vertex_curve(vertex: u32) -> u32 {
    vertex | 1 << 31
}

/// What a body covers of an arc around a place that begins at an angle, by angles beyond that.
#[allow(clippy::too_many_arguments)]
fn around(
    place: Place,
    start: f64,
    width: f64,
    number: u32,
    body: &Body,
    wires: &Wires,
    radius: f64,
    margins: Margins,
    ties: &mut Vec<f64>,
) -> [Option<Span>; 2] {
    let _ = wires;
    let way = minus(body.closest(place), place);
    let square = dot(way, way);
    if square >= (2.0 * radius + margins.gap).powi(2) {
        return [None; 2];
    }
    let middle = (way[1].atan2(way[0]) - start).rem_euclid(TAU);
    if square > (2.0 * radius - margins.gap).powi(2) {
        ties.push(middle);
        return [None; 2];
    }
    let distance = square.sqrt();
    let x = way.map(|part| part / distance);
    let local = |way: Place| -> Place { [dot(way, x), cross(x, way)] };
    let (c, u) = (local(minus(body.from, place)), local(body.along));
    let mut ends = [(f64::NEG_INFINITY, NONE), (f64::INFINITY, NONE)];
    let mut meet = |at: Place, with: u32| {
        let angle = at[1].atan2(at[0]);
        if angle < 0.0 && angle > ends[0].0 {
            ends[0] = (angle, with);
        }
        if angle > 0.0 && angle < ends[1].0 {
            ends[1] = (angle, with);
        }
    };
    let d = plus(c, body.length, u);
    for (end, at, sign) in [(0, c, 1.0), (1, d, -1.0)] {
        let far = dot(at, at);
        let rest = radius * radius - 0.25 * far;
        if rest > 0.0 {
            let side = (rest / far).sqrt();
            for side in [-side, side] {
                let meeting = [0.5 * at[0] - side * at[1], 0.5 * at[1] + side * at[0]];
                if sign * dot(minus(meeting, at), u) <= 0.0 {
                    meet(meeting, vertex_curve(body.ends[end]));
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
                        meet(meeting, half);
                    }
                }
            }
        }
    }
    if ends[0].1 == NONE || ends[1].1 == NONE {
        ties.push(middle);
        return [None; 2];
    }
    let span = |turn: f64| Span { ends: ends.map(|(angle, with)| (middle + turn + angle, with)) };
    let reaches = |span: &Span| span.ends[1].0 > -margins.along / radius && span.ends[0].0 < width + margins.along / radius;
    [0.0, -TAU].map(|turn| Some(span(turn)).filter(reaches))
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
        let own = if piece.meets[0] == NATURAL && matches!(piece.curve, Curve::Arc { is_second: true, .. }) { NONE - 1 } else { piece.meets[0] };
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
