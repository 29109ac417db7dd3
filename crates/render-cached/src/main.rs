//! `render-cached`: see the library of the same name.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    cli::finish("render-cached", render_cached::run(&render_cached::Args::parse()))
}
