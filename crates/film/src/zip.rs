//! Blocks of scan lines in the ZIP compression of OpenEXR.
//!
//! The exr crate packs them, too, but at a fixed level of deflate, 4, which takes 3.5 times as long as level 1 and makes
//! files of all layers 5 % smaller: then the file takes longer than the picture.

use std::ops::Range;

use exr::meta::attribute::Compression;

/// What blocks of [`pack`] are called in a header.
pub(crate) const COMPRESSION: Compression = Compression::ZIP16;

/// Rows of a picture that an OpenEXR file packs together, from its first row on.
pub const LINES: usize = 16;

/// The level of deflate, of 10.
const LEVEL: u8 = 1;

/// The rows of each block of a picture of this height. The last one may have fewer.
pub(crate) fn blocks(height: usize) -> impl Iterator<Item = Range<usize>> {
    (0..height).step_by(LINES).map(move |y| y..height.min(y + LINES))
}

/// The bytes of a block as they are in the file: scan line by scan line, channel by channel; `channels` holds the
/// rows of each. First the even bytes, then the odd ones, as differences, deflated ("OpenEXR File Layout", 2013, and
/// `ImfZip.cpp` of OpenEXR). What doesn't become smaller stays as it was, as the format has it.
pub(crate) fn pack<T: AsRef<[f32]>>(channels: &[T], width: usize) -> Vec<u8> {
    let n_samples: usize = channels.iter().map(|values| values.as_ref().len()).sum();
    let mut bytes = vec![0; 4 * n_samples];
    let (mut even, mut odd) = bytes.split_at_mut(2 * n_samples);
    for row in rows(channels, width) {
        let (even_row, odd_row);
        (even_row, even) = even.split_at_mut(2 * row.len());
        (odd_row, odd) = odd.split_at_mut(2 * row.len());
        let halves = even_row.as_chunks_mut().0.iter_mut().zip(odd_row.as_chunks_mut().0);
        for (sample, (even, odd)) in row.iter().zip(halves) {
            let [a, b, c, d] = sample.to_le_bytes();
            (*even, *odd) = ([a, c], [b, d]);
        }
    }
    to_differences(&mut bytes);
    let packed = miniz_oxide::deflate::compress_to_vec_zlib(&bytes, LEVEL);
    if packed.len() < bytes.len() {
        return packed;
    }
    rows(channels, width).flatten().flat_map(|sample| sample.to_le_bytes()).collect()
}

/// From bytes to how much more each one is than the one before, and 128: from the end, so that the one before is there
/// still, and many at a time.
fn to_differences(bytes: &mut [u8]) {
    const AT_ONCE: usize = 64;
    let mut end = bytes.len();
    while end > 1 {
        let start = end.saturating_sub(AT_ONCE).max(1);
        let mut before = [0; AT_ONCE];
        before[..end - start].copy_from_slice(&bytes[start - 1..end - 1]);
        for (byte, before) in bytes[start..end].iter_mut().zip(before) {
            *byte = byte.wrapping_sub(before).wrapping_add(128);
        }
        end = start;
    }
}

/// The rows of a block in the order of the file.
fn rows<T: AsRef<[f32]>>(channels: &[T], width: usize) -> impl Iterator<Item = &[f32]> {
    let n_rows = channels.first().map_or(0, |values| values.as_ref().len() / width);
    let row = move |y: usize| y * width..(y + 1) * width;
    (0..n_rows).flat_map(move |y| channels.iter().map(move |values| &values.as_ref()[row(y)]))
}
