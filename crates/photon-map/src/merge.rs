//! From the shares of the photons to their maps.

use base::PhotonClass;

use crate::build::Loose;
use crate::shard::PhotonShard;
use crate::{Metadata, PhotonMaps, PhotonSet};

/// The maps that one process would have made of all shares, in rayon's current pool. The shards must be all shares of one
/// run, in order.
///
/// The shards are read from where they lie, class by class. Photons take 24 bytes each in memory while their class is
/// sorted and 12.9 afterwards.
///
/// # Panics
/// When there are no shards, or more than 2^32 - 1 photons of a class.
pub fn merge(shards: &[PhotonShard]) -> PhotonMaps {
    let mut metadata = Metadata { emitted: 0, ..shards[0].about.metadata.clone() };
    (metadata.absorbed, metadata.escaped, metadata.cut, metadata.rays) = (0, 0, 0, 0);
    for share in shards.iter().map(|shard| &shard.about.metadata) {
        metadata.emitted += share.emitted;
        metadata.absorbed += share.absorbed;
        metadata.escaped += share.escaped;
        metadata.cut += share.cut;
        metadata.rays += share.rays;
    }
    let stores_direct = shards[0].about.stores_direct;
    let direct = stores_direct.then(|| set(shards, PhotonClass::Direct));
    let caustic = set(shards, PhotonClass::Caustic);
    let indirect = set(shards, PhotonClass::Indirect);
    let stores_focused = shards[0].about.stores_focused;
    let focused = stores_focused.then(|| set(shards, PhotonClass::Focused));
    PhotonMaps { metadata, direct, caustic, indirect, focused }
}

fn set(shards: &[PhotonShard], class: PhotonClass) -> PhotonSet {
    let n = shards.iter().map(|shard| shard.n_photons(class)).sum();
    let largest = shards.iter().map(|shard| shard.largest[class as usize]).fold(0.0, f32::max);
    let mut loose = Loose::new(n, largest);
    for shard in shards {
        loose.extend(shard.photons(class), |landed| (*landed).into());
    }
    loose.into_set()
}
