//! The file of photon maps.

use std::path::Path;

use atomic_file::Existing;
use base::{Fingerprint, FingerprintBuilder, Inventory, PhotonClass, Rgb};
use mapfile::{Error, Header, MapFile, Section};
use serde::{Deserialize, Serialize};

use crate::flux;
use crate::set::{LEAF, LeafBox, PhotonSet};

/// The kind of map.
pub const KIND: &str = "photon map";
/// The version of its layout.
pub const VERSION: u32 = 1;

/// What made the photons, and what became of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Metadata {
    /// The parts of the scene that photons depend on.
    pub inventory: Inventory,
    /// Seed of all random streams.
    pub seed: u64,
    /// Surfaces a photon could meet before its path was cut.
    pub max_bounces: u32,
    /// Photons emitted.
    pub emitted: u64,
    /// Of these, absorbed.
    pub absorbed: u64,
    /// Of these, gone out of the scene.
    pub escaped: u64,
    /// Of these, cut.
    pub cut: u64,
    /// Rays traced.
    pub rays: u64,
    /// Flux emitted, in watts.
    pub flux: Rgb,
}

/// What the file holds as metadata.
#[derive(Debug, Serialize, Deserialize)]
struct Contents {
    metadata: Metadata,
    sets: Vec<SetMetadata>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct SetMetadata {
    class: String,
    n: u64,
    flux_scale: f32,
}

/// The photons of a scene by class.
#[derive(Clone, Debug)]
pub struct PhotonMaps {
    /// What made them.
    pub metadata: Metadata,
    /// Photons straight from the lights, if they were stored.
    pub direct: Option<PhotonSet>,
    /// Photons that came through specular bounces only.
    pub caustic: PhotonSet,
    /// Photons that were scattered diffusely.
    pub indirect: PhotonSet,
    /// Those of them whose last bounce was specular, if they were stored.
    pub focused: Option<PhotonSet>,
}

/// The arrays of a set, in the order in which they are written.
const ARRAYS: [&str; 3] = ["splits", "boxes", "leaves"];

fn array_name(class: &str, array: &str) -> String {
    format!("{class}.{array}")
}

impl PhotonMaps {
    /// Each set with its class.
    pub fn sets(&self) -> impl Iterator<Item = (PhotonClass, &PhotonSet)> {
        let sets = [
            (PhotonClass::Direct, self.direct.as_ref()),
            (PhotonClass::Caustic, Some(&self.caustic)),
            (PhotonClass::Indirect, Some(&self.indirect)),
            (PhotonClass::Focused, self.focused.as_ref()),
        ];
        sets.into_iter().filter_map(|(class, set)| Some((class, set?)))
    }

    /// A digest of all photons.
    pub fn fingerprint(&self) -> Fingerprint {
        let mut digest = FingerprintBuilder::new();
        digest.pod(&[self.metadata.inventory.fingerprint().0]);
        for (class, set) in self.sets() {
            digest.bytes(class.name().as_bytes()).pod(&[set.n as u64]).pod(&[set.flux_scale]);
            digest.pod(&set.splits).pod(&set.boxes).pod(&set.leaves);
        }
        digest.finish()
    }

    /// Writes all sets to one file, whole or not at all; answers its size in bytes.
    ///
    /// `made_by` is the program and its version, `command` the command line that makes the file anew.
    ///
    /// # Errors
    /// When the file can't be written, or exists and isn't to be replaced.
    pub fn save(
        &self,
        path: &Path,
        existing: Existing,
        made_by: &str,
        command: &str,
    ) -> Result<u64, Error> {
        let metadata = &self.metadata;
        let sets = self
            .sets()
            .map(|(class, set)| SetMetadata {
                class: class.name().into(),
                n: set.n as u64,
                flux_scale: set.flux_scale,
            })
            .collect();
        let mut notes = vec![
            ("seed".into(), metadata.seed.to_string()),
            ("emitted".into(), metadata.emitted.to_string()),
        ];
        notes.extend(
            self.sets().map(|(class, set)| (format!("stored_{}", class.name()), set.n.to_string())),
        );
        let header = Header {
            kind: KIND.into(),
            version: VERSION,
            made_by: made_by.into(),
            command: command.into(),
            inputs: metadata.inventory.fingerprint(),
            notes,
        };
        let names: Vec<[String; 3]> = self
            .sets()
            .map(|(class, _)| ARRAYS.map(|array| array_name(class.name(), array)))
            .collect();
        let mut sections = Vec::new();
        for ((_, set), [splits, boxes, leaves]) in self.sets().zip(&names) {
            sections.push(Section::new(splits, &set.splits));
            sections.push(Section::new(boxes, &set.boxes));
            sections.push(Section::new(leaves, &set.leaves));
        }
        mapfile::write(
            path,
            existing,
            &header,
            &Contents { metadata: metadata.clone(), sets },
            &sections,
        )
    }

    /// Opens a file that [`PhotonMaps::save`] wrote. The photons are used where they lie.
    ///
    /// # Errors
    /// When the file can't be read, is something else, of another version, or damaged.
    pub fn open(path: &Path) -> Result<(Self, MapFile), Error> {
        let (file, contents) = MapFile::open(path, KIND, VERSION)?;
        let maps = Self::read(contents, &file, |set| read_set(&file, set))?;
        Ok((maps, file))
    }

    /// Opens a file as [`PhotonMaps::open`] does, but leaves its photons where they are, unread: all sets are empty. For
    /// who asks what made them, and which they are ([`MapFile::digest`]).
    ///
    /// # Errors
    /// Those of [`PhotonMaps::open`], but for what is wrong with photons.
    pub fn open_without_photons(path: &Path) -> Result<(Self, MapFile), Error> {
        let (file, contents) = MapFile::open_in_part(path, KIND, VERSION)?;
        let maps = Self::read(contents, &file, |_| Ok(PhotonSet::build(&[])))?;
        Ok((maps, file))
    }

    fn read(
        Contents { metadata, sets }: Contents,
        file: &MapFile,
        read_set: impl Fn(&SetMetadata) -> Result<PhotonSet, Error>,
    ) -> Result<Self, Error> {
        let set = |class: PhotonClass| {
            sets.iter().find(|s| s.class == class.name()).map(&read_set).transpose()
        };
        let required = |class: PhotonClass| {
            set(class)?.ok_or_else(|| {
                file.corrupt(format!("the set of {} photons is missing", class.name()))
            })
        };
        Ok(Self {
            direct: set(PhotonClass::Direct)?,
            caustic: required(PhotonClass::Caustic)?,
            indirect: required(PhotonClass::Indirect)?,
            focused: set(PhotonClass::Focused)?,
            metadata,
        })
    }
}

fn read_set(file: &MapFile, of: &SetMetadata) -> Result<PhotonSet, Error> {
    let name = |array| array_name(&of.class, array);
    let set = PhotonSet {
        n: usize::try_from(of.n).unwrap_or(usize::MAX),
        flux_scale: of.flux_scale,
        splits: file.array(&name("splits"))?,
        boxes: file.array(&name("boxes"))?,
        leaves: file.array(&name("leaves"))?,
    };
    let n_leaves = set.n.div_ceil(LEAF);
    let lengths_agree = u32::try_from(set.n).is_ok()
        && [set.splits.len(), set.boxes.len(), set.leaves.len()] == [n_leaves; 3];
    let is_sound = |around: &LeafBox| {
        around.min.iter().zip(&around.step).all(|(min, step)| {
            let max = min + 65535.0 * step;
            min.is_finite() && max.is_finite() && *step >= 0.0
        })
    };
    let carries_numbers = of.flux_scale > 0.0 && (of.flux_scale * flux::MAX).is_finite();
    if !lengths_agree {
        return Err(file.corrupt(format!("the arrays of {} photons differ in length", of.class)));
    }
    if !(set.boxes.iter().all(is_sound) && carries_numbers) {
        return Err(
            file.corrupt(format!("{} photons lie at no place, or carry no number", of.class))
        );
    }
    Ok(set)
}
