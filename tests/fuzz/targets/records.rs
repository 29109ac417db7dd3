//! Records of mode adaptive: opened, then asked.
#![no_main]

use base::{Fingerprint, Inventory};
use cache_map::{RecordSet, SurfacePoint};
use glam::Vec3;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let path = tetralux_fuzz::file("a.records", &tetralux_fuzz::seal(data));
    let mut inputs = Inventory::new();
    inputs.add("mesh `box`", Fingerprint(1));
    let Ok((set, _)) = RecordSet::open(&path, &inputs, "x") else { return };
    let at = SurfacePoint { position: Vec3::new(0.5, 1.0, -2.0), normal: Vec3::Y };
    for records in [&set.rest, &set.indirect, &set.caustic, &set.leaves] {
        std::hint::black_box(records.at(&at));
        std::hint::black_box(records.near(&records.index(), &at, 1.0));
    }
    for (_, records) in &set.visibility {
        std::hint::black_box(records.at(&at));
        std::hint::black_box(records.near(&records.index(), &at, 1.0));
    }
});
