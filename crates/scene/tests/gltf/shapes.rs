//! Containers, meshes, nodes, and what else nodes place.

use base::{ImageSize, Rgb};
use glam::{Vec2, Vec3, Vec3A};
use scene::LightKind;
use serde_json::{Value, json};

use crate::file::{
    base64, binary, buffer, changed, corners, error, inventory, load, parts, read, set, square,
    two, warnings,
};

#[test]
fn all_containers_hold_the_same_scene() {
    let (parts, warnings) = load(&square(), false).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(parts.meshes.len(), 1);
    let (name, mesh) = &parts.meshes[0];
    assert_eq!((name.as_str(), corners(mesh)), ("floor", two()));
    assert_eq!(mesh.normals, [Vec3::Y; 4]);
    // Nothing shows a texture.
    assert!(mesh.uvs.is_empty());
    let whole = inventory(parts);

    let mut file = square();
    set(&mut file, "/buffers/0", json!({ "byteLength": 140 }));
    let glb = binary(&file.to_string(), Some(&buffer()));
    let (parts, _) = read(&[("a.glb", &glb)], false).unwrap();
    assert_eq!(inventory(parts), whole);
    // By what it holds, whatever it is called.
    let (parts, _) = read(&[("a.gltf", &glb)], false).unwrap();
    assert_eq!(inventory(parts), whole);

    let uri = format!("data:application/octet-stream;base64,{}", base64(&buffer()));
    set(&mut file, "/buffers/0", json!({ "byteLength": 140, "uri": uri }));
    for bytes in [file.to_string().into_bytes(), binary(&file.to_string(), None)] {
        let (parts, _) = read(&[("a.gltf", &bytes)], false).unwrap();
        assert_eq!(inventory(parts), whole);
    }
    set(&mut file, "/buffers/0/uri", json!("my%20buffer.bin"));
    let text = file.to_string();
    let files = [("a.gltf", text.as_bytes()), ("my buffer.bin", &buffer()[..])];
    assert_eq!(inventory(read(&files, false).unwrap().0), whole);
}

#[test]
fn triangles_come_as_lists_strips_and_fans() {
    let list = |indices: &[u8], mode: u32| {
        let bin = [buffer(), indices.to_vec()].concat();
        let file = changed(&[
            ("/buffers/0/byteLength", json!(bin.len())),
            ("/bufferViews/2/byteOffset", json!(140)),
            ("/bufferViews/2/byteLength", json!(indices.len())),
            ("/accessors/3/componentType", json!(5121)),
            ("/accessors/3/count", json!(indices.len())),
            ("/meshes/0/primitives/0/mode", json!(mode)),
        ]);
        let text = file.to_string();
        let (parts, _) = read(&[("a.gltf", text.as_bytes()), ("a.bin", &bin)], false).unwrap();
        corners(&parts.meshes[0].1)
    };
    let turned = |t: [Vec3; 3], by: usize| [0, 1, 2].map(|i| t[(i + by) % 3]);
    let [first, second]: [[Vec3; 3]; 2] = two().try_into().unwrap();
    assert_eq!(list(&[0, 1, 2, 0, 2, 3], 4), two());
    // Every second triangle of a strip runs the other way.
    assert_eq!(list(&[1, 2, 0, 3], 5), [turned(first, 1), turned(second, 1)]);
    assert_eq!(list(&[0, 1, 2, 3], 6), [turned(first, 1), turned(second, 1)]);
    // Words of 32 bits, and none at all.
    let wide: Vec<u8> = [0_u32, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()).collect();
    let bin = [buffer(), wide].concat();
    let text = changed(&[
        ("/buffers/0/byteLength", json!(bin.len())),
        ("/bufferViews/2/byteOffset", json!(140)),
        ("/bufferViews/2/byteLength", json!(24)),
        ("/accessors/3/componentType", json!(5125)),
    ])
    .to_string();
    let (parts, _) = read(&[("a.gltf", text.as_bytes()), ("a.bin", &bin)], false).unwrap();
    assert_eq!(corners(&parts.meshes[0].1), two());
    let alone = json!({ "attributes": { "POSITION": 0 }, "material": 0 });
    let three = self::parts(&[("/meshes/0/primitives/0", alone), ("/accessors/0/count", json!(3))]);
    assert_eq!(corners(&three.meshes[0].1), [first]);
    assert!(three.meshes[0].1.normals.is_empty(), "what has no normals is flat");
}

#[test]
fn numbers_may_be_sparse_strided_and_parts_of_one() {
    // The third vertex moved up, by a sparse accessor over the dense one.
    let mut bin = buffer();
    bin.extend([2, 0, 0, 0]);
    bin.extend([1.0_f32, 5.0, -1.0].iter().flat_map(|x| x.to_le_bytes()));
    // Four vertices of signed bytes, a whole one each being 1, in strides of four bytes.
    bin.extend([129_u8, 0, 127, 0, 127, 0, 127, 0, 127, 0, 129, 0, 128, 0, 129, 0]);
    let load = |changes: &[(&str, Value)]| {
        let mut file = changed(&[
            ("/buffers/0/byteLength", json!(172)),
            ("/bufferViews/3", json!({ "buffer": 0, "byteOffset": 140, "byteLength": 4 })),
            ("/bufferViews/4", json!({ "buffer": 0, "byteOffset": 144, "byteLength": 12 })),
            (
                "/bufferViews/5",
                json!({ "buffer": 0, "byteOffset": 156, "byteLength": 16, "byteStride": 4 }),
            ),
        ]);
        changes.iter().for_each(|(path, value)| set(&mut file, path, value.clone()));
        let text = file.to_string();
        read(&[("a.gltf", text.as_bytes()), ("a.bin", &bin)], false)
            .map(|(parts, _)| corners(&parts.meshes[0].1))
    };
    let sparse = json!({ "count": 1, "indices": { "bufferView": 3, "componentType": 5121 }, "values": { "bufferView": 4 } });
    let mut raised = two();
    raised[0][2].y = 5.0;
    raised[1][1].y = 5.0;
    assert_eq!(load(&[("/accessors/0/sparse", sparse.clone())]).unwrap(), raised);
    // Without dense values the others are zero.
    let zeros = json!({ "componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse });
    assert!(load(&[("/accessors/0", zeros)]).unwrap_err().contains("there are no surfaces"));
    let bytes = json!({ "bufferView": 5, "componentType": 5120, "normalized": true, "count": 4, "type": "VEC3" });
    assert_eq!(load(&[("/accessors/0", bytes.clone())]).unwrap(), two());
    let mut plain = bytes;
    plain["normalized"] = json!(false);
    assert_eq!(load(&[("/accessors/0", plain)]).unwrap()[0][1], Vec3::new(127.0, 0.0, 127.0));
}

#[test]
fn nodes_place_their_meshes() {
    let of = |node: Value| corners(&parts(&[("/nodes/1", node)]).meshes[0].1);
    let near = |a: &[[Vec3; 3]], b: &[[Vec3; 3]]| {
        a.len() == b.len()
            && a.as_flattened().iter().zip(b.as_flattened()).all(|(a, b)| (*a - *b).length() < 1e-5)
    };
    let map = |f: &dyn Fn(Vec3) -> Vec3| two().iter().map(|t| t.map(f)).collect::<Vec<_>>();
    // Scaled, then turned by a quarter about x, so that z becomes -y, then moved.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let steps = json!({ "mesh": 0, "scale": [1, 2, 3], "rotation": [half, 0, 0, half], "translation": [0, 5, 0] });
    let expected = map(&|p| Vec3::new(p.x, 5.0 - 3.0 * p.z, 0.0));
    assert!(near(&of(steps), &expected));
    let columns = json!([1, 0, 0, 0, 0, 0, 2, 0, 0, -3, 0, 0, 0, 5, 0, 1]);
    assert!(near(&of(json!({ "mesh": 0, "matrix": columns })), &expected));
    // What is mirrored still shows its front to the same side of the surface.
    let mirrored = of(json!({ "mesh": 0, "scale": [-1, 1, 1] }));
    for [a, b, c] in mirrored {
        assert!((b - a).cross(c - a).y > 0.0);
    }
    // Children follow those above; nodes that the scene doesn't name aren't shown.
    let file = [
        ("/nodes/1", json!({ "children": [3, 4], "scale": [2, 2, 2], "translation": [0, 1, 0] })),
        ("/nodes/3", json!({ "mesh": 0, "name": "twin", "translation": [10, 0, 0] })),
        ("/nodes/4", json!({ "mesh": 0, "name": "twin", "scale": [1, 1, -1] })),
        ("/nodes/5", json!({ "mesh": 0 })),
    ];
    let two_of_them = parts(&file);
    let names: Vec<_> = two_of_them.meshes.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["twin", "twin, node 4"]);
    let expected = map(&|p| 2.0 * (p + Vec3::X * 10.0) + Vec3::Y);
    assert_eq!(corners(&two_of_them.meshes[0].1), expected);
    // Without scenes all nodes are shown that stand below no other.
    let mut file = changed(&file);
    file.as_object_mut().unwrap().retain(|key, _| !key.starts_with("scene"));
    assert_eq!(load(&file, false).unwrap().0.meshes.len(), 3);
    // The default scene is the one named.
    let file = [("/scenes/1", json!({ "nodes": [0, 2] })), ("/scene", json!(1))];
    assert!(error(&file).ends_with("there are no surfaces; add a mesh, a quad, a box or a sphere"));
}

#[test]
fn lights_shine_along_their_node() {
    let kind = |light: Value| {
        let path = "/extensions/KHR_lights_punctual/lights/0";
        // Turned about x so that -z is down.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let node = json!({ "translation": [0, 2, 0], "rotation": [-half, 0, 0, half], "extensions": { "KHR_lights_punctual": { "light": 0 } } });
        parts(&[(path, light), ("/nodes/2", node)]).lights.remove(0)
    };
    let down = |v: Vec3A| (v - Vec3A::NEG_Y).length() < 1e-6;
    let light = kind(json!({ "type": "point", "intensity": 3, "range": 10 }));
    assert_eq!(light.name, "node 2");
    assert!(matches!(light.kind, LightKind::Point { position, intensity }
        if position == Vec3A::new(0.0, 2.0, 0.0) && intensity == Rgb::splat(3.0)));
    let light = kind(json!({ "type": "directional", "color": [1, 0.5, 0] }));
    assert!(matches!(light.kind, LightKind::Directional { direction, irradiance }
        if down(direction) && irradiance == Rgb::new(1.0, 0.5, 0.0)));
    let light = kind(json!({ "type": "spot", "spot": { "innerConeAngle": 0.5 } }));
    let LightKind::Spot(spot) = light.kind else { panic!("{light:?}") };
    assert!(down(spot.direction) && spot.intensity == Rgb::ONE);
    assert!((spot.cos_inner - base::math::sin_cos(0.5).1).abs() < 1e-6);
    assert!((spot.cos_outer - std::f32::consts::FRAC_1_SQRT_2).abs() < 1e-6);
}

#[test]
fn cameras_look_along_their_node() {
    let camera = |changes: &[(&str, Value)]| parts(changes).camera;
    let size = ImageSize { width: 100, height: 50 };
    let middle = camera(&[]);
    assert_eq!((middle.origin(), middle.film()), (Vec3A::new(0.0, 1.0, 4.0), None));
    assert!((middle.ray(size, Vec2::new(50.0, 25.0)).dir() - Vec3A::NEG_Z).length() < 1e-6);
    // The upper edge, at half of yfov.
    let up = middle.ray(size, Vec2::new(50.0, 0.0)).dir();
    assert!((up.y / -up.z - base::math::tan(0.4)).abs() < 1e-5);
    let wide = camera(&[("/cameras/0/perspective/aspectRatio", json!(1.5))]);
    assert_eq!(wide.film(), Some(ImageSize { width: 768, height: 512 }));
    let told = warnings(&[("/nodes/1/camera", json!(0)), ("/animations", json!([{}]))]);
    assert_eq!(
        told,
        [
            "a.gltf: cameras: the first of 2 cameras is taken, that of nodes[0]",
            "a.gltf: animations: they are left out; nodes stand where the file places them",
        ]
    );
}

#[test]
fn small_files_take_little_memory() {
    // Ten thousand nodes, one below the other.
    let mut nodes = square()["nodes"].as_array().unwrap().clone();
    nodes[1] = json!({ "children": [3] });
    nodes.extend((3..10_000).map(|i| json!({ "children": [i + 1], "translation": [0, 0.001, 0] })));
    nodes.push(json!({ "mesh": 0 }));
    let deep = parts(&[("/nodes", json!(nodes))]);
    assert!((deep.meshes[0].1.positions[0].y - 9.997).abs() < 1e-4);
    // A sparse array of as many elements as fit, of which a triangle needs three.
    let mut bin = buffer();
    bin.extend([0_u8, 1, 2, 0].iter().chain(&buffer()[..36]));
    let sparse = json!({ "count": 3, "indices": { "bufferView": 3, "componentType": 5121 }, "values": { "bufferView": 4 } });
    let changes = [
        ("/buffers/0/byteLength", json!(180)),
        ("/bufferViews/3", json!({ "buffer": 0, "byteOffset": 140, "byteLength": 4 })),
        ("/bufferViews/4", json!({ "buffer": 0, "byteOffset": 144, "byteLength": 36 })),
        (
            "/accessors/0",
            json!({ "componentType": 5126, "count": u32::MAX, "type": "VEC3", "sparse": sparse }),
        ),
        ("/meshes/0/primitives/0/attributes", json!({ "POSITION": 0 })),
    ];
    let of = |more: &[(&str, Value)]| {
        let text = changed(&[&changes[..], more].concat()).to_string();
        read(&[("a.gltf", text.as_bytes()), ("a.bin", &bin)], false)
    };
    let (parts, _) = of(&[]).unwrap();
    assert_eq!(corners(&parts.meshes[0].1)[0], two()[0]);
    let all = json!({ "attributes": { "POSITION": 0 }, "material": 0 });
    let message = of(&[("/meshes/0/primitives/0", all)]).map(|_| ()).unwrap_err();
    let expected = "a.gltf: meshes[0].primitives[0]: up to this one, primitives have 1431655765 triangles, more than fit the 180 bytes of all buffers; let nodes share meshes instead";
    assert_eq!(message, expected);
    // The same triangles a hundred times.
    let one = square()["meshes"][0]["primitives"][0].clone();
    let message = error(&[("/meshes/0/primitives", json!(vec![one; 100]))]);
    assert!(
        message.contains("meshes[0].primitives[70]: up to this one, primitives have 142 triangles"),
        "{message}"
    );
}
