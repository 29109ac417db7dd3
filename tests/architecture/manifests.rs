//! Who may name whom.

use std::collections::{BTreeMap, BTreeSet};

use super::{ARCHITECTURE, Package, code, has_word, packages, read, sources, table};

/// Crates of other projects that belong to a few of ours.
const ONLY: &[(&str, &[&str])] = &[
    ("anyhow", &["cli", "photon-build", "render-cached", "xtask"]),
    ("bincode", &["mapfile"]),
    ("clap", &["cli", "photon-build", "pipeline-tests", "render-cached", "xtask"]),
    ("ctrlc", &["cli"]),
    ("exr", &["film"]),
    ("image", &["scene"]),
    ("indicatif", &["cli"]),
    ("libm", &["base", "scene"]),
    ("memmap2", &["mapfile"]),
    ("nix", &["cli", "mapfile"]),
    ("obvhs", &["geometry"]),
    ("png", &["film"]),
    ("quick-xml", &["scene"]),
    ("rand_core", &["base"]),
    ("rand_pcg", &["base"]),
    ("tobj", &["scene"]),
];

/// What a crate deliberately does not know.
const NEVER: &[(&str, &[&str])] = &[
    ("base", &["rayon"]),
    ("cache-map", &["geometry", "photon-map", "scene", "shade"]),
    ("film", &["geometry", "mapfile", "scene"]),
    ("photon-map", &["geometry", "photon-trace", "scene"]),
    ("photon-trace", &["mapfile", "photon-map", "serde"]),
    ("shade", &["cache-map", "film", "photon-trace", "rayon", "serde"]),
];

/// What a package names in what is built of it. The package of tests consists of tests only.
fn named(package: &Package) -> BTreeSet<String> {
    let mut names = package.section("dependencies");
    if package.name == "pipeline-tests" {
        names.extend(package.section("dev-dependencies"));
    }
    names
}

#[test]
fn the_table_of_crates_equals_the_manifests() {
    let packages = packages();
    let list =
        |names: &BTreeSet<&String>| names.iter().map(|n| n.as_str()).collect::<Vec<_>>().join(", ");
    let expected: BTreeMap<String, [String; 2]> = packages
        .values()
        .map(|package| {
            let names = named(package);
            let (ours, others) = names.iter().partition(|name| packages.contains_key(*name));
            (package.name.clone(), [list(&ours), list(&others)])
        })
        .collect();
    let page: BTreeMap<String, [String; 2]> = table(&read(ARCHITECTURE), "## Who may name whom")
        .into_iter()
        .map(|row| (row[0].clone(), [row[1].clone(), row[2].clone()]))
        .collect();
    let wrong: Vec<String> = expected
        .iter()
        .filter(|(name, row)| page.get(*name) != Some(row))
        .map(|(name, [ours, others])| format!("| {name} | {ours} | {others} |"))
        .collect();
    assert!(wrong.is_empty(), "{ARCHITECTURE} needs these rows:\n{}", wrong.join("\n"));
    let gone: Vec<_> = page.keys().filter(|name| !expected.contains_key(*name)).collect();
    assert!(gone.is_empty(), "{ARCHITECTURE} has rows of no crate: {gone:?}");
}

#[test]
fn crates_of_other_projects_stay_where_they_belong() {
    for package in packages().values() {
        let mut names = package.section("dependencies");
        names.extend(package.section("dev-dependencies"));
        for (name, owners) in ONLY {
            assert!(
                !names.contains(*name) || owners.contains(&package.name.as_str()),
                "{} names {name}, which belongs to {owners:?}",
                package.name
            );
        }
    }
}

#[test]
fn crates_do_not_know_what_they_should_not() {
    let packages = packages();
    for (name, strangers) in NEVER {
        let names = packages[*name].section("dependencies");
        for stranger in *strangers {
            assert!(!names.contains(*stranger), "{name} names {stranger}");
        }
    }
}

#[test]
fn every_dependency_is_used_and_has_its_reason() {
    let root: toml::Table = read("Cargo.toml").parse().unwrap();
    let packages = packages();
    let declared: BTreeSet<String> =
        root["workspace"]["dependencies"].as_table().unwrap().keys().cloned().collect();
    let used: BTreeSet<String> = packages
        .values()
        .flat_map(|p| [p.section("dependencies"), p.section("dev-dependencies")])
        .flatten()
        .collect();
    let unused: Vec<_> = declared.difference(&used).collect();
    assert!(unused.is_empty(), "Cargo.toml names {unused:?}, which no crate uses");

    let others: BTreeSet<String> =
        declared.into_iter().filter(|name| !packages.contains_key(name)).collect();
    let explained: BTreeSet<String> = table(&read(ARCHITECTURE), "## Dependencies")
        .into_iter()
        .filter(|row| !row[1].is_empty())
        .map(|row| row[0].clone())
        .collect();
    let missing: Vec<_> = others.difference(&explained).collect();
    let stale: Vec<_> = explained.difference(&others).collect();
    assert!(
        missing.is_empty() && stale.is_empty(),
        "{ARCHITECTURE} has no reason for {missing:?}, and one too many for {stale:?}"
    );
}

#[test]
fn every_crate_uses_what_it_names() {
    let mut unused = Vec::new();
    for package in packages().values() {
        let own = sources(package.folder.join("src"));
        let all = match package.name.as_str() {
            "pipeline-tests" => sources(&package.folder),
            _ => ["src", "tests"].map(|folder| sources(package.folder.join(folder))).concat(),
        };
        for name in package.section("dependencies") {
            let word = name.replace('-', "_");
            if !own.iter().any(|(_, text)| code(text).any(|line| has_word(line, &word))) {
                unused.push(format!("{} names {name}", package.name));
            }
        }
        for name in package.section("dev-dependencies") {
            let word = name.replace('-', "_");
            if !all.iter().any(|(_, text)| text.lines().any(|line| has_word(line, &word))) {
                unused.push(format!("the tests of {} name {name}", package.name));
            }
        }
    }
    assert!(unused.is_empty(), "named and not used: {}", unused.join(", "));
}

#[test]
fn manifests_are_alike() {
    for Package { name, manifest, folder } in packages().values() {
        let folder = folder.file_name().unwrap().to_str().unwrap();
        assert!(name == folder || name == "pipeline-tests", "{folder} holds the crate {name}");
        let lints = manifest.get("lints").and_then(|lints| lints.get("workspace"));
        assert_eq!(lints, Some(&toml::Value::Boolean(true)), "{name} has lints of its own");
        for key in ["edition", "license", "publish", "rust-version", "version"] {
            let inherited = manifest["package"].get(key).and_then(|value| value.get("workspace"));
            let expected = Some(&toml::Value::Boolean(true));
            assert_eq!(inherited, expected, "{name} has its own {key}");
        }
        for section in ["features", "build-dependencies", "target"] {
            assert!(!manifest.contains_key(section), "{name} has a section {section}");
        }
        for section in ["dependencies", "dev-dependencies"] {
            let table = manifest.get(section).and_then(|s| s.as_table());
            for (dependency, value) in table.into_iter().flatten() {
                let expected = toml::Table::from_iter([("workspace".into(), true.into())]);
                let inherited = value.as_table() == Some(&expected);
                assert!(inherited, "{name} has its own version of {dependency}");
            }
        }
    }
}
