//! The rules of `crates/README.md`, held against manifests and sources, so that the page stays true.

mod manifests;
mod pages;
mod sources;
mod supply;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The page that is held.
const ARCHITECTURE: &str = "crates/README.md";

/// The folder of the workspace.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// A text of the workspace, by its path from the root.
fn read(path: impl AsRef<Path>) -> String {
    let path = root().join(path);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The names in a folder of the workspace, in order.
fn entries(folder: impl AsRef<Path>) -> Vec<String> {
    let folder = root().join(folder);
    let entries = fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut names: Vec<_> =
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// A package of the workspace.
struct Package {
    name: String,
    /// From the root of the workspace.
    folder: PathBuf,
    manifest: toml::Table,
}

impl Package {
    /// The packages named in a section, such as `dependencies`.
    fn section(&self, name: &str) -> BTreeSet<String> {
        let table = self.manifest.get(name).and_then(|section| section.as_table());
        table.into_iter().flat_map(|t| t.keys().cloned()).collect()
    }
}

/// All packages of the workspace, by name.
fn packages() -> BTreeMap<String, Package> {
    let crates = entries("crates").into_iter().map(|name| Path::new("crates").join(name));
    let folders = crates.chain(["tests".into(), "xtask".into()]);
    let manifests = folders.filter(|folder| root().join(folder).join("Cargo.toml").exists());
    let packages = manifests.map(|folder| {
        let manifest: toml::Table = read(folder.join("Cargo.toml")).parse().unwrap();
        let name = manifest["package"]["name"].as_str().unwrap().to_owned();
        (name.clone(), Package { name, folder, manifest })
    });
    packages.collect()
}

/// Every Rust file below a folder of the workspace, by its path from the root, in order. None if there is no such folder.
fn sources(folder: impl AsRef<Path>) -> Vec<(PathBuf, String)> {
    let folder = folder.as_ref();
    if !root().join(folder).is_dir() {
        return Vec::new();
    }
    let mut files = Vec::new();
    for name in entries(folder) {
        let path = folder.join(name);
        if root().join(&path).is_dir() {
            files.extend(sources(&path));
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            files.push((path.clone(), read(&path)));
        }
    }
    files
}

/// The lines of a source that are neither comments nor in its module of tests.
fn code(source: &str) -> impl Iterator<Item = &str> {
    source
        .lines()
        .take_while(|line| line.trim() != "#[cfg(test)]")
        .map(|line| line.split("//").next().unwrap_or_default())
}

/// Whether `word` is in `line`, not as a part of a longer name.
fn has_word(line: &str, word: &str) -> bool {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    line.match_indices(word).any(|(at, _)| {
        !line[..at].chars().next_back().is_some_and(is_name)
            && !line[at + word.len()..].chars().next().is_some_and(is_name)
    })
}

/// The rows of the first table below a heading, without its header; cells have no backticks.
fn table(page: &str, heading: &str) -> Vec<Vec<String>> {
    let rows = page
        .lines()
        .skip_while(|line| *line != heading)
        .skip_while(|line| !line.starts_with('|'))
        .take_while(|line| line.starts_with('|'))
        .skip(2);
    let cells = |line: &str| -> Vec<String> {
        line.trim_matches('|').split('|').map(|cell| cell.trim().replace('`', "")).collect()
    };
    let rows: Vec<_> = rows.map(cells).collect();
    assert!(!rows.is_empty(), "there is no table below {heading:?}");
    rows
}
