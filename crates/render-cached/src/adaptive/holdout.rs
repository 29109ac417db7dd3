//! Pixels held out: computed in full, to measure what interpolation has missed.

use base::{Component, Components, ImageSize, Interrupted, Pixel, Rgb, Rng, Stream};

use super::{Account, ErrorReport};
use crate::Args;

/// Share of the pixels held out, the fewest, and the most: these tell a mean to about 2 %, of however large a picture.
const SHARE: f64 = 0.002;
const FEWEST: usize = 1000;
const MOST: usize = 1500;

/// The same of subpixels between those that the cache works on: what is wrong with these is known by then.
const BETWEEN: usize = 1000;

/// FLIP looks at a picture through the filters of the eye, which a lone pixel can't have; they take away this share of the
/// error. Measured against FLIP itself on the scenes of this project, where it lies between 0.09 and 0.18.
const FILTERED_AWAY: f64 = 0.13;

/// What was measured, and which component is to blame most.
#[derive(Debug)]
pub(crate) struct Report {
    pub(crate) estimate: ErrorReport,
    pub(crate) worst: Component,
    /// Whether that is specular light, and most of its error lies where rough surfaces are seen.
    pub(crate) glossy_is_worst: bool,
}

/// Random pixels as `--mode original` computes them.
#[derive(Debug)]
pub(crate) struct HeldOut {
    pixels: Vec<Pixel>,
    /// Components and emission; nothing where there is no surface.
    truth: Vec<Option<(Components<Rgb>, Rgb)>>,
}

impl HeldOut {
    /// Chooses and computes them.
    pub(crate) fn compute(args: &Args, account: &mut Account<'_, '_>) -> Result<Self, Interrupted> {
        let size = account.frame.size();
        // Subpixels are more, but what is to be known is the same.
        let per_pixel = f64::from(args.supersample) / f64::from(account.frame.step());
        let share = SHARE / (per_pixel * per_pixel);
        let n = ((size.n_pixels() as f64 * share) as usize).clamp(FEWEST, MOST);
        Self::of(choose(size, n, args.seed, 0), account)
    }

    /// The same of subpixels that aren't the first of their pixel, of so many each way.
    pub(crate) fn between(
        args: &Args,
        n: u32,
        account: &mut Account<'_, '_>,
    ) -> Result<Self, Interrupted> {
        let mut pixels = choose(account.frame.size(), BETWEEN, args.seed, 1);
        pixels.retain(|p| p.x % n != 0 || p.y % n != 0);
        Self::of(pixels, account)
    }

    fn of(pixels: Vec<Pixel>, account: &mut Account<'_, '_>) -> Result<Self, Interrupted> {
        let frame = account.frame;
        let shader = frame.shader();
        let truth = account.probe(&pixels, |&pixel, work| {
            frame.at(pixel, work, |point, stream, work| {
                let values = Components {
                    direct: shader.direct(point, stream, work),
                    indirect: shader.indirect(point, work),
                    specular: shader.specular(point, stream, work),
                    caustic: shader.caustic(point, work),
                };
                Some((values, point.emitted))
            })
        })?;
        Ok(Self { pixels, truth })
    }

    /// Compares what the cache has made of them: the components at a pixel, given the true specular radiance, or nothing
    /// where they aren't known yet. Such pixels count as the others do in the mean.
    pub(crate) fn measure(
        &self,
        args: &Args,
        size: ImageSize,
        composed: impl Fn(usize, Rgb) -> Option<Components<Rgb>>,
        is_glossy: impl Fn(usize) -> bool,
    ) -> Report {
        let Self { pixels, truth } = self;
        let mut errors = Vec::with_capacity(pixels.len());
        let mut blame = Components::<f64>::default();
        let mut blame_of_glossy = 0.0;
        let (mut n_empty, mut n_unknown) = (0, 0);
        for (&pixel, truth) in pixels.iter().zip(truth) {
            let &Some((truth, emitted)) = truth else {
                n_empty += 1;
                continue;
            };
            let Some(ours) = composed(size.index(pixel), truth.specular) else {
                n_unknown += 1;
                continue;
            };
            let sum =
                |c: &Components<Rgb>| Component::ALL.into_iter().fold(emitted, |s, k| s + c[k]);
            errors.push(film::flip_of_colors(sum(&ours), sum(&truth), args.exposure));
            for component in Component::ALL {
                let mut one = truth;
                one[component] = ours[component];
                let error = f64::from(film::flip_of_colors(sum(&one), sum(&truth), args.exposure));
                blame[component] += error;
                if component == Component::Specular && is_glossy(size.index(pixel)) {
                    blame_of_glossy += error;
                }
            }
        }
        let mean = errors.iter().map(|&e| f64::from(e)).sum::<f64>() / errors.len().max(1) as f64;
        let shown = (errors.len() + n_unknown) as f64 / pixels.len().max(1) as f64;
        let mean = mean * shown * (1.0 - FILTERED_AWAY);
        errors.resize(errors.len() + n_empty, 0.0);
        errors.sort_unstable_by(f32::total_cmp);
        let p995 = errors.get(errors.len() * 995 / 1000).copied().unwrap_or(0.0);
        let worst = Component::ALL
            .into_iter()
            .max_by(|a, b| blame[*a].total_cmp(&blame[*b]))
            .unwrap_or(Component::Direct);
        let estimate = ErrorReport {
            target: args.error,
            measured_mean: mean,
            measured_p995: f64::from(p995),
            held_out_pixels: pixels.len() as u64,
        };
        let glossy_is_worst =
            worst == Component::Specular && blame_of_glossy > 0.5 * blame.specular;
        Report { estimate, worst, glossy_is_worst }
    }
}

/// About so many random pixels.
fn choose(size: ImageSize, n: usize, seed: u64, which: u64) -> Vec<Pixel> {
    let n = n.min(size.n_pixels());
    let mut rng = Rng::new(seed, Stream::HoldOut, which);
    // One in each of n stretches of the picture, so that none is taken twice.
    let stretch = |i: usize| i * size.n_pixels() / n;
    let mut pixels: Vec<usize> = (0..n)
        .map(|i| stretch(i) + (rng.next_f32() * (stretch(i + 1) - stretch(i)) as f32) as usize)
        .collect();
    pixels.dedup();
    pixels.into_iter().map(|i| size.pixel(i)).collect()
}
