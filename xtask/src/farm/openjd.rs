//! Jobs of the Open Job Description, run by openjd-cli.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::ensure;

use super::{Job, NAME};
use crate::programs::{Call, root};

const TEMPLATE: &str = "xtask/farm/tetralux.openjd.yaml";

/// Where it is installed if it isn't there.
const FOLDER: &str = "target/openjd";

/// The program, from the path of the shell or from [`FOLDER`].
pub(super) fn find() -> Option<PathBuf> {
    let runs = |program: &PathBuf| {
        let mut command = Command::new(program);
        command.arg("--version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    };
    [PathBuf::from("openjd"), root().join(FOLDER).join("bin/openjd")].into_iter().find(runs)
}

/// The program; installed with Python's own tools if it isn't there.
///
/// # Errors
/// When that fails.
pub(super) fn find_or_install() -> anyhow::Result<PathBuf> {
    if let Some(program) = find() {
        return Ok(program);
    }
    let folder = root().join(FOLDER);
    Call::new(Path::new("python3")).args(["-m", "venv"]).args([&folder]).run()?;
    Call::new(&folder.join("bin/pip")).args(["install", "--quiet", "openjd-cli"]).run()?;
    Ok(folder.join("bin/openjd"))
}

/// Runs a job to its end.
///
/// # Errors
/// When the template is wrong, or a task fails.
pub(super) fn run(openjd: &Path, job: &Job) -> anyhow::Result<()> {
    Call::new(openjd).args(["check", TEMPLATE]).run()?;
    let values = [
        ("Scene", job.scene.display().to_string()),
        ("Folder", job.folder.display().to_string()),
        ("Name", NAME.into()),
        ("Photons", job.photons.clone()),
        ("Shards", job.shards.to_string()),
        ("Resolution", job.resolution.clone()),
        ("Tiles", job.tiles.to_string()),
        ("Mode", job.mode.clone()),
        ("PhotonBuild", job.programs.photon_build.display().to_string()),
        ("RenderCached", job.programs.render_cached.display().to_string()),
    ];
    let mut call =
        Call::new(openjd).args(["run", TEMPLATE, "--step", "Assemble", "--run-dependencies"]);
    for (name, value) in values {
        call = call.args(["--job-param".into(), format!("{name}={value}")]);
    }
    call.run()?;
    ensure!(job.file("exr").exists(), "the job has ended and made no {NAME}.exr");
    Ok(())
}
