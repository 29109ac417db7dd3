//! The writing itself.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Seek};
use std::path::Path;

use crate::partial::Partial;
use crate::target::{Target, bare};
use crate::{Error, Existing};

/// Writes what `content` writes to `path`, whole or not at all. Returns the number of bytes.
///
/// A new file gets the permissions that the user's mask allows, a replaced one keeps those it had. Symbolic links are
/// followed: the link stays, and what it points to is created or replaced, under the same rules. Devices, pipes and
/// terminals cannot be replaced: what `content` writes is collected in a temporary file, and copied to them if it ends well.
///
/// # Errors
/// When `path` is a folder or lies in none, when it exists and `existing` refuses, when `content` fails, or when the
/// system does.
pub fn write(
    path: &Path,
    existing: Existing,
    content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<u64, Error> {
    let failed_to = |action| move |cause| Error::Io { action, path: path.into(), cause };
    match Target::find(path, existing)? {
        Target::Device => {
            let collected = tempfile::tempfile()
                .map_err(|e| bare(&e))
                .map_err(failed_to("collect what goes to"))?;
            let mut collected = fill(collected, content).map_err(failed_to("write"))?;
            // Opened last: to open a pipe is to wait for its reader.
            let mut device =
                OpenOptions::new().write(true).open(path).map_err(failed_to("open"))?;
            collected.rewind().map_err(failed_to("write"))?;
            io::copy(&mut collected, &mut device).map_err(failed_to("write"))
        }
        Target::File { path: target, folder, permissions } => {
            let mut builder = tempfile::Builder::new();
            builder.prefix(".").suffix(".partial");
            #[cfg(unix)]
            builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
            // Dropped before it is renamed, a temporary file is removed.
            let (file, partial) = Partial::new(&builder, &folder)
                .map_err(|e| bare(&e))
                .map_err(failed_to("create"))?;
            let file = fill(file, content).map_err(failed_to("write"))?;
            if let Some(permissions) = permissions {
                file.set_permissions(permissions).map_err(failed_to("set the permissions of"))?;
            }
            file.sync_all().map_err(failed_to("write"))?;
            let bytes = file.metadata().map_err(failed_to("write"))?.len();
            partial.persist(&target, existing).map_err(|cause| match cause.kind() {
                // It came into being while `content` was written.
                io::ErrorKind::AlreadyExists => Error::Exists { path: path.into() },
                _ => failed_to("rename the finished file to")(cause),
            })?;
            // Makes the new name survive a loss of power. Where folders cannot be synced, the file still is in its place.
            let _ = File::open(&folder).and_then(|folder| folder.sync_all());
            Ok(bytes)
        }
    }
}

/// `file` with what `content` writes.
fn fill(
    file: File,
    content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<File> {
    let mut out = BufWriter::with_capacity(1 << 16, file);
    content(&mut out)?;
    out.into_inner().map_err(io::IntoInnerError::into_error)
}
