//! From a file to arrays.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use base::Inventory;
use bytemuck::Pod;
use serde::de::DeserializeOwned;
use xxhash_rust::xxh3::xxh3_64;

use crate::directory::{self, Entry};
use crate::header::{self, Block};
use crate::map::{ALIGNMENT, Bytes};
use crate::{Array, Error, Header, codec};

/// A map, of which nothing is lent out that wasn't verified.
#[derive(Clone, Debug)]
pub struct MapFile {
    path: PathBuf,
    header: Header,
    digest: u64,
    bytes: Arc<Bytes>,
    sections: Vec<Placed>,
    /// Of each section, whether it was verified: when the map was opened, or when it was asked for.
    verified: Vec<OnceLock<()>>,
}

impl MapFile {
    /// Opens the map at `path`, which must be of this kind and version, and verifies all of it. Returns its metadata too.
    ///
    /// Reads the whole file once, as fast as memory allows, and copies none of it unless it cannot be mapped.
    ///
    /// # Errors
    /// When the file cannot be read, is not a map, is one of another kind or version, or differs in any bit from what
    /// was written.
    pub fn open<M: DeserializeOwned>(
        path: &Path,
        kind: &str,
        version: u32,
    ) -> Result<(Self, M), Error> {
        let (map, metadata) = Self::open_in_part(path, kind, version)?;
        (0..map.sections.len()).try_for_each(|section| map.verify(section))?;
        Ok((map, metadata))
    }

    /// As [`open`](Self::open), but a section is verified when it is first asked for: for who needs a few of many.
    ///
    /// # Errors
    /// Those of [`open`](Self::open), but for what is wrong with sections.
    pub fn open_in_part<M: DeserializeOwned>(
        path: &Path,
        kind: &str,
        version: u32,
    ) -> Result<(Self, M), Error> {
        let bytes = Bytes::open(path, header::MAGIC.as_bytes())
            .map_err(|cause| Error::Read { path: path.into(), cause })?
            .ok_or_else(|| Error::NotAMap { path: path.into() })?;
        let (header, block) = header::parse(path, &bytes)?;
        if header.kind != kind {
            return Err(Error::OtherKind {
                path: path.into(),
                command: header.remedy(path),
                found: header.kind,
                expected: kind.into(),
            });
        }
        if header.version != version {
            return Err(Error::OtherVersion {
                path: path.into(),
                found: header.version,
                expected: version,
                remedy: header.remedy(path),
            });
        }
        match read_directory(&bytes, block) {
            Ok((sections, metadata)) => {
                let (path, bytes, digest) = (path.into(), Arc::new(bytes), block.xxh3);
                let verified = sections.iter().map(|_| OnceLock::new()).collect();
                Ok((Self { path, header, digest, bytes, sections, verified }, metadata))
            }
            Err((offset, what)) => Err(Error::Corrupt {
                path: path.into(),
                what,
                offset: Some(offset as u64),
                remedy: Some(header.remedy(path)),
            }),
        }
    }

    /// Holds a section, by number, against its digest, unless that was done.
    fn verify(&self, section: usize) -> Result<(), Error> {
        let ((entry, range), verified) = (&self.sections[section], &self.verified[section]);
        if verified.get().is_some() || xxh3_64(&self.bytes[range.clone()]) == entry.xxh3 {
            verified.get_or_init(|| ());
            return Ok(());
        }
        Err(Error::Corrupt {
            path: self.path.clone(),
            what: format!("section `{}` does not match its digest", entry.name),
            offset: Some(range.start as u64),
            remedy: Some(self.header.remedy(&self.path)),
        })
    }

    /// What the map says about itself.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// A digest of all that the map holds: of its metadata and of the digests of its sections. Those may not have been
    /// verified yet.
    pub fn digest(&self) -> u64 {
        self.digest
    }

    /// To be asked before anything that was made with the map is shown: bytes that were verified may have been
    /// overwritten since, by a program that doesn't replace files as those of this project do.
    ///
    /// # Errors
    /// When the file was changed while it was in use.
    pub fn check_untouched(&self) -> Result<(), Error> {
        if self.bytes.is_untouched() {
            return Ok(());
        }
        Err(Error::Touched { path: self.path.clone() })
    }

    /// The section `name`, in place.
    ///
    /// # Errors
    /// When there is no such section, its elements are not of the size of `T`, or it isn't as it was written.
    pub fn array<T: Pod>(&self, name: &str) -> Result<Array<T>, Error> {
        const { assert!(size_of::<T>() > 0 && align_of::<T>() <= ALIGNMENT) };
        let section = (self.sections.iter().position(|(entry, _)| entry.name == name))
            .ok_or_else(|| self.corrupt(format!("it has no section `{name}`")))?;
        let (entry, range) = &self.sections[section];
        let other_size = || {
            let (found, expected) = (entry.element_bytes, size_of::<T>());
            self.corrupt(format!("elements of `{name}` have {found} bytes instead of {expected}"))
        };
        if entry.element_bytes != size_of::<T>() as u64 {
            return Err(other_size());
        }
        self.verify(section)?;
        Array::in_file(&self.bytes, range.clone()).ok_or_else(other_size)
    }

    /// Refuses the map if it was made from other inputs than there are now.
    ///
    /// # Errors
    /// [`Error::Stale`], which lists what changed since and gives the command that makes the map anew.
    pub fn check_inputs(&self, then: &Inventory, now: &Inventory) -> Result<(), Error> {
        if then == now {
            return Ok(());
        }
        Err(Error::Stale {
            path: self.path.clone(),
            changes: then.changes(now),
            remedy: self.header.remedy(&self.path),
        })
    }

    /// The error for contents that are as they were written, but make no sense to whoever knows the kind of map.
    pub fn corrupt(&self, what: impl Into<String>) -> Error {
        Error::Corrupt {
            path: self.path.clone(),
            what: what.into(),
            offset: None,
            remedy: Some(self.header.remedy(&self.path)),
        }
    }
}

/// An array and the bytes where it lies.
type Placed = (Entry, Range<usize>);

/// The arrays and the metadata of a file, if all its bytes after the header, those of arrays aside, are as they were
/// written. Otherwise where and how they are not.
fn read_directory<M: DeserializeOwned>(
    file: &[u8],
    block: Block,
) -> Result<(Vec<Placed>, M), (usize, String)> {
    let start = block.start;
    let mut end = usize::try_from(block.bytes)
        .ok()
        .and_then(|len| start.checked_add(len))
        .filter(|end| *end <= file.len())
        .ok_or((file.len(), "the file ends before its metadata does".to_owned()))?;
    let bytes = &file[start..end];
    if xxh3_64(bytes) != block.xxh3 {
        return Err((start, "the metadata does not match its digest".into()));
    }
    let (entries, used) = codec::decode::<Vec<Entry>>(bytes)
        .map_err(|e| (start, format!("the directory makes no sense: {e}")))?;
    let (metadata, rest) = codec::decode::<M>(&bytes[used..])
        .map_err(|e| (start + used, format!("the metadata makes no sense: {e}")))?;
    if used + rest != bytes.len() {
        return Err((start + used + rest, "something follows the metadata".into()));
    }

    let ranges = directory::ranges(&entries, end, file.len())?;
    for (entry, range) in entries.iter().zip(&ranges) {
        if let Some(at) = file[end..range.start].iter().position(|byte| *byte != 0) {
            return Err((end + at, format!("something precedes section `{}`", entry.name)));
        }
        end = range.end;
    }
    Ok((entries.into_iter().zip(ranges).collect(), metadata))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A file that holds `bytes` for directory and metadata, digest and all, then `rest`.
    fn sealed(bytes: &[u8], rest: &[u8]) -> (Vec<u8>, Block) {
        let block = Block { start: 5, bytes: bytes.len() as u64, xxh3: xxh3_64(bytes) };
        ([&[b'#'; 5], bytes, rest].concat(), block)
    }

    #[test]
    fn hostile_lengths_of_the_metadata_are_refused() {
        let (file, block) = sealed(&[0; 8], &[]);
        read_directory::<()>(&file, block).unwrap();
        for bytes in [9, 13, 1 << 40, u64::MAX - 3, u64::MAX] {
            let (at, what) = read_directory::<()>(&file, Block { bytes, ..block }).unwrap_err();
            assert_eq!((at, &*what), (13, "the file ends before its metadata does"));
        }
    }

    #[test]
    fn padding_is_zero() {
        let mut entries = [Entry {
            name: "a".into(),
            element_bytes: 1,
            count: 4,
            offset: 0,
            xxh3: xxh3_64(&[7; 4]),
        }];
        let end = sealed(&codec::encode(&entries.as_slice()), &[]).0.len();
        directory::place(&mut entries, end as u64);
        let start = entries[0].offset as usize;
        let padding = vec![0; start - end];
        let (mut file, block) =
            sealed(&codec::encode(&entries.as_slice()), &[&padding, &[7; 4][..]].concat());
        assert_eq!(read_directory::<()>(&file, block).unwrap().0[0].1, start..start + 4);
        for at in end..start {
            file[at] = 1;
            let expected = (at, "something precedes section `a`".to_owned());
            assert_eq!(read_directory::<()>(&file, block).unwrap_err(), expected);
            file[at] = 0;
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 10_000,
            rng_seed: proptest::test_runner::RngSeed::Fixed(2),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        /// Digests keep accidents out, not malice: what they vouch for is still not trusted.
        #[test]
        fn sealed_nonsense_is_an_error_or_harmless(
            n_entries in 0_u64..4,
            words in proptest::collection::vec(prop_oneof![0_u64..300, any::<u64>()], 0..20),
            rest in proptest::collection::vec(any::<u8>(), 0..200),
        ) {
            let block = [&[n_entries], &*words].concat();
            let (file, block) = sealed(bytemuck::cast_slice(&block), &rest);
            if let Ok((sections, _)) = read_directory::<Vec<String>>(&file, block) {
                for (entry, range) in sections {
                    prop_assert!(range.start <= range.end && range.end <= file.len());
                    prop_assert_eq!(range.len() as u64, entry.element_bytes * entry.count);
                }
            }
        }
    }
}
