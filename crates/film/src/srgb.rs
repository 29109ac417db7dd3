//! The curve between linear light and the values screens are sent (IEC 61966-2-1).

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
        assert_eq!([0.0, 0.18, 0.5, 1.0].map(to_byte), [0, 118, 188, 255]);
        assert_eq!([-1.0, 7.0, f32::INFINITY, f32::NAN].map(to_byte), [0, 255, 255, 0]);
        assert_eq!([-2.0, 0.0, 10.0].map(exposure_factor), [0.25, 1.0, 1024.0]);
    }
}
