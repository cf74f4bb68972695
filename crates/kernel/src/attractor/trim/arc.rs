//! Pieces of trim curves: rational Bezier arcs in the parameter plane.

use crate::de_casteljau::halves;

/// A point of the parameter plane, (u, v).
pub(crate) type Parameter = [f64; 2];

/// A rational Bezier arc with positive weights; it lies in the hull of its control points.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Arc {
    /// Control points (w u, w v, w).
    points: Vec<[f64; 3]>,
}

fn place(point: &[f64; 3]) -> Parameter {
    [point[0] / point[2], point[1] / point[2]]
}

fn minus(a: Parameter, b: Parameter) -> Parameter {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: Parameter, b: Parameter) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Twice the signed area of the triangle 0, a, b.
pub(super) fn cross(a: Parameter, b: Parameter) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// Directions between `low` and `high`, counterclockwise, less than half a turn apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    low: Parameter,
    high: Parameter,
}

impl Cone {
    fn holds(&self, direction: Parameter) -> bool {
        cross(self.low, direction) >= 0.0 && cross(direction, self.high) >= 0.0
    }

    /// Whether the opposite of this cone and the other one have a direction in common.
    pub(super) fn turns_back(&self, other: &Cone) -> bool {
        let opposite = Cone { low: [-self.low[0], -self.low[1]], high: [-self.high[0], -self.high[1]] };
        // Of two cones that meet, one holds an end of the other; beyond half a turn `holds` has to look at both ends.
        let inside = |cone: &Cone, direction| cone.holds(direction) && dot(cone.low, direction) + dot(cone.high, direction) > 0.0;
        inside(&opposite, other.low) || inside(&opposite, other.high) || inside(other, opposite.low) || inside(other, opposite.high)
    }
}

impl Arc {
    pub(crate) fn new(points: Vec<[f64; 3]>) -> Self {
        Self { points }
    }

    pub(super) fn segment(start: Parameter, end: Parameter) -> Self {
        Self { points: vec![[start[0], start[1], 1.0], [end[0], end[1], 1.0]] }
    }

    pub(crate) fn start(&self) -> Parameter {
        self.points.first().map_or([0.0; 2], place)
    }

    pub(crate) fn end(&self) -> Parameter {
        self.points.last().map_or([0.0; 2], place)
    }

    /// Moves the control points.
    pub(super) fn map(&mut self, mut to: impl FnMut(Parameter) -> Parameter) {
        for point in &mut self.points {
            let [u, v] = to(place(point));
            *point = [u * point[2], v * point[2], point[2]];
        }
    }

    /// Moves the start.
    pub(super) fn start_at(&mut self, [u, v]: Parameter) {
        if let Some(first) = self.points.first_mut() {
            *first = [u * first[2], v * first[2], first[2]];
        }
    }

    pub(super) fn reverse(&mut self) {
        self.points.reverse();
    }

    pub(super) fn is_straight(&self) -> bool {
        self.points.len() == 2
    }

    pub(super) fn homogeneous(&self) -> &[[f64; 3]] {
        &self.points
    }

    pub(super) fn control_points(&self) -> impl Iterator<Item = Parameter> {
        self.points.iter().map(place)
    }

    /// The two halves, by de Casteljau's algorithm.
    pub(super) fn halves(&self) -> [Self; 2] {
        halves(&self.points, |a, b| std::array::from_fn(|k| 0.5 * (a[k] + b[k]))).map(|points| Self { points })
    }

    /// The least box of the control points: [low, high].
    pub(super) fn bounds(&self) -> [Parameter; 2] {
        self.control_points().fold([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]], |[low, high], p| {
            [[low[0].min(p[0]), low[1].min(p[1])], [high[0].max(p[0]), high[1].max(p[1])]]
        })
    }

    /// The directions of the arc, if they are less than half a turn apart: tangents of a rational Bezier curve with
    /// positive weights are non-negative combinations of differences of control points P_j - P_i, j > i (Saito, Wang and
    /// Sederberg, "Hodographs and normals of rational curves and surfaces", Computer Aided Geometric Design 12, 1995), so
    /// of its legs. Such an arc has no point twice: it moves on along the middle of its directions.
    pub(super) fn directions(&self) -> Option<Cone> {
        let chord = minus(self.end(), self.start());
        let mut cone: Option<Cone> = None;
        let mut last = self.start();
        for point in self.control_points().skip(1) {
            let leg = minus(point, last);
            last = point;
            if leg == [0.0; 2] {
                continue;
            }
            if dot(leg, chord) <= 0.0 {
                return None;
            }
            let Cone { low, high } = *cone.get_or_insert(Cone { low: leg, high: leg });
            cone = Some(Cone { low: if cross(low, leg) < 0.0 { leg } else { low }, high: if cross(leg, high) < 0.0 { leg } else { high } });
        }
        cone
    }

    /// Whether a line between the hulls of the control points is found, with `gap` to spare. Always found for segments
    /// that are farther apart.
    pub(super) fn is_apart(&self, other: &Self, gap: f64) -> bool {
        let chords = [minus(self.end(), self.start()), minus(other.end(), other.start())];
        let axes = [[1.0, 0.0], [0.0, 1.0], chords[0], chords[1], [-chords[0][1], chords[0][0]], [-chords[1][1], chords[1][0]]];
        // Seen from a point of theirs, so that coordinates far from the origin lose nothing.
        let origin = self.start();
        axes.iter().any(|axis| {
            let length = dot(*axis, *axis).sqrt();
            let extent = |arc: &Self| {
                arc.control_points().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), point| {
                    let along = dot(minus(point, origin), *axis);
                    (low.min(along), high.max(along))
                })
            };
            let ((low, high), (other_low, other_high)) = (extent(self), extent(other));
            length > 0.0 && (other_low - high).max(low - other_high) > gap * length
        })
    }

    /// The largest distance of a control point from the chord, (u, v) being measured in these units.
    pub(super) fn sagitta(&self, scale: [f64; 2]) -> f64 {
        if self.is_straight() {
            return 0.0;
        }
        let scaled = |p: Parameter| [p[0] * scale[0], p[1] * scale[1]];
        let (start, end) = (scaled(self.start()), scaled(self.end()));
        let chord = minus(end, start);
        let square = dot(chord, chord);
        let off = |point: Parameter| {
            let offset = minus(scaled(point), start);
            let along = if square > 0.0 { (dot(offset, chord) / square).clamp(0.0, 1.0) } else { 0.0 };
            let rest = [offset[0] - along * chord[0], offset[1] - along * chord[1]];
            dot(rest, rest).sqrt()
        };
        self.control_points().map(off).fold(0.0, f64::max)
    }
}
