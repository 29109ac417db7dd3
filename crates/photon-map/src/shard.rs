//! The file of a share of the photons, as they landed: unsorted, to be merged with the others.

use std::path::Path;

use atomic_file::Existing;
use base::{Photon, PhotonClass, Share};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use mapfile::{Array, Error, Header, MapFile, Section};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::Metadata;
use crate::build::largest_flux;

/// The kind of map.
pub const SHARD_KIND: &str = "photon shard";
/// The version of its layout.
pub const SHARD_VERSION: u32 = 2;

/// The number of classes.
const N_CLASSES: usize = PhotonClass::ALL.len();

/// What made a shard, and what it is a share of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShardMetadata {
    /// Which share.
    pub share: Share,
    /// What became of the photons of this share; scene, seed, bounces and flux are those of all.
    pub metadata: Metadata,
    /// Photons of each light, of all shares together.
    pub emitted_by_light: Vec<u64>,
    /// Whether photons of class *direct* are stored.
    pub stores_direct: bool,
    /// Whether photons of class *focused* are stored.
    pub stores_focused: bool,
    /// Share of the photons that is aimed.
    pub aim: f32,
    /// The program that made it, with its version.
    pub made_by: String,
    /// The command that makes the whole map, with `{file}` for its name.
    pub command_of_all: String,
}

/// What the file holds as metadata.
#[derive(Debug, Serialize, Deserialize)]
struct Contents {
    about: ShardMetadata,
    /// Largest channel of flux of each class, in the order of [`PhotonClass::ALL`].
    largest: [f32; N_CLASSES],
}

/// A photon as it lies in the file.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Landed {
    position: [f32; 3],
    flux: [f32; 3],
    normal: u32,
}

impl From<Photon> for Landed {
    fn from(Photon { position, normal, flux }: Photon) -> Self {
        Self { position: position.into(), flux: flux.to_array(), normal: normal.into() }
    }
}

impl From<Landed> for Photon {
    fn from(landed: Landed) -> Self {
        Self {
            position: Vec3::from(landed.position),
            normal: landed.normal as u16,
            flux: landed.flux.into(),
        }
    }
}

/// A share of the photons, in a file that is mapped.
#[derive(Debug)]
pub struct PhotonShard {
    /// What made it.
    pub about: ShardMetadata,
    classes: [Array<Landed>; N_CLASSES],
    pub(crate) largest: [f32; N_CLASSES],
}

/// Writes a share of the photons, whole or not at all; answers the size of the file in bytes. Photons are given by class,
/// in the order of [`PhotonClass::ALL`] and of their emission.
///
/// # Errors
/// When the file can't be written, or exists and isn't to be replaced.
pub fn save_shard(
    path: &Path,
    existing: Existing,
    about: ShardMetadata,
    photons: [Vec<Photon>; PhotonClass::ALL.len()],
    command: &str,
) -> Result<u64, Error> {
    let largest = PhotonClass::ALL.map(|class| largest_flux(&photons[class as usize]));
    // A photon takes as much room either way, so this happens in place.
    let classes =
        photons.map(|photons| photons.into_iter().map(Landed::from).collect::<Vec<Landed>>());
    let Metadata { seed, emitted, .. } = about.metadata;
    let mut notes = vec![
        ("share".into(), about.share.to_string()),
        ("seed".into(), seed.to_string()),
        ("emitted".into(), emitted.to_string()),
    ];
    notes.extend(
        PhotonClass::ALL.into_iter().zip(&classes).map(|(class, photons)| {
            (format!("stored_{}", class.name()), photons.len().to_string())
        }),
    );
    let header = Header {
        kind: SHARD_KIND.into(),
        version: SHARD_VERSION,
        made_by: about.made_by.clone(),
        command: command.into(),
        inputs: about.metadata.inventory.fingerprint(),
        notes,
    };
    let sections: Vec<Section<'_>> = (PhotonClass::ALL.into_iter().zip(&classes))
        .map(|(class, photons)| Section::new(class.name(), photons))
        .collect();
    mapfile::write(path, existing, &header, &Contents { about, largest }, &sections)
}

impl PhotonShard {
    /// Opens a file that [`save_shard`] wrote.
    ///
    /// # Errors
    /// When the file can't be read, is something else, of another version, or damaged.
    pub fn open(path: &Path) -> Result<(Self, MapFile), Error> {
        let (file, Contents { about, largest }) =
            MapFile::open::<Contents>(path, SHARD_KIND, SHARD_VERSION)?;
        let array = |class: PhotonClass| file.array::<Landed>(class.name());
        let [direct, caustic, indirect, focused] = PhotonClass::ALL.map(array);
        let classes = [direct?, caustic?, indirect?, focused?];
        for (class, (photons, &largest)) in
            PhotonClass::ALL.iter().zip(classes.iter().zip(&largest))
        {
            let is_sound = |photon: &Landed| {
                photon.position.iter().all(|x| x.is_finite())
                    && photon.flux.iter().all(|f| (0.0..=largest).contains(f))
            };
            if !largest.is_finite() || !photons.par_iter().all(is_sound) {
                return Err(file.corrupt(format!(
                    "{} photons lie at no place, or carry no number",
                    class.name()
                )));
            }
        }
        Ok((Self { about, classes, largest }, file))
    }

    /// The number of photons of a class.
    pub fn n_photons(&self, class: PhotonClass) -> usize {
        self.photons(class).len()
    }

    pub(crate) fn photons(&self, class: PhotonClass) -> &[Landed] {
        &self.classes[class as usize]
    }
}
