//! Chores of the project: `cargo xtask COMMAND`, one file per command.

mod bench;
mod demo;
mod farm;
mod programs;
mod props;
mod rabbit;
mod stats;
mod table;
mod torture;
mod validate;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Chores of the project.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Bench(Box<bench::Args>),
    Demo(demo::Args),
    Farm(farm::Args),
    Props(props::Args),
    Rabbit(rabbit::Args),
    Torture(torture::Args),
    Validate(validate::Args),
}

#[expect(clippy::print_stderr, reason = "a program says on standard error why it failed")]
fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Bench(args) => bench::run(&args),
        Command::Demo(args) => demo::run(&args),
        Command::Farm(args) => farm::run(&args),
        Command::Props(args) => props::run(&args),
        Command::Rabbit(args) => rabbit::run(&args),
        Command::Torture(args) => torture::run(&args),
        Command::Validate(args) => validate::run(&args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(err) => {
            eprintln!("xtask: {err:#}");
            ExitCode::FAILURE
        }
    }
}
