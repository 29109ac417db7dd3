//! From a scene and its photons to pictures.

use std::iter;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::bail;
use base::{Components, Fingerprint, FingerprintBuilder, Grid, ImageSize, Inventory, Rgb, Watch};
use cache_map::{Origin, Reason};
use cli::{Clock, Console, Interrupt, Need, Seconds, WrongUsage};
use film::Format;
use mapfile::MapFile;
use photon_map::{Gather, PhotonMaps};
use rayon::prelude::*;
use scene::Scene;
use shade::{Counts, GatherPhotons, Settings, Shader};

use crate::adaptive::{self, ErrorReport};
use crate::finished::Finished;
use crate::frame::{Frame, for_each};
use crate::photons::Photons;
use crate::resume::{NOTHING_WRITTEN, Resume};
use crate::tally::Tally;
use crate::tile::Extent;
use crate::{
    Args, Indirect, Mode, finished, health, memory, original, output, paper, photons, stats,
};

/// Subpixels that a thread looks up in 50 ms or so. To start it, and the memory that it touches first, costs 5 ms.
const LOOKED_UP_BY_A_THREAD: usize = 1 << 16;

/// A picture by components, and what it took.
#[derive(Debug)]
pub(crate) struct Rendered {
    pub(crate) values: Components<Grid<Rgb>>,
    pub(crate) origins: Components<Grid<Origin>>,
    /// Pixels that this run has computed; what was loaded doesn't count.
    pub(crate) traced: Components<u64>,
    pub(crate) counts: Counts,
    pub(crate) seconds: Components<Seconds>,
    /// Time for choosing and interpolating.
    pub(crate) cache: Seconds,
    /// What only `--mode adaptive` knows.
    pub(crate) adaptive: Option<AdaptiveLayers>,
}

/// The history of each pixel in `--mode adaptive`.
#[derive(Debug)]
pub(crate) struct AdaptiveLayers {
    pub(crate) reasons: Components<Vec<Reason>>,
    pub(crate) levels: Components<Vec<u8>>,
    pub(crate) error: ErrorReport,
}

/// Shows how work goes on, and stops it on request.
#[derive(Debug)]
pub(crate) struct Progress<'a> {
    console: &'a Console,
    interrupt: &'a Interrupt,
    /// Where finished work is kept.
    pub(crate) resume: Resume,
}

impl Progress<'_> {
    /// Does some work of so many units. To ask the watch whether to go on, without news, costs nothing.
    pub(crate) fn run<T>(
        &self,
        what: &'static str,
        units: usize,
        work: impl FnOnce(Watch<'_>) -> T,
    ) -> T {
        let bar = self.console.progress(what, units as u64);
        let done = AtomicU64::new(0);
        let result = work(&|n| {
            if n > 0 {
                bar.set_position(done.fetch_add(n, Ordering::Relaxed) + n);
            }
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
    let interrupt = Interrupt::listen("render-cached", NOTHING_WRITTEN);
    let pool = check(args)?;
    pool.install(|| render_in_pool(args, &interrupt, clock)).map_err(|e| interrupt.explain(e))
}

/// Finds what can't work before anything is done.
fn check(args: &Args) -> anyhow::Result<rayon::ThreadPool> {
    let caches = match args.mode {
        Mode::Paper => true,
        Mode::Adaptive => args.error > 0.0,
        Mode::Original => false,
    };
    if !caches && (args.paper.save_cache.is_some() || args.paper.from_cache.is_some()) {
        bail!(WrongUsage(
            "--save-cache and --from-cache need --mode paper, or --mode adaptive with an --error above 0".into()
        ));
    }
    if let Some(option) = args.paper.of_paper_alone().filter(|_| args.mode != Mode::Paper) {
        bail!(WrongUsage(format!("{option} needs --mode paper")));
    }
    if args.is_part() {
        if args.paper.save_cache.is_some() || args.paper.from_cache.is_some() {
            bail!(WrongUsage(
                "--save-cache and --from-cache are of whole pictures; leave out --tile or --crop"
                    .into()
            ));
        }
        if args.mode == Mode::Adaptive && args.error > 0.0 && args.paper.from_layers.is_none() {
            bail!(WrongUsage(
                "mode adaptive looks at the whole picture: save it with --save-layers and without --tile or --crop, \
                 then give --from-layers with them".into()
            ));
        }
    }
    let has_layers = args.paper.save_layers.is_some() || args.paper.from_layers.is_some();
    if has_layers && (args.mode != Mode::Adaptive || args.error == 0.0) {
        bail!(WrongUsage(
            "--save-layers and --from-layers need --mode adaptive with an --error above 0".into()
        ));
    }
    for path in &args.output {
        if let Err(error) = Format::of(path) {
            bail!(WrongUsage(error.to_string()));
        }
    }
    let outputs = args
        .output
        .iter()
        .chain(&args.common.stats)
        .chain(&args.paper.save_cache)
        .chain(&args.paper.save_layers);
    // A cache map may be saved in place of the one it starts from: nothing of that is needed later.
    let inputs = args.scene.iter().chain(&args.photons).chain(&args.paper.from_layers);
    let paths: fn(&PathBuf) -> &Path = PathBuf::as_path;
    cli::check_outputs(
        &outputs.map(paths).collect::<Vec<_>>(),
        &inputs.map(paths).collect::<Vec<_>>(),
        args.common.existing(),
    )?;
    let extent = args.resolution.map(|resolution| Extent::new(args, resolution)).transpose()?;
    match extent {
        // To look up a small part takes less than what another thread costs.
        Some(extent) if args.paper.from_layers.is_some() => {
            let useful = extent.frame.size.n_pixels().div_ceil(LOOKED_UP_BY_A_THREAD);
            args.common.thread_pool_for(useful)
        }
        _ => args.common.thread_pool(),
    }
}

/// Whether all of a picture is looked at, so that no band can be rendered alone.
pub(crate) fn takes_all(args: &Args) -> bool {
    match args.mode {
        Mode::Original => false,
        Mode::Adaptive => args.error > 0.0 && args.paper.from_layers.is_none(),
        Mode::Paper => true,
    }
}

fn render_in_pool(args: &Args, interrupt: &Interrupt, mut clock: Clock) -> anyhow::Result<()> {
    let console = Console::new("render-cached", &args.common);
    let (Some(scene_path), Some(photons_path)) = (&args.scene, &args.photons) else {
        bail!(WrongUsage("a scene and its photon maps are needed".into()));
    };

    let cli::SceneOptions { define, lenient, no_external } = args.scene_options.clone();
    let options = scene::Options { definitions: define, lenient, no_external };
    let (parts, warnings) = scene::load_parts(scene_path, &options)?;
    warnings.iter().try_for_each(|w| console.warn(w))?;
    let surfaces = Need { own: parts.memory().building, mapped: 0 };
    let of_surfaces =
        cli::predict_memory(surfaces, args.memory, "leave out or simplify meshes", &console)?;
    let scene = Scene::assemble(parts);
    if !scene.camera.is_pinhole() && args.supersample < 4 {
        console.warn(
            "with so few rays through the lens what is out of focus is noisy; give --supersample 4 or more",
        )?;
    }
    let usual = ImageSize { width: 512, height: 512 };
    let resolution = args.resolution.or(scene.camera.film()).unwrap_or(usual);
    let extent = Extent::new(args, resolution)?;
    let (picture, files) =
        (memory::of_picture(args, &extent, &scene), memory::of_files(args, &extent));
    let need = Need { own: picture.own + files.own, mapped: files.mapped };
    let remedy = remedy_of_memory(args, resolution);
    let predicted = of_surfaces.max(cli::predict_memory(need, args.memory, &remedy, &console)?);
    // Whatever tells of this picture names its size.
    let args = &Args { resolution: Some(resolution), ..args.clone() };
    let layers = args.paper.from_layers.as_ref();
    let finished = layers.map(|path| Finished::open(path)).transpose()?;
    let known = finished.as_ref().map(Finished::photons);
    let photons = photons::open(photons_path, scene_path, &args.scene_options, &scene, known)?;
    let Photons { maps: photons, file: photons_file, fingerprint: photons_digest } = photons;
    let settings = settings(args, scene.bounds().diagonal());
    if args.shading.indirect == Indirect::Gather
        && finished.is_none()
        && GatherPhotons::of(&photons, &settings.indirect).is_none()
    {
        bail!(
            "{} holds no photons for --indirect gather; make it with: {}",
            photons_path.display(),
            photons::for_gathering(photons_path, scene_path, &args.scene_options, &photons)
        );
    }
    let of_surfaces = inputs_of_surfaces(args, &scene, photons_digest, &settings);
    let mut inputs = of_surfaces.clone();
    inputs.add("the camera", scene.view_fingerprint());
    let resume = Resume::open(args, &inputs, &console, interrupt)?;
    let progress = Progress { console: &console, interrupt, resume };
    let load = clock.lap();
    interrupt.check()?;
    for (class, set) in photons.sets().filter(|_| finished.is_none()) {
        console.detail(format_args!("{:>10} {} photons", set.len(), class.name()));
    }

    let mut tally = Tally::default();
    let (shader, counts_ahead) = shader(args, &scene, &photons, settings, &progress)?;
    if let (Some(path), Some(finished)) = (layers, &finished) {
        finished.check(path, args, extent.frame.whole, &inputs)?;
    }
    tally.counts += counts_ahead;
    tally.seconds.indirect += clock.lap();
    let job = Job {
        args,
        shader: &shader,
        photons: &photons_file,
        of_surfaces: &of_surfaces,
        inputs: &inputs,
        console: &console,
        progress: &progress,
    };
    let whole = match takes_all(args) {
        true => Some(job.render(&extent, true, &mut clock, &mut tally)?),
        false => None,
    };
    if let Some((frame, rendered)) = &whole
        && let (Some(path), Some(layers)) = (&args.paper.save_layers, &rendered.adaptive)
    {
        let photons = (photons_file.digest(), photons_digest);
        finished::save(path, args, frame, rendered, layers, &inputs, photons)?;
    }
    let mut bands = extent.bands(args);
    let bands = iter::from_fn(|| {
        let band = bands.next()?;
        tally.write += clock.lap();
        Some(match (&whole, &finished) {
            (Some((frame, rendered)), _) => {
                output::blocks(args, &band.in_frame_of(&extent), frame, rendered, &inputs)
            }
            (None, Some(finished)) => job.look_up(finished, &band, &mut tally),
            (None, None) => job
                .render(&band, bands.len() == 0, &mut clock, &mut tally)
                .and_then(|(f, rendered)| output::blocks(args, &band, &f, &rendered, &inputs)),
        })
    });
    let blocks = bands.flat_map(|blocks| match blocks {
        Ok(blocks) => blocks.into_iter().map(Ok).collect(),
        Err(error) => vec![Err(error)],
    });
    output::write(args, extent.part, blocks, interrupt)?;
    progress.resume.done();
    tally.write += clock.lap();

    let stages = stats::Stages { load, total: clock.total() };
    let stats = stats::Stats::new(args, &tally, photons_digest, &stages, predicted);
    stats.say(&console);
    if let Some(path) = &args.common.stats {
        cli::write_stats(path, args.common.existing(), &stats)?;
    }
    Ok(())
}

/// What to do where there isn't enough memory.
fn remedy_of_memory(args: &Args, ImageSize { width, height }: ImageSize) -> String {
    let smaller = "ask for fewer pixels with --resolution or --supersample";
    match args.mode {
        Mode::Original => format!("{smaller} than {width}x{height}"),
        Mode::Paper => format!(
            "{smaller} than {width}x{height}, for parts with --tile, or for --mode original"
        ),
        Mode::Adaptive => format!("{smaller} than {width}x{height}, or for --mode original"),
    }
}

/// What all bands of a picture have in common.
struct Job<'x, 'a> {
    args: &'x Args,
    shader: &'a Shader<'a>,
    photons: &'x MapFile,
    of_surfaces: &'x Inventory,
    inputs: &'x Inventory,
    console: &'x Console,
    progress: &'x Progress<'x>,
}

impl<'a> Job<'_, 'a> {
    /// Traces the eye rays of a frame, the last one or not, and renders it.
    fn render(
        &self,
        extent: &Extent,
        is_last: bool,
        clock: &mut Clock,
        tally: &mut Tally,
    ) -> anyhow::Result<(Frame<'a>, Rendered)> {
        let &Self { args, shader, of_surfaces, inputs, progress, .. } = self;
        let n_rays = extent.frame.size.n_pixels();
        let (frame, eye_counts) = progress.run("eye rays", n_rays, |watch| {
            match adaptive::thinned_by(args, n_rays, shader.scene) {
                1 => Frame::trace(shader, extent.frame, watch),
                step => Frame::sketch(shader, extent.frame, step, watch),
            }
        })?;
        tally.primary += clock.lap();
        let mut rendered = match args.mode {
            Mode::Adaptive if args.error > 0.0 => {
                adaptive::render(args, &frame, of_surfaces, clock, progress)?
            }
            Mode::Original | Mode::Adaptive => original::render(&frame, clock, progress)?,
            Mode::Paper => {
                let thresholds = paper::thresholds(args, shader.scene.bounds().diagonal());
                paper::render(args, &frame, extent.computed, inputs, &thresholds, clock, progress)?
            }
        };
        rendered.counts += eye_counts;
        tally.add(Tally::of(&rendered));
        let n = tally.counts.chains_cut;
        if is_last && n > 0 {
            self.console.warn(format_args!(
                "{n} specular chains were cut; surfaces that reflect everything face each other"
            ))?;
        }
        health::check(&rendered.values, extent.frame, args.supersample)?;
        self.photons.check_untouched()?;
        Ok((frame, rendered))
    }

    /// The blocks of a band of a picture that is finished, each looked up and packed by one thread.
    fn look_up(
        &self,
        finished: &Finished,
        band: &Extent,
        tally: &mut Tally,
    ) -> anyhow::Result<Vec<output::Block>> {
        let &Self { args, shader, inputs, progress, .. } = self;
        let blocks: Vec<Extent> = band.blocks(args).collect();
        let look_up = |block: &Extent| {
            let go_on = |_| progress.interrupt.go_on();
            let (frame, counts) = finished.frame(shader, block.frame, &go_on)?;
            let mut rendered = finished.render(&frame)?;
            rendered.counts += counts;
            health::check(&rendered.values, block.frame, args.supersample)?;
            let shown = output::blocks(args, block, &frame, &rendered, inputs)?;
            Ok((shown, Tally::of(&rendered)))
        };
        let found: anyhow::Result<Vec<_>> = blocks.par_iter().map(look_up).collect();
        let mut all = Vec::with_capacity(blocks.len());
        for (shown, of_block) in found? {
            all.extend(shown);
            tally.add(of_block);
        }
        Ok(all)
    }
}

/// What computes components. Irradiance for final gathering is computed ahead, unless nothing will be gathered.
fn shader<'a>(
    args: &Args,
    scene: &'a Scene,
    photons: &'a PhotonMaps,
    settings: Settings,
    progress: &Progress<'_>,
) -> anyhow::Result<(Shader<'a>, Counts)> {
    let shader = Shader::new(scene, photons, settings);
    match GatherPhotons::of(photons, &settings.indirect) {
        Some(photons)
            if args.shading.indirect == Indirect::Gather && args.paper.from_layers.is_none() =>
        {
            let places = photons.places(settings.seed);
            let ahead = progress.run("irradiance", places.len(), |watch| {
                for_each(&places, watch, |place, work| {
                    shader.irradiance_ahead(&photons, place, work)
                })
            });
            let (irradiance, counts) = ahead?;
            let rays = args.shading.gather_rays;
            Ok((shader.gathering(rays, photons, &irradiance), counts))
        }
        _ => Ok((shader, Counts::default())),
    }
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
        glossy_rays: shading.glossy_rays,
        indirect: gather(shading.gather, shading.gather_radius, 0.05),
        caustic: gather(shading.caustic_gather, shading.caustic_radius, 0.01),
        seed: args.seed,
    }
}

/// All that light at a point of a surface depends on, whoever looks at it.
fn inputs_of_surfaces(
    args: &Args,
    scene: &Scene,
    photons: Fingerprint,
    settings: &Settings,
) -> Inventory {
    let mut inputs = scene.inventory().clone();
    let digest = |bytes: &[u8]| Fingerprint::of(bytes);
    let gather = |g: &Gather| {
        let mut digest = FingerprintBuilder::new();
        digest.pod(&[g.k as u64]).pod(&[g.max_radius]).bytes(g.kernel.name().as_bytes());
        digest.finish()
    };
    inputs.add("the photon map", photons);
    inputs.add("the number of shadow rays", digest(&settings.shadow_rays.to_le_bytes()));
    inputs.add("the number of glossy rays", digest(&settings.glossy_rays.to_le_bytes()));
    inputs.add("the estimate of indirect light", gather(&settings.indirect));
    if args.shading.indirect == Indirect::Gather {
        let rays = args.shading.gather_rays;
        inputs.add("the number of gather rays", digest(&rays.to_le_bytes()));
    }
    inputs.add("the estimate of caustics", gather(&settings.caustic));
    inputs.add("the seed", digest(&settings.seed.to_le_bytes()));
    inputs
}
