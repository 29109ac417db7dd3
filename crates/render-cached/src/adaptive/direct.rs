//! Direct light: unshadowed irradiance in closed form, times cached visibility, verified by rays.

use base::{Component, Interrupted, Pixel, Rgb};
use cache_map::{Layer, Reason, RecordPoint, RecordSet, Rule, Tolerance};
use scene::Light;

use super::indirect::Indirect;
use super::records::{Saved, Source};
use super::{Account, COARSEST, View};

/// Lights whose visibility is cached each on its own. The others share a layer of irradiance.
const MAX_SEPARATE: usize = 4;

/// Direct irradiance at every pixel.
#[derive(Debug)]
pub(crate) struct Direct {
    lights: Vec<CachedLight>,
    /// Irradiance from all other lights together.
    rest: Option<Rest>,
    /// Luminance of the whole irradiance.
    luminance: Vec<f32>,
}

/// A light with its visibility at every pixel.
#[derive(Debug)]
pub(crate) struct CachedLight {
    pub(crate) light: usize,
    /// Unshadowed irradiance.
    unshadowed: Vec<Rgb>,
    pub(crate) visibility: Layer<f32>,
    source: Source<f32>,
}

/// Lights that share a layer of irradiance.
#[derive(Debug)]
struct Rest {
    lights: Vec<usize>,
    layer: Layer<Rgb>,
    source: Source<Rgb>,
}

impl Direct {
    /// Computes the unshadowed irradiance of the strongest lights everywhere.
    pub(crate) fn start(
        view: &View,
        saved: &Saved,
        account: &mut Account<'_, '_>,
    ) -> Result<Self, Interrupted> {
        let scene = account.frame.shader().scene;
        let flux = |l: &usize| scene.lights[*l].flux(&scene.bounds()).mean();
        let mut separate: Vec<usize> =
            (0..scene.lights.len()).filter(|&l| scene.lights[l].has_closed_form()).collect();
        separate.sort_by(|a, b| flux(b).total_cmp(&flux(a)).then(a.cmp(b)));
        separate.truncate(MAX_SEPARATE);
        separate.sort_unstable();

        let n = view.size().n_pixels();
        let mut lights = Vec::new();
        for &light in &separate {
            let source: &Light = &scene.lights[light];
            let unshadowed = account.items(Component::Direct, view.sites.values(), |site, _| {
                let site = site.as_ref()?;
                source.unshadowed_irradiance(site.position.into(), site.normal.into())
            })?;
            let unshadowed = unshadowed.into_iter().map(|u| u.unwrap_or(Rgb::BLACK)).collect();
            let source = saved.visibility(light);
            lights.push(CachedLight { light, unshadowed, visibility: Layer::new(n), source });
        }
        let others: Vec<usize> =
            (0..scene.lights.len()).filter(|l| !separate.contains(l)).collect();
        let rest = (!others.is_empty()).then(|| Rest {
            lights: others,
            layer: Layer::new(n),
            source: saved.source(&saved.set.rest),
        });
        Ok(Self { lights, rest, luminance: vec![0.0; n] })
    }

    pub(crate) fn irradiance(&self, index: usize) -> Rgb {
        let separate: Rgb =
            self.lights.iter().map(|l| l.unshadowed[index] * l.visibility.values[index]).sum();
        separate + self.rest.as_ref().map_or(Rgb::BLACK, |rest| rest.layer.values[index])
    }

    /// Luminance of [`Direct::irradiance`].
    #[inline]
    pub(crate) fn luminance(&self, index: usize) -> f32 {
        self.luminance[index]
    }

    pub(crate) fn lights(&self) -> &[CachedLight] {
        &self.lights
    }

    /// Irradiance of the lights that share a layer.
    pub(crate) fn rest(&self) -> Option<&Layer<Rgb>> {
        self.rest.as_ref().map(|rest| &rest.layer)
    }

    /// All that is known of direct light, for good.
    pub(crate) fn record(&self, view: &View, set: &mut RecordSet) {
        let point = |layer_level: u8, i: usize| {
            let surface = view.sites.values()[i]?;
            let reach = (1_u32 << layer_level) as f32 * view.footprint(&surface);
            Some(RecordPoint { surface, reach })
        };
        let of_light = |cached: &CachedLight| {
            let layer = &cached.visibility;
            (cached.light as u32, cached.source.with(layer, |i| point(layer.levels[i], i)))
        };
        set.visibility = self.lights.iter().map(of_light).collect();
        if let Some(Rest { layer, source, .. }) = &self.rest {
            set.rest = source.with(layer, |i| point(layer.levels[i], i));
        }
    }

    /// Whether what records around a pixel told counts anywhere.
    pub(crate) fn uses_nearby(&self) -> bool {
        let mut layers = self.lights.iter().map(|l| &l.visibility.reasons);
        layers.any(|r| r.contains(&Reason::Nearby))
            || self.rest.as_ref().is_some_and(|r| r.layer.reasons.contains(&Reason::Nearby))
    }

    /// Why any light was traced at each pixel.
    pub(crate) fn reasons(&self) -> Vec<Reason> {
        let layers = self
            .lights
            .iter()
            .map(|l| &l.visibility.reasons)
            .chain(self.rest.iter().map(|r| &r.layer.reasons));
        let mut reasons = vec![Reason::Interpolated; self.luminance.len()];
        for layer in layers {
            for (reason, &r) in reasons.iter_mut().zip(layer) {
                if *reason == Reason::Interpolated
                    || reason.is_reuse() && !r.is_reuse() && r != Reason::Interpolated
                {
                    *reason = r;
                }
            }
        }
        reasons
    }

    /// The finest step of any light at each pixel.
    pub(crate) fn levels(&self) -> Vec<u8> {
        let first = self
            .lights
            .iter()
            .map(|l| &l.visibility.levels)
            .chain(self.rest.iter().map(|r| &r.layer.levels))
            .next();
        first.cloned().unwrap_or_else(|| vec![0; self.luminance.len()])
    }

    pub(crate) fn refine(
        &mut self,
        view: &View,
        indirect: &Indirect,
        tolerance: Tolerance,
        account: &mut Account<'_, '_>,
    ) -> Result<(), Interrupted> {
        // What is known of the light that isn't this light's.
        let mut known: Vec<f32> =
            (0..self.luminance.len()).map(|i| indirect.ambient(view, i)).collect();
        let shader = account.frame.shader();
        for CachedLight { light, unshadowed, visibility, source } in &mut self.lights {
            let rule = LightRule { view, unshadowed, known: &known, floor: indirect.floor() };
            source.refine(
                &view.lattice,
                visibility,
                COARSEST,
                &rule,
                tolerance,
                |i| view.place(i),
                account,
                |account, pixels: &[Pixel]| {
                    account.pixels(Component::Direct, pixels, |point, stream, work| {
                        shader.visibility(*light, &point.facing, stream, work)
                    })
                },
            )?;
            verify(view, *light, visibility, source, &rule, tolerance, account)?;
            for (i, known) in known.iter_mut().enumerate() {
                *known += unshadowed[i].luminance() * visibility.values[i];
            }
        }
        if let Some(Rest { lights, layer, source }) = &mut self.rest {
            let rule = RestRule { view, known: &known, floor: indirect.floor() };
            source.refine(
                &view.lattice,
                layer,
                COARSEST,
                &rule,
                tolerance,
                |i| view.place(i),
                account,
                |account, pixels: &[Pixel]| {
                    account.pixels(Component::Direct, pixels, |point, stream, work| {
                        lights
                            .iter()
                            .map(|&l| shader.irradiance_from(l, &point.facing, stream, work))
                            .sum()
                    })
                },
            )?;
        }
        self.luminance = (0..known.len()).map(|i| self.irradiance(i).luminance()).collect();
        Ok(())
    }
}

struct LightRule<'x> {
    view: &'x View,
    unshadowed: &'x [Rgb],
    known: &'x [f32],
    floor: f32,
}

impl Rule<f32> for LightRule<'_> {
    fn gain(&self, index: usize) -> f32 {
        self.view.gain(index) * self.unshadowed[index].luminance()
    }
    fn reference(&self, index: usize, predicted: f32) -> f32 {
        let irradiance = self.known[index] + self.unshadowed[index].luminance() * predicted;
        self.floor + irradiance * self.view.gain(index)
    }
    fn spacing(&self, _: usize) -> u32 {
        COARSEST
    }
}

struct RestRule<'x> {
    view: &'x View,
    known: &'x [f32],
    floor: f32,
}

impl Rule<Rgb> for RestRule<'_> {
    fn gain(&self, index: usize) -> f32 {
        self.view.gain(index)
    }
    fn reference(&self, index: usize, predicted: Rgb) -> f32 {
        self.floor + (self.known[index] + predicted.luminance()) * self.view.gain(index)
    }
    fn spacing(&self, _: usize) -> u32 {
        COARSEST
    }
}

/// Predictions beyond these count as certain: one ray that says otherwise proves them wrong.
const SURELY_LIT: f32 = 0.98;
const SURELY_DARK: f32 = 0.02;

/// How far around a wrong prediction others are doubted, in pixels.
const DOUBT: u32 = 2;

/// A shadow ray for every other interpolated pixel, its place on the light stratified over blocks of 4x4 pixels. Where it
/// contradicts the interpolation, the pixel is traced, and its neighbours as long as they too were wrong.
fn verify(
    view: &View,
    light: usize,
    visibility: &mut Layer<f32>,
    source: &Source<f32>,
    rule: &LightRule<'_>,
    tolerance: Tolerance,
    account: &mut Account<'_, '_>,
) -> Result<(), Interrupted> {
    let size = view.size();
    let shader = account.frame.shader();
    let matters = |i: usize, value: f32| {
        let gain = rule.gain(i);
        gain > tolerance.error * rule.reference(i, value)
    };
    let surfaces = account.frame.surfaces().values();
    let rows: Vec<u32> = (0..size.height).collect();
    let contradicted = account.overhead(&rows, |&y, work| {
        let mut contradicted = Vec::new();
        for pixel in (0..size.width).map(|x| Pixel { x, y }) {
            let i = size.index(pixel);
            let value = visibility.values[i];
            let is_sure = !(SURELY_DARK..=SURELY_LIT).contains(&value);
            // Every other pixel, as on a chessboard.
            if (pixel.x + pixel.y) % 2 == 1 {
                continue;
            }
            let (Some(site), Some(surface)) = (&view.sites.values()[i], &surfaces[i]) else {
                continue;
            };
            if is_sure && !visibility.is_exact(i) && matters(i, value) {
                let in_block = (pixel.y % 4) * 2 + pixel.x % 4 / 2;
                let block = u64::from(pixel.y / 4) << 32 | u64::from(pixel.x / 4);
                let facing = surface.facing(site.normal.into());
                let free = shader.probe(light, &facing, in_block, block, work);
                if free.is_some_and(|free| free != (value > 0.5)) {
                    contradicted.push(pixel);
                }
            }
        }
        contradicted
    })?;
    let mut wave = contradicted.concat();
    while !wave.is_empty() {
        // What records around a pixel tell is what is in doubt.
        let take = |&pixel: &Pixel| {
            let (value, _, reason) = source.take(&view.place(size.index(pixel))?, 0, |_| false)?;
            Some((value, reason))
        };
        let values = source.fill(account, &wave, take, |account, wave| {
            account.pixels(Component::Direct, wave, |point, stream, work| {
                let value = shader.visibility(light, &point.facing, stream, work);
                (value, Reason::Verification)
            })
        })?;
        let mut next = Vec::new();
        for (&pixel, (value, reason)) in wave.iter().zip(values) {
            let i = size.index(pixel);
            let wrong_by = (value - visibility.values[i]).abs();
            visibility.values[i] = value;
            visibility.reasons[i] = reason;
            if rule.gain(i) * wrong_by > tolerance.error * rule.reference(i, value) {
                for y in pixel.y.saturating_sub(DOUBT)..(pixel.y + DOUBT + 1).min(size.height) {
                    next.extend(
                        (pixel.x.saturating_sub(DOUBT)..(pixel.x + DOUBT + 1).min(size.width))
                            .map(|x| Pixel { x, y }),
                    );
                }
            }
        }
        next.sort_unstable_by_key(|p| (p.y, p.x));
        next.dedup();
        next.retain(|&p| {
            let i = size.index(p);
            view.sites.values()[i].is_some() && rule.gain(i) > 0.0 && !visibility.is_exact(i)
        });
        wave = next;
    }
    Ok(())
}
