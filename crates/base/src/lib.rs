//! The nouns every pass shares: color, ray, component, pixel grid, random stream, fingerprint.
//!
//! Everything here is plain data and pure functions. Nothing touches a file, a clock or a thread.

mod color;
mod component;
mod fingerprint;
mod frame;
mod grid;
pub mod math;
mod octahedral;
mod photon;
mod random;
mod ray;
mod share;
mod sobol;
pub mod warp;
mod watch;
mod window;

pub use color::Rgb;
pub use component::{Component, Components};
pub use fingerprint::{Fingerprint, FingerprintBuilder, Inventory};
pub use frame::Frame;
pub use grid::{Grid, ImageSize, Pixel};
pub use octahedral::{decode_octahedral, encode_octahedral};
pub use photon::{Photon, PhotonClass};
pub use random::{Rng, Stream, hash_u64};
pub use ray::Ray;
pub use share::Share;
pub use sobol::{OwenSobol, SOBOL_DIMENSIONS};
pub use watch::{Interrupted, Watch};
pub use window::Window;
