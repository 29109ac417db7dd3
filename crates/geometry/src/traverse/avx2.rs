//! Eight boxes at once.
//!
//! Measured with `cargo bench -p pipeline-tests --bench rays`. The only unsafe code here is to call what was compiled for a
//! processor that has these instructions.
#![expect(unsafe_code, reason = "instructions that only some processors have")]

use std::arch::x86_64::{
    __m256, __m256i, _CMP_LE_OQ, _mm_cvtsi64_si128, _mm_cvtsi128_si64, _mm_or_si128,
    _mm_unpackhi_epi64, _mm256_add_ps, _mm256_and_si256, _mm256_castps_si256,
    _mm256_castsi256_si128, _mm256_cmp_ps, _mm256_cvtepi32_ps, _mm256_cvtepu8_epi32,
    _mm256_extracti128_si256, _mm256_max_ps, _mm256_min_ps, _mm256_mul_ps, _mm256_set1_ps,
    _mm256_sllv_epi32,
};

use glam::Vec3A;
use obvhs::cwbvh::node::CwBvhNode;
use obvhs::ray::Ray;

use super::Query;

/// As in obvhs: what lies nearer is not met.
const NEAREST: f32 = 0.0001;

#[inline]
pub(super) fn is_available() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt")
}

#[inline]
pub(super) fn nearest(query: &Query<'_>) -> Option<(f32, u32)> {
    debug_assert!(is_available());
    // SAFETY: callers have asked `is_available`.
    unsafe { nearest_wide(query) }
}

#[inline]
pub(super) fn any(query: &Query<'_>) -> bool {
    debug_assert!(is_available());
    // SAFETY: callers have asked `is_available`.
    unsafe { any_wide(query) }
}

#[target_feature(enable = "avx2,lzcnt,popcnt")]
fn nearest_wide(query: &Query<'_>) -> Option<(f32, u32)> {
    query.nearest_by(|node, ray, octant| children(node, ray, octant))
}

#[target_feature(enable = "avx2,lzcnt,popcnt")]
fn any_wide(query: &Query<'_>) -> bool {
    query.any_by(|node, ray, octant| children(node, ray, octant))
}

/// The children that a ray meets, as [`CwBvhNode::intersect_ray`] has them, by the same operations in the same order.
#[inline]
#[target_feature(enable = "avx2,lzcnt,popcnt")]
fn children(node: &CwBvhNode, ray: &Ray, octant: u32) -> u32 {
    let scale = node.compute_extent() * ray.inv_direction;
    let origin = (Vec3A::from(node.p) - ray.origin) * ray.inv_direction;
    let (near_x, far_x) =
        slab(ray.direction.x, node.child_min_x, node.child_max_x, scale.x, origin.x);
    let (near_y, far_y) =
        slab(ray.direction.y, node.child_min_y, node.child_max_y, scale.y, origin.y);
    let (near_z, far_z) =
        slab(ray.direction.z, node.child_min_z, node.child_max_z, scale.z, origin.z);
    let near = _mm256_max_ps(near_x, _mm256_max_ps(near_y, near_z));
    let far = _mm256_min_ps(far_x, _mm256_min_ps(far_y, far_z));
    let near = _mm256_max_ps(near, _mm256_set1_ps(NEAREST));
    let far = _mm256_min_ps(far, _mm256_set1_ps(ray.tmax));
    let is_met = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far));

    let (bits, places) = node.get_child_and_index_bits(octant);
    let bits = _mm256_and_si256(_mm256_sllv_epi32(widen(bits), widen(places)), is_met);
    let half = _mm_or_si128(_mm256_castsi256_si128(bits), _mm256_extracti128_si256::<1>(bits));
    let quarter = _mm_cvtsi128_si64(_mm_or_si128(half, _mm_unpackhi_epi64(half, half))) as u64;
    quarter as u32 | (quarter >> 32) as u32
}

/// Where the ray enters and leaves the eight children along one axis.
#[inline]
#[target_feature(enable = "avx2")]
fn slab(direction: f32, min: [u8; 8], max: [u8; 8], scale: f32, origin: f32) -> (__m256, __m256) {
    let (min, max) = (u64::from_le_bytes(min), u64::from_le_bytes(max));
    let (near, far) = if direction < 0.0 { (max, min) } else { (min, max) };
    let (scale, origin) = (_mm256_set1_ps(scale), _mm256_set1_ps(origin));
    let at =
        |plane: u64| _mm256_add_ps(_mm256_mul_ps(_mm256_cvtepi32_ps(widen(plane)), scale), origin);
    (at(near), at(far))
}

/// Eight bytes as eight integers.
#[inline]
#[target_feature(enable = "avx2")]
fn widen(bytes: u64) -> __m256i {
    _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(bytes as i64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Rng, Stream};
    use glam::Vec3;

    #[test]
    fn eight_at_once_are_eight_one_by_one() {
        if !is_available() {
            return;
        }
        let mut rng = Rng::new(0, Stream::Test, 0);
        let mut n_met = 0;
        for i in 0..20_000 {
            // Boxes that are too small to be met are rarely of use: most extend far one way.
            let mut planes = || -> ([u8; 8], [u8; 8]) {
                let mut byte = || (rng.next_u32() >> 24) as u8;
                let pairs: [(u8, u8); 8] = std::array::from_fn(|_| (byte(), byte()));
                (pairs.map(|(a, b)| a.min(b) / 2), pairs.map(|(a, b)| 128 + a.max(b) / 2))
            };
            let [x, y, z] = [planes(), planes(), planes()];
            let mut node = CwBvhNode {
                e: [127, 128, 126],
                child_min_x: x.0,
                child_max_x: x.1,
                child_min_y: y.0,
                child_max_y: y.1,
                child_min_z: z.0,
                child_max_z: z.1,
                ..CwBvhNode::default()
            };
            // Inner nodes, leaves of one to three primitives, and empty slots.
            node.child_meta = std::array::from_fn(|slot| match (i + slot) % 5 {
                0 | 1 => 0b0010_0000 | (24 + slot as u8),
                2 => 0b0110_0000 | (3 * slot as u8),
                3 => 0b1110_0000 | (3 * slot as u8),
                _ => 0,
            });
            node.p = Vec3::new(rng.next_f32(), rng.next_f32(), rng.next_f32()) * 100.0 - 50.0;
            let mut coordinate = |scale: f32| (rng.next_f32() - 0.5) * scale;
            let origin = Vec3A::new(coordinate(600.0), coordinate(600.0), coordinate(600.0));
            let mut dir = Vec3A::new(coordinate(2.0), coordinate(2.0), coordinate(2.0));
            if i % 7 == 0 {
                // Along a plane: the inverse is infinite, and some products are not numbers.
                dir[i % 3] = if i % 2 == 0 { 0.0 } else { -0.0 };
            }
            let end = if i % 3 == 0 { f32::INFINITY } else { 400.0 * rng.next_f32() };
            let ray = Ray::new(origin, dir.normalize(), 0.0, end);
            for octant in [0, 0x0707_0707, 0x0303_0303, 0x0505_0505] {
                let expected = node.intersect_ray(&ray, octant);
                // SAFETY: `is_available` was asked.
                assert_eq!(unsafe { children(&node, &ray, octant) }, expected, "{i}");
                n_met += expected.count_ones();
            }
        }
        assert!(n_met > 20_000, "{n_met}");
    }
}
