//! What mode `adaptive` is held to, and whether it holds: savings, errors, and growth with the size of the picture.

use crate::bench::runs::{Clock, ModeRuns, Row, Runs, Saved, SceneRuns, SizeRuns};
use crate::bench::spread::Spread;
use crate::bench::tables::{percent, square, title};
use crate::table::Table;

/// The mode that is held to them.
const MODE: &str = "adaptive";
/// The size that they are meant for, and the two between which growth counts.
const SIZE: u32 = 1024;
const GROWTH_SIZES: [u32; 2] = [512, 2048];
/// Where pass 1 is a larger share of the original's total, no cache could save what is demanded of the total.
const MOST_PASS_1: f64 = 0.04;

/// A figure, and what is demanded of it.
pub(crate) struct Bar {
    pub(crate) name: String,
    pub(crate) demanded: Demanded,
    /// `None` where it wasn't measured.
    pub(crate) measured: Option<f64>,
    pub(crate) show: fn(f64) -> String,
    /// Why the bar doesn't count, if it doesn't.
    pub(crate) waived: Option<String>,
}

#[derive(Clone, Copy)]
pub(crate) enum Demanded {
    AtLeast(f64),
    AtMost(f64),
    Within(f64, f64),
}

/// The bars of a scene, or `None` when the mode wasn't run.
pub(crate) fn table(runs: &Runs, scene: &SceneRuns) -> Option<Table> {
    let has_mode = |size: &&SizeRuns| size.modes.iter().any(|m| m.mode == MODE);
    let fits = |size: &&SizeRuns| size.size <= SIZE;
    let at = scene.sizes.iter().filter(has_mode);
    let size = at.clone().rfind(fits).or_else(|| at.clone().next())?;
    let bars = bars(runs, scene, size, size.modes.iter().find(|m| m.mode == MODE)?);

    let caption = format!("{}: bars of mode {MODE} at {}", title(&scene.name), square(size.size));
    let mut table = Table::new(caption, ["", "demanded", "measured", "holds"]);
    for bar in &bars {
        let measured = bar.measured.map_or_else(String::new, bar.show);
        table.push(bar.name.clone(), [bar.demanded.text(bar.show), measured, bar.verdict()]);
    }
    table.notes.push(summary(&bars));
    for (bar, why) in bars.iter().filter_map(|bar| Some((bar, bar.waived.as_ref()?))) {
        table.notes.push(format!("\"{}\" doesn't count: {why}.", bar.name));
    }
    table.notes.push(format!("CPU seconds. Settings: {}.", runs.settings));
    if size.size != SIZE {
        table.notes.push(format!("The bars are meant for {}.", square(SIZE)));
    }
    Some(table)
}

/// How many hold, and which don't.
fn summary(bars: &[Bar]) -> String {
    let counts: Vec<&Bar> =
        bars.iter().filter(|b| b.measured.is_some() && b.waived.is_none()).collect();
    let fails: Vec<&str> = counts.iter().filter(|b| !b.holds()).map(|b| b.name.as_str()).collect();
    match fails.as_slice() {
        [] => format!("All {} bars that were measured hold.", counts.len()),
        _ => format!(
            "{} of {} bars hold; these don't: {}.",
            counts.len() - fails.len(),
            counts.len(),
            fails.join("; ")
        ),
    }
}

fn bars(runs: &Runs, scene: &SceneRuns, size: &SizeRuns, mode: &ModeRuns) -> Vec<Bar> {
    use Demanded::{AtLeast, AtMost, Within};

    let original = &size.modes[0];
    let cpu = |mode: &ModeRuns, row| scene.seconds(mode, row, Clock::Cpu).median;
    let saved = |saved| Some(scene.saved(size, mode, saved, Clock::Cpu).median);
    let share = |v: f64| percent(v, 1);
    let flip = |v: f64| format!("{v:.4}");
    let times = |v: f64| format!("{v:.2}");
    let bar = |name: &str, demanded, measured, show| Bar {
        name: name.into(),
        demanded,
        measured,
        show,
        waived: None,
    };

    // Four eye rays and more see the same cache.
    let pass_2 = if runs.settings.supersample > 1 { 0.97 } else { 0.92 };
    let pass_1 = cpu(original, Row::Pass1) / cpu(original, Row::Total);
    let waived = (pass_1 > MOST_PASS_1)
        .then(|| format!("pass 1 alone is {} of the original's", percent(pass_1, 1)));
    let total = bar("Saved, pass 1 counted", AtLeast(0.9), saved(Saved::WithPass1), share);

    let quality = mode.quality;
    let error = mode.counts().error;
    let cache = Spread::of(pairs(original, mode).map(|(o, m)| m.cache / o.pass_2()));
    vec![
        bar("Saved of pass 2", AtLeast(pass_2), saved(Saved::Pass2), share),
        Bar { waived, ..total },
        bar("FLIP, mean", AtMost(0.02), quality.map(|q| q.mean), flip),
        bar("FLIP, 99th percentile", AtMost(0.08), quality.map(|q| q.p99), flip),
        bar("FLIP, worst 8\u{d7}8 block", AtMost(0.15), quality.map(|q| q.worst_block_8x8), flip),
        bar("FLIP above 0.1", AtMost(0.003), quality.map(|q| q.share_above_0_1), |v| percent(v, 3)),
        bar("Cache's own time, of the original's pass 2", AtMost(0.03), Some(cache.median), share),
        bar("Growth of pass 2 from 512\u{b2} to 2048\u{b2}", AtMost(6.0), growth(scene), times),
        bar("Pass 2 beside the original's, at the worst size", AtMost(1.05), slowest(scene), times),
        bar(
            "Error measured by the mode, of the true one",
            Within(0.7, 1.3),
            error.zip(quality).map(|(e, q)| e.measured_mean / q.mean),
            times,
        ),
        bar(
            "True error, of the one aimed at",
            AtMost(2.0),
            error.zip(quality).map(|(e, q)| q.mean / e.target),
            times,
        ),
    ]
}

/// CPU seconds of the same round of two modes.
fn pairs<'a>(
    a: &'a ModeRuns,
    b: &'a ModeRuns,
) -> impl Iterator<Item = (&'a crate::stats::RenderSeconds, &'a crate::stats::RenderSeconds)> {
    a.rounds.iter().zip(&b.rounds).map(|(a, b)| (&a.cpu_seconds, &b.cpu_seconds))
}

fn growth(scene: &SceneRuns) -> Option<f64> {
    let [small, large] = GROWTH_SIZES.map(|size| scene.mode(size, MODE));
    Some(large?.pass_2().median / small?.pass_2().median)
}

/// Pass 2 as a multiple of the original's, where that is most.
fn slowest(scene: &SceneRuns) -> Option<f64> {
    let ratio = |size: &SizeRuns| {
        let mode = size.modes.iter().find(|m| m.mode == MODE)?;
        let ratios = pairs(&size.modes[0], mode).map(|(o, m)| m.pass_2() / o.pass_2());
        Some(Spread::of(ratios).median)
    };
    scene.sizes.iter().filter_map(ratio).max_by(f64::total_cmp)
}

impl Bar {
    pub(crate) fn holds(&self) -> bool {
        self.measured.is_some_and(|v| match self.demanded {
            Demanded::AtLeast(least) => least <= v,
            Demanded::AtMost(most) => v <= most,
            Demanded::Within(least, most) => least <= v && v <= most,
        })
    }

    pub(crate) fn verdict(&self) -> String {
        match (self.measured, &self.waived) {
            (None, _) => "not measured".into(),
            (_, Some(_)) => "doesn't count".into(),
            _ if self.holds() => "yes".into(),
            _ => "no".into(),
        }
    }
}

impl Demanded {
    pub(crate) fn text(self, show: fn(f64) -> String) -> String {
        match self {
            Self::AtLeast(v) => format!("at least {}", show(v)),
            Self::AtMost(v) => format!("at most {}", show(v)),
            Self::Within(least, most) => format!("{} to {}", show(least), show(most)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::raw::Record;
    use crate::bench::runs::tests::records;

    fn verdicts(records: &[Record]) -> (Vec<[String; 3]>, Vec<String>) {
        let runs = Runs::of(records).unwrap();
        let table = table(&runs, &runs.scenes[0]).unwrap();
        let row = |row: &Vec<String>| [row[0].clone(), row[2].clone(), row[3].clone()];
        (table.rows.iter().map(row).collect(), table.notes)
    }

    fn holds<'a>(rows: &'a [[String; 3]], name: &str) -> [&'a str; 2] {
        let [_, measured, holds] = rows.iter().find(|row| row[0].starts_with(name)).unwrap();
        [measured, holds]
    }

    #[test]
    fn figures_are_held_against_what_is_demanded() {
        let modes = ["original", "paper", "adaptive"];
        let mut all = records("rabbit", &[512, 1024, 2048], &modes, 3);
        let (rows, notes) = verdicts(&all);
        // Adaptive takes 1/3 of the original's time for all but the cache, which takes as long as its caustics.
        assert_eq!(holds(&rows, "Saved of pass 2"), ["63.6 %", "no"]);
        assert_eq!(holds(&rows, "Cache's own time"), ["3.0 %", "no"]);
        assert_eq!(holds(&rows, "FLIP, mean"), ["0.0118", "yes"]);
        assert_eq!(holds(&rows, "Growth of pass 2"), ["16.00", "no"]);
        assert_eq!(holds(&rows, "Pass 2 beside"), ["0.36", "yes"]);
        assert_eq!(holds(&rows, "Error measured"), ["", "not measured"]);
        assert!(
            notes[0].starts_with("5 of 9 bars hold; these don't: Saved of pass 2;"),
            "{notes:?}"
        );
        for record in &mut all {
            if record.stats["mode"] == "adaptive" {
                for seconds in ["seconds", "cpu_seconds"] {
                    let seconds = record.stats[seconds].as_object_mut().unwrap();
                    seconds.values_mut().for_each(|s| *s = (s.as_f64().unwrap() / 5.0).into());
                }
                record.stats["error"] = serde_json::json!({
                    "target": 0.01, "measured_mean": 0.0118, "measured_p995": 0.1, "held_out_pixels": 100,
                });
            }
        }
        let (rows, _) = verdicts(&all);
        assert_eq!(holds(&rows, "Saved of pass 2"), ["92.7 %", "yes"]);
        assert_eq!(holds(&rows, "Cache's own time"), ["0.6 %", "yes"]);
        assert_eq!(holds(&rows, "Error measured"), ["1.00", "yes"]);
        assert_eq!(holds(&rows, "True error"), ["1.18", "yes"]);
    }

    #[test]
    fn pass_1_can_rule_a_bar_out() {
        let modes = ["original", "adaptive"];
        let (rows, notes) = verdicts(&records("rabbit", &[256], &modes, 1));
        let [measured, holds] = holds(&rows, "Saved, pass 1 counted");
        assert!(measured.ends_with('%') && holds == "doesn't count", "{holds}");
        assert!(notes[1].contains("doesn't count: pass 1 alone is"), "{notes:?}");
        assert_eq!(notes.last().unwrap(), "The bars are meant for 1024\u{d7}1024.");
    }

    #[test]
    fn more_eye_rays_must_save_more() {
        let mut all = records("rabbit", &[1024], &["original", "adaptive"], 1);
        all.iter_mut().for_each(|record| record.settings.supersample = 2);
        let runs = Runs::of(&all).unwrap();
        let table = table(&runs, &runs.scenes[0]).unwrap();
        assert_eq!(table.rows[0][1], "at least 97.0 %");
    }

    #[test]
    fn other_modes_have_no_bars() {
        let runs = Runs::of(&records("rabbit", &[1024], &["original", "paper"], 1)).unwrap();
        assert_eq!(table(&runs, &runs.scenes[0]), None);
    }
}
