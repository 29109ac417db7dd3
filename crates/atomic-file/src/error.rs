//! What can go wrong, divided by what the user can do about it.

use std::io;
use std::path::PathBuf;

/// Why an output was not, or would not be, written.
///
/// The messages hold their causes, so that one line says it all.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The system refused.
    #[error("cannot {action} {}: {cause}", path.display())]
    Io {
        /// What was to be done, such as "write".
        action: &'static str,
        /// The output.
        path: PathBuf,
        /// What the system said.
        cause: io::Error,
    },
    /// The output exists and may not be replaced.
    #[error("{} exists; give another name or --force to replace it", path.display())]
    Exists {
        /// The output.
        path: PathBuf,
    },
    /// The folder of the output does not exist, or is none.
    #[error("cannot write {}: there is no folder {}; create it or give another name", path.display(), folder.display())]
    NoFolder {
        /// The output.
        path: PathBuf,
        /// The folder that would hold it.
        folder: PathBuf,
    },
    /// The output is a folder.
    #[error("cannot write {}: it is a folder; add the name of a file", path.display())]
    IsFolder {
        /// The output.
        path: PathBuf,
    },
    /// The name is empty.
    #[error("the name of an output is empty; give one")]
    NoName,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_say_what_to_do() {
        let path = PathBuf::from("out/a.exr");
        let cause = io::Error::from(io::ErrorKind::StorageFull);
        assert_eq!(
            Error::Io { action: "write", path: path.clone(), cause }.to_string(),
            "cannot write out/a.exr: no storage space"
        );
        assert_eq!(
            Error::Exists { path: path.clone() }.to_string(),
            "out/a.exr exists; give another name or --force to replace it"
        );
        assert_eq!(
            Error::NoFolder { path: path.clone(), folder: "out".into() }.to_string(),
            "cannot write out/a.exr: there is no folder out; create it or give another name"
        );
        assert_eq!(
            Error::IsFolder { path }.to_string(),
            "cannot write out/a.exr: it is a folder; add the name of a file"
        );
    }
}
