//! Eight boxes at once.
//!
//! Measured with `cargo bench -p pipeline-tests --bench micro -- BVH`. The only unsafe code here is to call what was compiled
//! for a processor that has these instructions.
#![expect(unsafe_code, reason = "instructions that only some processors have")]

use std::arch::x86_64::{
    __m256, _CMP_LE_OQ, _mm256_cmp_ps, _mm256_max_ps, _mm256_min_ps, _mm256_movemask_ps,
    _mm256_mul_ps, _mm256_set1_ps, _mm256_setzero_ps, _mm256_sub_ps,
};

use super::{Entries, Query, SlabRay};
use crate::node::Node;

#[inline]
pub(super) fn is_available() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("bmi1")
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

#[target_feature(enable = "avx2,bmi1")]
fn nearest_wide(query: &Query<'_>) -> Option<(f32, u32)> {
    query.nearest_by(|ray, node, t_max, entries| children(ray, node, t_max, entries))
}

#[target_feature(enable = "avx2,bmi1")]
fn any_wide(query: &Query<'_>) -> bool {
    query.any_by(|ray, node, t_max, entries| children(ray, node, t_max, entries))
}

/// [`SlabRay::children`], by the same operations in the same order.
#[inline]
#[target_feature(enable = "avx2")]
fn children(ray: &SlabRay, node: &Node, t_max: f32, entries: &mut Entries) -> u32 {
    let (near_x, far_x) = slab(ray, node, 0);
    let (near_y, far_y) = slab(ray, node, 1);
    let (near_z, far_z) = slab(ray, node, 2);
    let near = _mm256_max_ps(near_x, _mm256_max_ps(near_y, near_z));
    let far = _mm256_min_ps(far_x, _mm256_min_ps(far_y, far_z));
    let near = _mm256_max_ps(near, _mm256_setzero_ps());
    let far = _mm256_min_ps(far, _mm256_set1_ps(t_max));
    entries.0 = bytemuck::cast(near);
    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far)) as u32
}

/// Where the ray enters and leaves the eight boxes along one axis.
#[inline]
#[target_feature(enable = "avx2")]
fn slab(ray: &SlabRay, node: &Node, axis: usize) -> (__m256, __m256) {
    let origin = _mm256_set1_ps(ray.origin[axis]);
    let inverse = _mm256_set1_ps(ray.inverse_dir[axis]);
    let (min, max) = (&node.min[axis], &node.max[axis]);
    let (near, far) = if ray.is_negative[axis] { (max, min) } else { (min, max) };
    let at =
        |planes: &[f32; 8]| _mm256_mul_ps(_mm256_sub_ps(bytemuck::cast(*planes), origin), inverse);
    (at(near), at(far))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::Child;
    use base::{Rng, Stream};
    use glam::Vec3A;

    #[test]
    fn eight_at_once_are_eight_one_by_one() {
        if !is_available() {
            return;
        }
        let mut rng = Rng::new(0, Stream::Test, 0);
        let (mut n_met, mut n_missed) = (0, 0);
        for i in 0..20_000 {
            // Boxes around the middle, and empty places.
            let mut node = Node { min: [[0.0; 8]; 3], max: [[0.0; 8]; 3], children: [Child(0); 8] };
            for slot in 0..8 {
                for axis in 0..3 {
                    let mut plane = |from: f32| from + (rng.next_f32() * 64.0).floor();
                    (node.min[axis][slot], node.max[axis][slot]) = (plane(-64.0), plane(0.0));
                    if (i + slot) % 5 == 0 {
                        node.min[axis][slot] = f32::INFINITY;
                        node.max[axis][slot] = f32::NEG_INFINITY;
                    }
                }
            }
            let mut point = |size: f32| {
                let mut coordinate = || (rng.next_f32() - 0.5) * size;
                Vec3A::new(coordinate(), coordinate(), coordinate())
            };
            let (mut origin, target) = (point(200.0), point(100.0));
            let mut dir = target - origin;
            if i % 7 == 0 {
                // In a plane and along it: the inverse is infinite, and some products are not numbers.
                dir[i % 3] = if i % 2 == 0 { 0.0 } else { -0.0 };
                origin[i % 3] = node.min[i % 3][0];
            }
            let t_max = if i % 3 == 0 { f32::INFINITY } else { 200.0 * rng.next_f32() };
            let ray = SlabRay::new(origin, dir.normalize(), t_max);
            let (mut ours, mut expected) = (Entries([0.0; 8]), Entries([0.0; 8]));
            let met = ray.children(&node, t_max, &mut expected);
            // SAFETY: `is_available` was asked.
            assert_eq!(unsafe { children(&ray, &node, t_max, &mut ours) }, met, "{i}");
            for slot in (0..8).filter(|slot| met >> slot & 1 != 0) {
                assert_eq!(ours.0[slot].to_bits(), expected.0[slot].to_bits(), "{i}");
                assert!(node.min[0][slot] < node.max[0][slot], "{i}: empty");
            }
            n_met += met.count_ones();
            n_missed += (!met & 255).count_ones();
        }
        assert!(n_met > 20_000 && n_missed > 20_000, "{n_met} {n_missed}");
    }
}
