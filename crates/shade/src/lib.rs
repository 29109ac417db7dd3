//! Pass 2: the four components of Eq. (8) at the place where an eye ray arrives, one file a component.
//!
//! Every function gives the radiance of one component towards the eye. What is random draws from the stream of the
//! pixel, so a component evaluated alone, twice, or on another thread is the same to the bit.

mod caustic;
mod chain;
mod coverage;
mod direct;
mod gather;
mod glossy;
mod indirect;
mod irradiance_points;
mod lights;
mod path;
mod point;
#[cfg(test)]
mod seen;
mod shader;
mod specular;
mod spots;
mod work;

pub use chain::{ChainEmission, ChainLeaf};
pub use irradiance_points::{GatherPhotons, GatherPlace, IrradianceAhead};
pub use path::Path;
pub use point::{PixelStream, ShadingPoint};
pub use shader::{Settings, Shader};
pub use work::{Counts, Work};
