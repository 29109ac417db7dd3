//! The balanced kd-tree.

use base::Photon;
use bytemuck::Zeroable;
use glam::Vec3;
use rayon::prelude::*;

use crate::flux;
use crate::set::{LEAF, Leaf, LeafBox, PhotonSet};

/// A photon on its way to its place in the tree. Its flux is packed before it moves: nothing has to be fetched from all
/// over memory, or from files, when the leaves are filled.
#[derive(Clone, Copy, Debug)]
struct Item {
    position: Vec3,
    /// Which photon of the sequence: parts equals, and is the chance by which flux is rounded.
    index: u32,
    flux: u32,
    normal: u16,
}

/// Below this number of leaves, a task isn't worth another thread.
const LEAVES_PER_TASK: usize = 64;

/// Photons of one class that come in parts, to be sorted into a tree when all are there. 24 bytes each.
#[derive(Debug)]
pub struct Loose {
    items: Vec<Item>,
    flux_scale: f32,
}

impl Loose {
    /// None yet, with room for `n`, whose largest channel of flux is `largest`, in watts. Both must be those of all the
    /// photons to come, or the rounding of flux isn't that of [`PhotonSet::build`].
    pub fn new(n: usize, largest: f32) -> Self {
        let flux_scale = if largest > 0.0 { largest / flux::MAX } else { 1.0 };
        Self { items: Vec::with_capacity(n), flux_scale }
    }

    /// Appends photons in the order of their emission, in rayon's current pool.
    ///
    /// # Panics
    /// When there are more than 2^32 - 1.
    pub fn extend<T: Sync>(&mut self, photons: &[T], photon: impl Fn(&T) -> Photon + Sync) {
        let (first, flux_scale) = (self.items.len(), self.flux_scale);
        assert!(first + photons.len() <= u32::MAX as usize, "at most 2^32 - 1 photons of a class");
        self.items.par_extend(photons.par_iter().enumerate().map(|(i, landed)| {
            let Photon { position, normal, flux } = photon(landed);
            let index = (first + i) as u32;
            Item { position, index, flux: flux::pack(flux / flux_scale, index.into()), normal }
        }));
    }

    /// Sorts the photons into a tree, in rayon's current pool.
    pub fn into_set(self) -> PhotonSet {
        let Self { mut items, flux_scale } = self;
        let n_leaves = items.len().div_ceil(LEAF);
        let mut splits = vec![0.0_f32; n_leaves];
        if n_leaves > 1 {
            partition(&mut items, &mut splits[1..], n_leaves);
        }
        let (mut boxes, mut leaves) =
            (vec![LeafBox::zeroed(); n_leaves], vec![Leaf::zeroed(); n_leaves]);
        (items.par_chunks_mut(LEAF), boxes.par_iter_mut(), leaves.par_iter_mut())
            .into_par_iter()
            .for_each(|(items, around, leaf)| {
                // Partitioning leaves an order of its own: this one is known from the photons alone.
                items.sort_unstable_by_key(|item| item.index);
                quantize(items, around, leaf);
                for (lane, item) in items.iter().enumerate() {
                    (leaf.flux[lane], leaf.normals[lane]) = (item.flux, item.normal);
                }
            });
        PhotonSet {
            n: items.len(),
            flux_scale,
            splits: splits.into(),
            boxes: boxes.into(),
            leaves: leaves.into(),
        }
    }
}

/// The largest channel of the flux of any photon, in watts; 0 if there is none.
pub fn largest_flux(photons: &[Photon]) -> f32 {
    photons.par_iter().map(|p| p.flux.max_channel()).reduce(|| 0.0, f32::max)
}

pub(crate) fn build(photons: &[Photon]) -> PhotonSet {
    let mut loose = Loose::new(photons.len(), largest_flux(photons));
    loose.extend(photons, |photon| *photon);
    loose.into_set()
}

/// Orders the items of `n_leaves` leaves; `splits` are the planes between them.
fn partition(items: &mut [Item], splits: &mut [f32], n_leaves: usize) {
    let middle = n_leaves / 2;
    let n_low = middle * LEAF;
    let (axis, plane) = split(items, n_low);
    splits[middle - 1] = f32::from_bits(plane.to_bits() & !3 | axis as u32);
    let (low, high) = items.split_at_mut(n_low);
    let (low_splits, high_splits) = splits.split_at_mut(middle - 1);
    let high_splits = &mut high_splits[1..];
    let low_task = |items: &mut [Item], splits: &mut [f32]| {
        if middle > 1 {
            partition(items, splits, middle);
        }
    };
    let high_task = |items: &mut [Item], splits: &mut [f32]| {
        if n_leaves - middle > 1 {
            partition(items, splits, n_leaves - middle);
        }
    };
    if n_leaves > LEAVES_PER_TASK {
        rayon::join(|| low_task(low, low_splits), || high_task(high, high_splits));
    } else {
        low_task(low, low_splits);
        high_task(high, high_splits);
    }
}

/// Moves the `n_low` items that are lowest along the longest axis to the front; answers with the axis and the place of the
/// next higher one.
fn split(items: &mut [Item], n_low: usize) -> (usize, f32) {
    let axis = extent(items).max_position();
    let plane = select(items, n_low, axis);
    let n_below = move_to_front(&mut items[..n_low], |position| position[axis] < plane);
    if n_below < n_low {
        // Photons of a wall that lies in the plane go to both sides. Parted at random, both would have some everywhere,
        // and searches would have to look at both.
        let n_above = move_to_front(&mut items[n_low..], |position| position[axis] == plane);
        let within = &mut items[n_below..n_low + n_above];
        let mut extent = extent(within);
        extent[axis] = -1.0;
        select(within, n_low - n_below, extent.max_position());
    }
    (axis, plane)
}

/// The sides of the box around all items.
fn extent(items: &[Item]) -> Vec3 {
    let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for item in items {
        min = min.min(item.position);
        max = max.max(item.position);
    }
    max - min
}

/// Moves the `n` lowest items to the front; answers with the place of the next one.
fn select(items: &mut [Item], n: usize, axis: usize) -> f32 {
    let (_, next, _) = items.select_nth_unstable_by(n, |a, b| {
        a.position[axis].total_cmp(&b.position[axis]).then(a.index.cmp(&b.index))
    });
    next.position[axis]
}

/// Moves the items whose position passes to the front; answers how many there are.
fn move_to_front(items: &mut [Item], passes: impl Fn(Vec3) -> bool) -> usize {
    let mut n = 0;
    for i in 0..items.len() {
        if passes(items[i].position) {
            items.swap(n, i);
            n += 1;
        }
    }
    n
}

/// Positions in steps of the box of a leaf. No rounded position leaves the box, so the planes of the tree hold.
fn quantize(items: &[Item], around: &mut LeafBox, leaf: &mut Leaf) {
    for axis in 0..3 {
        let coordinates = || items.iter().map(|item| item.position[axis]);
        let min = coordinates().fold(f32::INFINITY, f32::min);
        let max = coordinates().fold(f32::NEG_INFINITY, f32::max);
        let mut step = (max - min) / 65535.0;
        while min + 65535.0 * step > max {
            step = step.next_down();
        }
        (around.min[axis], around.step[axis]) = (min, step.max(0.0));
        for (lane, x) in coordinates().enumerate() {
            let steps = if step > 0.0 { (x - min) / step + 0.5 } else { 0.0 };
            leaf.positions[axis][lane] = steps.min(65535.0) as u16;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Rgb, Rng, Stream};

    /// On the walls of a box, which lie in planes that are split: leaves must not lie one over the other.
    #[test]
    fn leaves_on_a_wall_do_not_overlap() {
        for n in [10_000, 100_000, 131_072] {
            let mut rng = Rng::new(0, Stream::Test, n);
            let photons: Vec<Photon> = (0..n)
                .map(|_| {
                    let mut place = [rng.next_f32(), rng.next_f32(), rng.next_f32()];
                    place[rng.next_u32() as usize % 3] = (rng.next_u32() % 2) as f32;
                    Photon { position: place.into(), normal: 0, flux: Rgb::ONE }
                })
                .collect();
            let set = build(&photons);
            let mut area = 0.0;
            for leaf in set.boxes.iter() {
                let [x, y, z] = leaf.step.map(|step| step * 65535.0);
                // The few that hold photons of two walls have a volume.
                if x * y * z == 0.0 {
                    area += x * y + y * z + z * x;
                }
            }
            assert!(area < 6.0, "{n} photons: leaves of area {area} on walls of area 6");
        }
    }
}
