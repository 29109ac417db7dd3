//! From a scene and its photons to pictures.

use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::{Context, bail};
use base::{Components, Fingerprint, FingerprintBuilder, Grid, Interrupted, Inventory, Rgb, Watch};
use cache_map::Origin;
use cli::{Clock, Console, Interrupt, Seconds, WrongUsage};
use film::Format;
use photon_map::{Gather, PhotonMaps};
use scene::Scene;
use shade::{Counts, Settings, Shader};

use crate::frame::Frame;
use crate::{Args, Mode, original, output, paper, stats};

/// A picture by components, and what it took.
#[derive(Debug)]
pub(crate) struct Rendered {
    pub(crate) values: Components<Grid<Rgb>>,
    pub(crate) origins: Components<Grid<Origin>>,
    pub(crate) counts: Counts,
    pub(crate) seconds: Components<Seconds>,
    /// Time for choosing and interpolating.
    pub(crate) cache: Seconds,
}

/// Shows how work goes on, and stops it on request.
#[derive(Debug)]
pub(crate) struct Progress<'a> {
    console: &'a Console,
    interrupt: &'a Interrupt,
}

impl Progress<'_> {
    /// Does some work of so many units.
    pub(crate) fn run<T>(
        &self,
        what: &'static str,
        units: usize,
        work: impl FnOnce(Watch<'_>) -> T,
    ) -> T {
        let bar = self.console.progress(what, units as u64);
        let done = AtomicU64::new(0);
        let result = work(&|n| {
            bar.set_position(done.fetch_add(n, Ordering::Relaxed) + n);
            self.interrupt.go_on()
        });
        bar.finish_and_clear();
        result
    }
}

/// Renders what the command line asks for.
///
/// # Errors
/// Whatever went wrong, in words for the user.
pub fn render(args: &Args) -> anyhow::Result<()> {
    let clock = Clock::start();
    let pool = check(args)?;
    pool.install(|| render_in_pool(args, clock))
}

/// Finds what can't work before anything is done.
fn check(args: &Args) -> anyhow::Result<rayon::ThreadPool> {
    if args.mode != Mode::Paper
        && (args.paper.save_cache.is_some() || args.paper.from_cache.is_some())
    {
        bail!(WrongUsage("--save-cache and --from-cache need --mode paper".into()));
    }
    for path in &args.output {
        if let Err(error) = Format::of(path) {
            bail!(WrongUsage(error.to_string()));
        }
    }
    let mut outputs: Vec<_> =
        args.output.iter().chain(&args.common.stats).chain(&args.paper.save_cache).collect();
    for path in &outputs {
        atomic_file::check(path, args.common.existing())?;
    }
    outputs.sort_unstable();
    if let Some(twice) = outputs.windows(2).find(|w| w[0] == w[1]) {
        bail!(WrongUsage(format!("{} is named as an output twice", twice[0].display())));
    }
    args.common.thread_pool()
}

fn render_in_pool(args: &Args, mut clock: Clock) -> anyhow::Result<()> {
    let console = Console::new("render-cached", args.common.verbosity());
    let interrupt = Interrupt::listen();
    let progress = Progress { console: &console, interrupt: &interrupt };
    let (Some(scene_path), Some(photons_path)) = (&args.scene, &args.photons) else {
        bail!(WrongUsage("a scene and its photon maps are needed".into()));
    };

    let loaded = scene::load(scene_path)?;
    loaded.warnings.iter().for_each(|w| console.warn(w));
    let scene = loaded.scene;
    let (photons, file) = PhotonMaps::open(photons_path)?;
    file.check_inputs(&photons.metadata.inventory, scene.inventory())?;
    let settings = settings(args, scene.bounds().diagonal());
    let inputs = inputs(&scene, &photons, &settings);
    let load = clock.lap();

    let shader = Shader::new(&scene, &photons, settings);
    let traced = progress.run("eye rays", args.resolution.n_pixels(), |watch| {
        Frame::trace(shader, args.resolution, watch)
    });
    let (frame, eye_counts) = traced.map_err(interrupted)?;
    let primary = clock.lap();

    let mut rendered = match args.mode {
        Mode::Original => original::render(&frame, &mut clock, &progress).map_err(interrupted)?,
        Mode::Paper => {
            let thresholds = paper::thresholds(args, scene.bounds().diagonal());
            paper::render(args, &frame, &inputs, &thresholds, &mut clock, &progress)?
        }
    };
    rendered.counts += eye_counts;
    if rendered.counts.chains_cut > 0 {
        let n = rendered.counts.chains_cut;
        console.warn(format_args!(
            "{n} specular chains were cut; surfaces that reflect everything face each other"
        ));
    }

    let picture = output::picture(args, &frame, &rendered, &inputs);
    output::write(args, &picture)?;
    let write = clock.lap();

    let stages = stats::Stages { load, primary, write, total: clock.total() };
    let stats = stats::Stats::new(args, &frame, &rendered, &photons, &stages);
    stats.say(&console);
    if let Some(path) = &args.common.stats {
        cli::write_stats(path, args.common.existing(), &stats)?;
    }
    Ok(())
}

fn interrupted(error: Interrupted) -> anyhow::Error {
    Err::<(), _>(error).context("no picture was written").unwrap_err()
}

fn settings(args: &Args, diagonal: f32) -> Settings {
    let shading = &args.shading;
    let gather = |k: u64, radius: Option<f32>, share: f32| Gather {
        k: k as usize,
        max_radius: radius.unwrap_or(diagonal * share),
        kernel: shading.kernel,
    };
    Settings {
        shadow_rays: shading.shadow_rays,
        indirect: gather(shading.gather, shading.gather_radius, 0.05),
        caustic: gather(shading.caustic_gather, shading.caustic_radius, 0.01),
        seed: args.seed,
    }
}

/// All that the value of a pixel depends on, the resolution aside.
fn inputs(scene: &Scene, photons: &PhotonMaps, settings: &Settings) -> Inventory {
    let mut inputs = scene.inventory().clone();
    let digest = |bytes: &[u8]| Fingerprint::of(bytes);
    let gather = |g: &Gather| {
        let mut digest = FingerprintBuilder::new();
        digest.pod(&[g.k as u64]).pod(&[g.max_radius]).bytes(g.kernel.name().as_bytes());
        digest.finish()
    };
    inputs.add("the camera", scene.view_fingerprint());
    inputs.add("the photon map", photons.fingerprint());
    inputs.add("the number of shadow rays", digest(&settings.shadow_rays.to_le_bytes()));
    inputs.add("the estimate of indirect light", gather(&settings.indirect));
    inputs.add("the estimate of caustics", gather(&settings.caustic));
    inputs.add("the seed", digest(&settings.seed.to_le_bytes()));
    inputs
}
