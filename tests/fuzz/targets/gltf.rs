//! Files of glTF, text and binary.
#![no_main]

use libfuzzer_sys::fuzz_target;
use scene::{Options, load_parts};

fuzz_target!(|data: &[u8]| {
    let path = tetralux_fuzz::file("scene.gltf", data);
    for lenient in [false, true] {
        let options = Options { definitions: Vec::new(), lenient, no_external: true };
        let _ = std::hint::black_box(load_parts(&path, &options));
    }
});
