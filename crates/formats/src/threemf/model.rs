//! A model part: its objects, and what is built of them.

use std::borrow::Cow;
use std::collections::HashMap;

use nalgebra::Matrix4;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::REPAIR;
use super::package::{Package, plain};
use crate::budget::Budget;
use crate::{DeclaredUnit, FormatError, ReadLimits, number, quote};

/// What a resource takes beside its values (bytes).
const RESOURCE: usize = 256;

/// A part of the package.
pub(super) struct Model {
    pub unit: DeclaredUnit,
    pub objects: HashMap<u32, Object>,
    /// The objects in the order of the file.
    order: Vec<u32>,
    items: Vec<Part>,
}

/// A mesh, or a list of others, or both.
#[derive(Default)]
pub(super) struct Object {
    pub vertices: Vec<[f64; 3]>,
    pub triangles: Vec<[u32; 3]>,
    /// Colours of the vertices; empty where there are none.
    pub colors: Vec<Option<[u8; 3]>>,
    pub components: Vec<Part>,
}

/// An object within another, or within what is built.
#[derive(Clone)]
pub(super) struct Part {
    pub object: u32,
    /// The part of the package that has it, if it is another.
    pub model: Option<String>,
    pub parent_from_object: Matrix4<f64>,
}

/// An element of an XML text, and its attributes.
pub(super) struct Element<'a> {
    /// Its name without the prefix.
    pub name: &'a str,
    start: &'a BytesStart<'a>,
}

impl Element<'_> {
    /// The value of an attribute, whatever its prefix.
    pub(super) fn get(&self, name: &str) -> Option<Cow<'_, str>> {
        // looking for doubled ones takes the square of their number
        let mut attributes = self.start.attributes();
        let found = attributes.with_checks(false).flatten().find(|a| a.key.local_name().as_ref() == name)?;
        Some(found.value)
    }
}

/// Calls `take` for every element of a text; its errors get the line.
pub(super) fn elements(
    text: &str,
    part: &str,
    mut take: impl FnMut(&Element) -> Result<(), Fault>,
) -> Result<(), FormatError> {
    let mut reader = Reader::from_str(text);
    loop {
        let event = reader.read_event();
        let place = |reader: &Reader<&[u8]>| {
            let line = 1 + memchr::memchr_iter(b'\n', &text.as_bytes()[..reader.buffer_position() as usize]).count();
            format!("{:.80}, line {line}", part.escape_debug().to_string())
        };
        let start = match &event {
            Ok(Event::Start(start) | Event::Empty(start)) => start,
            Ok(Event::Eof) => return Ok(()),
            Ok(_) => continue,
            Err(error) => {
                let problem = error.to_string().chars().take(200).collect::<String>();
                return Err(FormatError::malformed(place(&reader), problem, REPAIR));
            }
        };
        let name = start.local_name();
        take(&Element { name: name.as_ref(), start }).map_err(|fault| match fault {
            Fault::Wrong(problem) => FormatError::malformed(place(&reader), problem, REPAIR),
            Fault::Refused(error) => error,
        })?;
    }
}

/// What is wrong with an element.
pub(super) enum Fault {
    Wrong(String),
    Refused(FormatError),
}

impl From<String> for Fault {
    fn from(problem: String) -> Self {
        Fault::Wrong(problem)
    }
}

impl From<FormatError> for Fault {
    fn from(error: FormatError) -> Self {
        Fault::Refused(error)
    }
}

impl Model {
    pub(super) fn read(
        package: &mut Package,
        part: &str,
        limits: &ReadLimits,
        budget: &mut Budget,
    ) -> Result<Model, FormatError> {
        let text = package.text(part)?;
        let model = Model {
            unit: DeclaredUnit { metres: 0.001 },
            objects: HashMap::new(),
            order: Vec::new(),
            items: Vec::new(),
        };
        let mut builder = Builder { model, limits, budget, open: None, group: 0, groups: HashMap::new() };
        elements(&text, part, |element| builder.element(element))?;
        builder.close();
        Ok(builder.model)
    }

    /// What is built; of a model that doesn't say, all objects that have a mesh.
    pub(super) fn built(&self) -> Vec<Part> {
        if !self.items.is_empty() {
            return self.items.clone();
        }
        let all = self.order.iter();
        all.map(|object| Part { object: *object, model: None, parent_from_object: Matrix4::identity() }).collect()
    }
}

/// An object while it is read.
struct Open {
    id: u32,
    object: Object,
    /// The group of colours and the colour in it of triangles that name none.
    group: Option<u32>,
    color: usize,
}

/// A model while it is read.
struct Builder<'a> {
    model: Model,
    limits: &'a ReadLimits,
    budget: &'a mut Budget,
    open: Option<Open>,
    /// The group of colours that is being read, and all by their ids.
    group: u32,
    groups: HashMap<u32, Vec<[u8; 3]>>,
}

impl Builder<'_> {
    fn element(&mut self, element: &Element) -> Result<(), Fault> {
        match element.name {
            "model" => self.model.unit = unit(element.get("unit").as_deref().unwrap_or("millimeter"))?,
            "colorgroup" | "basematerials" => {
                self.close();
                self.budget.take(1, RESOURCE)?;
                self.group = required(element, "id")?;
                self.groups.entry(self.group).or_default();
            }
            "color" | "base" => {
                let name = if element.name == "color" { "color" } else { "displaycolor" };
                self.budget.take(1, 3)?;
                // one that is none keeps its place
                let color = element.get(name).and_then(|text| color(&text)).unwrap_or_default();
                self.groups.entry(self.group).or_default().push(color);
            }
            "object" => {
                self.close();
                self.budget.take(1, RESOURCE)?;
                let color = whole(element, "pindex")?.unwrap_or(0) as usize;
                let (id, group) = (required(element, "id")?, whole(element, "pid")?);
                self.open = Some(Open { id, object: Object::default(), group, color });
            }
            "vertex" => self.vertex(element)?,
            "triangle" => self.triangle(element)?,
            "component" => {
                self.budget.take(1, size_of::<Part>() + RESOURCE)?;
                let part = part(element)?;
                if let Some(open) = &mut self.open {
                    open.object.components.push(part);
                }
            }
            "item" => {
                self.close();
                self.budget.take(1, size_of::<Part>() + RESOURCE)?;
                self.model.items.push(part(element)?);
            }
            _ => {}
        }
        Ok(())
    }

    /// Ends the object that is being read.
    fn close(&mut self) {
        if let Some(Open { id, object, .. }) = self.open.take()
            && self.model.objects.insert(id, object).is_none()
        {
            self.model.order.push(id);
        }
    }

    fn vertex(&mut self, element: &Element) -> Result<(), Fault> {
        let Some(open) = &mut self.open else { return Ok(()) };
        let limit = self.limits.most_points();
        if open.object.vertices.len() as u64 >= limit {
            return Err(FormatError::TooLarge { what: "points", found: limit + 1, limit }.into());
        }
        self.budget.take(1, size_of::<[f64; 3]>())?;
        let mut vertex = [None; 3];
        let mut attributes = element.start.attributes();
        for attribute in attributes.with_checks(false).flatten() {
            let axis = match attribute.key.as_ref() {
                "x" => 0,
                "y" => 1,
                "z" => 2,
                _ => continue,
            };
            let word = attribute.value.trim().as_bytes();
            let value = number::parse(word).ok_or_else(|| format!("{} is no number", quote(word)))?;
            vertex[axis] = Some(value);
        }
        let [Some(x), Some(y), Some(z)] = vertex else { return Err("a vertex lacks x, y or z".to_owned().into()) };
        open.object.vertices.push([x, y, z]);
        Ok(())
    }

    fn triangle(&mut self, element: &Element) -> Result<(), Fault> {
        let Some(open) = &mut self.open else { return Ok(()) };
        let limit = self.limits.max_faces;
        if open.object.triangles.len() as u64 >= limit {
            return Err(FormatError::TooLarge { what: "faces", found: limit + 1, limit }.into());
        }
        self.budget.take(1, size_of::<[u32; 3]>())?;
        // corners, their colours, the group of these
        let mut values = [None; 7];
        let mut attributes = element.start.attributes();
        for attribute in attributes.with_checks(false).flatten() {
            let names = ["v1", "v2", "v3", "p1", "p2", "p3", "pid"];
            let Some(index) = names.iter().position(|name| *name == attribute.key.as_ref()) else { continue };
            values[index] = Some(parse(&attribute.value)?);
        }
        let [Some(a), Some(b), Some(c), ..] = values else {
            return Err("a triangle lacks v1, v2 or v3".to_owned().into());
        };
        let [_, _, _, first, second, third, group] = values;
        open.object.triangles.push([a, b, c]);
        let Some(colors) = group.or(open.group).and_then(|group| self.groups.get(&group)) else { return Ok(()) };
        let first = first.map_or(open.color, |color| color as usize);
        let others = [second, third].map(|color| color.map_or(first, |color| color as usize));
        for (vertex, color) in [a, b, c].into_iter().zip([first, others[0], others[1]]) {
            let count = open.object.vertices.len();
            let (Some(color), true) = (colors.get(color), (vertex as usize) < count) else { continue };
            if open.object.colors.len() < count {
                self.budget.take((count - open.object.colors.len()) as u64, size_of::<Option<[u8; 3]>>())?;
                open.object.colors.resize(count, None);
            }
            // of several triangles the first
            open.object.colors[vertex as usize].get_or_insert(*color);
        }
        Ok(())
    }
}

fn unit(name: &str) -> Result<DeclaredUnit, String> {
    let metres = match name {
        "micron" => 1e-6,
        "millimeter" => 1e-3,
        "centimeter" => 1e-2,
        "inch" => 0.0254,
        "foot" => 0.3048,
        "meter" => 1.0,
        _ => return Err(format!("there is no unit {}", quote(name.as_bytes()))),
    };
    Ok(DeclaredUnit { metres })
}

fn parse(text: &str) -> Result<u32, String> {
    text.trim().parse().map_err(|_| format!("{} is no index", quote(text.as_bytes())))
}

fn whole(element: &Element, name: &str) -> Result<Option<u32>, String> {
    element.get(name).map(|text| parse(&text)).transpose()
}

fn required(element: &Element, name: &str) -> Result<u32, String> {
    whole(element, name)?.ok_or_else(|| format!("{} has no {name}", quote(element.name.as_bytes())))
}

/// A component or an item.
fn part(element: &Element) -> Result<Part, String> {
    let parent_from_object = match element.get("transform") {
        None => Matrix4::identity(),
        Some(text) => {
            let numbers: Vec<f64> =
                text.split_ascii_whitespace().filter_map(|word| number::parse(word.as_bytes())).collect();
            let [a, b, c, d, e, f, g, h, i, x, y, z] = numbers[..] else {
                return Err(format!("a transform has twelve numbers, this one is {}", quote(text.as_bytes())));
            };
            // rows of the file stand beneath a row of coordinates
            Matrix4::new(a, d, g, x, b, e, h, y, c, f, i, z, 0.0, 0.0, 0.0, 1.0)
        }
    };
    Ok(Part {
        object: required(element, "objectid")?,
        model: element.get("path").map(|path| plain(&path)),
        parent_from_object,
    })
}

/// A colour like `#RRGGBB` or `#RRGGBBAA`.
fn color(text: &str) -> Option<[u8; 3]> {
    let digits = text.trim().strip_prefix('#').filter(|digits| digits.len() == 6 || digits.len() == 8)?;
    let channel = |at: usize| u8::from_str_radix(digits.get(at..at + 2)?, 16).ok();
    Some([channel(0)?, channel(2)?, channel(4)?])
}
