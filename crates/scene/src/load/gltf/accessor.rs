//! Arrays in buffers. All of an accessor is checked before any of it is read.

use super::file::File;
use crate::Error;

/// An array of numbers, or of tuples of them.
pub(super) struct Accessor<'f> {
    count: usize,
    /// How many numbers an element has.
    width: usize,
    component: Component,
    is_normalized: bool,
    /// Zeros if there are none.
    dense: Option<Elements<'f>>,
    /// Places that have other values than the dense ones, rising.
    sparse: Option<(Vec<usize>, Elements<'f>)>,
}

impl<'f> Accessor<'f> {
    /// The accessor of an index that was read at a place.
    pub(super) fn new(file: &'f File, index: usize, place: &str) -> Result<Self, Error> {
        let table = file.get(&file.tables.accessors, "accessors", index, place)?;
        let place = format!("accessors[{index}]");
        let fault = |fault: String| file.fault(&place, fault);
        let component = Component::new(table.component_type).map_err(fault)?;
        let width = match table.kind.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            other => return Err(fault(format!("its type {other} is not expected here"))),
        };
        let of = |view, offset, component: Component, width, count, name: &str| {
            let place = format!("{place}{name}");
            let view = file.view(view, &place)?;
            Elements::new(view.bytes, view.stride, offset, component.size() * width, count)
                .map_err(|text| file.fault(&place, text))
        };
        let dense = match table.buffer_view {
            Some(view) => Some(of(view, table.byte_offset, component, width, table.count, "")?),
            None => None,
        };
        let sparse = match &table.sparse {
            Some(sparse) => {
                let (at, values) = (&sparse.indices, &sparse.values);
                let kind = Component::new(at.component_type.unwrap_or_default())
                    .map_err(|text| file.fault(&format!("{place}.sparse.indices"), text))?;
                let n = sparse.count;
                let indices = of(at.buffer_view, at.byte_offset, kind, 1, n, ".sparse.indices")?;
                let indices: Vec<usize> =
                    (0..n).map(|i| kind.whole(indices.get(i)) as usize).collect();
                if !indices.is_sorted_by(|a, b| a < b)
                    || indices.last().is_some_and(|last| *last >= table.count)
                {
                    let fault = format!("its indices must rise and stay below {}", table.count);
                    return Err(file.fault(&format!("{place}.sparse.indices"), fault));
                }
                let (view, offset) = (values.buffer_view, values.byte_offset);
                Some((indices, of(view, offset, component, width, n, ".sparse.values")?))
            }
            None => None,
        };
        let Some(()) = (dense.is_some() || sparse.is_some()).then_some(()) else {
            return Err(fault("it has no bufferView, so it holds nothing but zeros".into()));
        };
        Ok(Self {
            count: table.count,
            width,
            component,
            is_normalized: table.normalized,
            dense,
            sparse,
        })
    }

    /// How many elements it has.
    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// How many numbers an element has.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Whether it consists of single whole numbers without a sign.
    pub(super) fn is_index(&self) -> bool {
        self.width == 1 && matches!(self.component, Component::U8 | Component::U16 | Component::U32)
    }

    /// The first numbers of an element below [`Self::len`]; those that it doesn't have are 0.
    pub(super) fn floats<const N: usize>(&self, index: usize) -> [f32; N] {
        let mut floats = [0.0; N];
        if let Some(bytes) = self.element(index) {
            for (float, bytes) in floats.iter_mut().zip(bytes.chunks_exact(self.component.size())) {
                *float = self.component.float(bytes, self.is_normalized);
            }
        }
        floats
    }

    /// An element below [`Self::len`] of single numbers as an index.
    pub(super) fn index(&self, index: usize) -> u32 {
        self.element(index).map_or(0, |bytes| self.component.whole(bytes))
    }

    fn element(&self, index: usize) -> Option<&'f [u8]> {
        if let Some((indices, values)) = &self.sparse
            && let Ok(at) = indices.binary_search(&index)
        {
            return Some(values.get(at));
        }
        self.dense.as_ref().map(|dense| dense.get(index))
    }
}

/// Elements in a row, some bytes apart.
struct Elements<'f> {
    bytes: &'f [u8],
    stride: usize,
    size: usize,
}

impl<'f> Elements<'f> {
    /// Elements of that size, as many as `count`; or why they can't be, in words.
    fn new(
        bytes: &'f [u8],
        stride: Option<usize>,
        offset: usize,
        size: usize,
        count: usize,
    ) -> Result<Self, String> {
        let stride = stride.unwrap_or(size);
        if stride < size {
            return Err(format!(
                "the stride of its buffer view, {stride}, is less than the {size} bytes of an element"
            ));
        }
        let needed = match count.checked_sub(1) {
            Some(before) => before.checked_mul(stride).and_then(|n| n.checked_add(size)),
            None => return Err("its count is 0; give at least one element".into()),
        };
        match bytes.get(offset..) {
            Some(bytes) if needed.is_some_and(|needed| needed <= bytes.len()) => {
                Ok(Self { bytes, stride, size })
            }
            _ => Err(format!(
                "its {count} elements end behind its buffer view, which has {} bytes",
                bytes.len()
            )),
        }
    }

    fn get(&self, index: usize) -> &'f [u8] {
        let start = index * self.stride;
        &self.bytes[start..start + self.size]
    }
}

/// How a number is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    /// The kind of a number of the JSON, or words.
    fn new(number: u32) -> Result<Self, String> {
        Ok(match number {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return Err(format!("its componentType {number} is unknown")),
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    fn float(self, bytes: &[u8], is_normalized: bool) -> f32 {
        let (value, one) = match (self, bytes) {
            (Self::I8, &[a]) => (f32::from(a as i8), 127.0),
            (Self::U8, &[a]) => (f32::from(a), 255.0),
            (Self::I16, &[a, b]) => (f32::from(i16::from_le_bytes([a, b])), 32767.0),
            (Self::U16, &[a, b]) => (f32::from(u16::from_le_bytes([a, b])), 65535.0),
            (Self::U32, &[a, b, c, d]) => {
                (u32::from_le_bytes([a, b, c, d]) as f32, u32::MAX as f32)
            }
            (Self::F32, &[a, b, c, d]) => return f32::from_le_bytes([a, b, c, d]),
            _ => return 0.0,
        };
        // -128 stands for -1, too.
        if is_normalized { (value / one).max(-1.0) } else { value }
    }

    fn whole(self, bytes: &[u8]) -> u32 {
        match (self, bytes) {
            (Self::U8, &[a]) => u32::from(a),
            (Self::U16, &[a, b]) => u32::from(u16::from_le_bytes([a, b])),
            (Self::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]),
            _ => u32::MAX,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_may_be_parts_of_one() {
        let of = |component: Component, bytes: &[u8]| component.float(bytes, true);
        assert_eq!([0, 255].map(|b| of(Component::U8, &[b])), [0.0, 1.0]);
        assert_eq!([127, 129, 128].map(|b| of(Component::I8, &[b])), [1.0, -1.0, -1.0]);
        assert_eq!(of(Component::U16, &[255, 255]), 1.0);
        assert_eq!(of(Component::I16, &[1, 128]), -1.0);
        assert_eq!(Component::I16.float(&[254, 255], false), -2.0);
    }
}
