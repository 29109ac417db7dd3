//! How a program begins and ends.

use std::fmt;
use std::io::{self, Write};
use std::process::ExitCode;

use base::Interrupted;

use crate::console::one_line;

/// A command line that parses but makes no sense.
#[derive(Debug)]
pub struct WrongUsage(pub String);

impl fmt::Display for WrongUsage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for WrongUsage {}

/// Reads the command line, does what it asks for, and says in one line what went wrong, if anything did.
///
/// 0 done, 1 failed, 2 wrong usage, 130 after Ctrl-C.
pub fn run<A: clap::Parser>(
    program: &str,
    work: impl FnOnce(&A) -> anyhow::Result<()>,
) -> ExitCode {
    let result = match A::try_parse() {
        Ok(args) => work(&args),
        Err(error) if error.use_stderr() => {
            Err(WrongUsage(without_usage(&error.to_string())).into())
        }
        Err(help) => {
            // Nobody is left to be told if this fails.
            let _ = help.print();
            return ExitCode::SUCCESS;
        }
    };
    let Err(error) = result else { return ExitCode::SUCCESS };
    let _ = writeln!(io::stderr(), "{program}: {}", one_line(&format!("{error:#}")));
    if error.is::<Interrupted>() {
        ExitCode::from(130)
    } else if error.is::<WrongUsage>() {
        ExitCode::from(2)
    } else {
        ExitCode::FAILURE
    }
}

/// The parts of a message of clap's that say what is wrong, on one line.
fn without_usage(message: &str) -> String {
    let is_fault = |paragraph: &&str| {
        !paragraph.starts_with("Usage:") && !paragraph.starts_with("For more information")
    };
    let on_one_line = |paragraph: &str| {
        let lines: Vec<_> = paragraph.lines().map(str::trim).collect();
        lines.join(" ")
    };
    let message = message.strip_prefix("error: ").unwrap_or(message);
    let mut parts: Vec<_> = message.split("\n\n").filter(is_fault).map(on_one_line).collect();
    parts.push("try --help".into());
    parts.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usage_is_left_to_the_help() {
        let message = "error: unexpected argument '--sed' found\n\n  tip: a similar argument exists: '--seed'\n\n\
            Usage: photon-build <SCENE>\n\nFor more information, try '--help'.\n";
        assert_eq!(
            without_usage(message),
            "unexpected argument '--sed' found; tip: a similar argument exists: '--seed'; try --help"
        );
        let message = "error: required arguments were not provided:\n  --output <FILE>\n  <SCENE>\n\nUsage: x\n";
        assert_eq!(
            without_usage(message),
            "required arguments were not provided: --output <FILE> <SCENE>; try --help"
        );
    }
}
