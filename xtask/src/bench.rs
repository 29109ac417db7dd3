//! `cargo xtask bench`: the paper's tables and figures from our own runs, measured so that nothing can flatter.

mod environment;
mod measure;
mod outside;
mod paper;
mod plan;
mod raw;
mod runs;
mod tables;

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use anyhow::Context;

use crate::bench::environment::Environment;
use crate::bench::measure::{Earlier, measure};
use crate::bench::plan::Plan;
use crate::bench::runs::Runs;
use crate::programs::{self, root};

/// Measure the paper's tables and figures
///
/// Runs are kept as they end: a bench that was interrupted goes on where it was when it is started again.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
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
}

/// Measures, and writes tables and report.
///
/// # Errors
/// When a program can't be built or fails, or when runs contradict each other.
#[expect(clippy::print_stdout, reason = "the tables are the command's result")]
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let plan = Plan::new(args, programs::build()?)?;
    let environment = Environment::here(command_line())?;
    let earlier = if args.fresh { Earlier::Discard } else { Earlier::Reuse };
    let records = measure(&plan, earlier)?;
    let runs = Runs::of(&records)?;

    let mut text = String::new();
    for (name, value) in environment.lines() {
        writeln!(text, "{name:>10}: {value}")?;
    }
    for scene in &runs.scenes {
        for table in tables::tables(&runs, scene) {
            write!(text, "\n{table}")?;
        }
    }
    print!("{text}");
    let path = root().join(&plan.out).join("tables.txt");
    fs::write(&path, text).with_context(|| format!("writing {}", path.display()))?;
    Ok(())
}

/// The command that was typed.
fn command_line() -> String {
    let words = ["cargo".into(), "xtask".into()].into_iter().chain(std::env::args_os().skip(1));
    cli::command_line(words)
}
