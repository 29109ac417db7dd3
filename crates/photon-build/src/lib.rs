//! The program of pass 1: shoots photons into a scene and saves photon maps.

mod args;
mod build;
mod info;
mod memory;
mod merge;
mod resume;
mod shard;
mod stats;

pub use args::{Args, Command, Merge};
pub use build::build;

/// Runs the program.
///
/// # Errors
/// Whatever went wrong, in words for the user.
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.command {
        Some(Command::Info { map }) => info::info(map),
        Some(Command::Merge(args)) => merge::merge(args),
        None => build(args),
    }
}
