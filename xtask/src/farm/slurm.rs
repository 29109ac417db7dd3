//! Jobs of Slurm.

use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use anyhow::{Context, ensure};

use super::{Job, NAME};
use crate::programs::root;

const SUBMIT: &str = "xtask/farm/slurm/submit.sh";

/// Whether there is a Slurm that answers.
pub(super) fn is_there() -> bool {
    let mut command = Command::new("sinfo");
    command.arg("--noheader").stdin(Stdio::null()).stderr(Stdio::null());
    command.output().is_ok_and(|output| output.status.success() && !output.stdout.is_empty())
}

/// Submits a job and waits for its end. Elements that fail are queued again this often.
///
/// # Errors
/// When it can't be submitted, or makes no picture.
pub(super) fn run(job: &Job, retries: u32) -> anyhow::Result<()> {
    let submitted = Command::new(root().join(SUBMIT))
        .args([&job.scene, &job.folder])
        .env("NAME", NAME)
        .env("PHOTONS", &job.photons)
        .env("SHARDS", job.shards.to_string())
        .env("RESOLUTION", &job.resolution)
        .env("TILES", job.tiles.to_string())
        .env("MODE", &job.mode)
        .env("RETRIES", retries.to_string())
        .env("PHOTON_BUILD", &job.programs.photon_build)
        .env("RENDER_CACHED", &job.programs.render_cached)
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| format!("cannot run {SUBMIT}"))?;
    ensure!(submitted.status.success(), "{SUBMIT} has failed; it says why above");
    let number = String::from_utf8_lossy(&submitted.stdout).trim().to_owned();
    while is_queued(&number)? {
        sleep(Duration::from_millis(500));
    }
    ensure!(
        job.file("exr").exists(),
        "job {number} has ended and made no {NAME}.exr; its logs are in {}",
        job.folder.display()
    );
    Ok(())
}

/// Whether the last job of a chain is waiting, or runs.
fn is_queued(number: &str) -> anyhow::Result<bool> {
    let queue = Command::new("squeue")
        .args(["--noheader", "--format=%i", "--jobs", number])
        .args(["--states", "PENDING,CONFIGURING,RUNNING,COMPLETING,SUSPENDED,REQUEUED"])
        .output()
        .context("cannot run squeue")?;
    // A job that has ended long ago is no valid number any more.
    Ok(queue.status.success() && !queue.stdout.is_empty())
}
