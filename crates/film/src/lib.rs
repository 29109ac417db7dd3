//! Pictures as files, and what tells two pictures apart.
//!
//! - The same picture gives the same bytes, on any number of threads.
//! - Files are read without trust: a damaged or hostile one gives an error that names it, never a panic, and memory in
//!   proportion to its size.
//! - Values are linear Rec. 709 everywhere but inside PNG files and inside FLIP.
//! - Parallel work runs in the rayon pool of the caller. No other threads are started.
//!
//! ```no_run
//! use std::path::Path;
//!
//! use base::{Grid, ImageSize, Rgb};
//! use film::{Existing, Picture};
//!
//! let size = ImageSize { width: 2, height: 1 };
//! let mut picture = Picture::new(size, r#"{"seed": 0}"#.into());
//! picture.push_rgb("", &Grid::from_fn(size, |_| Rgb::ONE));
//! picture.push_rgb("direct", &Grid::from_fn(size, |_| Rgb::splat(0.5)));
//! film::write_exr(Path::new("picture.exr"), Existing::Refuse, &picture)?;
//! # Ok::<(), film::Error>(())
//! ```

mod assemble;
mod difference;
mod error;
mod flip;
mod format;
mod magma;
mod part;
mod picture;
mod read_exr;
mod reconstruct;
mod srgb;
mod write_exr;
mod write_png;
mod zip;

pub use assemble::{assemble_exr, assemble_rgb};
pub use atomic_file::Existing;
pub use difference::{Difference, FlipStats, compare};
pub use error::Error;
pub use flip::{flip, flip_of_colors};
pub use format::Format;
pub use magma::flip_picture;
pub use part::Part;
pub use picture::Picture;
pub use read_exr::{read_exr, read_rgb};
pub use reconstruct::{Filter, reconstruct};
pub use srgb::decode as decode_srgb;
pub use write_exr::{PackedRows, write_exr, write_packed_exr};
pub use write_png::write_png;
pub use zip::LINES as BLOCK_ROWS;
