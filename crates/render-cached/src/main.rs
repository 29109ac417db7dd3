//! `render-cached`: see the library of the same name.

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::reuse_freed_memory();
    cli::run("render-cached", render_cached::run)
}
