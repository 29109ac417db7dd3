//! Serialized meshes: a file as it is, and one stream that is packed here, so that what lies in it is tried, too. The first
//! byte tells which, and the version.
#![no_main]

use std::io::Write;

use libfuzzer_sys::fuzz_target;
use scene::{Options, load_parts};

const SCENE: &str = r#"<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="40"/></sensor>
<emitter type="constant"/><shape type="serialized"><string name="filename" value="a.serialized"/></shape></scene>"#;

fuzz_target!(|data: &[u8]| {
    let Some((kind, rest)) = data.split_first() else { return };
    let bytes = if kind & 1 == 0 {
        rest.to_vec()
    } else {
        let start = vec![0x1c, 4, 3 + (kind >> 1 & 1), 0];
        let mut encoder = flate2::write::ZlibEncoder::new(start, flate2::Compression::fast());
        encoder.write_all(rest).expect("it is written to memory");
        encoder.finish().expect("it is written to memory")
    };
    tetralux_fuzz::file("a.serialized", &bytes);
    let path = tetralux_fuzz::file("scene.xml", SCENE.as_bytes());
    let options = Options { definitions: Vec::new(), lenient: false, no_external: false };
    let _ = std::hint::black_box(load_parts(&path, &options));
});
