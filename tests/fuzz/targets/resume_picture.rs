//! Journals of `render-cached`, sealed: chunks of pixels that are taken for computed. The first byte chooses the mode.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use tetralux_fuzz::programs::{RENDER, journal_of, pieces, prepare, resume};

static HEADERS: LazyLock<[Vec<u8>; 2]> = LazyLock::new(|| {
    prepare();
    RENDER.map(|line| journal_of(line).0)
});

fuzz_target!(|data: &[u8]| {
    let Some((first, data)) = data.split_first() else { return };
    let mode = usize::from(*first) % RENDER.len();
    resume(RENDER[mode], &HEADERS[mode], &pieces(data));
});
