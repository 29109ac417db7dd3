//! From arrays to a file.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::Path;

use atomic_file::Existing;
use bytemuck::Pod;
use serde::Serialize;
use xxhash_rust::xxh3::xxh3_64;

use crate::directory::{self, Entry};
use crate::map::ALIGNMENT;
use crate::{Error, Header, codec, header};

/// An array to be written, and the name by which it is found again.
#[derive(Clone, Copy, Debug)]
pub struct Section<'a> {
    name: &'a str,
    element_bytes: usize,
    bytes: &'a [u8],
}

impl<'a> Section<'a> {
    /// The elements go to the file as they lie in memory.
    pub fn new<T: Pod>(name: &'a str, elements: &'a [T]) -> Self {
        const { assert!(size_of::<T>() > 0 && align_of::<T>() <= ALIGNMENT) };
        Self { name, element_bytes: size_of::<T>(), bytes: bytemuck::cast_slice(elements) }
    }
}

/// Writes a map to `path`, whole or not at all. Returns the bytes of the file.
///
/// The same arguments make the same bytes.
///
/// # Errors
/// Those of [`atomic_file::write`], and when header or metadata are too large to be read again.
///
/// # Panics
/// When two sections or two notes have the same name, or bincode has no form for `M`, such as a sequence of unknown length.
pub fn write<M: Serialize>(
    path: &Path,
    existing: Existing,
    header: &Header,
    metadata: &M,
    sections: &[Section<'_>],
) -> Result<u64, Error> {
    assert!(distinct(sections.iter().map(|s| s.name)), "sections need names of their own");
    assert!(
        distinct(header.notes.iter().map(|(name, _)| name.as_str())),
        "notes need names of their own"
    );
    let mut entries: Vec<Entry> = sections
        .iter()
        .map(|section| Entry {
            name: section.name.into(),
            element_bytes: section.element_bytes as u64,
            count: (section.bytes.len() / section.element_bytes) as u64,
            offset: 0,
            xxh3: xxh3_64(section.bytes),
        })
        .collect();

    // Where arrays lie depends on the length of what precedes them, which does not depend on where they lie.
    let metadata = codec::encode(metadata);
    let end_of_metadata = head(header, &entries, &metadata).len();
    directory::place(&mut entries, end_of_metadata as u64);
    let head = head(header, &entries, &metadata);
    let fits = |part, bytes, limit| match bytes <= limit {
        true => Ok(()),
        false => Err(Error::TooLarge { path: path.into(), part, bytes, limit }),
    };
    fits("header", head.text.len(), header::MAX_BYTES)?;
    fits("metadata", head.block.len(), codec::MAX_BYTES)?;

    let bytes = atomic_file::write(path, existing, |out| {
        out.write_all(head.text.as_bytes())?;
        out.write_all(&head.block)?;
        let mut end = head.len();
        for (entry, section) in entries.iter().zip(sections) {
            let offset = entry.offset as usize;
            out.write_all(&[0; ALIGNMENT][..offset - end])?;
            out.write_all(section.bytes)?;
            end = offset + section.bytes.len();
        }
        Ok(())
    })?;
    Ok(bytes)
}

/// All that precedes the arrays.
struct Head {
    text: String,
    /// Directory and metadata.
    block: Vec<u8>,
}

impl Head {
    fn len(&self) -> usize {
        self.text.len() + self.block.len()
    }
}

fn head(header: &Header, entries: &[Entry], metadata: &[u8]) -> Head {
    let mut block = codec::encode(&entries);
    block.extend_from_slice(metadata);
    Head { text: header::render(header, &block), block }
}

fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> bool {
    let mut seen = BTreeSet::new();
    names.into_iter().all(|name| seen.insert(name))
}
