//! Runs what is planned, in pairs, and reuses what was run before.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use serde_json::Value;

use crate::bench::outside;
use crate::bench::plan::{EXPOSURE, Plan, SceneFile};
use crate::bench::raw::{Pass, Quality, Record, Run, differences, digest, digest_folder};
use crate::programs::{Call, root};
use crate::stats;

/// Whether finished runs of an earlier bench may stand for new ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Earlier {
    Reuse,
    Discard,
}

/// Runs everything, or finds that it was run before, and adds the records in the order of the plan. Each is saved as
/// soon as it is there.
///
/// # Errors
/// When a program fails, when two runs of the same do different work, or when a program's account can't be true. What was
/// measured until then stays in its files, and the sizes that are complete are in `records`.
pub(crate) fn measure(
    plan: &Plan,
    earlier: Earlier,
    records: &mut Vec<Record>,
) -> anyhow::Result<()> {
    let mut bench = Bench { plan, earlier, records, digests: digests(plan)? };
    plan.scenes.iter().try_for_each(|scene| bench.scene(scene))
}

/// The folder of the records.
fn raw_folder(plan: &Plan) -> PathBuf {
    root().join(&plan.out).join("raw")
}

/// Digests of the two programs.
fn digests(plan: &Plan) -> anyhow::Result<[String; 2]> {
    let of = |path: &Path| digest(&root().join(path));
    Ok([of(&plan.programs.photon_build)?, of(&plan.programs.render_cached)?])
}

struct Bench<'a> {
    plan: &'a Plan,
    earlier: Earlier,
    records: &'a mut Vec<Record>,
    digests: [String; 2],
}

impl Bench<'_> {
    fn scene(&mut self, scene: &SceneFile) -> anyhow::Result<()> {
        let plan = self.plan;
        let folder = root().join(&plan.out).join(&scene.name);
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let file = root().join(&scene.path);
        let scene_digest = digest_folder(file.parent().unwrap_or(Path::new(".")))?;

        let build = |round: u32| {
            let (call, output, stats) = plan.build(scene, round);
            let run = Run { scene: scene.name.clone(), pass: Pass::Build, round };
            let key = key(&[&call.to_string(), &self.digests[0], &scene_digest]);
            Step { run, key, call, output, stats, keeps: vec![] }
        };
        let maps = root().join(plan.maps(&scene.name));
        let mut warm_up = build(0);
        warm_up.keeps = vec![maps.clone()];
        let steps: Vec<Vec<Step>> = (1..=plan.runs).map(|round| vec![build(round)]).collect();
        // They join the others with the first pictures that were made from the map.
        let mut pass_1 = self.block(vec![warm_up], steps)?;

        let maps_digest = digest(&maps)?;
        for &size in &plan.sizes {
            let render = |mode: &str, round: u32| {
                let (call, output, stats) = plan.render(scene, size, mode, round);
                let pass = Pass::Render { size, mode: mode.into() };
                let run = Run { scene: scene.name.clone(), pass, round };
                let key = key(&[&call.to_string(), &self.digests[1], &scene_digest, &maps_digest]);
                let picture = root().join(plan.picture(&scene.name, size, mode));
                let keeps =
                    if round == 0 { vec![picture.with_extension("png"), picture] } else { vec![] };
                Step { run, key, call, output, stats, keeps }
            };
            let warm_up = plan.modes.iter().map(|mode| render(mode, 0)).collect();
            let rounds = (1..=plan.runs).map(|round| {
                plan.order(round).into_iter().map(|mode| render(mode, round)).collect()
            });
            let pictures = self.block(warm_up, rounds.collect())?;
            self.records.append(&mut pass_1);
            self.records.extend(pictures);
        }
        Ok(())
    }

    /// Runs one round to warm up, then all rounds to be measured; what is there already isn't run again, but a round is
    /// run as a whole, and never without a warm-up.
    fn block(&self, warm_up: Vec<Step>, rounds: Vec<Vec<Step>>) -> anyhow::Result<Vec<Record>> {
        let raw = raw_folder(self.plan);
        let find = |step: &Step| match self.earlier {
            Earlier::Reuse => Record::find(&raw, &step.run, &step.key)
                .filter(|_| step.keeps.iter().all(|p| p.exists())),
            Earlier::Discard => None,
        };
        let known: Vec<Option<Vec<Record>>> = std::iter::once(&warm_up)
            .chain(&rounds)
            .map(|steps| steps.iter().map(find).collect())
            .collect();
        let all_known = known.iter().all(Option::is_some);

        let (mut first, mut all): (Vec<Record>, Vec<Record>) = (Vec::new(), Vec::new());
        for (steps, known) in std::iter::once(&warm_up).chain(&rounds).zip(known) {
            let is_warm_up = steps[0].run.round == 0;
            let records = match known {
                Some(records) if all_known || !is_warm_up => records,
                _ => self.run_steps(steps, &raw)?,
            };
            if is_warm_up {
                first.clone_from(&records);
            }
            for record in &records {
                let reference = first.iter().find(|r| r.run.pass == record.run.pass);
                check_work(reference.unwrap_or(record), record)?;
            }
            all.extend(records);
        }
        Ok(all)
    }

    fn run_steps(&self, steps: &[Step], raw: &Path) -> anyhow::Result<Vec<Record>> {
        let mut records = Vec::new();
        for step in steps {
            let record = step.execute(self.plan)?;
            record.save(raw)?;
            self.say(&record);
            records.push(record);
        }
        Ok(records)
    }

    #[expect(clippy::print_stderr, reason = "an hour is long without a word")]
    fn say(&self, record: &Record) {
        let Run { scene, pass, round } = &record.run;
        let what = match pass {
            Pass::Build => "pass 1".into(),
            Pass::Render { size, mode } => format!("{size} {mode}"),
        };
        let round = match round {
            0 => "warm-up".into(),
            round => format!("run {round} of {}", self.plan.runs),
        };
        eprintln!("{scene} {what}, {round}: {:.2} s", record.outside.wall_seconds);
    }
}

/// A run that is planned.
struct Step {
    run: Run,
    key: String,
    call: Call,
    /// What the run writes, for its digest.
    output: PathBuf,
    stats: PathBuf,
    /// Files that must still be there for a record to stand for the run.
    keeps: Vec<PathBuf>,
}

impl Step {
    fn execute(&self, plan: &Plan) -> anyhow::Result<Record> {
        let yardstick = outside::yardstick();
        let outside = outside::measure(&self.call)?;
        let stats: Value = stats::read(&root().join(&self.stats))?;
        let mut record = Record {
            run: self.run.clone(),
            settings: plan.settings.clone(),
            key: self.key.clone(),
            command: self.call.to_string(),
            outside,
            yardstick,
            output: digest(&root().join(&self.output))?,
            stats,
            quality: None,
        };
        let total = |clock: &str| {
            let seconds = record.stats[clock]["total"].as_f64();
            seconds.with_context(|| format!("{} has no {clock}.total", self.stats.display()))
        };
        outside
            .confirm(total("seconds")?, total("cpu_seconds")?)
            .with_context(|| format!("this run can't be trusted:\n  {}\n", self.call))?;
        if let Pass::Build = self.run.pass {
            record.build_stats()?;
        } else {
            let stats = record.render_stats()?;
            for (clock, seconds) in [("wall", stats.seconds), ("CPU", stats.cpu_seconds)] {
                // The stages are timed in turns, so together they take no longer than the whole.
                ensure!(
                    seconds.rest() >= -0.01 * seconds.total - 0.01,
                    "the stages take longer than the whole in {clock} seconds, so this run can't be trusted:\n  {}",
                    self.call
                );
            }
            record.quality = quality(plan, &self.run)?;
        }
        Ok(record)
    }
}

/// How far the picture of a warm-up is from the original.
fn quality(plan: &Plan, run: &Run) -> anyhow::Result<Option<Quality>> {
    let Pass::Render { size, mode } = &run.pass else { return Ok(None) };
    if run.round > 0 || mode == "original" {
        return Ok(None);
    }
    let read = |mode: &str| film::read_rgb(&root().join(plan.picture(&run.scene, *size, mode)), "");
    let (difference, _) = film::compare(&read(mode)?, &read("original")?, EXPOSURE)?;
    Ok(Some(difference.flip.into()))
}

/// Digest of all that decides what a run does, the number of threads included.
fn key(parts: &[&str]) -> String {
    let mut builder = base::FingerprintBuilder::new();
    for part in parts {
        builder.bytes(part.as_bytes());
    }
    let threads = std::env::var_os("TETRALUX_THREADS").unwrap_or_default();
    builder.bytes(threads.as_encoded_bytes());
    builder.finish().to_string()
}

/// The same command must do the same work: its counters and the bytes it writes.
fn check_work(first: &Record, record: &Record) -> anyhow::Result<()> {
    let differences = differences(&first.work(), &record.work());
    ensure!(
        differences.is_empty(),
        "two runs did different work, so that their times can't be compared; run {} against run {} of\n  {}\n  {}",
        record.run.round,
        first.run.round,
        record.command,
        differences.join("\n  ")
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::bench::outside::Outside;
    use crate::bench::settings::Settings;

    fn record(round: u32, shadow_rays: u64) -> Record {
        Record {
            run: Run { scene: "box".into(), pass: Pass::Build, round },
            settings: Settings::usual(),
            key: String::new(),
            command: "photon-build box".into(),
            outside: Outside { wall_seconds: 1.0, cpu_seconds: None },
            yardstick: 0.1,
            output: "00".into(),
            stats: json!({ "rays": { "shadow": shadow_rays }, "seconds": { "total": round } }),
            quality: None,
        }
    }

    #[test]
    fn other_work_in_another_run_fails_loudly() {
        check_work(&record(0, 7), &record(1, 7)).unwrap();
        assert_eq!(
            check_work(&record(0, 7), &record(2, 8)).unwrap_err().to_string(),
            "two runs did different work, so that their times can't be compared; run 2 against run 0 of\n  \
             photon-build box\n  rays.shadow: 7 became 8"
        );
    }

    #[test]
    fn keys_tell_parts_apart() {
        assert_eq!(key(&["ab", "c"]), key(&["ab", "c"]));
        assert_ne!(key(&["ab", "c"]), key(&["a", "bc"]));
    }
}
