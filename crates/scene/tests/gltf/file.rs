//! A small file to change, and its readers.

use std::fs;
use std::io::Cursor;

use geometry::Mesh;
use glam::Vec3;
use scene::{Options, Parts, load_parts};
use serde_json::{Value, json};

/// Positions (48 bytes), normals (48), texture coordinates (32) and indices (12) of a square of side 2 on the floor.
pub(crate) fn buffer() -> Vec<u8> {
    let floats = [
        [-1.0_f32, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0, -1.0, -1.0, 0.0, -1.0].as_slice(),
        &[0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0],
        &[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0],
    ]
    .concat();
    let mut bytes: Vec<u8> = floats.iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    bytes
}

/// A gray square under a lamp.
pub(crate) fn square() -> Value {
    json!({
        "asset": { "version": "2.0", "generator": "by hand" },
        "extensionsUsed": ["KHR_lights_punctual"],
        "scene": 0,
        "scenes": [{ "nodes": [0, 1, 2] }],
        "nodes": [
            { "camera": 0, "translation": [0, 1, 4] },
            { "mesh": 0, "name": "floor" },
            { "translation": [0, 2, 0], "name": "lamp", "extensions": { "KHR_lights_punctual": { "light": 0 } } }
        ],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point", "color": [1, 0.5, 0.25], "intensity": 8 }] } },
        "materials": [{
            "name": "gray",
            "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0 },
            "extensions": { "KHR_materials_specular": { "specularFactor": 0 } }
        }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2 }, "indices": 3, "material": 0 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3" },
            { "bufferView": 0, "byteOffset": 48, "componentType": 5126, "count": 4, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2" },
            { "bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR" }
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 96 },
            { "buffer": 0, "byteOffset": 96, "byteLength": 32 },
            { "buffer": 0, "byteOffset": 128, "byteLength": 12 }
        ],
        "buffers": [{ "uri": "a.bin", "byteLength": 140 }]
    })
}

/// The square with changes: each a path (RFC 6901) whose last part is set or added.
pub(crate) fn changed(changes: &[(&str, Value)]) -> Value {
    let mut file = square();
    for (path, value) in changes {
        set(&mut file, path, value.clone());
    }
    file
}

pub(crate) fn set(file: &mut Value, path: &str, value: Value) {
    let (above, key) = path.rsplit_once('/').unwrap();
    match file.pointer_mut(above) {
        Some(Value::Object(table)) => drop(table.insert(key.into(), value)),
        Some(Value::Array(list)) => match key.parse::<usize>() {
            Ok(i) if i < list.len() => list[i] = value,
            _ => list.push(value),
        },
        _ => panic!("there is no {above}"),
    }
}

pub(crate) type Read = Result<(Parts, Vec<String>), String>;

/// Reads the first file; places in messages are relative to the folder.
pub(crate) fn read(files: &[(&str, &[u8])], lenient: bool) -> Read {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    let options = Options { definitions: Vec::new(), lenient, no_external: false };
    let local = |text: &str| text.replace(&format!("{}/", folder.path().display()), "");
    load_parts(&folder.path().join(files[0].0), &options)
        .map(|(parts, warnings)| (parts, warnings.iter().map(|w| local(w)).collect()))
        .map_err(|e| local(&e.to_string()))
}

/// Reads a file beside its buffer and an image of two texels.
pub(crate) fn load(file: &Value, lenient: bool) -> Read {
    let text = file.to_string();
    let (bin, png) = (buffer(), png(&[[255, 0, 0, 255], [255, 255, 255, 51]]));
    read(&[("a.gltf", text.as_bytes()), ("a.bin", &bin), ("a.png", &png)], lenient)
}

pub(crate) fn parts(changes: &[(&str, Value)]) -> Parts {
    load(&changed(changes), false).unwrap().0
}

pub(crate) fn error(changes: &[(&str, Value)]) -> String {
    load(&changed(changes), false).map(|_| ()).unwrap_err()
}

pub(crate) fn warnings(changes: &[(&str, Value)]) -> Vec<String> {
    load(&changed(changes), true).unwrap().1
}

pub(crate) fn png(texels: &[[u8; 4]]) -> Vec<u8> {
    let image =
        image::RgbaImage::from_fn(texels.len() as u32, 1, |x, _| image::Rgba(texels[x as usize]));
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

pub(crate) fn binary(json: &str, bin: Option<&[u8]>) -> Vec<u8> {
    let mut chunks = Vec::new();
    let mut chunk = |kind: &[u8; 4], data: &[u8], pad: u8| {
        let mut data = data.to_vec();
        data.resize(data.len().next_multiple_of(4), pad);
        chunks.extend((data.len() as u32).to_le_bytes());
        chunks.extend(kind);
        chunks.extend(data);
    };
    chunk(b"JSON", json.as_bytes(), b' ');
    if let Some(bin) = bin {
        chunk(b"BIN\0", bin, 0);
    }
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((chunks.len() as u32 + 12).to_le_bytes());
    bytes.extend(chunks);
    bytes
}

pub(crate) fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for group in bytes.chunks(3) {
        let bits = (0..3).fold(0_u32, |bits, i| bits << 8 | u32::from(*group.get(i).unwrap_or(&0)));
        for i in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * i) & 63) as usize];
            text.push(if i <= group.len() { digit.into() } else { '=' });
        }
    }
    text
}

/// The corners of all triangles.
pub(crate) fn corners(mesh: &Mesh) -> Vec<[Vec3; 3]> {
    (0..mesh.triangles.len()).map(|t| mesh.corners(t)).collect()
}

/// The corners of the triangles of the square.
pub(crate) fn two() -> Vec<[Vec3; 3]> {
    let [a, b, c, d] =
        [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].map(|(x, z)| Vec3::new(x, 0.0, z));
    vec![[a, b, c], [a, c, d]]
}

pub(crate) fn inventory(parts: Parts) -> base::Inventory {
    scene::Scene::assemble(parts).inventory().clone()
}

/// The square with a texture of one red and one white texel, the second nearly transparent.
pub(crate) fn textured(changes: &[(&str, Value)]) -> Value {
    let mut file = changed(&[
        ("/images", json!([{ "uri": "a.png" }])),
        ("/samplers", json!([{ "magFilter": 9728 }])),
        ("/textures", json!([{ "source": 0, "sampler": 0 }])),
        ("/materials/0/pbrMetallicRoughness/baseColorTexture", json!({ "index": 0 })),
    ]);
    changes.iter().for_each(|(path, value)| set(&mut file, path, value.clone()));
    file
}
