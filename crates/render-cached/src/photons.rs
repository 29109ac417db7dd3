//! The photon maps of a scene, or the command that makes them.

use std::ffi::OsString;
use std::path::Path;

use anyhow::bail;
use base::Fingerprint;
use cli::SceneOptions;
use mapfile::{Error, Header, MapFile};
use photon_map::PhotonMaps;
use scene::Scene;

/// Photon maps, the file where they lie, and a digest of all photons.
#[derive(Debug)]
pub(crate) struct Photons {
    pub(crate) maps: PhotonMaps,
    pub(crate) file: MapFile,
    pub(crate) fingerprint: Fingerprint,
}

/// Opens the photon maps of a scene.
///
/// If no photon will be asked for, and a file with this digest is known to hold photons of that fingerprint, none is read:
/// tiles of layers only ask whether the photons are the same.
///
/// # Errors
/// When there are none, when they can't be read, or when they were made of something else.
pub(crate) fn open(
    path: &Path,
    scene_path: &Path,
    scene_options: &SceneOptions,
    scene: &Scene,
    known: Option<(u64, Fingerprint)>,
) -> anyhow::Result<Photons> {
    let words = || scene_options.words().into_iter().map(OsString::from);
    if !path.exists() {
        bail!(
            "there is no {}; make it with: {}",
            path.display(),
            command(scene_path, path, words())
        );
    }
    let check = |maps: &PhotonMaps, file: &MapFile| {
        let (then, now) = (&maps.metadata.inventory, scene.inventory());
        if then == now {
            return Ok(());
        }
        Err(Error::Stale {
            path: path.into(),
            changes: then.changes(now),
            remedy: remedy(path, scene_path, scene_options, maps, file.header()),
        })
    };
    if let Some((digest, fingerprint)) = known {
        let (maps, file) = PhotonMaps::open_without_photons(path)?;
        if file.digest() == digest {
            check(&maps, &file)?;
            return Ok(Photons { maps, file, fingerprint });
        }
    }
    let (maps, file) = PhotonMaps::open(path)?;
    check(&maps, &file)?;
    // All photons are read for it: once.
    let fingerprint = maps.fingerprint();
    Ok(Photons { maps, file, fingerprint })
}

/// The command that makes maps anew from as many photons, with those for final gathering.
pub(crate) fn for_gathering(
    path: &Path,
    scene_path: &Path,
    scene_options: &SceneOptions,
    photons: &PhotonMaps,
) -> String {
    command(scene_path, path, options(scene_options, photons, Some("gather")))
}

/// The command that makes the maps anew. That in the file won't do if they are of another scene, or were made elsewhere.
fn remedy(
    path: &Path,
    scene_path: &Path,
    scene_options: &SceneOptions,
    photons: &PhotonMaps,
    header: &Header,
) -> String {
    // A scene of Mitsuba with other parameters is another scene.
    let is_option = |word: &&str| word.starts_with("-D") || *word == "--lenient";
    let same_options = header.command.split(' ').filter(is_option).eq(scene_options.words());
    let start = command(scene_path, Path::new("{file}"), []);
    if same_options && header.command.starts_with(&start) {
        return header.remedy(path);
    }
    let stored = match (&photons.direct, &photons.focused) {
        (_, Some(_)) => Some("gather"),
        (Some(_), None) => Some("direct"),
        (None, None) => None,
    };
    command(scene_path, path, options(scene_options, photons, stored))
}

/// The options of a command that makes maps like these.
fn options(
    scene_options: &SceneOptions,
    photons: &PhotonMaps,
    stored: Option<&str>,
) -> Vec<OsString> {
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
    if let Some(class) = stored {
        words.extend(["--store".into(), class.into()]);
    }
    words.extend(scene_options.words().into_iter().map(Into::into));
    words.push("--force".into());
    words
}

fn command(scene: &Path, photons: &Path, options: impl IntoIterator<Item = OsString>) -> String {
    let words = ["photon-build".into(), scene.into(), "-o".into(), photons.into()];
    cli::command_line(words.into_iter().chain(options))
}
