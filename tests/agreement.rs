//! Whether the renderer and the path tracer show the same, as far as their noise allows to tell.

use std::fs;
use std::path::{Path, PathBuf};

use base::{Component, Grid, ImageSize, Pixel, Rgb};
use film::{Existing, Picture};
use glam::DVec3;
use photon_map::{Gather, Kernel};
use scene::{Parts, Scene};
use shade::{Settings, Shader};

use crate::path_tracer::{self, Reference};
use crate::renderer::{self, Rendering};

/// Blocks of pictures along a side.
const BLOCKS: u32 = 4;
/// Renderings, each with photons and shadow rays of its own: their spread is the noise.
const N_RENDERINGS: u32 = 16;

/// What means of whole pictures may differ by, as a share.
const MEAN_TOLERANCE: f64 = 0.01;
/// What blocks may differ by apart from noise, as a share: density estimates blur.
const BLOCK_TOLERANCE: f64 = 0.01;
/// Standard deviations that blocks may differ by. With the spread of 16 renderings one in 40,000 differs by more, of
/// those that fall below the average noise; about 2000 are looked at.
const BLOCK_SIGMAS: f64 = 6.0;
/// Standard deviations that means of components may differ by besides [`MEAN_TOLERANCE`].
const MEAN_SIGMAS: f64 = 4.0;
/// The greatest standard deviation of a mean, as a share of that of the whole picture.
const PRECISION: f64 = 0.003;

/// A scene, and how much work makes both pictures precise.
pub(crate) struct Case {
    /// The name of the folder of what fails.
    pub(crate) name: String,
    /// The scene.
    pub(crate) parts: Parts,
    /// Paths a pixel.
    pub(crate) samples_per_pixel: u32,
    /// Photons in all.
    pub(crate) photons: u64,
    /// The radius of all density estimates.
    pub(crate) radius: f32,
    /// Pixels along a side, a multiple of four.
    pub(crate) side: u32,
}

impl Case {
    fn size(&self) -> ImageSize {
        ImageSize { width: self.side, height: self.side }
    }
}

/// Asserts that both pictures of a scene are the same: their emission, each component, and the sum.
pub(crate) fn assert_agreement(case: &Case) {
    assert_agreement_of(case, &rendering);
}

/// The same with indirect light by final gathering, of so many rays at each point.
pub(crate) fn assert_agreement_of_gathering(case: &Case, rays: u32) {
    assert_agreement_of(case, &|case, scene, seed| gathered(case, scene, seed, rays));
}

fn assert_agreement_of(case: &Case, rendering: &dyn Fn(&Case, &Scene, u64) -> Rendering) {
    let scene = Scene::assemble(case.parts.clone());
    let reference =
        path_tracer::render(&case.parts, &scene, case.size(), case.samples_per_pixel, 1);
    let renderings: Vec<Rendering> =
        (0..N_RENDERINGS).map(|seed| rendering(case, &scene, u64::from(seed))).collect();

    let mut faults = Vec::new();
    if !renderings.iter().all(|r| same_emission(&r.emission, &reference.emission)) {
        faults.push("emission differs".to_owned());
    }
    let whole = mean(&reference.total());
    for component in [None].into_iter().chain(Component::ALL.map(Some)) {
        let views: Vec<_> = renderings.iter().map(|r| view(r, component)).collect();
        let (means, variances) = match component {
            None => (&reference.total(), &reference.total_variance),
            Some(c) => (&reference.mean[c], &reference.variance[c]),
        };
        let name = component.map_or("total", Component::name);
        let compare = |side| Comparison::new(&views, means, variances, side);
        let (all, blocks) = (compare(case.side), compare(case.side / BLOCKS));
        let line = format!("{} {name}: {}", case.name, all.report(&blocks));
        println!("{line}");
        if !(all.is_precise(whole) && all.means_agree(component.is_some()) && blocks.agree()) {
            faults.push(line);
        }
    }
    if !faults.is_empty() {
        let folder = show(&case.name, &renderings, &reference);
        panic!("{}\nlook at the pictures in {}", faults.join("\n"), folder.display());
    }
}

fn rendering(case: &Case, scene: &Scene, seed: u64) -> Rendering {
    let maps = renderer::photons(scene, case.photons / u64::from(N_RENDERINGS), seed);
    renderer::original(&Shader::new(scene, &maps, settings(case, seed)), case.size())
}

fn gathered(case: &Case, scene: &Scene, seed: u64, rays: u32) -> Rendering {
    let maps = renderer::photons_for_gathering(scene, case.photons / u64::from(N_RENDERINGS), seed);
    let mut settings = settings(case, seed);
    // Few photons in each radius, in each of many renderings, would make what is known ahead too dark.
    settings.indirect.max_radius *= 4.0;
    renderer::original(&renderer::gathering(scene, &maps, settings, rays), case.size())
}

fn settings(case: &Case, seed: u64) -> Settings {
    // More photons than there are: so the radius is the same everywhere, and the mean of many renderings is that of one
    // with all their photons.
    let gather =
        Gather { k: usize::MAX / 8, max_radius: case.radius, kernel: Kernel::Epanechnikov };
    Settings { shadow_rays: 16, glossy_rays: 4, indirect: gather, caustic: gather, seed }
}

fn view(rendering: &Rendering, component: Option<Component>) -> Grid<Rgb> {
    match component {
        None => rendering.total(),
        Some(c) => rendering.components[c].clone(),
    }
}

fn same_emission(a: &Grid<Rgb>, b: &Grid<Rgb>) -> bool {
    a.values().iter().zip(b.values()).all(|(&a, &b)| {
        let (a, b) = (color(a), color(b));
        (a - b).abs().cmple(b * 1e-6).all()
    })
}

/// Two estimates of the mean radiance of each block of a picture, by channel, and the variance of their difference.
struct Comparison {
    blocks: Vec<(DVec3, DVec3, DVec3)>,
}

impl Comparison {
    fn new(views: &[Grid<Rgb>], means: &Grid<Rgb>, variances: &Grid<Rgb>, side: u32) -> Self {
        let of_views: Vec<Vec<DVec3>> = views.iter().map(|view| block_means(view, side)).collect();
        let n = of_views.len() as f64;
        let rendered: Vec<(DVec3, DVec3)> = (0..of_views[0].len())
            .map(|block| {
                let mean = of_views.iter().map(|view| view[block]).sum::<DVec3>() / n;
                let squares = of_views.iter().map(|view| (view[block] - mean).powf(2.0));
                (mean, squares.sum::<DVec3>() / (n * (n - 1.0)))
            })
            .collect();
        let n_pixels = f64::from(side * side);
        let traced = block_means(means, side).into_iter().zip(block_means(variances, side));
        let mut blocks: Vec<(DVec3, DVec3, DVec3)> = rendered
            .into_iter()
            .zip(traced)
            .map(|(r, (mean, variance))| (r.0, mean, r.1 + variance / n_pixels))
            .collect();
        // Light that is found rarely, by photons or by paths, has a variance in proportion to it. Where chance kept it
        // from being found the spread says too little.
        let sum = blocks.iter().fold((DVec3::ZERO, DVec3::ZERO), |s, b| (s.0 + b.0, s.1 + b.2));
        let factor = sum.1 / sum.0.max(DVec3::splat(f64::MIN_POSITIVE));
        for (rendered, traced, variance) in &mut blocks {
            let rounding = *traced * 1e-6;
            *variance = variance.max(*rendered * factor) + rounding * rounding;
        }
        Self { blocks }
    }

    fn whole(&self) -> (DVec3, DVec3, DVec3) {
        self.blocks[0]
    }

    fn is_precise(&self, whole_picture: DVec3) -> bool {
        let (_, _, variance) = self.whole();
        variance.map(f64::sqrt).cmple(whole_picture * PRECISION).all()
    }

    fn means_agree(&self, is_component: bool) -> bool {
        let (rendered, traced, variance) = self.whole();
        let sigmas = if is_component { MEAN_SIGMAS } else { 0.0 };
        let allowed = traced * MEAN_TOLERANCE + variance.map(f64::sqrt) * sigmas;
        (rendered - traced).abs().cmple(allowed).all()
    }

    fn agree(&self) -> bool {
        self.blocks.iter().all(|&(rendered, traced, variance)| {
            let allowed = traced * BLOCK_TOLERANCE + variance.map(f64::sqrt) * BLOCK_SIGMAS;
            (rendered - traced).abs().cmple(allowed).all()
        })
    }

    fn report(&self, blocks: &Self) -> String {
        let (rendered, traced, variance) = self.whole();
        if traced == DVec3::ZERO && rendered == DVec3::ZERO {
            return "none".into();
        }
        let [r, g, b] = (rendered / traced).to_array();
        let sigma = (variance.map(f64::sqrt) / traced).max_element();
        format!(
            "{r:.4} {g:.4} {b:.4} times the path tracer's mean (sigma {sigma:.4}), {}",
            blocks.worst_report()
        )
    }

    fn worst_report(&self) -> String {
        let sigmas = |b: &(DVec3, DVec3, DVec3)| {
            let difference = b.0 - b.1;
            let sigmas = difference / b.2.map(f64::sqrt).max(DVec3::splat(f64::MIN_POSITIVE));
            sigmas.to_array().into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap()
        };
        let worst = (0..self.blocks.len())
            .max_by(|&a, &b| {
                sigmas(&self.blocks[a]).abs().total_cmp(&sigmas(&self.blocks[b]).abs())
            })
            .unwrap();
        let (rendered, traced, _) = self.blocks[worst];
        let (columns, sigmas) = (BLOCKS, sigmas(&self.blocks[worst]));
        let (x, y) = (worst as u32 % columns, worst as u32 / columns);
        let [r, g, b] = (rendered / traced).to_array();
        format!("worst block {x} {y}: {sigmas:+.1} sigmas, {r:.4} {g:.4} {b:.4} times")
    }
}

/// Writes both pictures and their difference for a person to look at; returns the folder.
fn show(name: &str, renderings: &[Rendering], reference: &Reference) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("failed").join(name);
    fs::create_dir_all(&folder).unwrap();
    let size = reference.emission.size();
    let mut picture = Picture::new(size, String::new());
    for component in [None].into_iter().chain(Component::ALL.map(Some)) {
        let share = 1.0 / renderings.len() as f32;
        let views: Vec<_> = renderings.iter().map(|r| view(r, component)).collect();
        let rendered = Grid::from_fn(size, |at| views.iter().map(|v| v[at] * share).sum::<Rgb>());
        let traced = match component {
            None => reference.total(),
            Some(c) => reference.mean[c].clone(),
        };
        let difference = Grid::from_fn(size, |at| rendered[at] - traced[at]);
        let name = component.map_or("total", Component::name);
        // Red where the renderer is brighter, blue where it is darker, by a tenth or more when full.
        let signed = Grid::from_fn(size, |at| {
            let share = difference[at].mean() / (traced[at].mean() + 0.01) * 10.0;
            Rgb::new(share.max(0.0), 0.0, (-share).max(0.0))
        });
        for (what, grid) in
            [("renderer", &rendered), ("path-tracer", &traced), ("difference", &signed)]
        {
            let path = folder.join(format!("{name}-{what}.png"));
            film::write_png(&path, Existing::Replace, grid, 0.0).unwrap();
        }
        picture.push_rgb(&format!("{name}-renderer"), &rendered);
        picture.push_rgb(&format!("{name}-path-tracer"), &traced);
        picture.push_rgb(&format!("{name}-difference"), &difference);
    }
    film::write_exr(&folder.join("all.exr"), Existing::Replace, &picture).unwrap();
    folder
}

/// The means of square blocks, row by row.
fn block_means(grid: &Grid<Rgb>, side: u32) -> Vec<DVec3> {
    let size = grid.size();
    let columns = size.width / side;
    let mut sums = vec![DVec3::ZERO; (columns * (size.height / side)) as usize];
    for i in 0..size.n_pixels() {
        let Pixel { x, y } = size.pixel(i);
        sums[(y / side * columns + x / side) as usize] += color(grid.values()[i]);
    }
    sums.into_iter().map(|sum| sum / f64::from(side * side)).collect()
}

fn mean(grid: &Grid<Rgb>) -> DVec3 {
    block_means(grid, grid.size().width)[0]
}

fn color(c: Rgb) -> DVec3 {
    DVec3::from_array(c.to_array().map(f64::from))
}
