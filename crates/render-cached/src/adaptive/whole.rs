//! Pictures that are computed in full, since a cache costs more than it saves.

use base::{Component, Components, Interrupted, Pixel, Rgb};
use cache_map::{Reason, Value};
use cli::Clock;
use scene::Material;
use shade::{Counts, Work};

use super::glossy::divided;
use super::strictness::Strictness;
use super::{Account, ErrorReport};
use crate::Args;
use crate::frame::Frame;
use crate::original;
use crate::render::{AdaptiveLayers, Progress, Rendered};

/// A picture with fewer pixels that show a surface has too few between its lattices and its edges.
pub(super) const FEWEST_PIXELS: usize = 10_000;

/// Computing a pixel must take as long as visiting so many photons. Measured on the scenes of this project: below, choosing
/// and interpolating take as long.
const LEAST_WORK: f64 = 400.0;

/// A ray takes as long as visiting so many photons.
const PHOTONS_PER_RAY: f64 = 17.0;

/// So many pixels are computed to find out.
const PROBES: usize = 64;

/// Chains that may come to rough surfaces are followed up to so many times more.
const AGAIN: f64 = 3.0;

/// Where they do, what is saved must be twice the least work in a picture of so many pixels: of a small one as many are
/// held out as of a larger one.
const TWICE_AT: f64 = 12_000.0;

/// Pixels beside those that are computed to find out lie so far away.
const BESIDE: u32 = 2;

/// What is to be interpolated is as alike there, as a part of how much neighbors may span.
const ALIKE: f32 = 0.25;

/// What a pixel shows by a component and how long that took, but for the ways of chains: in photons.
type Probed = Components<(Rgb, f32)>;

/// Whether a cache saves time. Chains that may come to rough surfaces are followed again and again: then it doesn't where much of the
/// rest is noise, or all is edges.
pub(crate) fn cache_pays(
    strictness: &Strictness,
    account: &mut Account<'_, '_>,
) -> Result<bool, Interrupted> {
    let frame = account.frame;
    let n_pixels = frame.n_surfaces();
    if n_pixels < FEWEST_PIXELS {
        return Ok(false);
    }
    let has_rough = frame.shader().scene.materials.iter().any(Material::is_rough);
    let width = frame.size().width;
    let beside = |Pixel { x, y }: Pixel| Pixel {
        x: if x + BESIDE < width { x + BESIDE } else { x.saturating_sub(BESIDE) },
        y,
    };
    let some: Vec<_> = frame.pixels_that_show(|_| true).step_by(n_pixels / PROBES).collect();
    let rays_before = account.counts().specular_rays;
    let probed = account.probe(&some, |&pixel, work| {
        let there = has_rough.then(|| of_pixel(frame, beside(pixel), work)).flatten();
        (of_pixel(frame, pixel, work), there)
    })?;
    let chain_rays = account.counts().specular_rays - rays_before;
    let (mut all, mut saved) = (PHOTONS_PER_RAY * chain_rays as f64, 0.0);
    for (here, there) in &probed {
        let Some(here) = here else { continue };
        let sum: f32 = Component::ALL.iter().map(|&c| here[c].0.luminance()).sum();
        for component in Component::ALL {
            let (value, work) = here[component];
            let most = ALIKE * strictness.tolerance(component).edge * sum;
            all += f64::from(work);
            if there.as_ref().is_some_and(|there| (there[component].0 - value).size() <= most) {
                saved += f64::from(work);
            }
        }
    }
    let n = some.len() as f64;
    if !has_rough {
        return Ok(all >= LEAST_WORK * n);
    }
    // Two pixels were computed for each.
    let again = AGAIN * PHOTONS_PER_RAY * chain_rays as f64 / 2.0;
    Ok(saved >= LEAST_WORK * (1.0 + TWICE_AT / n_pixels as f64) * n + again)
}

/// All components of a pixel, computed; nothing where it shows no surface.
fn of_pixel(frame: &Frame<'_>, pixel: Pixel, work: &mut Work) -> Option<Probed> {
    let shader = frame.shader();
    let taken = |work: &Work| {
        let Counts { shadow_rays, gather_rays, photons_visited, .. } = work.counts;
        PHOTONS_PER_RAY * (shadow_rays + gather_rays) as f64 + photons_visited as f64
    };
    frame.at(pixel, work, |point, stream, work| {
        // Of diffuse light irradiance is alike, whatever color it falls on.
        let albedo = point.albedo.map(|a| a.max(1e-3));
        Some(Components::from_fn(|component| {
            let before = taken(work);
            let value = match component {
                Component::Direct => divided(shader.direct(point, stream, work), albedo),
                Component::Indirect => divided(shader.indirect(point, work), albedo),
                Component::Specular => shader.specular(point, stream, work),
                Component::Caustic => divided(shader.caustic(point, work), albedo),
            };
            (value, (taken(work) - before) as f32)
        }))
    })
}

/// The picture of mode original, without error.
pub(crate) fn render(
    args: &Args,
    frame: &Frame<'_>,
    clock: &mut Clock,
    progress: &Progress<'_>,
) -> Result<Rendered, Interrupted> {
    let rendered = original::render(frame, clock, progress)?;
    let size = frame.size();
    let reason = |i: usize| match frame.shows_surface(i) {
        true => Reason::Whole,
        false => Reason::Interpolated,
    };
    let reasons = Components::from_fn(|_: Component| (0..size.n_pixels()).map(reason).collect());
    let levels = Components::from_fn(|_| vec![0; size.n_pixels()]);
    let error = ErrorReport {
        target: args.error,
        measured_mean: 0.0,
        measured_p995: 0.0,
        held_out_pixels: 0,
    };
    Ok(Rendered { adaptive: Some(AdaptiveLayers { reasons, levels, error }), ..rendered })
}
