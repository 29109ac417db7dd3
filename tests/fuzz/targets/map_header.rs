//! Headers of maps, sealed and not.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    for bytes in [data.to_vec(), tetralux_fuzz::seal(data)] {
        let path = tetralux_fuzz::file("a.map", &bytes);
        if let Ok(header) = mapfile::read_header(&path) {
            std::hint::black_box(header.remedy(&path));
        }
    }
});
