//! `OpenEXR` files: pictures to be compared, and textures.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let path = tetralux_fuzz::file("a.exr", data);
    let _ = std::hint::black_box(film::read_exr(&path));
    let _ = std::hint::black_box(film::read_rgb(&path, ""));
});
