//! `cargo xtask bench`: the paper's tables and figures from our own runs, measured so that nothing can flatter.

mod against;
mod environment;
mod figures;
mod gallery;
mod measure;
mod micro;
mod outside;
mod paper;
mod plan;
mod raw;
mod readme;
mod reasons;
mod record;
mod report;
mod runs;
mod spread;
mod tables;

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;

use film::Existing;

use crate::bench::environment::Environment;
use crate::bench::gallery::{Detail, Gallery, exr_in, gallery};
use crate::bench::measure::{Earlier, measure};
use crate::bench::plan::Plan;
use crate::bench::runs::{Runs, SceneRuns};
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
    /// Scene to render: a folder of scenes/, or a path; may be given several times [default: cornell-box, rabbit]
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
    /// Folder for raw results, pictures and report [default: target/bench]
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Photons to emit from each light, such as 1M
    #[arg(long, value_name = "COUNT", default_value = "1M", value_parser = programs::parse_count_text)]
    photons: String,
    /// Shadow rays for each pixel and light
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=65536))]
    shadow_rays: u32,
    /// Run everything anew, whatever was run before
    #[arg(long)]
    fresh: bool,
    /// Keep the run under this name in xtask/runs, and show it in the README
    #[arg(long, value_name = "NAME", value_parser = record::parse_name)]
    record: Option<String>,
    /// Compare with the recorded run of this name
    #[arg(long, value_name = "NAME", value_parser = record::parse_name)]
    against: Option<String>,
}

#[derive(clap::Subcommand, Debug)]
enum Command {
    Micro(micro::Args),
}

/// Measures, and writes tables and report.
///
/// # Errors
/// When a program can't be built or fails, or when runs contradict each other.
#[expect(clippy::print_stdout, reason = "the tables are the command's result")]
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    if let Some(Command::Micro(args)) = &args.command {
        return micro::run(args);
    }
    // Before an hour of work.
    args.record.as_deref().map_or(Ok(()), record::check_free)?;
    let then = args.against.as_deref().map(record::load).transpose()?;

    let plan = Plan::new(args, programs::build()?)?;
    let environment = Environment::here(command_line())?;
    let earlier = if args.fresh { Earlier::Discard } else { Earlier::Reuse };
    let records = measure(&plan, earlier)?;
    let runs = Runs::of(&records)?;

    let text = text(&environment, &runs)?;
    print!("{text}");
    let page = |detail| -> anyhow::Result<String> {
        Ok(report::page(&environment, &runs, &galleries(&plan, &runs, detail)?))
    };
    let markdown = markdown(&runs);
    for (name, contents) in
        [("tables.txt", &text), ("tables.md", &markdown), ("report.html", &page(DETAIL)?)]
    {
        let path = root().join(&plan.out).join(name);
        atomic_file::write(&path, Existing::Replace, |out| out.write_all(contents.as_bytes()))?;
        println!("{}", plan.out.join(name).display());
    }
    if let Some(then) = &then {
        let (tables, changes) = against::against(&runs, &then.runs);
        println!("\nThen: commit {} on {}", then.environment.commit, then.environment.processor);
        tables.iter().for_each(|table| println!("\n{table}"));
        changes.iter().for_each(|change| println!("{change}"));
    }
    if let Some(name) = &args.record {
        record::keep(name, &environment, &records, &markdown, &page(record::DETAIL)?)?;
        readme::update(name)?;
        println!("{} and README.md", record::folder(name).display());
    }
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
    tables.map(section).collect()
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
