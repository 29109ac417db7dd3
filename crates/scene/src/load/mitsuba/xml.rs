//! XML as a tree: includes spliced in, parameters put in their places, every element with its own place.
//!
//! Nothing here recurses but over a bounded depth, entities are refused, and memory is proportional to the files.

use std::collections::BTreeMap;
use std::path::Path;

use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

use super::super::reach::Reach;
use super::super::source::Source;
use crate::Error;

/// How deep elements may nest; those of scenes stay below ten.
const MAX_DEPTH: usize = 64;

/// How deep files may include each other.
const MAX_INCLUDES: usize = 16;

/// How many attributes an element may have; a rotation has five.
const MAX_ATTRIBUTES: usize = 32;

/// Where something stands: the number of the file, and bytes from its beginning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    file: usize,
    at: usize,
}

/// An element and all it holds.
#[derive(Debug, Default)]
pub(super) struct Element {
    /// In lower case and without underscores: `lookAt` and `lookat` are one.
    pub(super) tag: String,
    attributes: Vec<(String, String)>,
    pub(super) children: Vec<Self>,
    pub(super) place: Place,
}

impl Element {
    /// An attribute as written.
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }
}

/// A scene file and all it includes.
#[derive(Debug)]
pub(super) struct Document {
    sources: Vec<Source>,
    /// What stands in the scene.
    pub(super) elements: Vec<Element>,
}

impl Document {
    /// Reads a file, with values for its parameters.
    pub(super) fn read(
        path: &Path,
        reach: &Reach,
        definitions: &[(String, String)],
    ) -> Result<Self, Error> {
        let source = Source::read(path, reach)?;
        let mut parser = Parser { sources: Vec::new(), parameters: BTreeMap::new() };
        for (name, value) in definitions {
            let parameter = Parameter { value: value.clone(), is_given: true, is_used: false };
            parser.parameters.insert(name.clone(), parameter);
        }
        let elements = parser.file(source, 0)?;
        let unused = parser.parameters.iter().find(|(_, p)| p.is_given && !p.is_used);
        if let Some((name, _)) = unused {
            let fault = format!("the scene has no parameter ${name}, which -D gives a value");
            return Err(parser.sources[0].fault_of_whole(fault));
        }
        Ok(Self { sources: parser.sources, elements })
    }

    /// The file that was asked for.
    pub(super) fn main(&self) -> &Source {
        &self.sources[0]
    }

    /// The file in which something stands.
    pub(super) fn source(&self, place: Place) -> &Source {
        &self.sources[place.file]
    }

    /// Something is wrong at a place.
    pub(super) fn fault(&self, place: Place, fault: impl Into<String>) -> Error {
        self.sources[place.file].fault(place.at..place.at, fault)
    }
}

/// What stands for `$name`.
#[derive(Debug)]
struct Parameter {
    value: String,
    is_given: bool,
    is_used: bool,
}

struct Parser {
    sources: Vec<Source>,
    parameters: BTreeMap<String, Parameter>,
}

impl Parser {
    /// What stands in the scene of a file.
    fn file(&mut self, source: Source, n_above: usize) -> Result<Vec<Element>, Error> {
        let text = source.text().to_owned();
        let file = self.sources.len();
        self.sources.push(source);
        let mut reader = Reader::from_str(&text);
        // The scene, and below it the elements that are open.
        let mut open: Vec<Element> = Vec::new();
        let mut scene = None;
        loop {
            let at = reader.buffer_position() as usize;
            let place = Place { file, at };
            let fault = |parser: &Self, fault: String| parser.sources[file].fault(at..at, fault);
            let event = reader.read_event().map_err(|e| {
                let at = (reader.error_position() as usize).min(text.len());
                self.sources[file].fault(at..at, format!("the XML is broken: {e}"))
            })?;
            match event {
                Event::Eof if open.is_empty() => break,
                Event::Eof => {
                    let fault = format!("`{}` has no end", open[open.len() - 1].tag);
                    return Err(self.fault(open[open.len() - 1].place, fault));
                }
                Event::Start(start) => {
                    if open.len() == MAX_DEPTH {
                        let text = format!("elements nest more than {MAX_DEPTH} deep");
                        return Err(fault(self, text));
                    }
                    open.push(self.element(&start, place)?);
                }
                Event::Empty(start) => {
                    let element = self.element(&start, place)?;
                    self.close(element, &mut open, &mut scene, n_above)?;
                }
                Event::End(_) => {
                    // The reader has checked that it ends what is open.
                    if let Some(element) = open.pop() {
                        self.close(element, &mut open, &mut scene, n_above)?;
                    }
                }
                Event::DocType(_) => {
                    let text = "document types and entities are refused; remove <!DOCTYPE ...>";
                    return Err(fault(self, text.into()));
                }
                Event::Text(text) if text.trim().is_empty() => {}
                Event::Text(_) | Event::CData(_) | Event::GeneralRef(_) => {
                    let text = "there is text between elements; values stand in attributes";
                    return Err(fault(self, text.into()));
                }
                Event::Comment(_) | Event::Decl(_) | Event::PI(_) => {}
            }
        }
        let scene: Element = scene.ok_or_else(|| {
            self.sources[file].fault_of_whole("there is no <scene>; is this a scene of Mitsuba?")
        })?;
        Ok(scene.children)
    }

    fn fault(&self, place: Place, fault: impl Into<String>) -> Error {
        self.sources[place.file].fault(place.at..place.at, fault)
    }

    fn element(&mut self, start: &BytesStart<'_>, place: Place) -> Result<Element, Error> {
        let tag = start.name().0.to_ascii_lowercase().replace('_', "");
        let mut element = Element { tag, place, ..Element::default() };
        for attribute in start.attributes() {
            let attribute =
                attribute.map_err(|e| self.fault(place, format!("the XML is broken: {e}")))?;
            if element.attributes.len() == MAX_ATTRIBUTES {
                let fault = format!("an element has more than {MAX_ATTRIBUTES} attributes");
                return Err(self.fault(place, fault));
            }
            let value = attribute
                .normalized_value(XmlVersion::Explicit1_0)
                .map_err(|e| self.fault(place, format!("the XML is broken: {e}")))?;
            let value = self.substituted(&value, place)?;
            element.attributes.push((attribute.key.0.to_owned(), value));
        }
        Ok(element)
    }

    /// A value with parameters put in.
    fn substituted(&mut self, value: &str, place: Place) -> Result<String, Error> {
        let mut pieces = value.split('$');
        let mut result = pieces.next().unwrap_or_default().to_owned();
        for piece in pieces {
            let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
            let end = piece.find(|c| !is_name(c)).unwrap_or(piece.len());
            // The longest name counts, as long as it is one.
            let known = (1..=end).rev().find(|&n| self.parameters.contains_key(&piece[..n]));
            let parameter = known.and_then(|n| self.parameters.get_mut(&piece[..n]));
            let (Some(n), Some(parameter)) = (known, parameter) else {
                let name = &piece[..end];
                let fault = format!(
                    "${name} has no value; give it one by <default> before, or by -D {name}=..."
                );
                return Err(self.fault(place, fault));
            };
            parameter.is_used = true;
            result += &parameter.value;
            result += &piece[n..];
        }
        Ok(result)
    }

    /// Puts an element that has ended into the one around it.
    fn close(
        &mut self,
        element: Element,
        open: &mut [Element],
        scene: &mut Option<Element>,
        n_above: usize,
    ) -> Result<(), Error> {
        let Some(parent) = open.last_mut() else {
            if element.tag != "scene" || scene.is_some() {
                let fault = format!("`{}` stands where one <scene> must be", element.tag);
                return Err(self.fault(element.place, fault));
            }
            *scene = Some(element);
            return Ok(());
        };
        let need = |name: &str| {
            element.attribute(name).map(str::to_owned).ok_or_else(|| {
                let fault = format!("<{}> needs the attribute `{name}`", element.tag);
                self.fault(element.place, fault)
            })
        };
        match element.tag.as_str() {
            "default" => {
                let (name, value) = (need("name")?, need("value")?);
                let parameter = Parameter { value, is_given: false, is_used: false };
                // A value given from outside counts as wanted.
                let known = self.parameters.entry(name).or_insert(parameter);
                known.is_used = true;
            }
            "include" => {
                let path = self.sources[element.place.file].resolve(&need("filename")?);
                if n_above == MAX_INCLUDES {
                    let fault = format!(
                        "files include each other more than {MAX_INCLUDES} deep; does one include itself?"
                    );
                    return Err(self.fault(element.place, fault));
                }
                let reach = self.sources[element.place.file].reach();
                let source = Source::read(&path, reach)
                    .map_err(|e| self.fault(element.place, e.to_string()))?;
                parent.children.extend(self.file(source, n_above + 1)?);
            }
            _ => parent.children.push(element),
        }
        Ok(())
    }
}
