//! `cargo xtask props`: makes what the scenes in XML name and nobody could write by hand, to the same bytes everywhere.

mod maps;
mod radiance;
mod water;

use std::fs;
use std::io::Write;

use anyhow::{Context, ensure};
use atomic_file::Existing;

use crate::programs::root;

/// Make the images around the scenes in XML and the water of the pool, or check those that are there
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Compare the files with what would be written, and write nothing
    #[arg(long)]
    check: bool,
}

/// A file below `scenes/`, and what makes it.
type Prop = (&'static str, fn() -> Vec<u8>);

const PROPS: [Prop; 3] = [
    ("interior/sky.hdr", || radiance::encode(256, 128, maps::sky)),
    ("perfume/studio.hdr", || radiance::encode(256, 128, maps::studio)),
    ("pool/water.ply", water::ply),
];

/// Makes every file, and writes or compares it.
///
/// # Errors
/// When a file can't be read or written, or isn't what it should be.
#[expect(clippy::print_stdout, reason = "what was written is the command's result")]
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    for (name, make) in PROPS {
        let (path, bytes) = (root().join("scenes").join(name), make());
        if args.check {
            let found = fs::read(&path).with_context(|| format!("cannot read scenes/{name}"))?;
            ensure!(
                found == bytes,
                "scenes/{name} is not what the generator makes; without --check it is written anew"
            );
            println!("scenes/{name} is what the generator makes");
        } else {
            atomic_file::write(&path, Existing::Replace, |out| out.write_all(&bytes))?;
            println!("wrote scenes/{name} ({} bytes)", bytes.len());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_are_what_the_generator_makes() {
        run(&Args { check: true }).unwrap_or_else(|e| panic!("{e:#}"));
    }
}
