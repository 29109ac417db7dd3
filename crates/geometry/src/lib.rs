//! Surfaces in, nearest hit out.
//!
//! Triangles and spheres lie in one eight-wide BVH behind [`Accel`], which obvhs builds. The triangle test is
//! watertight, and a ray that leaves a surface starts at an origin moved by a bound on the rounding errors
//! ([`Surface::leave`]): there is no absolute epsilon, so scenes of any size and place behave the same.
//!
//! Only this crate names obvhs.

mod accel;
mod bounds;
mod corner_normals;
mod crease;
mod frustum;
mod memory;
mod mesh;
mod node;
mod primitive;
mod shaft;
mod surface;
mod traverse;

pub use accel::{Accel, Hit, Target, sphere_uv};
pub use bounds::Bounds;
pub use crease::{Crease, Creases};
pub use frustum::Frustum;
pub use memory::Memory;
pub use mesh::{MaterialId, Mesh, Sphere};
pub use node::MAX_PRIMITIVES;
pub use shaft::{Patch, Plane};
pub use surface::{MAX_SHADING_GAIN, Surface};
