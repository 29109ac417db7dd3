//! What can go wrong when a scene is read.

use std::path::{Path, PathBuf};

/// Why a scene was refused.
///
/// The messages hold their causes and the way out, so that one line says it all.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read.
    #[error("cannot read {}: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: String,
    },
    /// Something is wrong at one place of a text file: the scene file, or an OBJ or MTL file it names.
    #[error("{}:{line}:{column}: {fault}", path.display())]
    At {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// In characters, counted from 1.
        column: usize,
        /// What is wrong, and what to do about it.
        fault: String,
    },
    /// Something is wrong with a file, or with the scene, as a whole.
    #[error("{}: {fault}", path.display())]
    Whole {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do about it.
        fault: String,
    },
}

impl Error {
    /// Something is wrong at one place of a text file.
    pub(crate) fn at(path: &Path, line: usize, column: usize, fault: impl Into<String>) -> Self {
        Self::At { path: path.to_path_buf(), line, column, fault: one_line(fault.into()) }
    }

    /// Something is wrong with a file as a whole.
    pub(crate) fn whole(path: &Path, fault: impl Into<String>) -> Self {
        Self::Whole { path: path.to_path_buf(), fault: one_line(fault.into()) }
    }
}

/// Faults quote the file, which may hold anything.
fn one_line(text: String) -> String {
    if text.chars().any(char::is_control) {
        text.chars().map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c }).collect()
    } else {
        text
    }
}
