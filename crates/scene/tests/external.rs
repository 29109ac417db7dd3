//! Which files a scene may name, with and without `no_external`.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;

use scene::{Options, load_with};

const LIBRARY: &[u8] = b"newmtl m\nKd 1 1 1\nmap_Kd stone.png\n";
const OBJ: &str =
    "mtllib LIB\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n";
const PLY: &[u8] = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
/// A Targa image of one texel.
const IMAGE: &[u8] = &[0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 24, 0, 1, 2, 3];

const HEAD: &str = "camera = { origin = [0, 1, 5], target = [0, 1, 0], fov = 40 }\n\
    materials.lamp = { type = \"diffuse\", albedo = 0, emission = 3 }\n\
    quads = [{ corner = [-2, 0, -2], edges = [[0, 0, 4], [4, 0, 0]], material = \"lamp\" }]\n";

const XML_HEAD: &str = "<scene version=\"3.0.0\"><sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/></sensor>\
    <emitter type=\"constant\"/><shape type=\"rectangle\"/>";

/// A lamp with a texture, and what it names.
fn gltf(buffer: &str, image: &str) -> String {
    let text = r#"{ "asset": { "version": "2.0" }, "nodes": [{ "mesh": 0 }, { "camera": 0, "translation": [0, 0, 5] }],
        "cameras": [{ "perspective": { "yfov": 1 } }],
        "materials": [{ "pbrMetallicRoughness": { "metallicFactor": 0, "baseColorTexture": { "index": 0 } }, "emissiveFactor": [1, 1, 1] }],
        "textures": [{ "source": 0 }], "images": [{ "uri": "IMAGE" }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 0 }, "material": 0 }] }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }], "buffers": [{ "byteLength": 36, "uri": "BUFFER" }] }"#;
    text.replace("IMAGE", image).replace("BUFFER", buffer)
}

fn toml(rest: &str) -> String {
    format!("{HEAD}{rest}")
}

/// What a scene may name: a file of the folder `scene`, and the text of the scene for it.
fn kinds() -> Vec<(&'static str, &'static str, String)> {
    let obj = |library: &str| OBJ.replace("LIB", library);
    let xml = |rest: &str| format!("{XML_HEAD}{rest}</scene>");
    let mesh = toml("meshes = [{ file = \"a.obj\" }]");
    // The OBJ file goes beside the scene; what it names is the file in question.
    let library = format!("{mesh}\n#OBJ#{}", obj("FILE"));
    vec![
        ("s.toml", "a.ply", toml("meshes = [{ file = \"FILE\", material = \"lamp\" }]")),
        (
            "s.toml",
            "stone.tga",
            toml(
                "[textures.t]\ntype = \"bitmap\"\nfile = \"FILE\"\n[materials.a]\ntype = \"diffuse\"\nalbedo_texture = \"t\"",
            ),
        ),
        ("s.toml", "stone.exr", toml("lights = [{ type = \"environment\", file = \"FILE\" }]")),
        ("s.toml", "stone.tga", toml("lights = [{ type = \"environment\", file = \"FILE\" }]")),
        ("s.toml", "a.mtl", library),
        ("s.toml", "stone.tga", format!("{mesh}\n#OBJ#{}", obj("FILE.mtl"))),
        (
            "s.xml",
            "a.ply",
            xml("<shape type=\"ply\"><string name=\"filename\" value=\"FILE\"/></shape>"),
        ),
        ("s.xml", "more.xml", xml("<include filename=\"FILE\"/>")),
        (
            "s.xml",
            "stone.tga",
            xml(
                "<shape type=\"rectangle\"><bsdf type=\"diffuse\"><texture type=\"bitmap\" name=\"reflectance\">\
                <string name=\"filename\" value=\"FILE\"/></texture></bsdf></shape>",
            ),
        ),
        (
            "s.xml",
            "stone.tga",
            xml("<emitter type=\"envmap\"><string name=\"filename\" value=\"FILE\"/></emitter>")
                .replace("<emitter type=\"constant\"/>", ""),
        ),
        ("s.gltf", "a.bin", gltf("FILE", "below/stone.png")),
        ("s.gltf", "stone.png", gltf("below/a.bin", "FILE")),
    ]
}

/// Loads `scene/s.toml` or `scene/s.xml` in which `FILE` stands for `named`.
fn load(top: &Path, scene: &str, text: &str, named: &str, no_external: bool) -> Result<(), String> {
    let text = match text.split_once("\n#OBJ#") {
        Some((text, obj)) => {
            let library = LIBRARY.to_vec();
            let obj = if obj.contains("FILE.mtl") {
                let map = String::from_utf8(library).unwrap().replace("stone.png", named);
                fs::write(top.join("scene/b.mtl"), map).unwrap();
                obj.replace("FILE.mtl", "b.mtl")
            } else {
                obj.replace("FILE", named)
            };
            fs::write(top.join("scene/a.obj"), obj).unwrap();
            text
        }
        None => text,
    };
    let path = top.join("scene").join(scene);
    fs::write(&path, text.replace("FILE", named)).unwrap();
    let options = Options { definitions: Vec::new(), lenient: false, no_external };
    load_with(&path, &options).map(|_| ()).map_err(|error| error.to_string())
}

#[test]
fn nothing_outside_the_folder_is_read_without_external_files() {
    let size = base::ImageSize { width: 1, height: 1 };
    let mut picture = film::Picture::new(size, String::new());
    picture.push_rgb("", &base::Grid::from_fn(size, |_| base::Rgb::ONE));
    for (scene, file, text) in kinds() {
        let folder = tempfile::tempdir().unwrap();
        let top = folder.path();
        fs::create_dir_all(top.join("scene/below")).unwrap();
        fs::create_dir(top.join("other")).unwrap();
        for place in ["scene", "scene/below", "other"] {
            let path = |name: &str| top.join(place).join(name);
            fs::write(path("a.ply"), PLY).unwrap();
            fs::write(path("stone.tga"), IMAGE).unwrap();
            let triangle = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
            fs::write(path("a.bin"), triangle.map(f32::to_le_bytes).concat()).unwrap();
            image::RgbImage::from_pixel(1, 1, image::Rgb([9, 8, 7]))
                .save(path("stone.png"))
                .unwrap();
            fs::write(path("a.mtl"), "newmtl m\nKd 1 1 1\n").unwrap();
            fs::write(path("more.xml"), "<scene version=\"3.0.0\"></scene>").unwrap();
            film::write_exr(&path("stone.exr"), film::Existing::Replace, &picture).unwrap();
        }
        symlink(top.join("other").join(file), top.join("scene").join(format!("link-{file}")))
            .unwrap();
        symlink(top.join("other"), top.join("scene/link")).unwrap();
        symlink(top.join("scene/below"), top.join("scene/link-below")).unwrap();

        let inside = [
            file.to_string(),
            format!("below/{file}"),
            format!("./below/../{file}"),
            format!("../scene/{file}"),
            format!("link-below/{file}"),
            top.join("scene").join(file).display().to_string(),
        ];
        let outside = [
            format!("../other/{file}"),
            format!("below/../../other/{file}"),
            format!("link-{file}"),
            format!("link/{file}"),
            top.join("other").join(file).display().to_string(),
        ];
        for named in inside.iter().chain(&outside) {
            let loaded = load(top, scene, &text, named, false);
            assert!(loaded.is_ok(), "{named}: {loaded:?}");
        }
        for named in &inside {
            let loaded = load(top, scene, &text, named, true);
            assert!(loaded.is_ok(), "{named}: {loaded:?}");
        }
        for named in &outside {
            let message = load(top, scene, &text, named, true).unwrap_err();
            assert!(
                message.contains(": it lies outside the folder of the scene, where nothing is read with --no-external; ")
                    && message.contains(file),
                "{named}: {message}"
            );
        }
    }
}

#[test]
fn the_scene_itself_is_no_way_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.toml");
    let elsewhere = tempfile::tempdir().unwrap();
    fs::write(elsewhere.path().join("s.toml"), HEAD).unwrap();
    symlink(elsewhere.path().join("s.toml"), &path).unwrap();
    let load = |no_external| {
        load_with(&path, &Options { definitions: Vec::new(), lenient: false, no_external })
    };
    assert!(load(false).is_ok());
    let message = load(true).unwrap_err().to_string();
    assert!(message.contains("it lies outside the folder of the scene"), "{message}");
}
