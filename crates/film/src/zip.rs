//! Blocks of scan lines in the ZIP compression of OpenEXR.
//!
//! The exr crate packs them, too, but at a fixed level of deflate, 4, which takes 3.5 times as long as level 1 and makes
//! files of all layers 5 % smaller: then the file takes longer than the picture.

use std::ops::Range;

use exr::meta::attribute::Compression;
use miniz_oxide::deflate::core::{
    CompressorOxide, TDEFLFlush, compress_to_output, create_comp_flags_from_zip_params,
};

/// What blocks of [`pack`] are called in a header.
pub(crate) const COMPRESSION: Compression = Compression::ZIP16;

/// Rows of a picture that an OpenEXR file packs together, from its first row on.
pub const LINES: usize = 16;

/// The level of deflate, of 10.
const LEVEL: i32 = 1;

/// The largest window of deflate, as a power of 2, with the frame of zlib around.
const ZLIB_WINDOW: i32 = 15;

/// The rows of each block of a picture of this height. The last one may have fewer.
pub(crate) fn blocks(height: usize) -> impl Iterator<Item = Range<usize>> {
    (0..height).step_by(LINES).map(move |y| y..height.min(y + LINES))
}

/// The bytes of a block as they are in the file: scan line by scan line, channel by channel; `channels` holds the
/// rows of each. First the even bytes, then the odd ones, as differences, deflated ("OpenEXR File Layout", 2013, and
/// `ImfZip.cpp` of OpenEXR). What doesn't become smaller stays as it was, as the format has it.
pub(crate) fn pack<T: AsRef<[f32]>>(channels: &[T], width: usize) -> Vec<u8> {
    let n_samples: usize = channels.iter().map(|values| values.as_ref().len()).sum();
    let flags = create_comp_flags_from_zip_params(LEVEL, ZLIB_WINDOW, 0);
    let mut deflater = CompressorOxide::new(flags);
    let mut packed = Vec::with_capacity(4 * n_samples);
    let mut deflate = |bytes: &[u8], flush| {
        // It stops early only where the callback says so.
        compress_to_output(&mut deflater, bytes, flush, |more| {
            packed.extend_from_slice(more);
            true
        });
    };
    // A row of one channel at a time, which no cache is too small for.
    let (mut half, mut last) = (vec![0; 2 * width], None);
    for odd in [0, 1] {
        for row in rows(channels, width) {
            for (half, sample) in half.as_chunks_mut().0.iter_mut().zip(row) {
                let bytes = sample.to_le_bytes();
                *half = [bytes[odd], bytes[2 + odd]];
            }
            last = to_differences(&mut half, last);
            deflate(&half, TDEFLFlush::None);
        }
    }
    deflate(&[], TDEFLFlush::Finish);
    if packed.len() < 4 * n_samples {
        packed.shrink_to_fit();
        return packed;
    }
    rows(channels, width).flatten().flat_map(|sample| sample.to_le_bytes()).collect()
}

/// From bytes to how much more each one is than the one before, and 128; `last` is the one before the first. Returns the
/// last one. From the end, so that the one before is there still, and many at a time.
fn to_differences(bytes: &mut [u8], last: Option<u8>) -> Option<u8> {
    const AT_ONCE: usize = 64;
    let &new_last = bytes.last()?;
    let mut end = bytes.len();
    while end > 1 {
        let start = end.saturating_sub(AT_ONCE).max(1);
        let mut before = [0; AT_ONCE];
        before[..end - start].copy_from_slice(&bytes[start - 1..end - 1]);
        for (byte, before) in bytes[start..end].iter_mut().zip(before) {
            *byte = difference(*byte, before);
        }
        end = start;
    }
    if let Some(last) = last {
        bytes[0] = difference(bytes[0], last);
    }
    Some(new_last)
}

fn difference(byte: u8, before: u8) -> u8 {
    byte.wrapping_sub(before).wrapping_add(128)
}

/// The rows of a block in the order of the file.
fn rows<T: AsRef<[f32]>>(channels: &[T], width: usize) -> impl Iterator<Item = &[f32]> {
    let n_rows = channels.first().map_or(0, |values| values.as_ref().len() / width);
    let row = move |y: usize| y * width..(y + 1) * width;
    (0..n_rows).flat_map(move |y| channels.iter().map(move |values| &values.as_ref()[row(y)]))
}
