//! `cargo xtask bench`: the paper's tables and figures from our own runs, measured so that nothing can flatter.

mod against;
mod bars;
mod budgets;
mod counts;
pub(crate) mod environment;
mod figures;
mod gallery;
mod measure;
mod micro;
mod outside;
mod paper;
mod peers;
pub(crate) mod plan;
mod rates;
mod raw;
mod readme;
mod reasons;
mod record;
mod report;
mod runs;
mod settings;
mod spread;
mod tables;

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;

use anyhow::{Context, ensure};
use film::Existing;

use crate::bench::environment::Environment;
use crate::bench::gallery::{Detail, Gallery, exr_in, gallery};
use crate::bench::measure::{Earlier, measure};
use crate::bench::plan::Plan;
use crate::bench::raw::Record;
use crate::bench::record::Kept;
use crate::bench::runs::{Runs, SceneRuns};
use crate::bench::settings::Settings;
use crate::programs::{self, root};
use crate::table::Table;

/// Measure the paper's tables and figures
///
/// Runs are kept as they end: a bench that was interrupted goes on where it was when it is started again.
#[derive(clap::Args, Debug)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// Scene to render: a folder of scenes/, "all" of them, or a path; may be given several times [default: cornell-box, rabbit]
    #[arg(long, value_name = "SCENE")]
    scene: Vec<String>,
    /// Side of the square pictures, in pixels; may be given several times [default: 128, 256, 512, 1024]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(8..=16384))]
    size: Vec<u32>,
    /// Mode to compare with original; may be given several times [default: all]
    #[arg(long, value_name = "MODE")]
    mode: Vec<String>,
    /// A few minutes: sizes up to 512, three runs
    #[arg(long)]
    quick: bool,
    /// Measured runs of each, besides the one that warms up [default: 5]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: Option<u32>,
    /// Folder for raw results, pictures and report [default: target/bench, and for other settings target/bench-SETTINGS]
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    #[command(flatten)]
    settings: Settings,
    /// Run everything anew, whatever was run before
    #[arg(long)]
    fresh: bool,
    /// Keep the run under this name in xtask/runs
    #[arg(long, value_name = "NAME", value_parser = record::parse_name)]
    record: Option<String>,
    /// Replace the run of that name
    #[arg(long, requires = "record")]
    force: bool,
    /// Compare with the recorded run of this name
    #[arg(long, value_name = "NAME", value_parser = record::parse_name)]
    against: Option<String>,
}

#[derive(clap::Subcommand, Debug)]
enum Command {
    Counts(counts::Args),
    Micro(micro::Args),
    Readme(readme::Args),
}

/// Measures, and writes tables and report: of a bench that fails, for the sizes that are complete.
///
/// # Errors
/// When a program can't be built or fails, or when runs contradict each other.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    match &args.command {
        Some(Command::Counts(args)) => return counts::run(args),
        Some(Command::Micro(args)) => return micro::run(args),
        Some(Command::Readme(args)) => return readme::run(args),
        None => {}
    }
    // Before an hour of work.
    if let Some(name) = args.record.as_deref().filter(|_| !args.force) {
        record::check_free(name)?;
    }
    let then = args.against.as_deref().map(record::load).transpose()?;
    if let Some(then) = &then {
        ensure!(
            then.runs.settings == args.settings,
            "the recorded run is of other settings, so times can't be compared: {}; and now {}",
            then.runs.settings,
            args.settings
        );
    }

    let plan = Plan::new(args, programs::build()?)?;
    let environment = Environment::here(command_line())?;
    let earlier = if args.fresh { Earlier::Discard } else { Earlier::Reuse };
    let mut records = Vec::new();
    let outcome = measure(&plan, earlier, &mut records);
    if !records.is_empty() {
        let runs = Runs::of(&records)?;
        write(&plan, &environment, &runs)?;
        if let Some(then) = &then {
            compare(&runs, then);
        }
        if let (Some(name), Ok(())) = (&args.record, &outcome) {
            keep(name, &plan, &environment, &records, &runs)?;
        }
    }
    outcome
        .context("the bench isn't complete; started again without --fresh, it goes on where it was")
}

/// Shows the tables, and leaves them and the report in the folder of the plan.
#[expect(clippy::print_stdout, reason = "the tables are the command's result")]
fn write(plan: &Plan, environment: &Environment, runs: &Runs) -> anyhow::Result<()> {
    let text = text(environment, runs)?;
    print!("{text}");
    let page = report::page(environment, runs, &galleries(plan, runs, DETAIL)?);
    let files = [("tables.txt", &text), ("tables.md", &markdown(runs)), ("report.html", &page)];
    for (name, contents) in files {
        let path = root().join(&plan.out).join(name);
        atomic_file::write(&path, Existing::Replace, |out| out.write_all(contents.as_bytes()))?;
        println!("{}", plan.out.join(name).display());
    }
    Ok(())
}

#[expect(clippy::print_stdout, reason = "what changed is the command's result")]
fn compare(runs: &Runs, then: &Kept) {
    let (tables, changes) = against::against(runs, &then.runs);
    println!("\nThen: commit {} on {}", then.environment.commit, then.environment.processor);
    tables.iter().for_each(|table| println!("\n{table}"));
    changes.iter().for_each(|change| println!("{change}"));
}

#[expect(clippy::print_stdout, reason = "says where the run is kept")]
fn keep(
    name: &str,
    plan: &Plan,
    environment: &Environment,
    records: &[Record],
    runs: &Runs,
) -> anyhow::Result<()> {
    let page = report::page(environment, runs, &galleries(plan, runs, record::DETAIL)?);
    record::keep(name, environment, records, &markdown(runs), &page)?;
    println!(
        "{}; to show it in the README: cargo xtask bench readme {name}",
        record::folder(name).display()
    );
    Ok(())
}

/// What the report on this machine shows.
const DETAIL: Detail = Detail { picture: 512, pixels: 256 };

/// Machine and tables, for a terminal.
fn text(environment: &Environment, runs: &Runs) -> anyhow::Result<String> {
    let mut text = String::new();
    for (name, value) in environment.lines() {
        writeln!(text, "{name:>10}: {value}")?;
    }
    writeln!(text, "{:>10}: {}", "settings", runs.settings)?;
    for scene in &runs.scenes {
        for table in tables::tables(runs, scene) {
            write!(text, "\n{table}")?;
        }
    }
    text.push('\n');
    Ok(text)
}

/// All tables, for a document.
fn markdown(runs: &Runs) -> String {
    let tables = runs.scenes.iter().flat_map(|scene| tables::tables(runs, scene));
    let section = |table: Table| {
        let notes: String = table.notes.iter().map(|note| format!("{note}\n\n")).collect();
        format!("### {}\n\n{}\n{notes}", table.caption, table.to_markdown())
    };
    format!("Settings: {}.\n\n", runs.settings) + &tables.map(section).collect::<String>()
}

fn galleries(plan: &Plan, runs: &Runs, detail: Detail) -> anyhow::Result<Vec<Gallery>> {
    let of = |scene: &SceneRuns| gallery(scene, detail, &exr_in(&plan.out, &scene.name));
    runs.scenes.iter().map(of).collect()
}

/// The command that was typed.
fn command_line() -> String {
    let words = ["cargo".into(), "xtask".into()].into_iter().chain(std::env::args_os().skip(1));
    cli::command_line(words)
}
