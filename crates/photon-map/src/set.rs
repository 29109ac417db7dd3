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
pub(crate) struct LeafBox {
    pub(crate) min: [f32; 3],
    pub(crate) step: [f32; 3],
}

/// The photons of a leaf, in six lines of the processor's cache: what a search needs together lies together.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Leaf {
    /// In steps of the box, by axis.
    pub(crate) positions: [[u16; LEAF]; 3],
    pub(crate) normals: [u16; LEAF],
    pub(crate) flux: [u32; LEAF],
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
    /// One for each leaf. Apart from the photons, since most of those that a search looks at are left out.
    pub(crate) boxes: Array<LeafBox>,
    pub(crate) leaves: Array<Leaf>,
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
        let LeafBox { min, step } = self.boxes[leaf];
        let Leaf { positions, normals, .. } = &self.leaves[leaf];
        let place = |axis: usize| min[axis] + f32::from(positions[axis][lane]) * step[axis];
        StoredPhoton {
            position: Vec3A::new(place(0), place(1), place(2)),
            normal: decode_octahedral(normals[lane]),
            flux: self.flux_of(i),
        }
    }

    /// The boxes of the leaves, as lower and upper corners.
    pub(crate) fn leaf_boxes(&self) -> impl Iterator<Item = (Vec3, Vec3)> {
        self.boxes.iter().map(|leaf| {
            let (min, step) = (Vec3::from(leaf.min), Vec3::from(leaf.step));
            (min, min + step * 65535.0)
        })
    }

    /// Where the photons of a leaf lie.
    pub(crate) fn positions_of_leaf(&self, leaf: usize) -> impl Iterator<Item = Vec3> {
        (leaf * LEAF..self.n.min((leaf + 1) * LEAF)).map(|i| self.photon(i).position.into())
    }

    /// The flux of photon `i` in the order of the tree, in watts.
    ///
    /// # Panics
    /// When there is no such leaf.
    pub fn flux_of(&self, i: usize) -> Rgb {
        flux::unpack(self.leaves[i / LEAF].flux[i % LEAF]) * self.flux_scale
    }

    /// Bytes that the photons and their tree take, in memory and in a file alike.
    pub fn n_bytes(&self) -> usize {
        size_of_val(&*self.splits) + size_of_val(&*self.boxes) + size_of_val(&*self.leaves)
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
