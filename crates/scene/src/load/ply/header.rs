//! The text in front of a PLY file.

use std::path::Path;

use crate::Error;

/// Headers are small; a file without an end of its header is none.
const MAX_HEADER: usize = 1 << 20;

/// How the values are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// The type of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary file.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    /// The type of the length, if this is a list.
    pub(super) length: Option<Kind>,
    pub(super) kind: Kind,
}

#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

impl Element {
    fn find(&self, name: &str) -> Option<(usize, &Property)> {
        self.properties.iter().enumerate().find(|(_, p)| p.name == name)
    }

    /// The place of the property `name`, if it is one number.
    pub(super) fn scalar(&self, name: &str) -> Option<usize> {
        self.find(name).filter(|(_, p)| p.length.is_none()).map(|(i, _)| i)
    }

    /// The place of the property `name`, if it is a list.
    pub(super) fn list(&self, name: &str) -> Option<usize> {
        self.find(name).filter(|(_, p)| p.length.is_some()).map(|(i, _)| i)
    }
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) format: Format,
    pub(super) elements: Vec<Element>,
    /// Where the values start.
    pub(super) len: usize,
}

impl Header {
    pub(super) fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|e| e.name == name)
    }

    pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Self, Error> {
        let fault = |line: usize, fault: String| Error::at(path, line, 1, fault);
        let (mut format, mut elements) = (None, Vec::<Element>::new());
        let mut len = 0;
        let head = &bytes[..bytes.len().min(MAX_HEADER)];
        for (i, raw) in head.split_inclusive(|&b| b == b'\n').enumerate() {
            let line_number = i + 1;
            len += raw.len();
            let line = String::from_utf8_lossy(raw);
            let line = line.trim_end();
            if i == 0 {
                if line != "ply" {
                    return Err(fault(
                        1,
                        "this is no PLY file; its first line must be `ply`".into(),
                    ));
                }
                continue;
            }
            let mut words = line.split_ascii_whitespace();
            match words.next() {
                None | Some("comment" | "obj_info") => {}
                Some("format") => {
                    format = Some(match words.next() {
                        Some("ascii") => Format::Ascii,
                        Some("binary_little_endian") => Format::LittleEndian,
                        Some("binary_big_endian") => Format::BigEndian,
                        _ => {
                            let text = format!(
                                "`{line}` is unknown; the formats are ascii, binary_little_endian and binary_big_endian"
                            );
                            return Err(fault(line_number, text));
                        }
                    });
                }
                Some("element") => {
                    let element = match (words.next(), words.next().map(str::parse)) {
                        (Some(name), Some(Ok(count))) => {
                            Element { name: name.into(), count, properties: Vec::new() }
                        }
                        _ => {
                            let text = format!("`{line}` must be: element NAME COUNT");
                            return Err(fault(line_number, text));
                        }
                    };
                    if elements.iter().any(|e| e.name == element.name) {
                        let text = format!("there are two elements `{}`; keep one", element.name);
                        return Err(fault(line_number, text));
                    }
                    elements.push(element);
                }
                Some("property") => {
                    let property = property(&mut words).ok_or_else(|| {
                        let text = format!(
                            "`{line}` must be: property TYPE NAME, or: property list TYPE TYPE NAME"
                        );
                        fault(line_number, text)
                    })?;
                    let Some(element) = elements.last_mut() else {
                        return Err(fault(
                            line_number,
                            "a property stands before any element".into(),
                        ));
                    };
                    if element.find(&property.name).is_some() {
                        let text =
                            format!("there are two properties `{}`; keep one", property.name);
                        return Err(fault(line_number, text));
                    }
                    element.properties.push(property);
                }
                Some("end_header") => {
                    if let Some(e) =
                        elements.iter().find(|e| e.properties.is_empty() && e.count > 0)
                    {
                        let text = format!("the element `{}` has no properties", e.name);
                        return Err(fault(line_number, text));
                    }
                    let Some(format) = format else {
                        return Err(fault(line_number, "the header names no format".into()));
                    };
                    return Ok(Self { format, elements, len });
                }
                Some(word) => {
                    let text = format!("`{word}` is no word of PLY headers; save the file anew");
                    return Err(fault(line_number, text));
                }
            }
        }
        let text = "the header has no end; the file is cut off or not a PLY file";
        Err(Error::whole(path, text))
    }
}

fn property<'a>(words: &mut impl Iterator<Item = &'a str>) -> Option<Property> {
    let first = words.next()?;
    let length = if first == "list" {
        Some(Kind::parse(words.next()?).filter(|k| !matches!(k, Kind::F32 | Kind::F64))?)
    } else {
        None
    };
    let kind = if length.is_some() { words.next()? } else { first };
    Some(Property { kind: Kind::parse(kind)?, length, name: words.next()?.into() })
}
