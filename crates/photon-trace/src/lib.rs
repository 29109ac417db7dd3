//! Pass 1: follow photons from the lights, say where they land.
//!
//! A photon is stored at every diffuse surface it meets, with its class: *direct* if nothing happened to it before,
//! *caustic* if it came through specular bounces only, *indirect* if it was scattered diffusely before. A specular bounce
//! is one by a mirror, metal or glass, however rough: there is no threshold. The three sets are disjoint; their union is Jensen's global map.
//!
//! Russian roulette decides at every surface, with the flux rescaled, so no length of path is favored. Photon `i` of a
//! light owns its random streams: neither threads nor the order of work can change the result.
//!
//! Some photons may be aimed at specular surfaces (`aim.rs`): where these are a small part of the scene, few photons would
//! find them by chance.

mod aim;
mod budget;
mod trace;

pub use budget::{Budget, photons_of_lights, share_out};
pub use trace::{Account, Config, Energy, Keeper, Traced, trace, trace_kept, trace_share};
