//! `photon-build merge`: from the shards of a run to the maps that one process makes.

use std::path::{Path, PathBuf};

use anyhow::bail;
use base::PhotonClass;
use cli::{Clock, Console, Interrupt, Seconds};
use mapfile::MapFile;
use photon_map::{PhotonShard, ShardMetadata};

use crate::args::Merge;
use crate::build::{MADE_BY, MOST_PHOTONS, NOTHING_WRITTEN};
use crate::memory;
use crate::stats::{self, Stages, Stats, Written};

/// Joins the shards that the command line names.
///
/// # Errors
/// When a shard can't be read, is missing, there twice, or of another run; the message names it.
pub(crate) fn merge(args: &Merge) -> anyhow::Result<()> {
    let mut clock = Clock::start();
    let console = Console::new("photon-build", &args.common);
    let interrupt = Interrupt::listen("photon-build", NOTHING_WRITTEN);
    let outputs: Vec<&Path> =
        args.common.stats.iter().chain([&args.output]).map(PathBuf::as_path).collect();
    let inputs: Vec<&Path> = args.shards.iter().map(PathBuf::as_path).collect();
    cli::check_outputs(&outputs, &inputs, args.common.existing())?;
    let pool = args.common.thread_pool()?;
    pool.install(|| {
        let (shards, files) = open(&args.shards, &interrupt)?;
        let load = clock.lap();
        let remedy = "ask for fewer photons, or use a larger machine";
        let need = memory::of_merging(&shards);
        let predicted = cli::predict_memory(need, args.memory, remedy, &console)?;
        let maps = photon_map::merge(&shards);
        let tree = clock.lap();
        interrupt.check()?;
        files.iter().try_for_each(MapFile::check_untouched)?;

        let command = &shards[0].about.command_of_all;
        let file_bytes = maps.save(&args.output, args.common.existing(), MADE_BY, command)?;
        let write = clock.lap();
        let (bvh, trace) = (Seconds::default(), Seconds::default());
        let stages = Stages { load, bvh, trace, tree, write, total: clock.total() };
        let written = Written::maps(&maps, file_bytes);
        stats::say(&console, &written, &stages, &args.output);
        if let Some(path) = &args.common.stats {
            let stats = Stats::new(None, &written, &stages, predicted);
            cli::write_stats(path, args.common.existing(), &stats)?;
        }
        Ok(())
    })
    .map_err(|error| interrupt.explain(error))
}

/// A shard, its file and its name.
struct Opened<'a> {
    path: &'a Path,
    file: MapFile,
    shard: PhotonShard,
}

/// All shards of a run, in order, and their files.
fn open(
    paths: &[PathBuf],
    interrupt: &Interrupt,
) -> anyhow::Result<(Vec<PhotonShard>, Vec<MapFile>)> {
    let mut opened: Vec<Opened<'_>> = Vec::new();
    for path in paths {
        interrupt.check()?;
        let (shard, file) = PhotonShard::open(path)?;
        let this = Opened { path, file, shard };
        if let Some(first) = opened.first() {
            check_kin(first, &this)?;
        } else {
            check_program(&this)?;
        }
        opened.push(this);
    }
    opened.sort_by_key(|opened| opened.shard.about.share.number());
    for pair in opened.windows(2) {
        let [a, b] = [&pair[0], &pair[1]];
        if a.shard.about.share == b.shard.about.share {
            let (a, b, share) = (a.path.display(), b.path.display(), a.shard.about.share);
            bail!("{a} and {b} are both shard {share}; leave one of them out");
        }
    }
    check_all_there(&opened)?;
    let (shards, files): (Vec<PhotonShard>, Vec<MapFile>) =
        opened.into_iter().map(|opened| (opened.shard, opened.file)).unzip();
    for class in PhotonClass::ALL {
        let n: u64 = shards.iter().map(|shard| shard.n_photons(class) as u64).sum();
        if n > MOST_PHOTONS {
            bail!(
                "{n} {} photons are more than {MOST_PHOTONS}; emit fewer with --photons",
                class.name()
            );
        }
    }
    Ok((shards, files))
}

/// Refuses shards of another version of the program: their photons may be others, too.
fn check_program(shard: &Opened<'_>) -> anyhow::Result<()> {
    let made_by = &shard.shard.about.made_by;
    if made_by != MADE_BY {
        bail!(
            "{} was made by {made_by}, and this is {MADE_BY}; make it anew with: {}",
            shard.path.display(),
            shard.file.header().remedy(shard.path)
        );
    }
    Ok(())
}

/// Refuses a shard of another run than that of the first one.
fn check_kin(first: &Opened<'_>, this: &Opened<'_>) -> anyhow::Result<()> {
    check_program(this)?;
    let (a, b): (&ShardMetadata, &ShardMetadata) = (&first.shard.about, &this.shard.about);
    let (a_scene, b_scene) = (&a.metadata.inventory, &b.metadata.inventory);
    let differences = [
        (a_scene != b_scene, format!("the scene ({})", b_scene.changes(a_scene).join(", "))),
        (a.metadata.seed != b.metadata.seed, "--seed".into()),
        (a.metadata.max_bounces != b.metadata.max_bounces, "--max-bounces".into()),
        (
            (a.stores_direct, a.stores_focused) != (b.stores_direct, b.stores_focused),
            "--store".into(),
        ),
        (a.aim.to_bits() != b.aim.to_bits(), "--aim".into()),
        (a.emitted_by_light != b.emitted_by_light, "the number of photons".into()),
        (a.metadata.flux != b.metadata.flux, "the flux of the lights".into()),
        (a.share.of() != b.share.of(), "the number of shards".into()),
    ];
    if let Some((_, what)) = differences.into_iter().find(|(differs, _)| *differs) {
        bail!(
            "{} belongs to another run than {}: they differ in {what}; it was made with: {}",
            this.path.display(),
            first.path.display(),
            this.file.header().remedy(this.path)
        );
    }
    Ok(())
}

/// Refuses shards, sorted and no two the same, that are not everything.
fn check_all_there(opened: &[Opened<'_>]) -> anyhow::Result<()> {
    let first = &opened[0];
    let share = first.shard.about.share;
    let is_there = |number: &u32| {
        opened.binary_search_by_key(number, |o| o.shard.about.share.number()).is_ok()
    };
    let missing: Vec<u32> = (1..=share.of()).filter(|number| !is_there(number)).take(6).collect();
    if let Some(&number) = missing.first() {
        let (some, more) = (&missing[..missing.len().min(5)], missing.len() > 5);
        let list =
            some.iter().map(|n| format!("{n}/{}", share.of())).collect::<Vec<_>>().join(", ");
        let command = first
            .file
            .header()
            .command
            .replace(&format!("--shard {share} "), &format!("--shard {number}/{} ", share.of()));
        bail!(
            "shard {list}{} is missing; name it, or make it with: {}",
            if more { " and more" } else { "" },
            command.replace("'{file}'", "SHARD")
        );
    }
    let emitted: u64 = opened.iter().map(|o| o.shard.about.metadata.emitted).sum();
    let expected: u64 = first.shard.about.emitted_by_light.iter().sum();
    if emitted != expected {
        bail!("the shards hold {emitted} of {expected} photons: this is a bug, please report it");
    }
    Ok(())
}
