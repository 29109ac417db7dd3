//! The bytes of a file, mapped into memory where that can be done.

use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::ops::Deref;
use std::path::Path;

use bytemuck::{Pod, Zeroable};
use memmap2::Mmap;

/// Arrays begin at multiples of this, in the file and so in memory.
pub(crate) const ALIGNMENT: usize = 64;

/// The bytes of a file. The first lies at a multiple of [`ALIGNMENT`].
pub(crate) enum Bytes {
    /// In the system's cache, brought in page by page when touched.
    Mapped(Mmap),
    /// Read, because the file could not be mapped.
    Read { blocks: Vec<Block>, len: usize },
}

/// The unit of memory that is aligned as arrays need it.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Block([u8; ALIGNMENT]);

impl Bytes {
    /// The bytes of the file at `path`, or nothing if it doesn't begin with `magic`.
    pub(crate) fn open(path: &Path, magic: &[u8]) -> io::Result<Option<Self>> {
        let mut file = File::open(path)?;
        let bytes = match map(&file) {
            Some(mapped) => Self::Mapped(mapped),
            None => return read(&mut file, magic),
        };
        Ok(bytes.starts_with(magic).then_some(bytes))
    }
}

impl Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Mapped(bytes) => bytes,
            Self::Read { blocks, len } => &bytemuck::cast_slice(blocks)[..*len],
        }
    }
}

impl fmt::Debug for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let how = match self {
            Self::Mapped(_) => "mapped",
            Self::Read { .. } => "read",
        };
        write!(f, "{} bytes, {how}", self.len())
    }
}

#[expect(unsafe_code, reason = "a map of many megabytes is to be used where it lies, not copied")]
fn map(file: &File) -> Option<Mmap> {
    if !file.metadata().ok()?.is_file() {
        return None;
    }
    // SAFETY: the bytes must not change while they are mapped. Maps are replaced by renaming a finished file, never
    // written in place (see `atomic_file::write`), and the crate documents that nobody else may. The mapping is private
    // and read-only, so nothing changes through it. A file shortened against this assumption ends the process (SIGBUS).
    unsafe { Mmap::map(file) }.ok()
}

/// Reads to the end, but no further than a start that is wrong: some things that can be opened never end.
fn read(file: &mut impl Read, magic: &[u8]) -> io::Result<Option<Bytes>> {
    let mut blocks = vec![Block::zeroed(); 1024];
    let mut len = 0;
    loop {
        if len == blocks.len() * ALIGNMENT {
            blocks.resize(blocks.len() * 2, Block::zeroed());
        }
        match file.read(&mut bytemuck::cast_slice_mut(&mut blocks)[len..]) {
            Ok(0) => break,
            Ok(n) => len += n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
        let start = &bytemuck::cast_slice::<_, u8>(&blocks)[..len.min(magic.len())];
        if !magic.starts_with(start) {
            return Ok(None);
        }
    }
    Ok((len >= magic.len()).then_some(Bytes::Read { blocks, len }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_read_is_what_is_there() {
        for len in [0, 1, 2, 3, 65_535, 65_536, 65_537, 300_000] {
            let content: Vec<u8> = (0..len).map(|i| i as u8).collect();
            let bytes = read(&mut &content[..], &[0, 1]).unwrap();
            if len < 2 {
                assert!(bytes.is_none());
            } else {
                let bytes = bytes.unwrap();
                assert_eq!(*bytes, content);
                assert_eq!(bytes.as_ptr() as usize % ALIGNMENT, 0);
            }
        }
    }

    #[test]
    fn a_wrong_start_ends_the_reading() {
        assert!(read(&mut io::repeat(7), b"\x07\x07\x08").unwrap().is_none());
        let path = Path::new("/dev/zero");
        if path.exists() {
            assert!(Bytes::open(path, b"#").unwrap().is_none());
        }
    }

    #[test]
    fn regular_files_are_mapped() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), b"#abc").unwrap();
        let bytes = Bytes::open(file.path(), b"#a").unwrap().unwrap();
        assert_eq!(format!("{bytes:?}"), "4 bytes, mapped");
        assert_eq!(*bytes, *b"#abc");
        assert!(Bytes::open(file.path(), b"#b").unwrap().is_none());
    }
}
