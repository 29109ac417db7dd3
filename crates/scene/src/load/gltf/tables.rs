//! The JSON of glTF 2.0, as far as it is used; what isn't named here is skipped.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value;

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct Tables {
    pub(super) asset: Asset,
    #[serde(default)]
    pub(super) extensions_used: Vec<String>,
    #[serde(default)]
    pub(super) extensions_required: Vec<String>,
    pub(super) scene: Option<usize>,
    #[serde(default)]
    pub(super) scenes: Vec<SceneTable>,
    #[serde(default)]
    pub(super) nodes: Vec<Node>,
    #[serde(default)]
    pub(super) meshes: Vec<MeshTable>,
    #[serde(default)]
    pub(super) accessors: Vec<AccessorTable>,
    #[serde(default)]
    pub(super) buffer_views: Vec<BufferView>,
    #[serde(default)]
    pub(super) buffers: Vec<Buffer>,
    #[serde(default)]
    pub(super) materials: Vec<MaterialTable>,
    #[serde(default)]
    pub(super) textures: Vec<TextureTable>,
    #[serde(default)]
    pub(super) images: Vec<Image>,
    #[serde(default)]
    pub(super) samplers: Vec<Sampler>,
    #[serde(default)]
    pub(super) cameras: Vec<CameraTable>,
    #[serde(default)]
    pub(super) animations: Vec<IgnoredAny>,
    #[serde(default)]
    pub(super) extensions: Extensions,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct Asset {
    pub(super) version: String,
    pub(super) min_version: Option<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct Extensions {
    #[serde(rename = "KHR_lights_punctual")]
    pub(super) punctual: Option<Punctual>,
}

#[derive(Debug, Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct Punctual {
    #[serde(default)]
    pub(super) lights: Vec<PunctualLight>,
}

#[derive(Debug, Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct PunctualLight {
    #[serde(rename = "type")]
    pub(super) kind: String,
    #[serde(default = "white")]
    pub(super) color: [f32; 3],
    #[serde(default = "one")]
    pub(super) intensity: f32,
    pub(super) spot: Option<SpotTable>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct SpotTable {
    #[serde(default)]
    pub(super) inner_cone_angle: f64,
    #[serde(default = "eighth_turn")]
    pub(super) outer_cone_angle: f64,
}

#[derive(Debug, Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct SceneTable {
    #[serde(default)]
    pub(super) nodes: Vec<usize>,
}

#[derive(Debug, Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct Node {
    pub(super) name: Option<String>,
    #[serde(default)]
    pub(super) children: Vec<usize>,
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) mesh: Option<usize>,
    pub(super) camera: Option<usize>,
    pub(super) skin: Option<usize>,
    pub(super) weights: Option<Vec<f64>>,
    #[serde(default)]
    pub(super) extensions: NodeExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct NodeExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    pub(super) punctual: Option<LightOfNode>,
}

#[derive(Debug, Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct LightOfNode {
    pub(super) light: usize,
}

#[derive(Debug, Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct MeshTable {
    pub(super) primitives: Vec<Primitive>,
    #[serde(default)]
    pub(super) weights: Vec<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct Primitive {
    pub(super) attributes: BTreeMap<String, usize>,
    pub(super) indices: Option<usize>,
    pub(super) material: Option<usize>,
    pub(super) mode: Option<u32>,
    #[serde(default)]
    pub(super) targets: Vec<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct AccessorTable {
    pub(super) buffer_view: Option<usize>,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) component_type: u32,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: usize,
    #[serde(rename = "type")]
    pub(super) kind: String,
    pub(super) sparse: Option<Sparse>,
}

#[derive(Debug, Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct Sparse {
    pub(super) count: usize,
    pub(super) indices: SparsePart,
    pub(super) values: SparsePart,
}

/// Indices have a type of their own; values have that of the accessor.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct SparsePart {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) component_type: Option<u32>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct BufferView {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) byte_length: usize,
    pub(super) byte_stride: Option<usize>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct Buffer {
    pub(super) uri: Option<String>,
    pub(super) byte_length: usize,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct MaterialTable {
    pub(super) name: Option<String>,
    #[serde(default)]
    pub(super) pbr_metallic_roughness: Pbr,
    pub(super) normal_texture: Option<TextureInfo>,
    #[serde(default)]
    pub(super) emissive_factor: [f32; 3],
    pub(super) emissive_texture: Option<TextureInfo>,
    pub(super) alpha_mode: Option<String>,
    pub(super) alpha_cutoff: Option<f32>,
    #[serde(default)]
    pub(super) double_sided: bool,
    #[serde(default)]
    pub(super) extensions: MaterialExtensions,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
#[serde(expecting = "an object")]
pub(super) struct Pbr {
    pub(super) base_color_factor: [f32; 4],
    pub(super) base_color_texture: Option<TextureInfo>,
    pub(super) metallic_factor: f32,
    pub(super) roughness_factor: f32,
    pub(super) metallic_roughness_texture: Option<TextureInfo>,
}

impl Default for Pbr {
    fn default() -> Self {
        Self {
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            metallic_roughness_texture: None,
        }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct MaterialExtensions {
    #[serde(rename = "KHR_materials_emissive_strength")]
    pub(super) emissive_strength: Option<EmissiveStrength>,
    #[serde(rename = "KHR_materials_ior")]
    pub(super) ior: Option<Ior>,
    #[serde(rename = "KHR_materials_specular")]
    pub(super) specular: Option<SpecularTable>,
    #[serde(rename = "KHR_materials_transmission")]
    pub(super) transmission: Option<Transmission>,
    #[serde(rename = "KHR_materials_volume")]
    pub(super) volume: Option<Volume>,
    #[serde(rename = "KHR_materials_unlit")]
    pub(super) unlit: Option<Value>,
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub(super) specular_glossiness: Option<Value>,
    #[serde(rename = "KHR_materials_clearcoat")]
    pub(super) clearcoat: Option<Value>,
    #[serde(rename = "KHR_materials_sheen")]
    pub(super) sheen: Option<Value>,
    #[serde(rename = "KHR_materials_iridescence")]
    pub(super) iridescence: Option<Value>,
    #[serde(rename = "KHR_materials_anisotropy")]
    pub(super) anisotropy: Option<Value>,
    #[serde(rename = "KHR_materials_dispersion")]
    pub(super) dispersion: Option<Value>,
    #[serde(rename = "KHR_materials_diffuse_transmission")]
    pub(super) diffuse_transmission: Option<Value>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct EmissiveStrength {
    #[serde(default = "one")]
    pub(super) emissive_strength: f32,
}

#[derive(Debug, Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct Ior {
    #[serde(default = "ior_of_glass")]
    pub(super) ior: f32,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct SpecularTable {
    #[serde(default = "one")]
    pub(super) specular_factor: f32,
    pub(super) specular_texture: Option<IgnoredAny>,
    #[serde(default = "white")]
    pub(super) specular_color_factor: [f32; 3],
    pub(super) specular_color_texture: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct Transmission {
    #[serde(default)]
    pub(super) transmission_factor: f32,
    pub(super) transmission_texture: Option<TextureInfo>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct Volume {
    #[serde(default)]
    pub(super) thickness_factor: f32,
    pub(super) attenuation_distance: Option<f32>,
    #[serde(default = "white")]
    pub(super) attenuation_color: [f32; 3],
}

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct TextureInfo {
    pub(super) index: usize,
    #[serde(default)]
    pub(super) tex_coord: usize,
    #[serde(default)]
    pub(super) extensions: TextureInfoExtensions,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub(super) transform: Option<TextureTransform>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct TextureTransform {
    #[serde(default)]
    pub(super) offset: [f64; 2],
    #[serde(default)]
    pub(super) rotation: f64,
    #[serde(default = "same_size")]
    pub(super) scale: [f64; 2],
    pub(super) tex_coord: Option<usize>,
}

#[derive(Debug, Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct TextureTable {
    pub(super) source: Option<usize>,
    pub(super) sampler: Option<usize>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct Image {
    pub(super) uri: Option<String>,
    pub(super) buffer_view: Option<usize>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct Sampler {
    pub(super) mag_filter: Option<u32>,
    #[serde(default = "repeat")]
    pub(super) wrap_s: u32,
    #[serde(default = "repeat")]
    pub(super) wrap_t: u32,
}

#[derive(Debug, Deserialize)]
#[serde(expecting = "an object")]
pub(super) struct CameraTable {
    pub(super) perspective: Option<Perspective>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
#[serde(expecting = "an object")]
pub(super) struct Perspective {
    pub(super) yfov: f64,
    pub(super) aspect_ratio: Option<f64>,
}

fn one() -> f32 {
    1.0
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

fn same_size() -> [f64; 2] {
    [1.0; 2]
}

fn ior_of_glass() -> f32 {
    1.5
}

fn eighth_turn() -> f64 {
    std::f64::consts::FRAC_PI_4
}

/// The name that samplers have for it.
fn repeat() -> u32 {
    10497
}
