//! `cargo xtask bench micro`: rates of single stages, by criterion.

use std::process::Command;

use anyhow::{Context, ensure};

use crate::programs::root;

/// Measure rates of single stages: rays, photons, queries and pixels a second
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Measure only what has this in its name, such as "bvh" or "gather from 1 M"
    filter: Option<String>,
    /// Keep the results under this name, to compare with later
    #[arg(long, value_name = "NAME", conflicts_with = "against")]
    save: Option<String>,
    /// Compare with the results that were kept under this name
    #[arg(long, value_name = "NAME")]
    against: Option<String>,
}

/// Runs the benchmarks of the package of tests.
///
/// # Errors
/// When they can't be built or run.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.args(["bench", "--package", "pipeline-tests", "--bench", "micro", "--"]);
    command.args(&args.filter).current_dir(root());
    for (option, name) in [("--save-baseline", &args.save), ("--baseline", &args.against)] {
        if let Some(name) = name {
            command.args([option, name]);
        }
    }
    let status = command.status().context("cannot run cargo")?;
    ensure!(status.success(), "the benchmarks failed; the reason is above");
    Ok(())
}
