//! Words for people, on standard error. A closed or full standard error is no reason to stop.

use std::fmt::Display;
use std::io::{self, Write};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::Verbosity;

/// Where a program says what it does.
#[derive(Clone, Copy, Debug)]
pub struct Console {
    program: &'static str,
    verbosity: Verbosity,
}

impl Console {
    /// The console of a program.
    pub fn new(program: &'static str, verbosity: Verbosity) -> Self {
        Self { program, verbosity }
    }

    fn line(&self, text: &dyn Display) {
        // Nobody is left to be told if this fails.
        let _ = writeln!(io::stderr(), "{}: {text}", self.program);
    }

    /// Something that the user should know, whatever the verbosity.
    pub fn warn(&self, text: impl Display) {
        self.line(&format_args!("warning: {text}"));
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
