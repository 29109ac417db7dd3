//! What is built of others: licenses, packages in two versions, the oldest compiler.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde_json::Value;

use super::{ARCHITECTURE, read, root, table};

/// Licenses under which code may be in the programs: each lets them be given on under those of this project.
const ALLOWED: [&str; 9] = [
    "0BSD",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "MIT",
    "Unicode-3.0",
    "Zlib",
];

/// What a tool of the toolchain prints.
fn output(tool: &str, args: &[&str]) -> String {
    let program = std::env::var(tool.to_uppercase()).unwrap_or_else(|_| tool.into());
    let output = Command::new(program).args(args).current_dir(root()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// All packages that any build on any machine takes, those of tests included.
fn built() -> Vec<Value> {
    let text = output("cargo", &["metadata", "--locked", "--format-version", "1"]);
    let metadata: Value = serde_json::from_str(&text).unwrap();
    metadata["packages"].as_array().unwrap().clone()
}

/// Whether a license expression leaves a choice that is allowed. A slash is the old way to write OR.
fn is_allowed(expression: &str) -> bool {
    let is_choice = |term: &str| {
        let term = term.trim().trim_start_matches('(').trim_end_matches(')');
        term.replace('/', " OR ").split(" OR ").any(|license| ALLOWED.contains(&license.trim()))
    };
    expression.split(" AND ").all(is_choice)
}

#[test]
fn every_package_may_be_given_on() {
    for (expression, expected) in [
        ("MIT", true),
        ("GPL-3.0", false),
        ("MIT OR GPL-3.0", true),
        ("Unlicense/MIT", true),
        ("(MIT OR Apache-2.0) AND Unicode-3.0", true),
        ("(MIT OR Apache-2.0) AND GPL-3.0", false),
        ("", false),
    ] {
        assert_eq!(is_allowed(expression), expected, "{expression}");
    }
    let packages = built();
    let locked: toml::Table = read("Cargo.lock").parse().unwrap();
    assert_eq!(packages.len(), locked["package"].as_array().unwrap().len());
    for package in packages {
        let license = package["license"].as_str().unwrap_or("");
        assert!(is_allowed(license), "{} is under `{license}`", package["id"]);
    }
}

#[test]
fn packages_in_two_versions_are_explained() {
    let mut versions: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let args =
        ["tree", "--workspace", "--locked", "--edges", "normal,build,dev", "--prefix", "none"];
    for line in output("cargo", &args).lines() {
        let mut words = line.split_whitespace();
        if let (Some(name), Some(version)) = (words.next(), words.next()) {
            versions.entry(name.into()).or_default().insert(version.into());
        }
    }
    let twice: BTreeSet<String> =
        versions.into_iter().filter(|(_, v)| v.len() > 1).map(|(name, _)| name).collect();
    let explained: BTreeSet<String> = table(&read(ARCHITECTURE), "### In two versions")
        .into_iter()
        .map(|row| row[0].clone())
        .collect();
    assert_eq!(
        twice, explained,
        "packages that are built twice, and those that {ARCHITECTURE} explains"
    );
}

#[test]
fn the_oldest_compiler_is_told_and_no_newer_than_this_one() {
    let manifest: toml::Table = read("Cargo.toml").parse().unwrap();
    let oldest = manifest["workspace"]["package"]["rust-version"].as_str().unwrap();
    assert!(
        read("README.md").contains(&format!("Rust {oldest} ")),
        "README.md tells another Rust than {oldest}"
    );
    let this = output("rustc", &["--version"]);
    let numbers = |version: &str| -> Vec<u32> {
        version.split('.').map(|part| part.parse().unwrap()).collect()
    };
    let this = this.split_whitespace().nth(1).unwrap().split('-').next().unwrap();
    assert!(numbers(oldest) <= numbers(this), "{oldest} is asked for, this is {this}");
}

#[test]
fn nothing_of_ours_runs_while_it_is_built() {
    for package in super::packages().values() {
        assert!(
            !root().join(&package.folder).join("build.rs").exists(),
            "{} has a build.rs",
            package.name
        );
        assert!(!package.manifest["package"].as_table().unwrap().contains_key("build"));
    }
}
