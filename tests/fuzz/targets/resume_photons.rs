//! Journals of `photon-build`, sealed: batches of photons that are taken for traced.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use tetralux_fuzz::programs::{BUILD, journal_of, pieces, prepare, resume};

static HEADER: LazyLock<Vec<u8>> = LazyLock::new(|| {
    prepare();
    journal_of(BUILD).0
});

fuzz_target!(|data: &[u8]| resume(BUILD, &HEADER, &pieces(data)));
