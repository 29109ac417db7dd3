//! The one place that knows how metadata becomes bytes: bincode 2, through serde.

use bincode::config::{self, Configuration, Fixint, Limit, LittleEndian};
use bincode::serde::{decode_from_slice, encode_to_vec};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// The longest metadata, in bytes.
pub(crate) const MAX_BYTES: usize = 1 << 28;

/// The bytes of `value`.
///
/// Integers have their full width, so that the length does not depend on their values.
///
/// # Panics
/// When the type of `value` has no form in bincode, such as a sequence of unknown length.
pub(crate) fn encode(value: &impl Serialize) -> Vec<u8> {
    match encode_to_vec(value, config::<MAX_BYTES>()) {
        Ok(bytes) => bytes,
        Err(e) => panic!("metadata must be plain data: {e}"),
    }
}

/// The value at the start of `bytes`, and how many bytes it takes.
pub(crate) fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<(T, usize), String> {
    // Bincode makes room for a string before it looks whether there are as many bytes, up to a limit that has to be a
    // constant. The smallest that suffices keeps memory in proportion to the file.
    match bytes.len() {
        0..=0x1000 => decode_from_slice(bytes, config::<0x1000>()),
        0x1001..=0x1_0000 => decode_from_slice(bytes, config::<0x1_0000>()),
        0x1_0001..=0x10_0000 => decode_from_slice(bytes, config::<0x10_0000>()),
        0x10_0001..=0x100_0000 => decode_from_slice(bytes, config::<0x100_0000>()),
        _ => decode_from_slice(bytes, config::<MAX_BYTES>()),
    }
    .map_err(|e| e.to_string())
}

const fn config<const LIMIT: usize>() -> Configuration<LittleEndian, Fixint, Limit<LIMIT>> {
    config::standard().with_little_endian().with_fixed_int_encoding().with_limit::<LIMIT>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_pinned() {
        let bytes = encode(&(7_u32, "ab", [1.5_f32], Some(true), vec![3_u16]));
        let expected: &[u8] = &[
            7, 0, 0, 0, // u32
            2, 0, 0, 0, 0, 0, 0, 0, b'a', b'b', // length and bytes of a string
            0, 0, 0xc0, 0x3f, // f32
            1, 1, // Some, true
            1, 0, 0, 0, 0, 0, 0, 0, 3, 0, // length and elements of a sequence
        ];
        assert_eq!(bytes, expected);
    }

    #[test]
    fn every_length_up_to_the_limit_comes_back() {
        for len in [0, 0x0ff8, 0x0ff9, 0x1000, 0xfff8, 0x1_0000, 0x10_0000, 0x100_0000] {
            let text = "x".repeat(len);
            let bytes = encode(&text);
            assert_eq!(decode::<String>(&bytes), Ok((text, len + 8)));
        }
    }

    #[test]
    fn hostile_lengths_are_errors() {
        for len in [3_u64, 0x0fff, 0x1001, 1 << 31, 1 << 40, 1 << 62, u64::MAX] {
            let bytes = [&len.to_le_bytes()[..], b"xy"].concat();
            assert!(decode::<String>(&bytes).is_err(), "{len}");
            assert!(decode::<Vec<String>>(&bytes).is_err(), "{len}");
            assert!(decode::<Vec<[u64; 4]>>(&bytes).is_err(), "{len}");
        }
    }
}
