//! Eight photons at once.
//!
//! Measured with `cargo bench -p pipeline-tests --bench micro -- gather`. The only unsafe code here is to call what was
//! compiled for a processor that has these instructions.
#![expect(unsafe_code, reason = "instructions that only some processors have")]

use std::arch::x86_64::{
    __m256i, _CMP_LE_OQ, _MM_HINT_T0, _mm_cvtsi64_si128, _mm_movemask_epi8, _mm_packs_epi16,
    _mm_prefetch, _mm256_castsi256_si128, _mm256_cmp_ps, _mm256_cmpeq_epi16, _mm256_cvtepu8_epi32,
    _mm256_extracti128_si256, _mm256_movemask_ps, _mm256_permutevar8x32_epi32, _mm256_set1_epi16,
    _mm256_set1_ps,
};

use super::{Counted, Surface};
use crate::set::{LEAF, Leaf, LeafBox};

#[inline]
pub(super) fn is_available() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("popcnt")
}

/// Asks for the cache lines of a leaf.
#[inline(always)]
pub(super) fn prefetch(leaf: &Leaf) {
    for line in bytemuck::bytes_of(leaf).chunks(64) {
        // SAFETY: every processor of this kind has the instruction, and it changes no memory and never fails.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(line.as_ptr().cast()) };
    }
}

#[inline]
pub(super) fn count(
    surface: &mut Surface,
    photons: (&LeafBox, &Leaf),
    n: usize,
    bound2: f32,
    counted: &mut Counted,
) {
    debug_assert!(is_available());
    // SAFETY: callers have asked `is_available`.
    unsafe { count_wide(surface, photons, n, bound2, counted) }
}

#[target_feature(enable = "avx2,bmi1,popcnt")]
fn count_wide(
    surface: &mut Surface,
    (around, leaf): (&LeafBox, &Leaf),
    n: usize,
    bound2: f32,
    counted: &mut Counted,
) {
    let dist2 = around.distances(leaf, surface.point, surface.normal, surface.height2);
    let bound2 = _mm256_set1_ps(bound2);
    let (dist2_by_8, _) = dist2.as_chunks::<8>();
    let mut near = 0;
    for (i, eight) in dist2_by_8.iter().enumerate() {
        let is_near = _mm256_cmp_ps::<_CMP_LE_OQ>(bytemuck::cast(*eight), bound2);
        near |= (_mm256_movemask_ps(is_near) as u32) << (8 * i);
    }
    near &= u32::MAX >> (LEAF - n);

    // A normal is looked at once, with all photons that share it.
    let mut lanes = 0;
    while near != 0 {
        let code = leaf.normals[near.trailing_zeros() as usize % LEAF];
        let same = having(&leaf.normals, code);
        lanes |= if surface.is_facing(code) { near & same } else { 0 };
        near &= !same;
    }

    let (flux_by_8, _) = leaf.flux.as_chunks::<8>();
    let mut n = 0;
    for (i, (dist2, flux)) in dist2_by_8.iter().zip(flux_by_8).enumerate() {
        let eight = (lanes >> (8 * i)) as u8;
        let order = order(eight);
        let room = n..n + 8;
        let packed = _mm256_permutevar8x32_epi32(bytemuck::cast(*dist2), order);
        counted.dist2[room.clone()].copy_from_slice(&bytemuck::cast::<_, [f32; 8]>(packed));
        let packed = _mm256_permutevar8x32_epi32(bytemuck::cast(*flux), order);
        counted.flux[room].copy_from_slice(&bytemuck::cast::<_, [u32; 8]>(packed));
        n += eight.count_ones() as usize;
    }
    (counted.n, counted.lanes) = (n, lanes);
}

/// A bit for each of the codes that is this one.
#[inline]
#[target_feature(enable = "avx2")]
fn having(codes: &[u16; LEAF], code: u16) -> u32 {
    let (by_16, _) = codes.as_chunks::<16>();
    let code = _mm256_set1_epi16(code as i16);
    let half = |i: usize| {
        let is_same = _mm256_cmpeq_epi16(bytemuck::cast(by_16[i]), code);
        let low = _mm256_castsi256_si128(is_same);
        let bytes = _mm_packs_epi16(low, _mm256_extracti128_si256::<1>(is_same));
        _mm_movemask_epi8(bytes) as u32
    };
    half(0) | half(1) << 16
}

/// The places of the bits that are set, from the lowest.
#[inline]
#[target_feature(enable = "avx2")]
fn order(bits: u8) -> __m256i {
    _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(ORDERS[usize::from(bits)] as i64))
}

/// For each set of bits, a byte for each of them.
static ORDERS: [u64; 256] = {
    let mut orders = [0; 256];
    let mut bits = 0;
    while bits < 256 {
        let (mut place, mut n) = (0, 0);
        while place < 8 {
            if bits >> place & 1 == 1 {
                orders[bits] |= place << (8 * n);
                n += 1;
            }
            place += 1;
        }
        bits += 1;
    }
    orders
};

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Rng, Stream, encode_octahedral};
    use bytemuck::Zeroable;
    use glam::Vec3A;

    #[test]
    fn eight_at_once_are_eight_one_by_one() {
        if !is_available() {
            return;
        }
        let mut rng = Rng::new(0, Stream::Test, 0);
        let mut n_counted = 0;
        for i in 0..20_000 {
            let mut dir = || {
                let mut coordinate = || rng.next_f32() - 0.5;
                Vec3A::new(coordinate(), coordinate(), coordinate()).normalize()
            };
            let normals = [Vec3A::Z, dir(), Vec3A::Z].map(encode_octahedral);
            let around = LeafBox { min: [-0.3, 0.2, 0.0], step: [1e-5, 2e-5, 1e-7] };
            let mut leaf = Leaf::zeroed();
            for lane in 0..LEAF {
                (0..3).for_each(|axis| leaf.positions[axis][lane] = rng.next_u32() as u16);
                leaf.normals[lane] = normals[rng.next_u32() as usize % (1 + i % 3)];
                leaf.flux[lane] = rng.next_u32();
            }
            let point = Vec3A::new(rng.next_f32() - 0.5, rng.next_f32(), 0.01 * rng.next_f32());
            let n = 1 + rng.next_u32() as usize % LEAF;
            // Some photon lies exactly at the bound.
            let any = rng.next_u32() as usize % LEAF;
            let bound2 = around.distances(&leaf, point, Vec3A::ZERO, f32::INFINITY)[any];
            // Some lie too high, or not.
            let height = [f32::INFINITY, 0.003][i % 2];
            let [mut narrow, mut wide] = [Counted::new(), Counted::new()];
            let mut surface = Surface::new(point, Vec3A::Z, height);
            surface.count_one_by_one((&around, &leaf), n, bound2, &mut narrow);
            let mut surface = Surface::new(point, Vec3A::Z, height);
            count(&mut surface, (&around, &leaf), n, bound2, &mut wide);
            assert_eq!((wide.dist2(), wide.flux()), (narrow.dist2(), narrow.flux()), "{i}");
            assert_eq!(wide.lanes, narrow.lanes, "{i}");
            assert_eq!(wide.lanes().count(), wide.n, "{i}");
            n_counted += wide.n;
        }
        assert!(n_counted > 50_000, "{n_counted}");
    }
}
