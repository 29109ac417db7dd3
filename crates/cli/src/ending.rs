//! How a program ends.

use std::fmt;
use std::io::{self, Write};
use std::process::ExitCode;

use base::Interrupted;

/// A command line that parses but makes no sense.
#[derive(Debug)]
pub struct WrongUsage(pub String);

impl fmt::Display for WrongUsage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for WrongUsage {}

/// Says in one line what went wrong, if anything did. 0 done, 1 failed, 2 wrong usage, 130 after Ctrl-C.
pub fn finish(program: &str, result: anyhow::Result<()>) -> ExitCode {
    let Err(error) = result else { return ExitCode::SUCCESS };
    let _ = writeln!(io::stderr(), "{program}: {error:#}");
    if error.is::<Interrupted>() {
        ExitCode::from(130)
    } else if error.is::<WrongUsage>() {
        ExitCode::from(2)
    } else {
        ExitCode::FAILURE
    }
}
