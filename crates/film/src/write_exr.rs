//! OpenEXR files: every layer of a picture.

use std::io;
use std::path::Path;

use atomic_file::Existing;
use exr::block::UncompressedBlock;
use exr::block::chunk::Chunk;
use exr::block::writer::ChunksWriter;
use exr::meta::BlockDescription;
use exr::meta::attribute::{
    AttributeValue, ChannelDescription, Compression, LineOrder, SampleType, Text,
};
use exr::meta::header::{Header, LayerAttributes};
use rayon::prelude::*;

use crate::{Error, Picture};

/// The attribute that holds the metadata of a picture.
///
/// It is the only one outside the standard: the exr crate keeps those in a hash map, and two would come out in either order.
pub(crate) const METADATA_ATTRIBUTE: &str = "tetralux";

/// Blocks of 16 lines that are compressed at once: bounds the memory, leaves work for every thread.
const BLOCKS_AT_ONCE: usize = 32;

/// Writes `picture` as one part of 32-bit float channels, in ZIP blocks of 16 scan lines. Returns the number of bytes.
///
/// The channels are sorted by name, as the format asks. The same picture gives the same bytes. The metadata goes into
/// the string attribute `tetralux`.
///
/// # Errors
/// When a value is NaN or infinite, when there are no pixels, or when the file cannot be written.
pub fn write_exr(path: &Path, existing: Existing, picture: &Picture) -> Result<u64, Error> {
    let size = picture.size();
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
    let values: Vec<&[f32]> = channels.iter().map(|(_, values)| *values).collect();
    let header = header(picture, channels.iter().map(|(name, _)| *name));
    let width = size.width as usize;
    Ok(atomic_file::write(path, existing, |out| {
        exr::block::write(out, [header].into_iter().collect(), true, |meta, writer| {
            let blocks: Vec<_> = meta.enumerate_ordered_header_block_indices().collect();
            for blocks in blocks.chunks(BLOCKS_AT_ONCE) {
                let compress = |&(index, block)| -> exr::error::Result<(usize, Chunk)> {
                    let channels = &meta.headers[0].channels;
                    let block = UncompressedBlock::from_lines(channels, block, |line| {
                        let start = line.location.position.y() * width;
                        let samples = &values[line.location.channel][start..start + width];
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
    })?)
}

fn header<'a>(picture: &Picture, names: impl Iterator<Item = &'a str>) -> Header {
    let size = picture.size();
    let mut attributes = LayerAttributes {
        software_name: Some(text(concat!("Tetralux ", env!("CARGO_PKG_VERSION")))),
        ..LayerAttributes::default()
    };
    if !picture.metadata().is_empty() {
        let value = AttributeValue::Text(text(picture.metadata()));
        attributes.other.insert(text(METADATA_ATTRIBUTE), value);
    }
    let channels = names.map(|name| ChannelDescription {
        name: text(name),
        sample_type: SampleType::F32,
        quantize_linearly: false,
        sampling: (1, 1).into(),
    });
    Header::new(Text::default(), (size.width as usize, size.height as usize), channels.collect())
        .with_encoding(Compression::ZIP16, BlockDescription::ScanLines, LineOrder::Increasing)
        .with_attributes(attributes)
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
