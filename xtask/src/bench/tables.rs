//! Tables I and II from our own runs, beside the paper's, and what the paper doesn't tell.

use base::{Component, ImageSize};

use crate::bench::bars;
use crate::bench::paper::{Printed, PrintedSize, PrintedTimes, printed};
use crate::bench::runs::{Clock, ModeRuns, Row, Runs, Saved, SceneRuns, SizeRuns};
use crate::table::Table;

/// All tables of a scene, in the order of reading.
pub(crate) fn tables(runs: &Runs, scene: &SceneRuns) -> Vec<Table> {
    let printed = printed(&scene.name);
    let mut tables = vec![times(runs, scene, Clock::Cpu)];
    tables.extend(bars::table(runs, scene));
    tables.extend(printed.map(as_printed));
    tables.extend(printed.map(|printed| shares(scene, printed)));
    tables.push(times(runs, scene, Clock::Wall));
    tables.push(ranges(runs, scene));
    tables.push(origins(scene));
    tables.push(work(scene));
    tables
}

/// The table of the paper that a scene belongs to, and the scene.
pub(crate) fn title(scene: &str) -> String {
    printed(scene).map_or_else(|| scene.into(), |table| format!("{}, {scene}", table.name))
}

/// A table with a column for each size and mode.
fn by_size_and_mode(caption: String, scene: &SceneRuns) -> Table {
    let modes = scene.sizes.iter().flat_map(|size| size.modes.iter().map(|m| m.mode.clone()));
    let mut table = Table::new(caption, std::iter::once(String::new()).chain(modes));
    table.groups = scene.sizes.iter().map(|s| (square(s.size), s.modes.len())).collect();
    table
}

pub(crate) fn square(size: u32) -> String {
    format!("{size}\u{d7}{size}")
}

/// A cell for each size and mode.
fn cells(scene: &SceneRuns, f: impl Fn(&SizeRuns, &ModeRuns) -> String) -> Vec<String> {
    let f = &f;
    scene.sizes.iter().flat_map(|size| size.modes.iter().map(move |mode| f(size, mode))).collect()
}

/// Seconds with three digits that count, but no more than four after the point.
pub(crate) fn seconds(s: f64) -> String {
    match s.abs() {
        s if s < 0.000_05 => "0".into(),
        s if s < 1.0 => format!("{s:.3}"),
        s if s < 100.0 => format!("{s:.2}"),
        s => format!("{s:.1}"),
    }
}

/// A share, as a percentage.
pub(crate) fn percent(share: f64, digits: usize) -> String {
    format!("{:.digits$} %", share * 100.0)
}

/// The paper's table from our runs.
fn times(runs: &Runs, scene: &SceneRuns, clock: Clock) -> Table {
    let unit = match clock {
        Clock::Cpu => "CPU seconds",
        Clock::Wall => "seconds on the wall",
    };
    let caption = format!("{}: {unit}, medians of {} runs", title(&scene.name), runs.n_runs());
    let mut table = by_size_and_mode(caption, scene);
    for row in Row::ALL {
        table.push(
            row.name(),
            cells(scene, |_, mode| seconds(scene.seconds(mode, row, clock).median)),
        );
    }
    table.push(
        "Spread of the total",
        cells(scene, |_, mode| {
            format!("\u{b1}{}", percent(scene.seconds(mode, Row::Total, clock).relative(), 1))
        }),
    );
    for saved in Saved::ALL {
        let cell = |size: &SizeRuns, mode: &ModeRuns| {
            if mode.mode == "original" {
                return String::new();
            }
            percent(scene.saved(size, mode, saved, clock).median, 1)
        };
        table.push(saved.name(), cells(scene, cell));
    }
    if clock == Clock::Cpu {
        let stored = scene.pass_1[0].stored;
        table.notes = vec![
            format!(
                "Pass 1: {} photons emitted, {} caustic and {} indirect ones stored; one map for all pictures.",
                scene.pass_1[0].emitted, stored.caustic, stored.indirect
            ),
            "Saved is 1 - cached/original, the median over pairs of runs. Pass 1 counted: both programs from start to end. \
             Pass 2 alone: eye rays, components and cache. With a map that was there: render-cached from start to end. \
             Spread is half of the range over the runs."
                .into(),
        ];
    }
    table
}

/// Smallest and largest CPU seconds.
fn ranges(runs: &Runs, scene: &SceneRuns) -> Table {
    let caption =
        format!("{}: CPU seconds, least\u{2013}most of {} runs", title(&scene.name), runs.n_runs());
    let mut table = by_size_and_mode(caption, scene);
    for row in Row::ALL {
        table.push(
            row.name(),
            cells(scene, |_, mode| format!("{:.3}", scene.seconds(mode, row, Clock::Cpu))),
        );
    }
    table
}

/// The paper's table as printed, and what follows from it.
fn as_printed(printed: &'static Printed) -> Table {
    let header = printed.columns.iter().flat_map(|_| ["original", "cached"]);
    let caption = format!("{} as printed: seconds of the authors' machine", printed.name);
    let mut table = Table::new(caption, std::iter::once("").chain(header));
    table.groups = printed.columns.iter().map(|c| (square(c.size), 2)).collect();
    let mut row = |name: &str, f: fn(&PrintedTimes) -> f64| {
        let cells = printed.columns.iter().flat_map(|c| [f(&c.original), f(&c.cached)]);
        table.push(name, cells.map(|s| format!("{s:.2}")));
    };
    row("Caustics", |t| t.caustics);
    row("Specular", |t| t.specular);
    row("Indirect", |t| t.indirect);
    row("Direct", |t| t.direct);
    row("Pass 1", |t| t.pass_1);
    row("Total time, as printed", |t| t.total);
    row("Sum of the rows", PrintedTimes::sum);
    let mut saved = |name: &str, f: &dyn Fn(&PrintedSize) -> f64| {
        table.push(name, printed.columns.iter().flat_map(|c| [String::new(), percent(f(c), 2)]));
    };
    let ratio = |cached: f64, original: f64| 1.0 - cached / original;
    saved("Saved, as printed", &|c| c.saved / 100.0);
    saved("Saved, pass 1 counted", &|c| ratio(c.cached.total, c.original.total));
    saved("Saved of pass 2 alone", &|c| ratio(c.cached.pass_2(), c.original.pass_2()));
    table.notes = notes(printed);
    table
}

/// Where the printed table contradicts itself.
fn notes(printed: &Printed) -> Vec<String> {
    let mut notes = Vec::new();
    let off = |c: &&PrintedSize| {
        (1.0 - c.cached.total / c.original.total - c.saved / 100.0).abs() > 0.001
    };
    if printed.columns.iter().any(|c| off(&c)) {
        notes.push(format!(
            "The printed row of savings of {} doesn't follow from its times: the rows below it are computed anew, as 1 - cached/original.",
            printed.name
        ));
    } else {
        notes.push(format!(
            "The printed row of savings of {} is 1 - cached/original of its totals.",
            printed.name
        ));
    }
    let sums =
        printed.columns.iter().flat_map(|c| [(c, "original", c.original), (c, "cached", c.cached)]);
    let wrong: Vec<String> = sums
        .filter(|(_, _, times)| (times.sum() - times.total).abs() > 0.05)
        .map(|(c, which, times)| {
            format!("{} {which} by {:+.2} s", square(c.size), times.total - times.sum())
        })
        .collect();
    if !wrong.is_empty() {
        notes.push(format!("Totals that aren't the sum of their rows: {}.", wrong.join(", ")));
    }
    notes
}

/// Shares of the time, ours beside the paper's.
fn shares(scene: &SceneRuns, printed: &Printed) -> Table {
    let mut header = vec![String::new()];
    let mut groups = Vec::new();
    let sizes: Vec<(&SizeRuns, Option<&PrintedSize>)> = scene
        .sizes
        .iter()
        .map(|size| (size, printed.columns.iter().find(|c| c.size == size.size)))
        .collect();
    for (size, printed) in &sizes {
        let before = header.len();
        for (i, mode) in size.modes.iter().enumerate() {
            header.push(mode.mode.clone());
            match (i, printed) {
                (0, Some(_)) => header.push("printed".into()),
                (1, Some(_)) => header.push("printed, cached".into()),
                _ => {}
            }
        }
        groups.push((square(size.size), header.len() - before));
    }
    let caption = format!(
        "{}: shares of the CPU time, pass 1 counted, ours beside the printed ones",
        title(&scene.name)
    );
    let mut table = Table::new(caption, header);
    table.groups = groups;
    for row in Row::ALL {
        let mut cells = Vec::new();
        for (size, printed) in &sizes {
            for (i, mode) in size.modes.iter().enumerate() {
                let of = |row| scene.seconds(mode, row, Clock::Cpu).median;
                cells.push(percent(of(row) / of(Row::Total), 1));
                let times = match (i, printed) {
                    (0, Some(printed)) => &printed.original,
                    (1, Some(printed)) => &printed.cached,
                    _ => continue,
                };
                cells.push(
                    printed_seconds(times, row)
                        .map_or_else(String::new, |s| percent(s / times.sum(), 1)),
                );
            }
        }
        table.push(row.name(), cells);
    }
    table.notes = vec!["Printed shares are of the sum of the printed rows.".into()];
    table
}

/// The printed row, if there is one.
fn printed_seconds(times: &PrintedTimes, row: Row) -> Option<f64> {
    match row {
        Row::Caustics => Some(times.caustics),
        Row::Specular => Some(times.specular),
        Row::Indirect => Some(times.indirect),
        Row::Direct => Some(times.direct),
        Row::Pass1 => Some(times.pass_1),
        Row::Total => Some(times.sum()),
        Row::Cache | Row::EyeRays | Row::Rest => None,
    }
}

/// Traced pixels, and how far the pictures are from the original.
fn origins(scene: &SceneRuns) -> Table {
    let caption = format!("{}: pixels traced, and FLIP against the original", title(&scene.name));
    let mut table = by_size_and_mode(caption, scene);
    for component in
        [Component::Caustic, Component::Specular, Component::Indirect, Component::Direct]
    {
        let share = |_: &SizeRuns, mode: &ModeRuns| {
            let counts = mode.counts();
            let [width, height] = counts.resolution;
            let n = ImageSize { width, height }.n_pixels() as f64;
            percent(counts.traced[component] as f64 / n, 1)
        };
        table.push(format!("Traced, {component}"), cells(scene, share));
    }
    let mut row = |name: &str, f: &dyn Fn(&ModeRuns) -> Option<String>| {
        table.push(name, cells(scene, |_, mode| f(mode).unwrap_or_default()));
    };
    row("FLIP, mean", &|m| Some(format!("{:.4}", m.quality?.mean)));
    row("FLIP, 99th percentile", &|m| Some(format!("{:.4}", m.quality?.p99)));
    row("FLIP, worst 8\u{d7}8 block", &|m| Some(format!("{:.4}", m.quality?.worst_block_8x8)));
    row("FLIP above 0.1", &|m| Some(percent(m.quality?.share_above_0_1, 3)));
    let has_error = scene.sizes.iter().flat_map(|s| &s.modes).any(|m| m.counts().error.is_some());
    if has_error {
        row("Error aimed at", &|m| Some(format!("{:.4}", m.counts().error?.target)));
        row("Error that the mode measured", &|m| {
            Some(format!("{:.4}", m.counts().error?.measured_mean))
        });
    }
    table
}

/// Rays, photons and memory.
fn work(scene: &SceneRuns) -> Table {
    let caption = format!("{}: work, the same in every run, and memory", title(&scene.name));
    let mut table = by_size_and_mode(caption, scene);
    let mut row = |name: &str, f: &dyn Fn(&ModeRuns) -> u64| {
        table.push(name, cells(scene, |_, mode| millions(f(mode))));
    };
    row("Eye rays", &|m| m.counts().rays.eye);
    row("Specular rays", &|m| m.counts().rays.specular);
    row("Shadow rays", &|m| m.counts().rays.shadow);
    row("Gather rays", &|m| m.counts().rays.gather);
    row("Photons visited", &|m| m.counts().photons_visited);
    table.push(
        "Peak memory, MB",
        cells(scene, |_, mode| format!("{:.0}", mode.peak_bytes() as f64 / 1e6)),
    );
    table.notes = vec![
        "Counts in millions. Memory counts the mapped file of photons as far as it was read."
            .into(),
    ];
    table
}

fn millions(n: u64) -> String {
    if n == 0 { "0".into() } else { format!("{:.3}", n as f64 / 1e6) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::runs::tests::records;

    fn runs() -> Runs {
        Runs::of(&records("cornell-box", &[128, 256], &["original", "paper", "adaptive"], 3))
            .unwrap()
    }

    fn row<'a>(table: &'a Table, name: &str) -> &'a [String] {
        &table.rows.iter().find(|row| row[0] == name).unwrap()[1..]
    }

    #[test]
    fn the_paper_s_rows_in_the_paper_s_order() {
        let runs = runs();
        let tables = tables(&runs, &runs.scenes[0]);
        let names: Vec<_> = tables[0].rows.iter().map(|row| row[0].as_str()).collect();
        assert_eq!(names[..4], ["Caustics", "Specular", "Indirect", "Direct"]);
        assert_eq!(names[7..9], ["Pass 1", "Total time"]);
        assert_eq!(tables[0].groups, [("128×128".into(), 3), ("256×256".into(), 3)]);
        // Run 2 of 3: 128^2 / 10^5 x 1.02 for a share of caustics.
        assert_eq!(row(&tables[0], "Caustics")[..3], ["0.167", "0.084", "0.056"]);
        assert_eq!(row(&tables[0], "Saved of pass 2 alone")[..3], ["", "45.5 %", "63.6 %"]);
        assert_eq!(row(&tables[0], "Pass 1")[0], "1.20");
    }

    #[test]
    fn printed_tables_stand_beside_ours_with_their_faults() {
        let table = as_printed(printed("cornell-box").unwrap());
        assert_eq!(row(&table, "Direct")[6..], ["1364.48", "545.32"]);
        assert_eq!(row(&table, "Saved, as printed")[1], "27.26 %");
        assert_eq!(row(&table, "Saved, pass 1 counted")[1], "67.05 %");
        assert!(table.notes[0].contains("doesn't follow"), "{:?}", table.notes);
        assert!(table.notes[1].contains("128×128 original by -1.84 s"), "{:?}", table.notes);
        let table = as_printed(printed("rabbit").unwrap());
        assert!(!table.notes[0].contains("doesn't follow"), "{:?}", table.notes);
        assert!(table.notes[1].contains("1024×1024 original by +10.00 s"), "{:?}", table.notes);
    }

    #[test]
    fn shares_add_up() {
        let runs = runs();
        let table = shares(&runs.scenes[0], printed("cornell-box").unwrap());
        assert_eq!(
            table.header[1..6],
            ["original", "printed", "paper", "printed, cached", "adaptive"]
        );
        for column in 1..table.header.len() {
            let share =
                |row: &Vec<String>| row[column].trim_end_matches(" %").parse().unwrap_or(0.0);
            let sum: f64 = table.rows[..8].iter().map(share).sum();
            assert!((sum - 100.0).abs() < 0.5, "column {column}: {sum}");
        }
    }

    #[test]
    fn scenes_of_our_own_have_no_printed_table() {
        let runs = Runs::of(&records("glass-slab", &[64], &["original"], 1)).unwrap();
        let tables = tables(&runs, &runs.scenes[0]);
        assert_eq!(tables.len(), 5);
        assert!(tables.iter().all(|t| t.caption.starts_with("glass-slab")), "{tables:?}");
    }

    #[test]
    fn seconds_have_the_digits_that_count() {
        assert_eq!([0.0, 0.01234, 1.2345, 123.45].map(seconds), ["0", "0.012", "1.23", "123.5"]);
    }
}
