//! Outputs appear whole or not at all.
//!
//! A file is written under another name in its folder, synced and renamed. Whoever looks sees the old file or the
//! whole new one; whatever fails on the way leaves the old one as it was, and nothing beside it.
//!
//! ```no_run
//! use std::io::Write;
//! use std::path::Path;
//!
//! use atomic_file::Existing;
//!
//! let path = Path::new("picture.exr");
//! atomic_file::check(path, Existing::Refuse)?; // Before the hours of work.
//! atomic_file::write(path, Existing::Refuse, |out| out.write_all(b"pixels"))?;
//! # Ok::<(), atomic_file::Error>(())
//! ```

mod error;
mod partial;
mod target;
mod write;

pub use error::Error;
pub use partial::abandon;
pub use target::{Existing, check};
pub use write::write;
