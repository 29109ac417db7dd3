//! What is refused, and how.

use scene::{Options, load_parts};
use serde_json::{Value, json};

use crate::file::{binary, buffer, changed, load, read, set, square, textured, warnings};

#[test]
fn what_is_not_supported_is_refused_or_replaced() {
    let pbr = "/materials/0/pbrMetallicRoughness";
    let texture =
        ("/materials/0/pbrMetallicRoughness/metallicRoughnessTexture", json!({ "index": 0 }));
    let metal = ("/materials/0/pbrMetallicRoughness/metallicFactor", json!(1));
    let transmission = json!({ "KHR_materials_transmission": { "transmissionFactor": 1 } });
    let clear = ("/materials/0/extensions", transmission);
    type Case<'a> = (&'a str, &'a [(&'a str, Value)], &'a str, &'a str);
    let cases: &[Case<'_>] = &[
        (
            "materials[0]",
            &[("/materials/0/extensions", json!({ "KHR_materials_unlit": {} }))],
            "KHR_materials_unlit isn't supported",
            "it is lit as any other",
        ),
        (
            "materials[0]",
            &[(
                "/materials/0/extensions",
                json!({ "KHR_materials_clearcoat": { "clearcoatFactor": 1 } }),
            )],
            "KHR_materials_clearcoat isn't supported",
            "it is left out",
        ),
        (
            "materials[0]",
            &[(
                "/materials/0/extensions",
                json!({ "KHR_materials_specular": { "specularFactor": 0.5 } }),
            )],
            "KHR_materials_specular that is neither 0 nor 1 isn't supported",
            "reflections are multiplied by its factors, at most 1",
        ),
        (
            "materials[0]",
            &[("/materials/0/pbrMetallicRoughness/metallicFactor", json!(0.75))],
            "metallic between 0 and 1 isn't supported",
            "it is metal",
        ),
        (
            "materials[0]",
            &[texture],
            "roughness that varies by a texture isn't supported",
            "it is the mean of the texture",
        ),
        (
            "materials[0]",
            &[metal],
            "a texture on a metal isn't supported",
            "its mean color is taken",
        ),
        (
            "materials[0]",
            &[
                clear,
                (
                    pbr,
                    json!({ "metallicFactor": 0, "roughnessFactor": 0.5, "baseColorFactor": [1, 0, 0, 1] }),
                ),
            ],
            "glass whose base color isn't white isn't supported (give it an attenuationColor)",
            "it is taken for white",
        ),
        (
            "materials[0]",
            &[
                ("/materials/0/alphaMode", json!("BLEND")),
                ("/materials/0/emissiveFactor", json!([1, 1, 1])),
            ],
            "a material that emits and lets light pass isn't supported",
            "it is opaque",
        ),
        (
            "samplers[0]",
            &[("/samplers/0/wrapS", json!(33071))],
            "a wrapT that differs from wrapS isn't supported",
            "both are that of wrapS",
        ),
        (
            "meshes[0].primitives[1]",
            &[("/meshes/0/primitives/1", json!({ "attributes": { "POSITION": 0 }, "mode": 1 }))],
            "points and lines aren't supported",
            "they are left out",
        ),
        (
            "meshes[0].primitives[0]",
            &[("/meshes/0/primitives/0/attributes/COLOR_0", json!(0))],
            "colors of vertices aren't supported",
            "they are taken for white",
        ),
        (
            "nodes[1]",
            &[("/nodes/1/skin", json!(0))],
            "skins aren't supported",
            "its mesh is shown as it is stored",
        ),
        (
            "meshes[0]",
            &[
                ("/meshes/0/weights", json!([0, 0.5])),
                ("/meshes/0/primitives/0/targets", json!([{}, {}])),
            ],
            "morph targets whose weights differ from 0 aren't supported",
            "it is shown without them",
        ),
    ];
    for (place, changes, what, instead) in cases {
        let file = textured(changes);
        let message = load(&file, false).map(|_| ()).unwrap_err();
        assert_eq!(message, format!("a.gltf: {place}: {what}; with --lenient {instead}"));
        let (_, told) = load(&file, true).unwrap();
        assert!(told.contains(&format!("a.gltf: {place}: {what}; {instead}")), "{told:?}");
    }
    // A required extension has nothing to take its place.
    let required =
        [("/extensionsRequired", json!(["KHR_texture_transform", "KHR_draco_mesh_compression"]))];
    let expected = "a.gltf: extensionsRequired: KHR_draco_mesh_compression isn't supported; save the file without it";
    assert_eq!(load(&changed(&required), true).map(|_| ()).unwrap_err(), expected);
    let told = warnings(&[("/extensionsUsed/1", json!("EXT_of_mine"))]);
    assert_eq!(
        told,
        ["a.gltf: extensionsUsed: EXT_of_mine isn't supported; what it says is left out"]
    );
}

#[test]
fn faults_name_file_and_place() {
    let half: Vec<usize> = Vec::new();
    let cases: &[(&str, Value, &str)] = &[
        ("/asset/version", json!("1.0"), "asset: version 1.0 is needed to read it; save it as 2.0"),
        (
            "/nodes/0",
            json!({}),
            "no node of the scene has a camera in perspective; add one where the file was made, and save it with cameras",
        ),
        ("/nodes/2", json!({}), "nothing emits light; add a light or an emissive material"),
        ("/scene", json!(7), "scene: there is no scenes[7]; the file has 1 of them"),
        (
            "/scenes/0/nodes/3",
            json!(9),
            "scenes[0].nodes: there is no nodes[9]; the file has 3 of them",
        ),
        (
            "/nodes/1/children",
            json!([0]),
            "nodes[1].children: nodes[0] has another place already; every node needs one of its own",
        ),
        (
            "/nodes/1/children",
            json!([1]),
            "nodes[1].children: nodes[1] has another place already; every node needs one of its own",
        ),
        ("/nodes/1/mesh", json!(3), "nodes[1]: there is no meshes[3]; the file has 1 of them"),
        (
            "/nodes/1/scale",
            json!([1, 0, 1]),
            "nodes[1]: it flattens its mesh; every scale must differ from 0 and the axes from each other",
        ),
        (
            "/nodes/1/scale",
            json!([1e9, 1e9, 1e9]),
            "nodes[1]: it moves its mesh too far away; keep coordinates within 1e8",
        ),
        (
            "/nodes/1/scale",
            json!([1e300, 1, 1]),
            "nodes[1]: its place in the world overflows; use smaller numbers",
        ),
        (
            "/nodes/1/rotation",
            json!([0, 0, 0, 0]),
            "nodes[1]: its rotation is no quaternion of length 1",
        ),
        (
            "/nodes/1/matrix",
            json!([1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
            "nodes[1]: the last row of its matrix must be 0, 0, 0, 1",
        ),
        (
            "/nodes/0/scale",
            json!([-1, 1, 1]),
            "nodes[0]: it mirrors the picture of its camera; every scale must be above 0",
        ),
        (
            "/cameras/0/perspective/yfov",
            json!(4),
            "cameras[0].perspective: its yfov is 4; give radians between 0 and pi",
        ),
        (
            "/meshes/0/primitives/0/attributes",
            json!({}),
            "meshes[0].primitives[0]: it has no POSITION",
        ),
        (
            "/meshes/0/primitives/0/attributes/NORMAL",
            json!(3),
            "meshes[0].primitives[0]: its NORMAL has 6 elements of 1 numbers, for 4 vertices",
        ),
        (
            "/meshes/0/primitives/0/indices",
            json!(0),
            "meshes[0].primitives[0]: its indices must be whole numbers without a sign",
        ),
        ("/meshes/0/primitives/0/mode", json!(7), "meshes[0].primitives[0]: its mode 7 is unknown"),
        (
            "/meshes/0/primitives/0/material",
            json!(1),
            "meshes[0].primitives[0]: there is no materials[1]; the file has 1 of them",
        ),
        (
            "/accessors/3/count",
            json!(5),
            "meshes[0].primitives[0]: its 5 corners don't make triangles; give three for each",
        ),
        (
            "/accessors/0/count",
            json!(3),
            "meshes[0].primitives[0]: an index is 3, but it has only 3 vertices",
        ),
        (
            "/accessors/0/count",
            json!(9),
            "accessors[0]: its 9 elements end behind its buffer view, which has 96 bytes",
        ),
        (
            "/accessors/0/count",
            json!(u64::MAX),
            "accessors[0]: its 18446744073709551615 elements end behind its buffer view, which has 96 bytes",
        ),
        (
            "/accessors/0/byteOffset",
            json!(u64::MAX),
            "accessors[0]: its 4 elements end behind its buffer view, which has 96 bytes",
        ),
        ("/accessors/0/count", json!(0), "accessors[0]: its count is 0; give at least one element"),
        ("/accessors/0/type", json!("MAT4"), "accessors[0]: its type MAT4 is not expected here"),
        (
            "/accessors/0/componentType",
            json!(5124),
            "accessors[0]: its componentType 5124 is unknown",
        ),
        (
            "/accessors/0/bufferView",
            Value::Null,
            "accessors[0]: it has no bufferView, so it holds nothing but zeros",
        ),
        (
            "/accessors/0/bufferView",
            json!(8),
            "accessors[0]: there is no bufferViews[8]; the file has 3 of them",
        ),
        (
            "/bufferViews/0/byteStride",
            json!(4),
            "accessors[0]: the stride of its buffer view, 4, is less than the 12 bytes of an element",
        ),
        (
            "/bufferViews/0/byteOffset",
            json!(u64::MAX),
            "bufferViews[0]: it ends behind buffers[0], which has 140 bytes",
        ),
        (
            "/bufferViews/0/buffer",
            json!(1),
            "bufferViews[0]: there is no buffers[1]; the file has 1 of them",
        ),
        (
            "/buffers/0/byteLength",
            json!(141),
            "buffers[0]: it promises 141 bytes but holds 140; it may be cut off",
        ),
        (
            "/buffers/0/uri",
            json!("b.bin"),
            "buffers[0]: cannot read b.bin: there is no such file; paths are relative to the scene file",
        ),
        (
            "/buffers/0/uri",
            json!("http://a.b/c"),
            "buffers[0]: nothing is loaded by http://; save it beside the scene",
        ),
        (
            "/buffers/0/uri",
            Value::Null,
            "buffers[0]: it has no `uri`, and no chunk of a binary file stands for it",
        ),
        (
            "/extensions/KHR_lights_punctual/lights/0/type",
            json!("area"),
            "lights[0]: its type \"area\" is unknown; the types are point, spot and directional",
        ),
        (
            "/extensions/KHR_lights_punctual/lights/0/intensity",
            json!(-1),
            "lights[0]: its color times its intensity must lie between 0 and 1e15",
        ),
        (
            "/extensions/KHR_lights_punctual/lights",
            json!(half),
            "nodes[2]: there is no lights[0]; the file has 0 of them",
        ),
        (
            "/materials/0/pbrMetallicRoughness/baseColorFactor",
            json!([2, 0, 0, 1]),
            "materials[0]: its baseColorFactor, metallicFactor and roughnessFactor must lie between 0 and 1",
        ),
        (
            "/materials/0/alphaMode",
            json!("GLOW"),
            "materials[0]: its alphaMode \"GLOW\" is unknown; the modes are OPAQUE, MASK and BLEND",
        ),
        (
            "/materials/0/extensions",
            json!({ "KHR_materials_ior": { "ior": 0 } }),
            "materials[0]: its ior is 0; use 1 to 10",
        ),
        (
            "/materials/0/emissiveFactor",
            json!([-1, 0, 0]),
            "materials[0]: its emission must lie between 0 and 1e15",
        ),
        (
            "/materials/0/pbrMetallicRoughness/baseColorTexture",
            json!({ "index": 2 }),
            "materials[0]: there is no textures[2]; the file has 1 of them",
        ),
        (
            "/textures/0/source",
            json!(4),
            "materials[0]: there is no images[4]; the file has 1 of them",
        ),
        (
            "/textures/0/source",
            Value::Null,
            "textures[0]: it has no image that is PNG or JPEG; save the file with such",
        ),
        (
            "/images/0/uri",
            json!("a.bin"),
            "images[0]: a.bin is neither PNG nor JPEG; save the image as such",
        ),
        (
            "/images/0/uri",
            json!("c.png"),
            "images[0]: cannot read c.png: there is no such file; paths are relative to the scene file",
        ),
        (
            "/images/0/uri",
            json!("data:image/png;base64,Zm9v"),
            "images[0]: its data URI is neither PNG nor JPEG; save the image as such",
        ),
        (
            "/meshes/0/primitives/0/attributes",
            json!({ "POSITION": 0 }),
            "meshes[0].primitives[0]: its material has a texture, for which it needs TEXCOORD_0",
        ),
    ];
    for (path, value, expected) in cases {
        let message = load(&textured(&[(path, value.clone())]), false).map(|_| ()).unwrap_err();
        assert_eq!(message, format!("a.gltf: {expected}"), "{path} = {value}");
    }
    let syntax: &[(&str, &str)] = &[
        ("{", "a.gltf:1:1: EOF while parsing an object; glTF 2.0 is expected"),
        ("{\n \"asset\": {}\n}", "a.gltf:2:12: missing field `version`; glTF 2.0 is expected"),
        ("[]", "a.gltf:1:2: invalid length 0, expected an object"),
        ("", "a.gltf:1:1: EOF while parsing a value; glTF 2.0 is expected"),
    ];
    for (text, expected) in syntax {
        let message = read(&[("a.gltf", text.as_bytes())], false).map(|_| ()).unwrap_err();
        assert!(message.starts_with(expected), "{message}");
    }
    let stride = square().to_string().replacen(
        "\"byteLength\":96",
        "\"byteLength\":96,\"byteStride\":-12",
        1,
    );
    let message = read(&[("a.gltf", stride.as_bytes()), ("a.bin", &buffer())], false)
        .map(|_| ())
        .unwrap_err();
    assert!(message.starts_with("a.gltf:1:") && message.contains("`-12`"), "{message}");
    // What is skipped may be as deep as it likes; what is kept may not.
    let brackets = format!("{}{}", "[".repeat(10_000), "]".repeat(10_000));
    let deep =
        square().to_string().replacen("\"nodes\"", &format!("\"extras\":{brackets},\"nodes\""), 1);
    let load =
        |text: &str| read(&[("a.gltf", text.as_bytes()), ("a.bin", &buffer())], false).map(|_| ());
    load(&deep).unwrap();
    let deep = changed(&[("/materials/0/extensions", json!({ "KHR_materials_unlit": "DEEP" }))]);
    let message = load(&deep.to_string().replace("\"DEEP\"", &brackets)).unwrap_err();
    assert!(message.starts_with("a.gltf:1:") && message.contains("recursion limit"), "{message}");
    // Options of the other formats.
    let options =
        Options { definitions: vec![("a".into(), "1".into())], lenient: false, no_external: false };
    let message =
        load_parts(std::path::Path::new("a.gltf"), &options).map(|_| ()).unwrap_err().to_string();
    assert_eq!(message, "a.gltf: only scenes of Mitsuba (.xml) take -D; leave it out");
}

#[test]
fn nan_and_cut_files_are_refused() {
    let text = square().to_string();
    for (at, bad, expected) in [
        (4, f32::NAN, "POSITION 0 is [-1.0, NaN, 1.0]"),
        (12, f32::INFINITY, "POSITION 1 is [inf, 0.0, 1.0]"),
        (36, 1e9, "POSITION 3 is [1000000000.0, 0.0, -1.0]"),
        (48, f32::NAN, "NORMAL 0 is [NaN, 1.0, 0.0]"),
    ] {
        let mut bin = buffer();
        bin[at..at + 4].copy_from_slice(&bad.to_le_bytes());
        let message =
            read(&[("a.gltf", text.as_bytes()), ("a.bin", &bin)], false).map(|_| ()).unwrap_err();
        let expected =
            format!("a.gltf: meshes[0].primitives[0]: its {expected}; keep numbers within 1e8");
        assert_eq!(message, expected);
    }
    let mut file = square();
    set(&mut file, "/buffers/0", json!({ "byteLength": 140 }));
    let glb = binary(&file.to_string(), Some(&buffer()));
    for end in 4..glb.len() {
        let message = read(&[("a.glb", &glb[..end])], false).map(|_| ()).unwrap_err();
        assert!(
            message.starts_with("a.glb: the file ") && message.contains("cut off"),
            "{end}: {message}"
        );
    }
    let old = [&glb[..4], &[1], &glb[5..]].concat();
    let message = read(&[("a.glb", &old)], false).map(|_| ()).unwrap_err();
    assert_eq!(message, "a.glb: the binary file is of version 1; save it as glTF 2.0");
}
