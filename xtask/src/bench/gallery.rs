//! The pictures of the report, and what is known of their pixels, as PNG files that a page can embed.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use base::{Grid, ImageSize, Pixel, Rgb};
use film::{Existing, Picture};

use crate::bench::plan::EXPOSURE;
use crate::bench::reasons;
use crate::bench::runs::SceneRuns;
use crate::programs::root;

/// The names of the components in the layers of a picture, in the order of the report.
pub(crate) const LAYERS: [&str; 4] = ["direct", "indirect", "specular", "caustics"];

/// How much of the pictures a report holds: the largest sizes that it shows, in pixels each way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Detail {
    pub(crate) picture: u32,
    /// Of pictures whose every pixel is told.
    pub(crate) pixels: u32,
}

/// The pictures of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Gallery {
    /// Side of the pictures.
    pub(crate) size: u32,
    /// Side of those whose every pixel is told.
    pub(crate) pixels: u32,
    /// The original first.
    pub(crate) modes: Vec<Shown>,
}

/// What is shown of a mode. All are the bytes of PNG files.
#[derive(Clone, Debug)]
pub(crate) struct Shown {
    pub(crate) mode: String,
    pub(crate) picture: Vec<u8>,
    /// FLIP against the original, for the others.
    pub(crate) difference: Option<Vec<u8>>,
    /// Where each of [`LAYERS`] was traced, and the share of pixels by reason.
    pub(crate) origins: Vec<(Vec<u8>, BTreeMap<u8, f64>)>,
    /// See [`atlas`].
    pub(crate) atlas: Vec<u8>,
}

/// Makes the pictures of a scene from the EXR files that `exr` names by size and mode.
///
/// # Errors
/// When a picture can't be read, or lacks a layer.
pub(crate) fn gallery(
    scene: &SceneRuns,
    detail: Detail,
    exr: &dyn Fn(u32, &str) -> PathBuf,
) -> anyhow::Result<Gallery> {
    let sizes: Vec<u32> = scene.sizes.iter().map(|s| s.size).collect();
    let largest = |most: u32| {
        let fitting = sizes.iter().copied().filter(|&s| s <= most).max();
        fitting.or(sizes.iter().copied().min()).context("no picture was rendered")
    };
    let (size, pixels) = (largest(detail.picture)?, largest(detail.pixels)?);
    let modes = scene.sizes.iter().find(|s| s.size == size).map_or(&[][..], |s| &s.modes);

    let reference = film::read_rgb(&exr(size, "original"), "")?;
    let mut shown = Vec::new();
    for mode in modes.iter().map(|m| m.mode.as_str()) {
        let path = exr(size, mode);
        let png = path.with_extension("png");
        let picture = fs::read(&png).with_context(|| format!("reading {}", png.display()))?;
        let difference = if mode == "original" {
            None
        } else {
            let (_, map) = film::compare(&film::read_rgb(&path, "")?, &reference, EXPOSURE)?;
            Some(write_png(&path.with_extension("difference.png"), &film::flip_picture(&map))?)
        };

        let path = exr(pixels, mode);
        let layers = film::read_exr(&path)?;
        let mut origins = Vec::new();
        for layer in LAYERS {
            let reasons = reasons_of(&layers, mode, layer, &path)?;
            let grid = Grid::from_fn(layers.size(), |p| {
                reasons::linear(reasons::color(reasons[layers.size().index(p)]))
            });
            let file = path.with_extension(format!("{layer}.png"));
            origins.push((write_png(&file, &grid)?, shares(&reasons)));
        }
        let atlas = write_png(&path.with_extension("pixels.png"), &atlas(&layers, mode, &path)?)?;
        shown.push(Shown { mode: mode.into(), picture, difference, origins, atlas });
    }
    Ok(Gallery { size, pixels, modes: shown })
}

/// Writes a PNG file and returns its bytes.
fn write_png(path: &Path, image: &Grid<Rgb>) -> anyhow::Result<Vec<u8>> {
    film::write_png(path, Existing::Replace, image, 0.0)?;
    fs::read(path).with_context(|| format!("reading {}", path.display()))
}

/// The numbers in the layer `reason.LAYER`. The original has a reason for every pixel with a surface: it is traced.
fn reasons_of(picture: &Picture, mode: &str, layer: &str, path: &Path) -> anyhow::Result<Vec<u8>> {
    let name =
        if mode == "original" { format!("traced.{layer}") } else { format!("reason.{layer}") };
    let values = picture
        .channel(&name)
        .with_context(|| format!("{} has no layer {name}", path.display()))?;
    Ok(values.iter().map(|&v| v as u8).collect())
}

fn shares(reasons: &[u8]) -> BTreeMap<u8, f64> {
    let mut shares = BTreeMap::new();
    for &reason in reasons {
        *shares.entry(reason).or_insert(0.0) += 1.0 / reasons.len() as f64;
    }
    shares
}

/// All that a page tells of a pixel, packed into one picture whose bytes it reads back: four columns, one a component;
/// above, the mantissas of red, green and blue; below, the exponent they share (Ward 1991), the reason why the pixel was
/// traced, and the level plus one, or 0 where the mode has none.
fn atlas(picture: &Picture, mode: &str, path: &Path) -> anyhow::Result<Grid<Rgb>> {
    let ImageSize { width, height } = picture.size();
    let mut columns = Vec::new();
    for layer in LAYERS {
        let values = picture
            .rgb(layer)
            .with_context(|| format!("{} has no layer {layer}", path.display()))?;
        let reasons = reasons_of(picture, mode, layer, path)?;
        let levels = picture.channel(&format!("level.{layer}"));
        columns.push((values, reasons, levels));
    }
    ensure!(width <= 4096 && height <= 4096, "{} is too large for a page", path.display());
    let size = ImageSize { width: width * 4, height: height * 2 };
    Ok(Grid::from_fn(size, |p| {
        let (values, reasons, levels) = &columns[(p.x / width) as usize];
        let at = Pixel { x: p.x % width, y: p.y % height };
        let index = picture.size().index(at);
        let [r, g, b, exponent] = to_rgbe(values[at]);
        reasons::linear(if p.y < height {
            [r, g, b]
        } else {
            [exponent, reasons[index], levels.map_or(0, |l| l[index] as u8 + 1)]
        })
    }))
}

/// Three mantissas and the exponent that they share: Ward 1991, "Real Pixels". A channel is
/// `(mantissa + 0.5) / 256 * 2^(exponent - 128)`; black has exponent 0.
fn to_rgbe(color: Rgb) -> [u8; 4] {
    let largest = f64::from(color.max_channel());
    if !(largest.is_finite() && largest > 1e-30) {
        return [0; 4];
    }
    let exponent = largest.log2().floor() + 1.0;
    let scale = 256.0 / exponent.exp2();
    let mantissa = |v: f32| (f64::from(v) * scale).clamp(0.0, 255.0) as u8;
    [mantissa(color.r), mantissa(color.g), mantissa(color.b), (exponent + 128.0) as u8]
}

/// Where a plan keeps the picture of a size and mode of a scene.
pub(crate) fn exr_in(out: &Path, scene: &str) -> impl Fn(u32, &str) -> PathBuf {
    let folder = root().join(out).join(scene);
    move |size, mode| folder.join(format!("{size:04}-{mode}.exr"))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::bench::runs::Runs;
    use crate::bench::runs::tests::records;

    /// A small picture with all layers that a report needs: every third column is traced.
    pub(crate) fn picture(size: u32, mode: &str) -> Picture {
        let size = ImageSize { width: size, height: size };
        let mut picture = Picture::new(size, String::new());
        let shade = |p: Pixel, c: f32| Rgb::new(c * 0.1, p.x as f32 / 100.0, p.y as f32 / 50.0);
        picture.push_rgb("", &Grid::from_fn(size, |p| shade(p, 3.0)));
        for (i, layer) in LAYERS.into_iter().enumerate() {
            picture.push_rgb(layer, &Grid::from_fn(size, |p| shade(p, i as f32)));
            let traced = |i: usize| mode == "original" || size.pixel(i).x.is_multiple_of(3);
            let values = |f: &dyn Fn(usize) -> f32| (0..size.n_pixels()).map(f).collect::<Vec<_>>();
            picture.push(format!("traced.{layer}"), values(&|i| f32::from(u8::from(traced(i)))));
            picture
                .push(format!("reason.{layer}"), values(&|i| f32::from(u8::from(traced(i)) * 2)));
            if mode == "adaptive" {
                picture.push(format!("level.{layer}"), values(&|_| 3.0));
            }
        }
        picture
    }

    /// The gallery of small pictures of all modes.
    pub(crate) fn small_gallery(folder: &Path, scene: &SceneRuns) -> Gallery {
        let exr = |size: u32, mode: &str| folder.join(format!("{size}-{mode}.exr"));
        for size in &scene.sizes {
            for mode in &size.modes {
                let (path, picture) = (exr(size.size, &mode.mode), picture(size.size, &mode.mode));
                film::write_exr(&path, Existing::Replace, &picture).unwrap();
                write_png(&path.with_extension("png"), &picture.rgb("").unwrap()).unwrap();
            }
        }
        gallery(scene, Detail { picture: 32, pixels: 24 }, &exr).unwrap()
    }

    #[test]
    fn galleries_show_the_largest_pictures_that_fit() {
        let folder = tempfile::tempdir().unwrap();
        let records = records("cornell-box", &[16, 24, 32, 40], &["original", "paper"], 1);
        let runs = Runs::of(&records).unwrap();
        let gallery = small_gallery(folder.path(), &runs.scenes[0]);
        assert_eq!((gallery.size, gallery.pixels, gallery.modes.len()), (32, 24, 2));
        assert!(gallery.modes[0].difference.is_none() && gallery.modes[1].difference.is_some());
        assert_eq!(gallery.modes[0].origins[0].1.keys().copied().collect::<Vec<_>>(), [1]);
        let shares = &gallery.modes[1].origins[3].1;
        assert!(
            (shares[&2] - 1.0 / 3.0).abs() < 1e-9 && (shares[&0] - 2.0 / 3.0).abs() < 1e-9,
            "{shares:?}"
        );
    }

    #[test]
    fn shared_exponents_keep_values() {
        for color in [Rgb::new(1.0, 0.5, 0.25), Rgb::new(17.0, 0.0, 3.3), Rgb::new(1e-6, 2e-6, 0.0)]
        {
            let [r, g, b, exponent] = to_rgbe(color);
            let value = |m: u8| (f64::from(m) + 0.5) / 256.0 * (f64::from(exponent) - 128.0).exp2();
            for (m, v) in [r, g, b].into_iter().zip(color.to_array()) {
                let error = (value(m) - f64::from(v)).abs() / f64::from(color.max_channel());
                assert!(error <= 1.0 / 256.0, "{v} became {}", value(m));
            }
        }
        assert_eq!(to_rgbe(Rgb::BLACK), [0; 4]);
    }
}
