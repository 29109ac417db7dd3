//! A run beside an earlier one: what got slower, and what got faster.

use std::fmt;

use crate::bench::runs::{ModeRuns, Row, Runs, SceneRuns, SizeRuns};
use crate::bench::spread::Spread;
use crate::bench::tables::percent;
use crate::table::Table;

/// A change below this isn't told, however steady the runs were.
const LEAST_CHANGE: f64 = 0.05;
/// Nor is one of fewer CPU seconds, in a stage of a program.
const LEAST_SECONDS: f64 = 0.005;

/// Tables of ratios, a scene each, and a sentence for each change that is more than noise.
pub(crate) fn against(now: &Runs, then: &Runs) -> (Vec<Table>, Vec<String>) {
    let (mut tables, mut changes) = (Vec::new(), Vec::new());
    for scene in &now.scenes {
        let Some(old) = then.scenes.iter().find(|s| s.name == scene.name) else { continue };
        tables.push(ratios(scene, old));
        for (i, (size, new, old_mode)) in common(scene, old).enumerate() {
            // What a yard is in seconds.
            let yard = Spread::of(new.yardsticks.iter().copied()).median;
            for row in Row::ALL {
                // Pass 1 is the same for all pictures.
                let name = match row {
                    Row::Total => continue,
                    Row::Pass1 if i > 0 => continue,
                    Row::Pass1 => format!("{} pass 1", scene.name),
                    _ => {
                        let row = row.name().to_lowercase();
                        format!("{} {} {}, {row}", scene.name, size.size, new.mode)
                    }
                };
                let change = change(scene.yards(new, row), old.yards(old_mode, row));
                let change = change.filter(|c| c.difference.abs() * yard > LEAST_SECONDS);
                changes.extend(change.map(|c| format!("{}: {name}, {c}", c.word())));
            }
            let name = format!("{} {} {}", scene.name, size.size, new.mode);
            for ((what, now), (_, then)) in work(new).into_iter().zip(work(old_mode)) {
                if now > then * (1.0 + LEAST_CHANGE) {
                    let ratio = now / then;
                    changes.push(format!("more work: {name}, {what}: {ratio:.2} times as many"));
                }
            }
            let worse = new
                .quality
                .zip(old_mode.quality)
                .filter(|(new, old)| new.mean > old.mean * (1.0 + LEAST_CHANGE));
            changes.extend(worse.map(|(new_quality, old_quality)| {
                format!(
                    "farther from the original: {} {} {}, mean FLIP {:.4} after {:.4}",
                    scene.name, size.size, new.mode, new_quality.mean, old_quality.mean
                )
            }));
        }
    }
    changes.sort();
    if tables.is_empty() {
        changes.push("the two runs have no scene in common".into());
    } else if changes.is_empty() {
        changes.push("nothing changed by more than noise".into());
    }
    (tables, changes)
}

/// What was run both times: size, new and old runs.
fn common<'a>(
    now: &'a SceneRuns,
    then: &'a SceneRuns,
) -> impl Iterator<Item = (&'a SizeRuns, &'a ModeRuns, &'a ModeRuns)> {
    now.sizes.iter().flat_map(|size| {
        let old = then.sizes.iter().find(|s| s.size == size.size);
        let modes = old.into_iter().flat_map(|old| &old.modes);
        let pairs =
            modes.filter_map(|old| Some((size.modes.iter().find(|m| m.mode == old.mode)?, old)));
        pairs.map(move |(new, old)| (size, new, old))
    })
}

/// A change that is more than noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Change {
    /// Now as a multiple of then.
    ratio: f64,
    /// Now less then.
    difference: f64,
    noise: f64,
}

/// The change from then to now, both in units of the yardstick, if they differ by more than they spread.
pub(crate) fn change(now: Spread, then: Spread) -> Option<Change> {
    let (ratio, difference) = (now.median / then.median, now.median - then.median);
    let noise = now.relative() + then.relative();
    let is_change = (ratio - 1.0).abs() > LEAST_CHANGE.max(noise);
    is_change.then_some(Change { ratio, difference, noise })
}

impl Change {
    pub(crate) fn word(self) -> &'static str {
        if self.ratio > 1.0 { "slower" } else { "faster" }
    }
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} times the CPU time (noise {})", self.ratio, percent(self.noise, 0))
    }
}

/// What doesn't depend on the machine.
fn work(mode: &ModeRuns) -> [(&'static str, f64); 5] {
    let counts = mode.counts();
    [
        ("specular rays", counts.rays.specular as f64),
        ("shadow rays", counts.rays.shadow as f64),
        ("gather rays", counts.rays.gather as f64),
        ("photons visited", counts.photons_visited as f64),
        ("bytes of memory at the peak", mode.peak_bytes() as f64),
    ]
}

/// New over old: time of each row for what the machine is worth, the time beside that of the original, and work.
fn ratios(now: &SceneRuns, then: &SceneRuns) -> Table {
    let columns: Vec<_> = common(now, then).collect();
    let caption = format!("{}: now as a multiple of then", now.name);
    let header = columns.iter().map(|(size, new, _)| format!("{} {}", size.size, new.mode));
    let mut table = Table::new(caption, std::iter::once(String::new()).chain(header));
    let times = |ratio: f64| if ratio.is_finite() { format!("{ratio:.2}") } else { String::new() };
    for row in Row::ALL {
        let cell = |(_, new, old): &(&SizeRuns, &ModeRuns, &ModeRuns)| {
            times(now.yards(new, row).median / then.yards(old, row).median)
        };
        table.push(format!("{}, CPU time", row.name()), columns.iter().map(cell));
    }
    let beside = |(size, new, old): &(&SizeRuns, &ModeRuns, &ModeRuns)| {
        let old_size = then.sizes.iter().find(|s| s.size == size.size);
        let share =
            |mode: &ModeRuns, size: &SizeRuns| mode.pass_2().median / size.modes[0].pass_2().median;
        old_size.map_or_else(String::new, |old_size| times(share(new, size) / share(old, old_size)))
    };
    table.push("Pass 2 beside the original's", columns.iter().map(beside));
    let mut row = |name: &str, f: &dyn Fn(&ModeRuns) -> f64| {
        table.push(name, columns.iter().map(|(_, new, old)| times(f(new) / f(old))));
    };
    row("Specular rays", &|m| m.counts().rays.specular as f64);
    row("Shadow rays", &|m| m.counts().rays.shadow as f64);
    row("Photons visited", &|m| m.counts().photons_visited as f64);
    row("Peak memory", &|m| m.peak_bytes() as f64);
    row("Mean FLIP", &|m| m.quality.map_or(f64::NAN, |q| q.mean));
    table.notes = vec![
        "Times are in units of a fixed piece of work that was timed before each run, then and now."
            .into(),
    ];
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::raw::Record;
    use crate::bench::runs::tests::records;

    fn modes() -> Vec<Record> {
        records("rabbit", &[256], &["original", "paper"], 3)
    }

    #[test]
    fn the_same_run_has_not_changed() {
        let runs = Runs::of(&modes()).unwrap();
        let (tables, changes) = against(&runs, &runs);
        assert_eq!(changes, ["nothing changed by more than noise"]);
        let cells = tables[0].rows.iter().flat_map(|row| &row[1..]);
        assert!(cells.clone().all(|c| c == "1.00" || c.is_empty()), "{tables:?}");
    }

    #[test]
    fn a_slower_machine_is_no_change_and_a_slower_row_is_one() {
        let then = Runs::of(&modes()).unwrap();
        let mut records = modes();
        for record in &mut records {
            record.yardstick *= 2.0;
            let seconds = record.stats["cpu_seconds"].as_object_mut().unwrap();
            seconds.values_mut().for_each(|s| *s = (s.as_f64().unwrap() * 2.0).into());
        }
        let (_, changes) = against(&Runs::of(&records).unwrap(), &then);
        assert_eq!(changes, ["nothing changed by more than noise"]);
        for record in &mut records {
            let seconds = &mut record.stats["cpu_seconds"];
            if let (Some(direct), Some(total)) =
                (seconds["direct"].as_f64(), seconds["total"].as_f64())
            {
                seconds["direct"] = (direct * 1.5).into();
                seconds["total"] = (total + direct * 0.5).into();
            }
        }
        let (_, changes) = against(&Runs::of(&records).unwrap(), &then);
        assert_eq!(changes.len(), 2, "{changes:?}");
        assert_eq!(
            changes[0],
            "slower: rabbit 256 original, direct, 1.50 times the CPU time (noise 2 %)"
        );
    }

    #[test]
    fn noise_is_no_change() {
        let spread = |median, least, most| Spread { median, least, most };
        let steady = |m: f64| spread(m, m, m);
        let word = |now, then| change(now, then).map(Change::word);
        assert_eq!(word(steady(1.04), steady(1.0)), None);
        assert_eq!(word(steady(1.06), steady(1.0)), Some("slower"));
        assert_eq!(word(steady(0.5), steady(1.0)), Some("faster"));
        assert_eq!(word(spread(1.3, 1.0, 2.0), spread(1.0, 0.9, 1.1)), None);
    }

    #[test]
    fn more_work_is_told_however_fast_it_is() {
        let then = Runs::of(&modes()).unwrap();
        let mut records = modes();
        for record in &mut records {
            if let Some(shadow) = record.stats["rays"]["shadow"].as_u64() {
                record.stats["rays"]["shadow"] = (shadow * 2).into();
            }
        }
        let (_, changes) = against(&Runs::of(&records).unwrap(), &then);
        let expected = ["original", "paper"]
            .map(|mode| format!("more work: rabbit 256 {mode}, shadow rays: 2.00 times as many"));
        assert_eq!(changes, expected);
    }
}
