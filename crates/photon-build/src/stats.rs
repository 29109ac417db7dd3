//! The account of a run: for people, and as JSON whose names are a contract.

use std::path::Path;

use base::{Fingerprint, PhotonClass};
use cli::Console;
use photon_map::{Metadata, PhotonMaps};
use serde::Serialize;

/// Time of each stage.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Stages {
    pub(crate) load: cli::Seconds,
    pub(crate) bvh: cli::Seconds,
    pub(crate) trace: cli::Seconds,
    pub(crate) tree: cli::Seconds,
    pub(crate) write: cli::Seconds,
    pub(crate) total: cli::Seconds,
}

/// What was written.
#[derive(Debug)]
pub(crate) struct Written {
    pub(crate) metadata: Metadata,
    /// Of maps; shards have none.
    pub(crate) fingerprint: Option<Fingerprint>,
    /// Photons by class, in the order of [`PhotonClass::ALL`]; nothing for a class that isn't stored.
    pub(crate) stored: [Option<usize>; PhotonClass::ALL.len()],
    /// What the photons take.
    pub(crate) n_bytes: usize,
    pub(crate) file_bytes: u64,
}

impl Written {
    /// Maps that were written to a file of so many bytes.
    pub(crate) fn maps(maps: &PhotonMaps, file_bytes: u64) -> Self {
        let mut stored = [None; PhotonClass::ALL.len()];
        maps.sets().for_each(|(class, set)| stored[class as usize] = Some(set.len()));
        Self {
            metadata: maps.metadata.clone(),
            fingerprint: Some(maps.fingerprint()),
            stored,
            n_bytes: maps.sets().map(|(_, set)| set.n_bytes()).sum(),
            file_bytes,
        }
    }
}

#[derive(Debug, Serialize)]
pub(crate) struct Stats {
    program: &'static str,
    version: &'static str,
    /// Nothing when shards were merged, which needs no scene.
    scene: Option<String>,
    /// Nothing for a shard.
    fingerprint: Option<String>,
    seed: u64,
    threads: usize,
    emitted: u64,
    stored: Stored,
    absorbed: u64,
    escaped: u64,
    cut: u64,
    rays: u64,
    bytes_per_photon: f64,
    file_bytes: u64,
    seconds: Seconds,
    cpu_seconds: Seconds,
    /// What was predicted before the work: the next is to be no more.
    predicted_rss_bytes: u64,
    peak_rss_bytes: u64,
}

#[derive(Debug, Serialize)]
struct Stored {
    direct: usize,
    caustic: usize,
    indirect: usize,
    focused: usize,
}

#[derive(Debug, Serialize)]
struct Seconds {
    load: f64,
    bvh: f64,
    trace: f64,
    tree: f64,
    write: f64,
    total: f64,
}

impl Stats {
    pub(crate) fn new(
        scene: Option<&Path>,
        written: &Written,
        stages: &Stages,
        predicted_rss_bytes: u64,
    ) -> Self {
        let seconds = |f: fn(&cli::Seconds) -> f64| Seconds {
            load: f(&stages.load),
            bvh: f(&stages.bvh),
            trace: f(&stages.trace),
            tree: f(&stages.tree),
            write: f(&stages.write),
            total: f(&stages.total),
        };
        let metadata = &written.metadata;
        let stored = |class: PhotonClass| written.stored[class as usize].unwrap_or(0);
        let n_photons = written.stored.iter().flatten().sum::<usize>().max(1);
        Self {
            program: "photon-build",
            version: env!("CARGO_PKG_VERSION"),
            scene: scene.map(|path| path.display().to_string()),
            fingerprint: written.fingerprint.map(|fingerprint| fingerprint.to_string()),
            seed: metadata.seed,
            threads: rayon::current_num_threads(),
            emitted: metadata.emitted,
            stored: Stored {
                direct: stored(PhotonClass::Direct),
                caustic: stored(PhotonClass::Caustic),
                indirect: stored(PhotonClass::Indirect),
                focused: stored(PhotonClass::Focused),
            },
            absorbed: metadata.absorbed,
            escaped: metadata.escaped,
            cut: metadata.cut,
            rays: metadata.rays,
            bytes_per_photon: written.n_bytes as f64 / n_photons as f64,
            file_bytes: written.file_bytes,
            seconds: seconds(|s| s.wall),
            cpu_seconds: seconds(|s| s.cpu),
            predicted_rss_bytes,
            peak_rss_bytes: cli::peak_rss_bytes(),
        }
    }
}

/// The account for people.
pub(crate) fn say(console: &Console, written: &Written, stages: &Stages, output: &Path) {
    let Metadata { emitted, absorbed, escaped, rays, .. } = written.metadata;
    console.detail(format_args!("{absorbed} photons absorbed, {escaped} escaped, {rays} rays"));
    let Stages { load, bvh, trace, tree, write, total } = stages;
    for (stage, seconds) in
        [("load", load), ("bvh", bvh), ("trace", trace), ("tree", tree), ("write", write)]
    {
        console
            .detail(format_args!("{stage:>10} {:8.2} s {:8.2} CPU s", seconds.wall, seconds.cpu));
    }
    for (class, n) in PhotonClass::ALL.into_iter().zip(written.stored) {
        if let Some(n) = n {
            console.say(format_args!("{n:>10} {} photons", class.name()));
        }
    }
    console.say(format_args!(
        "{emitted} emitted, {:.1} MB written to {} in {:.2} s ({:.2} CPU s)",
        written.file_bytes as f64 * 1e-6,
        output.display(),
        total.wall,
        total.cpu,
    ));
}
