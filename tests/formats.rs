//! A scene of glTF or Mitsuba beside the same scene as `scene.toml`: the same picture, to the bit.

use std::fs;
use std::path::Path;

use base::{Fingerprint, Grid, ImageSize, Rgb};
use photon_map::{Gather, Kernel};
use scene::{Options, Parts, load_parts};
use serde_json::{Value, json};
use shade::{Settings, Shader};

use crate::renderer;

/// A corner, two edges and a material.
type Quad = (&'static str, [f32; 3], [[f32; 3]; 2], usize);

/// What the room is made of.
const QUADS: [Quad; 7] = [
    ("floor", [-2.0, 0.0, -2.0], [[0.0, 0.0, 4.0], [4.0, 0.0, 0.0]], 0),
    ("ceiling", [-2.0, 4.0, -2.0], [[4.0, 0.0, 0.0], [0.0, 0.0, 4.0]], 0),
    ("back", [-2.0, 0.0, -2.0], [[4.0, 0.0, 0.0], [0.0, 4.0, 0.0]], 0),
    ("left", [-2.0, 0.0, -2.0], [[0.0, 4.0, 0.0], [0.0, 0.0, 4.0]], 1),
    ("right", [2.0, 0.0, -2.0], [[0.0, 0.0, 4.0], [0.0, 4.0, 0.0]], 2),
    ("lamp", [-0.5, 3.75, -0.5], [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], 3),
    ("window", [-1.0, 0.5, 0.5], [[2.0, 0.0, 0.0], [0.0, 1.0, 0.5]], 4),
];

fn toml() -> String {
    let mut text = format!(
        "camera = {{ origin = [0, 2, 8], target = [0, 2, 0], fov = {}, fov_axis = \"y\" }}\n\
        lights = [{{ name = \"spot\", type = \"spot\", position = [0, 3.5, 1], target = [0, 0, 1], intensity = [4, 2, 1], cone_angle = 45, falloff_angle = 0 }}]\n\
        [materials]\nm0 = {{ type = \"diffuse\", albedo = 0.75 }}\nm1 = {{ type = \"diffuse\", albedo = [0.5, 0.0625, 0.0625] }}\n\
        m2 = {{ type = \"diffuse\", albedo = [0.125, 0.5, 0.125] }}\nm3 = {{ type = \"diffuse\", albedo = 0.5, emission = [16, 12, 4] }}\n\
        m4 = {{ type = \"pane\", ior = 1.5 }}\n",
        0.6_f64.to_degrees()
    );
    for (name, corner, edges, material) in QUADS {
        text += &format!(
            "[[quads]]\nname = \"{name}\"\ncorner = {corner:?}\nedges = {edges:?}\nmaterial = \"m{material}\"\n"
        );
    }
    text
}

/// The file and its buffer.
fn gltf() -> (Value, Vec<u8>) {
    let add = |a: [f32; 3], b: [f32; 3]| [0, 1, 2].map(|i| a[i] + b[i]);
    let mut bin: Vec<u8> = [0_u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()).collect();
    let mut nodes = vec![
        json!({ "camera": 0, "translation": [0, 2, 8] }),
        // Turned by a quarter about x, so that -z points down.
        json!({ "name": "spot", "matrix": [1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 3.5, 1, 1],
            "extensions": { "KHR_lights_punctual": { "light": 0 } } }),
    ];
    let (mut meshes, mut accessors) = (Vec::new(), Vec::new());
    accessors.push(json!({ "bufferView": 0, "componentType": 5123, "count": 6, "type": "SCALAR" }));
    for (i, (name, corner, [a, b], material)) in QUADS.into_iter().enumerate() {
        accessors.push(json!({ "bufferView": 0, "byteOffset": bin.len(), "componentType": 5126, "count": 4, "type": "VEC3" }));
        let corners = [corner, add(corner, a), add(add(corner, a), b), add(corner, b)];
        bin.extend(corners.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        meshes.push(json!({ "primitives": [{ "attributes": { "POSITION": i + 1 }, "indices": 0, "material": material }] }));
        nodes.push(json!({ "name": name, "mesh": i }));
    }
    let diffuse = |name: &str, color: [f64; 4]| {
        json!({ "name": name, "pbrMetallicRoughness": { "metallicFactor": 0, "baseColorFactor": color },
            "extensions": { "KHR_materials_ior": { "ior": 1 } } })
    };
    let mut lamp = diffuse("m3", [0.5, 0.5, 0.5, 1.0]);
    lamp["emissiveFactor"] = json!([1, 0.75, 0.25]);
    lamp["extensions"] = json!({ "KHR_materials_ior": { "ior": 1 }, "KHR_materials_emissive_strength": { "emissiveStrength": 16 } });
    let pane = json!({ "name": "m4", "pbrMetallicRoughness": { "metallicFactor": 0, "roughnessFactor": 0 },
        "extensions": { "KHR_materials_transmission": { "transmissionFactor": 1 } } });
    let file = json!({
        "asset": { "version": "2.0" },
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "spot", "color": [1, 0.5, 0.25], "intensity": 4,
            "spot": { "outerConeAngle": std::f64::consts::FRAC_PI_4 } }] } },
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.6, "znear": 0.01 } }],
        "materials": [
            diffuse("m0", [0.75, 0.75, 0.75, 1.0]), diffuse("m1", [0.5, 0.0625, 0.0625, 1.0]),
            diffuse("m2", [0.125, 0.5, 0.125, 1.0]), lamp, pane
        ],
        "nodes": nodes, "meshes": meshes, "accessors": accessors,
        "bufferViews": [{ "buffer": 0, "byteLength": bin.len() }],
        "buffers": [{ "byteLength": bin.len(), "uri": "room.bin" }]
    });
    (file, bin)
}

fn read(path: &Path) -> Parts {
    let options = Options { definitions: Vec::new(), lenient: false, no_external: true };
    let (parts, warnings) = load_parts(path, &options).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    parts
}

#[test]
fn a_room_of_gltf_is_the_room_of_toml() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (file, bin) = gltf();
    fs::write(path("room.gltf"), file.to_string()).unwrap();
    fs::write(path("room.bin"), bin).unwrap();
    fs::write(path("scene.toml"), toml()).unwrap();
    let [of_gltf, of_toml] = ["room.gltf", "scene.toml"].map(|name| render(&path(name), 4000));
    assert_eq!(of_gltf.0, of_toml.0, "maps of one are maps of the other");
    assert_same(&of_gltf.1, &of_toml.1);
}

#[test]
fn the_cornell_box_of_mitsuba_is_that_of_toml() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/cornell-box");
    let [of_xml, of_toml] =
        ["scene.xml", "scene.toml"].map(|name| render(&folder.join(name), 40_000));
    assert_same(&of_xml.1, &of_toml.1);
}

/// A small picture of a scene, and what the scene is known by.
fn render(path: &Path, photons: u64) -> (Fingerprint, Grid<Rgb>) {
    let size = ImageSize { width: 24, height: 24 };
    let gather = Gather { k: 50, max_radius: 1.0, kernel: Kernel::Epanechnikov };
    let settings =
        Settings { shadow_rays: 4, glossy_rays: 4, indirect: gather, caustic: gather, seed: 3 };
    let scene = scene::Scene::assemble(read(path));
    let maps = renderer::photons(&scene, photons, 3);
    let picture = renderer::original(&Shader::new(&scene, &maps, settings), size);
    (scene.inventory().fingerprint(), picture.total())
}

/// The same to the bit, and not black.
fn assert_same(picture: &Grid<Rgb>, expected: &Grid<Rgb>) {
    assert_eq!(picture.values(), expected.values());
    let mean: Rgb =
        expected.values().iter().copied().sum::<Rgb>() * (1.0 / expected.values().len() as f32);
    assert!(mean.min_channel() > 0.01, "{mean:?}");
}
