//! The ends of specular chains.
//!
//! Irradiance doesn't depend on who looks: an end that the eye sees directly as well is looked up in the finished
//! primary view. The others form pictures of their own, one for each sequence of reflections and transmissions (what a
//! mirror shows, what is seen through two sides of a glass ...), which are refined like the primary view.

use std::collections::BTreeMap;

use base::{Component, Grid, ImageSize, Interrupted, Pixel, Rgb, math::FRAC_1_PI};
use cache_map::{
    Lattice, Layer, Reason, RecordPoint, Records, Rule, SurfacePoint, Tolerance, same_surface,
};
use geometry::Surface;
use glam::Vec2;
use shade::{PixelStream, Shader, Work};

use super::caustic::Caustic;
use super::direct::Direct;
use super::indirect::Indirect;
use super::records::{Place, Saved, Source};
use super::{Account, View};
use crate::frame::Frame;

/// The widest spacing in the picture of a path.
const COARSEST: u32 = 8;

/// Paths seen in fewer pixels are traced.
const FEWEST: usize = 64;

/// Pixels whose chains are followed together.
const TOGETHER: usize = 16;

/// A diffuse surface at the end of a chain.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    pixel: u32,
    path: u64,
    /// What is left on the way to the eye, times albedo over pi.
    weight: Rgb,
    surface: Surface,
    stream: PixelStream,
}

impl Leaf {
    fn site(&self) -> SurfacePoint {
        site_of(&self.surface)
    }

    fn irradiance(&self, shader: &Shader<'_>, work: &mut Work) -> Rgb {
        shader.irradiance(&self.surface, self.stream, false, work)
    }
}

pub(super) fn site_of(surface: &Surface) -> SurfacePoint {
    SurfacePoint { position: surface.position.into(), normal: surface.shading_normal.into() }
}

/// What is known of the diffuse surfaces of the primary view.
#[derive(Clone, Copy)]
pub(crate) struct Finished<'x> {
    pub(crate) direct: &'x Direct,
    pub(crate) indirect: &'x Indirect,
    pub(crate) caustic: &'x Caustic,
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
    radiance: Grid<Rgb>,
    /// The pixels whose chains have glossy ends, too: these ends are left to [`super::glossy`].
    glossy: Vec<Pixel>,
    source: Source<Rgb>,
}

impl Leaves {
    /// Follows all chains that begin sharply.
    pub(crate) fn start(
        frame: &Frame<'_>,
        saved: &Saved,
        account: &mut Account<'_, '_>,
    ) -> Result<Self, Interrupted> {
        let size = frame.size();
        let shader = frame.shader();
        let materials = &shader.scene.materials;
        let mut pixels = frame.surface_pixels();
        pixels.retain(|&p| {
            frame.surfaces()[p]
                .as_ref()
                .map(|s| &materials[s.material.0 as usize])
                .is_some_and(|material| material.is_specular() && !material.is_rough())
        });
        // Some pixels at a time share their vectors: one for each would be as long as chains rarely are.
        let groups: Vec<&[Pixel]> = pixels.chunks(TOGETHER).collect();
        let chains = account.items(Component::Specular, &groups, |group, work| {
            let (mut shown, mut leaves) = (Vec::with_capacity(group.len()), Vec::new());
            for &pixel in *group {
                let mut is_glossy = false;
                let sum = frame.at(pixel, work, |point, stream, work| {
                    let pixel = size.index(pixel) as u32;
                    shader.chain(point, stream, work, |leaf, _| {
                        is_glossy |= leaf.is_glossy;
                        if !leaf.is_glossy {
                            let weight = leaf.weight * leaf.point.albedo * FRAC_1_PI;
                            let (path, stream, surface) =
                                (leaf.path, leaf.stream, leaf.point.facing);
                            leaves.push(Leaf { pixel, path, weight, surface, stream });
                        }
                    })
                });
                shown.push((pixel, sum, is_glossy));
            }
            (shown, leaves)
        })?;
        let mut emitted = Grid::from_fn(size, |_| Rgb::BLACK);
        let mut glossy = Vec::new();
        for &(pixel, sum, is_glossy) in chains.iter().flat_map(|c| &c.0) {
            emitted[pixel] = sum;
            glossy.extend(is_glossy.then_some(pixel));
        }
        let leaves = by_path(chains.iter().flat_map(|c| &c.1));
        let traced = vec![None; leaves.len()];
        let source = saved.source(&saved.set.leaves);
        Ok(Self { leaves, traced, radiance: emitted.clone(), emitted, glossy, source })
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
        self.radiance.values()[index]
    }

    /// Why any leaf of a pixel was traced.
    pub(crate) fn reasons(&self) -> Vec<Reason> {
        let mut reasons = vec![Reason::Interpolated; self.radiance.values().len()];
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
        finished: &Finished<'_>,
        tolerance: Tolerance,
        account: &mut Account<'_, '_>,
    ) -> Result<(), Interrupted> {
        let shader = account.frame.shader();
        for traced in &mut self.traced {
            traced.take_if(|t| t.1 == Reason::Nearby);
        }
        let found = account
            .overhead(&self.leaves, |leaf, _| look_up(shader, &leaf.surface, view, finished))?;
        // What is known of a pixel's radiance is what errors in the rest are measured against.
        let size = view.size();
        let mut known: Vec<f32> = self.emitted.values().iter().map(|e| e.luminance()).collect();
        for (leaf, found) in self.leaves.iter().zip(&found) {
            known[leaf.pixel as usize] += found.map_or(0.0, |e| (leaf.weight * e).luminance());
        }

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
            let layer = image.refine(
                &self.leaves,
                &found,
                &self.traced,
                &known,
                finished.indirect.floor(),
                tolerance,
                &self.source,
                account,
            )?;
            for (at, &leaf) in image.leaf_at.iter().enumerate().filter(|(_, leaf)| **leaf != NONE) {
                let leaf = leaf as usize;
                irradiance[leaf] = layer.values[at];
                if layer.is_traced(at) && found[leaf].is_none() {
                    self.traced[leaf] = Some((layer.values[at], layer.reasons[at]));
                }
            }
        }
        let (leaves, source) = (&self.leaves, &self.source);
        let take = |&i: &usize| {
            // Too few for neighbors to be compared: only what is certain counts.
            let (value, _, reason) = source.take(&place(leaves, i), 0, |_| false)?;
            Some((value, reason))
        };
        let values = source.fill(account, &few, take, |account, few| {
            account.items(Component::Specular, few, |&i, work| {
                (leaves[i].irradiance(shader, work), Reason::NoNeighbours)
            })
        })?;
        few.iter().zip(values).for_each(|(&i, value)| self.traced[i] = Some(value));

        self.radiance = self.emitted.clone();
        for (i, leaf) in self.leaves.iter().enumerate() {
            let value = self.traced[i].map_or(irradiance[i], |traced| traced.0);
            self.radiance.values_mut()[leaf.pixel as usize] += leaf.weight * value;
        }
        Ok(())
    }
}

/// Leaves by path, those of a path in the order in which they come.
fn by_path<'l>(leaves: impl Iterator<Item = &'l Leaf> + Clone) -> Vec<Leaf> {
    let mut places = BTreeMap::<u64, usize>::new();
    leaves.clone().for_each(|leaf| *places.entry(leaf.path).or_default() += 1);
    // From the numbers of leaves to where the first of a path goes.
    let mut n = 0;
    for place in places.values_mut() {
        n += std::mem::replace(place, n);
    }
    let Some(any) = leaves.clone().next() else { return Vec::new() };
    let mut sorted = vec![*any; n];
    for leaf in leaves {
        if let Some(place) = places.get_mut(&leaf.path) {
            sorted[*place] = *leaf;
            *place += 1;
        }
    }
    sorted
}

/// The place of a leaf. What a pixel spans there is the distance to its neighbor in the row; 0 if it has none.
fn place(leaves: &[Leaf], index: usize) -> Place {
    let leaf = &leaves[index];
    let others = [index.wrapping_sub(1), index + 1].into_iter().filter_map(|i| leaves.get(i));
    let beside = others.filter(|o| o.path == leaf.path && o.pixel.abs_diff(leaf.pixel) == 1);
    let distances = beside.map(|o| o.surface.position.distance(leaf.surface.position));
    Place { surface: leaf.site(), pixel: distances.reduce(f32::min).unwrap_or(0.0) }
}

/// Irradiance at the end of a chain from the four pixels around its place in the primary view, if all show its surface.
pub(super) fn look_up(
    shader: &Shader<'_>,
    surface: &Surface,
    view: &View,
    finished: &Finished<'_>,
) -> Option<Rgb> {
    let Finished { direct, indirect, caustic } = finished;
    let size = view.size();
    let Surface { position, shading_normal, .. } = *surface;
    let at = shader.scene.camera.project(size, position)? - 0.5;
    let low = at.floor();
    let last = Vec2::new(size.width as f32, size.height as f32) - 1.0;
    if low.cmplt(Vec2::ZERO).any() || low.cmpge(last).any() {
        return None;
    }
    let (x, y) = (low.x as u32, low.y as u32);
    let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| Pixel { x: x + dx, y: y + dy });
    let site = site_of(surface);
    if !corners.iter().all(|&c| view.sites[c].as_ref().is_some_and(|s| same_surface(s, &site))) {
        return None;
    }
    let f = at - low;
    let weights = [(1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y];
    let corners = corners.map(|c| size.index(c));
    let mix = |value: &dyn Fn(usize) -> Rgb| -> Rgb {
        corners.iter().zip(weights).map(|(&i, w)| value(i) * w).sum()
    };
    let mut irradiance =
        mix(&|i| indirect.irradiance(i) + caustic.irradiance(i) + direct.rest_irradiance(i));
    for cached in direct.lights() {
        let values = &cached.visibility.values;
        let visibility: f32 = corners.iter().zip(weights).map(|(&i, w)| values[i] * w).sum();
        if visibility > 0.0 {
            let light = shader.light(cached.light);
            irradiance += light.unshadowed_irradiance(position, shading_normal)? * visibility;
        }
    }
    Some(irradiance)
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

    #[expect(clippy::too_many_arguments, reason = "all that is known of the leaves, each once")]
    fn refine(
        &self,
        leaves: &[Leaf],
        found: &[Option<Rgb>],
        traced: &[Option<(Rgb, Reason)>],
        known: &[f32],
        floor: f32,
        tolerance: Tolerance,
        source: &Source<Rgb>,
        account: &mut Account<'_, '_>,
    ) -> Result<Layer<Rgb>, Interrupted> {
        let sites =
            self.leaf_at.iter().map(|&i| (i != NONE).then(|| leaves[i as usize].site())).collect();
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
        let rule = LeafRule { image: self, leaves, known, floor };
        let shader = account.frame.shader();
        source.refine(
            &lattice,
            &mut layer,
            COARSEST,
            &rule,
            tolerance,
            |at| Some(place(leaves, self.leaf_at[at] as usize)),
            account,
            |account, pixels: &[Pixel]| {
                account.items(Component::Specular, pixels, |&pixel, work| {
                    leaves[self.leaf_at[self.size.index(pixel)] as usize].irradiance(shader, work)
                })
            },
        )?;
        Ok(layer)
    }
}

struct LeafRule<'x> {
    image: &'x Image,
    leaves: &'x [Leaf],
    known: &'x [f32],
    floor: f32,
}

impl LeafRule<'_> {
    fn leaf(&self, index: usize) -> &Leaf {
        &self.leaves[self.image.leaf_at[index] as usize]
    }
}

impl Rule<Rgb> for LeafRule<'_> {
    fn gain(&self, index: usize) -> f32 {
        self.leaf(index).weight.luminance()
    }
    fn reference(&self, index: usize, predicted: Rgb) -> f32 {
        let leaf = self.leaf(index);
        self.floor + self.known[leaf.pixel as usize] + (leaf.weight * predicted).luminance()
    }
    fn spacing(&self, _: usize) -> u32 {
        COARSEST
    }
}
