//! The values of a PLY file, one after another.

use std::path::Path;

use super::header::{Element, Format, Header, Kind, Property};
use crate::Error;

/// The values that are still to be read.
pub(super) struct Body<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
    format: Format,
}

impl<'a> Body<'a> {
    /// Refuses a file that is too short for what its header promises.
    pub(super) fn new(path: &'a Path, bytes: &'a [u8], header: &Header) -> Result<Self, Error> {
        let body = Self { path, bytes, at: header.len, format: header.format };
        let ascii = header.format == Format::Ascii;
        // The last number of a text needs no blank behind it.
        let mut left = bytes.len() - header.len + usize::from(ascii);
        for element in &header.elements {
            // An empty list is its length alone; a number as text is at least one digit and one blank.
            let size = |p: &Property| if ascii { 2 } else { p.length.unwrap_or(p.kind).size() };
            let size: usize = element.properties.iter().map(size).sum();
            let needed = size.checked_mul(element.count);
            left = needed.and_then(|n| left.checked_sub(n)).ok_or_else(|| {
                body.whole(format!(
                    "the header promises {} of `{}`, for which the file is too short; it may be cut off",
                    element.count, element.name
                ))
            })?;
        }
        Ok(body)
    }

    /// Something is wrong with the file as a whole.
    pub(super) fn whole(&self, fault: String) -> Error {
        Error::whole(self.path, fault)
    }

    /// Something is wrong with what was read last: with its line, if there are lines.
    pub(super) fn fault(&self, fault: String) -> Error {
        if self.format != Format::Ascii {
            return self.whole(fault);
        }
        let before = &self.bytes[..self.at.min(self.bytes.len())];
        let line = before.iter().filter(|&&b| b == b'\n').count() + 1;
        Error::at(self.path, line, 1, fault)
    }

    /// The next value, of element `index` of its kind.
    #[inline]
    pub(super) fn number(
        &mut self,
        kind: Kind,
        element: &Element,
        index: usize,
    ) -> Result<f64, Error> {
        let value = match self.format {
            Format::Ascii => return self.word(element, index),
            Format::LittleEndian => self.binary(kind, |b| b),
            Format::BigEndian => self.binary(kind, |mut b: [u8; 8]| {
                b[..kind.size()].reverse();
                b
            }),
        };
        value.ok_or_else(|| self.cut_off(element, index))
    }

    /// A value whose bytes, brought to the front and to little-endian order, are followed by zeros.
    #[inline]
    fn binary(&mut self, kind: Kind, order: impl Fn([u8; 8]) -> [u8; 8]) -> Option<f64> {
        let size = kind.size();
        let raw = self.bytes.get(self.at..self.at + size)?;
        let mut b = [0; 8];
        b[..size].copy_from_slice(raw);
        self.at += size;
        let b = order(b);
        let bits = u64::from_le_bytes(b);
        Some(match kind {
            Kind::I8 => f64::from(bits as i8),
            Kind::U8 => f64::from(bits as u8),
            Kind::I16 => f64::from(bits as i16),
            Kind::U16 => f64::from(bits as u16),
            Kind::I32 => f64::from(bits as i32),
            Kind::U32 => f64::from(bits as u32),
            Kind::F32 => f64::from(f32::from_bits(bits as u32)),
            Kind::F64 => f64::from_bits(bits),
        })
    }

    fn word(&mut self, element: &Element, index: usize) -> Result<f64, Error> {
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace());
        let Some(start) = start else {
            return Err(self.cut_off(element, index));
        };
        let rest = &rest[start..];
        let len = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        let word = &rest[..len];
        self.at += start + len;
        std::str::from_utf8(word).ok().and_then(|w| w.parse().ok()).ok_or_else(|| {
            // Of a binary file with a wrong header, a word can be long.
            let word = String::from_utf8_lossy(&word[..len.min(20)]);
            self.fault(format!("`{word}` of {} {index} is no number", element.name))
        })
    }

    fn cut_off(&self, element: &Element, index: usize) -> Error {
        self.whole(format!(
            "the file ends in `{}` {index} of {}; it is cut off",
            element.name, element.count
        ))
    }

    /// The length of a list, which the rest of the file is long enough for.
    #[inline]
    pub(super) fn list_length(
        &mut self,
        property: &Property,
        element: &Element,
        index: usize,
    ) -> Result<usize, Error> {
        let kind = property.length.unwrap_or(Kind::U8);
        let n = self.number(kind, element, index)?;
        if n >= 0.0 && n.fract() == 0.0 && n <= (self.bytes.len() - self.at) as f64 {
            Ok(n as usize)
        } else {
            Err(self.fault(format!(
                "the list `{}` of {} {index} promises {n} values, more than the file holds",
                property.name, element.name
            )))
        }
    }

    /// Reads the numbers of one element; lists are skipped and leave their value as it was.
    #[inline]
    pub(super) fn scalars(
        &mut self,
        element: &Element,
        index: usize,
        values: &mut [f64],
    ) -> Result<(), Error> {
        for (property, value) in element.properties.iter().zip(values) {
            if property.length.is_some() {
                self.skip_property(property, element, index)?;
            } else {
                *value = self.number(property.kind, element, index)?;
            }
        }
        Ok(())
    }

    /// Reads faces for as long as they are what most files hold: three valid indices of four bytes each, and nothing
    /// else. Returns how many those were.
    pub(super) fn plain_triangles(
        &mut self,
        element: &Element,
        n_vertices: usize,
        corners: &mut Vec<u32>,
    ) -> usize {
        let [Property { length: Some(Kind::U8), kind: Kind::I32 | Kind::U32, .. }] =
            element.properties.as_slice()
        else {
            return 0;
        };
        if self.format != Format::LittleEndian {
            return 0;
        }
        let mut n = 0;
        for face in self.bytes[self.at..].as_chunks::<13>().0.iter().take(element.count) {
            let index =
                |at| u32::from_le_bytes([face[at], face[at + 1], face[at + 2], face[at + 3]]);
            let indices = [index(1), index(5), index(9)];
            if face[0] != 3 || indices.iter().any(|&i| i as usize >= n_vertices) {
                break;
            }
            corners.extend(indices);
            n += 1;
        }
        self.at += 13 * n;
        n
    }

    pub(super) fn skip(&mut self, element: &Element, index: usize) -> Result<(), Error> {
        element.properties.iter().try_for_each(|p| self.skip_property(p, element, index))
    }

    pub(super) fn skip_property(
        &mut self,
        property: &Property,
        element: &Element,
        index: usize,
    ) -> Result<(), Error> {
        let n = match property.length {
            Some(_) => self.list_length(property, element, index)?,
            None => 1,
        };
        (0..n).try_for_each(|_| self.number(property.kind, element, index).map(drop))
    }

    /// Bytes after the last value, blanks aside.
    pub(super) fn n_left(&self) -> usize {
        self.bytes[self.at..].trim_ascii().len()
    }
}
