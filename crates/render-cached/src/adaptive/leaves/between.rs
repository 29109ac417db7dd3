//! Chains of subpixels between the pixels whose chains were followed.

use base::{Interrupted, Pixel, Rgb};
use cache_map::{Reason, Records, Rule, Tolerance, same_surface};
use glam::Vec3A;
use shade::ChainEmission;

use super::{Ends, Finished, Leaf, LeafRule, Leaves, follow, look_up};
use crate::adaptive::records::Saved;
use crate::adaptive::subpixels::Cells;
use crate::adaptive::{Account, View};

/// What each pixel shows by chains, once all is known.
pub(crate) struct ByPixel {
    /// Leaves, those of a pixel by path. Where those of a pixel begin, and at last the number of all.
    first: Vec<u32>,
    leaves: Vec<u32>,
    /// Radiance by branches that carry little.
    faint: Vec<Rgb>,
    /// Whether the other branches show what emits.
    is_lit: Vec<bool>,
    /// Whether a pixel has glossy ends, too; empty if none has.
    is_glossy: Vec<bool>,
}

impl ByPixel {
    fn of(&self, pixel: usize) -> &[u32] {
        &self.leaves[self.first[pixel] as usize..self.first[pixel + 1] as usize]
    }

    /// Radiance by branches that carry little.
    pub(crate) fn faint(&self, pixel: usize) -> Rgb {
        self.faint[pixel]
    }

    pub(crate) fn has_glossy(&self, pixel: usize) -> bool {
        self.is_glossy.get(pixel) == Some(&true)
    }
}

/// What a pixel shows whose chains were followed.
pub(crate) struct Followed {
    pub(crate) radiance: Rgb,
    /// Why an end of them was computed, if one was.
    pub(crate) reason: Reason,
    /// Whether there are glossy ends, which aren't part of the radiance.
    pub(crate) is_glossy: bool,
}

/// The fewest shadow rays of an end, if there are so many.
const FEWEST_RAYS: u32 = 16;

/// Ends of the same path that lie far apart may bring as different radiance as so many times the tolerance: what lies between
/// is wrong by a part of that.
const FAR_APART: f32 = 4.0;

impl Leaves {
    /// Sorts the leaves by their pixels.
    pub(crate) fn by_pixel(&self, n_pixels: usize) -> ByPixel {
        let mut first = vec![0; n_pixels + 1];
        for leaf in &self.leaves {
            first[leaf.pixel as usize + 1] += 1;
        }
        for i in 0..n_pixels {
            first[i + 1] += first[i];
        }
        let mut leaves = vec![0; self.leaves.len()];
        let mut next = first.clone();
        for (i, leaf) in self.leaves.iter().enumerate() {
            let place = &mut next[leaf.pixel as usize];
            leaves[*place as usize] = i as u32;
            *place += 1;
        }
        let mut is_glossy = Vec::new();
        if !self.glossy.is_empty() {
            is_glossy.resize(n_pixels, false);
            let size = self.emitted.size();
            self.glossy.iter().for_each(|&pixel| is_glossy[size.index(pixel)] = true);
        }
        let (mut faint, mut is_lit) = (vec![Rgb::BLACK; n_pixels], vec![false; n_pixels]);
        for &(pixel, ChainEmission { all, faint: part }) in &self.emissions {
            let i = self.emitted.size().index(pixel);
            (faint[i], is_lit[i]) = (part, all != part);
        }
        for (leaf, &irradiance) in self.leaves.iter().zip(&self.irradiance) {
            if leaf.is_faint {
                faint[leaf.pixel as usize] += leaf.weight * irradiance;
            }
        }
        ByPixel { first, leaves, faint, is_lit, is_glossy }
    }

    /// Whether the chains of two pixels go the same ways to the same surfaces and bring the same from there, to this part of what
    /// the pixels show, with no emitter on them or between; but for those that bring little. Emitters are given as spheres
    /// around them.
    pub(crate) fn agree(
        &self,
        by_pixel: &ByPixel,
        emitters: &[(Vec3A, f32)],
        tolerance: f32,
        a: usize,
        b: usize,
    ) -> bool {
        if by_pixel.is_lit[a] || by_pixel.is_lit[b] {
            return false;
        }
        let most = tolerance * self.radiance[a].luminance();
        let reach = self.around.reach();
        let brought = |&i: &u32| {
            let leaf = &self.leaves[i as usize];
            (leaf, (leaf.weight * self.irradiance[i as usize]).luminance())
        };
        let is_little = |(leaf, radiance): &(&Leaf, f32)| leaf.is_faint || *radiance <= most;
        let mut others = by_pixel.of(b).iter().map(brought).peekable();
        for one in by_pixel.of(a).iter().map(brought) {
            while let Some(other) = others.next_if(|other| other.0.path < one.0.path) {
                if !is_little(&other) {
                    return false;
                }
            }
            let Some(other) = others.next_if(|other| other.0.path == one.0.path) else {
                if is_little(&one) {
                    continue;
                }
                return false;
            };
            let ((leaf, radiance), (other, other_radiance)) = (one, other);
            let (p, q) = (leaf.site.position.into(), other.site.position.into());
            let (between, apart) = (Vec3A::midpoint(p, q), Vec3A::distance(p, q));
            let is_near = |&(center, radius): &(Vec3A, f32)| {
                between.distance_squared(center) < (radius + apart) * (radius + apart)
            };
            let differs = !same_surface(&leaf.site, &other.site)
                && radiance.max(other_radiance) > most
                || apart > reach && (radiance - other_radiance).abs() > FAR_APART * most;
            let is_bright = !(leaf.is_faint && other.is_faint);
            if differs || is_bright && emitters.iter().any(is_near) {
                return false;
            }
        }
        others.all(|other| is_little(&other))
    }

    /// Follows the chains of subpixels between the pixels that these leaves are of; what comes by branches that carry little is
    /// known of most. What isn't in view is told by the ends of the
    /// same path around, by all ends that were computed before, or computed.
    #[expect(
        clippy::too_many_arguments,
        reason = "where chains begin, and all that tells of their ends"
    )]
    pub(crate) fn between(
        &mut self,
        by_pixel: &ByPixel,
        pixels: &[(Pixel, Option<Rgb>)],
        cells: Cells,
        view: &View,
        finished: &Finished,
        tolerance: Tolerance,
        account: &mut Account<'_, '_>,
    ) -> Result<Vec<Followed>, Interrupted> {
        let frame = account.frame;
        let size = frame.size();
        let chains = follow(frame, pixels, |&(pixel, faint)| (pixel, faint.is_none()), account)?;
        let ends = || chains.iter().flat_map(|c| &c.1);
        let leaves: Vec<Leaf> = ends().copied().collect();
        let found = account.overhead(&leaves, |leaf, _| look_up(&leaf.site, view, finished))?;
        let mut known = vec![0.0; size.n_pixels()];
        let emissions = || chains.iter().flat_map(|c| &c.0).zip(pixels);
        for ((pixel, emission, _), (_, faint)) in emissions() {
            known[size.index(*pixel)] = (emission.all + faint.unwrap_or_default()).luminance();
        }
        for (leaf, found) in leaves.iter().zip(&found) {
            known[leaf.pixel as usize] += found.map_or(0.0, |e| (leaf.weight * e).luminance());
        }
        let rule = LeafRule::new(&leaves, &known, view, finished);
        let tell = |i: usize| {
            let leaf = &leaves[i];
            let same = |pixel: usize| {
                let mut all = by_pixel.of(pixel).iter().map(|&other| other as usize);
                all.find(|&other| {
                    let other = &self.leaves[other];
                    other.path == leaf.path && same_surface(&other.site, &leaf.site)
                })
            };
            let around = cells.around(size.pixel(leaf.pixel as usize), |p| same(p).is_some())?;
            let of = |pixel: usize| same(pixel).map_or(Rgb::BLACK, |i| self.irradiance[i]);
            let is_close = |(pixel, _): (usize, f32)| {
                same(pixel).is_some_and(|other| {
                    let other = &self.leaves[other].site;
                    other.position.distance(leaf.site.position) <= self.around.reach()
                })
            };
            let (value, span) = (around.blend(of), around.span(of));
            let is_even = rule.gain(i) * span <= tolerance.edge * rule.reference(i, value);
            (is_even && around.iter().all(is_close)).then_some(value)
        };
        let numbers: Vec<usize> = (0..leaves.len()).collect();
        let found: Vec<Option<Rgb>> =
            account.overhead(&numbers, |&i, _| found[i].or_else(|| tell(i)))?;
        let missing: Vec<usize> = numbers.into_iter().filter(|&i| found[i].is_none()).collect();
        let source = Saved::default().exact_source(&Records::default());
        // The subpixels of a pixel share the rays of one.
        let rays = frame.shader().settings.shadow_rays;
        let rays = (rays / cells.n_subpixels()).max(rays.min(FEWEST_RAYS));
        let mut ends = Ends { leaves: &leaves, rays, source: &source, around: &mut self.around };
        let computed = ends.fill(&rule, tolerance, &missing, |_| 0, account)?;

        let mut irradiance: Vec<Rgb> = found.into_iter().map(Option::unwrap_or_default).collect();
        let mut reasons = vec![Reason::Interpolated; leaves.len()];
        for (&i, (value, reason)) in missing.iter().zip(computed) {
            (irradiance[i], reasons[i]) = (value, reason.unwrap_or(Reason::NoNeighbours));
        }
        let mut all = leaves.iter().zip(irradiance).zip(reasons).peekable();
        let followed = emissions().map(|(&(pixel, emission, is_glossy), (_, faint))| {
            let pixel = size.index(pixel) as u32;
            let radiance = emission.all + faint.unwrap_or_default();
            let mut shown = Followed { radiance, reason: Reason::Interpolated, is_glossy };
            while let Some(((leaf, value), reason)) = all.next_if(|l| l.0.0.pixel == pixel) {
                shown.radiance += leaf.weight * value;
                if reason.is_traced() {
                    shown.reason = reason;
                }
            }
            shown
        });
        Ok(followed.collect())
    }
}
