//! The gathers of `photon-map` by another kd-tree: kiddo. It finds photons; the sum over them is ours. It knows neither
//! surfaces nor normals, so it does less.

use std::num::NonZero;

use base::{Photon, Rgb};
use glam::Vec3A;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// Photons in a tree of kiddo.
pub(crate) struct Peer {
    tree: ImmutableKdTree<f32, 3>,
    flux: Vec<Rgb>,
}

/// Where the photons are.
pub(crate) fn positions(photons: &[Photon]) -> Vec<[f32; 3]> {
    photons.iter().map(|p| p.position.to_array()).collect()
}

/// The tree alone.
pub(crate) fn build(positions: &[[f32; 3]]) -> ImmutableKdTree<f32, 3> {
    ImmutableKdTree::new_from_slice(positions).expect("positions are finite, and not too many")
}

impl Peer {
    pub(crate) fn new(photons: &[Photon]) -> Self {
        Self { tree: build(&positions(photons)), flux: photons.iter().map(|p| p.flux).collect() }
    }

    /// The weighted flux of the `k` nearest photons within a radius.
    pub(crate) fn nearest(&self, point: Vec3A, k: usize, max_radius: f32) -> Rgb {
        let k = NonZero::new(k).expect("k is at least 2");
        let query = point.to_array();
        let nearest = self.tree.query(&query).nearest_n::<SquaredEuclidean<f32>>(k);
        let found = nearest.within(max_radius * max_radius).unsorted().execute();
        let radius2 = found.iter().map(|p| p.distance).fold(f32::MIN_POSITIVE, f32::max);
        found.iter().map(|p| self.flux[p.item as usize] * (1.0 - p.distance / radius2)).sum()
    }

    /// The weighted flux of all photons within a radius.
    pub(crate) fn within(&self, point: Vec3A, radius: f32) -> Rgb {
        let radius2 = radius * radius;
        let query = point.to_array();
        let found =
            self.tree.query(&query).within::<SquaredEuclidean<f32>>(radius2).unsorted().execute();
        found.iter().map(|p| self.flux[p.item as usize] * (1.0 - p.distance / radius2)).sum()
    }
}
