//! Options that all programs have.

use std::path::PathBuf;
use std::thread;

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

/// How a scene is read.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct SceneOptions {
    /// Give $NAME of a scene of Mitsuba a value
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = parse_definition)]
    pub define: Vec<(String, String)>,
    /// Replace what a scene of Mitsuba or glTF has and Tetralux doesn't, and say so, instead of refusing it
    #[arg(long)]
    pub lenient: bool,
    /// Refuse a scene that names files outside its folder: for scenes from strangers
    #[arg(long)]
    pub no_external: bool,
}

impl SceneOptions {
    /// The words of a command line that give the options which say what the scene is.
    pub fn words(&self) -> Vec<String> {
        let definitions = self.define.iter().map(|(name, value)| format!("-D{name}={value}"));
        definitions.chain(self.lenient.then(|| "--lenient".into())).collect()
    }
}

fn parse_definition(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() => Ok((name.into(), value.into())),
        _ => Err("it must be NAME=VALUE".into()),
    }
}

/// Options that all programs have.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Common {
    /// Threads to use; 0 takes one for each processor, or as many as are of use
    #[arg(short = 't', long, value_name = "N", default_value_t = 0, env = "TETRALUX_THREADS")]
    pub threads: usize,
    /// Write what was done, and how long it took, as one JSON object
    #[arg(long, value_name = "FILE.json")]
    pub stats: Option<PathBuf>,
    /// Replace outputs that exist
    #[arg(long)]
    pub force: bool,
    /// Take warnings for errors
    #[arg(long)]
    pub strict: bool,
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
        self.thread_pool_for(usize::MAX)
    }

    /// The threads that `-t` asks for; if it asks for none, one for each core, but no more than are of use.
    ///
    /// # Errors
    /// When the system doesn't give that many.
    pub fn thread_pool_for(&self, useful: usize) -> anyhow::Result<rayon::ThreadPool> {
        let has_more = || thread::available_parallelism().is_ok_and(|cores| cores.get() > useful);
        let threads = if self.threads == 0 && has_more() { useful } else { self.threads };
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            // Building a BVH over triangles in bad places recurses deeply.
            .stack_size(64 << 20)
            .build()
            .map_err(|cause| {
                anyhow!("cannot start {threads} threads; ask for fewer with -t: {cause}")
            })
    }
}
