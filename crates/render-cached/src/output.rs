//! Layers, and the files they go to.

use std::fs::File;
use std::io;
use std::path::Path;

use base::{Component, Components, Grid, ImageSize, Inventory, Pixel, Rgb, Window};
use cache_map::Origin;
use cli::Interrupt;
use film::{Filter, Format, Picture};
use geometry::Surface;
use rayon::prelude::*;
use serde_json::json;
use shade::ShadingPoint;

use crate::frame::Frame;
use crate::render::Rendered;
use crate::tile::Extent;
use crate::{Args, Indirect, Mode};

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

/// The command that makes the file of layers anew, with its name or `{file}` in its place.
pub(crate) fn layers_command(args: &Args, layers: &Path) -> String {
    let option = ["--save-layers".into(), layers.into()];
    format!("{} {}", command(args), cli::command_line(option))
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
    if args.supersample > 1 || filter(args) != Filter::Box {
        option("--supersample", args.supersample.to_string());
        option("--filter", filter(args).name().into());
    }
    option("--seed", args.seed.to_string());
    option("--shadow-rays", shading.shadow_rays.to_string());
    option("--glossy-rays", shading.glossy_rays.to_string());
    match shading.indirect {
        Indirect::Estimate => option("--gather", shading.gather.to_string()),
        Indirect::Gather => {
            option("--indirect", "gather".into());
            option("--gather-rays", shading.gather_rays.to_string());
        }
    }
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

/// Some rows of a picture, as they go to files.
#[derive(Debug)]
pub(crate) struct Band {
    whole: Grid<Rgb>,
    /// Nothing where no file takes them.
    layers: Option<Picture>,
}

impl Band {
    /// What `extent` shows of what was rendered of its frame.
    pub(crate) fn new(
        args: &Args,
        extent: &Extent,
        frame: &Frame<'_>,
        rendered: &Rendered,
        inputs: &Inventory,
    ) -> anyhow::Result<Self> {
        let n = args.supersample;
        let shown = extent.filtered.subdivided(n);
        let to_pixels = |subpixels: Grid<Rgb>| match (n, filter(args)) {
            (1, Filter::Box) => subpixels,
            (n, filter) => {
                film::reconstruct(&subpixels, n, filter).cut(extent.filtered, extent.part)
            }
        };
        let emission =
            Grid::from_fn(shown.size, |p| frame.emitted(extent.in_frame(shown.in_whole(p))));
        let emission = to_pixels(emission);
        let components = Components::from_fn(|component| {
            to_pixels(rendered.values[component].cut(extent.frame, shown))
        });
        let whole = Grid::from_fn(emission.size(), |p| {
            Component::ALL
                .into_iter()
                .fold(emission[p], |sum, component| sum + components[component][p])
        });
        let is_layered = files(args, Format::Exr)?.next().is_some();
        let layers = is_layered
            .then(|| layers(args, extent, frame, rendered, inputs, &emission, &components, &whole));
        Ok(Self { whole, layers })
    }
}

/// Writes the picture, or the part of it that is asked for, to all outputs. Its bands come from top to bottom; no file is begun
/// before the first is there.
pub(crate) fn write(
    args: &Args,
    part: Window,
    bands: impl Iterator<Item = anyhow::Result<Band>>,
    interrupt: &Interrupt,
) -> anyhow::Result<()> {
    if args.output.is_empty() {
        return Ok(());
    }
    let existing = args.common.existing();
    let mut pngs = files(args, Format::Png)?.peekable();
    let (is_shown, mut shown) = (pngs.peek().is_some(), Vec::new());
    let mut layers = bands.map(|band| {
        let Band { whole, layers } = band?;
        interrupt.check()?;
        if is_shown {
            shown.extend_from_slice(whole.values());
        }
        Ok(layers)
    });
    let mut exrs = files(args, Format::Exr)?;
    match exrs.next() {
        Some(path) => {
            let layers = layers.by_ref().filter_map(Result::transpose);
            film::write_exr_bands::<Picture, anyhow::Error>(path, existing, part, layers)?;
            for other in exrs {
                atomic_file::write(other, existing, |out| {
                    io::copy(&mut File::open(path)?, out).map(drop)
                })?;
            }
        }
        None => layers.by_ref().try_for_each(|band: anyhow::Result<_>| band.map(drop))?,
    }
    drop(layers);
    let shown = is_shown.then(|| Grid::from_values(part.size, shown));
    for (path, shown) in pngs.zip(shown.iter().cycle()) {
        film::write_png(path, existing, shown, args.exposure)?;
    }
    Ok(())
}

/// The outputs of a format.
fn files(args: &Args, format: Format) -> anyhow::Result<impl Iterator<Item = &Path>> {
    let formats: Vec<_> =
        args.output.iter().map(|path| Format::of(path)).collect::<Result<_, _>>()?;
    let outputs = args.output.iter().zip(formats);
    Ok(outputs.filter(move |(_, f)| *f == format).map(|(path, _)| path.as_path()))
}

/// All layers. The picture itself is the sum emission + direct + indirect + specular + caustics, in that order.
///
/// The layers tell of the picture, not of the run: in mode paper, what was loaded from a cache map had been computed at its
/// pixel, so its `traced` is 1. In mode adaptive it may have been computed elsewhere: its `traced` is 0, and its `reason`
/// says so. What this run has computed is told by `--stats`: it depends on how the picture was split.
#[expect(clippy::too_many_arguments, reason = "all that is known of the picture, each once")]
fn layers(
    args: &Args,
    extent: &Extent,
    frame: &Frame<'_>,
    rendered: &Rendered,
    inputs: &Inventory,
    emission: &Grid<Rgb>,
    components: &Components<Grid<Rgb>>,
    whole: &Grid<Rgb>,
) -> Picture {
    let metadata = json!({
        "command": command(args),
        "version": env!("CARGO_PKG_VERSION"),
        "seed": args.seed,
        "inputs": inputs.fingerprint().to_string(),
        "error": rendered.adaptive.as_ref().map(|a| a.error),
    });
    let mut picture = Picture::part(extent.part, metadata.to_string());
    picture.push_rgb("", whole);
    for component in Component::ALL {
        picture.push_rgb(layer(component), &components[component]);
    }
    picture.push_rgb("emission", emission);
    let subpixels = |pixel| extent.subpixels(pixel, args.supersample);
    push_surfaces(&mut picture, frame, &subpixels);
    for component in Component::ALL {
        push_history(&mut picture, component, rendered, args.supersample, &subpixels);
    }
    picture
}

/// What the eye sees first: position, normals on the side of the eye, albedo, depth; the mean of the subpixels that show
/// a surface. All 0 where none does.
fn push_surfaces<I: Iterator<Item = Pixel>>(
    picture: &mut Picture,
    frame: &Frame<'_>,
    subpixels: &(impl Fn(Pixel) -> I + Sync),
) {
    const NAMES: [&str; 13] = [
        "P.X", "P.Y", "P.Z", "N.X", "N.Y", "N.Z", "Ns.X", "Ns.Y", "Ns.Z", "Albedo.R", "Albedo.G",
        "Albedo.B", "Z",
    ];
    let size = picture.size();
    let camera = &frame.shader().scene.camera;
    let of_subpixel = |pixel: Pixel| {
        let ShadingPoint { facing, albedo: a, .. } = frame.point(pixel)?;
        let Surface { position: p, geometric_normal: n, shading_normal: ns, .. } = facing;
        let depth = camera.depth(p);
        Some([p.x, p.y, p.z, n.x, n.y, n.z, ns.x, ns.y, ns.z, a.r, a.g, a.b, depth])
    };
    let pixels: Vec<[f32; 13]> = (0..size.n_pixels())
        .into_par_iter()
        .map(|i| {
            let (mut sum, mut count) = ([0.0_f32; 13], 0.0_f32);
            for values in subpixels(size.pixel(i)).filter_map(of_subpixel) {
                sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
                count += 1.0;
            }
            sum.map(|v| v / count.max(1.0))
        })
        .collect();
    for (channel, name) in NAMES.into_iter().enumerate() {
        picture.push(name, pixels.iter().map(|pixel| pixel[channel]).collect());
    }
}

/// Whether, and why, a component was computed at each pixel: the share of its subpixels, and of reasons and levels the
/// greatest number.
fn push_history<I: Iterator<Item = Pixel>>(
    picture: &mut Picture,
    component: Component,
    rendered: &Rendered,
    n: u32,
    subpixels: &impl Fn(Pixel) -> I,
) {
    let name = layer(component);
    let origins = &rendered.origins[component];
    let (size, fine) = (picture.size(), origins.size());
    let computed = |o: &Origin| matches!(o, Origin::Sampled | Origin::Traced);
    let over = |start: f32, f: &dyn Fn(f32, Pixel) -> f32| -> Vec<f32> {
        (0..size.n_pixels()).map(|i| subpixels(size.pixel(i)).fold(start, f)).collect()
    };
    let share = 1.0 / (n * n) as f32;
    picture.push(
        format!("traced.{name}"),
        over(0.0, &|sum, p| sum + share * f32::from(u8::from(computed(&origins[p])))),
    );
    let reason = format!("reason.{name}");
    match &rendered.adaptive {
        None => {
            let number = |o: &Origin| -> f32 {
                match o {
                    Origin::None | Origin::Known | Origin::Interpolated => 0.0,
                    Origin::Sampled => 1.0,
                    Origin::Traced => 2.0,
                }
            };
            picture.push(reason, over(0.0, &|most, p| number(&origins[p]).max(most)));
        }
        Some(history) => {
            let (reasons, levels) = (&history.reasons[component], &history.levels[component]);
            let number = |p: Pixel| f32::from(reasons[fine.index(p)] as u8);
            picture.push(reason, over(0.0, &|most, p| number(p).max(most)));
            let level = |p: Pixel| f32::from(levels[fine.index(p)]);
            picture.push(format!("level.{name}"), over(0.0, &|most, p| level(p).max(most)));
        }
    }
}

/// How pixels are made of subpixels.
pub(crate) fn filter(args: &Args) -> Filter {
    match args.filter {
        crate::args::Filter::Box => Filter::Box,
        crate::args::Filter::Tent => Filter::Tent,
        crate::args::Filter::Gaussian => Filter::Gaussian,
        crate::args::Filter::Mitchell => Filter::Mitchell,
    }
}
