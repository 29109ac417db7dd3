//! Images in the format of RADIANCE: four bytes a texel, of which the last is an exponent that three colors share.

use base::{Rgb, math};
use glam::Vec3A;

/// Places within a texel that are averaged, along each side.
const SAMPLES: usize = 4;

/// An image of all directions, y up, of so many columns and rows: -z is at the sides, +z in the middle, +x between them in
/// the left half.
pub(super) fn encode(width: usize, height: usize, radiance: fn(Vec3A) -> Rgb) -> Vec<u8> {
    let mut bytes =
        format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    let place = |i: usize, k: usize| i as f32 + (k as f32 + 0.5) / SAMPLES as f32;
    for row in 0..height {
        for column in 0..width {
            let mut sum = Rgb::BLACK;
            for k in 0..SAMPLES * SAMPLES {
                let u = place(column, k % SAMPLES) / width as f32;
                let v = place(row, k / SAMPLES) / height as f32;
                let (sin_u, cos_u) = math::sin_cos(2.0 * math::PI * u);
                let (sin_v, cos_v) = math::sin_cos(math::PI * v);
                sum += radiance(Vec3A::new(sin_v * sin_u, cos_v, -sin_v * cos_u));
            }
            bytes.extend(texel(sum * (1.0 / (SAMPLES * SAMPLES) as f32)));
        }
    }
    bytes
}

/// A color, rounded down to a 128th of its largest channel or finer.
fn texel(color: Rgb) -> [u8; 4] {
    let largest = color.max_channel();
    if largest < 1e-30 {
        return [0; 4];
    }
    // The power of two above the largest channel, found in its bits.
    let exponent = (largest.to_bits() >> 23) as i32 - 126;
    let scale = f32::from_bits(((127 + 8 - exponent) as u32) << 23);
    let [r, g, b] = color.to_array().map(|c| (c * scale) as u8);
    [r, g, b, (exponent + 128) as u8]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_hold_their_colors() {
        for color in [[1.0, 0.5, 0.25], [0.999, 0.0, 0.3], [1200.0, 900.0, 3.0], [3e-5, 1e-5, 0.0]]
        {
            let [r, g, b, e] = texel(Rgb::from(color));
            let unit = (f64::from(e) - 136.0).exp2();
            for (wanted, found) in color.into_iter().zip([r, g, b]) {
                let off = f64::from(wanted) - f64::from(found) * unit;
                let largest = f64::from(color.into_iter().fold(0.0, f32::max));
                assert!((0.0..largest / 128.0).contains(&off), "{color:?}: {off}");
            }
        }
        assert_eq!(texel(Rgb::BLACK), [0; 4]);
    }
}
