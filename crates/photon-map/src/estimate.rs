//! Density estimates: from photons to irradiance.

use base::{Rgb, decode_octahedral, math::PI};
use glam::Vec3A;

use crate::set::{LEAF, PhotonSet};
use crate::{Kernel, flux};

/// A photon counts for a surface only if its normal is within this cosine of the surface's (26 degrees): photons from
/// the other side of a thin wall, or from around a corner, don't.
const MIN_COS_NORMALS: f32 = 0.9;

/// How an estimate is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gather {
    /// How many of the nearest photons are used, if so many are close enough; at least 2, since the farthest of them
    /// only tells the radius.
    pub k: usize,
    /// The largest distance of a photon, in world units; not negative.
    pub max_radius: f32,
    /// The weight of a photon by its distance.
    pub kernel: Kernel,
}

/// Irradiance from the photons around a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Irradiance.
    pub irradiance: Rgb,
    /// The radius of the kernel, in world units: the distance of photon `k`, or the largest allowed.
    pub radius: f32,
    /// Photons that lie within the radius and on the same surface.
    pub found: usize,
    /// Photons whose distance was computed.
    pub visited: usize,
}

/// Memory that estimates reuse; one a thread.
#[derive(Debug, Default)]
pub struct Scratch {
    candidates: Candidates,
    /// Room to look for the `k`-th.
    ordered: Vec<u32>,
}

/// Photons within some distance, in the order of the walk.
#[derive(Debug, Default)]
struct Candidates {
    /// Squared distances.
    dist2: Vec<f32>,
    indices: Vec<u32>,
}

impl PhotonSet {
    /// Irradiance at `point` of a surface with unit normal `normal` on the side of interest.
    ///
    /// The radius is the distance of the `k`-th photon, whose own weight is left out: given that distance, the other
    /// `k - 1` are spread as without it, so their sum over the area is unbiased on a uniform field (no factor
    /// `k / (k - 1)`). Where fewer than `k` lie within the largest radius, that radius is used for all of them.
    ///
    /// `guess` is a distance within which about `k` photons are expected; it only changes how long the search takes.
    ///
    /// # Panics
    /// When `k` is below 2.
    pub fn irradiance(
        &self,
        point: Vec3A,
        normal: Vec3A,
        gather: &Gather,
        guess: Option<f32>,
        scratch: &mut Scratch,
    ) -> Estimate {
        assert!(gather.k >= 2, "k is {}: an estimate needs two photons", gather.k);
        let mut visited = 0;
        // From a guess of nothing the search would never grow.
        let guess = guess.filter(|radius| *radius >= f32::MIN_POSITIVE);
        let mut search =
            guess.unwrap_or_else(|| self.guess_radius(point, gather.k)).min(gather.max_radius);
        loop {
            visited += self.collect(point, normal, search * search, gather.k, scratch);
            if scratch.candidates.len() >= gather.k || search >= gather.max_radius {
                break;
            }
            // Twice the photons that are missing, if they lie as densely as those found.
            let found = scratch.candidates.len().max(1) as f32;
            let growth = (2.0 * gather.k as f32 / found).sqrt().clamp(1.2, 4.0);
            search = (search * growth).min(gather.max_radius);
        }
        let Scratch { candidates: Candidates { dist2, indices }, ordered } = scratch;
        let full = dist2.len() >= gather.k;
        let radius2 = match full {
            true => kth_smallest(dist2, gather.k, ordered),
            false => gather.max_radius * gather.max_radius,
        };
        let (mut sum, mut found) = self.sum(dist2, indices, radius2, gather.kernel);
        // Photons at exactly the same distance as number k: the sum above has left out more than one.
        if full && found + 1 < gather.k {
            let rim = dist2.iter().zip(indices).filter(|(d, _)| **d == radius2);
            let rim = rim.take(gather.k - 1 - found).map(|(_, i)| self.flux_of(*i as usize));
            sum += rim.sum::<Rgb>() * gather.kernel.weight(1.0);
            found = gather.k - 1;
        }
        Estimate {
            irradiance: density(sum, radius2),
            radius: radius2.sqrt(),
            found: found + usize::from(full),
            visited,
        }
    }

    /// Irradiance from all photons within `radius`.
    pub fn irradiance_within(
        &self,
        point: Vec3A,
        normal: Vec3A,
        radius: f32,
        kernel: Kernel,
    ) -> Estimate {
        let radius2 = radius * radius;
        let (mut sum, mut found) = (Rgb::BLACK, 0);
        let visited = self.accept(point, normal, radius2, |dist2, indices| {
            let (more, n) = self.sum(dist2, indices, radius2, kernel);
            sum += more;
            found += n;
            None
        });
        Estimate { irradiance: density(sum, radius2), radius, found, visited }
    }

    /// The photons that the estimate counts, as indices with squared distances in ascending order of both.
    pub fn nearest(
        &self,
        point: Vec3A,
        normal: Vec3A,
        k: usize,
        max_radius: f32,
    ) -> Vec<(f32, u32)> {
        let mut all = Vec::new();
        self.accept(point, normal, max_radius * max_radius, |dist2, indices| {
            all.extend(dist2.iter().copied().zip(indices.iter().copied()));
            None
        });
        all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        all.truncate(k);
        all
    }

    /// Collects the candidates within a distance, or at least the nearest `k` of them, in the order of the walk.
    fn collect(
        &self,
        point: Vec3A,
        normal: Vec3A,
        bound2: f32,
        k: usize,
        scratch: &mut Scratch,
    ) -> usize {
        let Scratch { candidates, ordered } = scratch;
        candidates.keep(|_| false);
        let mut full = 3 * k + 4 * LEAF;
        self.accept(point, normal, bound2, |dist2, indices| {
            candidates.dist2.extend_from_slice(dist2);
            candidates.indices.extend_from_slice(indices);
            (candidates.len() >= full).then(|| {
                // Too many: keep those within the distance of number k.
                let bound2 = kth_smallest(&candidates.dist2, k, ordered);
                candidates.keep(|dist2| dist2 <= bound2);
                full = full.max(2 * candidates.len());
                bound2
            })
        })
    }

    /// Calls `found` with the squared distances and indices of the photons of this surface within a distance, leaf by leaf;
    /// it may answer with a smaller one. Answers how many photons were looked at.
    #[inline(always)]
    fn accept(
        &self,
        point: Vec3A,
        normal: Vec3A,
        bound2: f32,
        mut found: impl FnMut(&[f32], &[u32]) -> Option<f32>,
    ) -> usize {
        let (boxes, leaves) = (&*self.boxes, &*self.leaves);
        let (mut near, mut indices) = ([0.0_f32; LEAF], [0_u32; LEAF]);
        let is_facing = |code| decode_octahedral(code).dot(normal) > MIN_COS_NORMALS;
        // Neighbors mostly share their normal.
        let mut last = (0, is_facing(0));
        let mut visited = 0;
        self.walk(point, bound2, |leaf, bound2| {
            let first = leaf * LEAF;
            let n = LEAF.min(self.n - first);
            visited += n;
            let dist2 = boxes[leaf].distances(&leaves[leaf], point, normal);
            let normals = &leaves[leaf].normals;
            // Each photon is written, and overwritten by the next unless it counts: a branch would be mispredicted every
            // other time. The remainders spare the bounds checks.
            let mut n_near = 0;
            for (lane, &dist2) in dist2[..n].iter().enumerate() {
                near[n_near % LEAF] = dist2;
                indices[n_near % LEAF] = lane as u32;
                n_near += usize::from(dist2 <= bound2);
            }
            let mut n_found = 0;
            for i in 0..n_near {
                let lane = indices[i];
                let code = normals[lane as usize % LEAF];
                if code != last.0 {
                    last = (code, is_facing(code));
                }
                near[n_found % LEAF] = near[i];
                indices[n_found % LEAF] = first as u32 + lane;
                n_found += usize::from(last.1);
            }
            let smaller =
                if n_found > 0 { found(&near[..n_found], &indices[..n_found]) } else { None };
            smaller.unwrap_or(bound2)
        });
        visited
    }

    /// The sum of the flux of the photons within a radius, weighted by the kernel, and their number.
    fn sum(&self, dist2: &[f32], indices: &[u32], radius2: f32, kernel: Kernel) -> (Rgb, usize) {
        // The kernel is chosen outside the loop.
        match kernel {
            Kernel::Box => self.sum_by(dist2, indices, radius2, |x2| Kernel::Box.weight(x2)),
            Kernel::Cone => self.sum_by(dist2, indices, radius2, |x2| Kernel::Cone.weight(x2)),
            Kernel::Epanechnikov => {
                self.sum_by(dist2, indices, radius2, |x2| Kernel::Epanechnikov.weight(x2))
            }
            Kernel::Biweight => {
                self.sum_by(dist2, indices, radius2, |x2| Kernel::Biweight.weight(x2))
            }
        }
    }

    #[inline(always)]
    fn sum_by(
        &self,
        dist2: &[f32],
        indices: &[u32],
        radius2: f32,
        weight: impl Fn(f32) -> f32,
    ) -> (Rgb, usize) {
        let leaves = &*self.leaves;
        let (mut sum, mut n) = (Rgb::BLACK, 0);
        for (&dist2, &i) in dist2.iter().zip(indices) {
            let i = i as usize;
            let is_inside = dist2 < radius2;
            // Those outside add exactly nothing, so that the sum doesn't depend on which of them were found.
            let weight = if is_inside { weight(dist2 / radius2) } else { 0.0 };
            sum += flux::unpack(leaves[i / LEAF].flux[i % LEAF]) * weight;
            n += usize::from(is_inside);
        }
        (sum * self.flux_scale, n)
    }

    /// A radius within which `k` photons are likely, from the leaf that the point falls into.
    fn guess_radius(&self, point: Vec3A, k: usize) -> f32 {
        let mut extent2 = 0.0;
        self.walk(point, f32::INFINITY, |leaf, _| {
            let step = self.boxes[leaf].step;
            extent2 = step.iter().map(|s| (s * 65535.0) * (s * 65535.0)).sum();
            // Stops the walk.
            -1.0
        });
        // A leaf on a surface is about a rectangle: its diagonal squared is two or more times its area.
        let area_per_photon = 0.5 * extent2 / LEAF as f32;
        let radius2 = 1.5 * k as f32 * area_per_photon / PI;
        if radius2 > 0.0 { radius2.sqrt() } else { f32::INFINITY }
    }
}

impl Candidates {
    fn len(&self) -> usize {
        self.dist2.len()
    }

    /// Keeps those whose squared distance passes, in their order.
    fn keep(&mut self, passes: impl Fn(f32) -> bool) {
        let Self { dist2, indices } = self;
        let mut n = 0;
        for i in 0..dist2.len() {
            (dist2[n], indices[n]) = (dist2[i], indices[i]);
            n += usize::from(passes(dist2[i]));
        }
        dist2.truncate(n);
        indices.truncate(n);
    }
}

/// A sum of weighted flux over the square of the kernel's radius; nothing where photons coincide and that is 0.
fn density(sum: Rgb, radius2: f32) -> Rgb {
    if radius2 > 0.0 { sum / radius2 } else { Rgb::BLACK }
}

/// The `k`-th smallest squared distance.
fn kth_smallest(dist2: &[f32], k: usize, ordered: &mut Vec<u32>) -> f32 {
    ordered.clear();
    // Numbers that aren't negative have the order of their bits, which are compared faster.
    ordered.extend(dist2.iter().map(|d| d.to_bits()));
    f32::from_bits(*ordered.select_nth_unstable(k - 1).1)
}
