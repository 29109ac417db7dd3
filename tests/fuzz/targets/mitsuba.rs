//! Scenes of Mitsuba.
#![no_main]

use libfuzzer_sys::fuzz_target;
use scene::{Options, load_parts};

fuzz_target!(|data: &[u8]| {
    let path = tetralux_fuzz::file("scene.xml", data);
    for lenient in [false, true] {
        let options = Options { definitions: vec![("n".into(), "1".into())], lenient, no_external: false };
        let _ = std::hint::black_box(load_parts(&path, &options));
    }
});
