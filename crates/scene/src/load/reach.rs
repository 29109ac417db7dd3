//! What a scene may make the program read.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Where files may lie that a scene names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Reach {
    /// Anywhere.
    Everything,
    /// In a folder and those below, as they really are: links are followed before it is asked.
    Within(PathBuf),
}

impl Reach {
    /// The folder of a scene file, and nothing else.
    pub(super) fn beside(scene: &Path) -> Self {
        let folder = match scene.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        // What isn't there is refused when it is read.
        Self::Within(fs::canonicalize(folder).unwrap_or_else(|_| folder.into()))
    }

    /// All bytes of a regular file, or the reason in words.
    pub(super) fn bytes(&self, path: &Path) -> Result<Vec<u8>, String> {
        let path = self.real(path)?;
        let kind = fs::metadata(&path).map_err(words)?;
        if kind.is_dir() {
            return Err("it is a folder; add the name of a file".into());
        }
        // A device may never end.
        if !kind.is_file() {
            return Err("it is not a regular file".into());
        }
        fs::read(path).map_err(words)
    }

    /// Where a file is to be read, or why it isn't, in words. Without a limit that is the path as it was given; else it
    /// holds no links.
    pub(super) fn real(&self, path: &Path) -> Result<PathBuf, String> {
        let Self::Within(folder) = self else { return Ok(path.into()) };
        let real = fs::canonicalize(path).map_err(words)?;
        if real.starts_with(folder) {
            return Ok(real);
        }
        Err("it lies outside the folder of the scene, where nothing is read with --no-external; \
             copy it there, or leave that option out if you trust the scene"
            .into())
    }
}

fn words(error: io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => "there is no such file".into(),
        io::ErrorKind::PermissionDenied => "permission denied".into(),
        _ => error.to_string(),
    }
}
