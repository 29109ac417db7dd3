//! The figures in the README, made from a recorded run.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;

use anyhow::Context;
use film::Existing;

use crate::bench::bars;
use crate::bench::micro;
use crate::bench::record::{self, Kept};
use crate::bench::runs::{Clock, ModeRuns, Saved, SceneRuns, SizeRuns};
use crate::bench::spread::Spread;
use crate::bench::tables::{percent, seconds, title};
use crate::programs::root;
use crate::table::Table;

const BEGIN: &str = "<!-- bench:begin -->";
const END: &str = "<!-- bench:end -->";

/// Show a recorded run in the README
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Name of the run in xtask/runs
    #[arg(value_parser = record::parse_name)]
    name: String,
}

/// Puts the figures of a recorded run between the marks in the README.
///
/// # Errors
/// When there is no such run, or when the README can't be read or written, or has no marks.
pub(crate) fn run(Args { name }: &Args) -> anyhow::Result<()> {
    let path = root().join("README.md");
    let text = fs::read_to_string(&path).context("reading README.md")?;
    let (before, rest) =
        text.split_once(BEGIN).with_context(|| format!("README.md has no {BEGIN}"))?;
    let (_, after) = rest.split_once(END).with_context(|| format!("README.md has no {END}"))?;
    let section = section(name, &record::load(name)?);
    let text = format!("{before}{BEGIN}\n{section}{END}{after}");
    atomic_file::write(&path, Existing::Replace, |out| out.write_all(text.as_bytes()))?;
    Ok(())
}

/// What stands between the marks.
fn section(name: &str, kept: &Kept) -> String {
    let Kept { environment, runs } = kept;
    let folder = record::folder(name);
    let rates = match root().join(&folder).join(micro::PAGE).is_file() {
        true => format!(", the [rates of single stages]({}/{})", folder.display(), micro::PAGE),
        false => String::new(),
    };
    let folder = folder.display();
    let mut text = format!(
        "`{}` measured this at commit {} on {}, {} threads, {}:\n{}.\n\n\
         CPU seconds of pass 1 and pass 2, medians of {} runs in alternation; saved of pass 2 alone, and with pass 1 \
         counted;\nFLIP is the mean against `original`. There are [all tables]({folder}/README.md) beside those of the \
         paper{rates}, and\na [report]({folder}/report.html) with figures and pictures, to be opened from disk.\n",
        environment.command,
        environment.commit,
        environment.processor,
        environment.processors,
        environment.system,
        runs.settings,
        runs.n_runs(),
    );
    for scene in &runs.scenes {
        let _ = write!(text, "\n{}\n", table(scene).to_markdown());
        if let Some(bars) = bars::table(runs, scene) {
            let _ = writeln!(text, "{}. {}", bars.caption, bars.notes[0]);
        }
    }
    text.truncate(text.trim_end().len());
    text + "\n"
}

/// A row for each size, and for each cached mode its time, what it saves and how far it is from the original.
fn table(scene: &SceneRuns) -> Table {
    let mut names: Vec<&str> = Vec::new();
    for mode in scene.sizes.iter().flat_map(|size| &size.modes[1..]) {
        if !names.contains(&mode.mode.as_str()) {
            names.push(&mode.mode);
        }
    }
    let mut header = vec![title(&scene.name), "pass 1".into(), "original".into()];
    header
        .extend(names.iter().flat_map(|mode| [format!("`{mode}`"), "saved".into(), "FLIP".into()]));
    let mut table = Table::new("", header);
    for size in &scene.sizes {
        let pass_1 = Spread::of(scene.pass_1.iter().map(|s| s.cpu_seconds.total));
        let mut cells = vec![seconds(pass_1.median), seconds(size.modes[0].pass_2().median)];
        for mode in &names {
            let found = size.modes.iter().find(|m| m.mode == *mode);
            cells.extend(found.map_or_else(Default::default, |m| mode_cells(scene, size, m)));
        }
        table.push(format!("{0}\u{d7}{0}", size.size), cells);
    }
    table
}

fn mode_cells(scene: &SceneRuns, size: &SizeRuns, mode: &ModeRuns) -> [String; 3] {
    let saved = |saved| percent(scene.saved(size, mode, saved, Clock::Cpu).median, 1);
    [
        seconds(mode.pass_2().median),
        format!("{}, {}", saved(Saved::Pass2), saved(Saved::WithPass1)),
        mode.quality.map_or_else(String::new, |q| format!("{:.4}", q.mean)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::report::tests::environment;
    use crate::bench::runs::Runs;
    use crate::bench::runs::tests::records;

    #[test]
    fn the_readme_shows_a_recorded_run_as_it_is() {
        let text = fs::read_to_string(root().join("README.md")).unwrap();
        let shown = text.split_once(BEGIN).and_then(|(_, rest)| rest.split_once(END));
        let (shown, _) = shown.expect("README.md has both marks");
        let names = record::names(record::RAW);
        if names.is_empty() {
            assert_eq!(shown.trim(), "", "README.md shows figures of no recorded run");
            return;
        }
        let name = names.iter().find(|name| shown.contains(&format!("xtask/runs/{name}/")));
        let name =
            name.expect("README.md shows one of the recorded runs: cargo xtask bench readme NAME");
        let expected = section(name, &record::load(name).unwrap());
        assert_eq!(shown.trim(), expected.trim(), "README.md differs from {name}");
    }

    #[test]
    fn a_row_tells_of_all_modes() {
        let records = records("rabbit", &[100], &["original", "paper", "adaptive"], 3);
        let kept = Kept { environment: environment(), runs: Runs::of(&records).unwrap() };
        let text = section("first", &kept);
        let row = text.lines().find(|line| line.starts_with("| 100")).unwrap();
        assert_eq!(
            row,
            "| 100×100 | 1.20 | 1.12 | 0.612 | 45.5 %, 21.9 % | 0.0118 | 0.408 | 63.6 %, 30.6 % | 0.0118 |"
        );
        assert!(text.contains("(xtask/runs/first/README.md)"), "{text}");
    }
}
