//! The photon maps of a scene, or the command that makes them.

use std::ffi::OsString;
use std::path::Path;

use anyhow::bail;
use mapfile::{Error, Header};
use photon_map::PhotonMaps;
use scene::Scene;

/// Opens the photon maps of a scene.
///
/// # Errors
/// When there are none, when they can't be read, or when they were made of something else.
pub(crate) fn open(path: &Path, scene_path: &Path, scene: &Scene) -> anyhow::Result<PhotonMaps> {
    if !path.exists() {
        bail!("there is no {}; make it with: {}", path.display(), command(scene_path, path, []));
    }
    let (photons, file) = PhotonMaps::open(path)?;
    let (then, now) = (&photons.metadata.inventory, scene.inventory());
    if then != now {
        bail!(Error::Stale {
            path: path.into(),
            changes: then.changes(now),
            remedy: remedy(path, scene_path, &photons, file.header()),
        });
    }
    Ok(photons)
}

/// The command that makes the maps anew. That in the file won't do if they are of another scene, or were made elsewhere.
fn remedy(path: &Path, scene_path: &Path, photons: &PhotonMaps, header: &Header) -> String {
    if header.command.starts_with(&command(scene_path, Path::new("{file}"), [])) {
        return header.remedy(path);
    }
    let made = &photons.metadata;
    let options = [
        ("--photons", made.emitted),
        ("--seed", made.seed),
        ("--max-bounces", made.max_bounces.into()),
    ];
    let mut words: Vec<OsString> = Vec::new();
    for (name, value) in options {
        words.extend([name.into(), value.to_string().into()]);
    }
    if photons.direct.is_some() {
        words.extend(["--store".into(), "direct".into()]);
    }
    words.push("--force".into());
    command(scene_path, path, words)
}

fn command(scene: &Path, photons: &Path, options: impl IntoIterator<Item = OsString>) -> String {
    let words = ["photon-build".into(), scene.into(), "-o".into(), photons.into()];
    cli::command_line(words.into_iter().chain(options))
}
