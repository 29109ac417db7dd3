//! How much memory a picture takes.
//!
//! The figures are what `peak_rss_bytes` of `--stats` shows with pictures of 512x512 to 8192x8192 pixels.

use std::fs;
use std::path::{Path, PathBuf};

use cli::Need;
use scene::{LightKind, Scene};

use crate::adaptive::step_of_cache;
use crate::render::takes_all;
use crate::tile::Extent;
use crate::{Args, Indirect, Mode};

/// What a frame and its finished components take of a subpixel.
const FRAME: u64 = 52;
const FINISHED: u64 = 52;

/// What the history of a component takes in mode adaptive, of all four.
const HISTORY: u64 = 8;

/// What mode original takes while it computes: numbers of pixels, and radiance on its way to its place.
const SHADING: u64 = 32;

/// What mode paper takes at most: frame, cache map, its surfaces, and what it traces.
const PAPER: u64 = 205;

/// What mode adaptive takes at most, and of each light whose visibility is cached.
const ADAPTIVE: u64 = 243;
const CACHED_LIGHT: u64 = 20;

/// What is left of a pixel when all are worked on after every fourth was tried.
const TRIED: u64 = 36;

/// What it takes of a subpixel if it works on one of each pixel, beside what it takes of that.
const TOLD: u64 = 88;

/// A block of a picture while its layers are made and packed, one for each thread: of a pixel, and of a subpixel where there
/// are several.
const LAYERS: u64 = 400;
const FILTERED: u64 = 60;

/// What is kept of a pixel of a band until it is written: its packed layers.
const PACKED: u64 = 64;

/// What is kept of a pixel until the end, for a PNG.
const SHOWN: u64 = 36;

/// What the allocator keeps of memory that a thread has freed, to use it again.
const FREED: u64 = 2 << 20;

/// What a picture takes from now on: neither the scene nor what computes it counts.
pub(crate) fn of_picture(args: &Args, extent: &Extent, scene: &Scene) -> Need {
    let subpixels = |extent: &Extent| extent.frame.size.n_pixels() as u64;
    let pixels = |extent: &Extent| extent.part.size.n_pixels() as u64;
    let has = |ending: &str| args.output.iter().any(|path| ends_in(path, ending));
    let threads = rayon::current_num_threads() as u64;
    let layers = |band: &Extent| {
        let packed = if has("exr") { PACKED * pixels(band) } else { 0 };
        let of_block = |block: Extent| {
            let filtered = if args.supersample > 1 { FILTERED } else { 0 };
            LAYERS * pixels(&block) + filtered * subpixels(&block)
        };
        packed + threads * band.blocks(args).next().map_or(0, of_block)
    };
    let bands = || extent.bands(args);
    let history = if args.mode == Mode::Adaptive && args.error > 0.0 { HISTORY } else { 0 };
    let finished = FRAME + FINISHED + history;
    let at_work = match takes_all(args) {
        true => {
            let of_cache = ADAPTIVE + CACHED_LIGHT * n_cached(scene);
            let n = subpixels(extent);
            let most = match args.mode {
                Mode::Adaptive => match u64::from(step_of_cache(args, n as usize, &scene.camera)) {
                    1 => of_cache * n,
                    step => {
                        let told = TOLD * n + of_cache * (n / (step * step));
                        // Whole pixels may turn out to tell nothing.
                        let anew = (TRIED + of_cache) * n;
                        if args.supersample == 1 { told.max(anew) } else { told }
                    }
                },
                Mode::Original | Mode::Paper => PAPER * n,
            };
            let of_layers = bands().map(|band| layers(&band)).max().unwrap_or(0);
            most.max(finished * n + of_layers)
        }
        false => {
            let of_band = |band: Extent| {
                finished * subpixels(&band) + layers(&band).max(SHADING * subpixels(&band))
            };
            bands().map(of_band).max().unwrap_or(0)
        }
    };
    let kept = if has("png") { SHOWN } else { 0 };
    Need { own: at_work + kept * pixels(extent) + threads * FREED, mapped: 0 }
}

/// What the files that a run reads take.
pub(crate) fn of_files(args: &Args, extent: &Extent) -> Need {
    let length = |path: &Option<PathBuf>| {
        path.as_ref().and_then(|path| fs::metadata(path).ok()).map_or(0, |file| file.len())
    };
    if args.paper.from_layers.is_some() {
        // Nothing is computed from photons, and layers are read where the part shows them.
        let share = extent.part.size.n_pixels() as f64 / extent.part.whole.n_pixels() as f64;
        let layers = length(&args.paper.from_layers) as f64 * share;
        return Need { own: 0, mapped: layers as u64 };
    }
    let photons = length(&args.photons);
    // Irradiance at one in 64 photons, and the spots.
    let ahead = if args.shading.indirect == Indirect::Gather { photons / 4 } else { 0 };
    let records = length(&args.paper.from_cache);
    Need { own: ahead + records, mapped: photons + records }
}

/// Lights with a visibility of their own, and all others together.
fn n_cached(scene: &Scene) -> u64 {
    const SEPARATE: usize = 4;
    let is_image = |kind: &LightKind| matches!(kind, LightKind::EnvironmentMap(_));
    let n_images = scene.lights.iter().filter(|light| is_image(&light.kind)).count();
    let n_others = scene.lights.len() - n_images;
    n_others.min(SEPARATE) as u64 + u64::from(n_images > 0 || n_others > SEPARATE)
}

fn ends_in(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending))
}
