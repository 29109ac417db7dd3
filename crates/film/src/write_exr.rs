//! OpenEXR files: every layer of a picture.

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::iter;
use std::ops::Range;
use std::path::Path;

use atomic_file::Existing;
use base::Window;
use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::block::writer::ChunksWriter;
use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::{
    AttributeValue, ChannelDescription, IntegerBounds, LineOrder, SampleType, Text,
};
use exr::meta::header::{Header, LayerAttributes};
use rayon::prelude::*;

use crate::part::{self, PartDigest};
use crate::{Error, Picture, zip};

/// The attribute that holds the metadata of a picture.
///
/// It is the only one outside the standard: the exr crate keeps those in a hash map, and two would come out in either order.
pub(crate) const METADATA_ATTRIBUTE: &str = "tetralux";

/// The most blocks that are compressed at once: leaves work for every thread.
const BLOCKS_AT_ONCE: usize = 32;

/// About so many bytes are compressed at once, or one block: bounds the memory.
const BYTES_AT_ONCE: usize = 1 << 28;

/// Some rows of a picture as they lie in a file: their blocks, packed.
#[derive(Debug)]
pub struct PackedRows {
    window: Window,
    metadata: String,
    /// In the order of the file.
    names: Vec<String>,
    blocks: Vec<Vec<u8>>,
}

impl PackedRows {
    /// Packs a picture, or whole rows of one, for the file at `path`.
    ///
    /// # Errors
    /// When a value is NaN or infinite: the error names the file.
    pub fn new(path: &Path, picture: &Picture) -> Result<Self, Error> {
        let window = picture.window();
        for (channel, values) in picture.channels() {
            if let Some(index) = values.iter().position(|v| !v.is_finite()) {
                return Err(Error::NotFinite {
                    path: path.into(),
                    channel: channel.into(),
                    pixel: window.in_whole(window.size.pixel(index)),
                    value: values[index],
                });
            }
        }
        // The format asks for channels sorted by name.
        let mut channels: Vec<_> = picture.channels().collect();
        channels.sort_by_key(|(name, _)| *name);
        let width = window.size.width as usize;
        let rows: Vec<Range<usize>> = zip::blocks(window.size.height as usize).collect();
        let pack = |rows: &Range<usize>| {
            let pixels = rows.start * width..rows.end * width;
            let channels: Vec<_> = channels.iter().map(|(_, v)| &v[pixels.clone()]).collect();
            zip::pack(&channels, width)
        };
        let names = channels.iter().map(|&(name, _)| name.to_owned()).collect();
        let blocks = rows.par_iter().map(pack).collect();
        Ok(Self { window, metadata: picture.metadata().into(), names, blocks })
    }
}

/// Writes `picture` as one part of 32-bit float channels, in ZIP blocks of 16 scan lines. Returns the number of bytes.
///
/// The channels are sorted by name, as the format asks. The same picture gives the same bytes. The metadata goes into
/// the string attribute `tetralux`. What is a part of a picture has that part as its data window, the whole picture as its
/// display window, and a digest of all that it holds beside its metadata: see [`Part`](crate::Part).
///
/// # Errors
/// When a value is NaN or infinite, when there are no pixels, or when the file cannot be written.
pub fn write_exr(path: &Path, existing: Existing, picture: &Picture) -> Result<u64, Error> {
    write_packed_exr(path, existing, picture.window(), iter::once(PackedRows::new(path, picture)))
}

/// Writes what comes in bands of whole rows, from top to bottom, and together fills `window`: the bytes that [`write_exr`]
/// writes of it in one piece. The file is begun when the first band is there. One band is in memory at a time.
///
/// # Errors
/// As [`write_exr`], and the first that a band comes with.
///
/// # Panics
/// When a band isn't the one that follows, begins within a block of [`BLOCK_ROWS`](crate::BLOCK_ROWS), or has other channels
/// than the first.
pub fn write_packed_exr<E: From<Error>>(
    path: &Path,
    existing: Existing,
    window: Window,
    bands: impl IntoIterator<Item = Result<PackedRows, E>>,
) -> Result<u64, E> {
    if window.size.n_pixels() == 0 {
        return Err(Error::NoPixels { path: path.into() }.into());
    }
    let [left, right, top, bottom] = window.bounds();
    let mut y = top;
    let mut bands = bands.into_iter().inspect(|band| {
        let Ok(band) = band else { return };
        let bounds = band.window.bounds();
        let follows =
            bounds[..3] == [left, right, y] && (y - top).is_multiple_of(zip::LINES as u32);
        assert!(follows && bounds[3] <= bottom, "{bounds:?} follows row {y} of {window:?}");
        y = bounds[3];
    });
    let first = bands.next().expect("a window of pixels has a band")?;
    let PackedRows { metadata, names, blocks: first, .. } = first;
    let list = || names.iter().map(String::as_str);
    let blocks = iter::once(Ok(first)).chain(bands.map(|band| {
        let band = band?;
        assert_eq!(band.names, names, "every band has all channels");
        Ok(band.blocks)
    }));
    let (digest, metadata) = match window.is_whole() {
        true => (None, metadata),
        false => {
            let digest = PartDigest::new(window, &metadata, list());
            (Some(digest), part::seal(part::NO_DIGEST, &metadata))
        }
    };
    write_blocks(path, existing, header(window, &metadata, list()), digest, blocks)
}

/// The blocks of a picture, by the rows that they hold, as many at a time as should be packed at once.
pub(crate) fn blocks_at_once(header: &Header) -> Vec<Vec<Range<usize>>> {
    let (width, height) = (header.layer_size.width(), header.layer_size.height());
    let block_bytes = header.channels.bytes_per_pixel * width * zip::LINES;
    let n = (BYTES_AT_ONCE / block_bytes.max(1)).clamp(1, BLOCKS_AT_ONCE);
    let blocks: Vec<Range<usize>> = zip::blocks(height).collect();
    blocks.chunks(n).map(<[_]>::to_vec).collect()
}

/// Writes a picture whose packed blocks come in order, some at a time. Of a part, the blocks are added to the digest so far,
/// which then takes the place that the header has for it.
///
/// # Panics
/// When not all blocks come.
pub(crate) fn write_blocks<E: From<Error>>(
    path: &Path,
    existing: Existing,
    header: Header,
    mut digest: Option<PartDigest>,
    blocks: impl Iterator<Item = Result<Vec<Vec<u8>>, E>>,
) -> Result<u64, E> {
    let top = header.own_attributes.layer_position.y();
    let n_blocks = zip::blocks(header.layer_size.height()).count();
    let mut failure = None;
    let written = atomic_file::write(path, existing, |out| {
        exr::block::write(&mut *out, [header].into_iter().collect(), true, |_, writer| {
            let mut n = 0;
            for some in blocks {
                let some = some.map_err(|error| {
                    failure = Some(error);
                    exr::error::Error::Io(io::Error::other("there is no more of the picture"))
                })?;
                for bytes in some {
                    digest.iter_mut().for_each(|digest| digest.block(&bytes));
                    let block = CompressedScanLineBlock {
                        y_coordinate: top + (n * zip::LINES) as i32,
                        compressed_pixels_le: bytes,
                    };
                    let chunk = Chunk {
                        layer_index: 0,
                        compressed_block: CompressedBlock::ScanLine(block),
                    };
                    writer.write_chunk(n, chunk)?;
                    n += 1;
                }
            }
            assert_eq!(n, n_blocks, "all rows of the picture");
            Ok(())
        })
        .map_err(io_error)?;
        digest.map_or(Ok(()), |digest| seal(out, &digest))
    });
    match failure {
        Some(error) => Err(error),
        None => written.map_err(|error| Error::from(error).into()),
    }
}

/// Puts the digest of a part into its place in the header.
fn seal(out: &mut BufWriter<File>, digest: &PartDigest) -> io::Result<()> {
    const AT_ONCE: u64 = 1 << 16;
    out.flush()?;
    let file = out.get_mut();
    file.rewind()?;
    let (before, mut head) = (part::BEFORE_DIGEST.as_bytes(), Vec::new());
    let place = loop {
        let n = Read::by_ref(file).take(AT_ONCE).read_to_end(&mut head)?;
        match head.windows(before.len()).position(|bytes| bytes == before) {
            Some(place) => break place + before.len(),
            None if n == 0 => return Err(io::Error::other("its header has no digest")),
            None => {}
        }
    };
    file.seek(SeekFrom::Start(place as u64))?;
    file.write_all(digest.to_string().as_bytes())?;
    file.seek(SeekFrom::End(0)).map(drop)
}

/// The header of a picture with these channels, in order.
pub(crate) fn header<'a>(
    window: Window,
    metadata: &str,
    names: impl Iterator<Item = &'a str>,
) -> Header {
    let Window { corner, size, whole } = window;
    let mut attributes = LayerAttributes {
        software_name: Some(text(concat!("Tetralux ", env!("CARGO_PKG_VERSION")))),
        layer_position: Vec2(corner.x as i32, corner.y as i32),
        ..LayerAttributes::default()
    };
    if !metadata.is_empty() {
        let value = AttributeValue::Text(text(metadata));
        attributes.other.insert(text(METADATA_ATTRIBUTE), value);
    }
    let channels = names.map(|name| ChannelDescription {
        name: text(name),
        sample_type: SampleType::F32,
        quantize_linearly: false,
        sampling: (1, 1).into(),
    });
    let display = IntegerBounds::from_dimensions((whole.width as usize, whole.height as usize));
    Header::new(Text::default(), (size.width as usize, size.height as usize), channels.collect())
        .with_encoding(zip::COMPRESSION, BlockDescription::ScanLines, LineOrder::Increasing)
        .with_attributes(attributes)
        .with_display_window(display)
}

/// Text attributes are bytes: UTF-8 goes in as it is.
fn text(s: &str) -> Text {
    Text::from_slice_unchecked(s.as_bytes())
}

fn io_error(error: exr::error::Error) -> io::Error {
    match error {
        exr::error::Error::Io(cause) => cause,
        other => io::Error::other(other),
    }
}
