//! Photons in a kd-tree, density estimates, and the file that holds them.
//!
//! A [`PhotonSet`] is both the photons and their tree: their order is the tree. It is the same in memory and in a file,
//! so opening a map builds nothing and copies nothing. 12.9 bytes a photon, tree included.

mod build;
mod estimate;
mod file;
mod flux;
mod kernel;
mod leaf;
mod merge;
mod reach;
mod set;
mod shard;
mod sum;
mod traverse;

pub use build::{Loose, largest_flux};
pub use estimate::{Estimate, Gather, Scratch};
pub use file::{KIND, Metadata, PhotonMaps, VERSION};
pub use kernel::Kernel;
pub use merge::merge;
pub use reach::Reach;
pub use set::{LEAF, PhotonSet, StoredPhoton};
pub use shard::{PhotonShard, SHARD_KIND, SHARD_VERSION, ShardMetadata, save_shard};
