//! What can be wrong with a map, divided by what the user can do about it.

use std::fmt::{self, Write};
use std::io;
use std::path::PathBuf;

/// Why a map was not read or written.
///
/// The messages hold their causes, so that one line says it all.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The system did not let us read.
    #[error("cannot read {}: {cause}", path.display())]
    Read {
        /// The map.
        path: PathBuf,
        /// What the system said.
        cause: io::Error,
    },
    /// The map was not written.
    #[error(transparent)]
    Write(#[from] atomic_file::Error),
    /// The text or the metadata is too long for a reader that guards its memory.
    #[error("cannot write {}: its {part} takes {bytes} bytes, and {limit} are the most", path.display())]
    TooLarge {
        /// The map.
        path: PathBuf,
        /// "header" or "metadata".
        part: &'static str,
        /// Its size.
        bytes: usize,
        /// The largest size there may be.
        limit: usize,
    },
    /// Something else than a map.
    #[error("{} is not a map: its first line is not `#?tetralux-map`; check the name", path.display())]
    NotAMap {
        /// The file.
        path: PathBuf,
    },
    /// A map in a container that this program does not know.
    #[error("{} is a map of format {found}, and this program reads format {}; use the program that made it, or make it anew", path.display(), crate::header::FORMAT)]
    OtherFormat {
        /// The map.
        path: PathBuf,
        /// Its format.
        found: u32,
    },
    /// A map of another kind.
    #[error("{} is of kind `{}`, not `{expected}`; it was made with: {}", path.display(), OneLine(found), OneLine(command))]
    OtherKind {
        /// The map.
        path: PathBuf,
        /// Its kind.
        found: String,
        /// The kind asked for.
        expected: String,
        /// The command that made it.
        command: String,
    },
    /// A map of a version of its kind that this program does not know.
    #[error("{}", version_message(path, *found, *expected, remedy))]
    OtherVersion {
        /// The map.
        path: PathBuf,
        /// Its version.
        found: u32,
        /// The version asked for.
        expected: u32,
        /// The command that makes it anew.
        remedy: String,
    },
    /// A map that is not as it was written.
    #[error("{}", corrupt_message(path, what, *offset, remedy.as_deref()))]
    Corrupt {
        /// The map.
        path: PathBuf,
        /// What is wrong.
        what: String,
        /// The byte where that begins, where it has a place.
        offset: Option<u64>,
        /// The command that makes it anew, if the header can still be trusted.
        remedy: Option<String>,
    },
    /// A map that somebody has written to while it was in use.
    #[error("{} was changed while it was in use, so what was made with it is not to be trusted; put it back or make it anew, and start again", path.display())]
    Touched {
        /// The map.
        path: PathBuf,
    },
    /// A map made from inputs that have changed since.
    #[error("{} is stale: {}; make it anew with: {}", path.display(), list(changes), OneLine(remedy))]
    Stale {
        /// The map.
        path: PathBuf,
        /// One phrase per part that changed.
        changes: Vec<String>,
        /// The command that makes it anew.
        remedy: String,
    },
}

fn version_message(path: &std::path::Path, found: u32, expected: u32, remedy: &str) -> String {
    let (age, way_out) =
        if found < expected { ("older", "") } else { ("newer", "use a newer program, or ") };
    let (path, remedy) = (path.display(), OneLine(remedy));
    format!(
        "{path} has version {found}, {age} than the version {expected} that this program reads; {way_out}make it anew with: {remedy}"
    )
}

fn corrupt_message(
    path: &std::path::Path,
    what: &str,
    offset: Option<u64>,
    remedy: Option<&str>,
) -> String {
    let place = offset.map(|offset| format!(" (byte {offset})")).unwrap_or_default();
    let remedy = remedy
        .map(|command| format!("make it anew with: {}", OneLine(command)))
        .unwrap_or("make it anew".into());
    format!("{} is damaged: {}{place}; {remedy}", path.display(), OneLine(what))
}

/// The first few of `changes`, and how many more there are.
fn list(changes: &[String]) -> String {
    const SHOWN: usize = 5;
    let shown: Vec<String> = changes.iter().take(SHOWN).map(|c| OneLine(c).to_string()).collect();
    let shown = shown.join(", ");
    match changes.len().saturating_sub(SHOWN) {
        0 => shown,
        more => format!("{shown}, and {more} more"),
    }
}

/// Text from a file, made fit for a message: no line breaks, no codes that a terminal would obey.
struct OneLine<'a>(&'a str);

impl fmt::Display for OneLine<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.chars().try_for_each(|c| {
            if c.is_control() { write!(f, "{}", c.escape_default()) } else { f.write_char(c) }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_say_what_to_do() {
        let path = || PathBuf::from("a.photons");
        let remedy = || String::from("photon-build s.toml -o a.photons --force");
        let says = |error: Error, message: &str| assert_eq!(error.to_string(), message);
        says(
            Error::Read { path: path(), cause: io::ErrorKind::NotFound.into() },
            "cannot read a.photons: entity not found",
        );
        says(
            Error::TooLarge { path: path(), part: "header", bytes: 70_000, limit: 65_536 },
            "cannot write a.photons: its header takes 70000 bytes, and 65536 are the most",
        );
        says(
            Error::NotAMap { path: path() },
            "a.photons is not a map: its first line is not `#?tetralux-map`; check the name",
        );
        says(
            Error::OtherFormat { path: path(), found: 2 },
            "a.photons is a map of format 2, and this program reads format 1; \
             use the program that made it, or make it anew",
        );
        says(
            Error::OtherKind {
                path: path(),
                found: "cache map".into(),
                expected: "photon map".into(),
                command: "render-cached s.toml".into(),
            },
            "a.photons is of kind `cache map`, not `photon map`; it was made with: render-cached s.toml",
        );
        says(
            Error::OtherVersion { path: path(), found: 1, expected: 2, remedy: remedy() },
            "a.photons has version 1, older than the version 2 that this program reads; \
             make it anew with: photon-build s.toml -o a.photons --force",
        );
        says(
            Error::OtherVersion { path: path(), found: 3, expected: 2, remedy: remedy() },
            "a.photons has version 3, newer than the version 2 that this program reads; use a newer \
             program, or make it anew with: photon-build s.toml -o a.photons --force",
        );
        says(
            Error::Corrupt { path: path(), what: "a\nb".into(), offset: None, remedy: None },
            "a.photons is damaged: a\\nb; make it anew",
        );
        says(
            Error::Corrupt {
                path: path(),
                what: "section `tree` does not match its digest".into(),
                offset: Some(640),
                remedy: Some(remedy()),
            },
            "a.photons is damaged: section `tree` does not match its digest (byte 640); \
             make it anew with: photon-build s.toml -o a.photons --force",
        );
    }

    #[test]
    fn many_changes_are_counted() {
        let stale = |n| Error::Stale {
            path: "a".into(),
            changes: (0..n).map(|i| format!("mesh {i} changed")).collect(),
            remedy: "x".into(),
        };
        assert_eq!(stale(1).to_string(), "a is stale: mesh 0 changed; make it anew with: x");
        assert!(
            stale(5).to_string().ends_with("mesh 3 changed, mesh 4 changed; make it anew with: x")
        );
        assert!(stale(7).to_string().contains("mesh 4 changed, and 2 more; make it anew"));
    }
}
