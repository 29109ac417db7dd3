//! Slices that may lie in a file.

use std::fmt;
use std::marker::PhantomData;
use std::ops::{Deref, Range};
use std::sync::Arc;

use bytemuck::Pod;

use crate::map::Bytes;

/// A slice that is owned, or lies in a mapped file that it keeps open. To clone it copies no elements.
///
/// Turning it into a slice costs a few instructions: do so before a loop, not in it.
pub struct Array<T: Pod>(Storage<T>);

enum Storage<T> {
    Owned(Arc<Vec<T>>),
    InFile { file: Arc<Bytes>, range: Range<usize>, elements: PhantomData<T> },
}

impl<T: Pod> Array<T> {
    /// The elements in `range` of the bytes of `file`, if it is aligned for them and holds a whole number.
    pub(crate) fn in_file(file: &Arc<Bytes>, range: Range<usize>) -> Option<Self> {
        bytemuck::try_cast_slice::<u8, T>(file.get(range.clone())?).ok()?;
        Some(Self(Storage::InFile { file: Arc::clone(file), range, elements: PhantomData }))
    }

    /// Whether the elements lie in a file rather than in memory of their own.
    pub fn is_in_file(&self) -> bool {
        matches!(self.0, Storage::InFile { .. })
    }
}

impl<T: Pod> Deref for Array<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        match &self.0 {
            Storage::Owned(elements) => elements,
            // `in_file` has tried this cast.
            Storage::InFile { file, range, .. } => bytemuck::cast_slice(&file[range.clone()]),
        }
    }
}

impl<T: Pod> From<Vec<T>> for Array<T> {
    fn from(elements: Vec<T>) -> Self {
        Self(Storage::Owned(Arc::new(elements)))
    }
}

impl<T: Pod> Clone for Array<T> {
    fn clone(&self) -> Self {
        Self(match &self.0 {
            Storage::Owned(elements) => Storage::Owned(Arc::clone(elements)),
            Storage::InFile { file, range, .. } => Storage::InFile {
                file: Arc::clone(file),
                range: range.clone(),
                elements: PhantomData,
            },
        })
    }
}

impl<T: Pod> fmt::Debug for Array<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = if self.is_in_file() { "in a file" } else { "in memory" };
        write!(f, "{} x {}, {place}", self.len(), std::any::type_name::<T>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn owned_arrays_are_shared() {
        let array = Array::from(vec![1_u16, 2, 3]);
        let clone = array.clone();
        assert_eq!(*clone, [1, 2, 3]);
        assert_eq!(clone.as_ptr(), array.as_ptr());
        assert_eq!(format!("{array:?}"), "3 x u16, in memory");
    }

    #[test]
    fn arrays_go_between_threads() {
        fn goes<T: Send + Sync + 'static>(_: &T) {}
        goes(&Array::from(vec![0.0_f32]));
    }
}
