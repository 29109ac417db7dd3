//! The balanced kd-tree.

use base::Photon;
use glam::Vec3;
use rayon::prelude::*;

use crate::flux;
use crate::set::{LEAF, Leaf, PhotonSet};

/// What the build moves around: a position and where the photon was.
#[derive(Clone, Copy)]
struct Item {
    position: Vec3,
    index: u32,
}

/// Below this number of leaves, a task isn't worth another thread.
const LEAVES_PER_TASK: usize = 64;

pub(crate) fn build(photons: &[Photon]) -> PhotonSet {
    assert!(photons.len() <= u32::MAX as usize, "at most 2^32 photons of a class");
    let n_leaves = photons.len().div_ceil(LEAF);
    let mut items: Vec<Item> = (photons.par_iter().enumerate())
        .map(|(i, p)| Item { position: p.position, index: i as u32 })
        .collect();
    let mut splits = vec![0.0_f32; n_leaves];
    if n_leaves > 1 {
        partition(&mut items, &mut splits[1..], n_leaves);
    }

    let largest = photons.par_iter().map(|p| p.flux.max_channel()).reduce(|| 0.0, f32::max);
    let flux_scale = if largest > 0.0 { largest / flux::MAX } else { 1.0 };
    let mut leaves = vec![Leaf { min: [0.0; 3], step: [0.0; 3] }; n_leaves];
    let mut positions = vec![0_u16; n_leaves * 3 * LEAF];
    let (mut fluxes, mut normals) = (vec![0_u32; photons.len()], vec![0_u16; photons.len()]);
    (items.par_chunks_mut(LEAF), leaves.par_iter_mut(), positions.par_chunks_mut(3 * LEAF))
        .into_par_iter()
        .zip((fluxes.par_chunks_mut(LEAF), normals.par_chunks_mut(LEAF)).into_par_iter())
        .for_each(|((items, leaf, positions), (fluxes, normals))| {
            // Partitioning leaves an order of its own: this one is known from the photons alone.
            items.sort_unstable_by_key(|item| item.index);
            *leaf = quantize(items, positions);
            for (lane, item) in items.iter().enumerate() {
                let photon = &photons[item.index as usize];
                fluxes[lane] = flux::pack(photon.flux / flux_scale, item.index.into());
                normals[lane] = photon.normal;
            }
        });
    PhotonSet {
        n: photons.len(),
        flux_scale,
        splits: splits.into(),
        leaves: leaves.into(),
        positions: positions.into(),
        flux: fluxes.into(),
        normals: normals.into(),
    }
}

/// Orders the items of `n_leaves` leaves; `splits` are the planes between them.
fn partition(items: &mut [Item], splits: &mut [f32], n_leaves: usize) {
    let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for item in items.iter() {
        min = min.min(item.position);
        max = max.max(item.position);
    }
    let axis = (max - min).max_position();
    let middle = n_leaves / 2;
    let (low, pivot, _) = items.select_nth_unstable_by(middle * LEAF, |a, b| {
        a.position[axis].total_cmp(&b.position[axis]).then(a.index.cmp(&b.index))
    });
    splits[middle - 1] = f32::from_bits(pivot.position[axis].to_bits() & !3 | axis as u32);
    let n_low = low.len();
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

/// Positions in steps of the box of a leaf. No rounded position leaves the box, so the planes of the tree hold.
fn quantize(items: &[Item], positions: &mut [u16]) -> Leaf {
    let mut leaf = Leaf { min: [0.0; 3], step: [0.0; 3] };
    for axis in 0..3 {
        let coordinates = || items.iter().map(|item| item.position[axis]);
        let min = coordinates().fold(f32::INFINITY, f32::min);
        let max = coordinates().fold(f32::NEG_INFINITY, f32::max);
        let mut step = (max - min) / 65535.0;
        while min + 65535.0 * step > max {
            step = step.next_down();
        }
        (leaf.min[axis], leaf.step[axis]) = (min, step.max(0.0));
        for (lane, x) in coordinates().enumerate() {
            let steps = if step > 0.0 { ((x - min) / step).round() } else { 0.0 };
            positions[axis * LEAF + lane] = steps.min(65535.0) as u16;
        }
    }
    leaf
}
