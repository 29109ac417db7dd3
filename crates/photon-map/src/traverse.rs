//! Walking the tree: which leaves lie within a distance of a point.

use glam::Vec3A;

use crate::set::{LEAF, Leaf, LeafBox, PhotonSet};

/// A photon counts for a surface only if the line to it rises from the surface by less than this sine (14.5 degrees), so
/// that a step or a parallel surface close by doesn't count, whatever its scale.
const MAX_SINE_HEIGHT: f32 = 0.25;

impl PhotonSet {
    /// Calls `visit` for the leaves that may hold photons within `sqrt(bound2)` of `point`, near ones first; it answers
    /// with the bound for what follows.
    ///
    /// The order of the leaves depends on the point alone; a smaller bound only leaves some out.
    #[inline]
    pub(crate) fn walk(
        &self,
        point: Vec3A,
        mut bound2: f32,
        mut visit: impl FnMut(usize, f32) -> f32,
    ) {
        #[derive(Clone, Copy)]
        struct Task {
            low: u32,
            high: u32,
            /// Squared distance of the cell, and its parts along the axes.
            dist2: f32,
            parts: [f32; 3],
        }
        let (splits, boxes) = (&*self.splits, &*self.boxes);
        if boxes.is_empty() {
            return;
        }
        let p = point.to_array();
        let mut task = Task { low: 0, high: boxes.len() as u32, dist2: 0.0, parts: [0.0; 3] };
        // As deep as the tree, with room to spare: 2^32 photons are 2^27 leaves.
        let mut stack = [task; 32];
        let mut top = 0;
        loop {
            // Distances of cells are wrong by a few roundings a level.
            let cell_bound2 = |bound2: f32| bound2 * (1.0 + 2.0_f32.powi(-16));
            while task.high - task.low > 1 {
                let middle = task.low + (task.high - task.low) / 2;
                let plane = splits[middle as usize];
                let axis = (plane.to_bits() & 3).min(2) as usize;
                let distance = p[axis] - plane;
                // The axis took the two lowest bits of the plane.
                let gap = (distance.abs() - plane.abs() * 2.0_f32.powi(-21)).max(0.0);
                let low_is_near = distance < 0.0;
                let (low, high) = ((task.low, middle), (middle, task.high));
                // Written whether it is wanted or not: a branch would be mispredicted too often.
                let far = &mut stack[top % 32];
                *far = task;
                far.dist2 += gap * gap - task.parts[axis];
                far.parts[axis] = gap * gap;
                (far.low, far.high) = if low_is_near { high } else { low };
                (task.low, task.high) = if low_is_near { low } else { high };
                top += usize::from(far.dist2 <= cell_bound2(bound2));
            }
            let leaf = task.low as usize;
            if boxes[leaf].dist2(&p) <= bound2 {
                bound2 = visit(leaf, bound2);
            }
            loop {
                if top == 0 {
                    return;
                }
                top -= 1;
                if stack[top % 32].dist2 <= cell_bound2(bound2) {
                    break;
                }
            }
            task = stack[top % 32];
        }
    }
}

impl LeafBox {
    /// Squared distance of a point from the box.
    ///
    /// Every step is that of [`LeafBox::distances`], and rounding keeps order: no photon in the box comes out nearer than
    /// this. So what is found never depends on which boxes a search could leave out.
    #[inline(always)]
    fn dist2(&self, p: &[f32; 3]) -> f32 {
        let mut dist2 = 0.0;
        for (axis, x) in p.iter().enumerate() {
            let low = self.min[axis] - x;
            let high = self.min[axis] + 65535.0 * self.step[axis] - x;
            let d = low.max(-high).max(0.0);
            dist2 += d * d;
        }
        dist2
    }

    /// Squared distances of the photons of the leaf from a point; not a number for those that lie too high above, or too
    /// low below, the surface through the point with the given normal. More than `sqrt(height2)` is too high anyway.
    #[inline(always)]
    pub(crate) fn distances(
        &self,
        leaf: &Leaf,
        point: Vec3A,
        normal: Vec3A,
        height2: f32,
    ) -> [f32; LEAF] {
        let Self { min, step } = self;
        let [qx, qy, qz] = &leaf.positions;
        let (p, n) = (point.to_array(), normal.to_array());
        // A loop without branches, which the compiler turns into one over vectors.
        let mut distances = [0.0; LEAF];
        for lane in 0..LEAF {
            let x = min[0] + f32::from(qx[lane]) * step[0] - p[0];
            let y = min[1] + f32::from(qy[lane]) * step[1] - p[1];
            let z = min[2] + f32::from(qz[lane]) * step[2] - p[2];
            let dist2 = x * x + y * y + z * z;
            let height = x * n[0] + y * n[1] + z * n[2];
            let limit2 = (dist2 * (MAX_SINE_HEIGHT * MAX_SINE_HEIGHT)).min(height2);
            let is_flat = height * height <= limit2;
            distances[lane] = if is_flat { dist2 } else { f32::NAN };
        }
        distances
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Photon, Rgb, Rng, Stream};
    use bytemuck::Zeroable;
    use glam::Vec3;

    #[test]
    fn no_photon_is_nearer_than_its_box() {
        let mut rng = Rng::new(0, Stream::Test, 0);
        for i in 0..20_000 {
            let mut numbers = |size: f32| [0; 3].map(|_| (rng.next_f32() - 0.5) * size);
            // Boxes that are small for their place, and points near their faces.
            let offset = 10.0_f32.powi(i % 5);
            let around = LeafBox { min: numbers(offset), step: numbers(2e-4).map(f32::abs) };
            let max = Vec3::from(around.min) + Vec3::from(around.step) * 65535.0;
            let point = max + Vec3::from(numbers(1.0)) * 10.0_f32.powi(-(i % 7));
            let mut leaf = Leaf::zeroed();
            for step in leaf.positions.as_flattened_mut() {
                *step = [0, 65535, rng.next_u32() as u16][rng.next_u32() as usize % 3];
            }
            let box_dist2 = around.dist2(&point.to_array());
            // Nothing is too high above a surface without a normal.
            let distances = around.distances(&leaf, point.into(), Vec3A::ZERO, f32::INFINITY);
            let nearest = distances.into_iter().fold(f32::INFINITY, f32::min);
            assert!(box_dist2 <= nearest, "{box_dist2} > {nearest} from {point} to {around:?}");
        }
    }

    #[test]
    fn every_photon_within_the_bound_is_in_a_leaf_that_is_visited() {
        let mut rng = Rng::new(0, Stream::Test, 1);
        for offset in [0.0, 3.0, 700.0, 40_000.0] {
            let mut place = || {
                let [x, y] = rng.next_2d().to_array();
                Vec3::new(x, y, rng.next_f32()) + offset
            };
            let photons: Vec<Photon> = (0..5000)
                .map(|_| Photon { position: place(), normal: 0, flux: Rgb::ONE })
                .collect();
            let set = PhotonSet::build(&photons);
            for i in 0..set.len() {
                let point = Vec3A::from(place());
                let dist2 = (set.photon(i).position - point).length_squared();
                let mut visited = false;
                set.walk(point, dist2, |leaf, bound2| {
                    visited |= leaf == i / LEAF;
                    bound2
                });
                assert!(visited, "photon {i} at {dist2} from {point}");
            }
        }
    }
}
