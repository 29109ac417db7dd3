//! Where an output really goes, and whether it may.

use std::fs::{self, Metadata, Permissions};
use std::io;
use std::path::{Path, PathBuf};

use crate::Error;

/// What to do when the output exists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// Leave it alone and fail.
    Refuse,
    /// Put the new one in its place.
    Replace,
}

/// Whether [`write`](crate::write) would start: to be asked before hours of work.
///
/// The folder must exist and take new files, and the output must not be a folder, nor exist unless it may be replaced.
///
/// # Errors
/// Those of [`write`](crate::write), as far as they can be known beforehand.
pub fn check(path: &Path, existing: Existing) -> Result<(), Error> {
    match Target::find(path, existing)? {
        Target::Device => Ok(()),
        // The surest way to know whether a folder takes a file. This one has no name where the system allows that.
        Target::File { folder, .. } => match tempfile::tempfile_in(folder) {
            Ok(_) => Ok(()),
            Err(cause) => {
                Err(Error::Io { action: "create", path: path.into(), cause: bare(&cause) })
            }
        },
    }
}

/// Where the bytes of an output go.
pub(crate) enum Target {
    /// Something that is neither a file nor a folder: a device, a pipe, a terminal. It cannot be replaced, only written to.
    Device,
    /// A file, old or new.
    File {
        /// The name at the end of all links.
        path: PathBuf,
        /// The folder of `path`.
        folder: PathBuf,
        /// Permissions of the old file.
        permissions: Option<Permissions>,
    },
}

impl Target {
    pub(crate) fn find(path: &Path, existing: Existing) -> Result<Self, Error> {
        if path.as_os_str().is_empty() {
            return Err(Error::NoName);
        }
        let old = metadata(path)?;
        let ends_like_a_folder =
            path.file_name().is_none() || path.to_string_lossy().ends_with(std::path::is_separator);
        if ends_like_a_folder || old.as_ref().is_some_and(Metadata::is_dir) {
            return Err(Error::IsFolder { path: path.into() });
        }
        if old.is_some() && existing == Existing::Refuse {
            return Err(Error::Exists { path: path.into() });
        }
        if old.as_ref().is_some_and(|old| !old.is_file()) {
            return Ok(Self::Device);
        }
        let target = follow(path);
        let folder = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
            _ => PathBuf::from("."),
        };
        if !metadata(&folder)?.is_some_and(|folder| folder.is_dir()) {
            return Err(Error::NoFolder { path: path.into(), folder });
        }
        Ok(Self::File { path: target, folder, permissions: old.map(|old| old.permissions()) })
    }
}

/// An error without the name of a temporary file, which says nothing to anyone.
pub(crate) fn bare(error: &io::Error) -> io::Error {
    error.kind().into()
}

/// What `path` leads to, if anything.
fn metadata(path: &Path) -> Result<Option<Metadata>, Error> {
    match fs::metadata(path) {
        Ok(metadata) => Ok(Some(metadata)),
        Err(e) if matches!(e.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => {
            Ok(None)
        }
        Err(cause) => Err(Error::Io { action: "look at", path: path.into(), cause }),
    }
}

/// The name at the end of the links that start at `path`, whether or not it exists.
fn follow(path: &Path) -> PathBuf {
    let mut path = path.to_path_buf();
    // A chain this long is a loop, which the system has reported by now.
    for _ in 0..40 {
        let Ok(next) = fs::read_link(&path) else { break };
        path = path.parent().unwrap_or(Path::new("")).join(next);
    }
    path
}
