//! PLY files.
#![no_main]

use libfuzzer_sys::fuzz_target;
use scene::{Options, load_parts};

const SCENE: &str = r#"camera = { origin = [0, 1, 9], target = [0, 1, 0], fov = 40 }
materials.white = { type = "diffuse", albedo = 0.7, emission = 1 }
meshes = [{ file = "a.ply", material = "white" }]"#;

fuzz_target!(|data: &[u8]| {
    tetralux_fuzz::file("a.ply", data);
    let path = tetralux_fuzz::file("scene.toml", SCENE.as_bytes());
    let options = Options { definitions: Vec::new(), lenient: false, no_external: false };
    let _ = std::hint::black_box(load_parts(&path, &options));
});
