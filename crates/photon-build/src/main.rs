//! `photon-build`: see the library of the same name.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    cli::finish("photon-build", photon_build::run(&photon_build::Args::parse()))
}
