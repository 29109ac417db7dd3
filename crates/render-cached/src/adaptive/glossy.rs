//! Glossy light: what rough surfaces show, seen directly or along a chain.
//!
//! Rays are cheap: every pixel follows the same directions as in mode original, so highlights and the noise of emitters
//! are the same. Ends that the primary view shows are looked up in its finished irradiance. The others cost a hundred times as
//! much as a ray; what they add to a pixel, divided by the tint of its surface, varies slowly over it and is refined like
//! irradiance.

use std::ops::ControlFlow;

use base::{Component, Grid, Interrupted, Pixel, Rgb, math::FRAC_1_PI};
use cache_map::{Lattice, Layer, Reason, Rule, Tolerance, refine};
use rayon::prelude::*;
use scene::{Material, Specular, fresnel_conductor};
use shade::ChainLeaf;

use super::leaves::{Finished, look_up, site_of};
use super::{Account, View};
use crate::frame::Frame;

/// The widest spacing of pixels whose unseen ends are shaded.
const COARSEST: u32 = 8;

/// The glossy ends of a picture's chains.
#[derive(Debug)]
pub(crate) struct Glossy {
    /// The pixels that have any.
    pixels: Vec<Pixel>,
    /// What the rest of this is about; nothing if there are no such pixels.
    layers: Option<Layers>,
}

#[derive(Debug)]
struct Layers {
    lattice: Lattice,
    tint: Vec<Rgb>,
    /// Radiance of emitters, where chains begin at a rough surface. The others are known already.
    emitted: Vec<Rgb>,
    /// Radiance of the ends that were looked up.
    found: Vec<Rgb>,
    /// Whether there are others.
    has_rest: Vec<bool>,
    /// Radiance of the others, divided by the tint.
    rest: Layer<Rgb>,
    /// Whether all this is there.
    is_followed: bool,
}

impl Glossy {
    /// Prepares for the pixels that show rough surfaces, given those that do so along a chain.
    pub(crate) fn start(frame: &Frame<'_>, along_chains: &[Pixel]) -> Self {
        let materials = &frame.shader().scene.materials;
        let mut pixels = Vec::new();
        if materials.iter().any(Material::is_rough) {
            pixels.extend(frame.pixels_that_show(Material::is_rough));
            pixels.extend(along_chains);
        }
        if pixels.is_empty() {
            return Self { pixels, layers: None };
        }
        let size = frame.size();
        let n = size.n_pixels();
        let (mut sites, mut tint) = (Grid::from_fn(size, |_| None), vec![Rgb::BLACK; n]);
        for &pixel in &pixels {
            if let Some(point) = frame.point(pixel) {
                sites[pixel] = Some(site_of(&point.facing));
                tint[size.index(pixel)] = tint_of(point.material);
            }
        }
        let layers = Layers {
            lattice: Lattice::new(&sites, COARSEST),
            tint,
            emitted: vec![Rgb::BLACK; n],
            found: vec![Rgb::BLACK; n],
            has_rest: vec![false; n],
            rest: Layer::new(n),
            is_followed: false,
        };
        Self { pixels, layers: Some(layers) }
    }

    /// Adds what it shows to the other specular radiance of all pixels: memory is touched only if there is any.
    pub(crate) fn add_to(&self, specular: &mut [Rgb]) {
        if self.layers.is_some() {
            let each = specular.par_iter_mut().with_min_len(4096).enumerate();
            each.for_each(|(i, value)| *value += self.radiance(i));
        }
    }

    pub(crate) fn radiance(&self, index: usize) -> Rgb {
        self.layers.as_ref().map_or(Rgb::BLACK, |layers| {
            layers.emitted[index]
                + layers.found[index]
                + layers.rest.values[index] * layers.tint[index]
        })
    }

    /// Whether a pixel shows a rough surface.
    pub(crate) fn is_shown_at(&self, index: usize) -> bool {
        self.layers.as_ref().is_some_and(|layers| !layers.tint[index].is_black())
    }

    /// Tells why unseen ends were shaded, and from which step on pixels were predicted.
    pub(crate) fn tell(&self, reasons: &mut [Reason], levels: &mut [u8]) {
        let Some(Layers { rest, .. }) = &self.layers else { return };
        for i in (0..reasons.len()).filter(|&i| self.is_shown_at(i)) {
            levels[i] = rest.levels[i];
            if rest.is_traced(i) {
                reasons[i] = rest.reasons[i];
            }
        }
    }

    /// Looks up what is seen, again if the primary view has become better.
    pub(crate) fn look_up(
        &mut self,
        view: &View,
        finished: &Finished,
        account: &mut Account<'_, '_>,
    ) -> Result<(), Interrupted> {
        let Some(layers) = &mut self.layers else { return Ok(()) };
        let sums = follow(&self.pixels, layers.is_followed, view, finished, account)?;
        for (&pixel, (emitted, found, has_rest)) in self.pixels.iter().zip(sums) {
            let i = layers.lattice.size().index(pixel);
            layers.emitted[i] += emitted;
            (layers.found[i], layers.has_rest[i]) = (found, has_rest);
        }
        layers.is_followed = true;
        Ok(())
    }

    /// Looks up what is seen, the first time, and refines the rest. `sharp` is the other specular radiance of a pixel.
    pub(crate) fn resolve(
        &mut self,
        view: &View,
        finished: &Finished,
        sharp: impl Fn(usize) -> Rgb,
        tolerance: Tolerance,
        account: &mut Account<'_, '_>,
    ) -> Result<(), Interrupted> {
        if self.layers.as_ref().is_some_and(|layers| !layers.is_followed) {
            self.look_up(view, finished, account)?;
        }
        let Some(layers) = &mut self.layers else { return Ok(()) };
        let Layers { lattice, tint, emitted, found, has_rest, rest, .. } = layers;
        let known = |i: usize| (sharp(i) + emitted[i] + found[i]).luminance();
        let known: Vec<f32> = (0..lattice.size().n_pixels()).map(known).collect();
        let rule = GlossyRule { tint, has_rest, known: &known, floor: finished.floor };
        let shader = account.frame.shader();
        refine(lattice, rest, COARSEST, &rule, tolerance, &mut |pixels: &[Pixel]| {
            account.pixels(Component::Specular, pixels, |point, stream, work| {
                let mut sum = Rgb::BLACK;
                shader.chain_ends(point, stream, work, |leaf, work| {
                    let surface = &leaf.point.facing;
                    if leaf.is_glossy && look_up(&site_of(surface), view, finished).is_none() {
                        let irradiance = shader.irradiance_of_glossy(surface, leaf.stream, work);
                        sum += weight_of(&leaf) * irradiance;
                    }
                    ControlFlow::Continue(())
                });
                divided(sum, tint_of(point.material))
            })
        })
    }
}

/// Radiance of emitters where chains begin at a rough surface, unless it is known; that of ends that are looked up; and
/// whether there are others.
fn follow(
    pixels: &[Pixel],
    emitted_is_known: bool,
    view: &View,
    finished: &Finished,
    account: &mut Account<'_, '_>,
) -> Result<Vec<(Rgb, Rgb, bool)>, Interrupted> {
    let shader = account.frame.shader();
    account.pixels(Component::Specular, pixels, |point, stream, work| {
        let (mut found, mut has_rest) = (Rgb::BLACK, false);
        let mut arrive = |leaf: ChainLeaf<'_>| {
            if leaf.is_glossy {
                match look_up(&site_of(&leaf.point.facing), view, finished) {
                    Some(irradiance) => found += weight_of(&leaf) * irradiance,
                    None => has_rest = true,
                }
            }
        };
        let emitted = if emitted_is_known || !point.material.is_rough() {
            shader.chain_ends(point, stream, work, |leaf, _| {
                arrive(leaf);
                ControlFlow::Continue(())
            });
            Rgb::BLACK
        } else {
            shader.chain(point, stream, work, |leaf, _| arrive(leaf))
        };
        (emitted, found, has_rest)
    })
}

/// What a pixel shows of white irradiance of 1 at the end of a chain.
fn weight_of(leaf: &ChainLeaf<'_>) -> Rgb {
    leaf.weight * leaf.point.albedo * FRAC_1_PI
}

struct GlossyRule<'x> {
    tint: &'x [Rgb],
    has_rest: &'x [bool],
    known: &'x [f32],
    floor: f32,
}

impl Rule<Rgb> for GlossyRule<'_> {
    fn gain(&self, index: usize) -> f32 {
        if self.has_rest[index] { self.tint[index].luminance() } else { 0.0 }
    }
    fn reference(&self, index: usize, predicted: Rgb) -> f32 {
        self.floor + self.known[index] + (self.tint[index] * predicted).luminance()
    }
    fn spacing(&self, _: Pixel) -> f32 {
        COARSEST as f32
    }
}

/// The color that a surface gives to what it shows, head on. Nowhere black, so that it can be divided by.
fn tint_of(material: &Material) -> Rgb {
    let tint = match material.specular {
        Specular::None | Specular::Glass { .. } | Specular::Pane { .. } => Rgb::ONE,
        Specular::Mirror { reflectance } => reflectance,
        Specular::Metal { eta, k } => fresnel_conductor(1.0, eta, k),
        Specular::Coat(coat) => coat.reflectance(),
    };
    tint.map(|t| t.max(1e-3))
}

pub(super) fn divided(a: Rgb, b: Rgb) -> Rgb {
    Rgb::new(a.r / b.r, a.g / b.g, a.b / b.b)
}
