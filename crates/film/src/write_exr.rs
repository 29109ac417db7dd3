//! OpenEXR files: every layer of a picture.

use std::io;
use std::ops::Range;
use std::path::Path;

use atomic_file::Existing;
use base::Window;
use exr::block::UncompressedBlock;
use exr::block::chunk::Chunk;
use exr::block::writer::ChunksWriter;
use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::{
    AttributeValue, ChannelDescription, Compression, IntegerBounds, LineOrder, SampleType, Text,
};
use exr::meta::header::{Header, LayerAttributes};
use rayon::prelude::*;

use crate::part::{self, PartDigest};
use crate::{Error, Picture};

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
/// display window, and a digest of all that it holds beside its metadata: see [`Part`](crate::Part). It isn't compressed: that
/// takes longer than a tile's pixels do in mode adaptive, and is done once, when parts are joined.
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
    let values: Vec<&[f32]> = channels.iter().map(|(_, values)| *values).collect();
    let width = size.width as usize;
    let rows = |rows: Range<usize>| -> Vec<&[f32]> {
        values.iter().map(|v| &v[rows.start * width..rows.end * width]).collect()
    };
    let metadata = if window.is_whole() {
        picture.metadata().to_owned()
    } else {
        let mut digest = PartDigest::new(window, picture.metadata(), names.clone());
        (0..size.height as usize).for_each(|y| digest.row(&rows(y..y + 1)));
        part::seal(digest, picture.metadata())
    };
    let header = header(window, &metadata, names);
    write_rows(path, existing, header, |range| Ok(rows(range)))
}

/// Writes a picture whose rows are asked for in order: the values of each channel, in the order of the header.
pub(crate) fn write_rows<T: AsRef<[f32]> + Sync>(
    path: &Path,
    existing: Existing,
    header: Header,
    mut rows: impl FnMut(Range<usize>) -> Result<Vec<T>, Error>,
) -> Result<u64, Error> {
    let (width, height) = (header.layer_size.width(), header.layer_size.height());
    let lines = header.compression.scan_lines_per_block();
    let block_bytes = header.channels.bytes_per_pixel * width * lines;
    let blocks_at_once = (BYTES_AT_ONCE / block_bytes.max(1)).clamp(1, BLOCKS_AT_ONCE);
    let mut failure = None;
    let written = atomic_file::write(path, existing, |out| {
        exr::block::write(out, [header].into_iter().collect(), true, |meta, writer| {
            let blocks: Vec<_> = meta.enumerate_ordered_header_block_indices().collect();
            for (i, blocks) in blocks.chunks(blocks_at_once).enumerate() {
                let first = i * blocks_at_once * lines;
                let last = (first + blocks.len() * lines).min(height);
                let values = rows(first..last).map_err(|error| {
                    let message = error.to_string();
                    failure = Some(error);
                    exr::error::Error::Io(io::Error::other(message))
                })?;
                let compress = |&(index, block)| -> exr::error::Result<(usize, Chunk)> {
                    let channels = &meta.headers[0].channels;
                    let block = UncompressedBlock::from_lines(channels, block, |line| {
                        let start = (line.location.position.y() - first) * width;
                        let samples = &values[line.location.channel].as_ref()[start..start + width];
                        line.value.copy_from_slice(bytemuck::cast_slice(samples));
                    });
                    Ok((index, block.compress_to_chunk(&meta.headers)?))
                };
                let compressed: Vec<_> = blocks.par_iter().map(compress).collect();
                for chunk in compressed {
                    let (index, chunk) = chunk?;
                    writer.write_chunk(index, chunk)?;
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
    let compression =
        if window.is_whole() { Compression::ZIP16 } else { Compression::Uncompressed };
    let display = IntegerBounds::from_dimensions((whole.width as usize, whole.height as usize));
    Header::new(Text::default(), (size.width as usize, size.height as usize), channels.collect())
        .with_encoding(compression, BlockDescription::ScanLines, LineOrder::Increasing)
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
