//! Layers of mode adaptive: made into a picture.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use tetralux_fuzz::programs::{LAYERS, prepare, run};

static PREPARED: LazyLock<()> = LazyLock::new(prepare);

fuzz_target!(|data: &[u8]| {
    LazyLock::force(&PREPARED);
    // They tell the folder that they were made in.
    tetralux_fuzz::file("a.layers", &tetralux_fuzz::seal(&tetralux_fuzz::at_home(data)));
    let _ = std::hint::black_box(run(LAYERS[1]));
});
