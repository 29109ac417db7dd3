//! Layers, and the files they go to.

use std::borrow::Cow;
use std::fs::File;
use std::io;
use std::path::Path;

use base::{Component, Components, Grid, ImageSize, Inventory, Pixel, Rgb, Window};
use cache_map::Origin;
use cli::Interrupt;
use film::{Filter, Format, PackedRows, Picture};
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

/// A block of rows of a picture, as it goes to files.
#[derive(Debug)]
pub(crate) struct Block {
    /// Nothing where no file takes the picture alone.
    shown: Option<Grid<Rgb>>,
    /// Nothing where no file takes layers.
    layers: Option<PackedRows>,
}

/// The blocks of what `extent` shows of what was rendered of its frame, from top to bottom.
///
/// Each is made and packed on its own, by one thread: few enough pixels to stay in its cache.
///
/// # Errors
/// When a value isn't finite.
pub(crate) fn blocks(
    args: &Args,
    extent: &Extent,
    frame: &Frame<'_>,
    rendered: &Rendered,
    inputs: &Inventory,
) -> anyhow::Result<Vec<Block>> {
    let metadata = json!({
        "command": command(args),
        "version": env!("CARGO_PKG_VERSION"),
        "seed": args.seed,
        "inputs": inputs.fingerprint().to_string(),
        "error": rendered.adaptive.as_ref().map(|a| a.error),
    });
    let metadata = metadata.to_string();
    let file = files(args, Format::Exr)?.next();
    let is_shown = files(args, Format::Png)?.next().is_some();
    let blocks: Vec<Extent> = extent.blocks(args).map(|block| block.in_frame_of(extent)).collect();
    let block = |extent: &Extent| {
        let n = args.supersample;
        let subpixels = extent.filtered.subdivided(n);
        let emitted = |p| frame.emitted(extent.in_frame(subpixels.in_whole(p)));
        let emission = to_pixels(args, extent, Cow::Owned(Grid::from_fn(subpixels.size, emitted)));
        let components = Components::from_fn(|component| {
            let values = &rendered.values[component];
            let shown = match extent.frame == subpixels {
                true => Cow::Borrowed(values),
                false => Cow::Owned(values.cut(extent.frame, subpixels)),
            };
            to_pixels(args, extent, shown)
        });
        // The picture is the sum of emission, direct, indirect, specular and caustics, in that order.
        let shown = Grid::from_fn(emission.size(), |p| {
            Component::ALL
                .into_iter()
                .fold(emission[p], |sum, component| sum + components[component][p])
        });
        let pack = |file| {
            let mut picture = Picture::part(extent.part, metadata.clone());
            picture.push_rgb("", &shown);
            let Components { direct, indirect, specular, caustic } = components;
            for (component, values) in
                Component::ALL.into_iter().zip([direct, indirect, specular, caustic])
            {
                // Freed, so that other channels find memory that caches still hold.
                picture.push_rgb(layer(component), { values }.as_ref());
            }
            picture.push_rgb("emission", { emission }.as_ref());
            push_surfaces(&mut picture, args, extent, frame);
            for component in Component::ALL {
                push_history(&mut picture, args, extent, rendered, component);
            }
            PackedRows::new(file, &picture)
        };
        let layers = file.map(pack).transpose()?;
        Ok(Block { shown: is_shown.then_some(shown), layers })
    };
    blocks.par_iter().map(block).collect()
}

/// The pixels of a part of a picture, from its subpixels and those that filters look at around it.
fn to_pixels<'a>(
    args: &Args,
    extent: &Extent,
    subpixels: Cow<'a, Grid<Rgb>>,
) -> Cow<'a, Grid<Rgb>> {
    match (args.supersample, filter(args)) {
        (1, Filter::Box) => subpixels,
        (n, filter) => {
            let pixels = film::reconstruct(&subpixels, n, filter);
            Cow::Owned(pixels.cut(extent.filtered, extent.part))
        }
    }
}

/// Writes the picture, or the part of it that is asked for, to all outputs. Its blocks come from top to bottom; no file is
/// begun before the first is there.
pub(crate) fn write(
    args: &Args,
    part: Window,
    blocks: impl Iterator<Item = anyhow::Result<Block>>,
    interrupt: &Interrupt,
) -> anyhow::Result<()> {
    if args.output.is_empty() {
        return Ok(());
    }
    let existing = args.common.existing();
    let mut pngs = files(args, Format::Png)?.peekable();
    let is_shown = pngs.peek().is_some();
    let mut shown = Vec::new();
    let mut layers = blocks.map(|block| {
        let block = block?;
        interrupt.check()?;
        shown.extend(block.shown.iter().flat_map(Grid::values));
        Ok(block.layers)
    });
    let mut exrs = files(args, Format::Exr)?;
    match exrs.next() {
        Some(path) => {
            let layers = layers.by_ref().filter_map(Result::transpose);
            film::write_packed_exr::<anyhow::Error>(path, existing, part, layers)?;
            for other in exrs {
                atomic_file::write(other, existing, |out| {
                    io::copy(&mut File::open(path)?, out).map(drop)
                })?;
            }
        }
        None => layers.by_ref().try_for_each(|block: anyhow::Result<_>| block.map(drop))?,
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

/// What the eye sees first: position, normals on the side of the eye, albedo, depth; the mean of the subpixels that show
/// a surface. All 0 where none does.
fn push_surfaces(picture: &mut Picture, args: &Args, extent: &Extent, frame: &Frame<'_>) {
    const NAMES: [&str; 13] = [
        "P.X", "P.Y", "P.Z", "N.X", "N.Y", "N.Z", "Ns.X", "Ns.Y", "Ns.Z", "Albedo.R", "Albedo.G",
        "Albedo.B", "Z",
    ];
    let size = picture.size();
    let camera = &frame.shader().scene.camera;
    let mut looks = frame.looks();
    let mut of_subpixel = |pixel: Pixel| {
        let ShadingPoint { facing, albedo: a, .. } = looks.point(pixel)?;
        let Surface { position: p, geometric_normal: n, shading_normal: ns, .. } = facing;
        let depth = camera.depth(p);
        Some([p.x, p.y, p.z, n.x, n.y, n.z, ns.x, ns.y, ns.z, a.r, a.g, a.b, depth])
    };
    let mut channels = NAMES.map(|_| Vec::with_capacity(size.n_pixels()));
    size.pixels().for_each(|pixel| {
        let (mut sum, mut count) = ([0.0_f32; 13], 0.0_f32);
        for values in extent.subpixels(pixel, args.supersample).filter_map(&mut of_subpixel) {
            sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
            count += 1.0;
        }
        let means = sum.map(|v| v / count.max(1.0));
        channels.iter_mut().zip(means).for_each(|(channel, mean)| channel.push(mean));
    });
    for (name, values) in NAMES.into_iter().zip(channels) {
        picture.push(name, values);
    }
}

/// Whether, and why, a component was computed at each pixel: the share of its subpixels, and of reasons and levels the
/// greatest number.
///
/// These layers tell of the picture, not of the run: in mode paper, what was loaded from a cache map had been computed at its
/// pixel, so its `traced` is 1. In mode adaptive it may have been computed elsewhere: its `traced` is 0, and its `reason`
/// says so. What this run has computed is told by `--stats`: it depends on how the picture was split.
fn push_history(
    picture: &mut Picture,
    args: &Args,
    extent: &Extent,
    rendered: &Rendered,
    component: Component,
) {
    let (name, n) = (layer(component), args.supersample);
    let origins = &rendered.origins[component];
    let (size, fine) = (picture.size(), origins.size());
    let computed = |o: &Origin| matches!(o, Origin::Sampled | Origin::Traced);
    let of_subpixels = |pixel| extent.subpixels(pixel, n);
    let share = 1.0 / (n * n) as f32;
    picture.push(
        format!("traced.{name}"),
        folded(size, of_subpixels, |sum, p| {
            sum + share * f32::from(u8::from(computed(&origins[p])))
        }),
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
            picture
                .push(reason, folded(size, of_subpixels, |most, p| number(&origins[p]).max(most)));
        }
        Some(history) => {
            let (reasons, levels) = (&history.reasons[component], &history.levels[component]);
            let number = |p: Pixel| f32::from(reasons[fine.index(p)] as u8);
            picture.push(reason, folded(size, of_subpixels, |most, p| number(p).max(most)));
            let level = |p: Pixel| f32::from(levels[fine.index(p)]);
            picture.push(
                format!("level.{name}"),
                folded(size, of_subpixels, |most, p| level(p).max(most)),
            );
        }
    }
}

/// `f` folded over the subpixels of each pixel.
fn folded<I: Iterator<Item = Pixel>>(
    size: ImageSize,
    subpixels: impl Fn(Pixel) -> I,
    f: impl Fn(f32, Pixel) -> f32,
) -> Vec<f32> {
    let mut values = Vec::with_capacity(size.n_pixels());
    size.pixels().for_each(|pixel| values.push(subpixels(pixel).fold(0.0, &f)));
    values
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
