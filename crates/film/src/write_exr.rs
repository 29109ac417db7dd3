//! OpenEXR files: every layer of a picture.

use std::borrow::Borrow;
use std::io;
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

/// Writes `picture` as one part of 32-bit float channels, in ZIP blocks of 16 scan lines. Returns the number of bytes.
///
/// The channels are sorted by name, as the format asks. The same picture gives the same bytes. The metadata goes into
/// the string attribute `tetralux`. What is a part of a picture has that part as its data window, the whole picture as its
/// display window, and a digest of all that it holds beside its metadata: see [`Part`](crate::Part).
///
/// # Errors
/// When a value is NaN or infinite, when there are no pixels, or when the file cannot be written.
pub fn write_exr(path: &Path, existing: Existing, picture: &Picture) -> Result<u64, Error> {
    write_exr_bands(path, existing, picture.window(), iter::once(Ok(picture)))
}

/// Writes what comes in bands of whole rows, from top to bottom, and together fills `window`: the bytes that [`write_exr`]
/// writes of it in one piece. The file is begun when the first band is there. One band is in memory at a time; of a part of a
/// picture, whose digest comes first, all that is packed as well.
///
/// # Errors
/// As [`write_exr`], and the first that a band comes with.
///
/// # Panics
/// When a band isn't the one that follows, begins within a block of 16 rows, or has other channels than the first.
pub fn write_exr_bands<P: Borrow<Picture>, E: From<Error>>(
    path: &Path,
    existing: Existing,
    window: Window,
    bands: impl IntoIterator<Item = Result<P, E>>,
) -> Result<u64, E> {
    if window.size.n_pixels() == 0 {
        return Err(Error::NoPixels { path: path.into() }.into());
    }
    let [left, right, top, bottom] = window.bounds();
    let mut y = top;
    let mut packed = bands.into_iter().map(|band: Result<P, E>| {
        let band = band?;
        let picture = band.borrow();
        let bounds = picture.window().bounds();
        let follows =
            bounds[..3] == [left, right, y] && (y - top).is_multiple_of(zip::LINES as u32);
        assert!(follows && bounds[3] <= bottom, "{bounds:?} follows row {y} of {window:?}");
        y = bounds[3];
        let names = sorted(picture).into_iter().map(|(name, _)| name.to_owned());
        let names: Vec<String> = names.collect();
        Ok((pack(path, picture)?, names, picture.metadata().to_owned()))
    });
    let first: Option<Result<_, E>> = packed.next();
    let (first, names, metadata) = first.expect("a window of pixels has a band")?;
    let list = || names.iter().map(String::as_str);
    let mut bands = iter::once(Ok(first)).chain(packed.map(|band: Result<_, E>| {
        let (blocks, others, _) = band?;
        assert_eq!(others, names, "every band has all channels");
        Ok(blocks)
    }));
    if window.is_whole() {
        return write_blocks(path, existing, header(window, &metadata, list()), bands);
    }
    // The digest is of the packed blocks, and lies before them.
    let blocks: Vec<Vec<u8>> = bands.try_fold(Vec::new(), |mut all, band| {
        all.extend(band?);
        Ok::<_, E>(all)
    })?;
    let mut digest = PartDigest::new(window, &metadata, list());
    blocks.iter().for_each(|block| digest.block(block));
    let header = header(window, &part::seal(digest, &metadata), list());
    write_blocks(path, existing, header, iter::once(Ok(blocks)))
}

/// The channels of a picture by name.
fn sorted(picture: &Picture) -> Vec<(&str, &[f32])> {
    let mut channels: Vec<_> = picture.channels().collect();
    channels.sort_by_key(|(name, _)| *name);
    channels
}

/// All blocks of a picture, packed.
fn pack(path: &Path, picture: &Picture) -> Result<Vec<Vec<u8>>, Error> {
    let Window { size, .. } = picture.window();
    for (channel, values) in picture.channels() {
        if let Some(index) = values.iter().position(|v| !v.is_finite()) {
            return Err(Error::NotFinite {
                path: path.into(),
                channel: channel.into(),
                pixel: picture.window().in_whole(size.pixel(index)),
                value: values[index],
            });
        }
    }
    let channels = sorted(picture);
    let width = size.width as usize;
    let blocks: Vec<Range<usize>> = zip::blocks(size.height as usize).collect();
    let pack = |rows: &Range<usize>| {
        let pixels = rows.start * width..rows.end * width;
        let channels: Vec<_> = channels.iter().map(|(_, v)| &v[pixels.clone()]).collect();
        zip::pack(&channels, width)
    };
    Ok(blocks.par_iter().map(pack).collect())
}

/// The blocks of a picture, by the rows that they hold, as many at a time as should be packed at once.
pub(crate) fn blocks_at_once(header: &Header) -> Vec<Vec<Range<usize>>> {
    let (width, height) = (header.layer_size.width(), header.layer_size.height());
    let block_bytes = header.channels.bytes_per_pixel * width * zip::LINES;
    let n = (BYTES_AT_ONCE / block_bytes.max(1)).clamp(1, BLOCKS_AT_ONCE);
    let blocks: Vec<Range<usize>> = zip::blocks(height).collect();
    blocks.chunks(n).map(<[_]>::to_vec).collect()
}

/// Writes a picture whose packed blocks come in order, some at a time.
///
/// # Panics
/// When not all blocks come.
pub(crate) fn write_blocks<E: From<Error>>(
    path: &Path,
    existing: Existing,
    header: Header,
    blocks: impl Iterator<Item = Result<Vec<Vec<u8>>, E>>,
) -> Result<u64, E> {
    let top = header.own_attributes.layer_position.y();
    let n_blocks = zip::blocks(header.layer_size.height()).count();
    let mut failure = None;
    let written = atomic_file::write(path, existing, |out| {
        exr::block::write(out, [header].into_iter().collect(), true, |_, writer| {
            let mut n = 0;
            for some in blocks {
                let some = some.map_err(|error| {
                    failure = Some(error);
                    exr::error::Error::Io(io::Error::other("there is no more of the picture"))
                })?;
                for bytes in some {
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
        .map_err(io_error)
    });
    match failure {
        Some(error) => Err(error),
        None => written.map_err(|error| Error::from(error).into()),
    }
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
