//! Density estimates: from photons to irradiance.

use base::{Rgb, decode_octahedral, math::PI};
use glam::Vec3A;

use crate::leaf::{Counted, MIN_COS_NORMALS, Surface};
use crate::set::{LEAF, PhotonSet};
use crate::sum::Sum;
use crate::{Kernel, leaf};

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
    /// As packed.
    flux: Vec<u32>,
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
        self.irradiance_of_sheet(point, normal, f32::INFINITY, gather, guess, scratch)
    }

    /// The same from photons that lie no more than `height`, in world units, above or below the surface alone.
    ///
    /// # Panics
    /// When `k` is below 2.
    pub fn irradiance_of_sheet(
        &self,
        point: Vec3A,
        normal: Vec3A,
        height: f32,
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
            visited += self.collect((point, normal, height), search * search, gather.k, scratch);
            if scratch.candidates.len() >= gather.k || search >= gather.max_radius {
                break;
            }
            // A third more photons than are wanted, if they lie as densely as those found.
            let found = scratch.candidates.len().max(1) as f32;
            let growth = (1.3 * gather.k as f32 / found).sqrt().clamp(1.05, 4.0);
            search = (search * growth).min(gather.max_radius);
        }
        let Scratch { candidates, ordered } = scratch;
        let full = candidates.len() >= gather.k;
        let radius2 = match full {
            true => kth_smallest(&candidates.dist2, gather.k, ordered),
            false => gather.max_radius * gather.max_radius,
        };
        // Only photons inside count, and of those at exactly the distance of number k as many as are missing.
        let n_inside = candidates.dist2.iter().filter(|dist2| **dist2 < radius2).count();
        let mut missing = if full { gather.k - 1 - n_inside } else { 0 };
        candidates.keep(|dist2| {
            let is_taken = dist2 == radius2 && missing > 0;
            missing -= usize::from(is_taken);
            (dist2 < radius2) | is_taken
        });
        let mut sum = Sum::default();
        sum.add(&candidates.dist2, &candidates.flux, radius2, gather.kernel);
        Estimate {
            irradiance: self.density(&sum, radius2),
            radius: radius2.sqrt(),
            found: candidates.len() + usize::from(full),
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
        let (mut sum, mut found) = (Sum::default(), 0);
        let visited =
            self.accept((point, normal, f32::INFINITY), radius2.next_down(), |_, photons| {
                sum.add(photons.dist2(), photons.flux(), radius2, kernel);
                found += photons.dist2().len();
                None
            });
        Estimate { irradiance: self.density(&sum, radius2), radius, found, visited }
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
        self.accept((point, normal, f32::INFINITY), max_radius * max_radius, |leaf, photons| {
            let indices = photons.lanes().map(|lane| (leaf * LEAF + lane) as u32);
            all.extend(photons.dist2().iter().copied().zip(indices));
            None
        });
        all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        all.truncate(k);
        all
    }

    /// Calls `f` for each photon that an estimate within `radius` counts, with its squared distance and its number.
    /// None may lie more than `height` above or below the surface. Answers how many photons were looked at.
    pub fn each_within(
        &self,
        point: Vec3A,
        normal: Vec3A,
        height: f32,
        radius: f32,
        mut f: impl FnMut(f32, usize),
    ) -> usize {
        self.accept((point, normal, height), (radius * radius).next_down(), |leaf, photons| {
            for (&dist2, lane) in photons.dist2().iter().zip(photons.lanes()) {
                f(dist2, leaf * LEAF + lane);
            }
            None
        })
    }

    /// The nearest photon that the estimate counts, if one lies nearer than `max_radius`.
    pub fn nearest_one(&self, point: Vec3A, normal: Vec3A, max_radius: f32) -> Option<usize> {
        let mut found = None;
        self.walk(point, max_radius * max_radius, |leaf, mut bound2| {
            let n = LEAF.min(self.n - leaf * LEAF);
            let dist2 =
                self.boxes[leaf].distances(&self.leaves[leaf], point, normal, f32::INFINITY);
            for (lane, &dist2) in dist2[..n].iter().enumerate() {
                let is_facing = || {
                    let code = self.leaves[leaf].normals[lane];
                    decode_octahedral(code).dot(normal) > MIN_COS_NORMALS
                };
                if dist2 < bound2 && is_facing() {
                    (bound2, found) = (dist2, Some(leaf * LEAF + lane));
                }
            }
            bound2
        });
        found
    }

    /// Collects the candidates within a distance, or at least the nearest `k` of them, in the order of the walk.
    fn collect(
        &self,
        place: (Vec3A, Vec3A, f32),
        bound2: f32,
        k: usize,
        scratch: &mut Scratch,
    ) -> usize {
        let Scratch { candidates, ordered } = scratch;
        candidates.keep(|_| false);
        let mut full = 3 * k + 4 * LEAF;
        self.accept(place, bound2, |_, photons| {
            candidates.dist2.extend_from_slice(photons.dist2());
            candidates.flux.extend_from_slice(photons.flux());
            (candidates.len() >= full).then(|| {
                // Too many: keep those within the distance of number k.
                let bound2 = kth_smallest(&candidates.dist2, k, ordered);
                candidates.keep(|dist2| dist2 <= bound2);
                full = full.max(2 * candidates.len());
                bound2
            })
        })
    }

    /// Calls `found` for each leaf with photons of the surface at a place, given by point, normal and how high photons may
    /// lie, within a distance; it may answer with a smaller distance. Answers how many photons were looked at.
    #[inline(always)]
    fn accept(
        &self,
        (point, normal, height): (Vec3A, Vec3A, f32),
        bound2: f32,
        mut found: impl FnMut(usize, &Counted) -> Option<f32>,
    ) -> usize {
        let (boxes, leaves) = (&*self.boxes, &*self.leaves);
        let (mut surface, mut counted) = (Surface::new(point, normal, height), Counted::new());
        let (mut visited, mut bound2) = (0, bound2);
        let mut look = |leaf: usize, bound2: f32| {
            let n = LEAF.min(self.n - leaf * LEAF);
            visited += n;
            surface.count((&boxes[leaf], &leaves[leaf]), n, bound2, &mut counted);
            let smaller = if counted.dist2().is_empty() { None } else { found(leaf, &counted) };
            smaller.unwrap_or(bound2)
        };
        // A leaf is on its way from memory while the one before is looked at.
        let mut coming = None;
        self.walk(point, bound2, |leaf, _| {
            leaf::prefetch(&leaves[leaf]);
            if let Some(leaf) = coming.replace(leaf) {
                bound2 = look(leaf, bound2);
            }
            bound2
        });
        if let Some(leaf) = coming {
            look(leaf, bound2);
        }
        visited
    }

    /// Irradiance from a sum over a kernel; nothing where photons coincide and its radius is 0.
    fn density(&self, sum: &Sum, radius2: f32) -> Rgb {
        if radius2 > 0.0 { sum.total() * self.flux_scale / radius2 } else { Rgb::BLACK }
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
    fn keep(&mut self, mut passes: impl FnMut(f32) -> bool) {
        let Self { dist2, flux } = self;
        let mut n = 0;
        for i in 0..dist2.len().min(flux.len()) {
            let (d, f) = (dist2[i], flux[i]);
            (dist2[n], flux[n]) = (d, f);
            n += usize::from(passes(d));
        }
        dist2.truncate(n);
        flux.truncate(n);
    }
}

/// The `k`-th smallest squared distance.
fn kth_smallest(dist2: &[f32], k: usize, ordered: &mut Vec<u32>) -> f32 {
    ordered.clear();
    // Numbers that aren't negative have the order of their bits, which are compared faster.
    ordered.extend(dist2.iter().map(|d| d.to_bits()));
    f32::from_bits(*ordered.select_nth_unstable(k - 1).1)
}
