//! The file of a cache map: everything that was computed, nothing that was interpolated.

use std::path::Path;

use atomic_file::Existing;
use base::{Component, Components, ImageSize, Inventory, Pixel, Rgb};
use bytemuck::{Pod, Zeroable};
use mapfile::{Error, Header, MapFile, Section};
use serde::{Deserialize, Serialize};

use crate::map::{CacheMap, Origin, SurfacePoint};

/// The kind of map.
pub const KIND: &str = "cache map";
/// The version of its layout.
pub const VERSION: u32 = 1;

#[derive(Debug, Serialize, Deserialize)]
struct Metadata {
    inventory: Inventory,
    size: ImageSize,
}

/// A pixel of which something was computed.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct Entry {
    x: u32,
    y: u32,
    surface: SurfacePoint,
    /// In the order of [`Component::ALL`].
    radiance: [Rgb; 4],
    /// Two bits a component: 1 sampled, 2 traced.
    origins: u32,
}

/// What a file holds, until a [`CacheMap`] adopts it.
#[derive(Debug)]
pub struct Saved {
    size: ImageSize,
    entries: mapfile::Array<Entry>,
    file: MapFile,
}

impl Saved {
    /// Opens a file that [`CacheMap::save`] wrote, if it was made from the same inputs.
    ///
    /// # Errors
    /// When the file can't be read, is something else, damaged, or made from other inputs: it then names them, and
    /// `remedy`, the command that makes a file of those asked for. The command that made the file would make the same again.
    pub fn open(path: &Path, inputs: &Inventory, remedy: &str) -> Result<Self, Error> {
        let (file, metadata) = MapFile::open::<Metadata>(path, KIND, VERSION)?;
        if metadata.inventory != *inputs {
            return Err(Error::Stale {
                path: path.into(),
                changes: metadata.inventory.changes(inputs),
                remedy: remedy.into(),
            });
        }
        let entries = file.array::<Entry>("entries")?;
        let Metadata { size, .. } = metadata;
        let is_sound = |e: &Entry| {
            let finite = e.surface.position.is_finite() && e.surface.normal.is_finite();
            e.x < size.width
                && e.y < size.height
                && finite
                && e.radiance.iter().all(|c| c.is_finite())
        };
        match entries.iter().position(|e| !is_sound(e)) {
            Some(i) => {
                Err(file.corrupt(format!("entry {i} lies outside the picture, or is not a number")))
            }
            None => Ok(Self { size, entries, file }),
        }
    }

    /// To be asked when it was adopted, and before anything is shown.
    ///
    /// # Errors
    /// When the file was changed meanwhile.
    pub fn check_untouched(&self) -> Result<(), Error> {
        self.file.check_untouched()
    }

    /// The size of the picture it was made for.
    pub fn size(&self) -> ImageSize {
        self.size
    }
}

impl CacheMap {
    /// Takes over what a file holds.
    ///
    /// At the same resolution all values are known, should they be needed again: thresholds, region and fraction can
    /// change without any pixel being computed twice, and the picture is that of a run without the file. At another
    /// resolution complete samples become candidates at the pixels where they fall.
    pub fn adopt(&mut self, saved: &Saved) {
        let size = self.size();
        if saved.size == size {
            for entry in saved.entries.iter() {
                let pixel = Pixel { x: entry.x, y: entry.y };
                for (i, component) in Component::ALL.into_iter().enumerate() {
                    let is_computed = entry.origins >> (2 * i) & 3 != 0;
                    if is_computed && self.surfaces()[pixel].is_some() {
                        self.set(component, pixel, Some(entry.radiance[i]), Origin::Known);
                    }
                }
            }
            return;
        }
        self.borrowed_at = vec![0; size.n_pixels()];
        let scale = |at: u32, from: u32, to: u32| {
            ((u64::from(at) * 2 + 1) * u64::from(to) / (u64::from(from) * 2)).min(u64::from(to) - 1)
                as u32
        };
        for entry in saved.entries.iter().filter(|e| e.origins == 0b01_01_01_01) {
            let pixel = Pixel {
                x: scale(entry.x, saved.size.width, size.width),
                y: scale(entry.y, saved.size.height, size.height),
            };
            let at = &mut self.borrowed_at[size.index(pixel)];
            if *at == 0 {
                let [direct, indirect, specular, caustic] = entry.radiance;
                self.borrowed.push((
                    pixel,
                    entry.surface,
                    Components { direct, indirect, specular, caustic },
                ));
                *at = self.borrowed.len() as u32;
            }
        }
    }

    /// Those of the chosen pixels that need sampling: one for each cell of the choice that has no borrowed sample.
    ///
    /// `fraction` is that of [`crate::choose_pixels`], which has made the choice.
    pub fn unserved(&self, chosen: &[Pixel], fraction: f64) -> Vec<Pixel> {
        if self.borrowed.is_empty() {
            return chosen.to_vec();
        }
        let side = 1.0 / fraction.sqrt();
        let cell = |p: Pixel| {
            let index = |v: u32| ((f64::from(v) + 0.5) / side) as u32;
            (index(p.y), index(p.x))
        };
        let mut served: Vec<_> = self.borrowed.iter().map(|b| cell(b.0)).collect();
        served.sort_unstable();
        chosen.iter().filter(|&&p| served.binary_search(&cell(p)).is_err()).copied().collect()
    }

    /// Writes all that was computed, whole or not at all; answers the size of the file in bytes.
    ///
    /// `inputs` is all that the values depend on, but not the size of the picture.
    ///
    /// # Errors
    /// When the file can't be written, or exists and isn't to be replaced.
    pub fn save(
        &self,
        path: &Path,
        existing: Existing,
        inputs: &Inventory,
        made_by: &str,
        command: &str,
    ) -> Result<u64, Error> {
        let size = self.size();
        let mut entries = Vec::new();
        for i in 0..size.n_pixels() {
            let pixel = size.pixel(i);
            let Some(surface) = self.surfaces()[pixel] else { continue };
            let code = |component| match self.origins(component)[pixel] {
                Origin::Sampled => 1,
                Origin::Traced | Origin::Known => 2,
                Origin::None | Origin::Interpolated => 0,
            };
            let origins = Component::ALL.into_iter().rev().fold(0, |codes, c| codes << 2 | code(c));
            if origins != 0 {
                let radiance = Component::ALL.map(|c| match code(c) {
                    0 => Rgb::BLACK,
                    _ => self.values(c)[pixel],
                });
                entries.push(Entry { x: pixel.x, y: pixel.y, surface, radiance, origins });
            }
        }
        let header = Header {
            kind: KIND.into(),
            version: VERSION,
            made_by: made_by.into(),
            command: command.into(),
            inputs: inputs.fingerprint(),
            notes: vec![
                ("resolution".into(), format!("{}x{}", size.width, size.height)),
                ("pixels".into(), entries.len().to_string()),
            ],
        };
        let metadata = Metadata { inventory: inputs.clone(), size };
        mapfile::write(path, existing, &header, &metadata, &[Section::new("entries", &entries)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Fingerprint, Grid};
    use glam::Vec3;

    fn inputs(camera: u64) -> Inventory {
        let mut inputs = Inventory::new();
        inputs.add("camera", Fingerprint(camera));
        inputs
    }

    fn map(size: ImageSize) -> CacheMap {
        let at = |p: Pixel| {
            Vec3::new(p.x as f32 / size.width as f32, p.y as f32 / size.height as f32, 0.0)
        };
        CacheMap::new(Grid::from_fn(size, |p| {
            Some(SurfacePoint { position: at(p), normal: Vec3::Z })
        }))
    }

    #[test]
    fn what_was_computed_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.cache");
        let size = ImageSize { width: 40, height: 30 };
        let chosen = crate::choose_pixels(size, 1.0 / 16.0, 0);
        let mut first = map(size);
        for (i, component) in Component::ALL.into_iter().enumerate() {
            let values: Vec<_> =
                chosen.iter().map(|p| Rgb::new(p.x as f32, p.y as f32, i as f32)).collect();
            first.record(component, &chosen, &values, Origin::Sampled);
        }
        let traced =
            size.pixel((0..size.n_pixels()).find(|&i| !chosen.contains(&size.pixel(i))).unwrap());
        first.record(Component::Direct, &[traced], &[Rgb::splat(7.0)], Origin::Traced);
        first.save(&path, Existing::Refuse, &inputs(1), "test", "test {file}").unwrap();

        let mut same = map(size);
        same.adopt(&Saved::open(&path, &inputs(1), "x").unwrap());
        for component in Component::ALL {
            assert_eq!(same.values(component), first.values(component));
            assert_eq!(same.origins(component)[chosen[0]], Origin::Known);
            assert!(same.missing(component, &chosen).is_empty());
            assert_eq!(same.origins(component)[chosen[0]], Origin::Sampled);
        }
        assert_eq!(same.origins(Component::Direct)[traced], Origin::Known);

        // At twice the size every second cell is served.
        let double = ImageSize { width: 80, height: 60 };
        let mut larger = map(double);
        larger.adopt(&Saved::open(&path, &inputs(1), "x").unwrap());
        let chosen_larger = crate::choose_pixels(double, 1.0 / 16.0, 0);
        let unserved = larger.unserved(&chosen_larger, 1.0 / 16.0);
        assert!(
            unserved.len() < chosen_larger.len()
                && unserved.len() >= chosen_larger.len() - chosen.len()
        );
        assert_eq!(larger.borrowed.len(), chosen.len());

        let refused = Saved::open(&path, &inputs(2), "do this").unwrap_err().to_string();
        assert!(
            refused.ends_with("is stale: camera changed; make it anew with: do this"),
            "{refused}"
        );
    }

    #[test]
    fn the_layout_is_pinned() {
        let size = ImageSize { width: 3, height: 2 };
        let pixels = [Pixel { x: 1, y: 0 }, Pixel { x: 2, y: 1 }];
        let mut made = map(size);
        for (i, component) in Component::ALL.into_iter().enumerate() {
            let values = [Rgb::new(i as f32, 0.5, 0.25), Rgb::ONE];
            made.record(component, &pixels, &values, Origin::Sampled);
        }
        made.record(Component::Caustic, &[Pixel { x: 0, y: 0 }], &[Rgb::ONE], Origin::Traced);
        let golden = include_bytes!("../tests/golden.cache");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.cache");
        made.save(&path, Existing::Refuse, &inputs(1), "tests 1", "test {file}").unwrap();
        let is_same = std::fs::read(&path).unwrap() == golden;
        assert!(is_same, "raise VERSION with any change of layout");
        std::fs::write(&path, golden).unwrap();
        Saved::open(&path, &inputs(1), "x").unwrap();
    }
}
