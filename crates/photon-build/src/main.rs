//! `photon-build`: see the library of the same name.

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::run("photon-build", photon_build::run)
}
