//! The file of mode adaptive: every value that was computed, as records at points of surfaces.
//!
//! It is a kind of its own and not a version of [`crate::KIND`]: what mode paper saves is radiance at the pixels of one view,
//! which nothing but that view can use. Neither mode can make anything of the other's file.

use std::path::Path;

use atomic_file::Existing;
use base::{Fingerprint, Inventory, Rgb};
use mapfile::{Array, Error, Header, MapFile, Section};
use serde::{Deserialize, Serialize};

use crate::Value;
use crate::records::{RecordPoint, Records, order};

/// The kind of map.
pub const RECORDS_KIND: &str = "irradiance records";
/// The version of its layout.
pub const RECORDS_VERSION: u32 = 1;

#[derive(Debug, Serialize, Deserialize)]
struct Metadata {
    inventory: Inventory,
    views: Vec<Fingerprint>,
    lights: Vec<u32>,
}

/// All records of a scene.
#[derive(Clone, Debug, Default)]
pub struct RecordSet {
    /// Digests of the views of which every computed value is here.
    pub views: Vec<Fingerprint>,
    /// Visibility of lights, by their number in the scene, ascending.
    pub visibility: Vec<(u32, Records<f32>)>,
    /// The part of the irradiance from all other lights together that arrives, by channel.
    pub rest: Records<Rgb>,
    /// Indirect irradiance.
    pub indirect: Records<Rgb>,
    /// Irradiance of caustics.
    pub caustic: Records<Rgb>,
    /// Irradiance of all kinds, at the ends of specular chains.
    pub leaves: Records<Rgb>,
}

impl<T: Value> Default for Records<T> {
    fn default() -> Self {
        Self::new(Vec::new())
    }
}

impl RecordSet {
    /// Opens a file that [`RecordSet::save`] wrote, if it was made from the same inputs. The records are used where they lie:
    /// whoever is done with them asks [`MapFile::check_untouched`].
    ///
    /// # Errors
    /// When the file can't be read, is something else, damaged, or made from other inputs: it then names them, and
    /// `remedy`, the command that makes a file of those asked for.
    pub fn open(path: &Path, inputs: &Inventory, remedy: &str) -> Result<(Self, MapFile), Error> {
        let (file, metadata) = MapFile::open::<Metadata>(path, RECORDS_KIND, RECORDS_VERSION)?;
        let Metadata { inventory, views, lights } = metadata;
        if inventory != *inputs {
            return Err(Error::Stale {
                path: path.into(),
                changes: inventory.changes(inputs),
                remedy: remedy.into(),
            });
        }
        if !lights.is_sorted_by(|a, b| a < b) {
            return Err(file.corrupt("its lights are not in order"));
        }
        let visibility = lights.into_iter().map(|l| Ok((l, read(&file, &visibility_name(l))?)));
        let set = Self {
            views,
            visibility: visibility.collect::<Result<_, Error>>()?,
            rest: read(&file, "rest")?,
            indirect: read(&file, "indirect")?,
            caustic: read(&file, "caustic")?,
            leaves: read(&file, "leaves")?,
        };
        Ok((set, file))
    }

    /// Writes all records, whole or not at all; answers the size of the file in bytes.
    ///
    /// `inputs` is all that the values depend on: neither the camera nor the resolution.
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
        let names = self.visibility.iter().map(|(light, _)| visibility_name(*light));
        let names = names.chain(IRRADIANCE.map(String::from));
        let names: Vec<[String; 2]> = names.map(|name| array_names(&name)).collect();
        let (of_visibility, of_irradiance) = names.split_at(self.visibility.len());
        let mut sections = Vec::new();
        for ((_, records), [points, values]) in self.visibility.iter().zip(of_visibility) {
            sections.push(Section::new(points, &records.points));
            sections.push(Section::new(values, &records.values));
        }
        let irradiance = [&self.rest, &self.indirect, &self.caustic, &self.leaves];
        for (records, [points, values]) in irradiance.into_iter().zip(of_irradiance) {
            sections.push(Section::new(points, &records.points));
            sections.push(Section::new(values, &records.values));
        }
        let n_records = self.visibility.iter().map(|v| v.1.len()).sum::<usize>()
            + irradiance.iter().map(|r| r.len()).sum::<usize>();
        let header = Header {
            kind: RECORDS_KIND.into(),
            version: RECORDS_VERSION,
            made_by: made_by.into(),
            command: command.into(),
            inputs: inputs.fingerprint(),
            notes: vec![
                ("views".into(), self.views.len().to_string()),
                ("records".into(), n_records.to_string()),
            ],
        };
        let metadata = Metadata {
            inventory: inputs.clone(),
            views: self.views.clone(),
            lights: self.visibility.iter().map(|v| v.0).collect(),
        };
        mapfile::write(path, existing, &header, &metadata, &sections)
    }
}

/// What arrays of irradiance are called, in their order in the file.
const IRRADIANCE: [&str; 4] = ["rest", "indirect", "caustic", "leaves"];

fn visibility_name(light: u32) -> String {
    format!("visibility.{light}")
}

fn array_names(name: &str) -> [String; 2] {
    ["points", "values"].map(|array| format!("{name}.{array}"))
}

/// The records of one quantity, if they can be what was written.
fn read<T: Value>(file: &MapFile, name: &str) -> Result<Records<T>, Error> {
    let [points, values] = array_names(name);
    let points: Array<RecordPoint> = file.array(&points)?;
    let values: Array<T> = file.array(&values)?;
    let (p, v) = (&*points, &*values);
    if p.len() != v.len() || u32::try_from(p.len()).is_err() {
        let (n, m) = (p.len(), v.len());
        return Err(file.corrupt(format!("`{name}` has {n} points and {m} values")));
    }
    if !p.is_sorted_by(|a, b| order(&a.surface, &b.surface).is_lt()) {
        return Err(file.corrupt(format!("the records of `{name}` are not in order")));
    }
    let is_sound = |(p, v): (&RecordPoint, &T)| {
        let RecordPoint { surface, reach } = p;
        let is_place = surface.position.is_finite() && surface.normal.is_finite();
        // Rounding may have taken a share of light above 1.
        let is_value = (v.sound() - *v).size() < 1e-3;
        is_place && reach.is_finite() && *reach >= 0.0 && is_value
    };
    match p.iter().zip(v).position(|record| !is_sound(record)) {
        Some(i) => Err(file.corrupt(format!("record {i} of `{name}` can't have been computed"))),
        None => Ok(Records { points, values }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SurfacePoint;
    use glam::Vec3;

    fn inputs(scene: u64) -> Inventory {
        let mut inputs = Inventory::new();
        inputs.add("mesh `box`", Fingerprint(scene));
        inputs
    }

    fn point(i: u32) -> RecordPoint {
        let position = Vec3::new(0.5 * i as f32, 1.0, -2.0);
        RecordPoint { surface: SurfacePoint { position, normal: Vec3::Y }, reach: 0.25 }
    }

    fn records<T: Value>(n: u32, value: impl Fn(u32) -> T) -> Records<T> {
        Records::new((0..n).map(|i| (point(i), value(i))).collect())
    }

    fn example() -> RecordSet {
        let rgb = |scale: f32| move |i: u32| Rgb::new(i as f32, 1.0, 0.5) * scale;
        RecordSet {
            views: vec![Fingerprint(1), Fingerprint(2)],
            visibility: vec![(0, records(3, |i| i as f32 / 4.0)), (7, records(0, |_| 1.0))],
            rest: Records::default(),
            indirect: records(4, rgb(1.0)),
            caustic: records(2, rgb(2.0)),
            leaves: records(1, rgb(3.0)),
        }
    }

    fn save(set: &RecordSet, path: &Path) -> Vec<u8> {
        set.save(path, Existing::Replace, &inputs(1), "tests 1", "test {file}").unwrap();
        std::fs::read(path).unwrap()
    }

    #[test]
    fn what_is_saved_is_opened_and_used_in_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.cache");
        let bytes = save(&example(), &path);
        let (opened, _) = RecordSet::open(&path, &inputs(1), "x").unwrap();
        assert!(opened.indirect.points.is_in_file() && opened.visibility[0].1.values.is_in_file());
        assert_eq!(opened.views, example().views);
        assert_eq!(opened.indirect.at(&point(2).surface), Some((Rgb::new(2.0, 1.0, 0.5), 0.25)));
        assert_eq!(opened.visibility[0].1.at(&point(1).surface), Some((0.25, 0.25)));
        assert_eq!(opened.visibility[1].0, 7);
        // What was opened can be saved again, and is the same file.
        assert_eq!(save(&opened, &folder.path().join("b.cache")), bytes);

        let stale = RecordSet::open(&path, &inputs(2), "do this").unwrap_err().to_string();
        let end = "a.cache is stale: mesh `box` changed; make it anew with: do this";
        assert!(stale.ends_with(end), "{stale}");
    }

    #[test]
    fn the_layout_is_pinned() {
        let golden = include_bytes!("../tests/golden.records");
        let folder = tempfile::tempdir().unwrap();
        let bytes = save(&example(), &folder.path().join("a.cache"));
        assert!(bytes == golden, "raise RECORDS_VERSION with any change of layout");
        let path = folder.path().join("golden.cache");
        std::fs::write(&path, golden).unwrap();
        RecordSet::open(&path, &inputs(1), "x").unwrap();
    }

    #[test]
    fn every_damage_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.cache");
        let bytes = save(&example(), &path);
        let refused = |content: &[u8]| {
            let _ = std::fs::remove_file(&path);
            std::fs::write(&path, content).unwrap();
            assert!(RecordSet::open(&path, &inputs(1), "x").is_err());
        };
        for at in 0..bytes.len() {
            let mut bad = bytes.clone();
            bad[at] ^= 1 << (at % 8);
            refused(&bad);
            if at % 7 == 0 {
                refused(&bytes[..at]);
            }
        }
        refused(&[&bytes[..], &[0]].concat());
    }

    /// What is said of a file that is whole but holds this.
    fn forged(points: Vec<RecordPoint>, values: Vec<f32>) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.cache");
        let visibility = Records { points: points.into(), values: values.into() };
        save(&RecordSet { visibility: vec![(0, visibility)], ..example() }, &path);
        RecordSet::open(&path, &inputs(1), "x").map_or_else(|e| e.to_string(), |_| String::new())
    }

    #[test]
    fn forgeries_are_refused() {
        let fine: Vec<_> = (0..3).map(point).collect();
        assert_eq!(forged(fine.clone(), vec![0.0, 0.5, 1.0]), "");
        let says = |points: &[RecordPoint], values: &[f32], what: &str| {
            let message = forged(points.to_vec(), values.to_vec());
            assert!(message.contains(what), "{message}");
        };
        says(&fine, &[0.0, 0.5], "`visibility.0` has 3 points and 2 values");
        says(&[fine[1], fine[0]], &[0.0; 2], "the records of `visibility.0` are not in order");
        says(&[fine[1], fine[1]], &[0.0; 2], "the records of `visibility.0` are not in order");
        for bad in [-0.5, 1.5, f32::NAN, f32::INFINITY] {
            says(&fine, &[0.0, bad, 0.0], "record 1 of `visibility.0` can't have been computed");
        }
        for bad in [f32::NAN, -1.0, f32::INFINITY] {
            let point = RecordPoint { reach: bad, ..fine[0] };
            says(&[point], &[0.0], "record 0 of `visibility.0`");
        }
        let mut nowhere = fine[0];
        nowhere.surface.position.x = f32::NAN;
        says(&[nowhere], &[0.0], "record 0 of `visibility.0`");

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.cache");
        let twice = RecordSet {
            visibility: vec![(7, Records::default()), (3, Records::default())],
            ..example()
        };
        save(&twice, &path);
        let message = RecordSet::open(&path, &inputs(1), "x").unwrap_err().to_string();
        assert!(message.contains("its lights are not in order"), "{message}");
    }
}
