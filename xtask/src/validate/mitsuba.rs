//! Mitsuba 3 by its Python package: where it is, and what it renders.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, bail, ensure};
use base::{Grid, Rgb};
use serde::Deserialize;

/// What renders a scene, in Python.
const SCRIPT: &str = include_str!("reference.py");

/// A Python that has Mitsuba.
pub(super) struct Python {
    program: PathBuf,
    variant: String,
    folder: PathBuf,
}

/// A picture by Mitsuba.
pub(super) struct Reference {
    pub(super) version: String,
    pub(super) picture: Grid<Rgb>,
    /// Of the mean of each channel.
    pub(super) standard_error: [f64; 3],
    /// The relMSE that Mitsuba's own noise makes.
    pub(super) noise: f64,
    pub(super) cpu_seconds: f64,
}

/// What the script tells.
#[derive(Deserialize)]
struct Account {
    version: String,
    means: Vec<[f64; 3]>,
    cpu_seconds: f64,
}

impl Python {
    /// The given Python, or that of a virtual environment in `folder`, which `install` makes.
    ///
    /// # Errors
    /// When there is none that has Mitsuba and its variant: with what to do.
    pub(super) fn find(
        given: Option<&Path>,
        folder: &Path,
        install: bool,
        variant: &str,
    ) -> anyhow::Result<Self> {
        let environment = folder.join("venv");
        let own = environment.join("bin/python");
        if install {
            let made = call(Path::new("python3"), &["-m", "venv"], &[&environment])
                .and_then(|()| call(&own, &["-m", "pip", "install", "--quiet", "mitsuba>=3"], &[]));
            made.context(
                "cannot install Mitsuba; it takes python3 with its module venv (python3-venv of Debian), and the network",
            )?;
        }
        let program = given.map_or(own, Path::to_path_buf);
        let probe = format!(
            "import mitsuba as mi; mi.set_variant('{variant}'); mi.render(mi.load_dict(mi.cornell_box()), spp=1)"
        );
        let output = Command::new(&program)
            .args(["-c", &probe])
            .current_dir(folder)
            .stdin(Stdio::null())
            .output();
        match output {
            Ok(output) if output.status.success() => {
                Ok(Self { program, variant: variant.into(), folder: folder.into() })
            }
            Ok(output) => {
                let said = String::from_utf8_lossy(&output.stderr);
                bail!(
                    "Mitsuba doesn't run with the variant {variant} ({}); for llvm_ad_rgb install LLVM (libllvm19 of Debian), or take --variant scalar_rgb",
                    said.trim().lines().last().unwrap_or("no words")
                )
            }
            Err(_) => bail!(
                "there is no Python with Mitsuba at {}; run cargo xtask validate --install, or name one with --python",
                program.display()
            ),
        }
    }

    /// Renders a scene in an even number of passes.
    pub(super) fn render(
        &self,
        scene: &Path,
        name: &str,
        side: u32,
        passes: u32,
        samples: u32,
    ) -> anyhow::Result<Reference> {
        let script = self.folder.join("reference.py");
        fs::write(&script, SCRIPT).context("cannot write the script")?;
        let halves = ["even", "odd"].map(|half| self.folder.join(format!("{name}-{half}.exr")));
        let output = Command::new(&self.program)
            .arg(&script)
            .arg(scene)
            .args([side, passes, samples].map(|n| n.to_string()))
            .arg(&self.variant)
            .args(&halves)
            .stdin(Stdio::null())
            .stderr(Stdio::inherit())
            .output()
            .context("cannot run Python")?;
        ensure!(output.status.success(), "Mitsuba failed on {name}; it says why above");
        let account: Account =
            serde_json::from_slice(&output.stdout).context("Mitsuba's script said nothing")?;
        let [even, odd] = halves.map(|half| film::read_rgb(&half, ""));
        let (even, odd) = (even?, odd?);
        let (difference, _) = film::compare(&even, &odd, 0.0)?;
        let both = even.values().iter().zip(odd.values()).map(|(a, b)| (*a + *b) * 0.5);
        Ok(Reference {
            version: account.version,
            picture: Grid::from_values(even.size(), both.collect()),
            standard_error: standard_error(&account.means),
            noise: difference.rel_mse / 4.0,
            cpu_seconds: account.cpu_seconds,
        })
    }
}

/// Of the mean of passes, by channel.
fn standard_error(means: &[[f64; 3]]) -> [f64; 3] {
    let n = means.len() as f64;
    [0, 1, 2].map(|c| {
        let mean = means.iter().map(|m| m[c]).sum::<f64>() / n;
        let squares = means.iter().map(|m| (m[c] - mean) * (m[c] - mean)).sum::<f64>();
        (squares / (n * (n - 1.0))).sqrt()
    })
}

fn call(program: &Path, args: &[&str], paths: &[&Path]) -> anyhow::Result<()> {
    let status = Command::new(program)
        .args(args)
        .args(paths)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .status()
        .with_context(|| format!("cannot run {}", program.display()))?;
    ensure!(status.success(), "{} {} failed with {status}", program.display(), args.join(" "));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_means_fall_with_the_passes() {
        let means = [[1.0, 5.0, 0.0], [3.0, 5.0, 0.0]];
        assert_eq!(standard_error(&means), [1.0, 0.0, 0.0]);
        let often: Vec<_> = means.into_iter().cycle().take(200).collect();
        assert!((standard_error(&often)[0] - 1.0 / 199_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn what_is_missing_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let error = Python::find(None, folder.path(), false, "scalar_rgb").err().unwrap();
        let expected = format!(
            "there is no Python with Mitsuba at {}; run cargo xtask validate --install, or name one with --python",
            folder.path().join("venv/bin/python").display()
        );
        assert_eq!(error.to_string(), expected);
    }
}
