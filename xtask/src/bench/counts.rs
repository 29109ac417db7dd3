//! `cargo xtask bench counts`: instructions of the hot loops, which noise of the machine doesn't change.

use std::process::Command;

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};

use crate::bench::environment::Environment;
use crate::bench::{command_line, record};
use crate::programs;
use crate::table::Table;

const JSON: &str = "counts.json";
const PAGE: &str = "counts.md";

/// A loop has changed if its count has changed by more than this part.
const SAME: f64 = 0.01;

/// Count the instructions of the hot loops, by callgrind
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Keep the counts under this name in xtask/runs
    #[arg(long, value_name = "NAME", value_parser = record::parse_name)]
    record: Option<String>,
    /// Replace the counts of that name
    #[arg(long, requires = "record")]
    force: bool,
    /// Compare with the recorded counts of this name
    #[arg(long, value_name = "NAME", value_parser = record::parse_name)]
    against: Option<String>,
}

/// All counts, and where they were taken.
#[derive(Serialize, Deserialize)]
struct Counts {
    environment: Environment,
    loops: Vec<Loop>,
}

/// A hot loop, and the instructions that it takes once.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Loop {
    name: String,
    instructions: u64,
}

/// Counts every loop: the difference between a run that does it twice and one that does it once.
///
/// # Errors
/// When the benchmarks can't be built, when valgrind isn't there, or when counts can't be read or kept.
#[expect(clippy::print_stdout, reason = "the counts are the command's result")]
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    if let Some(name) = args.record.as_deref().filter(|_| !args.force) {
        record::check_no_file(name, JSON)?;
    }
    let then = args.against.as_deref().map(load).transpose()?;
    let environment = Environment::here(command_line())?;
    let program = programs::build_bench("micro")?;
    let output = Command::new(&program).arg("count").current_dir(programs::root()).output();
    let output = output.with_context(|| format!("cannot run {}", program.display()))?;
    let names = String::from_utf8_lossy(&output.stdout).into_owned();
    let mut loops = Vec::new();
    for name in names.lines() {
        let count = |n: u32| {
            let output = Command::new("valgrind")
                .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
                .arg(&program)
                .args(["count", name, &n.to_string()])
                .current_dir(programs::root())
                .output()
                .context("cannot run valgrind; install Debian's package valgrind")?;
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            ensure!(output.status.success(), "counting {name} failed: {said}");
            collected(&said).with_context(|| format!("valgrind tells no count of {name}: {said}"))
        };
        let (once, twice) = (count(1)?, count(2)?);
        let instructions = twice.checked_sub(once).context("twice takes less than once")?;
        println!("{name}: {instructions}");
        loops.push(Loop { name: name.into(), instructions });
    }
    ensure!(!loops.is_empty(), "the benchmarks name no loops");
    let counts = Counts { environment, loops };
    if let Some(then) = &then {
        changes(&counts.loops, &then.loops).iter().for_each(|change| println!("{change}"));
    }
    if let Some(name) = &args.record {
        let table = table(&counts.loops);
        let list = counts.environment.list();
        let page = format!("# {}, {name}\n\n{list}\n{}", table.caption, table.to_markdown());
        let json = serde_json::to_string_pretty(&counts)? + "\n";
        record::write(name, &[(JSON, &json), (PAGE, &page)])?;
    }
    Ok(())
}

/// The instructions that callgrind has collected, as it says at its end.
fn collected(said: &str) -> Option<u64> {
    let line = said.lines().rev().find(|line| line.contains("Collected :"))?;
    line.split_whitespace().last()?.parse().ok()
}

fn table(loops: &[Loop]) -> Table {
    let mut table = Table::new("Instructions of the hot loops", ["", "instructions"]);
    for Loop { name, instructions } in loops {
        table.push(name.clone(), [instructions.to_string()]);
    }
    table
}

/// A sentence for each loop whose count has changed.
fn changes(now: &[Loop], then: &[Loop]) -> Vec<String> {
    let change = |now: &Loop| {
        let then = then.iter().find(|then| then.name == now.name)?;
        let times = now.instructions as f64 / then.instructions as f64;
        let word = if times > 1.0 { "more" } else { "less" };
        ((times - 1.0).abs() > SAME)
            .then(|| format!("{word}: {}, {times:.3} times the instructions", now.name))
    };
    let changes: Vec<String> = now.iter().filter_map(change).collect();
    if changes.is_empty() { vec!["no count changed by more than 1 %".into()] } else { changes }
}

fn load(name: &str) -> anyhow::Result<Counts> {
    let path = programs::root().join(record::folder(name)).join(JSON);
    crate::stats::read(&path)
        .with_context(|| format!("there are no recorded counts {name}, or they can't be read"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_read_from_what_callgrind_says() {
        let said = "==1== Callgrind\n==1== Events    : Ir\n==1== Collected : 123456\n==1==\n";
        assert_eq!(collected(said), Some(123_456));
        assert_eq!(collected("valgrind: no such tool"), None);
    }

    #[test]
    fn a_loop_that_takes_more_is_named() {
        let named = |name: &str, instructions| Loop { name: name.into(), instructions };
        let then = [named("a", 1000), named("b", 1000)];
        assert_eq!(changes(&then, &then), ["no count changed by more than 1 %"]);
        let now = [named("a", 1005), named("b", 1500), named("c", 1)];
        assert_eq!(changes(&now, &then), ["more: b, 1.500 times the instructions"]);
    }

    #[test]
    fn all_kept_counts_can_be_read() {
        for name in record::names(JSON) {
            assert!(load(&name).unwrap().loops.iter().all(|l| l.instructions > 0), "{name}");
        }
    }
}
