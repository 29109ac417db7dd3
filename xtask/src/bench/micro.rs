//! `cargo xtask bench micro`: rates of single stages, by criterion.

use std::fs;
use std::process::Command;

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};

use crate::bench::budgets::{self, Whole};
use crate::bench::environment::Environment;
use crate::bench::rates::{self, Rate};
use crate::bench::spread::Spread;
use crate::bench::{command_line, outside, peers, record};
use crate::programs::root;
use crate::table::Table;

/// The files of a recorded run.
const JSON: &str = "micro.json";
pub(crate) const PAGE: &str = "micro.md";

/// Measure rates of single stages: rays, photons, queries and pixels a second
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Measure only what has this in its name, such as "BVH" or "gather from 1 M"
    filter: Option<String>,
    /// Keep the rates under this name in xtask/runs
    #[arg(long, value_name = "NAME", value_parser = record::parse_name)]
    record: Option<String>,
    /// Replace the rates of that name
    #[arg(long, requires = "record")]
    force: bool,
    /// Compare with the recorded rates of this name
    #[arg(long, value_name = "NAME", value_parser = record::parse_name)]
    against: Option<String>,
}

/// All rates of a run, and where they were measured.
#[derive(Serialize, Deserialize)]
struct Micro {
    environment: Environment,
    /// CPU seconds of a piece of work that is the same everywhere, before and after.
    yardsticks: Spread,
    rates: Vec<Rate>,
    /// What budgets ask of the programs; not where a filter asks for less.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    whole: Option<Whole>,
}

/// Runs the benchmarks of the package of tests.
///
/// # Errors
/// When they can't be built or run, or when their results can't be read or kept.
#[expect(clippy::print_stdout, reason = "the rates are the command's result")]
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    if let Some(name) = args.record.as_deref().filter(|_| !args.force) {
        record::check_no_file(name, JSON)?;
    }
    let then = args.against.as_deref().map(load).transpose()?;

    let environment = Environment::here(command_line())?;
    let folder = root().join("target/bench/micro");
    if folder.exists() {
        // What an earlier filter let through isn't of this run.
        fs::remove_dir_all(&folder)
            .with_context(|| format!("cannot remove {}", folder.display()))?;
    }
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let peers = peers::compile()?;
    let mut yardsticks: Vec<f64> = (0..3).map(|_| outside::yardstick()).collect();
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let status = Command::new(cargo)
        .args(["bench", "--package", "pipeline-tests", "--bench", "micro", "--", "--quiet"])
        .args(&args.filter)
        .env("CRITERION_HOME", &folder)
        .env("TETRALUX_PEERS", &peers)
        .current_dir(root())
        .status()
        .context("cannot run cargo")?;
    ensure!(status.success(), "the benchmarks failed; the reason is above");
    let whole = if args.filter.is_none() { Some(budgets::whole()?) } else { None };
    yardsticks.extend((0..3).map(|_| outside::yardstick()));

    let (yardsticks, rates) = (Spread::of(yardsticks), rates::read(&folder)?);
    let micro = Micro { environment, yardsticks, rates, whole };
    micro.tables().iter().for_each(|table| println!("\n{table}"));
    if let Some(then) = &then {
        println!("Then: commit {} on {}", then.environment.commit, then.environment.processor);
        let changes =
            rates::changes((&micro.rates, &micro.yardsticks), (&then.rates, &then.yardsticks));
        changes.iter().for_each(|change| println!("{change}"));
    }
    if let Some(name) = &args.record {
        keep(name, &micro)?;
        println!("{}", record::folder(name).join(PAGE).display());
    }
    Ok(())
}

impl Micro {
    fn tables(&self) -> [Table; 2] {
        [rates::table(&self.rates), budgets::table(&self.rates, self.whole.as_ref())]
    }
}

fn keep(name: &str, micro: &Micro) -> anyhow::Result<()> {
    let section = |table: &Table| {
        let notes: String = table.notes.iter().map(|note| format!("\n{note}\n")).collect();
        format!("\n### {}\n\n{}{notes}", table.caption, table.to_markdown())
    };
    let sections: String = micro.tables().iter().map(section).collect();
    let page =
        format!("# Rates of single stages, {name}\n\n{}{sections}", micro.environment.list());
    let json = serde_json::to_string_pretty(micro)? + "\n";
    record::write(name, &[(JSON, &json), (PAGE, &page)])
}

fn load(name: &str) -> anyhow::Result<Micro> {
    let path = root().join(record::folder(name)).join(JSON);
    crate::stats::read(&path)
        .with_context(|| format!("there are no recorded rates {name}, or they can't be read"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_kept_rates_can_be_read() {
        for name in record::names(JSON) {
            assert!(!load(&name).unwrap().rates.is_empty(), "{name}");
        }
    }
}
