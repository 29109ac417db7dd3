//! `--mode paper`: low-resolution samples, the cache map, interpolation, and tracing where no candidate fits.

use std::path::Path;

use anyhow::bail;
use base::{Component, Components, Grid, Inventory, Pixel, Window};
use cache_map::{CacheMap, Origin, Saved, SurfacePoint, Thresholds, choose_pixels_in};
use cli::{Clock, Seconds};
use mapfile::Error;
use shade::Counts;

use crate::frame::Frame;
use crate::render::{Progress, Rendered};
use crate::{Args, output};

/// What the options mean for a scene of the given diagonal.
pub(crate) fn thresholds(args: &Args, diagonal: f32) -> Thresholds {
    let paper = &args.paper;
    Thresholds {
        direct: paper.tau_direct,
        indirect: paper.tau_indirect,
        specular: paper.tau_specular,
        r0: paper.r0.unwrap_or(diagonal * 0.1),
        reach: paper.region / 2,
    }
}

/// Share of the pixels that are sampled: one in each quarter of the region.
fn fraction(args: &Args) -> f64 {
    let cell = f64::from((args.paper.region / 2).max(1));
    args.paper.fraction.unwrap_or(1.0 / (cell * cell))
}

/// Renders what lies in the window `computed` of the frame; beyond it there are samples only.
pub(crate) fn render(
    args: &Args,
    frame: &Frame<'_>,
    computed: Window,
    inputs: &Inventory,
    thresholds: &Thresholds,
    clock: &mut Clock,
    progress: &Progress<'_>,
) -> anyhow::Result<Rendered> {
    let mut counts = Counts::default();
    let mut seconds = Components::<Seconds>::default();
    let mut traced = Components::<u64>::default();

    let surfaces = Grid::from_fn(frame.size(), |pixel| {
        let facing = frame.point(pixel)?.facing;
        Some(SurfacePoint {
            position: facing.position.into(),
            normal: facing.shading_normal.into(),
        })
    });
    let mut map = CacheMap::of_part(surfaces, frame.window(), computed);
    if let Some(path) = &args.paper.from_cache {
        let remedy = output::cache_command(args, path);
        match Saved::open(path, inputs, &remedy) {
            Err(Error::OtherKind { path, found, .. }) if found == cache_map::RECORDS_KIND => bail!(
                "{} was saved in mode adaptive, which keeps no radiance; render with --mode adaptive, or replace it \
                 with: {remedy}",
                path.display()
            ),
            opened => {
                let saved = opened?;
                map.adopt(&saved);
                saved.check_untouched()?;
            }
        }
    }
    let samples =
        map.unserved(&choose_pixels_in(frame.window(), fraction(args), args.seed), fraction(args));
    let mut cache = clock.lap();

    let mut trace = |map: &mut CacheMap,
                     component: Component,
                     pixels: &[Pixel],
                     origin|
     -> anyhow::Result<()> {
        let what = if origin == Origin::Sampled { "samples" } else { component.name() };
        let (radiance, c) = progress.run(what, pixels.len(), |watch| {
            progress.resume.chunks(pixels, watch, |pixels| frame.shade(component, pixels, watch))
        })?;
        map.record(component, pixels, &radiance, origin);
        traced[component] += pixels.len() as u64;
        counts += c;
        Ok(())
    };
    for component in Component::ALL {
        let missing = map.missing(component, &samples);
        trace(&mut map, component, &missing, Origin::Sampled)?;
        seconds[component] += clock.lap();
    }
    for component in Component::ALL {
        let to_trace = map.plan(component, thresholds);
        cache += clock.lap();
        trace(&mut map, component, &to_trace, Origin::Traced)?;
        seconds[component] += clock.lap();
        map.interpolate(component, thresholds);
        cache += clock.lap();
    }
    if let Some(path) = &args.paper.save_cache {
        let made_by = concat!("render-cached ", env!("CARGO_PKG_VERSION"));
        let command = output::cache_command(args, Path::new("{file}"));
        map.save(path, args.common.existing(), inputs, made_by, &command)?;
        cache += clock.lap();
    }
    let origins = Components::from_fn(|component| map.origins(component).clone());
    Ok(Rendered {
        values: map.into_values(),
        origins,
        traced,
        counts,
        seconds,
        cache,
        adaptive: None,
    })
}
