//! Photons of one class, compact and in the order of their tree.

use base::{Photon, Rgb, decode_octahedral};
use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec3A};
use mapfile::Array;

use crate::{build, flux};

/// Photons in a leaf.
pub const LEAF: usize = 32;

/// The box of a leaf; positions count in steps of 1/65535 of it.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Leaf {
    pub(crate) min: [f32; 3],
    pub(crate) step: [f32; 3],
}

/// Photons of one class in a balanced kd-tree.
///
/// Leaves hold 32 photons each, the last one the rest. The tree over the leaves is implicit: the node over leaves
/// `a..b` splits them at `m = (a + b) / 2`, and `splits[m]` is the plane, with the axis in its two lowest bits. So there
/// are no pointers, and any order of memory is a valid tree to walk.
#[derive(Clone, Debug)]
pub struct PhotonSet {
    pub(crate) n: usize,
    /// Emission flux that is stored as 1.
    pub(crate) flux_scale: f32,
    /// One for each leaf; the first is unused.
    pub(crate) splits: Array<f32>,
    pub(crate) leaves: Array<Leaf>,
    /// For each leaf 32 x, then 32 y, then 32 z.
    pub(crate) positions: Array<u16>,
    pub(crate) flux: Array<u32>,
    pub(crate) normals: Array<u16>,
}

/// A photon as it is stored: position, normal and flux are rounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoredPhoton {
    /// Where it landed.
    pub position: Vec3A,
    /// Unit shading normal on the side that was hit.
    pub normal: Vec3A,
    /// Flux, in watts.
    pub flux: Rgb,
}

impl PhotonSet {
    /// Builds the tree in rayon's current pool. The result doesn't depend on the number of threads.
    pub fn build(photons: &[Photon]) -> Self {
        build::build(photons)
    }

    /// The number of photons.
    pub fn len(&self) -> usize {
        self.n
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// Photon `i` in the order of the tree.
    ///
    /// # Panics
    /// When `i` is not below [`PhotonSet::len`].
    pub fn photon(&self, i: usize) -> StoredPhoton {
        assert!(i < self.n, "photon {i} of {}", self.n);
        let (leaf, lane) = (i / LEAF, i % LEAF);
        let Leaf { min, step } = self.leaves[leaf];
        let q = |axis: usize| f32::from(self.positions[(leaf * 3 + axis) * LEAF + lane]);
        let position =
            Vec3::new(min[0] + q(0) * step[0], min[1] + q(1) * step[1], min[2] + q(2) * step[2]);
        StoredPhoton {
            position: position.into(),
            normal: decode_octahedral(self.normals[i]),
            flux: self.flux_of(i),
        }
    }

    /// The boxes of the leaves, as lower and upper corners.
    pub(crate) fn leaf_boxes(&self) -> impl Iterator<Item = (Vec3, Vec3)> {
        self.leaves.iter().map(|leaf| {
            let (min, step) = (Vec3::from(leaf.min), Vec3::from(leaf.step));
            (min, min + step * 65535.0)
        })
    }

    /// Where the photons of a leaf lie.
    pub(crate) fn positions_of_leaf(&self, leaf: usize) -> impl Iterator<Item = Vec3> {
        (leaf * LEAF..self.n.min((leaf + 1) * LEAF)).map(|i| self.photon(i).position.into())
    }

    #[inline(always)]
    pub(crate) fn flux_of(&self, i: usize) -> Rgb {
        flux::unpack(self.flux[i]) * self.flux_scale
    }

    /// Bytes that the photons and their tree take, in memory and in a file alike.
    pub fn n_bytes(&self) -> usize {
        size_of_val(&*self.splits)
            + size_of_val(&*self.leaves)
            + size_of_val(&*self.positions)
            + size_of_val(&*self.flux)
            + size_of_val(&*self.normals)
    }

    /// The sum of all flux, in watts.
    pub fn total_flux(&self) -> [f64; 3] {
        let mut sum = [0.0_f64; 3];
        for i in 0..self.n {
            let flux = self.flux_of(i).to_array();
            (0..3).for_each(|c| sum[c] += f64::from(flux[c]));
        }
        sum
    }
}
