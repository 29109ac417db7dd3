//! From a scene to a file of photons.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::{Context, bail};
use base::Inventory;
use cli::{Clock, Console, Interrupt, WrongUsage};
use photon_map::{Metadata, PhotonMaps, PhotonSet};
use photon_trace::{Account, Budget, Config, Traced};
use scene::Scene;

use crate::Args;
use crate::args::Store;
use crate::stats::{Seconds, Stats, Stored};

/// Builds the photon maps that the command line asks for.
///
/// # Errors
/// Whatever went wrong, in words for the user.
pub fn build(args: &Args) -> anyhow::Result<()> {
    let mut clock = Clock::start();
    let console = Console::new("photon-build", args.common.verbosity());
    let interrupt = Interrupt::listen();
    let (Some(scene_path), Some(output)) = (&args.scene, &args.output) else {
        bail!(WrongUsage("a scene and an output are needed".into()));
    };
    let budget = budget(args)?;
    let outputs: Vec<&Path> =
        args.common.stats.iter().chain([output]).map(PathBuf::as_path).collect();
    cli::check_outputs(&outputs, &[scene_path], args.common.existing())?;
    let pool = args.common.thread_pool()?;

    let cli::SceneOptions { define, lenient } = args.scene_options.clone();
    let options = scene::Options { definitions: define, lenient };
    let (parts, warnings) = pool.install(|| scene::load_parts(scene_path, &options))?;
    warnings.iter().for_each(|w| console.warn(w));
    let load = clock.lap();
    let scene = pool.install(|| Scene::assemble(parts));
    let bvh = clock.lap();
    console.detail(format_args!(
        "{} lights, {} threads",
        scene.lights.len(),
        pool.current_num_threads()
    ));
    interrupt.check().context(NOTHING_WRITTEN)?;

    let config = Config {
        budget,
        seed: args.seed,
        max_bounces: args.max_bounces,
        store_direct: args.store.contains(&Store::Direct),
    };
    let traced = trace(&scene, &config, &pool, &console, &interrupt)?;
    audit(&traced.account, args.max_bounces, &console)?;
    let trace = clock.lap();

    let account = traced.account;
    let maps = pool.install(|| maps(&scene, &config, traced))?;
    let tree = clock.lap();
    interrupt.check().context(NOTHING_WRITTEN)?;

    let made_by = concat!("photon-build ", env!("CARGO_PKG_VERSION"));
    let file_bytes =
        maps.save(output, args.common.existing(), made_by, &remedy(args, scene_path))?;
    let write = clock.lap();

    let n_photons: usize = maps.sets().map(|(_, set)| set.len()).sum();
    let n_bytes: usize = maps.sets().map(|(_, set)| set.n_bytes()).sum();
    let total = clock.total();
    console.detail(format_args!(
        "{} photons absorbed, {} escaped, {} rays",
        account.absorbed, account.escaped, account.rays
    ));
    for (stage, seconds) in
        [("load", load), ("bvh", bvh), ("trace", trace), ("tree", tree), ("write", write)]
    {
        console
            .detail(format_args!("{stage:>10} {:8.2} s {:8.2} CPU s", seconds.wall, seconds.cpu));
    }
    for (class, set) in maps.sets() {
        console.say(format_args!("{:>10} {} photons", set.len(), class.name()));
    }
    console.say(format_args!(
        "{} emitted, {:.1} MB written to {} in {:.2} s ({:.2} CPU s)",
        account.emitted,
        file_bytes as f64 * 1e-6,
        output.display(),
        total.wall,
        total.cpu,
    ));
    if let Some(path) = &args.common.stats {
        let seconds = |f: fn(&cli::Seconds) -> f64| Seconds {
            load: f(&load),
            bvh: f(&bvh),
            trace: f(&trace),
            tree: f(&tree),
            write: f(&write),
            total: f(&total),
        };
        let stats = Stats {
            program: "photon-build",
            version: env!("CARGO_PKG_VERSION"),
            scene: scene_path.display().to_string(),
            fingerprint: maps.fingerprint().to_string(),
            seed: args.seed,
            threads: pool.current_num_threads(),
            emitted: account.emitted,
            stored: Stored {
                direct: maps.direct.as_ref().map_or(0, PhotonSet::len),
                caustic: maps.caustic.len(),
                indirect: maps.indirect.len(),
            },
            absorbed: account.absorbed,
            escaped: account.escaped,
            cut: account.cut,
            rays: account.rays,
            bytes_per_photon: if n_photons > 0 { n_bytes as f64 / n_photons as f64 } else { 0.0 },
            file_bytes,
            seconds: seconds(|s| s.wall),
            cpu_seconds: seconds(|s| s.cpu),
            peak_rss_bytes: cli::peak_rss_bytes(),
        };
        cli::write_stats(path, args.common.existing(), &stats)?;
    }
    Ok(())
}

/// What an interrupted run leaves behind.
const NOTHING_WRITTEN: &str = "no photon map was written";

/// Emitting more than this would fill the memory of any machine, and more of a class can't be numbered.
const MOST_PHOTONS: u64 = u32::MAX as u64;

fn budget(args: &Args) -> anyhow::Result<Budget> {
    let budget = match args.photons_per_light {
        Some(n) => Budget::PerLight(n),
        None => Budget::Total(args.photons.unwrap_or(1_000_000)),
    };
    match budget {
        Budget::Total(0) => {
            bail!(WrongUsage("--photons 0 emits nothing; ask for one photon at least".into()))
        }
        Budget::PerLight(0) => {
            bail!(WrongUsage("--photons-per-light 0 emits nothing; ask for one at least".into()))
        }
        Budget::Total(n) | Budget::PerLight(n) if n > MOST_PHOTONS => bail!(too_many(n)),
        budget => Ok(budget),
    }
}

fn too_many(n_photons: u64) -> WrongUsage {
    WrongUsage(format!("{n_photons} photons are too many; ask for {MOST_PHOTONS} at most"))
}

fn trace(
    scene: &Scene,
    config: &Config,
    pool: &rayon::ThreadPool,
    console: &Console,
    interrupt: &Interrupt,
) -> anyhow::Result<Traced> {
    let fluxes: Vec<_> = scene.lights.iter().map(|light| light.flux(&scene.bounds())).collect();
    let counts = photon_trace::photons_of_lights(config.budget, &fluxes);
    let n_photons = counts.into_iter().fold(0, u64::saturating_add);
    if n_photons > MOST_PHOTONS {
        bail!(too_many(n_photons));
    }
    let bar = console.progress("photons", n_photons);
    let done = AtomicU64::new(0);
    let watch = |n| {
        bar.set_position(done.fetch_add(n, Ordering::Relaxed) + n);
        interrupt.go_on()
    };
    let traced = pool.install(|| photon_trace::trace(scene, config, &watch));
    bar.finish_and_clear();
    traced.context(NOTHING_WRITTEN)
}

/// Every photon must have met an end, and light must have come of it.
fn audit(account: &Account, max_bounces: u32, console: &Console) -> anyhow::Result<()> {
    let ended = account.absorbed + account.escaped + account.cut;
    if ended != account.emitted {
        bail!(
            "{} photons were emitted and {ended} ended: this is a bug, please report it",
            account.emitted
        );
    }
    if account.cut > 0 {
        let share = account.cut as f64 / account.emitted as f64 * 100.0;
        console.warn(format_args!(
            "{} photons ({share:.3} %) were cut after {max_bounces} surfaces; raise --max-bounces to keep their light",
            account.cut
        ));
    }
    Ok(())
}

fn maps(scene: &Scene, config: &Config, traced: Traced) -> anyhow::Result<PhotonMaps> {
    let sets = [&traced.direct, &traced.caustic, &traced.indirect];
    if let Some(n) = sets.map(Vec::len).into_iter().find(|&n| n as u64 > MOST_PHOTONS) {
        bail!("{n} photons of a class are more than {MOST_PHOTONS}; ask for fewer");
    }
    let Account { emitted, absorbed, escaped, cut, rays, flux } = traced.account;
    let inventory: Inventory = scene.inventory().clone();
    let metadata = Metadata {
        inventory,
        seed: config.seed,
        max_bounces: config.max_bounces,
        emitted,
        absorbed,
        escaped,
        cut,
        rays,
        flux,
    };
    // One after the other, each freed at once: the photons take twice as much memory as their trees.
    let direct = config.store_direct.then(|| PhotonSet::build(&traced.direct));
    drop(traced.direct);
    let caustic = PhotonSet::build(&traced.caustic);
    drop(traced.caustic);
    let indirect = PhotonSet::build(&traced.indirect);
    Ok(PhotonMaps { metadata, direct, caustic, indirect })
}

/// The command that makes the map anew, with `{file}` for its name; only what decides its contents.
fn remedy(args: &Args, scene: &Path) -> String {
    let mut words = vec!["photon-build".into(), scene.into(), "-o".into(), "{file}".into()];
    let mut option = |name: &str, value: String| words.extend([name.into(), value.into()]);
    match args.photons_per_light {
        Some(n) => option("--photons-per-light", n.to_string()),
        None => option("--photons", args.photons.unwrap_or(1_000_000).to_string()),
    }
    option("--seed", args.seed.to_string());
    option("--max-bounces", args.max_bounces.to_string());
    if args.store.contains(&Store::Direct) {
        option("--store", "direct".into());
    }
    words.extend(args.scene_options.words().into_iter().map(Into::into));
    words.push("--force".into());
    cli::command_line(words)
}
