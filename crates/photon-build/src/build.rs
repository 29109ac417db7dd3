//! From a scene to a file of photons.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::bail;
use base::{Photon, Rgb, Share};
use cli::{Clock, Console, Interrupt, Journal, Need, Seconds, WrongUsage};
use photon_map::{Loose, Metadata, PhotonMaps, ShardMetadata, largest_flux};
use photon_trace::{Account, Budget, Config, Traced, share_out};
use scene::Scene;

use crate::args::{Quota, Store};
use crate::stats::{self, Stages, Stats, Written};
use crate::{Args, memory, resume, shard};

/// Builds the photon maps that the command line asks for.
///
/// # Errors
/// Whatever went wrong, in words for the user.
pub fn build(args: &Args) -> anyhow::Result<()> {
    let interrupt = Interrupt::listen("photon-build", NOTHING_WRITTEN);
    build_until(args, &interrupt).map_err(|error| interrupt.explain(error))
}

fn build_until(args: &Args, interrupt: &Interrupt) -> anyhow::Result<()> {
    let mut clock = Clock::start();
    let console = Console::new("photon-build", &args.common);
    let (Some(scene_path), Some(output)) = (&args.scene, &args.output) else {
        bail!(WrongUsage("a scene and an output are needed".into()));
    };
    check_number(args)?;
    let outputs: Vec<&Path> =
        args.common.stats.iter().chain([output]).map(PathBuf::as_path).collect();
    cli::check_outputs(&outputs, &[scene_path], args.common.existing())?;
    let pool = args.common.thread_pool()?;

    let cli::SceneOptions { define, lenient, no_external } = args.scene_options.clone();
    let options = scene::Options { definitions: define, lenient, no_external };
    let (parts, warnings) = pool.install(|| scene::load_parts(scene_path, &options))?;
    warnings.iter().try_for_each(|w| console.warn(w))?;
    let load = clock.lap();
    let surfaces = Need { own: parts.memory().building, mapped: 0 };
    let predict =
        |need, remedy| pool.install(|| cli::predict_memory(need, args.memory, remedy, &console));
    let of_surfaces = predict(surfaces, "leave out or simplify meshes")?;
    let scene = pool.install(|| Scene::assemble(parts));
    let bvh = clock.lap();
    console.detail(format_args!(
        "{} lights, {} threads",
        scene.lights.len(),
        pool.current_num_threads()
    ));
    interrupt.check()?;

    let config = Config {
        budget: budget(args, scene_path, &scene)?,
        seed: args.seed,
        max_bounces: args.max_bounces,
        store_direct: !args.store.is_empty(),
        aim: args.aim,
    };
    let n_photons = photons_of_lights(&scene, &config).into_iter().fold(0, u64::saturating_add);
    if n_photons > MOST_PHOTONS {
        bail!(too_many(n_photons));
    }
    let share = args.shard.unwrap_or(Share::WHOLE);
    let photons =
        memory::of_tracing(&scene, &config, n_photons / u64::from(share.of()), &pool, interrupt)?;
    let of_photons = predict(photons, "ask for fewer with --photons, or for shards with --shard")?;
    let predicted = of_surfaces.max(of_photons);
    let command = remedy(args, scene_path, args.shard);
    let mut settings = vec![("the program".to_owned(), MADE_BY.to_owned())];
    settings.extend(cli::settings_of(&command));
    let parts = scene.inventory().parts();
    settings.extend(parts.map(|(name, digest)| (name.to_owned(), digest.to_string())));
    let journal =
        Arc::new(Journal::open(Some(output), args.journal, &args.common, &settings, console)?);
    let kept = Arc::clone(&journal);
    interrupt.at_end(move || kept.farewell(NOTHING_WRITTEN));

    let traced = trace(&scene, &config, args.shard, &pool, &console, interrupt, &journal)?;
    audit(&traced, args, &console)?;
    let trace = clock.lap();

    let metadata = metadata(&scene, &config, &traced.account);
    let stores_focused = args.store.contains(&Store::Gather);
    let command_of_all = remedy(args, scene_path, None);
    let (written, tree) = match args.shard {
        Some(share) => {
            let emitted_by_light = photons_of_lights(&scene, &config);
            let about = ShardMetadata {
                share,
                metadata,
                emitted_by_light,
                stores_direct: config.store_direct,
                aim: config.aim,
                stores_focused,
                made_by: MADE_BY.into(),
                command_of_all,
            };
            let existing = args.common.existing();
            let written =
                pool.install(|| shard::save(output, existing, about, traced, &command))?;
            (written, Seconds::default())
        }
        None => {
            let maps = pool.install(|| maps(metadata, &config, stores_focused, traced))?;
            let tree = clock.lap();
            interrupt.check()?;
            let file_bytes = maps.save(output, args.common.existing(), MADE_BY, &command_of_all)?;
            (Written::maps(&maps, file_bytes), tree)
        }
    };
    journal.remove();
    let write = clock.lap();

    let stages = Stages { load, bvh, trace, tree, write, total: clock.total() };
    stats::say(&console, &written, &stages, output);
    if let Some(path) = &args.common.stats {
        let stats = pool.install(|| Stats::new(Some(scene_path), &written, &stages, predicted));
        cli::write_stats(path, args.common.existing(), &stats)?;
    }
    Ok(())
}

/// The program and its version, as files tell them.
pub(crate) const MADE_BY: &str = concat!("photon-build ", env!("CARGO_PKG_VERSION"));

/// What an interrupted run leaves behind.
pub(crate) const NOTHING_WRITTEN: &str = "no photon map was written";

/// Emitting more than this would fill the memory of any machine, and more of a class can't be numbered.
pub(crate) const MOST_PHOTONS: u64 = u32::MAX as u64;

/// Refuses numbers of photons that can't be, whatever the scene.
fn check_number(args: &Args) -> anyhow::Result<()> {
    match (args.photons_per_light, total(args)) {
        (Some(0), _) => {
            bail!(WrongUsage("--photons-per-light 0 emits nothing; ask for one at least".into()))
        }
        (None, 0) => {
            bail!(WrongUsage("--photons 0 emits nothing; ask for one photon at least".into()))
        }
        (Some(n), _) | (None, n) if n > MOST_PHOTONS => bail!(too_many(n)),
        (None, n) => {
            let quotas = args.quota.iter().fold(0_u64, |sum, q| sum.saturating_add(q.photons));
            if quotas > n {
                bail!(WrongUsage(format!(
                    "the quotas take {quotas} photons of {n}; raise --photons"
                )));
            }
            Ok(())
        }
        _ => Ok(()),
    }
}

fn total(args: &Args) -> u64 {
    args.photons.unwrap_or(1_000_000)
}

/// How many photons are emitted from which light.
fn budget(args: &Args, path: &Path, scene: &Scene) -> anyhow::Result<Budget> {
    if let Some(n) = args.photons_per_light {
        return Ok(Budget::PerLight(n));
    }
    if args.quota.is_empty() && args.min_share == 0.0 {
        return Ok(Budget::Total(total(args)));
    }
    let fluxes = fluxes(scene);
    let mut quotas = vec![None; scene.lights.len()];
    for Quota { light, photons } in &args.quota {
        let named = |i: &usize| scene.lights[*i].name == *light;
        let mut found = (0..quotas.len()).filter(named);
        let (Some(i), None) = (found.next(), found.next()) else {
            let n = (0..quotas.len()).filter(named).count();
            bail!(
                "{} has {} light `{light}`, for --quota; its lights are {}",
                path.display(),
                if n == 0 { "no".into() } else { format!("more than one ({n})") },
                names(scene)
            );
        };
        if fluxes[i].is_black() {
            bail!("{}: light `{light}` emits nothing; leave out its --quota", path.display());
        }
        if quotas[i].replace(*photons).is_some() {
            bail!(WrongUsage(format!("--quota names light `{light}` twice")));
        }
    }
    Ok(Budget::Each(share_out(total(args), args.min_share, &quotas, &fluxes)))
}

/// The names of the lights, of many the first.
fn names(scene: &Scene) -> String {
    const MOST: usize = 10;
    let named = scene.lights.iter().take(MOST).map(|light| format!("`{}`", light.name));
    let mut names: Vec<String> = named.collect();
    if scene.lights.len() > MOST {
        names.push(format!("{} more", scene.lights.len() - MOST));
    }
    names.join(", ")
}

fn too_many(n_photons: u64) -> WrongUsage {
    WrongUsage(format!("{n_photons} photons are too many; ask for {MOST_PHOTONS} at most"))
}

fn trace(
    scene: &Scene,
    config: &Config,
    shard: Option<Share>,
    pool: &rayon::ThreadPool,
    console: &Console,
    interrupt: &Interrupt,
    journal: &Journal,
) -> anyhow::Result<Traced> {
    let share = shard.unwrap_or(Share::WHOLE);
    let n_photons: u64 = photons_of_lights(scene, config).into_iter().sum();
    let bar = console.progress("photons", n_photons / u64::from(share.of()));
    let done = AtomicU64::new(0);
    let watch = |n| {
        bar.set_position(done.fetch_add(n, Ordering::Relaxed) + n);
        interrupt.go_on()
    };
    let traced = resume::with_keeper(journal, |keeper| {
        pool.install(|| photon_trace::trace_kept(scene, config, share, keeper, &watch))
    });
    bar.finish_and_clear();
    Ok(traced?)
}

/// Every photon must have met an end, the ends must hold all the light, and what landed must be photons.
fn audit(traced: &Traced, args: &Args, console: &Console) -> anyhow::Result<()> {
    /// What rounding at every surface of a long path may come to.
    const MOST_IMBALANCE: f64 = 1e-3;

    let Account { emitted, absorbed, escaped, cut, energy, .. } = &traced.account;
    let ended = absorbed + escaped + cut;
    if ended != *emitted {
        bail!("{emitted} photons were emitted and {ended} ended: this is a bug, please report it");
    }
    let is_balanced = energy.imbalance() <= MOST_IMBALANCE;
    // No number is balanced.
    if !is_balanced {
        bail!(
            "no photon map was written, since energy got lost or was made: {energy:?} (W); this is a bug, please \
             report it"
        );
    }
    let is_sound = |p: &Photon| p.position.is_finite() && p.flux.is_finite();
    let sets = [&traced.direct, &traced.caustic, &traced.indirect];
    if let Some(photon) = sets.into_iter().flatten().find(|p| !is_sound(p)) {
        bail!(
            "no photon map was written, since {photon:?} is no photon: this is a bug, please report it"
        );
    }
    if *cut > 0 {
        let share = *cut as f64 / *emitted as f64 * 100.0;
        console.warn(format_args!(
            "{cut} photons ({share:.3} %) were cut after {} surfaces; raise --max-bounces to keep their light",
            args.max_bounces
        ))?;
    }
    Ok(())
}

fn photons_of_lights(scene: &Scene, config: &Config) -> Vec<u64> {
    photon_trace::photons_of_lights(&config.budget, &fluxes(scene))
}

fn fluxes(scene: &Scene) -> Vec<Rgb> {
    scene.lights.iter().map(|light| light.flux(&scene.bounds())).collect()
}

fn metadata(scene: &Scene, config: &Config, account: &Account) -> Metadata {
    let Account { emitted, absorbed, escaped, cut, rays, flux, .. } = *account;
    Metadata {
        inventory: scene.inventory().clone(),
        seed: config.seed,
        max_bounces: config.max_bounces,
        emitted,
        absorbed,
        escaped,
        cut,
        rays,
        flux,
    }
}

fn maps(
    metadata: Metadata,
    config: &Config,
    stores_focused: bool,
    traced: Traced,
) -> anyhow::Result<PhotonMaps> {
    let sets = [&traced.direct, &traced.caustic, &traced.indirect];
    if let Some(n) = sets.map(Vec::len).into_iter().find(|&n| n as u64 > MOST_PHOTONS) {
        bail!("{n} photons of a class are more than {MOST_PHOTONS}; ask for fewer");
    }
    // One after the other, each freed before it is sorted: as they were traced, they take twice as much memory as their trees.
    let set = |photons: Vec<Photon>| {
        let mut loose = Loose::new(photons.len(), largest_flux(&photons));
        loose.extend(&photons, |photon| *photon);
        drop(photons);
        loose.into_set()
    };
    let direct = config.store_direct.then(|| set(traced.direct));
    let caustic = set(traced.caustic);
    let indirect = set(traced.indirect);
    let focused = stores_focused.then(|| set(traced.focused));
    Ok(PhotonMaps { metadata, direct, caustic, indirect, focused })
}

/// The command that makes the map anew, with `{file}` for its name; only what decides its contents.
fn remedy(args: &Args, scene: &Path, shard: Option<Share>) -> String {
    let mut words = vec!["photon-build".into(), scene.into(), "-o".into(), "{file}".into()];
    let mut option = |name: &str, value: String| words.extend([name.into(), value.into()]);
    match args.photons_per_light {
        Some(n) => option("--photons-per-light", n.to_string()),
        None => option("--photons", total(args).to_string()),
    }
    for Quota { light, photons } in &args.quota {
        option("--quota", format!("{light}={photons}"));
    }
    if args.min_share > 0.0 {
        option("--min-share", args.min_share.to_string());
    }
    option("--seed", args.seed.to_string());
    option("--max-bounces", args.max_bounces.to_string());
    if args.aim > 0.0 {
        option("--aim", args.aim.to_string());
    }
    if args.store.contains(&Store::Gather) {
        option("--store", "gather".into());
    } else if args.store.contains(&Store::Direct) {
        option("--store", "direct".into());
    }
    words.extend(args.scene_options.words().into_iter().map(Into::into));
    if let Some(share) = shard {
        words.extend(["--shard".into(), share.to_string().into()]);
    }
    words.push("--force".into());
    cli::command_line(words)
}
