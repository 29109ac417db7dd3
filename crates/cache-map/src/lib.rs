//! The paper: sample a few pixels, interpolate the rest, one component at a time.
//!
//! This crate knows pixels and surface points; no rays, no scene, no photons. Whoever uses it shades the pixels that it
//! names. The steps, each a function, so that each can be timed alone:
//!
//! 1. [`choose_pixels`]: the low-resolution samples (section III-B);
//! 2. [`CacheMap::record`]: their radiance goes into the cache map (section III-C);
//! 3. [`CacheMap::plan`]: the pixels for which no candidate fits, Eqs. (9) to (12); they are shaded and recorded too;
//! 4. [`CacheMap::interpolate`]: all others, Eq. (3).
//!
//! # Reading the paper
//!
//! - Eqs. (9) to (11) accept a candidate if `w < tau`, but `w` of Eq. (2) grows as points approach, and the text asks for
//!   a "sufficiently high weight". We test the error `epsilon = 1 / w < tau`.
//! - Candidates are pixels that were computed: the samples, and those traced before in the same tile, in the order of
//!   rows (a tile is 64x64 pixels, so that the picture doesn't depend on threads). Interpolated pixels never are.
//! - The caustics rule, Eq. (12), asks the samples only, so that it doesn't depend on what tracing has found.
//! - With all three thresholds 0 nothing is interpolated, caustics included.

mod calm;
mod candidates;
mod file;
mod lattice;
mod layer;
mod map;
mod nearest;
mod plan;
mod record_file;
mod records;
mod refine;
mod sampling;
mod spaced;
mod weight;

pub use candidates::TILE;
pub use file::{KIND, Saved, VERSION};
pub use lattice::{Lattice, same_surface};
pub use layer::{Layer, Reason, Value};
pub use map::{CacheMap, Origin, SurfacePoint};
pub use plan::Thresholds;
pub use record_file::{RECORDS_KIND, RECORDS_VERSION, RecordSet};
pub use records::{Nearby, RecordIndex, RecordPoint, Records};
pub use refine::{Rule, Tolerance, Trace, refine};
pub use sampling::{choose_pixels, choose_pixels_in};
pub use spaced::{Steps, refine_spaced};
pub use weight::error_between;
