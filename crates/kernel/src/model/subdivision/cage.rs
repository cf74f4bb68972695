//! From a document's mesh to a labelled half-edge mesh, or to all that is wrong with it.

use super::host::{Host, NONE, edge_index};
use super::refine::Masks;
use super::{BoundaryRule, INFINITE_SHARPNESS, Scheme, Subdivision};
use crate::model::lower::Draft;
use glam::DVec3;

/// A mesh that the scheme can be run on.
pub(super) struct Cage {
    pub(super) host: Host,
    pub(super) points: Vec<DVec3>,
    /// Number of vertices that have patches of their own (Doo-Sabin); those that only double the boundary follow.
    pub(super) own_vertices: usize,
}

/// Findings of one kind are listed up to this number.
const MOST_FINDINGS: usize = 20;
/// Sides of a face, or faces at a vertex: a patch there has at least twice as many control points.
const MOST_SIDES: usize = 64;

/// Reports at most [`MOST_FINDINGS`] findings.
struct Report<'a> {
    draft: &'a mut Draft,
    count: usize,
}

impl Report<'_> {
    fn error(&mut self, pointer: &str, code: &'static str, message: String) {
        self.count += 1;
        if self.count <= MOST_FINDINGS {
            self.draft.error(pointer, code, message);
        }
    }
}

impl Cage {
    /// Checks the mesh, its creases and corners. `None` after errors, all of which are reported, up to twenty.
    pub(super) fn new(model: &Subdivision, draft: &mut Draft) -> Option<Self> {
        let mut report = Report { draft, count: 0 };
        faces(model, &mut report);
        if report.count > 0 {
            return None;
        }
        let regions = regions(model, &mut report);
        let mut host = Host::new(model.vertices.len(), &model.faces, regions);
        edges(&host, &mut report);
        if report.count > 0 {
            return None;
        }
        host = host.complete();
        vertices(&host, model.scheme, &mut report);
        labels(model, &mut host, &mut report);
        if report.count > 0 {
            return None;
        }
        let cage = Self { host, points: model.vertices.clone(), own_vertices: model.vertices.len() };
        Some(if model.scheme == Scheme::DooSabin { cage.doubled(model) } else { cage.sharp(model.boundary) })
    }

    /// One step of the scheme on the whole mesh.
    pub(super) fn refined(&self, (host, masks): (Host, Masks), scheme: Scheme) -> Self {
        let place = |vertex: u32| masks.of(vertex).iter().map(|&(source, weight)| weight * self.points[source as usize]).sum();
        let points: Vec<DVec3> = (0..host.vertices as u32).map(place).collect();
        let own_vertices = if scheme == Scheme::DooSabin { host.vertices } else { points.len() };
        Self { host, points, own_vertices }
    }

    /// Boundaries of Catmull-Clark and Loop are creases for ever.
    fn sharp(mut self, boundary: BoundaryRule) -> Self {
        for h in 0..self.host.origin.len() {
            if self.host.twin[h] == NONE {
                self.host.sharpness[h] = f64::INFINITY;
            }
        }
        self.host = self.host.complete();
        for vertex in 0..self.points.len() {
            let out = self.host.out[vertex];
            let alone = self.host.twin[out as usize] == NONE && self.host.counterclockwise(out) == NONE;
            if self.host.infinite_edges(vertex as u32) > 2 || (alone && boundary == BoundaryRule::SharpCorners) {
                self.host.corner[vertex] = f64::INFINITY;
            }
        }
        self
    }

    /// Doo-Sabin with a boundary: the boundary's vertices are doubled in place, as end points of a quadratic B-spline
    /// are, so that the surface ends in the quadratic B-spline of the boundary polygon. Vertices with patches come
    /// first and have all faces around them.
    fn doubled(self, model: &Subdivision) -> Self {
        let host = &self.host;
        let mut points = self.points.clone();
        let mut faces = model.faces.clone();
        // The doubles of a vertex that end the faces before and behind it along the boundary.
        let mut doubles = vec![[NONE; 2]; self.own_vertices];
        for h in (0..host.origin.len() as u32).filter(|&h| host.twin[h as usize] == NONE) {
            let vertex = host.origin[h as usize] as usize;
            let double = |points: &mut Vec<DVec3>| {
                points.push(self.points[vertex]);
                points.len() as u32 - 1
            };
            let first = double(&mut points);
            doubles[vertex] = [first; 2];
            if model.boundary == BoundaryRule::SharpCorners && host.counterclockwise(h) == NONE {
                let (second, middle) = (double(&mut points), double(&mut points));
                doubles[vertex][1] = second;
                faces.push(vec![vertex as u32, first, middle, second]);
            }
        }
        for h in (0..host.origin.len() as u32).filter(|&h| host.twin[h as usize] == NONE) {
            let (a, b) = (host.origin[h as usize], host.destination(h));
            faces.push(vec![b, a, doubles[a as usize][1], doubles[b as usize][0]]);
        }
        let mut region = host.region.clone();
        region.resize(faces.len(), 0);
        let host = Host::new(points.len(), &faces, region).complete();
        Self { host, points, own_vertices: self.own_vertices }
    }
}

/// Every face by itself, and every vertex.
fn faces(model: &Subdivision, report: &mut Report) {
    if model.faces.is_empty() {
        report.error("/mesh/faces", "subdivision.empty", "the mesh has no face".into());
    }
    for (index, vertex) in model.vertices.iter().enumerate().filter(|(_, vertex)| !vertex.is_finite()) {
        let message = format!("vertex {index} is {vertex}, and must be finite");
        report.error(&format!("/mesh/vertices/{index}"), "model.not-finite", message);
    }
    let mut sorted = Vec::new();
    for (index, face) in model.faces.iter().enumerate() {
        let mut fault = |code, message: String| report.error(&format!("/mesh/faces/{index}"), code, format!("face {index}: {message}"));
        sorted.clone_from(face);
        sorted.sort_unstable();
        if let Some(vertex) = face.iter().find(|&&vertex| vertex as usize >= model.vertices.len()) {
            fault("mesh.index", format!("vertex {vertex} does not exist: there are {}", model.vertices.len()));
        } else if face.len() < 3 {
            fault("subdivision.face-size", format!("it has {} vertices, and needs three or more", face.len()));
        } else if let Some(pair) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            fault("mesh.repeated-vertex", format!("vertex {} occurs twice", pair[0]));
        } else if model.scheme == Scheme::Loop && face.len() != 3 {
            let message = format!("it has {} vertices, and Loop's scheme takes triangles; split it, or use catmull_clark", face.len());
            fault("subdivision.not-a-triangle", message);
        } else if face.len() > MOST_SIDES {
            fault("subdivision.valence", format!("it has {} sides, and at most {MOST_SIDES} are allowed; split it", face.len()));
        }
    }
}

/// Every edge: at most two faces, which run along it in opposite directions.
fn edges(host: &Host, report: &mut Report) {
    let mut all: Vec<(u32, u32, u32)> = (0..host.origin.len() as u32)
        .map(|h| {
            let side = host.side(h);
            (side.from.min(side.to), side.from.max(side.to), h)
        })
        .collect();
    all.sort_unstable();
    for group in all.chunk_by(|left, right| (left.0, left.1) == (right.0, right.1)) {
        let (a, b, first) = group[0];
        let faces: Vec<u32> = group.iter().map(|edge| host.face[edge.2 as usize]).collect();
        let pointer = format!("/mesh/faces/{}", faces[faces.len() - 1]);
        if group.len() > 2 {
            let message = format!("edge ({a}, {b}) belongs to {} faces, {faces:?}, and to two at most on a manifold", group.len());
            report.error(&pointer, "mesh.nonmanifold-edge", message);
        } else if group.len() == 2 && host.origin[first as usize] == host.origin[group[1].2 as usize] {
            let message =
                format!("faces {} and {} run along edge ({a}, {b}) in the same direction; turn one of them round", faces[0], faces[1]);
            report.error(&pointer, "mesh.orientation", message);
        }
    }
}

/// Every vertex: it has faces, which form one fan.
fn vertices(host: &Host, scheme: Scheme, report: &mut Report) {
    let mut count = vec![0_usize; host.vertices];
    host.origin.iter().for_each(|&vertex| count[vertex as usize] += 1);
    let (mut ahead, mut behind) = (Vec::new(), Vec::new());
    for (vertex, &count) in count.iter().enumerate() {
        let mut fault =
            |code, message: String| report.error(&format!("/mesh/vertices/{vertex}"), code, format!("vertex {vertex} {message}"));
        if count == 0 {
            fault("mesh.isolated-vertex", "belongs to no face; remove it".into());
            continue;
        }
        let closed = host.fan(host.out[vertex], false, &mut ahead, &mut behind);
        let fan = ahead.len() + behind.len();
        if fan < count {
            let message = format!("is a bow-tie: {fan} of its {count} faces hang together, the others meet them only there; double it");
            fault("mesh.bow-tie", message);
        } else if closed && count == 2 && scheme != Scheme::CatmullClark {
            // Doo-Sabin would make a face of two sides, Loop two edges between the same vertices.
            let message = format!("belongs to two faces alone, and {} needs three; remove it, or use catmull_clark", scheme.name());
            fault("subdivision.valence", message);
        } else if count > MOST_SIDES {
            fault("subdivision.valence", format!("belongs to {count} faces, and at most {MOST_SIDES} are allowed"));
        }
    }
}

/// Creases and corners.
fn labels(model: &Subdivision, host: &mut Host, report: &mut Report) {
    if model.scheme == Scheme::DooSabin && !(model.creases.is_empty() && model.corners.is_empty()) {
        let pointer = if model.creases.is_empty() { "/corners" } else { "/creases" };
        report.error(pointer, "subdivision.no-creases", "Doo and Sabin's scheme has no creases; use catmull_clark or loop".into());
        return;
    }
    let lasting = |sharpness: f64| if sharpness >= INFINITE_SHARPNESS { f64::INFINITY } else { sharpness };
    let refused = |sharpness: f64| format!("the sharpness is {sharpness}, and must be 0 or more, or \"infinite\"");
    let index = if model.creases.is_empty() { std::collections::BTreeMap::new() } else { edge_index(host) };
    let mut known = std::collections::BTreeSet::new();
    for (position, crease) in model.creases.iter().enumerate() {
        let [a, b] = crease.edge;
        let key = (a.min(b), a.max(b));
        let place = format!("/creases/{position}");
        if crease.sharpness.is_nan() || crease.sharpness < 0.0 {
            report.error(&format!("{place}/sharpness"), "subdivision.sharpness", refused(crease.sharpness));
        }
        match index.get(&key) {
            None => report.error(&format!("{place}/edge"), "subdivision.no-edge", format!("the mesh has no edge ({a}, {b})")),
            Some(_) if !known.insert(key) => {
                report.error(&format!("{place}/edge"), "subdivision.edge-twice", format!("edge ({a}, {b}) is listed before"));
            }
            Some(&h) => host.sharpen(h, lasting(crease.sharpness)),
        }
    }
    let mut known = std::collections::BTreeSet::new();
    for (position, corner) in model.corners.iter().enumerate() {
        let place = format!("/corners/{position}");
        if corner.sharpness.is_nan() || corner.sharpness < 0.0 {
            report.error(&format!("{place}/sharpness"), "subdivision.sharpness", refused(corner.sharpness));
        }
        if corner.vertex as usize >= host.vertices {
            let message = format!("vertex {} does not exist: there are {}", corner.vertex, host.vertices);
            report.error(&format!("{place}/vertex"), "mesh.index", message);
        } else if known.insert(corner.vertex) {
            host.corner[corner.vertex as usize] = lasting(corner.sharpness);
        } else {
            report.error(&format!("{place}/vertex"), "subdivision.vertex-twice", format!("vertex {} is listed before", corner.vertex));
        }
    }
}

/// Weights of one's own may not be larger.
const MOST_WEIGHT: f64 = 1e3;
/// Their sum may be off 1 by this much, as printed digits leave it; it is corrected by the operators.
const SUM_ALLOWED: f64 = 1e-9;

/// The region of every face, from the coefficients.
fn regions(model: &Subdivision, report: &mut Report) -> Vec<u32> {
    let mut regions = vec![0; model.faces.len()];
    if model.scheme != Scheme::DooSabin && !model.coefficients.is_empty() {
        let message = format!("coefficients are for the scheme doo_sabin; {} has its own masks", model.scheme.name());
        report.error("/coefficients", "subdivision.coefficients", message);
    }
    for (index, own) in model.coefficients.iter().enumerate() {
        let place = format!("/coefficients/{index}");
        let all: Vec<u32> = (0..model.faces.len() as u32).collect();
        for (position, &face) in own.faces.as_ref().unwrap_or(&all).iter().enumerate() {
            match regions.get_mut(face as usize) {
                Some(region) if *region == 0 => *region = index as u32 + 1,
                Some(_) => {
                    let message = format!("face {face} is in a region before; a face belongs to one");
                    report.error(&format!("{place}/faces/{position}"), "subdivision.region-twice", message);
                }
                None => {
                    let message = format!("face {face} does not exist: there are {}", model.faces.len());
                    report.error(&format!("{place}/faces/{position}"), "mesh.index", message);
                }
            }
        }
        for (position, weights) in own.weights.iter().enumerate() {
            let sum: f64 = weights.iter().sum();
            let large = weights.iter().any(|weight| !weight.is_finite() || weight.abs() > MOST_WEIGHT);
            let twice = own.weights[..position].iter().any(|other| other.len() == weights.len());
            let fault = match weights.len() {
                0..3 => Some("faces have three sides or more, and as many weights".into()),
                _ if large => Some(format!("every weight must be finite, and at most {MOST_WEIGHT} in size")),
                _ if (sum - 1.0).abs() > SUM_ALLOWED => Some(format!("the weights sum to {sum}, and must sum to 1")),
                n if twice => Some(format!("faces of {n} sides have weights before")),
                _ => None,
            };
            if let Some(message) = fault {
                report.error(&format!("{place}/weights/{position}"), "subdivision.coefficients", message);
            }
        }
    }
    regions
}
