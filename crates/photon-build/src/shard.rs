//! `--shard I/N`: a share of the photons, as they landed.

use std::path::Path;

use atomic_file::Existing;
use base::PhotonClass;
use photon_map::ShardMetadata;
use photon_trace::Traced;

use crate::stats::Written;

/// Saves a share of the photons; `command` makes it anew.
///
/// # Errors
/// When the file can't be written.
pub(crate) fn save(
    path: &Path,
    existing: Existing,
    about: ShardMetadata,
    traced: Traced,
    command: &str,
) -> anyhow::Result<Written> {
    let ShardMetadata { stores_direct, stores_focused, .. } = about;
    let metadata = about.metadata.clone();
    let focused = if stores_focused { traced.focused } else { Vec::new() };
    let photons = [traced.direct, traced.caustic, traced.indirect, focused];
    let stored = PhotonClass::ALL.map(|class| {
        let is_stored = match class {
            PhotonClass::Direct => stores_direct,
            PhotonClass::Caustic | PhotonClass::Indirect => true,
            PhotonClass::Focused => stores_focused,
        };
        is_stored.then_some(photons[class as usize].len())
    });
    let n_bytes = photons.iter().map(|photons| size_of_val(photons.as_slice())).sum();
    let file_bytes = photon_map::save_shard(path, existing, about, photons, command)?;
    Ok(Written { metadata, fingerprint: None, stored, n_bytes, file_bytes })
}
