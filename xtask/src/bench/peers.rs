//! Programs in C++ that do with other libraries what our benchmarks do: see `xtask/peers`.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use anyhow::Context;

use crate::programs::root;

/// A program, what it is linked with, and the package of Debian that has its library.
struct Program {
    name: &'static str,
    /// Any of these will do.
    libraries: &'static [&'static [&'static str]],
    package: &'static str,
}

const PROGRAMS: [Program; 2] = [
    Program {
        name: "embree",
        libraries: &[&["-lembree4"], &["-lembree3"]],
        package: "libembree-dev",
    },
    Program { name: "nanoflann", libraries: &[&[]], package: "libnanoflann-dev" },
];

/// Compiles those whose libraries are there, for the machine that they run on. Those whose aren't are left out, and
/// named. Returns their folder.
///
/// # Errors
/// When there can't be such a folder.
#[expect(clippy::print_stderr, reason = "what is left out is told beside the results")]
pub(crate) fn compile() -> anyhow::Result<PathBuf> {
    let folder = root().join("target/bench/peers");
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    for Program { name, libraries, package } in PROGRAMS {
        let program = folder.join(name);
        // One of an earlier time may be of another source.
        if program.exists() {
            fs::remove_file(&program)
                .with_context(|| format!("cannot remove {}", program.display()))?;
        }
        let source = root().join("xtask/peers").join(name).with_extension("cpp");
        let compile = |libraries: &&[&str]| -> Option<Output> {
            let mut compiler = Command::new("c++");
            compiler.args(["-std=c++17", "-O3", "-march=native", "-o"]).args([&program, &source]);
            compiler.args(*libraries).output().ok()
        };
        let is_there = |output: Output| output.status.success();
        if !libraries.iter().any(|libraries| compile(libraries).is_some_and(is_there)) {
            eprintln!(
                "xtask: {name} is left out: it doesn't compile here; it needs a C++ compiler as `c++`, and {package}"
            );
        }
    }
    Ok(folder)
}
