//! Options that all programs have.

use std::path::PathBuf;

use anyhow::anyhow;
use atomic_file::Existing;

/// How much a program says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verbosity {
    /// Warnings and errors.
    Quiet,
    /// What was done as well.
    Normal,
    /// Details as well.
    Verbose,
}

/// Options that all programs have.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Common {
    /// Threads to use; 0 takes one for each processor
    #[arg(short = 't', long, value_name = "N", default_value_t = 0, env = "TETRALUX_THREADS")]
    pub threads: usize,
    /// Write what was done, and how long it took, as one JSON object
    #[arg(long, value_name = "FILE.json")]
    pub stats: Option<PathBuf>,
    /// Replace outputs that exist
    #[arg(long)]
    pub force: bool,
    /// Say nothing but warnings and errors
    #[arg(short, long, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say more
    #[arg(short, long)]
    pub verbose: bool,
}

impl Common {
    /// What `--force` means for outputs that exist.
    pub fn existing(&self) -> Existing {
        if self.force { Existing::Replace } else { Existing::Refuse }
    }

    /// What `-q` and `-v` mean.
    pub fn verbosity(&self) -> Verbosity {
        match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (_, true) => Verbosity::Verbose,
            _ => Verbosity::Normal,
        }
    }

    /// The threads that `-t` asks for.
    ///
    /// # Errors
    /// When the system doesn't give that many.
    pub fn thread_pool(&self) -> anyhow::Result<rayon::ThreadPool> {
        rayon::ThreadPoolBuilder::new()
            .num_threads(self.threads)
            // Building a BVH over triangles in bad places recurses deeply.
            .stack_size(64 << 20)
            .build()
            .map_err(|cause| {
                anyhow!("cannot start {} threads; ask for fewer with -t: {cause}", self.threads)
            })
    }
}
