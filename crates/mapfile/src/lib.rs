//! The container of every map on disk: a text header for people, metadata, and arrays that are used where they lie.
//!
//! No input makes the reader panic, or allocate more than in proportion to the file (and a megabyte or two).
//!
//! ```text
//! #?tetralux-map 1                                the container's format
//! kind = "photon map"                             flat TOML; `head` shows it
//! version = 1                                     of the kind
//! endian = "little"
//! made_by = "photon-build 0.1.0"
//! command = "photon-build scene.toml -o a.photons --force"
//! inputs = "2d06800538d394c2"                     fingerprint of what it was made from
//! note.emitted = "1000000"                        any number of notes
//! metadata_bytes = 412
//! metadata_xxh3 = "6f5438f9357af597"
//! digest = "4b808ed17bebd427"                     xxh3-64 of all bytes above this line
//!                                                 one blank line
//! directory, metadata                             bincode 2, little-endian, fixed-size integers
//! zeros up to a multiple of 64, array             for each entry of the directory, in its order
//! ```
//!
//! The directory is a sequence of (name, bytes of an element, elements, offset from the start of the file, xxh3-64).
//! Nothing follows the last array. So every byte of a file is determined by what it holds, and a file in which any bit
//! differs from what was written is refused.
//!
//! Arrays never run through a serializer: the file is mapped into memory, verified once, and lent out as slices. This
//! assumes that nobody changes or shortens a map while it is in use. Programs of this project do not: they replace maps
//! by renaming, which leaves the mapped one alive under no name. Where others do nevertheless, it doesn't go unnoticed:
//! when bytes can't be had any more, since the file was shortened or its disk is gone, the process says so and ends
//! with 1 (a handler of SIGBUS); when they were overwritten, [`MapFile::check_untouched`] tells.
//!
//! ```
//! use mapfile::{MapFile, Section};
//!
//! # fn example(path: &std::path::Path, header: mapfile::Header) -> Result<(), mapfile::Error> {
//! let photons = vec![[0.5_f32; 4]; 1000];
//! let sections = [Section::new("photons", &photons)];
//! mapfile::write(path, atomic_file::Existing::Refuse, &header, &"metadata", &sections)?;
//!
//! let (map, metadata) = MapFile::open::<String>(path, "photon map", 1)?;
//! assert_eq!(*map.array::<[f32; 4]>("photons")?, *photons);
//! # Ok(())
//! # }
//! ```

#[cfg(target_endian = "big")]
compile_error!("maps hold little-endian arrays that are used in place");
#[cfg(not(target_pointer_width = "64"))]
compile_error!("maps are used in place, and may be larger than 32 bits can address");

mod array;
mod codec;
mod directory;
mod error;
mod header;
mod map;
mod read;
mod write;

pub use array::Array;
pub use error::Error;
pub use header::{Header, read_header};
pub use read::MapFile;
pub use write::{Section, write};
