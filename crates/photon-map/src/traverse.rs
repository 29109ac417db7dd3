//! Walking the tree: which leaves lie within a distance of a point.

use glam::Vec3A;

use crate::set::{LEAF, Leaf, PhotonSet};

/// Squared distances and heights of the photons of a leaf, as seen from a point.
pub(crate) struct LeafView {
    /// Squared distance.
    pub(crate) dist2: [f32; LEAF],
    /// Distance from the plane through the point.
    pub(crate) height: [f32; LEAF],
}

impl LeafView {
    pub(crate) fn new() -> Self {
        Self { dist2: [0.0; LEAF], height: [0.0; LEAF] }
    }
}

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
        struct Task {
            low: u32,
            high: u32,
            /// Squared distance of the cell, and its parts along the axes.
            dist2: f32,
            offsets: [f32; 3],
        }
        const NONE: Task = Task { low: 0, high: 0, dist2: 0.0, offsets: [0.0; 3] };
        let (splits, leaves) = (&*self.splits, &*self.leaves);
        let p = point.to_array();
        // As deep as the tree: 2^32 photons are 2^27 leaves.
        let mut stack = [const { NONE }; 32];
        let mut top = 0;
        let mut task = Task { low: 0, high: leaves.len() as u32, ..NONE };
        if leaves.is_empty() {
            return;
        }
        loop {
            while task.high - task.low > 1 {
                let middle = task.low + (task.high - task.low) / 2;
                let plane = splits[middle as usize];
                let axis = (plane.to_bits() & 3).min(2) as usize;
                let distance = p[axis] - plane;
                // The axis took the two lowest bits of the plane.
                let gap = (distance.abs() - plane.abs() * 2.0_f32.powi(-21)).max(0.0);
                let mut far = Task { offsets: task.offsets, ..NONE };
                far.offsets[axis] = gap;
                let [x, y, z] = far.offsets;
                // A few roundings less, so that no cell seems farther than its photons.
                far.dist2 = (x * x + y * y + z * z) * (1.0 - 8.0 * f32::EPSILON);
                if distance < 0.0 {
                    (far.low, far.high, task.high) = (middle, task.high, middle);
                } else {
                    (far.low, far.high, task.low) = (task.low, middle, middle);
                }
                if far.dist2 <= bound2 {
                    stack[top] = far;
                    top += 1;
                }
            }
            let leaf = task.low as usize;
            if leaves[leaf].dist2(&p) <= bound2 {
                bound2 = visit(leaf, bound2);
            }
            loop {
                if top == 0 {
                    return;
                }
                top -= 1;
                if stack[top].dist2 <= bound2 {
                    break;
                }
            }
            task = std::mem::replace(&mut stack[top], NONE);
        }
    }
}

impl Leaf {
    /// Squared distance of a point from the box.
    ///
    /// Every step is that of [`Leaf::view`], and rounding keeps order: no photon in the box comes out nearer than this.
    /// So what is found never depends on which boxes a search could leave out.
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

    /// The photons of the leaf, at the given steps of its box, as seen from a point with a normal.
    #[inline(always)]
    pub(crate) fn view(&self, steps: &[u16], point: Vec3A, normal: Vec3A, view: &mut LeafView) {
        let Self { min, step } = *self;
        let (p, n) = (point.to_array(), normal.to_array());
        let Some((qx, rest)) = steps.split_first_chunk::<LEAF>() else { return };
        let Some((qy, rest)) = rest.split_first_chunk::<LEAF>() else { return };
        let Some((qz, _)) = rest.split_first_chunk::<LEAF>() else { return };
        for lane in 0..LEAF {
            let x = min[0] + f32::from(qx[lane]) * step[0] - p[0];
            let y = min[1] + f32::from(qy[lane]) * step[1] - p[1];
            let z = min[2] + f32::from(qz[lane]) * step[2] - p[2];
            view.dist2[lane] = x * x + y * y + z * z;
            view.height[lane] = x * n[0] + y * n[1] + z * n[2];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Photon, Rgb, Rng, Stream};
    use glam::Vec3;

    #[test]
    fn no_photon_is_nearer_than_its_box() {
        let mut rng = Rng::new(0, Stream::Test, 0);
        let mut view = LeafView::new();
        for i in 0..20_000 {
            let mut numbers = |size: f32| [0; 3].map(|_| (rng.next_f32() - 0.5) * size);
            // Boxes that are small for their place, and points near their faces.
            let offset = 10.0_f32.powi(i % 5);
            let leaf = Leaf { min: numbers(offset), step: numbers(2e-4).map(f32::abs) };
            let max = Vec3::from(leaf.min) + Vec3::from(leaf.step) * 65535.0;
            let point = max + Vec3::from(numbers(1.0)) * 10.0_f32.powi(-(i % 7));
            let steps: Vec<u16> = (0..3 * LEAF)
                .map(|_| [0, 65535, rng.next_u32() as u16][rng.next_u32() as usize % 3])
                .collect();
            leaf.view(&steps, point.into(), Vec3A::Z, &mut view);
            let box_dist2 = leaf.dist2(&point.to_array());
            let nearest = view.dist2.into_iter().fold(f32::INFINITY, f32::min);
            assert!(box_dist2 <= nearest, "{box_dist2} > {nearest} from {point} to {leaf:?}");
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
