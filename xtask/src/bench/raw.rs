//! Finished runs, each in a file of its own, so that nothing measured is lost.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;
use base::FingerprintBuilder;
use film::{Existing, FlipStats};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::bench::outside::Outside;
use crate::bench::settings::Settings;
use crate::stats::{BuildStats, RenderStats};

/// A run of a program that has ended well.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Record {
    pub(crate) run: Run,
    pub(crate) settings: Settings,
    /// Digest of all that decides what the run does: command line, program, scene, maps.
    pub(crate) key: String,
    /// The command line.
    pub(crate) command: String,
    /// What the system says of it.
    pub(crate) outside: Outside,
    /// CPU seconds that a piece of work takes that is the same everywhere, measured just before.
    pub(crate) yardstick: f64,
    /// Digest of what the run wrote.
    pub(crate) output: String,
    /// What the program says of it.
    pub(crate) stats: Value,
    /// How far the picture is from the original; known of the warm-up of the cached modes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) quality: Option<Quality>,
}

/// Which run it is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Run {
    pub(crate) scene: String,
    pub(crate) pass: Pass,
    /// 0 is the warm-up, whose times don't count.
    pub(crate) round: u32,
}

/// The program that was run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Pass {
    /// `photon-build`.
    Build,
    /// `render-cached`, for a square picture of that many pixels each way.
    Render { size: u32, mode: String },
}

/// FLIP between a picture and the original.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Quality {
    pub(crate) mean: f64,
    pub(crate) p99: f64,
    pub(crate) worst_block_8x8: f64,
    pub(crate) share_above_0_1: f64,
}

impl From<FlipStats> for Quality {
    fn from(flip: FlipStats) -> Self {
        let FlipStats { mean, p99, worst_block_8x8, share_above_0_1 } = flip;
        Self { mean, p99, worst_block_8x8, share_above_0_1 }
    }
}

impl Run {
    /// The file of the run within the folder of all raw files.
    pub(crate) fn file(&self) -> PathBuf {
        let name = match &self.pass {
            Pass::Build => format!("pass-1-run-{}.json", self.round),
            Pass::Render { size, mode } => format!("{size:04}-{mode}-run-{}.json", self.round),
        };
        Path::new(&self.scene).join(name)
    }
}

impl Record {
    /// The account of a run of `photon-build`.
    ///
    /// # Errors
    /// When it isn't one.
    pub(crate) fn build_stats(&self) -> anyhow::Result<BuildStats> {
        BuildStats::deserialize(&self.stats).with_context(|| self.faulty())
    }

    /// The account of a run of `render-cached`.
    ///
    /// # Errors
    /// When it isn't one.
    pub(crate) fn render_stats(&self) -> anyhow::Result<RenderStats> {
        RenderStats::deserialize(&self.stats).with_context(|| self.faulty())
    }

    fn faulty(&self) -> String {
        format!("the account of {} isn't as expected", self.run.file().display())
    }

    /// All that must be the same whenever the run is made: counts, sizes, the bytes written. Time and memory aren't in it.
    pub(crate) fn work(&self) -> Value {
        let mut work = self.stats.clone();
        if let Some(fields) = work.as_object_mut() {
            for name in ["seconds", "cpu_seconds", "peak_rss_bytes", "predicted_rss_bytes"] {
                fields.remove(name);
            }
            fields.insert("output".into(), self.output.clone().into());
        }
        work
    }

    /// Keeps the record below `folder`.
    ///
    /// # Errors
    /// When the file can't be written.
    pub(crate) fn save(&self, folder: &Path) -> anyhow::Result<()> {
        let path = folder.join(self.run.file());
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent)
                .with_context(|| format!("cannot make {}", parent.display()))?;
        }
        let text = serde_json::to_string_pretty(self)?;
        atomic_file::write(&path, Existing::Replace, |out| writeln!(out, "{text}"))?;
        Ok(())
    }

    /// The record of a run below `folder`, if there is one with this key. An unreadable file is as good as none.
    pub(crate) fn find(folder: &Path, run: &Run, key: &str) -> Option<Self> {
        let text = fs::read_to_string(folder.join(run.file())).ok()?;
        let record: Self = serde_json::from_str(&text).ok()?;
        (record.run == *run && record.key == key).then_some(record)
    }
}

/// Names that lead to what differs in two accounts of work, with both values.
pub(crate) fn differences(a: &Value, b: &Value) -> Vec<String> {
    match (a, b) {
        (Value::Object(a), Value::Object(b)) => {
            let names = a.keys().chain(b.keys().filter(|name| !a.contains_key(*name)));
            let below = |name: &String| {
                let (a, b) =
                    (a.get(name).unwrap_or(&Value::Null), b.get(name).unwrap_or(&Value::Null));
                differences(a, b)
                    .into_iter()
                    .map(|rest| match rest.strip_prefix(": ") {
                        Some(_) => format!("{name}{rest}"),
                        None => format!("{name}.{rest}"),
                    })
                    .collect::<Vec<_>>()
            };
            names.flat_map(below).collect()
        }
        _ if a == b => Vec::new(),
        _ => vec![format!(": {a} became {b}")],
    }
}

/// Digest of a file.
///
/// # Errors
/// When it can't be read.
pub(crate) fn digest(path: &Path) -> anyhow::Result<String> {
    let bytes = fs::read(path).with_context(|| format!("reading {}", path.display()))?;
    Ok(base::Fingerprint::of(&bytes).to_string())
}

/// Digest of the names and contents of all files in a folder and its folders.
///
/// # Errors
/// When one can't be read.
pub(crate) fn digest_folder(folder: &Path) -> anyhow::Result<String> {
    let mut builder = FingerprintBuilder::new();
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| format!("reading {}", folder.display()))? {
        names.push(entry?.path());
    }
    names.sort();
    for path in names {
        builder.bytes(path.file_name().unwrap_or_default().as_encoded_bytes());
        let digest = if path.is_dir() { digest_folder(&path)? } else { digest(&path)? };
        builder.bytes(digest.as_bytes());
    }
    Ok(builder.finish().to_string())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn record() -> Record {
        Record {
            run: Run {
                scene: "box".into(),
                pass: Pass::Render { size: 64, mode: "paper".into() },
                round: 3,
            },
            settings: Settings::usual(),
            key: "00ff".into(),
            command: "render-cached".into(),
            outside: Outside { wall_seconds: 1.5, cpu_seconds: Some(2.0) },
            yardstick: 0.1,
            output: "abcd".into(),
            stats: json!({ "rays": { "eye": 1, "shadow": 2 }, "seconds": { "total": 1.4 }, "peak_rss_bytes": 7, "predicted_rss_bytes": 9 }),
            quality: None,
        }
    }

    #[test]
    fn records_are_found_again_by_their_key() {
        let folder = tempfile::tempdir().unwrap();
        let record = record();
        record.save(folder.path()).unwrap();
        assert_eq!(Record::find(folder.path(), &record.run, "00ff"), Some(record.clone()));
        assert_eq!(Record::find(folder.path(), &record.run, "00fe"), None);
        let other = Run { round: 4, ..record.run.clone() };
        assert_eq!(Record::find(folder.path(), &other, "00ff"), None);
        fs::write(folder.path().join(record.run.file()), "{ half").unwrap();
        assert_eq!(Record::find(folder.path(), &record.run, "00ff"), None);
    }

    #[test]
    fn other_work_is_named_and_other_times_are_not() {
        let (a, mut b) = (record(), record());
        b.stats["seconds"]["total"] = 9.0.into();
        b.stats["peak_rss_bytes"] = 8.into();
        // What is held already when it is predicted isn't the same each time.
        b.stats["predicted_rss_bytes"] = 10.into();
        assert_eq!(differences(&a.work(), &b.work()), Vec::<String>::new());
        b.stats["rays"]["shadow"] = 3.into();
        b.stats["more"] = true.into();
        b.output = "abce".into();
        assert_eq!(
            differences(&a.work(), &b.work()),
            [
                r#"output: "abcd" became "abce""#,
                "rays.shadow: 2 became 3",
                "more: null became true"
            ]
        );
    }

    #[test]
    fn a_folder_has_another_digest_when_anything_in_it_changes() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("b")).unwrap();
        fs::write(path("a"), "1").unwrap();
        fs::write(path("b/c"), "2").unwrap();
        let mut digests = vec![digest_folder(folder.path()).unwrap()];
        fs::write(path("b/c"), "3").unwrap();
        digests.push(digest_folder(folder.path()).unwrap());
        fs::rename(path("a"), path("d")).unwrap();
        digests.push(digest_folder(folder.path()).unwrap());
        digests.dedup();
        assert_eq!(digests.len(), 3, "{digests:?}");
    }
}
