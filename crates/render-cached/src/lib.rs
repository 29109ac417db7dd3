//! The program of pass 2: traces eye rays, computes the four components, all of them or a few, and writes pictures.

mod adaptive;
mod args;
mod assemble;
mod diff;
mod finished;
mod frame;
mod health;
mod memory;
mod original;
mod output;
mod paper;
mod photons;
mod render;
mod resume;
mod stats;
mod tally;
mod tile;

pub use args::{Args, Assemble, Command, Indirect, Mode};
pub use render::render;

/// Runs the program.
///
/// # Errors
/// Whatever went wrong, in words for the user.
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.command {
        Some(Command::Diff(args)) => diff::diff(args),
        Some(Command::Assemble(args)) => assemble::assemble(args),
        None => render(args),
    }
}
