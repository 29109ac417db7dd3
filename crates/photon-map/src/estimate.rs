//! Density estimates: from photons to irradiance.

use base::{Rgb, decode_octahedral, math::PI};
use glam::Vec3A;

use crate::Kernel;
use crate::set::{LEAF, PhotonSet};
use crate::traverse::LeafView;

/// A photon counts for a surface only if its normal is within this cosine of the surface's (26 degrees): photons from
/// the other side of a thin wall, or from around a corner, don't.
const MIN_COS_NORMALS: f32 = 0.9;

/// ... and only if the line to it rises from the surface by less than this sine (14.5 degrees), so that a step or a
/// parallel surface close by doesn't count, whatever its scale.
const MAX_SINE_HEIGHT: f32 = 0.25;

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
    /// Squared distance and index of each candidate, in the order of the walk.
    candidates: Vec<(f32, u32)>,
    distances: Vec<f32>,
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
        let candidates = &scratch.candidates;
        let limit2 = gather.max_radius * gather.max_radius;
        let radius2 = if candidates.len() >= gather.k {
            kth_smallest(candidates, gather.k, &mut scratch.distances)
        } else {
            limit2
        };
        let full = candidates.len() >= gather.k;
        let mut sum = Rgb::BLACK;
        let mut found = 0;
        for &(dist2, i) in candidates {
            if dist2 < radius2 {
                sum += self.flux_of(i as usize) * gather.kernel.weight(dist2 / radius2);
                found += 1;
            }
        }
        // Photons at exactly the same distance as number k: the sum above has left out more than one.
        if full && found + 1 < gather.k {
            let rim = gather.k - 1 - found;
            let on_rim = candidates.iter().filter(|c| c.0 == radius2).take(rim);
            sum += on_rim.map(|c| self.flux_of(c.1 as usize) * gather.kernel.weight(1.0)).sum();
        }
        Estimate {
            irradiance: density(sum, radius2),
            radius: radius2.sqrt(),
            found: if full { gather.k } else { found },
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
        let mut sum = Rgb::BLACK;
        let (mut found, mut visited) = (0, 0);
        self.accept(
            point,
            normal,
            radius2,
            |dist2, i| {
                if dist2 < radius2 {
                    sum += self.flux_of(i as usize) * kernel.weight(dist2 / radius2);
                    found += 1;
                }
                None
            },
            &mut visited,
        );
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
        self.accept(
            point,
            normal,
            max_radius * max_radius,
            |dist2, i| {
                all.push((dist2, i));
                None
            },
            &mut 0,
        );
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
        let Scratch { candidates, distances } = scratch;
        candidates.clear();
        let mut visited = 0;
        let mut full = 3 * k + 4 * LEAF;
        self.accept(
            point,
            normal,
            bound2,
            |dist2, i| {
                candidates.push((dist2, i));
                if candidates.len() < full {
                    return None;
                }
                // Too many: keep those within the distance of number k, in their order.
                let bound2 = kth_smallest(candidates, k, distances);
                candidates.retain(|c| c.0 <= bound2);
                full = full.max(2 * candidates.len());
                Some(bound2)
            },
            &mut visited,
        );
        visited
    }

    /// Calls `found` for each photon of this surface within a distance; it may answer with a smaller one.
    #[inline(always)]
    fn accept(
        &self,
        point: Vec3A,
        normal: Vec3A,
        bound2: f32,
        mut found: impl FnMut(f32, u32) -> Option<f32>,
        visited: &mut usize,
    ) {
        let (leaves, positions, normals) = (&*self.leaves, &*self.positions, &*self.normals);
        let mut view = LeafView::new();
        // Neighbours mostly share their normal.
        let mut last = (0_u16, decode_octahedral(0).dot(normal) > MIN_COS_NORMALS);
        self.walk(point, bound2, |leaf, mut bound2| {
            leaves[leaf].view(&positions[leaf * 3 * LEAF..], point, normal, &mut view);
            let first = leaf * LEAF;
            let normals = &normals[first..self.n.min(first + LEAF)];
            *visited += normals.len();
            for (lane, &code) in normals.iter().enumerate() {
                let (dist2, height) = (view.dist2[lane], view.height[lane]);
                let flat = height * height <= dist2 * (MAX_SINE_HEIGHT * MAX_SINE_HEIGHT);
                if dist2 <= bound2 && flat {
                    if code != last.0 {
                        last = (code, decode_octahedral(code).dot(normal) > MIN_COS_NORMALS);
                    }
                    if last.1
                        && let Some(smaller) = found(dist2, (first + lane) as u32)
                    {
                        bound2 = smaller;
                    }
                }
            }
            bound2
        });
    }

    /// A radius within which `k` photons are likely, from the leaf that the point falls into.
    fn guess_radius(&self, point: Vec3A, k: usize) -> f32 {
        let mut extent2 = 0.0;
        self.walk(point, f32::INFINITY, |leaf, _| {
            let step = self.leaves[leaf].step;
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

/// A sum of weighted flux over the square of the kernel's radius; nothing where photons coincide and that is 0.
fn density(sum: Rgb, radius2: f32) -> Rgb {
    if radius2 > 0.0 { sum / radius2 } else { Rgb::BLACK }
}

/// The `k`-th smallest squared distance.
fn kth_smallest(candidates: &[(f32, u32)], k: usize, scratch: &mut Vec<f32>) -> f32 {
    scratch.clear();
    scratch.extend(candidates.iter().map(|c| c.0));
    *scratch.select_nth_unstable_by(k - 1, f32::total_cmp).1
}
