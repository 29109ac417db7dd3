//! OpenEXR files: every layer of a picture.

use std::io;
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
    let window = picture.window();
    let size = window.size;
    if size.n_pixels() == 0 {
        return Err(Error::NoPixels { path: path.into() });
    }
    for (channel, values) in picture.channels() {
        if let Some(index) = values.iter().position(|v| !v.is_finite()) {
            return Err(Error::NotFinite {
                path: path.into(),
                channel: channel.into(),
                pixel: size.pixel(index),
                value: values[index],
            });
        }
    }

    let mut channels: Vec<(&str, &[f32])> = picture.channels().collect();
    channels.sort_by_key(|(name, _)| *name);
    let names = channels.iter().map(|(name, _)| *name);
    let width = size.width as usize;
    let pack = |rows: &Range<usize>| {
        let part = rows.start * width..rows.end * width;
        let values: Vec<&[f32]> = channels.iter().map(|(_, v)| &v[part.clone()]).collect();
        zip::pack(&values, width)
    };
    if window.is_whole() {
        let header = header(window, picture.metadata(), names);
        return write_blocks(path, existing, header, |blocks| {
            Ok(blocks.par_iter().map(pack).collect())
        });
    }
    // The digest is of the packed blocks, and lies before them.
    let blocks: Vec<Range<usize>> = zip::blocks(size.height as usize).collect();
    let packed: Vec<Vec<u8>> = blocks.par_iter().map(pack).collect();
    let mut digest = PartDigest::new(window, picture.metadata(), names.clone());
    packed.iter().for_each(|block| digest.block(block));
    let header = header(window, &part::seal(digest, picture.metadata()), names);
    let mut packed = packed.into_iter();
    write_blocks(path, existing, header, |blocks| Ok(packed.by_ref().take(blocks.len()).collect()))
}

/// Writes a picture whose packed blocks are asked for in order, some at a time, by the rows that they hold.
pub(crate) fn write_blocks(
    path: &Path,
    existing: Existing,
    header: Header,
    mut pack: impl FnMut(&[Range<usize>]) -> Result<Vec<Vec<u8>>, Error>,
) -> Result<u64, Error> {
    let (width, height) = (header.layer_size.width(), header.layer_size.height());
    let block_bytes = header.channels.bytes_per_pixel * width * zip::LINES;
    let blocks_at_once = (BYTES_AT_ONCE / block_bytes.max(1)).clamp(1, BLOCKS_AT_ONCE);
    let top = header.own_attributes.layer_position.y();
    let blocks: Vec<Range<usize>> = zip::blocks(height).collect();
    let mut failure = None;
    let written = atomic_file::write(path, existing, |out| {
        exr::block::write(out, [header].into_iter().collect(), true, |_, writer| {
            for (i, blocks) in blocks.chunks(blocks_at_once).enumerate() {
                let packed = pack(blocks).map_err(|error| {
                    let message = error.to_string();
                    failure = Some(error);
                    exr::error::Error::Io(io::Error::other(message))
                })?;
                for (k, (rows, bytes)) in blocks.iter().zip(packed).enumerate() {
                    let block = CompressedScanLineBlock {
                        y_coordinate: top + rows.start as i32,
                        compressed_pixels_le: bytes,
                    };
                    let chunk = Chunk {
                        layer_index: 0,
                        compressed_block: CompressedBlock::ScanLine(block),
                    };
                    writer.write_chunk(i * blocks_at_once + k, chunk)?;
                }
            }
            Ok(())
        })
        .map_err(io_error)
    });
    match failure {
        Some(error) => Err(error),
        None => Ok(written?),
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
