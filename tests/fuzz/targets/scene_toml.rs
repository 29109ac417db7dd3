//! Scene files.
#![no_main]

use libfuzzer_sys::fuzz_target;
use scene::{Options, load_parts};

fuzz_target!(|data: &[u8]| {
    let path = tetralux_fuzz::file("scene.toml", data);
    let options = Options { definitions: Vec::new(), lenient: false, no_external: false };
    let _ = std::hint::black_box(load_parts(&path, &options));
});
