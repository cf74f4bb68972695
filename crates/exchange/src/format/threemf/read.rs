//! Reading 3MF files: archive, start part, objects, and the build that places them.

use super::super::error::{FormatError, Place};
use super::super::limits::{MeshBuilder, within};
use super::super::read::{MeshFacts, MeshFile, Unit, keep_name};
use super::super::text::{decimal, integer, words};
use super::super::{Format, ReadLimits};
use super::xml::{Allowance, Tag, visit};
use super::{CORE_NAMESPACE, LACUNA_NAMESPACE, MODEL_RELATIONSHIP, RELATIONSHIPS_PART, malformed};
use glam::{DAffine3, DVec3};
use lacuna_kernel::solid::TriMesh;
use quick_xml::events::BytesStart;
use std::collections::BTreeMap;
use std::io::Cursor;
use zip::ZipArchive;

const PRODUCTION_NAMESPACE: &str = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06";
/// Extensions that a file may require without changing what its meshes are.
const HARMLESS_NAMESPACES: [&str; 5] = [
    CORE_NAMESPACE,
    LACUNA_NAMESPACE,
    PRODUCTION_NAMESPACE,
    "http://schemas.microsoft.com/3dmanufacturing/material/2015/02",
    "http://schemas.microsoft.com/3dmanufacturing/trianglesets/2021/07",
];

/// A placed reference to an object.
#[derive(Clone)]
struct Reference {
    /// Part that holds the object, if not the same.
    part: Option<String>,
    object: u32,
    transform: DAffine3,
}

#[derive(Default)]
struct Object {
    mesh: TriMesh,
    components: Vec<Reference>,
    /// Whether it is to be made, rather than a support or an aid.
    is_model: bool,
    name: Vec<u8>,
}

/// A model part.
#[derive(Default)]
struct Model {
    unit: Option<Unit>,
    objects: BTreeMap<u32, Object>,
    items: Vec<Reference>,
}

/// The archive with what is left of the limits.
struct Package<'a> {
    archive: ZipArchive<Cursor<&'a [u8]>>,
    allowance: Allowance,
    limits: &'a ReadLimits,
    /// Vertices and triangles of all objects so far.
    parsed: (u64, u64),
}

pub(crate) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<MeshFile, FormatError> {
    let mut package = open(bytes, limits)?;
    let root_name = start_part(&mut package)?;
    let mut models = BTreeMap::new();
    let root = package.model(&root_name)?;
    let unit = root.unit.unwrap_or(Unit::Millimetre);
    let items = root.items.clone();
    models.insert(root_name.clone(), root);
    let mut facts = MeshFacts::of(Format::ThreeMf, "xml");
    facts.unit = Some(unit);
    let mut placing = Placing { package, models, facts, builder: MeshBuilder::new(limits), instances: 0, unit };
    for item in &items {
        placing.place(&root_name, item, DAffine3::IDENTITY, 0)?;
    }
    if placing.builder.vertex_count() == 0 {
        return Err(malformed(&root_name, 0, "an object of type model in the build", b"none"));
    }
    Ok(MeshFile::new(placing.builder, placing.facts))
}

fn open<'a>(bytes: &'a [u8], limits: &'a ReadLimits) -> Result<Package<'a>, FormatError> {
    let archive = ZipArchive::new(Cursor::new(bytes)).map_err(|source| FormatError::Archive { place: Place::File, source })?;
    within(Place::File, "archive_entries", archive.len() as u64, limits.archive_entries)?;
    if archive.has_duplicate_names() {
        return Err(FormatError::Refused { place: Place::File, what: "two archive entries of one name" });
    }
    for name in archive.file_names_raw() {
        let climbs = name.split(|&byte| byte == b'/').any(|step| step == b"..");
        if climbs || name.starts_with(b"/") || name.contains(&b'\\') || name.contains(&0) {
            let name = String::from_utf8_lossy(name.get(..80).unwrap_or(name)).into_owned();
            let place = Place::Part { name, byte: 0 };
            return Err(FormatError::Refused { place, what: "an archive entry whose name is a path out of it" });
        }
    }
    // A few lines that repeat deflate better than any mesh, and harm nobody.
    const ALWAYS_ALLOWED: u64 = 1 << 20;
    let ratio_most = (bytes.len() as u64).saturating_mul(limits.inflation_ratio).max(ALWAYS_ALLOWED);
    let archive_most = limits.inflated_bytes.min(ratio_most);
    let allowance = Allowance { archive_left: archive_most, archive_most, depth_most: limits.xml_depth };
    Ok(Package { archive, allowance, limits, parsed: (0, 0) })
}

/// The part that the package's relationships name as its model.
fn start_part(package: &mut Package<'_>) -> Result<String, FormatError> {
    let mut start = None;
    package.visit(RELATIONSHIPS_PART, &mut |tag, byte| {
        let Tag::Start(element) = tag else { return Ok(()) };
        if element.local_name().into_inner() != "Relationship" {
            return Ok(());
        }
        if attribute(element, "TargetMode").is_some_and(|mode| mode == "External") {
            let place = Place::Part { name: RELATIONSHIPS_PART.to_owned(), byte };
            return Err(FormatError::Refused { place, what: "an external part" });
        }
        if attribute(element, "Type").is_some_and(|kind| kind == MODEL_RELATIONSHIP) {
            start = attribute(element, "Target").map(|target| target.trim_start_matches('/').to_owned());
        }
        Ok(())
    })?;
    start.ok_or_else(|| malformed(RELATIONSHIPS_PART, 0, "a relationship to a model", b"none"))
}

impl Package<'_> {
    /// Goes through the tags of a part, whose name is compared without regard to case.
    fn visit(&mut self, part: &str, visitor: &mut dyn FnMut(Tag<'_, '_>, u64) -> Result<(), FormatError>) -> Result<(), FormatError> {
        let same = |name: &[u8]| name.eq_ignore_ascii_case(part.as_bytes());
        let index = self.archive.file_names_raw().position(same);
        let index = index.ok_or_else(|| malformed(part, 0, "the part in the archive", b"none"))?;
        let place = || Place::Part { name: part.to_owned(), byte: 0 };
        let entry = self.archive.by_index(index).map_err(|source| FormatError::Archive { place: place(), source })?;
        visit(entry, part, &mut self.allowance, visitor)
    }

    fn model(&mut self, part: &str) -> Result<Model, FormatError> {
        let mut reading = ModelReading {
            part,
            limits: self.limits,
            parsed: self.parsed,
            core_prefix: None,
            production_prefix: None,
            model: Model::default(),
            object: None,
        };
        self.visit(part, &mut |tag, byte| match tag {
            Tag::Start(element) => reading.start(element, byte),
            Tag::End(name) => reading.end(name, byte),
        })?;
        let (model, parsed) = (reading.model, reading.parsed);
        self.parsed = parsed;
        Ok(model)
    }
}

/// The raw value of an attribute.
fn attribute<'a>(element: &'a BytesStart<'_>, name: &str) -> Option<std::borrow::Cow<'a, str>> {
    let mut attributes = element.attributes();
    // The check for repeated names is quadratic; the first of a name counts here.
    attributes.with_checks(false).flatten().find(|found| found.key.0 == name).map(|found| found.value)
}

/// A model part while it is read.
struct ModelReading<'a> {
    part: &'a str,
    limits: &'a ReadLimits,
    parsed: (u64, u64),
    /// Prefix with its colon under which the root declares the core namespace; often empty.
    core_prefix: Option<String>,
    production_prefix: Option<String>,
    model: Model,
    object: Option<(u32, Object, MeshBuilder<'a>)>,
}

impl ModelReading<'_> {
    fn place(&self, byte: u64) -> Place {
        Place::Part { name: self.part.to_owned(), byte }
    }

    fn malformed(&self, byte: u64, expected: &'static str, element: &BytesStart<'_>) -> FormatError {
        malformed(self.part, byte, expected, element.as_bytes())
    }

    /// The local name, if the element is of the core namespace.
    fn core<'n>(&self, name: &'n str) -> Option<&'n str> {
        name.strip_prefix(self.core_prefix.as_deref()?).filter(|local| !local.contains(':'))
    }

    fn start(&mut self, element: &BytesStart<'_>, byte: u64) -> Result<(), FormatError> {
        let name = element.name().0;
        if self.core_prefix.is_none() {
            return self.start_model(element, byte);
        }
        match self.core(name) {
            Some("vertex") => self.vertex(element, byte),
            Some("triangle") => self.triangle(element, byte),
            Some("object") => self.start_object(element, byte),
            Some("component") => {
                let reference = self.reference(element, byte)?;
                match &mut self.object {
                    Some((_, object, _)) => object.components.push(reference),
                    None => return Err(self.malformed(byte, "a component in an object", element)),
                }
                Ok(())
            }
            Some("item") => {
                let reference = self.reference(element, byte)?;
                self.model.items.push(reference);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// The root element: unit, prefixes, and what a reader must know.
    fn start_model(&mut self, element: &BytesStart<'_>, byte: u64) -> Result<(), FormatError> {
        let mut prefixes = BTreeMap::new();
        let (mut required, mut unit) = (String::new(), None);
        for found in element.attributes().with_checks(false).flatten() {
            match found.key.0 {
                "xmlns" => drop(prefixes.insert(String::new(), found.value.into_owned())),
                "unit" => unit = Some(found.value),
                "requiredextensions" => required = found.value.into_owned(),
                other => {
                    if let Some(prefix) = other.strip_prefix("xmlns:") {
                        prefixes.insert(format!("{prefix}:"), found.value.into_owned());
                    }
                }
            }
        }
        let declared = |namespace: &str| prefixes.iter().find(|(_, value)| *value == namespace).map(|(prefix, _)| prefix.clone());
        self.core_prefix = declared(CORE_NAMESPACE);
        self.production_prefix = declared(PRODUCTION_NAMESPACE);
        if self.core(element.name().0) != Some("model") {
            return Err(self.malformed(byte, "the element model of the core namespace", element));
        }
        for prefix in required.split_ascii_whitespace() {
            let known = prefixes.get(&format!("{prefix}:")).is_some_and(|name| HARMLESS_NAMESPACES.contains(&name.as_str()));
            if !known {
                return Err(FormatError::Refused { place: self.place(byte), what: "a required extension that is not known" });
            }
        }
        self.model.unit = match unit.as_deref() {
            None | Some("millimeter") => Some(Unit::Millimetre),
            Some("micron") => Some(Unit::Micron),
            Some("centimeter") => Some(Unit::Centimetre),
            Some("inch") => Some(Unit::Inch),
            Some("foot") => Some(Unit::Foot),
            Some("meter") => Some(Unit::Metre),
            Some(_) => return Err(self.malformed(byte, "a unit of the specification", element)),
        };
        Ok(())
    }

    fn start_object(&mut self, element: &BytesStart<'_>, byte: u64) -> Result<(), FormatError> {
        let id = attribute(element, "id").and_then(|id| id.trim().parse().ok());
        let id: u32 = id.ok_or_else(|| self.malformed(byte, "an object with an id", element))?;
        if self.object.is_some() || self.model.objects.contains_key(&id) {
            return Err(self.malformed(byte, "an object of its own id", element));
        }
        let name = attribute(element, "name").unwrap_or_default();
        let name = quick_xml::escape::unescape(&name).map_or_else(|_| Vec::new(), |name| name.as_bytes().to_vec());
        let is_model = attribute(element, "type").is_none_or(|kind| kind == "model");
        let object = Object { is_model, name, ..Object::default() };
        self.object = Some((id, object, MeshBuilder::new(self.limits)));
        Ok(())
    }

    fn vertex(&mut self, element: &BytesStart<'_>, byte: u64) -> Result<(), FormatError> {
        let mut position = [f64::NAN; 3];
        let mut found = 0;
        for attribute in element.attributes().with_checks(false).flatten() {
            let axis = match attribute.key.0 {
                "x" => 0,
                "y" => 1,
                "z" => 2,
                _ => continue,
            };
            let value = decimal(attribute.value.trim().as_bytes());
            position[axis] = value.ok_or_else(|| self.malformed(byte, "a coordinate", element))?;
            found |= 1 << axis;
        }
        let part = self.part;
        let place = || Place::Part { name: part.to_owned(), byte };
        match &mut self.object {
            Some((_, _, builder)) if found == 0b111 => builder.vertex(DVec3::from_array(position), &place),
            _ => Err(self.malformed(byte, "a vertex with x, y and z in an object", element)),
        }
    }

    fn triangle(&mut self, element: &BytesStart<'_>, byte: u64) -> Result<(), FormatError> {
        let mut corners = [-1; 3];
        for attribute in element.attributes().with_checks(false).flatten() {
            let corner = match attribute.key.0 {
                "v1" => 0,
                "v2" => 1,
                "v3" => 2,
                _ => continue,
            };
            let index = integer(attribute.value.trim().as_bytes());
            corners[corner] = index.ok_or_else(|| self.malformed(byte, "a vertex index", element))?;
        }
        let part = self.part;
        let place = || Place::Part { name: part.to_owned(), byte };
        match &mut self.object {
            Some((_, _, builder)) => builder.polygon(&corners, &place),
            None => Err(self.malformed(byte, "a triangle in an object", element)),
        }
    }

    fn reference(&self, element: &BytesStart<'_>, byte: u64) -> Result<Reference, FormatError> {
        let object = attribute(element, "objectid").and_then(|id| id.trim().parse().ok());
        let object = object.ok_or_else(|| self.malformed(byte, "an object id", element))?;
        let transform = match attribute(element, "transform") {
            None => DAffine3::IDENTITY,
            Some(text) => {
                let numbers: Vec<f64> = words(text.as_bytes()).take(13).filter_map(decimal).collect();
                let numbers = <[f64; 12]>::try_from(numbers).ok().filter(|all| all.iter().all(|value| value.is_finite()));
                // Four rows of three in the file, for row vectors: the columns of the map.
                numbers
                    .map(|rows| DAffine3::from_cols_array(&rows))
                    .filter(|map| map.matrix3.determinant() != 0.0)
                    .ok_or_else(|| self.malformed(byte, "an invertible transform of twelve numbers", element))?
            }
        };
        let path = self.production_prefix.as_ref().and_then(|prefix| attribute(element, &format!("{prefix}path")));
        let part = path.map(|path| path.trim_start_matches('/').to_owned());
        Ok(Reference { part, object, transform })
    }

    fn end(&mut self, name: &str, byte: u64) -> Result<(), FormatError> {
        if self.core(name) != Some("object") {
            return Ok(());
        }
        if let Some((id, mut object, builder)) = self.object.take() {
            object.mesh = builder.finish().mesh;
            self.parsed.0 += object.mesh.vertices.len() as u64;
            self.parsed.1 += object.mesh.triangles.len() as u64;
            within(self.place(byte), "vertices", self.parsed.0, self.limits.vertices)?;
            within(self.place(byte), "triangles", self.parsed.1, self.limits.triangles)?;
            self.model.objects.insert(id, object);
        }
        Ok(())
    }
}

/// The build while it is followed.
struct Placing<'a> {
    package: Package<'a>,
    models: BTreeMap<String, Model>,
    facts: MeshFacts,
    builder: MeshBuilder<'a>,
    instances: u64,
    unit: Unit,
}

impl Placing<'_> {
    fn place(&mut self, part: &str, reference: &Reference, above: DAffine3, depth: u64) -> Result<(), FormatError> {
        let part = reference.part.as_deref().unwrap_or(part).to_owned();
        let place = || Place::Part { name: part.clone(), byte: 0 };
        let limits = self.package.limits;
        self.instances += 1;
        within(place(), "component_depth", depth, limits.component_depth)?;
        within(place(), "instances", self.instances, limits.instances)?;
        if !self.models.contains_key(&part) {
            let model = self.package.model(&part)?;
            self.models.insert(part.clone(), model);
        }
        let object = self.models.get_mut(&part).and_then(|model| model.objects.get_mut(&reference.object));
        let object =
            object.ok_or_else(|| malformed(&part, 0, "the object that is referred to", reference.object.to_string().as_bytes()))?;
        if !object.is_model {
            return Ok(());
        }
        let transform = above * reference.transform;
        keep_name(&mut self.facts, &object.name);
        let scale = self.unit.millimetres();
        let first = u32::try_from(self.builder.vertex_count()).unwrap_or(u32::MAX);
        for vertex in &object.mesh.vertices {
            self.builder.vertex(transform.transform_point3(*vertex) * scale, &place)?;
        }
        let mirrored = transform.matrix3.determinant() < 0.0;
        for &[a, b, c] in &object.mesh.triangles {
            let corners = if mirrored { [a, c, b] } else { [a, b, c] };
            self.builder.triangle(corners.map(|index| first + index), &place)?;
        }
        let components = object.components.clone();
        for component in &components {
            self.place(&part, component, transform, depth + 1)?;
        }
        Ok(())
    }
}
