//! What sources may not hold.

use super::{code, has_word, packages, root, sources};

/// The longest file, in lines.
const MAX_LINES: usize = 600;

/// The crate that knows how programs talk to people and to the system.
const CLI: &str = "cli";

/// The crates that may use it. All others are stages, or shared by them.
const PROGRAMS: [&str; 2] = ["photon-build", "render-cached"];

/// What programs leave to it: the clock, the environment, and words for people.
const NOT_IN_PROGRAMS: [&str; 6] =
    ["print!", "println!", "eprint!", "eprintln!", "std::env", "std::time"];

/// What stages leave to the programs, besides: results on standard output, the end of the process.
const NOT_IN_STAGES: [&str; 3] = ["std::process", "stdout", "stderr"];

/// What nothing may hold, since the same inputs must give the same bytes.
const NOT_IN_CRATES: [&str; 4] = ["SystemTime", "RandomState", "ThreadId", "todo!"];

/// The modules that hold unsafe code: one maps a file, two use instructions that not all processors have.
const UNSAFE: [&str; 3] = [
    "crates/mapfile/src/map.rs",
    "crates/geometry/src/traverse/avx2.rs",
    "crates/photon-map/src/leaf/avx2.rs",
];

#[test]
fn unsafe_code_stands_in_its_modules() {
    for package in packages().values().filter(|p| p.name != "pipeline-tests") {
        for (path, text) in sources(&package.folder) {
            if UNSAFE.iter().any(|module| path.ends_with(module)) {
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
    for module in UNSAFE {
        let text = std::fs::read_to_string(root().join(module)).unwrap();
        let n_blocks = code(&text).filter(|line| has_word(line, "unsafe")).count();
        assert!(n_blocks > 0 && text.matches("// SAFETY: ").count() >= n_blocks, "{module}");
    }
}

#[test]
fn stages_neither_print_nor_ask() {
    for package in packages().values().filter(|p| p.folder.starts_with("crates")) {
        let name = package.name.as_str();
        let words = match name {
            CLI => Vec::new(),
            _ if PROGRAMS.contains(&name) => NOT_IN_PROGRAMS.to_vec(),
            _ => [NOT_IN_PROGRAMS.as_slice(), &NOT_IN_STAGES].concat(),
        };
        for (path, text) in sources(package.folder.join("src")) {
            for word in words.iter().chain(&NOT_IN_CRATES) {
                let line = code(&text).find(|line| has_word(line, word));
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
