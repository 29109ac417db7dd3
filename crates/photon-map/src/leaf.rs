//! Which photons of a leaf an estimate counts.
//!
//! The loops over a leaf are half of the work of an estimate. Where the processor has AVX2, they take eight photons at
//! once. Both ways round alike and keep the order of the leaf, so estimates are the same to the bit.

#[cfg(target_arch = "x86_64")]
mod avx2;

use base::decode_octahedral;
use glam::Vec3A;

use crate::set::{LEAF, Leaf, LeafBox};

/// A photon counts for a surface only if its normal is within this cosine of the surface's (26 degrees): photons from
/// the other side of a thin wall, or from around a corner, don't.
pub(crate) const MIN_COS_NORMALS: f32 = 0.9;

/// Where an estimate is made.
pub(crate) struct Surface {
    point: Vec3A,
    normal: Vec3A,
    /// The square of how high or low photons may lie.
    height2: f32,
    /// The last code of a normal, and whether it counts: neighbors mostly share theirs.
    last: (u16, bool),
}

/// Photons of one leaf that count, in its order.
pub(crate) struct Counted {
    n: usize,
    /// Squared distances. Those after the last are of no meaning, here and below: eight are written at once.
    dist2: [f32; LEAF + 8],
    /// As packed.
    flux: [u32; LEAF + 8],
    /// A bit for each place in the leaf.
    lanes: u32,
}

impl Surface {
    pub(crate) fn new(point: Vec3A, normal: Vec3A, height: f32) -> Self {
        Self { point, normal, height2: height * height, last: (0, is_facing(0, normal)) }
    }

    /// Finds the photons within `sqrt(bound2)` among the first `n` of a leaf.
    #[inline(always)]
    pub(crate) fn count(
        &mut self,
        (around, leaf): (&LeafBox, &Leaf),
        n: usize,
        bound2: f32,
        counted: &mut Counted,
    ) {
        #[cfg(target_arch = "x86_64")]
        if avx2::is_available() {
            return avx2::count(self, (around, leaf), n, bound2, counted);
        }
        self.count_one_by_one((around, leaf), n, bound2, counted);
    }

    fn count_one_by_one(
        &mut self,
        (around, leaf): (&LeafBox, &Leaf),
        n: usize,
        bound2: f32,
        counted: &mut Counted,
    ) {
        let all = around.distances(leaf, self.point, self.normal, self.height2);
        // Each photon is written, and overwritten by the next unless it counts: a branch would be mispredicted every
        // other time. The remainders spare the bounds checks.
        let (mut lanes, mut n_near) = ([0_u32; LEAF], 0);
        for (lane, &dist2) in all[..n].iter().enumerate() {
            lanes[n_near % LEAF] = lane as u32;
            n_near += usize::from(dist2 <= bound2);
        }
        (counted.n, counted.lanes) = (0, 0);
        for &lane in &lanes[..n_near] {
            let i = lane as usize % LEAF;
            let is_facing = self.is_facing(leaf.normals[i]);
            counted.dist2[counted.n % LEAF] = all[i];
            counted.flux[counted.n % LEAF] = leaf.flux[i];
            counted.lanes |= u32::from(is_facing) << lane;
            counted.n += usize::from(is_facing);
        }
    }

    /// Whether photons with this normal count.
    #[inline(always)]
    fn is_facing(&mut self, code: u16) -> bool {
        if code != self.last.0 {
            self.last = (code, is_facing(code, self.normal));
        }
        self.last.1
    }
}

/// Asks for a leaf that is soon looked at, where the processor can.
#[inline(always)]
pub(crate) fn prefetch(leaf: &Leaf) {
    #[cfg(target_arch = "x86_64")]
    avx2::prefetch(leaf);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = leaf;
}

fn is_facing(code: u16, normal: Vec3A) -> bool {
    decode_octahedral(code).dot(normal) > MIN_COS_NORMALS
}

impl Counted {
    /// Room for those of a leaf.
    pub(crate) const fn new() -> Self {
        Self { n: 0, dist2: [0.0; LEAF + 8], flux: [0; LEAF + 8], lanes: 0 }
    }

    /// Squared distances.
    pub(crate) fn dist2(&self) -> &[f32] {
        &self.dist2[..self.n]
    }

    /// Flux, as packed.
    pub(crate) fn flux(&self) -> &[u32] {
        &self.flux[..self.n]
    }

    /// Places in the leaf.
    pub(crate) fn lanes(&self) -> impl Iterator<Item = usize> + use<> {
        let lanes = self.lanes;
        (0..LEAF).filter(move |lane| lanes >> lane & 1 == 1)
    }
}
