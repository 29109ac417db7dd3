//! The files that are being written, so that a process in a hurry can take them with it.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::{Builder, TempPath};

use crate::Existing;

static PARTIAL: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Removes what is being written, for a process that ends before it is whole. Writing goes on, but nothing appears any
/// more under its name, and who tries waits for the end of the process.
pub fn abandon() {
    let files = lock();
    for file in files.iter() {
        // It may be gone, and nobody could do anything about it.
        let _ = fs::remove_file(file);
    }
    // Locked for good: nothing is begun or finished from here on.
    std::mem::forget(files);
}

/// A file that [`abandon`] removes, and that goes away when it is dropped.
pub(crate) struct Partial(Option<TempPath>);

impl Partial {
    /// A new file in a folder.
    pub(crate) fn new(builder: &Builder<'_, '_>, folder: &Path) -> io::Result<(File, Self)> {
        let mut files = lock();
        let (file, path) = builder.tempfile_in(folder)?.into_parts();
        files.push(path.to_path_buf());
        Ok((file, Self(Some(path))))
    }

    /// Gives the file its name, or says why that can't be.
    pub(crate) fn persist(mut self, target: &Path, existing: Existing) -> io::Result<()> {
        let mut files = lock();
        let Some(path) = self.0.take() else { return Ok(()) };
        files.retain(|file| **file != *path);
        match existing {
            Existing::Refuse => path.persist_noclobber(target),
            Existing::Replace => path.persist(target),
        }
        .map_err(|e| e.error)
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        if let Some(path) = self.0.take() {
            lock().retain(|file| **file != *path);
        }
    }
}

fn lock() -> MutexGuard<'static, Vec<PathBuf>> {
    PARTIAL.lock().unwrap_or_else(PoisonError::into_inner)
}
