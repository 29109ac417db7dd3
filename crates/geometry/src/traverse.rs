//! Rays through the BVH.
//!
//! The loop over nodes is obvhs's. Its test of a node's eight boxes is made for processors of 2003; where the processor
//! has AVX2, ours takes all eight at once. Both round alike, so hits are the same to the bit.

#[cfg(target_arch = "x86_64")]
mod avx2;

use glam::UVec2;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::node::CwBvhNode;
use obvhs::ray::Ray;
use obvhs::traverse;

use crate::primitive::{Primitive, ShearedRay};

/// A ray, as boxes and primitives see it.
pub(crate) struct Query<'a> {
    pub(crate) bvh: &'a CwBvh,
    /// In the order of the leaves.
    pub(crate) primitives: &'a [Primitive],
    /// For boxes, in scaled units.
    pub(crate) slab: Ray,
    /// For primitives. It starts earlier, by `skipped`.
    pub(crate) sheared: ShearedRay,
    pub(crate) skipped: f64,
}

impl Query<'_> {
    /// Distance along the ray for boxes, and slot, of the nearest primitive.
    #[inline]
    pub(crate) fn nearest(&self) -> Option<(f32, u32)> {
        #[cfg(target_arch = "x86_64")]
        if avx2::is_available() {
            return avx2::nearest(self);
        }
        self.nearest_by(|node, ray, octant| node.intersect_ray(ray, octant))
    }

    /// Whether any primitive lies on the ray.
    #[inline]
    pub(crate) fn any(&self) -> bool {
        #[cfg(target_arch = "x86_64")]
        if avx2::is_available() {
            return avx2::any(self);
        }
        self.any_by(|node, ray, octant| node.intersect_ray(ray, octant))
    }

    #[inline(always)]
    fn nearest_by(&self, children: impl Fn(&CwBvhNode, &Ray, u32) -> u32) -> Option<(f32, u32)> {
        let mut ray = self.slab;
        let mut state = self.bvh.new_traversal(ray.direction);
        let mut nearest = None;
        let mut node;
        traverse!(self.bvh, node, state, children(node, &ray, state.oct_inv4), {
            let t_max = ray.tmax + self.skipped as f32;
            let t = self.distance(state.primitive_id, t_max);
            if t < ray.tmax {
                nearest = Some((t, state.primitive_id));
                ray.tmax = t;
            }
        });
        nearest
    }

    #[inline(always)]
    fn any_by(&self, children: impl Fn(&CwBvhNode, &Ray, u32) -> u32) -> bool {
        let ray = self.slab;
        let t_max = ray.tmax + self.skipped as f32;
        let mut state = self.bvh.new_traversal(ray.direction);
        let mut node;
        traverse!(self.bvh, node, state, children(node, &ray, state.oct_inv4), {
            if self.distance(state.primitive_id, t_max) < ray.tmax {
                return true;
            }
        });
        false
    }

    #[inline(always)]
    fn distance(&self, slot: u32, t_max: f32) -> f32 {
        (self.primitives[slot as usize].intersect(&self.sheared, t_max) - self.skipped) as f32
    }
}
