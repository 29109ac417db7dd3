//! Direct light: unshadowed irradiance in closed form, times cached visibility, verified by rays.

use base::{Component, ImageSize, Interrupted, Pixel, Rgb};
use cache_map::{Layer, Reason, RecordPoint, RecordSet, Rule, Tolerance, Value, refine};
use geometry::Surface;
use rayon::prelude::*;
use shade::{PixelStream, Shader, Work};

use super::cells::Corners;
use super::clear::Clear;
use super::indirect::Indirect;
use super::records::{Saved, Source};
use super::{Account, COARSEST, View};

/// Lights whose visibility is cached each on its own. The others share one, by channel; so do those of many colors.
const MAX_SEPARATE: usize = 4;

/// Shadow rays that the lights which share a visibility share too, at least.
const FEWEST_SHARED_RAYS: u32 = 256;

/// The part of the error that unshadowed irradiance may make: it costs little, so it is never what is seen.
const UNSHADOWED_SHARE: f32 = 0.1;

/// The widest spacing of unshadowed irradiance.
const UNSHADOWED_COARSEST: u32 = 8;

/// Direct irradiance at every pixel.
#[derive(Debug)]
pub(crate) struct Direct {
    lights: Vec<CachedLight>,
    /// All other lights together.
    rest: Option<Rest>,
    /// That of all together.
    irradiance: Vec<Rgb>,
}

/// What isn't known of direct light between pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lack {
    /// A light, or those that share a visibility.
    pub(super) part: usize,
    /// Irradiance as it is predicted, or radiance.
    pub(super) radiance: Rgb,
    /// Whether it is predicted to be lit.
    pub(super) is_lit: bool,
    /// Whether the prediction holds unless a ray says otherwise.
    pub(super) is_doubtful: bool,
}

/// A light with its visibility at every pixel.
#[derive(Debug)]
struct CachedLight {
    light: usize,
    /// Unshadowed irradiance.
    unshadowed: Vec<Rgb>,
    visibility: Layer<f32>,
    source: Source<f32>,
    /// Where it is surely 1.
    clear: Clear,
    /// Whether its shadows may be as thin as a pixel, so that all between those of the view are asked.
    is_sharp: bool,
}

/// Lights that share a visibility: the part of their unshadowed irradiance that arrives, by channel.
#[derive(Debug)]
struct Rest {
    lights: Vec<usize>,
    unshadowed: Vec<Rgb>,
    visibility: Layer<Rgb>,
    source: Source<Rgb>,
}

impl Direct {
    /// Finds the unshadowed irradiance everywhere.
    pub(crate) fn start(
        view: &View,
        indirect: &Indirect,
        saved: &Saved,
        error: f32,
        account: &mut Account<'_, '_>,
    ) -> Result<Self, Interrupted> {
        let scene = account.frame.shader().scene;
        let flux = |l: &usize| scene.lights[*l].flux(&scene.bounds()).mean();
        let is_told_by_one_number =
            |l: &usize| scene.lights[*l].has_closed_form() && scene.lights[*l].has_one_color();
        let mut separate: Vec<usize> =
            (0..scene.lights.len()).filter(is_told_by_one_number).collect();
        separate.sort_by(|a, b| flux(b).total_cmp(&flux(a)).then(a.cmp(b)));
        separate.truncate(MAX_SEPARATE);
        separate.sort_unstable();

        let n = view.size().n_pixels();
        let mut lights = Vec::new();
        for (&light, clear) in separate.iter().zip(Clear::find(&separate, view, account)?) {
            let unshadowed = unshadowed(&[light], view, indirect, error, account)?;
            let (visibility, source) = (Layer::new(n), saved.visibility(light));
            let is_sharp = scene.lights[light].is_delta() && view.apart() > 1;
            lights.push(CachedLight { light, unshadowed, visibility, source, clear, is_sharp });
        }
        let others: Vec<usize> =
            (0..scene.lights.len()).filter(|l| !separate.contains(l)).collect();
        let mut rest = None;
        if !others.is_empty() {
            rest = Some(Rest {
                unshadowed: unshadowed(&others, view, indirect, error, account)?,
                lights: others,
                visibility: Layer::new(n),
                source: saved.source(&saved.set.rest),
            });
        }
        Ok(Self { lights, rest, irradiance: vec![Rgb::BLACK; n] })
    }

    #[inline]
    pub(crate) fn irradiance(&self, index: usize) -> Rgb {
        self.irradiance[index]
    }

    /// The same of all pixels.
    pub(crate) fn into_irradiance(self) -> Vec<Rgb> {
        self.irradiance
    }

    /// The sum of all lights' irradiance.
    fn sum(&self, index: usize) -> Rgb {
        let of_light = |l: &CachedLight| l.unshadowed[index] * l.visibility.values[index];
        let of_rest = |rest: &Rest| rest.unshadowed[index] * rest.visibility.values[index];
        let separate: Rgb = self.lights.iter().map(of_light).sum();
        separate + self.rest.as_ref().map_or(Rgb::BLACK, of_rest)
    }

    /// Luminance of [`Direct::irradiance`].
    #[inline]
    pub(crate) fn luminance(&self, index: usize) -> f32 {
        self.irradiance[index].luminance()
    }

    /// Irradiance between the pixels of a cell that begins at `first`, given that of all else: without the parts (lights, and those that share a visibility) whose
    /// visibility differs too much between the corners, or is in doubt since other surfaces lie around. `lack` is told these.
    #[inline]
    pub(super) fn between(
        &self,
        corners: &Corners,
        first: Pixel,
        others: f32,
        tolerance: Tolerance,
        lack: &mut impl FnMut(Lack),
    ) -> Rgb {
        let n = self.lights.len();
        let of_light = |light: &CachedLight| {
            let unshadowed = corners.blend(|i| light.unshadowed[i]);
            let visibility = corners.blend(|i| light.visibility.values[i]);
            (unshadowed * visibility, unshadowed.luminance(), visibility)
        };
        let mut sum = Rgb::BLACK;
        let mut found = [(Rgb::BLACK, 0.0, 0.0); MAX_SEPARATE];
        for (found, light) in found.iter_mut().zip(&self.lights) {
            *found = of_light(light);
            sum += found.0;
        }
        let of_rest = self.rest.as_ref().map(|rest| {
            let unshadowed = corners.blend(|i| rest.unshadowed[i]);
            (unshadowed * corners.blend(|i| rest.visibility.values[i]), unshadowed.luminance())
        });
        sum += of_rest.map_or(Rgb::BLACK, |rest| rest.0);
        let all = others + sum.luminance();
        for (part, (light, &(radiance, unshadowed, visibility))) in
            self.lights.iter().zip(&found).enumerate()
        {
            let span = corners.span(|i| light.visibility.values[i]);
            let is_sure = !(SURELY_DARK..=SURELY_LIT).contains(&visibility);
            let matters = unshadowed > tolerance.error * all;
            let is_doubtful = !corners.is_whole && is_sure && matters;
            let is_asked = light.is_sharp && !(corners.is_whole && light.clear.holds(first));
            if unshadowed * span > tolerance.edge * all || is_asked && matters {
                lack(Lack { part, radiance, is_lit: false, is_doubtful: false });
                sum = sum - radiance;
            } else if is_doubtful {
                lack(Lack { part, radiance, is_lit: visibility > 0.5, is_doubtful });
                sum = sum - radiance;
            }
        }
        if let (Some(rest), Some((radiance, unshadowed))) = (&self.rest, of_rest) {
            let span = corners.span(|i| rest.visibility.values[i]);
            if unshadowed * span > tolerance.edge * all {
                lack(Lack { part: n, radiance, is_lit: false, is_doubtful: false });
                sum = sum - radiance;
            }
        }
        sum.map(|v| v.max(0.0))
    }

    /// Whether no light's visibility makes irradiance differ by more between the corners of a cell.
    #[inline]
    pub(super) fn is_even(&self, cell: &[usize; 4], first: Pixel, most: f32) -> bool {
        let is_even = |light: &CachedLight| {
            if light.is_sharp && !light.clear.holds(first) {
                return false;
            }
            let values = cell.map(|i| light.visibility.values[i]);
            let differs =
                |v: &f32| (v - values[0]).abs() * light.unshadowed[cell[0]].luminance() > most;
            !values.iter().any(differs)
        };
        let rest_is_even = |rest: &Rest| {
            let values = cell.map(|i| rest.visibility.values[i]);
            let differs =
                |v: &Rgb| (*v - values[0]).size() * rest.unshadowed[cell[0]].luminance() > most;
            !values.iter().any(differs)
        };
        self.lights.iter().all(is_even) && self.rest.as_ref().is_none_or(rest_is_even)
    }

    /// The light that a part is, if it is one.
    pub(super) fn light(&self, part: usize) -> Option<usize> {
        self.lights.get(part).map(|light| light.light)
    }

    /// Irradiance of a part at a surface, computed.
    pub(super) fn compute(
        &self,
        part: usize,
        shader: &Shader<'_>,
        surface: &Surface,
        stream: PixelStream,
        work: &mut Work,
    ) -> Rgb {
        match (self.lights.get(part), &self.rest) {
            (Some(light), _) => shader.irradiance_from(light.light, surface, stream, work),
            (None, Some(rest)) => {
                let rays = shared_rays(shader);
                shader.unshadowed_irradiance(&rest.lights, surface, stream)
                    * shader.visibility_of_lights(&rest.lights, surface, stream, rays, work)
            }
            (None, None) => Rgb::BLACK,
        }
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
        if let Some(Rest { visibility, source, .. }) = &self.rest {
            set.rest = source.with(visibility, |i| point(visibility.levels[i], i));
        }
    }

    /// Whether what records around a pixel told counts anywhere.
    pub(crate) fn uses_nearby(&self) -> bool {
        let mut layers = self.lights.iter().map(|l| &l.visibility.reasons);
        layers.any(|r| r.contains(&Reason::Nearby))
            || self.rest.as_ref().is_some_and(|r| r.visibility.reasons.contains(&Reason::Nearby))
    }

    /// Why any light was traced at each pixel.
    pub(crate) fn reasons(&self) -> Vec<Reason> {
        let layers = self
            .lights
            .iter()
            .map(|l| &l.visibility.reasons)
            .chain(self.rest.iter().map(|r| &r.visibility.reasons));
        let mut reasons = vec![Reason::Interpolated; self.irradiance.len()];
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
            .chain(self.rest.iter().map(|r| &r.visibility.levels))
            .next();
        first.cloned().unwrap_or_else(|| vec![0; self.irradiance.len()])
    }

    pub(crate) fn refine(
        &mut self,
        view: &View,
        indirect: &Indirect,
        tolerance: Tolerance,
        account: &mut Account<'_, '_>,
    ) -> Result<(), Interrupted> {
        // What is known of the light that isn't this light's.
        let ImageSize { width, height } = view.size();
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| Pixel { x, y }));
        let mut known: Vec<f32> = pixels.map(|p| indirect.ambient(view, p)).collect();
        let frame = account.frame;
        let shader = frame.shader();
        for cached in &mut self.lights {
            let CachedLight { light, unshadowed, visibility, source, clear, .. } = cached;
            // A single ray tells all of a point's visibility: nothing is cheaper.
            let coarsest =
                if shader.light(*light).is_delta() { 1 } else { COARSEST / view.apart() };
            let floor = indirect.floor();
            let rule = LightRule {
                view,
                light: *light,
                clear,
                unshadowed,
                known: &known,
                floor,
                coarsest,
            };
            source.refine(
                &view.lattice,
                visibility,
                COARSEST,
                &rule,
                tolerance,
                |i| view.place(i),
                account,
                |account, pixels: &[Pixel]| {
                    account.items(Component::Direct, pixels, |&pixel, work| {
                        if clear.holds(pixel) {
                            return 1.0;
                        }
                        frame.at(pixel, work, |point, stream, work| {
                            shader.visibility(*light, &point.facing, stream, work)
                        })
                    })
                },
            )?;
            if coarsest > 1 {
                verify(&rule, visibility, source, tolerance, account)?;
            }
            for (i, known) in known.iter_mut().enumerate() {
                *known += unshadowed[i].luminance() * visibility.values[i];
            }
        }
        if let Some(Rest { lights, unshadowed, visibility, source }) = &mut self.rest {
            let rule = RestRule { view, unshadowed, known: &known, floor: indirect.floor() };
            let rays = shared_rays(shader);
            // Their chance is no structure.
            let noise = 0.5 / (rays as f32).sqrt();
            let tolerance = Tolerance { error: tolerance.error + noise, ..tolerance };
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
                        shader.visibility_of_lights(lights, &point.facing, stream, rays, work)
                    })
                },
            )?;
        }
        let all = (0..known.len()).into_par_iter().with_min_len(4096);
        self.irradiance = all.map(|i| self.sum(i)).collect();
        Ok(())
    }
}

/// Shadow rays of the lights that share a visibility.
fn shared_rays(shader: &Shader<'_>) -> u32 {
    (shader.settings.shadow_rays * MAX_SEPARATE as u32).max(FEWEST_SHARED_RAYS)
}

struct LightRule<'x> {
    view: &'x View,
    light: usize,
    clear: &'x Clear,
    unshadowed: &'x [Rgb],
    known: &'x [f32],
    floor: f32,
    coarsest: u32,
}

impl Rule<f32> for LightRule<'_> {
    fn gain(&self, index: usize) -> f32 {
        self.view.gain(index) * self.unshadowed[index].luminance()
    }
    fn reference(&self, index: usize, predicted: f32) -> f32 {
        let irradiance = self.known[index] + self.unshadowed[index].luminance() * predicted;
        self.floor + irradiance * self.view.gain(index)
    }
    fn spacing(&self, _: Pixel) -> f32 {
        self.coarsest as f32
    }
}

struct RestRule<'x> {
    view: &'x View,
    unshadowed: &'x [Rgb],
    known: &'x [f32],
    floor: f32,
}

impl Rule<Rgb> for RestRule<'_> {
    fn gain(&self, index: usize) -> f32 {
        self.view.gain(index) * self.unshadowed[index].luminance()
    }
    fn reference(&self, index: usize, predicted: Rgb) -> f32 {
        let irradiance = self.known[index] + (self.unshadowed[index] * predicted).luminance();
        self.floor + irradiance * self.view.gain(index)
    }
    fn spacing(&self, _: Pixel) -> f32 {
        (COARSEST / self.view.apart()) as f32
    }
}

/// Unshadowed irradiance from some lights at every pixel. It is smooth, and computed where its structure asks for it.
fn unshadowed(
    lights: &[usize],
    view: &View,
    indirect: &Indirect,
    error: f32,
    account: &mut Account<'_, '_>,
) -> Result<Vec<Rgb>, Interrupted> {
    struct UnshadowedRule<'x> {
        view: &'x View,
        indirect: &'x Indirect,
    }
    impl Rule<Rgb> for UnshadowedRule<'_> {
        fn gain(&self, _: usize) -> f32 {
            1.0
        }
        fn reference(&self, index: usize, predicted: Rgb) -> f32 {
            self.indirect.ambient(self.view, self.view.size().pixel(index)) + predicted.luminance()
        }
        fn spacing(&self, _: Pixel) -> f32 {
            (UNSHADOWED_COARSEST / self.view.apart()) as f32
        }
    }
    let mut layer = Layer::new(view.size().n_pixels());
    let tolerance = Tolerance { error: UNSHADOWED_SHARE * error, edge: 0.5 };
    let rule = UnshadowedRule { view, indirect };
    let shader = account.frame.shader();
    refine(
        &view.lattice,
        &mut layer,
        UNSHADOWED_COARSEST,
        &rule,
        tolerance,
        &mut |pixels: &[Pixel]| {
            account.pixels(Component::Direct, pixels, |point, stream, _| {
                shader.unshadowed_irradiance(lights, &point.facing, stream)
            })
        },
    )?;
    Ok(layer.values)
}

/// Predictions beyond these count as certain: one ray that says otherwise proves them wrong.
const SURELY_LIT: f32 = 0.98;
const SURELY_DARK: f32 = 0.02;

/// From so many shadow rays on, a ray in every other pixel is little beside them.
const MANY_RAYS: u32 = 48;

/// How far around a wrong prediction others are doubted, in pixels.
const DOUBT: u32 = 2;

/// A shadow ray for every other interpolated pixel (for every fourth, where computing a pixel takes few rays or the cache works
/// on every fourth), its place on the light stratified over blocks of pixels. Where it contradicts the interpolation, the pixel is traced, and its
/// neighbours as long as they too were wrong.
fn verify(
    rule: &LightRule<'_>,
    visibility: &mut Layer<f32>,
    source: &Source<f32>,
    tolerance: Tolerance,
    account: &mut Account<'_, '_>,
) -> Result<(), Interrupted> {
    let &LightRule { view, light, clear, .. } = rule;
    let size = view.size();
    let shader = account.frame.shader();
    let matters = |i: usize, value: f32| {
        let gain = rule.gain(i);
        gain > tolerance.error * rule.reference(i, value)
    };
    let frame = account.frame;
    let rows: Vec<u32> = (0..size.height).collect();
    let (columns_apart, rows_apart) = match view.apart() {
        1 if shader.settings.shadow_rays < MANY_RAYS => (2, 2),
        1 => (2, 1),
        _ => (1, 1),
    };
    let contradicted = account.overhead(&rows, |&y, work| {
        let mut contradicted = Vec::new();
        for pixel in (0..size.width).map(|x| Pixel { x, y }) {
            let i = size.index(pixel);
            let value = visibility.values[i];
            let is_sure = !(SURELY_DARK..=SURELY_LIT).contains(&value);
            // Every other pixel, as on a chessboard, or the same of every other row.
            if (pixel.x + pixel.y / rows_apart) % columns_apart != 0
                || pixel.y % rows_apart != 0
                || clear.holds(pixel)
            {
                continue;
            }
            let (Some(site), Some(surface)) = (&view.sites.values()[i], frame.surface(i)) else {
                continue;
            };
            if is_sure && !visibility.is_exact(i) && matters(i, value) {
                let row = pixel.y / rows_apart;
                let in_block = (row % 4) * (4 / columns_apart) + pixel.x % 4 / columns_apart;
                let block = u64::from(row / 4) << 32 | u64::from(pixel.x / 4);
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
