//! The ends of specular chains.
//!
//! Irradiance doesn't depend on who looks: an end that the eye sees directly as well is looked up in the finished
//! primary view. The others form pictures of their own, one for each sequence of reflections and transmissions (what a
//! mirror shows, what is seen through two sides of a glass ...), which are refined like the primary view.

mod between;

use std::collections::BTreeMap;

use base::{Component, Grid, ImageSize, Interrupted, Pixel, Rgb, math::FRAC_1_PI};
use cache_map::{
    Lattice, Layer, Nearby, Reason, RecordPoint, Records, Rule, SurfacePoint, Tolerance, refine,
    same_surface,
};
use geometry::Surface;
use glam::Vec2;
use rayon::prelude::*;
use scene::Material;
use shade::{ChainEmission, ChainLeaf, Path, Work};

use super::around::{Around, Known};
use super::caustic::Caustic;
use super::direct::Direct;
use super::indirect::Indirect;
use super::records::{CLOSE, Place, Saved, Source};
use super::{Account, View};
use crate::frame::Frame;

pub(super) use between::{ByPixel, Chain};

/// The widest spacing in the picture of a path.
const COARSEST: u32 = 8;

/// Paths seen in fewer pixels are traced.
const FEWEST: usize = 64;

/// Other ends may be farther away than neighbors on a lattice, and must agree the better: to this part of the tolerance.
const FROM_AFAR: f32 = 0.5;

/// Pixels whose chains are followed together.
const TOGETHER: usize = 16;

/// Branches that carry less than this are seen alike by what lies in a cell.
const FAINT: f32 = 0.01;

/// A diffuse surface at the end of a chain. There are more of them than pixels, and few are computed: those are found
/// again by their pixel and path, so that this is small.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    path: Path,
    pixel: u32,
    is_faint: bool,
    /// What is left on the way to the eye, times albedo over pi.
    weight: Rgb,
    site: SurfacePoint,
}

impl Leaf {
    /// Follows the path again to its end, for so many shadow rays to each light.
    fn irradiance(&self, frame: &Frame<'_>, rays: u32, work: &mut Work) -> Rgb {
        let shader = frame.shader();
        frame.at(frame.size().pixel(self.pixel as usize), work, |point, stream, work| {
            let end = shader.chain_end(point, stream, self.path, work);
            end.map_or(Rgb::BLACK, |leaf| {
                shader.irradiance_by(&leaf.point.facing, leaf.stream, rays, work)
            })
        })
    }
}

pub(super) fn site_of(surface: &Surface) -> SurfacePoint {
    SurfacePoint { position: surface.position.into(), normal: surface.shading_normal.into() }
}

/// What is known of the diffuse surfaces of the primary view.
pub(crate) struct Finished {
    /// Irradiance of all light, in one place: it is looked up where chains end, in no order.
    irradiance: Vec<Rgb>,
    /// Radiance below which errors don't show.
    pub(crate) floor: f32,
}

impl Finished {
    /// Sums up the components as they are now.
    pub(crate) fn new(direct: &Direct, indirect: &Indirect, caustic: &Caustic, n: usize) -> Self {
        let of = |i| direct.irradiance(i) + indirect.irradiance(i) + caustic.irradiance(i);
        let irradiance = (0..n).into_par_iter().with_min_len(4096).map(of).collect();
        Self { irradiance, floor: indirect.floor() }
    }
}

/// The specular chains of a picture that begin sharply.
#[derive(Debug)]
pub(crate) struct Leaves {
    /// Sorted by path; those of a path in the order in which pixels are visited.
    leaves: Vec<Leaf>,
    /// Irradiance at the leaves that were traced, and why.
    traced: Vec<Option<(Rgb, Reason)>>,
    /// What surfaces emit and what lies beyond the scene, by pixel.
    emitted: Grid<Rgb>,
    /// The same of the pixels where there is any, as chains tell it.
    emissions: Vec<(Pixel, ChainEmission)>,
    /// Irradiance at all leaves, and radiance of all pixels, once that is known.
    irradiance: Vec<Rgb>,
    radiance: Vec<Rgb>,
    /// The pixels whose chains have glossy ends, too: these ends are left to [`super::glossy`].
    glossy: Vec<Pixel>,
    source: Source<Rgb>,
    around: Around,
}

impl Leaves {
    /// Follows all chains that begin sharply.
    pub(crate) fn start(saved: &Saved, account: &mut Account<'_, '_>) -> Result<Self, Interrupted> {
        let frame = account.frame;
        let pixels: Vec<Pixel> = frame.pixels_that_show(begins_sharply).collect();
        let chains = follow(&pixels, |&pixel| (pixel, None), account)?;
        let mut emitted = Grid::from_fn(frame.size(), |_| Rgb::BLACK);
        let (mut emissions, mut glossy) = (Vec::new(), Vec::new());
        for &(pixel, emission, is_glossy) in chains.iter().flat_map(|c| &c.0) {
            emitted[pixel] = emission.all;
            emissions.extend((!emission.all.is_black()).then_some((pixel, emission)));
            glossy.extend(is_glossy.then_some(pixel));
        }
        let leaves = by_path(chains.iter().flat_map(|c| &c.1));
        let traced = vec![None; leaves.len()];
        let source = saved.source(&saved.set.leaves);
        let around = Around::new(frame.shader().scene.bounds().diagonal());
        let (irradiance, radiance) = (Vec::new(), Vec::new());
        Ok(Self {
            leaves,
            traced,
            emitted,
            emissions,
            irradiance,
            radiance,
            glossy,
            source,
            around,
        })
    }

    /// All that is known of the ends of chains, for good.
    pub(crate) fn records(&self) -> Records<Rgb> {
        let new = (0..self.leaves.len()).filter_map(|i| {
            let (value, reason) = self.traced[i]?;
            let Place { surface, pixel } = place(&self.leaves, i);
            let reach = COARSEST as f32 * pixel;
            (!reason.is_reuse()).then_some((RecordPoint { surface, reach }, value))
        });
        self.source.with_all(new.collect())
    }

    /// Whether what records around an end told counts anywhere.
    pub(crate) fn uses_nearby(&self) -> bool {
        self.traced.iter().any(|t| t.is_some_and(|t| t.1 == Reason::Nearby))
    }

    /// The pixels whose chains have glossy ends.
    pub(crate) fn glossy_pixels(&self) -> &[Pixel] {
        &self.glossy
    }

    pub(crate) fn radiance(&self, index: usize) -> Rgb {
        self.radiance[index]
    }

    /// That of all pixels.
    pub(crate) fn into_radiance(self) -> Vec<Rgb> {
        self.radiance
    }

    /// Why any leaf of a pixel was traced.
    pub(crate) fn reasons(&self) -> Vec<Reason> {
        let mut reasons = vec![Reason::Interpolated; self.emitted.values().len()];
        for (leaf, traced) in self.leaves.iter().zip(&self.traced) {
            let shown = &mut reasons[leaf.pixel as usize];
            if let Some((_, reason)) = traced
                && (*shown == Reason::Interpolated || !reason.is_reuse())
            {
                *shown = *reason;
            }
        }
        reasons
    }

    /// Finds the irradiance at every leaf and sums up the radiance of the pixels.
    pub(crate) fn resolve(
        &mut self,
        view: &View,
        finished: &Finished,
        tolerance: Tolerance,
        account: &mut Account<'_, '_>,
    ) -> Result<(), Interrupted> {
        for traced in &mut self.traced {
            traced.take_if(|t| t.1 == Reason::Nearby);
        }
        let found =
            account.overhead(&self.leaves, |leaf, _| look_up(&leaf.site, view, finished))?;
        // What is known of a pixel's radiance is what errors in the rest are measured against.
        let size = view.size();
        let mut known: Vec<f32> = self.emitted.values().iter().map(|e| e.luminance()).collect();
        for (leaf, found) in self.leaves.iter().zip(&found) {
            known[leaf.pixel as usize] += found.map_or(0.0, |e| (leaf.weight * e).luminance());
        }

        let rule = LeafRule::new(&self.leaves, &known, view, finished);
        let rays = account.frame.shader().settings.shadow_rays;
        let mut ends =
            Ends { leaves: &self.leaves, rays, source: &self.source, around: &mut self.around };
        let mut irradiance: Vec<Rgb> = found.iter().map(|f| f.unwrap_or(Rgb::BLACK)).collect();
        let mut few = Vec::new();
        let mut first = 0;
        for image in self.leaves.chunk_by(|a, b| a.path == b.path) {
            let range = first..first + image.len();
            first = range.end;
            let missing: Vec<usize> =
                range.clone().filter(|&i| found[i].is_none() && self.traced[i].is_none()).collect();
            if missing.len() < FEWEST {
                few.extend(missing);
                continue;
            }
            let image = Image::new(&self.leaves, range, size);
            let layer = image.refine(&rule, tolerance, &found, &self.traced, &mut ends, account)?;
            for (at, &leaf) in image.leaf_at.iter().enumerate().filter(|(_, leaf)| **leaf != NONE) {
                let leaf = leaf as usize;
                irradiance[leaf] = layer.values[at];
                if layer.is_traced(at) && found[leaf].is_none() {
                    self.traced[leaf] = Some((layer.values[at], layer.reasons[at]));
                }
            }
        }
        // Too few for neighbors to be compared.
        let values = ends.fill(&rule, tolerance, &few, |_| 0, account)?;
        for (&leaf, (value, reason)) in few.iter().zip(values) {
            irradiance[leaf] = value;
            let reason = reason.unwrap_or(Reason::NoNeighbours);
            if reason != Reason::Interpolated {
                self.traced[leaf] = Some((value, reason));
            }
        }

        self.radiance.clear();
        self.radiance.extend_from_slice(self.emitted.values());
        for ((leaf, traced), value) in
            self.leaves.iter().zip(&self.traced).zip(irradiance.iter_mut())
        {
            if let Some((traced, _)) = traced {
                *value = *traced;
            }
            self.radiance[leaf.pixel as usize] += leaf.weight * *value;
        }
        self.irradiance = irradiance;
        Ok(())
    }
}

/// Whether chains begin at a surface of this material in few directions, each for sure.
pub(super) fn begins_sharply(material: &Material) -> bool {
    material.is_specular() && !material.is_rough()
}

/// Some pixels with what surfaces emit along their chains and whether these have glossy ends, and the other ends.
type Chains = (Vec<(Pixel, ChainEmission, bool)>, Vec<Leaf>);

/// Follows the chains of some pixels, in groups: `of` tells the pixel, and, if the branches that carry little aren't to be
/// followed, what is known of others.
fn follow<'k, T: Sync>(
    items: &[T],
    of: impl Fn(&T) -> (Pixel, Option<&'k [(Path, Rgb)]>) + Sync,
    account: &mut Account<'_, '_>,
) -> Result<Vec<Chains>, Interrupted> {
    let frame = account.frame;
    let (size, shader) = (frame.size(), frame.shader());
    // Some pixels at a time share their vectors: one for each would be as long as chains rarely are.
    let groups: Vec<&[T]> = items.chunks(TOGETHER).collect();
    account.fleeting(Component::Specular, &groups, |group, work| {
        let (mut shown, mut leaves) = (Vec::with_capacity(group.len()), Vec::new());
        for (pixel, known) in group.iter().map(&of) {
            let mut is_glossy = false;
            let mut arrive = |leaf: ChainLeaf<'_>| {
                is_glossy |= leaf.is_glossy;
                if !leaf.is_glossy {
                    let ChainLeaf { path, is_faint, .. } = leaf;
                    let weight = leaf.weight * leaf.point.albedo * FRAC_1_PI;
                    let (pixel, site) = (size.index(pixel) as u32, site_of(&leaf.point.facing));
                    leaves.push(Leaf { path, pixel, is_faint, weight, site });
                }
            };
            let emission = frame.at(pixel, work, |point, stream, work| match known {
                None => shader.chain_by_parts(point, stream, FAINT, work, |leaf, _| arrive(leaf)),
                Some(known) => {
                    let arrive = |leaf: ChainLeaf<'_>, _: &mut Work| arrive(leaf);
                    let all = shader.bright_chain(point, stream, FAINT, known, work, arrive);
                    ChainEmission { all, faint: Rgb::BLACK }
                }
            });
            shown.push((pixel, emission, is_glossy));
        }
        (shown, leaves)
    })
}

/// Leaves by path, those of a path in the order in which they come.
fn by_path<'l>(leaves: impl Iterator<Item = &'l Leaf> + Clone) -> Vec<Leaf> {
    let Some(&any) = leaves.clone().next() else { return Vec::new() };
    // Paths get numbers in the order in which they come; neighbors often share theirs.
    let (mut numbers, mut counts) = (BTreeMap::new(), Vec::new());
    let mut last = (any.path, 0);
    numbers.insert(any.path, 0);
    counts.push(0);
    let mut of_leaves = Vec::new();
    for path in leaves.clone().map(|leaf| leaf.path) {
        if path != last.0 {
            let number = *numbers.entry(path).or_insert(counts.len());
            if number == counts.len() {
                counts.push(0);
            }
            last = (path, number);
        }
        counts[last.1] += 1;
        of_leaves.push(last.1 as u32);
    }
    // From the numbers of leaves to where the first of a path goes.
    let mut places = vec![0; counts.len()];
    let mut n = 0;
    for &number in numbers.values() {
        places[number] = n;
        n += counts[number];
    }
    let mut sorted = vec![any; n];
    for (&leaf, number) in leaves.zip(of_leaves) {
        let place = &mut places[number as usize];
        sorted[*place] = leaf;
        *place += 1;
    }
    sorted
}

/// The place of a leaf. What a pixel spans there is the distance to its neighbor in the row; 0 if it has none.
fn place(leaves: &[Leaf], index: usize) -> Place {
    let leaf = &leaves[index];
    let others = [index.wrapping_sub(1), index + 1].into_iter().filter_map(|i| leaves.get(i));
    let beside = others.filter(|o| o.path == leaf.path && o.pixel.abs_diff(leaf.pixel) == 1);
    let distances = beside.map(|o| o.site.position.distance(leaf.site.position));
    Place { surface: leaf.site, pixel: distances.reduce(f32::min).unwrap_or(0.0) }
}

/// Irradiance at the end of a chain from the four pixels around its place in the primary view, if all show its surface.
pub(super) fn look_up(site: &SurfacePoint, view: &View, finished: &Finished) -> Option<Rgb> {
    let size = view.size();
    let at = view.project(site.position.into())?;
    let low = at.floor();
    let last = Vec2::new(size.width as f32, size.height as f32) - 1.0;
    if low.cmplt(Vec2::ZERO).any() || low.cmpge(last).any() {
        return None;
    }
    let (x, y) = (low.x as u32, low.y as u32);
    let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| Pixel { x: x + dx, y: y + dy });
    // Where pixels share a surface with all around them, one stands for its neighbors.
    let asked = if view.lattice.has_no_edge_around(corners[0]) { 1 } else { 4 };
    let is_shown = |&c: &Pixel| view.sites[c].as_ref().is_some_and(|s| same_surface(s, site));
    if !corners[..asked].iter().all(is_shown) {
        return None;
    }
    let f = at - low;
    let weights = [(1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y];
    let of = |c: Pixel| finished.irradiance[size.index(c)];
    Some(corners.into_iter().zip(weights).map(|(c, weight)| of(c) * weight).sum())
}

/// Where a picture has no leaf.
const NONE: u32 = u32::MAX;

/// The picture that the leaves of one path form, cut to where it shows anything.
struct Image {
    size: ImageSize,
    /// The leaf of each pixel, or [`NONE`].
    leaf_at: Vec<u32>,
}

impl Image {
    fn new(leaves: &[Leaf], range: std::ops::Range<usize>, whole: ImageSize) -> Self {
        let pixels = || leaves[range.clone()].iter().map(|leaf| whole.pixel(leaf.pixel as usize));
        let (mut low, mut high) = (Pixel { x: u32::MAX, y: u32::MAX }, Pixel { x: 0, y: 0 });
        for p in pixels() {
            low = Pixel { x: low.x.min(p.x), y: low.y.min(p.y) };
            high = Pixel { x: high.x.max(p.x), y: high.y.max(p.y) };
        }
        let size = ImageSize { width: high.x - low.x + 1, height: high.y - low.y + 1 };
        let mut leaf_at = vec![NONE; size.n_pixels()];
        for (i, p) in range.clone().zip(pixels()) {
            leaf_at[size.index(Pixel { x: p.x - low.x, y: p.y - low.y })] = i as u32;
        }
        Self { size, leaf_at }
    }

    fn refine(
        &self,
        rule: &LeafRule<'_>,
        tolerance: Tolerance,
        found: &[Option<Rgb>],
        traced: &[Option<(Rgb, Reason)>],
        ends: &mut Ends<'_>,
        account: &mut Account<'_, '_>,
    ) -> Result<Layer<Rgb>, Interrupted> {
        let leaves = rule.leaves;
        let sites =
            self.leaf_at.iter().map(|&i| (i != NONE).then(|| leaves[i as usize].site)).collect();
        let lattice = Lattice::new(&Grid::from_values(self.size, sites), COARSEST);
        let mut layer = Layer::new(self.leaf_at.len());
        for (at, &i) in self.leaf_at.iter().enumerate().filter(|(_, i)| **i != NONE) {
            // What was looked up needs no tracing, and serves as a neighbour.
            let value =
                found[i as usize].map(|value| (value, Reason::Lattice)).or(traced[i as usize]);
            if let Some((value, reason)) = value {
                (layer.values[at], layer.reasons[at]) = (value, reason);
            }
        }
        let of_image = ImageRule { image: self, rule };
        let mut known = Vec::new();
        refine(&lattice, &mut layer, COARSEST, &of_image, tolerance, &mut |pixels: &[Pixel]| {
            let at: Vec<usize> = pixels.iter().map(|&p| self.size.index(p)).collect();
            let wanted: Vec<usize> = at.iter().map(|&at| self.leaf_at[at] as usize).collect();
            let step = |n: usize| lattice.step(at[n]).min(COARSEST);
            let values = ends.fill(rule, tolerance, &wanted, step, account)?;
            known.extend(at.iter().zip(&values).filter_map(|(&at, v)| Some((at, v.1?))));
            Ok(values.into_iter().map(|v| v.0).collect())
        })?;
        known.into_iter().for_each(|(at, reason)| layer.reasons[at] = reason);
        Ok(layer)
    }
}

/// Where irradiance at ends that aren't in view comes from.
struct Ends<'x> {
    leaves: &'x [Leaf],
    /// Shadow rays to each light where it is computed.
    rays: u32,
    source: &'x Source<Rgb>,
    around: &'x mut Around,
}

impl Ends<'_> {
    /// Irradiance at some leaves, told by others, from the records, or computed. `step` is the distance of samples around the
    /// n-th, in pixels.
    fn fill(
        &mut self,
        rule: &LeafRule<'_>,
        tolerance: Tolerance,
        wanted: &[usize],
        step: impl Fn(usize) -> u32 + Sync,
        account: &mut Account<'_, '_>,
    ) -> Result<Vec<Known>, Interrupted> {
        let &mut Self { leaves, rays, source, ref mut around } = self;
        let frame = account.frame;
        let places: Vec<_> = wanted.iter().map(|&leaf| (leaf as u32, leaves[leaf].site)).collect();
        let Tolerance { error, edge } = tolerance;
        let from_afar = Tolerance { error: FROM_AFAR * error, edge: FROM_AFAR * edge };
        let is_good = |n: usize, near: &Nearby<Rgb>| {
            near.is_within(wanted[n], f32::INFINITY, rule, from_afar)
        };
        around.fill(account, &places, is_good, |account, missing| {
            let take = |&n: &usize| {
                let (place, step) = (place(leaves, wanted[n]), step(n));
                let is_good = |near: &Nearby<Rgb>| {
                    near.is_within(wanted[n], CLOSE * step as f32 * place.pixel, rule, tolerance)
                };
                let (value, _, reason) = source.take(&place, step, is_good)?;
                Some((value, Some(reason)))
            };
            source.fill(account, missing, take, |account, missing| {
                account.items(Component::Specular, missing, |&n, work| {
                    (leaves[wanted[n]].irradiance(frame, rays, work), None)
                })
            })
        })
    }
}

/// The rule for leaves, by number.
struct LeafRule<'x> {
    leaves: &'x [Leaf],
    known: &'x [f32],
    floor: f32,
    coarsest: f32,
}

impl<'x> LeafRule<'x> {
    /// For the leaves of pixels of which so much radiance is known.
    fn new(leaves: &'x [Leaf], known: &'x [f32], view: &View, finished: &Finished) -> Self {
        let coarsest = (COARSEST / view.apart()) as f32;
        Self { leaves, known, floor: finished.floor, coarsest }
    }
}

impl Rule<Rgb> for LeafRule<'_> {
    fn gain(&self, index: usize) -> f32 {
        self.leaves[index].weight.luminance()
    }
    fn reference(&self, index: usize, predicted: Rgb) -> f32 {
        let leaf = &self.leaves[index];
        self.floor + self.known[leaf.pixel as usize] + (leaf.weight * predicted).luminance()
    }
    fn spacing(&self, _: Pixel) -> f32 {
        self.coarsest
    }
}

/// The same for the pixels of an image.
struct ImageRule<'x> {
    image: &'x Image,
    rule: &'x LeafRule<'x>,
}

impl ImageRule<'_> {
    fn leaf(&self, index: usize) -> usize {
        self.image.leaf_at[index] as usize
    }
}

impl Rule<Rgb> for ImageRule<'_> {
    fn gain(&self, index: usize) -> f32 {
        self.rule.gain(self.leaf(index))
    }
    fn reference(&self, index: usize, predicted: Rgb) -> f32 {
        self.rule.reference(self.leaf(index), predicted)
    }
    fn spacing(&self, pixel: Pixel) -> f32 {
        self.rule.spacing(pixel)
    }
}
