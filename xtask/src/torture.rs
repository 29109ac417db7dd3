//! `cargo xtask torture`: loads and faults, really made, and what came of them.

mod faults;
mod loads;
mod scale;
mod tasks;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Instant;

use anyhow::{Context, ensure};

use crate::bench::environment::Environment;
use crate::programs::{self, Programs, root};
use crate::table::Table;

/// Load the programs and make faults for them, and tell in a table what came of it
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// How often runs are killed
    #[arg(long, value_name = "N", default_value_t = 100)]
    kills: u32,
    /// Renders at once
    #[arg(long, value_name = "N", default_value_t = 64)]
    crowd: u32,
    /// Make only those trials whose names hold these words
    #[arg(long, value_name = "WORDS", default_value = "", hide_default_value = true)]
    only: String,
    /// Make the trials that take minutes and gigabytes, too
    #[arg(long)]
    long: bool,
    /// Keep the table in xtask/runs/NAME
    #[arg(long, value_name = "NAME")]
    record: Option<String>,
}

const FOLDER: &str = "target/torture";

/// Where the programs run, and what they are asked for.
pub(crate) struct Bench {
    programs: Programs,
    folder: PathBuf,
    pub(crate) kills: u32,
    pub(crate) crowd: u32,
}

/// A load or fault; answers what came of it, or fails.
type Trial = fn(&Bench) -> anyhow::Result<String>;

const TRIALS: [(&str, Trial); 17] = [
    ("runs killed at random moments, and resumed", faults::kills),
    ("Ctrl-C at random moments", faults::interrupts),
    ("photon maps shortened while a picture is rendered", faults::shortened),
    ("a disk that is full", faults::full_disk),
    ("two runs with one output", faults::two_writers),
    ("photon maps replaced while pictures are rendered", faults::replaced),
    ("an output that is read slowly, standard error closed", faults::slow_and_closed),
    ("tasks of a farm on nodes that are lost", tasks::lost_nodes),
    ("tasks of a farm that run twice at once", tasks::twice),
    ("tasks of a farm while clocks jump", tasks::clocks),
    ("tasks of a farm on a slow disk", tasks::slow_disk),
    ("merging and tiles within limits of memory", tasks::memory),
    ("what checkpoints cost", loads::checkpoints),
    ("many renders at once on one map, each within 2 GB of addresses", loads::crowd),
    ("10,000 lights and 1,000 materials", loads::lights),
    ("pictures of 1,000,000 x 1 and 1 x 1,000,000 pixels", loads::long_pictures),
    ("1 to 256 threads", loads::threads),
];

/// Those that [`Args::long`] adds.
const LONG: [(&str, Trial); 4] = [
    ("a map of 100M photons, within 4 GB of addresses", loads::hundred_million),
    ("pictures of 8192x8192 pixels", scale::large_pictures),
    ("a mesh of 50 million triangles", scale::large_mesh),
    ("the time of a photon among 100 million", scale::time_per_photon),
];

/// Builds the programs, makes every trial, and writes the table.
///
/// # Errors
/// When a trial fails; the table tells of all.
#[expect(clippy::print_stdout, reason = "the table is the command's result")]
#[expect(clippy::print_stderr, reason = "a user wants to see how it goes on")]
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let programs = programs::build()?;
    let folder = root().join(FOLDER);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {FOLDER}"))?;
    let bench = Bench { programs, folder, kills: args.kills, crowd: args.crowd };
    bench.sound("photon-build", "SCENE -o a.photons --photons 200K -q")?;

    let mut table = Table::new("Loads and faults", ["what was done", "what came of it", "seconds"]);
    let mut n_failed = 0;
    let long = LONG.into_iter().filter(|_| args.long);
    let wanted = TRIALS.into_iter().chain(long).filter(|(name, _)| name.contains(&args.only));
    let mut n_trials = 0;
    for (name, trial) in wanted {
        n_trials += 1;
        eprintln!("{name} ...");
        let start = Instant::now();
        let outcome = trial(&bench).unwrap_or_else(|error| {
            n_failed += 1;
            format!("**failed**: {error:#}")
        });
        eprintln!("    {outcome}");
        let seconds = format!("{:.0}", start.elapsed().as_secs_f64());
        table.push(name, [outcome, seconds]);
    }
    let environment = Environment::here(command(args))?;
    let page = format!("{}\n\n{}", environment.list().trim_end(), table.to_markdown());
    println!("{page}");
    fs::write(bench.folder.join("README.md"), &page).context("cannot write the table")?;
    if let Some(name) = &args.record {
        let run = root().join("xtask/runs").join(name);
        fs::create_dir_all(&run).context("cannot make the folder of the run")?;
        fs::write(run.join("torture.md"), &page).context("cannot write the table")?;
    }
    ensure!(n_failed == 0, "{n_failed} of {n_trials} trials failed");
    Ok(())
}

/// The command that makes this run.
fn command(args: &Args) -> String {
    let mut words = vec!["cargo xtask torture".to_owned()];
    words.push(format!("--kills {} --crowd {}", args.kills, args.crowd));
    words.extend((!args.only.is_empty()).then(|| format!("--only '{}'", args.only)));
    words.extend(args.long.then(|| "--long".into()));
    words.join(" ")
}

/// What every render of the trials asks for.
pub(crate) const RENDER: &str = "SCENE --photons a.photons --shadow-rays 16 --gather 50 -q";

impl Bench {
    /// A file in the folder of the trials.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    pub(crate) fn read(&self, name: &str) -> anyhow::Result<Vec<u8>> {
        fs::read(self.path(name)).with_context(|| format!("cannot read {name}"))
    }

    /// One of the two programs with arguments that are separated by blanks; `SCENE` is the Cornell box. `limit` goes
    /// before it in a shell.
    pub(crate) fn command(&self, limit: &str, program: &str, args: &str) -> Command {
        let path = match program {
            "photon-build" => &self.programs.photon_build,
            _ => &self.programs.render_cached,
        };
        let scene = root().join("scenes/cornell-box/scene.toml");
        let words = args.replace("SCENE", &scene.display().to_string());
        let mut command = Command::new("bash");
        command
            .arg("-c")
            .arg(format!("{limit} exec '{}' {words}", root().join(path).display()))
            .current_dir(&self.folder)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        command
    }

    /// A run in the background.
    pub(crate) fn start(&self, program: &str, args: &str) -> anyhow::Result<Child> {
        self.command("", program, args).spawn().with_context(|| format!("cannot run {program}"))
    }

    /// A run to its end.
    pub(crate) fn output(&self, program: &str, args: &str) -> anyhow::Result<Output> {
        self.command("", program, args).output().with_context(|| format!("cannot run {program}"))
    }

    /// A run that must end well.
    pub(crate) fn sound(&self, program: &str, args: &str) -> anyhow::Result<()> {
        let output = self.output(program, args)?;
        ensure!(output.status.success(), "{program} {args}: {}", words(&output));
        Ok(())
    }

    /// No file that was half written is left in the folder.
    pub(crate) fn nothing_partial(&self) -> anyhow::Result<()> {
        for entry in fs::read_dir(&self.folder).context("cannot read the folder")? {
            let name = entry.context("cannot read the folder")?.file_name();
            let name = name.to_string_lossy();
            ensure!(!name.ends_with(".partial"), "{name} was left behind");
        }
        Ok(())
    }
}

/// How a run has ended, in its own words.
pub(crate) fn words(output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr);
    format!("{}: {}", output.status, said.lines().last().unwrap_or("no words"))
}

/// Numbers that look random, the same in every run.
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    /// A number from 0 up to `end`.
    pub(crate) fn throw(&mut self, end: u64) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % end.max(1)
    }
}

/// Whether two files hold the same.
pub(crate) fn same(bench: &Bench, a: &str, b: &str) -> anyhow::Result<()> {
    ensure!(bench.read(a)? == bench.read(b)?, "{a} and {b} differ");
    Ok(())
}

/// Removes files that may be there.
pub(crate) fn remove(bench: &Bench, names: &[&str]) {
    for name in names {
        let path: &Path = &bench.path(name);
        let _ = fs::remove_file(path);
    }
}
