//! Parts of pictures: opened, then assembled, alone if they are all.
#![no_main]

use base::Window;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let path = tetralux_fuzz::file("a.part.exr", data);
    let Ok(part) = film::Part::open(&path) else { return };
    if part.window() == Window::whole(part.window().whole) {
        let _ = std::hint::black_box(film::assemble_rgb(&[part]));
    }
});
