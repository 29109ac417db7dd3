//! Photon maps: opened, then gathered from as a renderer does.
#![no_main]

use glam::Vec3A;
use libfuzzer_sys::fuzz_target;
use photon_map::{Gather, Kernel, PhotonMaps, Scratch};

fuzz_target!(|data: &[u8]| {
    let path = tetralux_fuzz::file("a.photons", &tetralux_fuzz::seal(data));
    let Ok((maps, _)) = PhotonMaps::open(&path) else { return };
    let mut scratch = Scratch::default();
    let gather = Gather { k: 20, max_radius: 0.5, kernel: Kernel::Epanechnikov };
    for (_, set) in maps.sets() {
        for at in [Vec3A::ZERO, Vec3A::splat(0.5), Vec3A::new(1e8, -1e8, 0.0)] {
            let estimate = set.irradiance(at, Vec3A::Z, &gather, None, &mut scratch);
            std::hint::black_box(estimate);
        }
        for i in 0..set.len().min(100) {
            std::hint::black_box(set.photon(i));
        }
    }
    std::hint::black_box(maps.fingerprint());
});
