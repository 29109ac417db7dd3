//! Random streams that belong to photons and pixels, never to threads.
//!
//! Every kind of decision draws from a stream of its own. Sharing one generator between emission, scattering and
//! Russian roulette correlates the paths of neighbouring photons (Schregle found it in Radiance, `pmaprand.h`);
//! sharing one between pixels makes pictures depend on the order of work.

use glam::Vec2;
use rand_core::Rng as _;
use rand_pcg::Pcg32;

/// The kinds of decision. The numbers are part of the result: adding one at the end changes no picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Stream {
    /// Where and whereto a photon is emitted.
    Emit = 1,
    /// The direction in which a photon is scattered.
    Scatter = 2,
    /// Whether a photon is scattered or absorbed.
    Roulette = 3,
    /// Which pixels are sampled at low resolution.
    PixelChoice = 4,
    /// Points on emitters for shadow rays.
    Shadow = 5,
    /// Which branch of a specular chain is followed.
    Chain = 6,
    /// Position of a ray inside its pixel.
    Subpixel = 7,
    /// Tests.
    Test = 8,
    /// Pixels held out to measure an error.
    HoldOut = 9,
    /// Rays that verify interpolated visibility.
    Probe = 10,
    /// Directions in which rough surfaces are followed, and points on emitters that they show.
    Lobe = 11,
    /// Where eye rays come through a lens.
    Lens = 12,
    /// Rays that look for what photons are aimed at, and the starts of aimed photons.
    Aim = 13,
    /// Directions of final gathering, and what lies behind them.
    Gather = 14,
}

/// Mixes two 64-bit values into one, by two rounds of the finalizer of `SplitMix64` (Steele et al. 2014).
#[inline]
pub fn hash_u64(a: u64, b: u64) -> u64 {
    let mix = |mut z: u64| {
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    mix(mix(a.wrapping_add(0x9e37_79b9_7f4a_7c15)) ^ b.wrapping_mul(0xd1b5_4a32_d192_ed03))
}

/// A PCG32 generator (O'Neill 2014) that starts at a place known from seed, stream and index alone.
#[derive(Clone, Debug)]
pub struct Rng(Pcg32);

impl Rng {
    /// The generator of photon or pixel `index` for one kind of decision.
    #[inline]
    pub fn new(seed: u64, stream: Stream, index: u64) -> Self {
        let state = hash_u64(hash_u64(seed, stream as u64), index);
        Self(Pcg32::new(state, hash_u64(state, stream as u64)))
    }

    /// 32 uniform bits.
    #[inline]
    pub fn next_u32(&mut self) -> u32 {
        self.0.next_u32()
    }

    /// Uniform in [0, 1), a multiple of 2^-24.
    #[inline]
    pub fn next_f32(&mut self) -> f32 {
        (self.0.next_u32() >> 8) as f32 * (1.0 / 16_777_216.0)
    }

    /// Uniform in the unit square.
    #[inline]
    pub fn next_2d(&mut self) -> Vec2 {
        let x = self.next_f32();
        Vec2::new(x, self.next_f32())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A change of these numbers changes every map and every picture: it must be a decision.
    #[test]
    fn values_are_pinned() {
        let first = |stream| {
            let mut rng = Rng::new(1, stream, 2);
            [rng.next_u32(), rng.next_u32(), rng.next_u32()]
        };
        assert_eq!(first(Stream::Emit), PINNED[0]);
        assert_eq!(first(Stream::Scatter), PINNED[1]);
        assert_eq!(first(Stream::Shadow), PINNED[2]);
        assert_eq!(hash_u64(1, 2), PINNED_HASH);
    }

    const PINNED: [[u32; 3]; 3] = [
        [1000487787, 1048395773, 4195575505],
        [4204067800, 1587257965, 3756044514],
        [2097346968, 315418215, 1569487748],
    ];
    const PINNED_HASH: u64 = 17871621446422167481;

    #[test]
    fn numbers_fill_the_unit_interval_evenly() {
        let mut bins = [0_u32; 64];
        for index in 0..64_000 {
            let x = Rng::new(0, Stream::Test, index).next_f32();
            bins[(x * 64.0) as usize] += 1;
        }
        // Chi-square with 63 degrees of freedom: 99.99 % of samples lie below 113.
        let chi2: f64 = bins.iter().map(|&n| (f64::from(n) - 1000.0).powi(2) / 1000.0).sum();
        assert!(chi2 < 113.0, "first numbers of successive indices are not uniform: {chi2}");
    }
}
