//! `cargo xtask farm`: the Cornell box as a job of a render farm, compared with one machine's run.

mod openjd;
mod slurm;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};

use crate::programs::{self, Call, Programs, root};

/// Run the Cornell box through a job of a farm on this machine, and compare every byte with a single run
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// What runs the job: openjd-cli is installed in target/openjd where it isn't found, Slurm must be there
    #[arg(long, value_enum, default_value_t = Engine::Openjd)]
    engine: Engine,
    /// Side of the square picture, in pixels
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = clap::value_parser!(u32).range(64..=16384))]
    size: u32,
    /// Photons to emit, such as 1M or 50K
    #[arg(long, value_name = "COUNT", default_value = "1M", value_parser = programs::parse_count_text)]
    photons: String,
    /// Tasks that the photons are shared among
    #[arg(long, value_name = "N", default_value_t = 8)]
    shards: u32,
    /// Tasks that the pixels are shared among
    #[arg(long, value_name = "N", default_value_t = 16)]
    tiles: u32,
    /// Which pixels are computed, as render-cached has it: a job for each mode
    #[arg(long, value_name = "MODE", default_values = ["original", "adaptive"])]
    mode: Vec<String>,
}

/// What runs jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Engine {
    /// openjd-cli, with the template of the Open Job Description
    Openjd,
    /// Slurm, with job arrays
    Slurm,
}

/// A job: what every engine is told.
#[derive(Debug)]
struct Job {
    programs: Programs,
    scene: PathBuf,
    /// Where its files go, as `picture.exr` and so on.
    folder: PathBuf,
    photons: String,
    shards: u32,
    resolution: String,
    tiles: u32,
    mode: String,
}

/// The name of its files.
const NAME: &str = "picture";

const SCENE: &str = "scenes/cornell-box/scene.toml";

/// Builds the programs, runs the job, and compares.
///
/// # Errors
/// When the engine isn't there, the job fails, or any byte differs.
#[expect(clippy::print_stdout, reason = "the comparison is the command's result")]
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let Programs { photon_build, render_cached } = programs::build()?;
    let programs = Programs {
        photon_build: root().join(photon_build),
        render_cached: root().join(render_cached),
    };
    let folder = root().join("target/farm");
    if folder.exists() {
        fs::remove_dir_all(&folder)
            .with_context(|| format!("cannot empty {}", folder.display()))?;
    }
    let openjd = match args.engine {
        Engine::Openjd => Some(openjd::find_or_install()?),
        Engine::Slurm => {
            ensure!(
                slurm::is_there(),
                "no Slurm answers here; xtask/farm/slurm/one-node.sh starts one"
            );
            None
        }
    };
    for mode in &args.mode {
        let job = Job {
            programs: programs.clone(),
            scene: root().join(SCENE),
            folder: folder.join(mode),
            photons: args.photons.clone(),
            shards: args.shards,
            resolution: format!("{0}x{0}", args.size),
            tiles: args.tiles,
            mode: mode.clone(),
        };
        fs::create_dir_all(&job.folder)
            .with_context(|| format!("cannot make {}", job.folder.display()))?;
        match &openjd {
            Some(openjd) => openjd::run(openjd, &job)?,
            None => slurm::run(&job, 2)?,
        }
        compare(&job)?;
        println!(
            "{mode}: {} shards and {} tiles have made the bytes of one run: {}",
            job.shards,
            job.tiles,
            programs::from_root(&job.file("exr")).display()
        );
    }
    Ok(())
}

impl Job {
    fn file(&self, ending: &str) -> PathBuf {
        self.folder.join(NAME).with_extension(ending)
    }
}

/// Does the same in one process each, and compares.
///
/// # Errors
/// When a program fails, or any byte differs.
fn compare(job: &Job) -> anyhow::Result<()> {
    let single = job.folder.join("single");
    fs::create_dir_all(&single).with_context(|| format!("cannot make {}", single.display()))?;
    let (maps, picture) = (single.join("picture.photons"), single.join("picture.exr"));
    Call::new(&job.programs.photon_build)
        .args([&job.scene])
        .args(["--photons", &job.photons, "--force", "-q", "-o"])
        .args([&maps])
        .run()?;
    ensure_same(&maps, &job.file("photons"))?;
    // The picture tells where its photons are: from the same bytes in the same place.
    Call::new(&job.programs.render_cached)
        .args([&job.scene, Path::new("--photons"), &job.file("photons")])
        .args(["--resolution", &job.resolution, "--mode", &job.mode, "--force", "-q", "-o"])
        .args([&picture])
        .run()?;
    ensure_same(&picture, &job.file("exr"))
}

fn ensure_same(a: &Path, b: &Path) -> anyhow::Result<()> {
    let read =
        |path: &Path| fs::read(path).with_context(|| format!("cannot read {}", path.display()));
    ensure!(read(a)? == read(b)?, "{} and {} differ", a.display(), b.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A small job in a folder of its own, if the programs were built with the tests.
    pub(super) fn small(folder: &Path, mode: &str) -> Option<Job> {
        // Tests are built in a folder below the programs.
        let test = std::env::current_exe().unwrap();
        let programs = test.parent().unwrap().parent().unwrap();
        let program = |name: &str| Some(programs.join(name)).filter(|path| path.exists());
        let (Some(photon_build), Some(render_cached)) =
            (program("photon-build"), program("render-cached"))
        else {
            println!("skipped: the programs aren't built; cargo test --workspace builds them");
            return None;
        };
        Some(Job {
            programs: Programs { photon_build, render_cached },
            scene: root().join(SCENE),
            folder: folder.into(),
            photons: "40K".into(),
            shards: 3,
            resolution: "128x128".into(),
            tiles: 4,
            mode: mode.into(),
        })
    }

    #[test]
    fn a_job_of_openjd_makes_the_bytes_of_one_run() {
        let Some(openjd) = openjd::find() else {
            println!("skipped: there is no openjd; .ci/run installs it in target/openjd");
            return;
        };
        for mode in ["original", "adaptive"] {
            let folder = tempfile::tempdir().unwrap();
            let Some(job) = small(folder.path(), mode) else { return };
            openjd::run(&openjd, &job).unwrap();
            compare(&job).unwrap();

            // An element that is done again changes nothing; one that was lost is made again.
            let picture = fs::read(job.file("exr")).unwrap();
            fs::remove_file(folder.path().join("picture-2-of-4.part.exr")).unwrap();
            openjd::run(&openjd, &job).unwrap();
            assert!(fs::read(job.file("exr")).unwrap() == picture, "{mode}");
        }
    }

    #[test]
    fn a_job_of_slurm_makes_the_bytes_of_one_run() {
        if !slurm::is_there() {
            println!("skipped: no Slurm answers here; see xtask/farm/slurm/one-node.sh");
            return;
        }
        for mode in ["original", "adaptive"] {
            let folder = tempfile::tempdir().unwrap();
            let Some(job) = small(folder.path(), mode) else { return };
            slurm::run(&job, 0).unwrap();
            compare(&job).unwrap();

            // What was lost is made again, what is there isn't.
            let picture = fs::read(job.file("exr")).unwrap();
            for lost in ["picture-2-of-4.part.exr", "picture.exr"] {
                fs::remove_file(folder.path().join(lost)).unwrap();
            }
            slurm::run(&job, 0).unwrap();
            assert!(fs::read(job.file("exr")).unwrap() == picture, "{mode}");
        }
    }

    #[test]
    fn slurm_tries_again_and_gives_up() {
        if !slurm::is_there() {
            println!("skipped: no Slurm answers here; see xtask/farm/slurm/one-node.sh");
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        let Some(mut job) = small(folder.path(), "original") else { return };
        // A program that fails the first time it renders a tile, and one that always does.
        let (good, flaky) = (job.programs.render_cached.clone(), folder.path().join("flaky.sh"));
        let script = |body: &str| {
            fs::write(&flaky, format!("#!/bin/sh\n{body}\nexec '{}' \"$@\"\n", good.display()))
                .unwrap();
            Call::new(Path::new("chmod")).args(["+x"]).args([&flaky]).run().unwrap();
        };
        job.programs.render_cached = flaky.clone();
        script("exit 1");
        let error = slurm::run(&job, 0).unwrap_err().to_string();
        assert!(error.contains("made no picture.exr"), "{error}");
        script(&format!("mkdir '{}/failed' 2>/dev/null && kill -9 $$", folder.path().display()));
        slurm::run(&job, 0).unwrap();
        assert!(folder.path().join("failed").exists());
        job.programs.render_cached = good;
        compare(&job).unwrap();
    }
}
