//! Chains of subpixels between the pixels whose chains were followed.

use std::ops::{ControlFlow, Range};

use base::{Interrupted, Pixel, Rgb};
use cache_map::{Reason, Records, Rule, Tolerance, same_surface};
use glam::Vec3A;
use shade::{ChainEmission, Path};

use super::{Ends, Finished, Leaf, LeafRule, Leaves, follow, look_up};
use crate::adaptive::cells::{Cells, Corners};
use crate::adaptive::records::Saved;
use crate::adaptive::{Account, View};

/// What each pixel shows by chains, once all is known.
pub(crate) struct ByPixel {
    /// Leaves, those of a pixel by path. Where those of a pixel begin, and at last the number of all.
    first: Vec<u32>,
    leaves: Vec<u32>,
    /// Radiance by branches that carry little.
    faint: Vec<Rgb>,
    /// Luminance of the brightest emitters that a pixel, or one beside it, shows by such branches.
    highlight: Vec<f32>,
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

    /// Whether a pixel, or one beside it, shows emitters by branches that carry little, so that they are seen beside so much
    /// luminance. Such a highlight is often smaller than a pixel, and no pixel tells of it.
    pub(crate) fn has_highlight(&self, pixel: usize, shown: f32) -> bool {
        self.highlight[pixel] > HIGHLIGHT * shown
    }

    pub(crate) fn has_glossy(&self, pixel: usize) -> bool {
        self.is_glossy.get(pixel) == Some(&true)
    }
}

/// The chains of a subpixel that are to be followed.
#[derive(Clone, Debug)]
pub(crate) struct Chain {
    pub(crate) pixel: Pixel,
    /// What comes by branches that carry little, if that is known.
    pub(crate) faint: Option<Rgb>,
    /// Of all paths of which is known what comes by them, its own.
    pub(crate) known: Range<usize>,
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

/// Emitters that are so much of what a pixel shows are seen.
const HIGHLIGHT: f32 = 0.1;

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
        let mut highlight = vec![0.0_f32; n_pixels];
        let size = self.emitted.size();
        for &(Pixel { x, y }, ChainEmission { faint: part, .. }) in &self.emissions {
            for y in y.saturating_sub(1)..(y + 2).min(size.height) {
                for x in x.saturating_sub(1)..(x + 2).min(size.width) {
                    let brightest = &mut highlight[size.index(Pixel { x, y })];
                    *brightest = brightest.max(part.luminance());
                }
            }
        }
        for (leaf, &irradiance) in self.leaves.iter().zip(&self.irradiance) {
            if leaf.is_faint {
                faint[leaf.pixel as usize] += leaf.weight * irradiance;
            }
        }
        ByPixel { first, leaves, faint, highlight, is_lit, is_glossy }
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
        let shown = self.radiance[a].luminance();
        let is_lit = |i: usize| by_pixel.is_lit[i] || by_pixel.has_highlight(i, shown);
        if is_lit(a) || is_lit(b) {
            return false;
        }
        if a == b {
            return true;
        }
        let differ = |_, is_little| match is_little {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        };
        self.compare(by_pixel, emitters, tolerance, a, b, differ).is_continue()
    }

    /// What comes by some paths where the corners around a subpixel agree on these, and others alone differ.
    ///
    /// Paths that begin as any does of which the corners differ, or that some of them lack, aren't told: where they part, the
    /// subpixel may see a lamp that no corner sees. Nor does radiance that differs by more than `most`.
    pub(crate) fn tell(
        &self,
        by_pixel: &ByPixel,
        emitters: &[(Vec3A, f32)],
        tolerance: f32,
        corners: &Corners,
        most: f32,
        known: &mut Vec<(Path, Rgb)>,
    ) {
        if corners.iter().any(|(i, _)| by_pixel.is_lit[i]) {
            return;
        }
        let bright = |pixel: usize| {
            let all = by_pixel.of(pixel).iter().map(|&i| i as usize);
            all.filter(|&i| !self.leaves[i].is_faint)
        };
        let is_told = |i: usize| self.leaves[i].path.is_told();
        if !corners.iter().all(|(pixel, _)| bright(pixel).all(is_told)) {
            return;
        }
        let mut differing = Vec::new();
        let first = corners.first();
        for (other, _) in corners.iter().skip(1) {
            let differ = |path, _| {
                differing.push(path);
                ControlFlow::Continue(())
            };
            let _ = self.compare(by_pixel, emitters, tolerance, first, other, differ);
        }
        let begin = known.len();
        for i in bright(first) {
            let Some(start) = self.leaves[i].path.apart_from(&differing) else { continue };
            if known[begin..].iter().any(|known| known.0 == start) {
                continue;
            }
            let brought = |pixel: usize| -> Rgb {
                let all = bright(pixel).filter(|&i| self.leaves[i].path.may_begin_with(start));
                all.map(|i| self.leaves[i].weight * self.irradiance[i]).sum()
            };
            if corners.span(brought) <= most {
                known.push((start, corners.blend(brought)));
            }
        }
    }

    /// Calls `differ` for the paths of two pixels by which not the same comes from the same surfaces, or that one of them lacks,
    /// until it has seen enough. It is told whether so little comes by a path that is lacking that this doesn't matter.
    fn compare(
        &self,
        by_pixel: &ByPixel,
        emitters: &[(Vec3A, f32)],
        tolerance: f32,
        a: usize,
        b: usize,
        mut differ: impl FnMut(Path, bool) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let most = tolerance * self.radiance[a].luminance();
        let reach = self.around.reach();
        let brought = |&i: &u32| {
            let leaf = &self.leaves[i as usize];
            (leaf, (leaf.weight * self.irradiance[i as usize]).luminance())
        };
        // Whether there is an end of a branch that carries little is up to chance.
        let lacks = |(leaf, radiance): (&Leaf, f32)| {
            (!leaf.is_faint).then_some((leaf.path, radiance <= most))
        };
        let mut others = by_pixel.of(b).iter().map(brought).peekable();
        for one in by_pixel.of(a).iter().map(brought) {
            while let Some(other) = others.next_if(|other| other.0.path < one.0.path) {
                if let Some((path, is_little)) = lacks(other) {
                    differ(path, is_little)?;
                }
            }
            let Some(other) = others.next_if(|other| other.0.path == one.0.path) else {
                if let Some((path, is_little)) = lacks(one) {
                    differ(path, is_little)?;
                }
                continue;
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
                differ(leaf.path, false)?;
            }
        }
        others.filter_map(lacks).try_for_each(|(path, is_little)| differ(path, is_little))
    }

    /// Follows the chains of subpixels between the pixels that these leaves are of, but by paths of which it is known what comes
    /// by them. What isn't in view is told by the ends of the
    /// same path around, by all ends that were computed before, or computed.
    #[expect(
        clippy::too_many_arguments,
        reason = "where chains begin, and all that tells of their ends"
    )]
    pub(crate) fn between(
        &mut self,
        by_pixel: &ByPixel,
        pixels: &[Chain],
        known: &[(Path, Rgb)],
        cells: Cells,
        view: &View,
        finished: &Finished,
        tolerance: Tolerance,
        account: &mut Account<'_, '_>,
    ) -> Result<Vec<Followed>, Interrupted> {
        let frame = account.frame;
        let size = frame.size();
        let chains = follow(
            pixels,
            |chain| (chain.pixel, chain.faint.is_some().then(|| &known[chain.known.clone()])),
            account,
        )?;
        let ends = || chains.iter().flat_map(|c| &c.1);
        let leaves: Vec<Leaf> = ends().copied().collect();
        let found = account.overhead(&leaves, |leaf, _| look_up(&leaf.site, view, finished))?;
        let mut of_pixel = vec![0.0; size.n_pixels()];
        let emissions = || chains.iter().flat_map(|c| &c.0).zip(pixels);
        for ((pixel, emission, _), Chain { faint, .. }) in emissions() {
            of_pixel[size.index(*pixel)] = (emission.all + faint.unwrap_or_default()).luminance();
        }
        for (leaf, found) in leaves.iter().zip(&found) {
            of_pixel[leaf.pixel as usize] += found.map_or(0.0, |e| (leaf.weight * e).luminance());
        }
        let rule = LeafRule::new(&leaves, &of_pixel, view, finished);
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
        let followed = emissions().map(|(&(pixel, emission, is_glossy), Chain { faint, .. })| {
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
