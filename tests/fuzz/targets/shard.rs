//! Shards of photons: opened, then merged, alone if they are all.
#![no_main]

use base::Share;
use libfuzzer_sys::fuzz_target;
use photon_map::PhotonShard;

fuzz_target!(|data: &[u8]| {
    let path = tetralux_fuzz::file("a.shard", &tetralux_fuzz::seal(data));
    let Ok((shard, _)) = PhotonShard::open(&path) else { return };
    if shard.about.share == Share::WHOLE {
        std::hint::black_box(photon_map::merge(&[shard]));
    }
});
