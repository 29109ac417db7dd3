//! The curve between linear light and the values screens are sent (IEC 61966-2-1).

use std::array;

use base::math::pow;

/// The factor of an exposure in stops.
pub(crate) fn exposure_factor(stops: f32) -> f32 {
    pow(2.0, stops)
}

/// `v` brought into [0, 1]. NaN, which too strong an exposure can make of black, becomes 0.
#[inline]
#[expect(clippy::manual_clamp, reason = "f32::clamp lets NaN through")]
pub(crate) fn clamp(v: f32) -> f32 {
    v.max(0.0).min(1.0)
}

/// The sRGB value of linear light, both in [0, 1].
#[inline]
pub(crate) fn encode(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * pow(linear, 1.0 / 2.4) - 0.055 }
}

/// The linear light of an sRGB value, both in [0, 1] (IEC 61966-2-1).
#[inline]
pub fn decode(srgb: f32) -> f32 {
    if srgb <= 0.04045 { srgb / 12.92 } else { pow((srgb + 0.055) / 1.055, 2.4) }
}

/// The nearest 8-bit sRGB value of linear light, clamped.
#[inline]
pub(crate) fn to_byte(linear: f32) -> u8 {
    (encode(clamp(linear)) * 255.0 + 0.5) as u8
}

/// [`to_byte`] as a table, without its power, which takes thirty times as long.
///
/// The curve rises, so that a byte is known by the least light that has it.
pub(crate) struct Bytes {
    /// By byte.
    least: [f32; 256],
    /// By the leading bits of the light, the byte of the least light with these bits.
    first: Box<[u8]>,
}

/// Bits of light that tell apart too little to matter for where a search begins: 7 bits of the fraction remain.
const TRAILING: u32 = 16;

impl Bytes {
    pub(crate) fn new() -> Self {
        let first = (0..=1.0_f32.to_bits() >> TRAILING)
            .map(|leading| to_byte(f32::from_bits(leading << TRAILING)))
            .collect();
        let least = array::from_fn(|byte| {
            // Bits of numbers from 0 to 1 are in the order of the numbers.
            let (mut below, mut at) = (0, 1.0_f32.to_bits());
            while below < at {
                let middle = (below + at) / 2;
                match usize::from(to_byte(f32::from_bits(middle))) < byte {
                    true => below = middle + 1,
                    false => at = middle,
                }
            }
            f32::from_bits(at)
        });
        Self { least, first }
    }

    /// The nearest 8-bit sRGB value of linear light, clamped.
    #[inline]
    pub(crate) fn of(&self, linear: f32) -> u8 {
        let linear = clamp(linear).abs();
        let mut byte = self.first[(linear.to_bits() >> TRAILING) as usize];
        while byte < 255 && linear >= self.least[usize::from(byte) + 1] {
            byte += 1;
        }
        byte
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_comes_back() {
        for byte in 0..=255 {
            assert_eq!(to_byte(decode(f32::from(byte) / 255.0)), byte);
        }
    }

    #[test]
    fn known_values() {
        // 18 % gray and the ends of the scale, as every table of sRGB has them.
        let bytes = Bytes::new();
        assert_eq!([0.0, 0.18, 0.5, 1.0].map(|v| bytes.of(v)), [0, 118, 188, 255]);
        let outside = [-1.0, -0.0, 7.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN];
        assert_eq!(outside.map(|v| bytes.of(v)), [0, 0, 255, 255, 0, 0]);
        assert_eq!([-2.0, 0.0, 10.0].map(exposure_factor), [0.25, 1.0, 1024.0]);
    }

    /// All numbers of `[0, 1]` were compared once; here those about the steps, and some between.
    #[test]
    fn the_table_is_the_curve() {
        let bytes = Bytes::new();
        let about_steps = bytes.least.iter().flat_map(|least| {
            let at = least.to_bits();
            at.saturating_sub(50)..(at + 50).min(1.0_f32.to_bits())
        });
        for bits in about_steps.chain((0..=1.0_f32.to_bits()).step_by(9973)) {
            let v = f32::from_bits(bits);
            assert_eq!(bytes.of(v), to_byte(v), "{v}");
        }
    }
}
