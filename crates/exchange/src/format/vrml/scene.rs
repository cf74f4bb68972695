//! From the text to a scene: the nodes that bear on polygons, as a tree whose branches may be shared by name.

use super::super::error::{FormatError, Place};
use super::super::limits::{reserve, within};
use super::super::read::{MeshFacts, Unit, keep_name};
use super::super::{Format, ReadLimits};
use super::scan::{Scan, Token, number};
use glam::{DAffine3, DMat4, DQuat, DVec3};
use std::collections::HashMap;

/// Nodes within nodes; exporters nest as deep as their assemblies, which are seldom ten levels.
const MOST_NESTING: u64 = 64;

/// Nodes that are kept, each of about 150 bytes. Assemblies have some ten thousand.
const MOST_NODES: u64 = 1_000_000;

/// What a node is for.
#[derive(Clone, Debug)]
pub(super) enum Kind {
    /// A list of nodes, whatever it is called.
    Group,
    /// A group that leaves no trace in what follows it.
    Separator,
    /// A group that leaves no transform.
    TransformSeparator,
    /// A map of space.
    Transform(DAffine3),
    /// Points.
    Coordinates(Vec<DVec3>),
    /// Polygons: indices, -1 after each polygon, and the line where they stand.
    Faces {
        /// The indices.
        indices: Vec<i32>,
        /// Their line.
        line: u64,
        /// Whether corners run clockwise.
        clockwise: bool,
    },
    /// Hints to the polygons that follow: whether corners run clockwise.
    Hints(bool),
    /// One of its children, by number; all for -3, none for other negative numbers.
    Choice(i64),
    /// Its first child, the most detailed.
    Detail,
    /// Something to see that is no polygon.
    Shape(&'static str),
}

/// A node.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) kind: Kind,
    /// Numbers of nodes; [`NOTHING`] keeps the place of one that bears on nothing.
    pub(super) children: Vec<u32>,
}

/// The number of no node.
pub(super) const NOTHING: u32 = u32::MAX;

/// A scene: nodes come before those that have them as children, so there is no cycle.
pub(super) struct Scene {
    pub(super) nodes: Vec<Node>,
    /// Numbers of the nodes at the top.
    pub(super) top: Vec<u32>,
}

/// Shapes that are no polygons, by their names in either version.
const SHAPES: [&str; 20] = [
    "Box",
    "Cone",
    "Cylinder",
    "Sphere",
    "Extrusion",
    "ElevationGrid",
    "Text",
    "PointSet",
    "IndexedLineSet",
    "Inline",
    "Cube",
    "AsciiText",
    "WWWInline",
    "FaceSet",
    "QuadMesh",
    "TriangleStripSet",
    "IndexedTriangleStripSet",
    "LineSet",
    "NurbsSurface",
    "IndexedNurbsSurface",
];

fn kind_of(word: &[u8], line: u64) -> Kind {
    match word {
        b"Separator" => Kind::Separator,
        b"TransformSeparator" => Kind::TransformSeparator,
        b"Transform" | b"Translation" | b"Rotation" | b"Scale" | b"MatrixTransform" => Kind::Transform(DAffine3::IDENTITY),
        b"Coordinate" | b"Coordinate3" | b"VertexProperty" => Kind::Coordinates(Vec::new()),
        b"IndexedFaceSet" => Kind::Faces { indices: Vec::new(), line, clockwise: false },
        b"ShapeHints" => Kind::Hints(false),
        b"Switch" => Kind::Choice(-1),
        b"LOD" => Kind::Detail,
        _ => SHAPES.iter().find(|name| name.as_bytes() == word).map_or(Kind::Group, |name| Kind::Shape(name)),
    }
}

/// Reads the whole text.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits, facts: &mut MeshFacts) -> Result<Scene, FormatError> {
    let mut reader =
        Reader { scan: Scan::new(bytes), limits, facts, nodes: Vec::new(), names: HashMap::new(), points: 0, indices: 0, depth: 0 };
    let mut top = Node { kind: Kind::Group, children: Vec::new() };
    while reader.scan.peek()? != Token::End {
        reader.statement(&mut top, &mut Parts::default())?;
    }
    if reader.scan.says_millimetres {
        reader.facts.unit = Some(Unit::Millimetre);
    }
    Ok(Scene { nodes: reader.nodes, top: top.children })
}

/// What makes the map of a transform; the last value counts, as in a browser.
struct Parts {
    translation: DVec3,
    rotation: [f64; 4],
    scale: DVec3,
    scale_orientation: [f64; 4],
    centre: DVec3,
    matrix: Option<DAffine3>,
}

impl Default for Parts {
    fn default() -> Self {
        let none = [0.0, 0.0, 1.0, 0.0];
        let (translation, centre, scale) = (DVec3::ZERO, DVec3::ZERO, DVec3::ONE);
        Self { translation, rotation: none, scale, scale_orientation: none, centre, matrix: None }
    }
}

impl Parts {
    /// T C R O S O^-1 C^-1, as both versions define it.
    fn map(&self) -> DAffine3 {
        let turn = |[x, y, z, angle]: [f64; 4]| {
            DAffine3::from_quat(DQuat::from_axis_angle(DVec3::new(x, y, z).try_normalize().unwrap_or(DVec3::Z), angle))
        };
        let orientation = turn(self.scale_orientation);
        let back = turn([self.scale_orientation[0], self.scale_orientation[1], self.scale_orientation[2], -self.scale_orientation[3]]);
        let inner = turn(self.rotation) * orientation * DAffine3::from_scale(self.scale) * back;
        let about = DAffine3::from_translation(self.centre) * inner * DAffine3::from_translation(-self.centre);
        self.matrix.unwrap_or(DAffine3::from_translation(self.translation) * about)
    }
}

struct Reader<'a, 'f> {
    scan: Scan<'a>,
    limits: &'a ReadLimits,
    facts: &'f mut MeshFacts,
    nodes: Vec<Node>,
    names: HashMap<&'a [u8], u32>,
    /// Of all nodes so far.
    points: u64,
    indices: u64,
    depth: u64,
}

impl<'a> Reader<'a, '_> {
    /// A field, a child or a stray value in the body of a node.
    fn statement(&mut self, node: &mut Node, parts: &mut Parts) -> Result<(), FormatError> {
        let word = match self.scan.next()? {
            Token::Word(word) => word,
            // A value beyond those that its field has.
            Token::Text => return Ok(()),
            other => return Err(self.scan.malformed("a field or a node", other)),
        };
        if number(word).is_some() {
            return Ok(());
        }
        match word {
            b"PROTO" | b"EXTERNPROTO" => {
                Err(FormatError::Refused { place: self.scan.place(), what: "prototypes; export the scene without them" })
            }
            b"ROUTE" => (0..3).try_for_each(|_| match self.scan.next()? {
                Token::Word(_) => Ok(()),
                other => Err(self.scan.malformed("ROUTE a.b TO c.d", other)),
            }),
            b"DEF" | b"USE" => self.child(word, node),
            _ if self.scan.peek()? == Token::Open => self.child(word, node),
            _ => self.field(word, node, parts),
        }
    }

    /// The node that `word` begins, as a child.
    fn child(&mut self, word: &'a [u8], parent: &mut Node) -> Result<(), FormatError> {
        let child = self.node(word)?;
        if child != NOTHING || matches!(parent.kind, Kind::Choice(_) | Kind::Detail) {
            parent.children.push(child);
        }
        Ok(())
    }

    /// `DEF name Type { ... }`, `USE name` or `Type { ... }`, whose first word is `word`.
    fn node(&mut self, word: &'a [u8]) -> Result<u32, FormatError> {
        if word != b"DEF" && word != b"USE" {
            return self.body(word);
        }
        let name = match self.scan.next()? {
            Token::Word(name) => name,
            other => return Err(self.scan.malformed("a name", other)),
        };
        if word == b"USE" {
            return self.names.get(name).copied().ok_or_else(|| self.scan.malformed("a name that DEF gave before", Token::Word(name)));
        }
        let kind = match self.scan.next()? {
            Token::Word(kind) if kind != b"DEF" && kind != b"USE" => kind,
            other => return Err(self.scan.malformed("the type of a node", other)),
        };
        let node = self.body(kind)?;
        if self.nodes.get(node as usize).is_some_and(|node| !matches!(node.kind, Kind::Coordinates(_))) {
            keep_name(self.facts, name);
        }
        self.names.insert(name, node);
        Ok(node)
    }

    /// The body of a node of type `word`.
    fn body(&mut self, word: &'a [u8]) -> Result<u32, FormatError> {
        match self.scan.next()? {
            Token::Open => {}
            other => return Err(self.scan.malformed("{ after the type of a node", other)),
        }
        self.depth += 1;
        within(self.scan.place(), "scene_nesting", self.depth, MOST_NESTING)?;
        let mut node = Node { kind: kind_of(word, self.scan.line()), children: Vec::new() };
        let mut parts = Parts::default();
        while self.scan.peek()? != Token::Close {
            self.statement(&mut node, &mut parts)?;
        }
        self.scan.next()?;
        self.depth -= 1;
        if let Kind::Transform(map) = &mut node.kind {
            *map = parts.map();
        }
        // Materials, cameras and the like are groups without children.
        if matches!(node.kind, Kind::Group) && node.children.is_empty() {
            return Ok(NOTHING);
        }
        within(self.scan.place(), "scene_nodes", self.nodes.len() as u64 + 1, MOST_NODES)?;
        self.nodes.push(node);
        Ok(self.nodes.len() as u32 - 1)
    }

    fn field(&mut self, name: &'a [u8], node: &mut Node, parts: &mut Parts) -> Result<(), FormatError> {
        match (&mut node.kind, name) {
            (Kind::Coordinates(points), b"point" | b"vertex") => return self.points(points),
            (Kind::Faces { indices, line, .. }, b"coordIndex") => {
                *line = self.scan.line();
                return self.indices(indices);
            }
            (Kind::Faces { clockwise, .. }, b"ccw") => *clockwise = self.word()? == b"FALSE",
            (Kind::Hints(clockwise), b"vertexOrdering") => *clockwise = self.word()? == b"CLOCKWISE",
            (Kind::Choice(which), b"whichChild" | b"whichChoice") => *which = self.numbers::<1>()?[0] as i64,
            (Kind::Transform(_), b"translation") => parts.translation = DVec3::from_array(self.numbers()?),
            (Kind::Transform(_), b"rotation") => parts.rotation = self.numbers()?,
            (Kind::Transform(_), b"scale" | b"scaleFactor") => parts.scale = DVec3::from_array(self.numbers()?),
            (Kind::Transform(_), b"scaleOrientation") => parts.scale_orientation = self.numbers()?,
            (Kind::Transform(_), b"center") => parts.centre = DVec3::from_array(self.numbers()?),
            (Kind::Transform(_), b"matrix") => parts.matrix = Some(self.matrix()?),
            _ => return self.value(name, node),
        }
        Ok(())
    }

    /// A value of any type; nodes in it are children, except those that stand for others.
    fn value(&mut self, name: &'a [u8], node: &mut Node) -> Result<(), FormatError> {
        let counts = name != b"proxy";
        let mut unseen = Node { kind: Kind::Group, children: Vec::new() };
        let parent = if counts { node } else { &mut unseen };
        match self.scan.peek()? {
            Token::Close => Ok(()),
            Token::ListOpen => {
                self.scan.next()?;
                loop {
                    match self.scan.next()? {
                        Token::ListClose => return Ok(()),
                        Token::Word(word) => self.item(word, parent)?,
                        Token::Text => {}
                        other => return Err(self.scan.malformed("an item or ] of a list", other)),
                    }
                }
            }
            Token::Text => self.scan.next().map(drop),
            Token::Word(word) if number(word).is_some() => {
                while matches!(self.scan.peek()?, Token::Word(word) if number(word).is_some()) {
                    self.scan.next()?;
                }
                Ok(())
            }
            Token::Word(word) => {
                self.scan.next()?;
                self.item(word, parent)
            }
            other => Err(self.scan.malformed("a value", other)),
        }
    }

    /// A node, or a word that is none.
    fn item(&mut self, word: &'a [u8], parent: &mut Node) -> Result<(), FormatError> {
        if matches!(word, b"DEF" | b"USE") || number(word).is_none() && self.scan.peek()? == Token::Open {
            return self.child(word, parent);
        }
        Ok(())
    }

    fn word(&mut self) -> Result<&'a [u8], FormatError> {
        match self.scan.next()? {
            Token::Word(word) => Ok(word),
            other => Err(self.scan.malformed("a word", other)),
        }
    }

    /// The next word as a number.
    fn number(&mut self) -> Result<f64, FormatError> {
        let token = self.scan.next()?;
        let value = if let Token::Word(word) = token { number(word) } else { None };
        value.ok_or_else(|| self.scan.malformed("a number", token))
    }

    fn numbers<const COUNT: usize>(&mut self) -> Result<[f64; COUNT], FormatError> {
        let mut numbers = [0.0; COUNT];
        numbers.iter_mut().try_for_each(|value| {
            *value = self.number()?;
            Ok::<(), FormatError>(())
        })?;
        Ok(numbers)
    }

    /// Rows of a map that acts on rows; its last column must be that of an affine map.
    fn matrix(&mut self) -> Result<DAffine3, FormatError> {
        let entries = self.numbers::<16>()?;
        if [entries[3], entries[7], entries[11], entries[15]] != [0.0, 0.0, 0.0, 1.0] {
            return Err(FormatError::Refused { place: self.scan.place(), what: "a matrix with perspective" });
        }
        Ok(DAffine3::from_mat4(DMat4::from_cols_array(&entries)))
    }

    /// Hands over the numbers of a list, or a single run of them without brackets.
    fn each_number(&mut self, mut take: impl FnMut(f64, Token<'a>, &Scan<'a>) -> Result<(), FormatError>) -> Result<(), FormatError> {
        let bracketed = self.scan.peek()? == Token::ListOpen;
        if bracketed {
            self.scan.next()?;
        }
        loop {
            let token = self.scan.peek()?;
            let value = if let Token::Word(word) = token { number(word) } else { None };
            match value {
                Some(value) => {
                    self.scan.next()?;
                    take(value, token, &self.scan)?;
                }
                None if bracketed && token == Token::ListClose => return self.scan.next().map(drop),
                None if bracketed => return Err(self.scan.malformed("a number or ] of a list", token)),
                None => return Ok(()),
            }
        }
    }

    fn points(&mut self, points: &mut Vec<DVec3>) -> Result<(), FormatError> {
        points.clear();
        let (mut total, most) = (self.points, self.limits.vertices);
        let (mut point, mut filled) = ([0.0; 3], 0);
        self.each_number(|value, _, scan| {
            if !value.is_finite() {
                return Err(FormatError::NotFinite { place: scan.place(), value });
            }
            point[filled] = value;
            filled = (filled + 1) % 3;
            if filled == 0 {
                total += 1;
                within(scan.place(), "vertices", total, most)?;
                push(points, DVec3::from_array(point), || scan.place())?;
            }
            Ok(())
        })?;
        self.points = total;
        if filled == 0 { Ok(()) } else { Err(self.scan.malformed("three coordinates for every point", Token::ListClose)) }
    }

    fn indices(&mut self, indices: &mut Vec<i32>) -> Result<(), FormatError> {
        indices.clear();
        let (mut total, most) = (self.indices, most_indices(self.limits));
        self.each_number(|value, token, scan| {
            total += 1;
            within(scan.place(), "triangles", total / 4, most / 4)?;
            #[expect(clippy::cast_possible_truncation, reason = "whole and in range, by the test")]
            if value.fract() == 0.0 && (-1.0..=f64::from(i32::MAX)).contains(&value) {
                return push(indices, value as i32, || scan.place());
            }
            Err(FormatError::malformed(
                Format::Vrml,
                scan.place(),
                "an index of a vertex, or -1",
                if let Token::Word(word) = token { word } else { b"" },
            ))
        })?;
        self.indices = total;
        Ok(())
    }
}

/// Indices that the polygons of so many triangles have at most: a polygon of n corners takes n + 1 and makes
/// n - 2 triangles, and n + 1 <= 4 (n - 2).
pub(super) fn most_indices(limits: &ReadLimits) -> u64 {
    limits.triangles.saturating_mul(4).saturating_add(16)
}

fn push<T>(vector: &mut Vec<T>, item: T, place: impl Fn() -> Place) -> Result<(), FormatError> {
    if vector.len() == vector.capacity() {
        reserve(vector, 1, &place())?;
    }
    vector.push(item);
    Ok(())
}
