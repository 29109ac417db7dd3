//! Materials and textures.

use base::Rgb;
use glam::Vec2;
use scene::{Material, Parts, Specular};
use serde_json::{Value, json};

use crate::file::{binary, buffer, changed, load, parts, png, read, textured, warnings};

fn material(changes: &[(&str, Value)]) -> Material {
    parts(changes).materials.remove(0)
}

#[test]
fn materials_are_mapped_to_ours() {
    let pbr = "/materials/0/pbrMetallicRoughness";
    let extension = |name: &str, value: Value| {
        let name = format!("KHR_materials_{name}");
        ("/materials/0/extensions", json!({ name: value }))
    };
    let plain = material(&[]);
    assert_eq!(
        (plain.albedo, plain.specular, plain.name.as_str()),
        (Rgb::splat(0.5), Specular::None, "gray")
    );
    assert_eq!(material(&[extension("ior", json!({ "ior": 1 }))]).specular, Specular::None);
    let table = json!({ "metallicFactor": 0, "roughnessFactor": 0.25, "baseColorFactor": [0.25, 0.5, 0, 1] });
    let plastic = material(&[(pbr, table), extension("ior", json!({ "ior": 1.33 }))]);
    assert_eq!((plastic.albedo, plastic.roughness), (Rgb::new(0.25, 0.5, 0.0), 0.25));
    let Specular::Coat(coat) = plastic.specular else { panic!("{plastic:?}") };
    assert_eq!((coat.ior(), coat.reflectance(), coat.is_nonlinear()), (1.33, Rgb::ONE, false));
    // A smooth coat over white takes nothing away.
    let smooth = scene::Coat::new(1.33, Rgb::ONE, false, 0.0);
    let white = smooth.albedo(Rgb::ONE).r + mean(|cos| scene::fresnel_dielectric(cos, 1.33));
    assert!((white - 1.0).abs() < 2e-3, "{white}");

    let metal = material(&[(
        pbr,
        json!({ "baseColorFactor": [0.9, 0.5, 0.1, 1], "roughnessFactor": 0.5 }),
    )]);
    let Specular::Metal { eta, k } = metal.specular else { panic!("{metal:?}") };
    assert!(
        (scene::fresnel_conductor(1.0, eta, k) - Rgb::new(0.9, 0.5, 0.1)).max_channel().abs()
            < 1e-3
    );
    assert_eq!((metal.roughness, metal.albedo), (0.5, Rgb::BLACK));
    // The default is a metal, white and rough.
    let default = json!({ "attributes": { "POSITION": 0 }, "indices": 3 });
    let default = material(&[("/meshes/0/primitives/0", default)]);
    assert!(matches!(default.specular, Specular::Metal { .. }) && default.roughness == 1.0);

    let clear = json!({ "metallicFactor": 0, "roughnessFactor": 0 });
    let through = json!({ "transmissionFactor": 1 });
    let pane = material(&[(pbr, clear.clone()), extension("transmission", through.clone())]);
    assert_eq!(pane.specular, Specular::Pane { ior: 1.5 });
    let body = json!({ "KHR_materials_transmission": through, "KHR_materials_ior": { "ior": 1.7 },
        "KHR_materials_volume": { "thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0.25] } });
    let glass = load(&changed(&[(pbr, clear), ("/materials/0/extensions", body)]), false).unwrap();
    let Specular::Glass { ior, absorption } = glass.0.materials[0].specular else { panic!() };
    assert_eq!((ior, absorption.r), (1.7, 0.0));
    assert!((absorption.g - std::f32::consts::LN_2 / 2.0).abs() < 1e-6);
    assert!(
        glass.1[0].contains("meshes[0].primitives[0]: the glass has 4 open edges"),
        "{:?}",
        glass.1
    );

    let lamp = material(&[
        ("/materials/0/emissiveFactor", json!([1, 0.5, 0])),
        extension("emissive_strength", json!({ "emissiveStrength": 20 })),
    ]);
    assert_eq!(lamp.emission, Rgb::new(20.0, 10.0, 0.0));
    let told = warnings(&[
        ("/materials/0/emissiveFactor", json!([1, 1, 1])),
        ("/materials/0/doubleSided", json!(true)),
    ]);
    assert_eq!(told, ["a.gltf: materials[0]: it emits light from its front side only"]);
    // Layers that a factor takes away.
    let nothing = json!({ "KHR_materials_clearcoat": { "clearcoatRoughnessFactor": 1 }, "KHR_materials_sheen": { "sheenColorFactor": [0, 0, 0] } });
    material(&[("/materials/0/extensions", nothing)]);
}

/// The mean over light from all sides.
fn mean(f: impl Fn(f32) -> f32) -> f32 {
    (0..1000).map(|i| f(((i as f32 + 0.5) / 1000.0).sqrt())).sum::<f32>() / 1000.0
}

#[test]
fn textures_show_their_image_upright() {
    let (parts, _) = load(&textured(&[]), false).unwrap();
    let id = parts.materials[0].albedo_texture.unwrap();
    let at = |parts: &Parts, id: scene::TextureId, u, v| {
        parts.textures[usize::from(id.0)].1.at(Vec2::new(u, v))
    };
    assert_eq!(at(&parts, id, 0.25, 0.5), Rgb::new(1.0, 0.0, 0.0));
    assert_eq!(at(&parts, id, 0.75, 0.5), Rgb::ONE);
    assert_eq!(parts.meshes[0].1.uvs[1], Vec2::new(1.0, 1.0));
    assert_eq!(parts.materials[0].opacity_texture, None, "alpha of what is opaque means nothing");
    // Moved by half an image, from another set of coordinates, in a buffer.
    let image = png(&[[255, 0, 0, 255], [255, 255, 255, 51]]);
    let bin = [buffer(), image.clone()].concat();
    let file = textured(&[
        ("/images/0", json!({ "bufferView": 3, "mimeType": "image/png" })),
        ("/bufferViews/3", json!({ "buffer": 0, "byteOffset": 140, "byteLength": image.len() })),
        ("/buffers/0", json!({ "byteLength": bin.len() })),
        ("/meshes/0/primitives/0/attributes", json!({ "POSITION": 0, "TEXCOORD_1": 2 })),
        (
            "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions",
            json!({ "KHR_texture_transform": { "offset": [0.5, 0], "texCoord": 1 } }),
        ),
        ("/materials/0/alphaMode", json!("BLEND")),
        ("/materials/0/pbrMetallicRoughness/baseColorFactor", json!([1, 1, 1, 0.5])),
    ]);
    let glb = binary(&file.to_string(), Some(&bin));
    let (parts, _) = read(&[("a.glb", &glb)], false).unwrap();
    let material = &parts.materials[0];
    assert_eq!(at(&parts, material.albedo_texture.unwrap(), 0.25, 0.5), Rgb::ONE);
    let alpha = material.opacity_texture.unwrap();
    assert_eq!((material.opacity, at(&parts, alpha, 0.25, 0.5)), (0.5, Rgb::splat(0.2)));
    assert_eq!(parts.meshes[0].1.uvs.len(), 4);
    let mask =
        [("/materials/0/alphaMode", json!("MASK")), ("/materials/0/alphaCutoff", json!(0.25))];
    let (parts, _) = load(&textured(&mask), false).unwrap();
    let alpha = parts.materials[0].opacity_texture.unwrap();
    assert_eq!(
        (at(&parts, alpha, 0.25, 0.5), at(&parts, alpha, 0.75, 0.5)),
        (Rgb::ONE, Rgb::BLACK)
    );
    let (parts, _) =
        load(&textured(&[mask[0].clone(), ("/materials/0/alphaCutoff", json!(0.2))]), false)
            .unwrap();
    assert_eq!(parts.materials[0].opacity_texture, None, "all of it is there");
    // Light from a texture.
    let (parts, _) = load(
        &textured(&[
            ("/materials/0/emissiveFactor", json!([2, 2, 2])),
            ("/materials/0/emissiveTexture", json!({ "index": 0 })),
        ]),
        false,
    )
    .unwrap();
    let emission = parts.materials[0].emission_texture.unwrap();
    assert_eq!(Some(emission), parts.materials[0].albedo_texture, "one image, held once");
}
