//! Finished runs by scene, size and mode, and what follows from them.

use anyhow::{Context, ensure};

use crate::bench::raw::{Pass, Quality, Record};
use crate::bench::settings::Settings;
use crate::bench::spread::Spread;
use crate::stats::{BuildStats, RenderStats};

/// All runs of a bench.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Runs {
    pub(crate) settings: Settings,
    pub(crate) scenes: Vec<SceneRuns>,
}

/// The runs of a scene.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SceneRuns {
    pub(crate) name: String,
    pub(crate) command: String,
    /// One of each measured run, in order.
    pub(crate) pass_1: Vec<BuildStats>,
    pub(crate) yardsticks: Vec<f64>,
    pub(crate) sizes: Vec<SizeRuns>,
}

/// The runs for one picture size.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SizeRuns {
    pub(crate) size: u32,
    /// The original first.
    pub(crate) modes: Vec<ModeRuns>,
}

/// The runs of one mode.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ModeRuns {
    pub(crate) mode: String,
    pub(crate) command: String,
    /// One of each measured run, in order: the n-th of every mode and of pass 1 make up a pair.
    pub(crate) rounds: Vec<RenderStats>,
    pub(crate) yardsticks: Vec<f64>,
    /// `None` for the original.
    pub(crate) quality: Option<Quality>,
}

/// Which seconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Clock {
    /// Of all threads together.
    Cpu,
    /// On the wall.
    Wall,
}

/// A row of Tables I and II, or one of those that the paper lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Row {
    Caustics,
    Specular,
    Indirect,
    Direct,
    /// What the cache costs: choosing, interpolating, checking.
    Cache,
    EyeRays,
    /// Opening scene and maps, writing the picture, starting and ending.
    Rest,
    Pass1,
    Total,
}

/// What counts when savings are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Saved {
    /// Both programs from start to end.
    WithPass1,
    /// Eye rays, components and cache.
    Pass2,
    /// `render-cached` from start to end.
    WithMap,
}

impl Row {
    /// All, in the order of the paper's tables.
    pub(crate) const ALL: [Self; 9] = [
        Self::Caustics,
        Self::Specular,
        Self::Indirect,
        Self::Direct,
        Self::Cache,
        Self::EyeRays,
        Self::Rest,
        Self::Pass1,
        Self::Total,
    ];

    /// The name in tables and figures.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Caustics => "Caustics",
            Self::Specular => "Specular",
            Self::Indirect => "Indirect",
            Self::Direct => "Direct",
            Self::Cache => "Cache's own time",
            Self::EyeRays => "Eye rays",
            Self::Rest => "Load, write",
            Self::Pass1 => "Pass 1",
            Self::Total => "Total time",
        }
    }
}

impl Saved {
    pub(crate) const ALL: [Self; 3] = [Self::WithPass1, Self::Pass2, Self::WithMap];

    /// The name of the row.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::WithPass1 => "Saved, pass 1 counted",
            Self::Pass2 => "Saved of pass 2 alone",
            Self::WithMap => "Saved with a map that was there",
        }
    }
}

impl Runs {
    /// Sorts records into place; they come in the order in which they were planned.
    ///
    /// # Errors
    /// When an account isn't readable, when runs are missing, or when they are of different settings.
    pub(crate) fn of(records: &[Record]) -> anyhow::Result<Self> {
        let settings = &records.first().context("there are no runs")?.settings;
        let mut scenes: Vec<SceneRuns> = Vec::new();
        for record in records {
            let name = &record.run.scene;
            ensure!(
                record.settings == *settings,
                "the runs are of different settings: {settings}; and {}",
                record.settings
            );
            if scenes.last().is_none_or(|s| s.name != *name) {
                scenes.push(SceneRuns {
                    name: name.clone(),
                    command: String::new(),
                    pass_1: Vec::new(),
                    yardsticks: Vec::new(),
                    sizes: Vec::new(),
                });
            }
            let scene = scenes.last_mut().expect("a scene was pushed if there was none");
            scene.add(record)?;
        }
        let runs = Self { settings: settings.clone(), scenes };
        runs.check()?;
        Ok(runs)
    }

    fn check(&self) -> anyhow::Result<()> {
        for scene in &self.scenes {
            let n = scene.pass_1.len();
            ensure!(n > 0, "{} has no run of pass 1", scene.name);
            for size in &scene.sizes {
                let is_original = size.modes.first().is_some_and(|m| m.mode == "original");
                ensure!(is_original, "{} {} has no original", scene.name, size.size);
                for mode in &size.modes {
                    ensure!(
                        mode.rounds.len() == n,
                        "{} {} {} has {} runs and pass 1 {n}",
                        scene.name,
                        size.size,
                        mode.mode,
                        mode.rounds.len()
                    );
                }
            }
        }
        Ok(())
    }

    /// Measured runs of each.
    pub(crate) fn n_runs(&self) -> usize {
        self.scenes.first().map_or(0, |scene| scene.pass_1.len())
    }
}

impl SceneRuns {
    /// The runs of a mode at a size.
    pub(crate) fn mode(&self, size: u32, mode: &str) -> Option<&ModeRuns> {
        let size = self.sizes.iter().find(|s| s.size == size)?;
        size.modes.iter().find(|m| m.mode == mode)
    }

    fn add(&mut self, record: &Record) -> anyhow::Result<()> {
        let is_measured = record.run.round > 0;
        match &record.run.pass {
            Pass::Build => {
                if is_measured {
                    self.pass_1.push(record.build_stats()?);
                    self.yardsticks.push(record.yardstick);
                } else {
                    self.command.clone_from(&record.command);
                }
            }
            Pass::Render { size, mode } => {
                if self.sizes.last().is_none_or(|s| s.size != *size) {
                    self.sizes.push(SizeRuns { size: *size, modes: Vec::new() });
                }
                let sizes = self.sizes.last_mut().expect("a size was pushed if there was none");
                if !is_measured {
                    sizes.modes.push(ModeRuns {
                        mode: mode.clone(),
                        command: record.command.clone(),
                        rounds: Vec::new(),
                        yardsticks: Vec::new(),
                        quality: record.quality,
                    });
                    return Ok(());
                }
                let runs = sizes.modes.iter_mut().find(|m| m.mode == *mode);
                let runs = runs.with_context(|| format!("{mode} {size} was never warmed up"))?;
                runs.rounds.push(record.render_stats()?);
                runs.yardsticks.push(record.yardstick);
            }
        }
        Ok(())
    }

    /// Seconds of a row.
    pub(crate) fn seconds(&self, mode: &ModeRuns, row: Row, clock: Clock) -> Spread {
        let pairs = self.pass_1.iter().zip(&mode.rounds);
        Spread::of(pairs.map(|(pass_1, pass_2)| seconds(pass_1, pass_2, row, clock)))
    }

    /// CPU time of a row, each run in units of the yardstick that was timed just before it: what can be compared with
    /// another day and another machine.
    pub(crate) fn yards(&self, mode: &ModeRuns, row: Row) -> Spread {
        let of = |i: usize| {
            let seconds = |row| seconds(&self.pass_1[i], &mode.rounds[i], row, Clock::Cpu);
            let pass_1 = seconds(Row::Pass1) / self.yardsticks[i];
            match row {
                Row::Pass1 => pass_1,
                Row::Total => pass_1 + mode.rounds[i].cpu_seconds.total / mode.yardsticks[i],
                row => seconds(row) / mode.yardsticks[i],
            }
        };
        Spread::of((0..mode.rounds.len()).map(of))
    }

    /// Share of the original's time that a mode saves, from run to run.
    pub(crate) fn saved(
        &self,
        size: &SizeRuns,
        mode: &ModeRuns,
        saved: Saved,
        clock: Clock,
    ) -> Spread {
        let of = |pass_1: &BuildStats, pass_2: &RenderStats| {
            let row = |row| seconds(pass_1, pass_2, row, clock);
            match saved {
                Saved::WithPass1 => row(Row::Total),
                Saved::Pass2 => row(Row::Total) - row(Row::Pass1) - row(Row::Rest),
                Saved::WithMap => row(Row::Total) - row(Row::Pass1),
            }
        };
        let original = &size.modes[0];
        let pairs = self.pass_1.iter().zip(original.rounds.iter().zip(&mode.rounds));
        Spread::of(
            pairs.map(|(pass_1, (original, cached))| {
                1.0 - of(pass_1, cached) / of(pass_1, original)
            }),
        )
    }
}

fn seconds(pass_1: &BuildStats, pass_2: &RenderStats, row: Row, clock: Clock) -> f64 {
    let (pass_1, pass_2) = match clock {
        Clock::Cpu => (pass_1.cpu_seconds, pass_2.cpu_seconds),
        Clock::Wall => (pass_1.seconds, pass_2.seconds),
    };
    match row {
        Row::Caustics => pass_2.caustic,
        Row::Specular => pass_2.specular,
        Row::Indirect => pass_2.indirect,
        Row::Direct => pass_2.direct,
        Row::Cache => pass_2.cache,
        Row::EyeRays => pass_2.primary,
        Row::Rest => pass_2.rest(),
        Row::Pass1 => pass_1.total,
        Row::Total => pass_1.total + pass_2.total,
    }
}

impl ModeRuns {
    /// The account of counts, which is the same in all runs.
    pub(crate) fn counts(&self) -> &RenderStats {
        &self.rounds[0]
    }

    /// CPU seconds of pass 2: eye rays, components and cache.
    pub(crate) fn pass_2(&self) -> Spread {
        Spread::of(self.rounds.iter().map(|stats| stats.cpu_seconds.pass_2()))
    }

    /// The most memory held in any run, in bytes.
    pub(crate) fn peak_bytes(&self) -> u64 {
        self.rounds.iter().map(|stats| stats.peak_rss_bytes).max().unwrap_or_default()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use serde_json::json;

    use super::*;
    use crate::bench::outside::Outside;
    use crate::bench::raw::Run;

    /// Records as a bench of a scene makes them, with times that depend on run, size and mode.
    pub(crate) fn records(scene: &str, sizes: &[u32], modes: &[&str], n_runs: u32) -> Vec<Record> {
        let record = |pass: Pass, round: u32, stats| Record {
            run: Run { scene: scene.into(), pass, round },
            settings: Settings::usual(),
            key: "00".into(),
            command: format!("target/release/program {scene}"),
            outside: Outside { wall_seconds: 1.0, cpu_seconds: Some(1.0) },
            yardstick: 0.1,
            output: "00".into(),
            stats,
            quality: None,
        };
        let mut records: Vec<Record> =
            (0..=n_runs).map(|round| record(Pass::Build, round, build_stats(round))).collect();
        for &size in sizes {
            for round in 0..=n_runs {
                for (i, &mode) in modes.iter().enumerate() {
                    let pass = Pass::Render { size, mode: mode.into() };
                    let mut record = record(pass, round, render_stats(size, mode, i, round));
                    if round == 0 && i > 0 {
                        let quality = Quality {
                            mean: 0.0118,
                            p99: 0.0635,
                            worst_block_8x8: 0.087,
                            share_above_0_1: 0.00095,
                        };
                        record.quality = Some(quality);
                    }
                    records.push(record);
                }
            }
        }
        records
    }

    fn build_stats(round: u32) -> serde_json::Value {
        let total = 1.0 + f64::from(round) * 0.1;
        let seconds =
            json!({ "load": 0.0, "trace": 0.6, "tree": 0.2, "write": 0.1, "total": total });
        json!({
            "version": "0.1.0", "threads": 2, "emitted": 1_000_000, "rays": 2_000_000, "file_bytes": 8_000_000,
            "stored": { "direct": 0, "caustic": 75_000, "indirect": 600_000 },
            "seconds": seconds, "cpu_seconds": seconds, "peak_rss_bytes": 40_000_000,
        })
    }

    /// The mode of index `i` takes `1 / (i + 1)` of the time of the original, but for the cache.
    fn render_stats(size: u32, mode: &str, i: usize, round: u32) -> serde_json::Value {
        let n = f64::from(size * size);
        let unit = n * 1e-5 / (i + 1) as f64 * (1.0 + f64::from(round) * 0.01);
        let cache = if i > 0 { unit } else { 0.0 };
        let seconds = |factor: f64| {
            json!({
                "load": 0.001, "primary": unit * factor, "direct": 4.0 * unit * factor, "indirect": 3.0 * unit * factor,
                "specular": 2.0 * unit * factor, "caustic": unit * factor, "cache": cache * factor, "write": 0.009,
                "total": (11.0 * unit + cache) * factor + 0.01,
            })
        };
        let traced = n as u64 / (i as u64 + 1);
        let components =
            |v: u64| json!({ "direct": v, "indirect": v, "specular": v, "caustic": v });
        json!({
            "version": "0.1.0", "mode": mode, "resolution": [size, size], "threads": 2,
            "seconds": seconds(0.5), "cpu_seconds": seconds(1.0),
            "traced": components(traced), "interpolated": components(n as u64 - traced),
            "rays": { "eye": n as u64, "specular": 7, "shadow": 64 * traced, "gather": 0 },
            "photons_visited": 1000 * traced, "peak_rss_bytes": 120_000_000 + u64::from(round),
        })
    }

    #[test]
    fn rows_make_up_the_total() {
        let runs =
            Runs::of(&records("cornell-box", &[64, 128], &["original", "paper"], 3)).unwrap();
        let scene = &runs.scenes[0];
        for size in &scene.sizes {
            for mode in &size.modes {
                for clock in [Clock::Cpu, Clock::Wall] {
                    let of = |row| scene.seconds(mode, row, clock).median;
                    let sum: f64 = Row::ALL[..8].iter().map(|&row| of(row)).sum();
                    assert!((sum / of(Row::Total) - 1.0).abs() < 1e-12, "{sum}");
                }
            }
        }
    }

    #[test]
    fn savings_are_of_what_they_say() {
        let runs = Runs::of(&records("cornell-box", &[100], &["original", "paper"], 3)).unwrap();
        let (scene, size) = (&runs.scenes[0], &runs.scenes[0].sizes[0]);
        let saved = |saved| scene.saved(size, &size.modes[1], saved, Clock::Cpu);
        // Run n: pass 1 takes 1 + n/10, the original 1.1 (1 + n/100) and 0.01, the cached picture 12/22 of that and 0.01.
        let pass_2 = |n: f64| 1.1 * (1.0 + n / 100.0);
        let expected =
            |n: f64, more: f64| 1.0 - (pass_2(n) * 12.0 / 22.0 + more) / (pass_2(n) + more);
        assert!((saved(Saved::Pass2).median - 10.0 / 22.0).abs() < 1e-12);
        assert!((saved(Saved::WithMap).median - expected(2.0, 0.01)).abs() < 1e-12);
        assert!((saved(Saved::WithPass1).median - expected(2.0, 1.21)).abs() < 1e-12);
        assert!((saved(Saved::WithPass1).most - expected(1.0, 1.11)).abs() < 1e-12);
    }

    #[test]
    fn missing_runs_are_noticed() {
        let all = records("rabbit", &[64], &["original", "paper"], 2);
        let says = |keep: &dyn Fn(&Record) -> bool, text: &str| {
            let some: Vec<Record> = all.iter().filter(|r| keep(r)).cloned().collect();
            assert_eq!(Runs::of(&some).unwrap_err().to_string(), text);
        };
        let is_mode = |r: &Record, mode: &str| matches!(&r.run.pass, Pass::Render { mode: m, .. } if m == mode);
        says(&|_| false, "there are no runs");
        says(&|r| r.run.pass != Pass::Build, "rabbit has no run of pass 1");
        says(&|r| !is_mode(r, "original"), "rabbit 64 has no original");
        says(
            &|r| !is_mode(r, "paper") || r.run.round != 2,
            "rabbit 64 paper has 1 runs and pass 1 2",
        );
    }
}
