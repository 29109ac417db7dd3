//! Layers, and the files they go to.

use std::path::Path;

use base::{Component, Grid, ImageSize, Inventory, Rgb};
use cache_map::Origin;
use cli::Interrupt;
use film::{Format, Picture};
use geometry::Surface;
use rayon::prelude::*;
use serde_json::json;
use shade::ShadingPoint;

use crate::frame::Frame;
use crate::render::Rendered;
use crate::{Args, Mode};

/// The name of a component's layer.
fn layer(component: Component) -> &'static str {
    match component {
        Component::Caustic => "caustics",
        other => other.name(),
    }
}

/// The command that makes the picture anew, but for the name of the output: only what decides its contents.
pub(crate) fn command(args: &Args) -> String {
    command_line(args, args.paper.from_cache.as_deref(), None)
}

/// The command that makes the cache map anew, with its name or `{file}` in its place. It starts from no other.
pub(crate) fn cache_command(args: &Args, cache: &Path) -> String {
    command_line(args, None, Some(cache))
}

fn command_line(args: &Args, from_cache: Option<&Path>, save_cache: Option<&Path>) -> String {
    let (shading, paper) = (&args.shading, &args.paper);
    let mut words: Vec<String> = vec!["render-cached".into()];
    words.extend(args.scene.iter().map(|p| p.to_string_lossy().into_owned()));
    let mut option = |name: &str, value: String| words.extend([name.into(), value]);
    if let Some(path) = &args.photons {
        option("--photons", path.to_string_lossy().into_owned());
    }
    if let Some(ImageSize { width, height }) = args.resolution {
        option("--resolution", format!("{width}x{height}"));
    }
    option("--seed", args.seed.to_string());
    option("--shadow-rays", shading.shadow_rays.to_string());
    option("--glossy-rays", shading.glossy_rays.to_string());
    option("--gather", shading.gather.to_string());
    option("--caustic-gather", shading.caustic_gather.to_string());
    option("--kernel", shading.kernel.name().into());
    let mut length = |name: &str, value: Option<f32>| {
        value.into_iter().for_each(|v| option(name, v.to_string()));
    };
    length("--gather-radius", shading.gather_radius);
    length("--caustic-radius", shading.caustic_radius);
    match args.mode {
        Mode::Original => option("--mode", "original".into()),
        Mode::Adaptive => {
            option("--mode", "adaptive".into());
            option("--error", args.error.to_string());
            // The error is that of what is shown.
            option("--exposure", args.exposure.to_string());
        }
        Mode::Paper => {
            length("--r0", paper.r0);
            option("--mode", "paper".into());
            option("--tau-direct", paper.tau_direct.to_string());
            option("--tau-indirect", paper.tau_indirect.to_string());
            option("--tau-specular", paper.tau_specular.to_string());
            option("--region", paper.region.to_string());
            if let Some(fraction) = paper.fraction {
                option("--fraction", fraction.to_string());
            }
        }
    }
    let mut file = |name: &str, path: Option<&Path>| {
        path.into_iter().for_each(|p| option(name, p.to_string_lossy().into_owned()));
    };
    file("--from-cache", from_cache);
    file("--save-cache", save_cache);
    words.extend(args.scene_options.words());
    words.push("--force".into());
    cli::command_line(words.into_iter().map(Into::into))
}

/// Writes the picture to all outputs.
pub(crate) fn write(
    args: &Args,
    frame: &Frame<'_>,
    rendered: &Rendered,
    inputs: &Inventory,
    interrupt: &Interrupt,
) -> anyhow::Result<()> {
    let background = frame.shader().background();
    let emission =
        Grid::from_fn(frame.size(), |p| frame.point(p).map_or(background, |point| point.emitted()));
    let whole = Grid::from_fn(frame.size(), |p| {
        Component::ALL
            .into_iter()
            .fold(emission[p], |sum, component| sum + rendered.values[component][p])
    });
    interrupt.check()?;
    for path in &args.output {
        let existing = args.common.existing();
        match Format::of(path)? {
            Format::Png => film::write_png(path, existing, &whole, args.exposure)?,
            Format::Exr => {
                let picture = layers(args, frame, rendered, inputs, &emission, &whole);
                interrupt.check()?;
                film::write_exr(path, existing, &picture)?
            }
        };
    }
    Ok(())
}

/// All layers. The picture itself is the sum emission + direct + indirect + specular + caustics, in that order.
///
/// The layers tell of the picture, not of the run: in mode paper, what was loaded from a cache map had been computed at its
/// pixel, so its `traced` is 1. In mode adaptive it may have been computed elsewhere: its `traced` is 0, and its `reason`
/// says so. What this run has computed is told by `--stats`.
fn layers(
    args: &Args,
    frame: &Frame<'_>,
    rendered: &Rendered,
    inputs: &Inventory,
    emission: &Grid<Rgb>,
    whole: &Grid<Rgb>,
) -> Picture {
    let size = frame.size();
    let counts = rendered.counts;
    let metadata = json!({
        "command": command(args),
        "version": env!("CARGO_PKG_VERSION"),
        "seed": args.seed,
        "inputs": inputs.fingerprint().to_string(),
        "rays": { "eye": counts.eye_rays, "specular": counts.specular_rays, "shadow": counts.shadow_rays },
        "photons_visited": counts.photons_visited,
        "error": rendered.adaptive.as_ref().map(|a| a.error),
    });
    let mut picture = Picture::new(size, metadata.to_string());
    picture.push_rgb("", whole);
    for component in Component::ALL {
        picture.push_rgb(layer(component), &rendered.values[component]);
    }
    picture.push_rgb("emission", emission);
    push_surfaces(&mut picture, frame);
    for component in Component::ALL {
        push_history(&mut picture, component, rendered);
    }
    picture
}

/// What the eye sees first: position, normals on the side of the eye, albedo, depth. All 0 where there is no surface.
fn push_surfaces(picture: &mut Picture, frame: &Frame<'_>) {
    const NAMES: [&str; 13] = [
        "P.X", "P.Y", "P.Z", "N.X", "N.Y", "N.Z", "Ns.X", "Ns.Y", "Ns.Z", "Albedo.R", "Albedo.G",
        "Albedo.B", "Z",
    ];
    let size = frame.size();
    let camera = &frame.shader().scene.camera;
    let pixels: Vec<[f32; 13]> = (0..size.n_pixels())
        .into_par_iter()
        .map(|i| {
            let Some(ShadingPoint { facing, albedo: a, .. }) = frame.point(size.pixel(i)) else {
                return [0.0; 13];
            };
            let Surface { position: p, geometric_normal: n, shading_normal: ns, .. } = facing;
            let depth = camera.depth(p);
            [p.x, p.y, p.z, n.x, n.y, n.z, ns.x, ns.y, ns.z, a.r, a.g, a.b, depth]
        })
        .collect();
    for (channel, name) in NAMES.into_iter().enumerate() {
        picture.push(name, pixels.iter().map(|pixel| pixel[channel]).collect());
    }
}

/// Whether, and why, a component was computed at each pixel.
fn push_history(picture: &mut Picture, component: Component, rendered: &Rendered) {
    let name = layer(component);
    let origins = rendered.origins[component].values();
    let computed = |o: &Origin| matches!(o, Origin::Sampled | Origin::Traced);
    picture.push(
        format!("traced.{name}"),
        origins.iter().map(|o| f32::from(u8::from(computed(o)))).collect(),
    );
    let reason = format!("reason.{name}");
    match &rendered.adaptive {
        None => {
            let number = |o: &Origin| match o {
                Origin::None | Origin::Known | Origin::Interpolated => 0.0,
                Origin::Sampled => 1.0,
                Origin::Traced => 2.0,
            };
            picture.push(reason, origins.iter().map(number).collect());
        }
        Some(history) => {
            let numbers = history.reasons[component].iter().map(|&r| f32::from(r as u8));
            picture.push(reason, numbers.collect());
            let levels = history.levels[component].iter().map(|&l| f32::from(l));
            picture.push(format!("level.{name}"), levels.collect());
        }
    }
}
