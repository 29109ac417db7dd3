//! Flux in 32 bits: three mantissas of nine bits, one exponent of five.

use base::{Rgb, hash_u64};

/// Makes the chances of [`pack`] differ from all others that start from an index.
const ROUNDING: u64 = 0x666c_7578;

/// The largest value that can be packed.
pub(crate) const MAX: f32 = 65408.0;

/// Packs three non-negative values. Each is rounded up or down by chance, with the odds that keep its mean: photons often
/// carry one of few values, whose rounding errors would add up otherwise. `index` is the chance.
///
/// The error is below 1/255 of the largest value, or 2^-24. Values above [`MAX`] are clamped.
pub(crate) fn pack(c: Rgb, index: u64) -> u32 {
    let clamp = |v: f32| if v > 0.0 { v.min(MAX) } else { 0.0 };
    let c = c.map(clamp);
    let largest = c.max_channel();
    // The exponent of `largest` is that of its bits; a mantissa has nine bits without a hidden one.
    let mut exponent = ((largest.to_bits() >> 23) as i32 - 127).max(-16) + 16;
    if largest / step(exponent) > 511.0 {
        exponent += 1;
    }
    let chance = hash_u64(index, ROUNDING);
    let mantissa = |v: f32, shift: u32| {
        let steps = v / step(exponent);
        let u = (chance >> shift & 0x1f_ffff) as f32 * (1.0 / 2_097_152.0);
        let whole = steps as u32;
        whole + u32::from(u < steps - whole as f32)
    };
    mantissa(c.r, 0) | mantissa(c.g, 21) << 9 | mantissa(c.b, 42) << 18 | (exponent as u32) << 27
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
    fn errors_are_below_a_step_over_the_whole_range() {
        let mut rng = Rng::new(0, Stream::Test, 0);
        for i in 0..100_000 {
            let size = 2.0_f32.powi((rng.next_f32() * 30.0) as i32 - 15);
            let c = Rgb::new(rng.next_f32(), rng.next_f32(), rng.next_f32()) * size;
            let d = unpack(pack(c, i)) - c;
            let largest = d.map(f32::abs).max_channel();
            let step = (c.max_channel() / 255.5).max(2.0_f32.powi(-24));
            assert!(largest <= step, "{c:?} is off by {largest}");
        }
    }

    #[test]
    fn whole_steps_are_exact() {
        for exact in [0.0, 1.0, 255.5, 511.0 / 512.0, MAX] {
            for i in 0..1000 {
                assert_eq!(unpack(pack(Rgb::splat(exact), i)), Rgb::splat(exact), "{exact}");
            }
        }
        assert_eq!(unpack(pack(Rgb::splat(1e9), 0)), Rgb::splat(MAX));
        assert_eq!(unpack(pack(Rgb::new(-1.0, f32::NAN, 0.0), 0)), Rgb::BLACK);
    }

    #[test]
    fn the_mean_is_kept_in_every_channel() {
        let n = 100_000_u32;
        // Just below the change of an exponent, in the middle, below the smallest step.
        for c in [[511.7, 0.3, 3e-5], [300.4, 299.9, 11.11], [0.02, 0.9, 0.9], [2e-8, 5e-8, 0.0]] {
            let (mut sum, mut largest) = ([0.0_f64; 3], 0.0_f32);
            for i in 0..n {
                let stored = unpack(pack(c.into(), i.into())).to_array();
                (0..3).for_each(|j| sum[j] += f64::from(stored[j]));
                largest = stored.into_iter().fold(largest, f32::max);
            }
            for j in 0..3 {
                // A step is at most 1/255 of the largest value, or 2^-24; rounding to one of two spreads by half of it.
                let step = (f64::from(largest) / 255.0).max(2.0_f64.powi(-24));
                let sigma = 0.5 * step / f64::from(n).sqrt();
                let mean = sum[j] / f64::from(n);
                let off = (mean - f64::from(c[j])).abs();
                assert!(off < 4.5 * sigma, "channel {j} of {c:?} became {mean}");
            }
        }
    }
}
