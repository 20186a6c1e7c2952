//! A model's XML, read: objects, and what is built of them.
//!
//! An object is a mesh, or is made of objects that stand before it; so nothing can be part of itself. How much an
//! object would come to is known as soon as it ends, before anything is placed.

use std::borrow::Cow;
use std::collections::BTreeMap;

use quick_xml::events::{BytesStart, Event};
use quick_xml::name::{Namespace, QName, ResolveResult};
use quick_xml::reader::NsReader;

use crate::error::{Format, MeshError, beginning};
use crate::threemf::transform::Transform;
use crate::threemf::{MOST_NESTED_OBJECTS, MOST_PLACED};
use crate::triangles::MOST_TRIANGLES;

const CORE: &str = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02";
/// Colours and textures: they leave the shape as it is.
const MATERIALS: &str = "http://schemas.microsoft.com/3dmanufacturing/material/2015/02";
/// Elements within elements. The core needs six.
const MOST_NESTED_ELEMENTS: usize = 64;

/// Vertices, m, and triangles of all that is built.
#[derive(Default)]
pub(super) struct Built {
    pub(super) vertices_m: Vec<[f64; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// What a model builds.
pub(super) fn built(text: &str) -> Result<Built, MeshError> {
    let mut reader = NsReader::from_str(text);
    reader.config_mut().expand_empty_elements = true;
    let mut model = Model::default();
    let mut places = Vec::new();
    loop {
        let at = reader.buffer_position() as usize;
        let broken = |problem: Cow<'static, str>| MeshError::malformed(Format::Model, at, problem);
        let event = reader.read_resolved_event();
        let (namespace, event) = event.map_err(|error| broken(beginning(error).into()))?;
        match event {
            Event::Start(start) => {
                if places.len() == MOST_NESTED_ELEMENTS {
                    return Err(broken("elements are nested too deep".into()));
                }
                let is_core = namespace == ResolveResult::Bound(Namespace(CORE));
                let parent = places.last().copied().unwrap_or(Place::Document);
                let place = if is_core {
                    Place::of(parent, start.local_name().as_ref())
                } else {
                    Place::Elsewhere
                };
                match place {
                    Place::Model => check_extensions(&start, &reader)?,
                    _ if parent == Place::Document => {
                        return Err(broken("wanted a model of the core of 3MF".into()));
                    }
                    _ => {}
                }
                places.push(place);
                model.begin(place, &start).map_err(|wrong| wrong.at(at))?;
            }
            Event::End(_) => {
                let ended = places.pop();
                if ended == Some(Place::Object) {
                    model.end_object().map_err(|wrong| wrong.at(at))?;
                }
            }
            Event::DocType(_) => return Err(broken("a document type, which 3MF forbids".into())),
            Event::Eof if !places.is_empty() => {
                return Err(broken("the text ends within an element".into()));
            }
            Event::Eof if model.metres_per_unit.is_none() => {
                return Err(broken("there is no model".into()));
            }
            Event::Eof => return Ok(model.built),
            _ => {}
        }
    }
}

/// Which element is open, as far as its parents make it mean something.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    Document,
    Model,
    Resources,
    Object,
    Mesh,
    Vertices,
    Vertex,
    Triangles,
    Triangle,
    Components,
    Component,
    Build,
    Item,
    Elsewhere,
}

impl Place {
    fn of(parent: Self, name: &str) -> Self {
        match (parent, name) {
            (Self::Document, "model") => Self::Model,
            (Self::Model, "resources") => Self::Resources,
            (Self::Model, "build") => Self::Build,
            (Self::Resources, "object") => Self::Object,
            (Self::Object, "mesh") => Self::Mesh,
            (Self::Object, "components") => Self::Components,
            (Self::Mesh, "vertices") => Self::Vertices,
            (Self::Mesh, "triangles") => Self::Triangles,
            (Self::Vertices, "vertex") => Self::Vertex,
            (Self::Triangles, "triangle") => Self::Triangle,
            (Self::Components, "component") => Self::Component,
            (Self::Build, "item") => Self::Item,
            _ => Self::Elsewhere,
        }
    }
}

/// Something wrong, at a place that whoever reads knows.
enum Wrong {
    Broken(Cow<'static, str>),
    Error(MeshError),
}

impl Wrong {
    fn at(self, at: usize) -> MeshError {
        match self {
            Self::Broken(problem) => MeshError::malformed(Format::Model, at, problem),
            Self::Error(error) => error,
        }
    }
}

impl From<&'static str> for Wrong {
    fn from(problem: &'static str) -> Self {
        Self::Broken(problem.into())
    }
}

impl From<String> for Wrong {
    fn from(problem: String) -> Self {
        Self::Broken(problem.into())
    }
}

/// What has been read so far.
#[derive(Default)]
struct Model {
    /// None before the model has begun.
    metres_per_unit: Option<f64>,
    objects: BTreeMap<u32, Object>,
    /// The object that is being read, and its number.
    open: Option<(u32, Object)>,
    cost: Cost,
    built: Built,
}

/// A mesh, or what others it is made of. Lengths are in the model's unit.
#[derive(Default)]
struct Object {
    /// Supports and surfaces are none.
    is_body: bool,
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    components: Vec<(u32, Transform)>,
    cost: Cost,
}

/// What placing something once comes to.
#[derive(Clone, Copy, Default)]
struct Cost {
    meshes: u64,
    vertices: u64,
    triangles: u64,
    nested: u32,
}

impl Cost {
    fn add(&mut self, part: Self) -> Result<(), Wrong> {
        self.meshes += part.meshes;
        self.vertices += part.vertices;
        self.triangles += part.triangles;
        self.nested = self.nested.max(part.nested + 1);
        for (what, got, most) in [
            ("meshes", self.meshes, MOST_PLACED),
            ("vertices", self.vertices, 3 * MOST_TRIANGLES as u64),
            ("triangles", self.triangles, MOST_TRIANGLES as u64),
            (
                "objects within each other",
                self.nested.into(),
                MOST_NESTED_OBJECTS.into(),
            ),
        ] {
            if most < got {
                return Err(Wrong::Error(MeshError::TooMuch {
                    format: Format::Model,
                    what,
                    got,
                    most,
                }));
            }
        }
        Ok(())
    }
}

impl Model {
    fn begin(&mut self, place: Place, start: &BytesStart<'_>) -> Result<(), Wrong> {
        match place {
            Place::Model => {
                if self.metres_per_unit.is_some() {
                    return Err("a second model".into());
                }
                let [unit] = attributes(start, ["unit"])?;
                self.metres_per_unit = Some(metres(unit.as_deref().unwrap_or("millimeter"))?);
            }
            Place::Object => {
                let [id, kind] = attributes(start, ["id", "type"])?;
                let id = number(id.as_deref())?;
                if self.objects.contains_key(&id) {
                    return Err(format!("a second object {id}").into());
                }
                let is_body = kind.is_none_or(|kind| kind == "model");
                let object = Object {
                    is_body,
                    ..Object::default()
                };
                self.open = Some((id, object));
            }
            Place::Vertex => {
                let [x, y, z] = attributes(start, ["x", "y", "z"])?;
                let at = [length(x)?, length(y)?, length(z)?];
                self.object()?.vertices.push(at);
            }
            Place::Triangle => {
                let corners = attributes(start, ["v1", "v2", "v3"])?;
                let mut triangle = [0; 3];
                for (vertex, corner) in triangle.iter_mut().zip(&corners) {
                    *vertex = number(corner.as_deref())?;
                }
                self.object()?.triangles.push(triangle);
            }
            Place::Component => {
                let (id, transform) = reference(start)?;
                let cost = self.known(id)?.cost;
                let object = self.object()?;
                object.cost.add(cost)?;
                // Of nothing, any number could be placed.
                if 0 < cost.meshes {
                    object.components.push((id, transform));
                }
            }
            Place::Item => {
                let (id, transform) = reference(start)?;
                self.cost.add(self.known(id)?.cost)?;
                let unit = self.metres_per_unit.unwrap_or_default();
                place_object(&self.objects, id, &transform, unit, &mut self.built);
            }
            _ => {}
        }
        Ok(())
    }

    fn object(&mut self) -> Result<&mut Object, Wrong> {
        let open = self.open.as_mut().map(|(_, object)| object);
        open.ok_or_else(|| "no object is open".into())
    }

    /// An object that has ended.
    fn known(&self, id: u32) -> Result<&Object, Wrong> {
        let object = self.objects.get(&id);
        object.ok_or_else(|| format!("object {id} is named and does not stand before").into())
    }

    fn end_object(&mut self) -> Result<(), Wrong> {
        let Some((id, mut object)) = self.open.take() else {
            return Ok(());
        };
        let found = object.vertices.len() as u64;
        let named = object.triangles.iter().flatten().max();
        if let Some(&named) = named.filter(|named| found <= u64::from(**named)) {
            return Err(Wrong::Error(MeshError::SelfContradicting {
                format: Format::Model,
                what: "vertices",
                said: u64::from(named) + 1,
                found,
            }));
        }
        if !object.is_body {
            object = Object::default();
        }
        if !object.triangles.is_empty() {
            object.cost.add(Cost {
                meshes: 1,
                vertices: object.vertices.len() as u64,
                triangles: object.triangles.len() as u64,
                nested: 0,
            })?;
        }
        self.objects.insert(id, object);
        Ok(())
    }
}

/// Puts an object where it is built. It ends, since objects are made of those before them only, and soon, since
/// whatever is part of one comes to at least a mesh.
fn place_object(
    objects: &BTreeMap<u32, Object>,
    id: u32,
    transform: &Transform,
    metres_per_unit: f64,
    built: &mut Built,
) {
    let Some(object) = objects.get(&id) else {
        return;
    };
    if !object.triangles.is_empty() {
        let first = built.vertices_m.len() as u32;
        let placed = object.vertices.iter();
        let placed = placed.map(|&at| transform.apply(at).map(|at| at * metres_per_unit));
        built.vertices_m.extend(placed);
        let is_mirrored = transform.determinant() < 0.0;
        built
            .triangles
            .extend(object.triangles.iter().map(|triangle| {
                let [a, b, c] = triangle.map(|vertex| first + vertex);
                if is_mirrored { [a, c, b] } else { [a, b, c] }
            }));
    }
    for (part, inner) in &object.components {
        let whole = inner.then(transform);
        place_object(objects, *part, &whole, metres_per_unit, built);
    }
}

/// Refuses what asks for more than is understood. What is required is told by the prefixes of its namespaces.
fn check_extensions(start: &BytesStart<'_>, reader: &NsReader<&[u8]>) -> Result<(), MeshError> {
    let at = reader.buffer_position() as usize;
    let [required] =
        attributes(start, ["requiredextensions"]).map_err(|wrong: Wrong| wrong.at(at))?;
    let required = required.unwrap_or_default();
    for prefix in required.split_ascii_whitespace() {
        let name = format!("{prefix}:x");
        let (namespace, _) = reader.resolver().resolve_element(QName(&name));
        let is_known = [CORE, MATERIALS]
            .iter()
            .any(|known| namespace == ResolveResult::Bound(Namespace(known)));
        if !is_known {
            let shown = beginning(prefix);
            let problem =
                format!("the model requires the extension {shown}, only the core is read");
            return Err(MeshError::malformed(Format::Model, at, problem));
        }
    }
    Ok(())
}

/// The values of attributes without a prefix, as they are written.
fn attributes<'a, const N: usize>(
    start: &'a BytesStart<'_>,
    names: [&str; N],
) -> Result<[Option<Cow<'a, str>>; N], Wrong> {
    let mut values = [const { None }; N];
    // The library's own check for names that come twice compares each with every other.
    for attribute in start.attributes().with_checks(false) {
        let attribute = attribute.map_err(beginning)?;
        let name = attribute.key.into_inner();
        if let Some(at) = names.iter().position(|wanted| *wanted == name)
            && values[at].replace(attribute.value).is_some()
        {
            return Err(format!("{name} is said twice").into());
        }
    }
    Ok(values)
}

/// Which object, and how it is moved.
fn reference(start: &BytesStart<'_>) -> Result<(u32, Transform), Wrong> {
    let [id, transform] = attributes(start, ["objectid", "transform"])?;
    let id = number(id.as_deref())?;
    let transform = transform.map_or(Ok(Transform::NONE), |text| Transform::parse(&text))?;
    Ok((id, transform))
}

fn number(text: Option<&str>) -> Result<u32, Wrong> {
    let parsed = text.and_then(|text| text.trim().parse().ok());
    parsed.ok_or_else(|| "wanted a whole number from 0 to 4294967295".into())
}

fn length(text: Option<Cow<'_, str>>) -> Result<f64, Wrong> {
    let parsed = text.and_then(|text| text.trim().parse::<f64>().ok());
    let finite = parsed.filter(|length| length.is_finite());
    finite.ok_or_else(|| "wanted a finite number for x, y and z".into())
}

fn metres(unit: &str) -> Result<f64, Wrong> {
    Ok(match unit {
        "micron" => 1e-6,
        "millimeter" => 1e-3,
        "centimeter" => 1e-2,
        "inch" => 0.0254,
        "foot" => 0.3048,
        "meter" => 1.0,
        _ => {
            return Err("wanted micron, millimeter, centimeter, inch, foot or meter".into());
        }
    })
}
