//! Runs that are kept in the repository: `xtask/runs/NAME`.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use film::Existing;

use crate::bench::environment::Environment;
use crate::bench::gallery::Detail;
use crate::bench::raw::Record;
use crate::bench::runs::Runs;
use crate::programs::root;

/// What a report in the repository shows: enough to see, little enough to keep.
pub(crate) const DETAIL: Detail = Detail { picture: 256, pixels: 128 };

const RUNS: &str = "xtask/runs";
/// The files of a run that are read again: its records, a line each, and its machine.
pub(crate) const RAW: &str = "raw.jsonl";
const ENVIRONMENT: &str = "environment.json";

/// A run that was kept.
pub(crate) struct Kept {
    pub(crate) environment: Environment,
    pub(crate) runs: Runs,
}

/// The folder of a run, from the folder of the workspace.
pub(crate) fn folder(name: &str) -> PathBuf {
    Path::new(RUNS).join(name)
}

/// Names that can be kept: those of folders, without spaces.
///
/// # Errors
/// When the name is none.
pub(crate) fn parse_name(text: &str) -> Result<String, String> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    match text.chars().all(is_plain) && text.starts_with(|c: char| c.is_ascii_alphanumeric()) {
        true => Ok(text.into()),
        false => Err("expected letters, digits, '-', '_' and '.', as in 2026-05-first".into()),
    }
}

/// Finds out before an hour of work whether a run can be kept under a name.
///
/// # Errors
/// When there is one already.
pub(crate) fn check_free(name: &str) -> anyhow::Result<()> {
    check_no_file(name, RAW)
}

/// Finds out whether a run has a file yet.
///
/// # Errors
/// When it has.
pub(crate) fn check_no_file(name: &str, file: &str) -> anyhow::Result<()> {
    let path = folder(name).join(file);
    ensure!(
        !root().join(&path).exists(),
        "{} is there already; choose another name, or replace it with --force",
        path.display()
    );
    Ok(())
}

/// Keeps a run: raw accounts, machine and commit, tables, and a report.
///
/// # Errors
/// When a file can't be written.
pub(crate) fn keep(
    name: &str,
    environment: &Environment,
    records: &[Record],
    tables: &str,
    page: &str,
) -> anyhow::Result<()> {
    let mut raw = String::new();
    for record in records {
        writeln!(raw, "{}", serde_json::to_string(record)?)?;
    }
    let readme = format!(
        "# Bench run {name}\n\n{}\n`{RAW}` holds the account of every run, `report.html` the figures and pictures.\n\n{}\n",
        environment.list(),
        tables.trim_end()
    );
    let environment = serde_json::to_string_pretty(environment)? + "\n";
    write(
        name,
        &[(ENVIRONMENT, &environment), (RAW, &raw), ("README.md", &readme), ("report.html", page)],
    )
}

/// Writes files of a run.
///
/// # Errors
/// When one can't be written.
pub(crate) fn write(name: &str, files: &[(&str, &str)]) -> anyhow::Result<()> {
    let folder = root().join(folder(name));
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    for (file, contents) in files {
        let path = folder.join(file);
        atomic_file::write(&path, Existing::Replace, |out| out.write_all(contents.as_bytes()))?;
    }
    Ok(())
}

/// Reads a run that was kept.
///
/// # Errors
/// When there is none of that name, or its files can't be read.
pub(crate) fn load(name: &str) -> anyhow::Result<Kept> {
    let folder = root().join(folder(name));
    ensure!(
        folder.join(RAW).is_file(),
        "there is no recorded run {name}; there are: {}",
        names(RAW).join(", ")
    );
    let read = |name: &str| {
        let path = folder.join(name);
        fs::read_to_string(&path).with_context(|| format!("reading {}", path.display()))
    };
    let environment = serde_json::from_str(&read(ENVIRONMENT)?)
        .with_context(|| format!("reading {ENVIRONMENT} of {name}"))?;
    let parse = |line: &str| serde_json::from_str::<Record>(line);
    let records: Vec<Record> = read(RAW)?
        .lines()
        .map(parse)
        .collect::<Result<_, _>>()
        .with_context(|| format!("reading {RAW} of {name}"))?;
    Ok(Kept { environment, runs: Runs::of(&records)? })
}

/// The names of all runs that have a file, in order.
pub(crate) fn names(file: &str) -> Vec<String> {
    let entries = fs::read_dir(root().join(RUNS)).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .filter(|entry| entry.path().join(file).is_file())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_plain() {
        assert_eq!(parse_name("2026-05.first_run").as_deref(), Ok("2026-05.first_run"));
        for name in ["", ".", "..", "../x", "a b", "-x", "a/b"] {
            assert!(parse_name(name).is_err(), "{name:?}");
        }
    }

    #[test]
    fn all_kept_runs_can_be_read() {
        for name in names(RAW) {
            let kept = load(&name).unwrap();
            assert!(kept.runs.n_runs() > 0, "{name}");
        }
    }
}
