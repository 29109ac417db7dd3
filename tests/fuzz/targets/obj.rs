//! OBJ files and, behind a line of @, their MTL.
#![no_main]

use libfuzzer_sys::fuzz_target;
use scene::{Options, load_parts};

const SCENE: &str = r#"camera = { origin = [0, 1, 9], target = [0, 1, 0], fov = 40 }
materials.white = { type = "diffuse", albedo = 0.7, emission = 1 }
meshes = [{ file = "a.obj" }]"#;

fuzz_target!(|data: &[u8]| {
    let split = data.windows(3).position(|w| w == b"\n@\n").unwrap_or(data.len());
    tetralux_fuzz::file("a.obj", &data[..split]);
    tetralux_fuzz::file("a.mtl", data.get(split + 3..).unwrap_or_default());
    let path = tetralux_fuzz::file("scene.toml", SCENE.as_bytes());
    let options = Options { definitions: Vec::new(), lenient: false, no_external: false };
    let _ = std::hint::black_box(load_parts(&path, &options));
});
