//! Cache maps of mode paper: opened, then taken over.
#![no_main]

use base::{Fingerprint, Grid, ImageSize, Inventory};
use cache_map::{CacheMap, Saved, SurfacePoint};
use glam::Vec3;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let path = tetralux_fuzz::file("a.cache", &tetralux_fuzz::seal(data));
    let mut inputs = Inventory::new();
    inputs.add("camera", Fingerprint(1));
    let Ok(saved) = Saved::open(&path, &inputs, "x") else { return };
    for side in [16, 7] {
        let size = ImageSize { width: side, height: side };
        let surface = SurfacePoint { position: Vec3::ZERO, normal: Vec3::Z };
        CacheMap::new(Grid::from_fn(size, |_| Some(surface))).adopt(&saved);
    }
});
