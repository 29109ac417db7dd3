//! Parts of pictures: what a tile holds, block by block.
//!
//! The metadata of a part are `{"part":{"digest":"..."},"picture":...}`, with those of the picture at the end as they
//! are. The digest is of everything, the blocks as they lie in the file: a part may lie on any disk for any time before it
//! is joined with others, and the format itself doesn't notice damage to what can't be compressed.

use std::fmt::{self, Display};
use std::fs::File;
use std::io::{BufReader, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

use base::{Fingerprint, FingerprintBuilder, ImageSize, Window};
use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock};
use exr::block::reader::{AllChunksReader, ChunksReader};
use exr::meta::BlockDescription;
use exr::meta::attribute::{LineOrder, SampleType};

use crate::read_exr::{self, Fault};
use crate::{Error, zip};

/// A part of a picture in an OpenEXR file. Its pixels are not in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    path: PathBuf,
    window: Window,
    metadata: String,
    names: Vec<String>,
    digest: String,
}

impl Part {
    /// Reads what a file says of itself.
    ///
    /// # Errors
    /// When the file can't be read, is damaged as far as that can be seen, or isn't a part.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let (reader, file_len) = open(path)?;
        let header = &reader.headers()[0];
        read_exr::check(header, file_len).map_err(|fault| fault.at(path))?;
        let display = header.shared_attributes.display_window;
        let data = header.data_window();
        let side = |n: usize| u32::try_from(n).ok();
        let start = |at: i32| u32::try_from(at).ok();
        let window = || {
            let whole = ImageSize {
                width: side(display.size.width())?,
                height: side(display.size.height())?,
            };
            let (x, y) = (start(data.position.x())?, start(data.position.y())?);
            let end_x = x.checked_add(side(data.size.width())?)?;
            let end_y = y.checked_add(side(data.size.height())?)?;
            let is_ours = display.position.x() == 0
                && display.position.y() == 0
                && header.compression == zip::COMPRESSION
                && header.blocks == BlockDescription::ScanLines
                && header.line_order == LineOrder::Increasing
                && header.channels.list.iter().all(|c| c.sample_type == SampleType::F32);
            Window::new([x, end_x, y, end_y], whole)
                .filter(|_| is_ours && reader.headers().len() == 1)
        };
        let sealed = read_exr::metadata(header);
        let Some(((digest, metadata), window)) = unseal(&sealed).zip(window()) else {
            return Err(Error::NotAPart { path: path.into() });
        };
        let (digest, metadata) = (digest.into(), metadata.into());
        Ok(Self { path: path.into(), window, metadata, names: read_exr::names(header), digest })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where it lies in the whole picture.
    pub fn window(&self) -> Window {
        self.window
    }

    /// The JSON text of the whole picture; empty if it has none.
    pub fn metadata(&self) -> &str {
        &self.metadata
    }

    /// The names of the channels, in order.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The rows from the first on.
    pub(crate) fn rows(&self) -> Result<Rows<'_>, Error> {
        let (reader, _) = open(&self.path)?;
        let chunks = reader.all_chunks(false).map_err(|e| Fault::from(e).at(&self.path))?;
        let names = self.names.iter().map(String::as_str);
        let digest = PartDigest::new(self.window, &self.metadata, names);
        Ok(Rows { part: self, chunks, digest, block: Vec::new(), y: 0, first: 0, end: 0 })
    }
}

type Reader = exr::block::reader::Reader<BufReader<File>>;

/// The headers of a file, and its length.
fn open(path: &Path) -> Result<(Reader, usize), Error> {
    let unreadable = |cause| Error::Read { path: path.into(), cause };
    let file = File::open(path).map_err(unreadable)?;
    let length = file.metadata().map_err(unreadable)?.len();
    let mut magic = [0; 4];
    let is_exr = (&file).read_exact(&mut magic).is_ok() && magic == exr::meta::magic_number::BYTES;
    if !is_exr {
        return Err(Error::NotExr { path: path.into() });
    }
    let file = File::open(path).map_err(unreadable)?;
    let reader = exr::block::read(BufReader::new(file), false);
    let reader = reader.map_err(|e| Fault::from(e).at(path))?;
    Ok((reader, usize::try_from(length).unwrap_or(usize::MAX)))
}

/// The rows of a part, from the first to the last.
pub(crate) struct Rows<'p> {
    part: &'p Part,
    chunks: AllChunksReader<BufReader<File>>,
    digest: PartDigest,
    /// The values of each channel in the block at hand.
    block: Vec<Vec<f32>>,
    /// The next row, and the rows of the block.
    y: usize,
    first: usize,
    end: usize,
}

impl Rows<'_> {
    /// The next row by channel. Damage that no block shows is found with the last block.
    pub(crate) fn next(&mut self) -> Result<Vec<&[f32]>, Error> {
        if self.y == self.end {
            self.next_block().map_err(|fault| fault.at(&self.part.path))?;
        }
        let width = self.part.window.size.width as usize;
        let start = (self.y - self.first) * width;
        self.y += 1;
        Ok(self.block.iter().map(|values| &values[start..start + width]).collect())
    }

    /// The next block as it is packed. The rows before it have been taken.
    pub(crate) fn next_packed(&mut self) -> Result<Vec<u8>, Error> {
        assert_eq!(self.y, self.end, "the start of a block");
        let (rows, chunk) = self.next_chunk().map_err(|fault| fault.at(&self.part.path))?;
        self.y = rows.end;
        (self.first, self.end) = (rows.end, rows.end);
        match chunk.compressed_block {
            CompressedBlock::ScanLine(block) => Ok(block.compressed_pixels_le),
            _ => unreachable!("`next_chunk` gives scan lines"),
        }
    }

    fn next_block(&mut self) -> Result<(), Fault> {
        let damaged = |fault: &str| Fault::Damaged(fault.into());
        let (rows, chunk) = self.next_chunk()?;
        let meta = self.chunks.meta_data();
        let block = UncompressedBlock::decompress_chunk(chunk, meta, false)?;
        let width = self.part.window.size.width as usize;
        self.block = vec![vec![0.0; rows.len() * width]; self.part.names.len()];
        for line in block.lines(&meta.headers[0].channels) {
            let location = line.location;
            let y = location.position.y().checked_sub(rows.start);
            let start = y.map(|y| y * width + location.position.x());
            let values = start
                .and_then(|start| {
                    self.block[location.channel].get_mut(start..start + location.sample_count)
                })
                .ok_or_else(|| damaged("a block lies outside the picture"))?;
            line.read_samples_into_slice(values)?;
        }
        (self.first, self.end) = (rows.start, rows.end);
        Ok(())
    }

    /// The next block of the file, and its rows.
    fn next_chunk(&mut self) -> Result<(Range<usize>, Chunk), Fault> {
        let damaged = |fault: &str| Fault::Damaged(fault.into());
        let chunk = self.chunks.next().ok_or_else(|| damaged("the blocks end too early"))??;
        let Window { corner, size, .. } = self.part.window;
        let rows = self.y..(self.y + zip::LINES).min(size.height as usize);
        let CompressedBlock::ScanLine(block) = &chunk.compressed_block else {
            return Err(damaged("a block has no scan lines"));
        };
        if i64::from(block.y_coordinate) != i64::from(corner.y) + rows.start as i64 {
            return Err(damaged("a block is not where it belongs"));
        }
        self.digest.block(&block.compressed_pixels_le);
        if rows.end == size.height as usize && self.digest.to_string() != self.part.digest {
            return Err(damaged("what it holds does not match its digest"));
        }
        Ok((rows, chunk))
    }
}

/// A digest of all that a part holds.
pub(crate) struct PartDigest(FingerprintBuilder);

impl PartDigest {
    pub(crate) fn new<'a>(
        window: Window,
        metadata: &str,
        names: impl Iterator<Item = &'a str>,
    ) -> Self {
        let mut digest = FingerprintBuilder::new();
        digest.pod(&window.bounds()).pod(&[window.whole.width, window.whole.height]);
        digest.bytes(metadata.as_bytes());
        names.for_each(|name| {
            digest.bytes(name.as_bytes());
        });
        Self(digest)
    }

    /// Adds the next block, as it is packed.
    pub(crate) fn block(&mut self, packed: &[u8]) {
        self.0.bytes(packed);
    }
}

impl Display for PartDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digest: Fingerprint = self.0.finish();
        digest.fmt(f)
    }
}

/// As long as any digest: keeps its place while it isn't known.
pub(crate) const NO_DIGEST: &str = "0000000000000000";

pub(crate) const BEFORE_DIGEST: &str = r#"{"part":{"digest":""#;
const AFTER_DIGEST: &str = r#""},"picture":"#;

/// The metadata of a part.
pub(crate) fn seal(digest: impl Display, metadata: &str) -> String {
    let metadata = if metadata.is_empty() { "null" } else { metadata };
    format!("{BEFORE_DIGEST}{digest}{AFTER_DIGEST}{metadata}}}")
}

/// Digest and metadata of the picture, from the metadata of a part.
fn unseal(sealed: &str) -> Option<(&str, &str)> {
    let (digest, rest) = sealed.strip_prefix(BEFORE_DIGEST)?.split_once(AFTER_DIGEST)?;
    let metadata = rest.strip_suffix('}')?;
    Some((digest, if metadata == "null" { "" } else { metadata }))
}
