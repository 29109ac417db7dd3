//! What sources may not hold.

use super::{code, has_word, packages, root, sources};

/// The longest file, in lines.
const MAX_LINES: usize = 600;

/// The crates that talk to people and to the system. All others are stages, or shared by them.
const PROGRAMS: [&str; 3] = ["cli", "photon-build", "render-cached"];

/// What stages leave to the programs: printing, the clock, the environment, the command line.
const NOT_IN_STAGES: [&str; 9] = [
    "print!",
    "println!",
    "eprint!",
    "eprintln!",
    "std::env",
    "std::process",
    "std::time",
    "stdout",
    "stderr",
];

/// What nothing may hold, since the same inputs must give the same bytes.
const NOT_IN_CRATES: [&str; 4] = ["SystemTime", "RandomState", "ThreadId", "todo!"];

#[test]
fn only_mapping_a_file_is_unsafe() {
    for package in packages().values().filter(|p| p.name != "pipeline-tests") {
        for (path, text) in sources(&package.folder) {
            if path.ends_with("mapfile/src/map.rs") {
                continue;
            }
            let line = text.lines().find(|line| {
                let line = line.split("//").next().unwrap_or_default();
                has_word(line, "unsafe") || has_word(line, "unsafe_code")
            });
            assert!(line.is_none(), "{}: {}", path.display(), line.unwrap().trim());
        }
    }
}

#[test]
fn unsafe_code_says_why_it_is_safe() {
    let path = root().join("crates/mapfile/src/map.rs");
    let text = std::fs::read_to_string(path).unwrap();
    let n_blocks = code(&text).filter(|line| has_word(line, "unsafe")).count();
    assert!(n_blocks > 0 && text.matches("// SAFETY: ").count() >= n_blocks);
}

#[test]
fn stages_neither_print_nor_ask() {
    for package in packages().values().filter(|p| p.folder.starts_with("crates")) {
        let is_stage = !PROGRAMS.contains(&package.name.as_str());
        let words = NOT_IN_STAGES.iter().filter(|_| is_stage).chain(&NOT_IN_CRATES);
        let files = sources(package.folder.join("src"));
        for word in words {
            for (path, text) in &files {
                let line = code(text).find(|line| has_word(line, word));
                assert!(line.is_none(), "{}: {}", path.display(), line.unwrap().trim());
            }
        }
    }
}

#[test]
fn files_are_short() {
    for folder in ["crates", "tests", "xtask"] {
        for (path, text) in sources(folder) {
            let n = text.lines().count();
            assert!(n <= MAX_LINES, "{} has {n} lines; split it by ideas", path.display());
        }
    }
}

#[test]
fn files_begin_with_what_they_are() {
    for folder in ["crates", "tests", "xtask"] {
        for (path, text) in sources(folder) {
            let opening: Vec<&str> =
                text.lines().map_while(|line| line.strip_prefix("//! ")).collect();
            let opening = opening.join(" ");
            let is_sentence = opening.contains(['.', ':']);
            assert!(is_sentence, "{} begins with {opening:?}", path.display());
        }
    }
}
