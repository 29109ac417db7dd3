//! Layers, and the files they go to.

use std::path::Path;

use base::{Component, Grid, Interrupted, Inventory, Pixel, Rgb};
use cache_map::Origin;
use cli::Interrupt;
use film::{Format, Picture};
use glam::Vec3A;
use rayon::prelude::*;
use serde_json::json;

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
    option("--resolution", format!("{}x{}", args.resolution.width, args.resolution.height));
    option("--seed", args.seed.to_string());
    option("--shadow-rays", shading.shadow_rays.to_string());
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
            let mut file = |name: &str, path: Option<&Path>| {
                path.into_iter().for_each(|p| option(name, p.to_string_lossy().into_owned()));
            };
            file("--from-cache", from_cache);
            file("--save-cache", save_cache);
        }
    }
    words.push("--force".into());
    cli::command_line(words.into_iter().map(Into::into))
}

/// All layers, unless interrupted. The picture itself is the sum emission + direct + indirect + specular + caustics, in
/// that order.
///
/// The layers tell of the picture, not of the run: what was loaded from a cache map had been computed at its pixel, so
/// its `traced` is 1. What this run has computed is told by `--stats`.
pub(crate) fn picture(
    args: &Args,
    frame: &Frame<'_>,
    rendered: &Rendered,
    inputs: &Inventory,
    interrupt: &Interrupt,
) -> Result<Picture, Interrupted> {
    let size = frame.size();
    let counts = rendered.counts;
    let metadata = json!({
        "command": command(args),
        "version": env!("CARGO_PKG_VERSION"),
        "seed": args.seed,
        "inputs": inputs.fingerprint().to_string(),
        "rays": { "eye": counts.eye_rays, "specular": counts.specular_rays, "shadow": counts.shadow_rays },
        "photons_visited": counts.photons_visited,
    });
    let mut picture = Picture::new(size, metadata.to_string());

    let background = frame.shader().background();
    let emission =
        Grid::from_fn(size, |p| frame.point(p).map_or(background, |point| point.emitted()));
    let whole = Grid::from_fn(size, |p| {
        Component::ALL
            .into_iter()
            .fold(emission[p], |sum, component| sum + rendered.values[component][p])
    });
    picture.push_rgb("", &whole);
    for component in Component::ALL {
        picture.push_rgb(layer(component), &rendered.values[component]);
    }
    picture.push_rgb("emission", &emission);

    let mut push = |name: &str, f: &(dyn Fn(Pixel) -> f32 + Sync)| {
        // What lacks a layer is not written.
        if interrupt.go_on() {
            let values = (0..size.n_pixels()).into_par_iter().map(|i| f(size.pixel(i)));
            picture.push(name, values.collect());
        }
    };
    let mut push_vector = |name: &str, axes: [&str; 3], f: &(dyn Fn(Pixel) -> Vec3A + Sync)| {
        for (i, axis) in axes.iter().enumerate() {
            push(&format!("{name}.{axis}"), &|p| f(p)[i]);
        }
    };
    let xyz = ["X", "Y", "Z"];
    push_vector("P", xyz, &|p| frame.point(p).map_or(Vec3A::ZERO, |point| point.facing.position));
    push_vector("N", xyz, &|p| {
        frame.point(p).map_or(Vec3A::ZERO, |point| point.facing.geometric_normal)
    });
    push_vector("Ns", xyz, &|p| {
        frame.point(p).map_or(Vec3A::ZERO, |point| point.facing.shading_normal)
    });
    push_vector("Albedo", ["R", "G", "B"], &|p| {
        frame
            .point(p)
            .map_or(Vec3A::ZERO, |point| Vec3A::from_array(point.material.albedo.to_array()))
    });
    let camera = &frame.shader().scene.camera;
    push("Z", &|p| frame.point(p).map_or(0.0, |point| camera.depth(point.surface.position)));
    for component in Component::ALL {
        let origins = &rendered.origins[component];
        push(&format!("traced.{}", layer(component)), &|p| match origins[p] {
            Origin::Sampled | Origin::Traced => 1.0,
            Origin::None | Origin::Known | Origin::Interpolated => 0.0,
        });
        match &rendered.adaptive {
            None => push(&format!("reason.{}", layer(component)), &|p| match origins[p] {
                Origin::None | Origin::Known | Origin::Interpolated => 0.0,
                Origin::Sampled => 1.0,
                Origin::Traced => 2.0,
            }),
            Some(history) => {
                let (reasons, levels) = (&history.reasons[component], &history.levels[component]);
                let number = |p: Pixel| f32::from(reasons[size.index(p)] as u8);
                push(&format!("reason.{}", layer(component)), &number);
                push(&format!("level.{}", layer(component)), &|p| f32::from(levels[size.index(p)]));
            }
        }
    }
    interrupt.check()?;
    Ok(picture)
}

/// Writes the picture to all outputs.
pub(crate) fn write(args: &Args, picture: &Picture) -> anyhow::Result<()> {
    for path in &args.output {
        match Format::of(path)? {
            Format::Exr => film::write_exr(path, args.common.existing(), picture)?,
            Format::Png => {
                let whole: Grid<Rgb> = picture.rgb("").expect("the whole picture is a layer");
                film::write_png(path, args.common.existing(), &whole, args.exposure)?
            }
        };
    }
    Ok(())
}
