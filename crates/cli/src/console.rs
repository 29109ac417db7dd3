//! Words for people, on standard error. A closed or full standard error is no reason to stop.

use std::fmt::Display;
use std::io::{self, Write};

use anyhow::bail;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::{Common, Verbosity};

/// Where a program says what it does.
#[derive(Clone, Copy, Debug)]
pub struct Console {
    program: &'static str,
    verbosity: Verbosity,
    is_strict: bool,
}

impl Console {
    /// The console of a program.
    pub fn new(program: &'static str, common: &Common) -> Self {
        Self { program, verbosity: common.verbosity(), is_strict: common.strict }
    }

    fn line(&self, text: &dyn Display) {
        // Nobody is left to be told if this fails.
        let _ = writeln!(io::stderr(), "{}: {}", self.program, one_line(&text.to_string()));
    }

    /// Something that the user should know, whatever the verbosity.
    ///
    /// # Errors
    /// The same, with `--strict`.
    pub fn warn(&self, text: impl Display) -> anyhow::Result<()> {
        if self.is_strict {
            bail!("{text} (a warning, but for --strict)");
        }
        self.line(&format_args!("warning: {text}"));
        Ok(())
    }

    /// What was done.
    pub fn say(&self, text: impl Display) {
        if self.verbosity != Verbosity::Quiet {
            self.line(&text);
        }
    }

    /// Details.
    pub fn detail(&self, text: impl Display) {
        if self.verbosity == Verbosity::Verbose {
            self.line(&text);
        }
    }

    /// A progress bar, drawn on a terminal only.
    pub fn progress(&self, what: &'static str, length: u64) -> ProgressBar {
        let bar = ProgressBar::new(length).with_message(what);
        if self.verbosity == Verbosity::Quiet {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        let style = ProgressStyle::with_template("{msg:10} {wide_bar} {percent:>3} % {eta:>4}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar
    }
}

/// Text made fit for a message: no line breaks, no codes that a terminal would obey. Names of files can hold both.
pub(crate) fn one_line(text: &str) -> String {
    let mut line = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_control() { line.extend(c.escape_default()) } else { line.push(c) }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_stays_a_line() {
        assert_eq!(one_line("no `é\n\u{1b}[2J`"), "no `é\\n\\u{1b}[2J`");
    }
}
