//! The world, read once, then immutable: surfaces, materials, textures, lights, camera.
//!
//! A scene file describes the world only; every quality setting is a flag of a program. Units are the author's, as long
//! as they agree; y is up by convention only. Colors are linear Rec. 709.
//!
//! Only this crate reads scene files, and only it names tobj and quick-xml.

mod area_light;
mod bright_cells;
mod camera;
mod coat;
mod environment_map;
mod error;
mod fresnel;
mod ggx;
mod irradiance_table;
mod light;
mod light_view;
mod load;
mod lobe;
mod material;
mod polygon;
mod shares;
mod sphere_light;
mod spherical_triangle;
mod texture;
mod world;

pub use area_light::AreaLight;
pub use camera::{Camera, FovAxis};
pub use coat::Coat;
pub use environment_map::EnvironmentMap;
pub use error::Error;
pub use fresnel::{fresnel_conductor, fresnel_dielectric};
pub use light::{Beam, Emission, Light, LightKind, LightSample, Spot, Toward};
pub use light_view::LightView;
pub use load::{Loaded, Options, load, load_parts, load_with};
pub use lobe::{LEAST_ROUGHNESS, Lobe, LobeSample, LobeValue};
pub use material::{Material, Specular, SpecularBounce, Transport};
pub use polygon::polygon_irradiance;
pub use sphere_light::SphereLight;
pub use texture::{Filter, Pattern, Texels, Texture, TextureId, Wrap};
pub use world::{Parts, Scene};
