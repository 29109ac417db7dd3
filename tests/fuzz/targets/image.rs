//! Images for textures; the first byte chooses what the ending says.
#![no_main]

use libfuzzer_sys::fuzz_target;
use scene::{Options, load_parts};

fuzz_target!(|data: &[u8]| {
    let Some((first, data)) = data.split_first() else { return };
    let ending = ["png", "jpg", "tga", "bmp", "hdr"][usize::from(*first) % 5];
    tetralux_fuzz::file(&format!("a.{ending}"), data);
    let scene = format!(
        r#"camera = {{ origin = [0, 1, 9], target = [0, 1, 0], fov = 40 }}
textures.t = {{ type = "bitmap", file = "a.{ending}" }}
materials.white = {{ type = "diffuse", albedo_texture = "t", emission = 1 }}
quads = [{{ corner = [-1, 0, -1], edges = [[0, 0, 2], [2, 0, 0]], material = "white" }}]
"#
    );
    let path = tetralux_fuzz::file("scene.toml", scene.as_bytes());
    let options = Options { definitions: Vec::new(), lenient: false, no_external: false };
    let _ = std::hint::black_box(load_parts(&path, &options));
});
