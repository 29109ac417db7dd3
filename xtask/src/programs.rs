//! The programs of the pipeline: built by cargo, run as a user would run them.

use std::ffi::OsString;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, bail, ensure};
use serde_json::Value;

/// The paths of the two programs, relative to [`root`] where they lie below it.
#[derive(Clone, Debug)]
pub(crate) struct Programs {
    pub(crate) photon_build: PathBuf,
    pub(crate) render_cached: PathBuf,
}

/// A program with its arguments, to be run in [`root`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Call {
    pub(crate) program: PathBuf,
    pub(crate) args: Vec<OsString>,
}

/// The folder of the workspace.
pub(crate) fn root() -> PathBuf {
    let xtask = Path::new(env!("CARGO_MANIFEST_DIR"));
    xtask.parent().expect("the package lies in a folder of the workspace").to_path_buf()
}

/// Checks a count such as `1M`, and keeps it as it was written.
///
/// # Errors
/// When it isn't a count of at least one.
pub(crate) fn parse_count_text(text: &str) -> Result<String, String> {
    match cli::parse_count(text)? {
        0 => Err("expected a count above 0".into()),
        _ => Ok(text.into()),
    }
}

/// Builds the programs as `cargo build --release` does.
///
/// # Errors
/// When cargo can't be run, or the build fails.
pub(crate) fn build() -> anyhow::Result<Programs> {
    let args = ["build", "--release", "--package", "photon-build", "--package", "render-cached"];
    let messages = cargo(&args)?;
    let find = |name: &str| built(&messages, name);
    Ok(Programs { photon_build: find("photon-build")?, render_cached: find("render-cached")? })
}

/// Builds a benchmark of the package of tests.
///
/// # Errors
/// As [`build`].
pub(crate) fn build_bench(name: &str) -> anyhow::Result<PathBuf> {
    let messages = cargo(&["bench", "--no-run", "--package", "pipeline-tests", "--bench", name])?;
    built(&messages, name)
}

/// What cargo says of a build.
fn cargo(args: &[&str]) -> anyhow::Result<String> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(args)
        .arg("--message-format=json-render-diagnostics")
        .current_dir(root())
        .stderr(Stdio::inherit())
        .output()
        .context("cannot run cargo")?;
    ensure!(output.status.success(), "it does not build; cargo says why above");
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

fn built(messages: &str, name: &str) -> anyhow::Result<PathBuf> {
    let path = messages.lines().find_map(|line| executable(line, name));
    path.with_context(|| format!("cargo has built no program {name}"))
}

/// The program of that name, if this message of cargo tells of it.
fn executable(message: &str, name: &str) -> Option<PathBuf> {
    let message: Value = serde_json::from_str(message).ok()?;
    let path = Path::new(message["executable"].as_str()?);
    (message["target"]["name"] == name).then(|| from_root(path))
}

/// The path as seen from [`root`], where it lies below it: what can be said to others.
pub(crate) fn from_root(path: &Path) -> PathBuf {
    path.strip_prefix(root()).unwrap_or(path).to_path_buf()
}

impl Programs {
    /// The modes that `render-cached` knows: `original` first, which all others are compared with.
    ///
    /// # Errors
    /// When the program can't be run.
    pub(crate) fn modes(&self) -> anyhow::Result<Vec<String>> {
        let output = Command::new(&self.render_cached)
            .arg("--help")
            .current_dir(root())
            .output()
            .with_context(|| format!("cannot run {}", self.render_cached.display()))?;
        let help = String::from_utf8_lossy(&output.stdout);
        let modes = modes_in(&help);
        ensure!(
            modes.first().is_some_and(|m| m == "original"),
            "{} --help names no mode original",
            self.render_cached.display()
        );
        Ok(modes)
    }
}

/// The values of `--mode` in the long help that clap writes: lines such as `- paper: ...` below the option.
fn modes_in(help: &str) -> Vec<String> {
    let below = help.lines().skip_while(|line| !line.trim_start().starts_with("--mode ")).skip(1);
    let own = below.take_while(|line| !line.trim_start().starts_with("--"));
    own.filter_map(|line| line.trim_start().strip_prefix("- ")?.split(':').next())
        .map(Into::into)
        .collect()
}

impl Call {
    /// A call without arguments.
    pub(crate) fn new(program: &Path) -> Self {
        Self { program: program.into(), args: Vec::new() }
    }

    /// Adds arguments.
    pub(crate) fn args<T: Into<OsString>>(mut self, args: impl IntoIterator<Item = T>) -> Self {
        self.args.extend(args.into_iter().map(Into::into));
        self
    }

    /// Runs the program to its end; its warnings and errors go to standard error.
    ///
    /// # Errors
    /// When it can't be run, or fails.
    pub(crate) fn run(&self) -> anyhow::Result<()> {
        let status = Command::new(&self.program)
            .args(&self.args)
            .current_dir(root())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .status()
            .with_context(|| format!("cannot run {}", self.program.display()))?;
        if !status.success() {
            bail!("this failed with {status}; the program says why above:\n  {self}");
        }
        Ok(())
    }
}

/// The line to type in [`root`].
impl fmt::Display for Call {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let folder = self.program.parent().filter(|p| !p.as_os_str().is_empty());
        if let Some(folder) = folder {
            write!(f, "{}/", folder.display())?;
        }
        let words = std::iter::once(self.program.clone().into_os_string());
        f.write_str(&cli::command_line(words.chain(self.args.iter().cloned())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_are_read_from_the_help() {
        let help = "  -o, --output <IMAGE>\n          Where\n\n      --mode <MODE>\n          Which pixels\n\n          \
                    Possible values:\n          - original: Every\n          - paper:    A few: not all\n\n          \
                    [default: paper]\n\n      --seed <N>\n          - other: No mode\n";
        assert_eq!(modes_in(help), ["original", "paper"]);
        assert!(modes_in("--seed <N>\n - a: b").is_empty());
    }

    #[test]
    fn programs_are_found_in_messages_of_cargo() {
        let path = root().join("target/release/photon-build");
        let line = format!(
            r#"{{"reason":"compiler-artifact","target":{{"name":"photon-build"}},"executable":{:?}}}"#,
            path.display().to_string()
        );
        assert_eq!(
            executable(&line, "photon-build"),
            Some(PathBuf::from("target/release/photon-build"))
        );
        assert_eq!(executable(&line, "render-cached"), None);
        let library =
            r#"{"reason":"compiler-artifact","target":{"name":"photon-build"},"executable":null}"#;
        assert_eq!(executable(library, "photon-build"), None);
        assert_eq!(executable("not JSON", "photon-build"), None);
    }

    #[test]
    fn calls_show_as_one_would_type_them() {
        let call = Call::new(Path::new("target/release/photon-build")).args([
            "my scene.toml",
            "-o",
            "a.photons",
        ]);
        assert_eq!(call.to_string(), "target/release/photon-build 'my scene.toml' -o a.photons");
    }
}
