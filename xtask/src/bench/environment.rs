//! Where and of what a run was made.

use std::process::Command;
use std::{fs, thread};

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};

use crate::programs::root;

/// The machine, the compiler and the sources.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Environment {
    pub(crate) processor: String,
    /// Threads that the machine runs at a time.
    pub(crate) processors: usize,
    pub(crate) memory: String,
    pub(crate) system: String,
    pub(crate) rustc: String,
    pub(crate) rustflags: String,
    /// The commit checked out, with a word if files differ from it.
    pub(crate) commit: String,
    pub(crate) commit_date: String,
    /// The command that made the run.
    pub(crate) command: String,
}

impl Environment {
    /// What is here and now.
    ///
    /// # Errors
    /// When `git` or `rustc` can't be run: a measurement of unknown sources is worth nothing.
    pub(crate) fn here(command: String) -> anyhow::Result<Self> {
        let field = |path: &str, key: &str| {
            let text = fs::read_to_string(path).unwrap_or_default();
            let line = text.lines().find_map(|line| line.strip_prefix(key));
            line.map(|value| value.trim_matches([':', '=', '"', ' ', '\t']).to_owned())
        };
        let unknown = || "unknown".to_owned();
        let kernel = fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
        let system =
            field("/etc/os-release", "PRETTY_NAME").unwrap_or_else(|| std::env::consts::OS.into());
        let memory = field("/proc/meminfo", "MemTotal")
            .and_then(|text| text.strip_suffix(" kB")?.parse::<f64>().ok())
            .map(|kib| format!("{:.1} GiB", kib / f64::from(1 << 20)));
        let changes = said_by("git", &["status", "--porcelain", "--untracked-files=no"])?;
        let dirty = if changes.is_empty() { "" } else { ", with changes" };
        Ok(Self {
            processor: field("/proc/cpuinfo", "model name").unwrap_or_else(unknown),
            processors: thread::available_parallelism().map_or(1, usize::from),
            memory: memory.unwrap_or_else(unknown),
            system: format!("{system}, kernel {}", kernel.trim()),
            rustc: said_by("rustc", &["--version"])?,
            rustflags: std::env::var("RUSTFLAGS").unwrap_or_default(),
            commit: said_by("git", &["rev-parse", "--short=12", "HEAD"])? + dirty,
            commit_date: said_by("git", &["log", "-1", "--format=%cI"])?,
            command,
        })
    }

    /// As a list in Markdown.
    pub(crate) fn list(&self) -> String {
        self.lines().iter().map(|(name, value)| format!("- {name}: {value}\n")).collect()
    }

    /// Names and values, for people.
    pub(crate) fn lines(&self) -> Vec<(&'static str, String)> {
        let processor = format!("{}, {} threads", self.processor, self.processors);
        let mut lines = vec![
            ("processor", processor),
            ("memory", self.memory.clone()),
            ("system", self.system.clone()),
            ("compiler", self.rustc.clone()),
            ("commit", format!("{} ({})", self.commit, self.commit_date)),
            ("command", self.command.clone()),
        ];
        if !self.rustflags.is_empty() {
            lines.insert(4, ("flags", self.rustflags.clone()));
        }
        lines
    }
}

/// What a command prints, without white space around it.
fn said_by(program: &str, args: &[&str]) -> anyhow::Result<String> {
    let output = Command::new(program)
        .args(args)
        .current_dir(root())
        .output()
        .with_context(|| format!("cannot run {program}"))?;
    ensure!(output.status.success(), "{program} {} failed", args.join(" "));
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
