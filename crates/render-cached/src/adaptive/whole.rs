//! Pictures that are computed in full, since a cache costs more than it saves.

use base::{Component, Components, Interrupted};
use cache_map::Reason;
use cli::Clock;
use shade::Counts;

use super::{Account, ErrorReport};
use crate::Args;
use crate::frame::Frame;
use crate::original;
use crate::render::{AdaptiveLayers, Progress, Rendered};

/// A picture with fewer pixels that show a surface has too few between its lattices and its edges.
pub(super) const FEWEST_PIXELS: usize = 10_000;

/// Computing a pixel must take as long as visiting so many photons. Measured on the scenes of this project: below, choosing
/// and interpolating take as long.
const LEAST_WORK: u64 = 400;

/// A ray takes as long as visiting so many photons.
const PHOTONS_PER_RAY: u64 = 17;

/// So many pixels are computed to find out.
const PROBES: usize = 64;

/// Whether a cache saves time.
pub(crate) fn cache_pays(account: &mut Account<'_, '_>) -> Result<bool, Interrupted> {
    let frame = account.frame;
    let n_pixels = frame.n_surfaces();
    if n_pixels < FEWEST_PIXELS {
        return Ok(false);
    }
    let some: Vec<_> = frame.pixels_that_show(|_| true).step_by(n_pixels / PROBES).collect();
    let shader = frame.shader();
    let before = account.counts();
    account.probe(&some, |&pixel, work| {
        frame.at(pixel, work, |point, stream, work| {
            let _ = shader.direct(point, stream, work);
            let _ = shader.indirect(point, work);
            let _ = shader.specular(point, stream, work);
            let _ = shader.caustic(point, work);
        });
    })?;
    let counts = account.counts();
    let rays_of = |c: Counts| c.shadow_rays + c.specular_rays + c.gather_rays;
    let rays = rays_of(counts) - rays_of(before);
    let photons = counts.photons_visited - before.photons_visited;
    Ok(photons + PHOTONS_PER_RAY * rays >= LEAST_WORK * some.len() as u64)
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
