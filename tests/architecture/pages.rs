//! What the pages for people promise.

use std::collections::BTreeSet;
use std::path::Path;

use super::{ARCHITECTURE, entries, packages, read, root, sources};

/// What may lie at the top, beside files whose names begin with a dot.
const TOP: [&str; 9] = [
    "Cargo.lock",
    "Cargo.toml",
    "LICENSE-APACHE",
    "LICENSE-MIT",
    "README.md",
    "crates",
    "scenes",
    "tests",
    "xtask",
];

/// Whether `.gitignore` keeps an entry of the top out of the project: `/name` or `/*.ending`.
fn is_ignored(name: &str, gitignore: &str) -> bool {
    gitignore.lines().filter_map(|line| line.strip_prefix('/')).any(|pattern| {
        match pattern.strip_prefix('*') {
            Some(ending) => name.ends_with(ending),
            None => name == pattern,
        }
    })
}

#[test]
fn the_top_holds_nothing_else() {
    let gitignore = read(".gitignore");
    let others: Vec<_> = entries("")
        .into_iter()
        .filter(|name| !name.starts_with('.') && !TOP.contains(&name.as_str()))
        .filter(|name| !is_ignored(name, &gitignore))
        .collect();
    assert!(others.is_empty(), "these do not belong at the top: {others:?}");
}

#[test]
fn the_code_map_names_every_crate() {
    let page = read(ARCHITECTURE);
    let map = page.split("## Code map").nth(1).unwrap().split("\n## ").next().unwrap();
    for name in packages().keys().filter(|name| *name != "pipeline-tests") {
        assert!(map.contains(&format!("`{name}`")), "the code map doesn't tell of {name}");
    }
}

#[test]
fn links_between_pages_lead_somewhere() {
    for page in ["README.md", ARCHITECTURE, "tests/README.md"] {
        let text = read(page);
        let targets = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        for target in targets.filter(|target| !target.contains("://")) {
            let (file, heading) = target.split_once('#').unwrap_or((target, ""));
            let file = match file {
                "" => root().join(page),
                _ => root().join(page).parent().unwrap().join(file),
            };
            assert!(file.exists(), "{page} links to {target}");
            let found = heading.is_empty() || headings(&file).contains(heading);
            assert!(found, "{page} links to {target}, and there is no such heading");
        }
    }
}

/// The headings of a page as links name them.
fn headings(page: &Path) -> BTreeSet<String> {
    let text = read(page);
    let headings = text.lines().filter_map(|line| line.strip_prefix('#'));
    headings
        .map(|heading| {
            let words = heading.trim_start_matches('#').trim().to_lowercase();
            let kept = words.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
            kept.collect::<String>().replace(' ', "-")
        })
        .collect()
}

#[test]
fn the_checks_run_the_command_that_the_page_names() {
    let command = "cargo test --workspace";
    assert!(read("README.md").lines().any(|line| line == command), "README.md: {command}");
    let checks = read(".ci/run");
    assert!(checks.lines().any(|line| line.contains(command)), ".ci/run: {command}");
}

/// Author and year wherever a text names both: `Jensen 2001`, `Steele et al. 2014`.
fn citations(text: &str) -> BTreeSet<(String, String)> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let mut found = BTreeSet::new();
    for (i, word) in words.iter().enumerate().skip(1) {
        let year: String = word.chars().take_while(char::is_ascii_digit).collect();
        let goes_on = word[year.len()..].starts_with(|c: char| c.is_alphanumeric() || c == '-');
        if year.len() != 4 || goes_on || !(year.starts_with("19") || year.starts_with("20")) {
            continue;
        }
        let before =
            if words[i - 1].trim_end_matches(',') == "al." && i >= 3 { i - 3 } else { i - 1 };
        let author = words[before].trim_start_matches(['(', '[']).trim_end_matches(',');
        let is_name = author.chars().next().is_some_and(char::is_uppercase)
            && author.chars().skip(1).any(char::is_lowercase)
            && author.chars().all(|c| c.is_alphabetic() || "-'’".contains(c));
        if is_name {
            found.insert((author.to_owned(), year));
        }
    }
    found
}

#[test]
fn citations_and_references_agree() {
    let page = read(ARCHITECTURE);
    let (body, list) = page.split_once("\n## References\n").expect("the page ends with a list");
    let references: Vec<&str> = list.lines().filter(|line| line.starts_with("- ")).collect();

    let mut cited = citations(body);
    for folder in ["crates", "tests", "xtask"] {
        for (_, text) in sources(folder) {
            let comments = text.lines().filter_map(|line| line.trim_start().strip_prefix("//"));
            let comments: Vec<&str> =
                comments.map(|line| line.trim_start_matches(['/', '!'])).collect();
            cited.extend(citations(&comments.join("\n")));
        }
    }
    let names = |reference: &str, (author, year): &(String, String)| {
        reference.contains(author.as_str()) && reference.contains(year.as_str())
    };
    for citation in &cited {
        let known = references.iter().any(|reference| names(reference, citation));
        assert!(known, "{ARCHITECTURE} has no reference for {} {}", citation.0, citation.1);
    }
    for reference in references {
        let used = cited.iter().any(|citation| names(reference, citation));
        assert!(used, "nothing cites: {reference}");
    }
}

#[test]
fn citations_are_found() {
    let found = citations(
        "as in (Jensen 2001, Eq. 7.6), Steele et al. 2014; of Woop, Benthin and Wald 2013 but not in May 1, Pixel 2000x, \
         version 2000 or FLIP 2020.",
    );
    let expected = [("Jensen", "2001"), ("Steele", "2014"), ("Wald", "2013")];
    assert_eq!(found, expected.map(|(a, y)| (a.to_owned(), y.to_owned())).into());
}
