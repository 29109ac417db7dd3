//! The account of a run: for people, and as JSON whose names are a contract.

use base::{Component, Components, Fingerprint};
use cli::{Console, Seconds};
use serde::Serialize;

use crate::adaptive::ErrorReport;
use crate::tally::Tally;
use crate::{Args, Mode};

/// Time of what is done once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stages {
    pub(crate) load: Seconds,
    pub(crate) total: Seconds,
}

#[derive(Debug, Serialize)]
pub(crate) struct Stats {
    program: &'static str,
    version: &'static str,
    scene: String,
    mode: &'static str,
    /// Of the whole picture, also where a part of it was rendered.
    resolution: [u32; 2],
    /// Those that were looked at.
    #[serde(skip)]
    n_subpixels: usize,
    supersample: u32,
    seed: u64,
    threads: usize,
    photons_fingerprint: String,
    seconds: StageSeconds,
    cpu_seconds: StageSeconds,
    /// Pixels that this run has computed. What was loaded from a cache map is neither here nor among the interpolated.
    /// Supersampled, all three count subpixels.
    traced: Components<u64>,
    interpolated: Components<u64>,
    /// Pixels whose values mode adaptive has taken from the file of `--from-cache`.
    reused: Components<u64>,
    rays: Rays,
    photons_visited: u64,
    chains_cut: u64,
    error: Option<ErrorReport>,
    /// What was predicted before the work: the next is to be no more.
    predicted_rss_bytes: u64,
    peak_rss_bytes: u64,
}

#[derive(Debug, Serialize)]
struct StageSeconds {
    load: f64,
    primary: f64,
    direct: f64,
    indirect: f64,
    specular: f64,
    caustic: f64,
    cache: f64,
    write: f64,
    total: f64,
}

#[derive(Debug, Serialize)]
struct Rays {
    eye: u64,
    specular: u64,
    shadow: u64,
    gather: u64,
}

impl Stats {
    pub(crate) fn new(
        args: &Args,
        tally: &Tally,
        photons: Fingerprint,
        stages: &Stages,
        predicted_rss_bytes: u64,
    ) -> Self {
        let seconds = |f: fn(&Seconds) -> f64| StageSeconds {
            load: f(&stages.load),
            primary: f(&tally.primary),
            direct: f(&tally.seconds.direct),
            indirect: f(&tally.seconds.indirect),
            specular: f(&tally.seconds.specular),
            caustic: f(&tally.seconds.caustic),
            cache: f(&tally.cache),
            write: f(&tally.write),
            total: f(&stages.total),
        };
        let counts = tally.counts;
        Self {
            program: "render-cached",
            version: env!("CARGO_PKG_VERSION"),
            scene: args.scene.as_ref().map_or_else(String::new, |p| p.display().to_string()),
            mode: match args.mode {
                Mode::Original => "original",
                Mode::Paper => "paper",
                Mode::Adaptive => "adaptive",
            },
            resolution: args.resolution.map_or([0, 0], |size| [size.width, size.height]),
            n_subpixels: tally.n_subpixels,
            supersample: args.supersample,
            seed: args.seed,
            threads: rayon::current_num_threads(),
            photons_fingerprint: photons.to_string(),
            seconds: seconds(|s| s.wall),
            cpu_seconds: seconds(|s| s.cpu),
            traced: tally.traced,
            interpolated: tally.interpolated,
            reused: tally.reused,
            rays: Rays {
                eye: counts.eye_rays,
                specular: counts.specular_rays,
                shadow: counts.shadow_rays,
                gather: counts.gather_rays,
            },
            photons_visited: counts.photons_visited,
            chains_cut: counts.chains_cut,
            error: tally.error,
            predicted_rss_bytes,
            peak_rss_bytes: cli::peak_rss_bytes(),
        }
    }

    /// The account for people.
    pub(crate) fn say(&self, console: &Console) {
        let [w, h] = self.resolution;
        for component in Component::ALL {
            let (traced, cpu) = (self.traced[component], self.cpu_of(component));
            let percent = |n: u64| n as f64 / self.n_subpixels as f64 * 100.0;
            let share = percent(traced);
            let reused = match self.reused[component] {
                0 => String::new(),
                n => format!(", {:6.2} % reused", percent(n)),
            };
            console.say(format_args!(
                "{component:>10} {cpu:8.2} CPU s, {share:6.2} % of the pixels traced{reused}"
            ));
        }
        console.say(format_args!("{:>10} {:8.2} CPU s", "cache", self.cpu_seconds.cache));
        for (stage, cpu) in [
            ("load", self.cpu_seconds.load),
            ("eye rays", self.cpu_seconds.primary),
            ("write", self.cpu_seconds.write),
        ] {
            console.detail(format_args!("{stage:>10} {cpu:8.2} CPU s"));
        }
        let Rays { eye, specular, shadow, gather } = self.rays;
        console.detail(format_args!(
            "{eye} rays from the eye, {specular} specular, {shadow} shadow, {gather} gather rays; {} photons visited",
            self.photons_visited
        ));
        console.say(format_args!(
            "{w}x{h} in {:.2} s ({:.2} CPU s), mode {}",
            self.seconds.total, self.cpu_seconds.total, self.mode
        ));
    }

    fn cpu_of(&self, component: Component) -> f64 {
        match component {
            Component::Direct => self.cpu_seconds.direct,
            Component::Indirect => self.cpu_seconds.indirect,
            Component::Specular => self.cpu_seconds.specular,
            Component::Caustic => self.cpu_seconds.caustic,
        }
    }
}
