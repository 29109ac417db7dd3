//! Where in the file each array lies.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::map::ALIGNMENT;

/// One array. The offset follows from the arrays before it; it is written down for readers other than this crate.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Entry {
    pub(crate) name: String,
    /// Bytes of one element.
    pub(crate) element_bytes: u64,
    /// Number of elements.
    pub(crate) count: u64,
    /// Bytes from the start of the file to the first element.
    pub(crate) offset: u64,
    /// Digest of all elements.
    pub(crate) xxh3: u64,
}

impl Entry {
    /// The bytes of the array in the file, if they can be counted.
    fn range(&self) -> Option<Range<u64>> {
        let bytes = self.element_bytes.checked_mul(self.count)?;
        Some(self.offset..self.offset.checked_add(bytes)?)
    }
}

/// Fills in the offsets of arrays that follow `end_of_metadata`.
pub(crate) fn place(entries: &mut [Entry], end_of_metadata: u64) {
    let mut end = end_of_metadata;
    for entry in entries {
        entry.offset = end.next_multiple_of(ALIGNMENT as u64);
        end = entry.offset + entry.element_bytes * entry.count;
    }
}

/// The bytes of each array in a file of `file_bytes`, if all lie where [`place`] would put them and fill the file.
/// Otherwise where and how they don't.
pub(crate) fn ranges(
    entries: &[Entry],
    end_of_metadata: usize,
    file_bytes: usize,
) -> Result<Vec<Range<usize>>, (usize, String)> {
    let mut end = end_of_metadata;
    let mut ranges = Vec::new();
    for entry in entries {
        let Entry { name, offset, .. } = entry;
        let expected = end.next_multiple_of(ALIGNMENT);
        if *offset != expected as u64 {
            return Err((expected, format!("section `{name}` is said to begin at byte {offset}")));
        }
        let stop = entry.range().and_then(|range| usize::try_from(range.end).ok());
        let Some(stop) = stop.filter(|stop| *stop <= file_bytes) else {
            return Err((file_bytes, format!("the file ends before section `{name}` does")));
        };
        ranges.push(expected..stop);
        end = stop;
    }
    if end < file_bytes {
        return Err((end, "the file goes on after the end of the map".into()));
    }
    Ok(ranges)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(element_bytes: u64, count: u64) -> Entry {
        Entry { name: "a".into(), element_bytes, count, offset: 0, xxh3: 0 }
    }

    #[test]
    fn arrays_are_aligned_and_close() {
        let mut entries = [entry(12, 5), entry(4, 0), entry(1, 1), entry(8, 8)];
        place(&mut entries, 130);
        assert_eq!(entries.clone().map(|e| e.offset), [192, 256, 256, 320]);
        assert_eq!(ranges(&entries, 130, 384), Ok(vec![192..252, 256..256, 256..257, 320..384]));
        assert_eq!(ranges(&[], 130, 130), Ok(vec![]));
    }

    #[test]
    fn arrays_elsewhere_are_refused() {
        let mut entries = [entry(12, 5), entry(8, 8)];
        place(&mut entries, 130);
        let says = |entries: &[Entry], file, at, message: &str| {
            assert_eq!(ranges(entries, 130, file), Err((at, message.into())));
        };
        says(&entries, 319, 319, "the file ends before section `a` does");
        says(&entries, 321, 320, "the file goes on after the end of the map");
        says(&[], 131, 130, "the file goes on after the end of the map");
        for offset in [0, 128, 193, 256, u64::MAX] {
            entries[0].offset = offset;
            let message = format!("section `a` is said to begin at byte {offset}");
            says(&entries, 320, 192, &message);
        }
        for (element_bytes, count) in [(u64::MAX, 1), (1, u64::MAX), (1 << 32, 1 << 32), (1, 129)] {
            let entry = Entry { offset: 192, ..entry(element_bytes, count) };
            says(&[entry], 320, 320, "the file ends before section `a` does");
        }
    }
}
