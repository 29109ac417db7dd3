//! Flux in 32 bits: three mantissas of nine bits, one exponent of five.

use base::Rgb;

/// The largest value that can be packed.
pub(crate) const MAX: f32 = 65408.0;

/// Packs three non-negative values; the largest is right within 1/1024, all are rounded to nearest. Values above
/// [`MAX`] are clamped, values below 2^-25 become 0.
pub(crate) fn pack(c: Rgb) -> u32 {
    let clamp = |v: f32| if v > 0.0 { v.min(MAX) } else { 0.0 };
    let [r, g, b] = c.to_array().map(clamp);
    let largest = r.max(g).max(b);
    // The exponent of `largest` is that of its bits; a mantissa has nine bits without a hidden one.
    let mut exponent = ((largest.to_bits() >> 23) as i32 - 127).max(-16) + 16;
    if largest / step(exponent) >= 511.5 {
        exponent += 1;
    }
    let mantissa = |v: f32| (v / step(exponent)).round() as u32;
    mantissa(r) | mantissa(g) << 9 | mantissa(b) << 18 | (exponent as u32) << 27
}

/// Unpacks what [`pack`] packed.
#[inline(always)]
pub(crate) fn unpack(code: u32) -> Rgb {
    let step = step((code >> 27) as i32);
    let mantissa = |shift: u32| (code >> shift & 511) as f32 * step;
    Rgb::new(mantissa(0), mantissa(9), mantissa(18))
}

/// The value of the last bit of a mantissa: 2^(exponent - 24).
#[inline(always)]
fn step(exponent: i32) -> f32 {
    f32::from_bits(((exponent + 127 - 24) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Rng, Stream};

    #[test]
    fn rounds_to_nearest_over_the_whole_range() {
        let mut rng = Rng::new(0, Stream::Test, 0);
        for _ in 0..100_000 {
            let size = 2.0_f32.powi((rng.next_f32() * 30.0) as i32 - 15);
            let c = Rgb::new(rng.next_f32(), rng.next_f32(), rng.next_f32()) * size;
            let d = unpack(pack(c)) - c;
            let largest = d.map(f32::abs).max_channel();
            assert!(largest <= c.max_channel() / 1022.0, "{c:?} is off by {largest}");
        }
        for exact in [0.0, 1.0, 255.5, 511.0 / 512.0, MAX] {
            assert_eq!(unpack(pack(Rgb::splat(exact))), Rgb::splat(exact), "{exact}");
        }
        assert_eq!(unpack(pack(Rgb::splat(1e9))), Rgb::splat(MAX));
    }
}
