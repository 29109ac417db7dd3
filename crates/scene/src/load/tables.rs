//! The tables of `scene.toml` as serde reads them, each value with its place.
//!
//! What a key means and which belong together is told at [`load`](crate::load).

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use super::source::{Color, Factors};

type Place = Spanned<[f64; 3]>;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct SceneFile {
    pub(super) camera: Spanned<CameraTable>,
    #[serde(default)]
    pub(super) textures: BTreeMap<String, Spanned<TextureTable>>,
    #[serde(default)]
    pub(super) materials: BTreeMap<String, Spanned<MaterialTable>>,
    #[serde(default)]
    pub(super) meshes: Vec<Spanned<MeshTable>>,
    #[serde(default)]
    pub(super) quads: Vec<Spanned<QuadTable>>,
    #[serde(default)]
    pub(super) boxes: Vec<Spanned<BoxTable>>,
    #[serde(default)]
    pub(super) spheres: Vec<Spanned<SphereTable>>,
    #[serde(default)]
    pub(super) lights: Vec<Spanned<LightTable>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct CameraTable {
    pub(super) origin: Place,
    pub(super) target: Place,
    pub(super) up: Option<Place>,
    pub(super) fov: Spanned<f64>,
    pub(super) fov_axis: Option<Spanned<String>>,
    pub(super) aperture_radius: Option<Spanned<f64>>,
    pub(super) focus_distance: Option<Spanned<f64>>,
}

/// All kinds of texture in one, as for [`MaterialTable`].
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct TextureTable {
    #[serde(rename = "type")]
    pub(super) kind: Spanned<String>,
    pub(super) file: Option<Spanned<String>>,
    pub(super) raw: Option<Spanned<bool>>,
    pub(super) filter: Option<Spanned<String>>,
    pub(super) wrap: Option<Spanned<String>>,
    pub(super) colors: Option<[Spanned<Color>; 2]>,
    pub(super) scale: Option<Spanned<[f64; 2]>>,
    pub(super) rotate: Option<Spanned<f64>>,
    pub(super) offset: Option<Spanned<[f64; 2]>>,
}

/// All kinds of material in one: which keys go with which `type` is checked later, with better words than serde's.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct MaterialTable {
    #[serde(rename = "type")]
    pub(super) kind: Spanned<String>,
    pub(super) albedo: Option<Spanned<Color>>,
    pub(super) albedo_texture: Option<Spanned<String>>,
    pub(super) emission: Option<Spanned<Color>>,
    pub(super) emission_texture: Option<Spanned<String>>,
    pub(super) reflectance: Option<Spanned<Color>>,
    pub(super) eta: Option<Spanned<Color>>,
    pub(super) k: Option<Spanned<Color>>,
    pub(super) preset: Option<Spanned<String>>,
    pub(super) ior: Option<Spanned<f64>>,
    pub(super) absorption: Option<Spanned<Color>>,
    pub(super) roughness: Option<Spanned<f64>>,
    pub(super) nonlinear: Option<Spanned<bool>>,
    pub(super) opacity: Option<Spanned<f64>>,
    pub(super) opacity_texture: Option<Spanned<String>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct MeshTable {
    pub(super) name: Option<Spanned<String>>,
    pub(super) file: Spanned<String>,
    pub(super) material: Option<Spanned<String>>,
    pub(super) transform: Option<Spanned<TransformTable>>,
    pub(super) smooth: Option<bool>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct TransformTable {
    pub(super) scale: Option<Spanned<Factors>>,
    pub(super) rotate: Option<Rotations>,
    pub(super) translate: Option<Place>,
    pub(super) matrix: Option<Spanned<[[f64; 4]; 4]>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RotationTable {
    pub(super) axis: Place,
    pub(super) degrees: Spanned<f64>,
}

/// One rotation, or several in a row.
#[derive(Debug)]
pub(super) struct Rotations(pub(super) Vec<RotationTable>);

impl<'de> Deserialize<'de> for Rotations {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrMore;
        impl<'de> serde::de::Visitor<'de> for OneOrMore {
            type Value = Rotations;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("{ axis = [x, y, z], degrees = angle } or a list of such")
            }

            fn visit_map<A: serde::de::MapAccess<'de>>(
                self,
                map: A,
            ) -> Result<Rotations, A::Error> {
                let table = serde::de::value::MapAccessDeserializer::new(map);
                RotationTable::deserialize(table).map(|r| Rotations(vec![r]))
            }

            fn visit_seq<A: serde::de::SeqAccess<'de>>(
                self,
                mut seq: A,
            ) -> Result<Rotations, A::Error> {
                let mut rotations = Vec::new();
                while let Some(rotation) = seq.next_element()? {
                    rotations.push(rotation);
                }
                Ok(Rotations(rotations))
            }
        }
        deserializer.deserialize_any(OneOrMore)
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct QuadTable {
    pub(super) name: Option<Spanned<String>>,
    pub(super) corner: Place,
    pub(super) edges: [Place; 2],
    pub(super) material: Spanned<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct BoxTable {
    pub(super) name: Option<Spanned<String>>,
    pub(super) min: Option<Place>,
    pub(super) max: Option<Place>,
    pub(super) center: Option<Place>,
    pub(super) size: Option<Place>,
    pub(super) inward: Option<bool>,
    pub(super) transform: Option<Spanned<TransformTable>>,
    pub(super) material: Spanned<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct SphereTable {
    pub(super) name: Option<Spanned<String>>,
    pub(super) center: Place,
    pub(super) radius: Spanned<f64>,
    pub(super) material: Spanned<String>,
}

/// All kinds of light in one, as for [`MaterialTable`].
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct LightTable {
    #[serde(rename = "type")]
    pub(super) kind: Spanned<String>,
    pub(super) name: Option<Spanned<String>>,
    pub(super) position: Option<Place>,
    pub(super) target: Option<Place>,
    pub(super) direction: Option<Place>,
    pub(super) intensity: Option<Spanned<Color>>,
    pub(super) irradiance: Option<Spanned<Color>>,
    pub(super) radiance: Option<Spanned<Color>>,
    pub(super) cone_angle: Option<Spanned<f64>>,
    pub(super) falloff_angle: Option<Spanned<f64>>,
    pub(super) file: Option<Spanned<String>>,
    pub(super) rotate: Option<Spanned<Rotations>>,
}
