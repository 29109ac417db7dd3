//! What the programs say of a run in the JSON of `--stats`.

use std::fs;
use std::path::Path;

use anyhow::Context;
use base::{Component, Components};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// The account of `photon-build`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct BuildStats {
    pub(crate) version: String,
    pub(crate) threads: u64,
    pub(crate) emitted: u64,
    pub(crate) stored: Stored,
    pub(crate) rays: u64,
    pub(crate) file_bytes: u64,
    pub(crate) seconds: BuildSeconds,
    pub(crate) cpu_seconds: BuildSeconds,
    pub(crate) peak_rss_bytes: u64,
}

/// Photons in the maps, by class.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Stored {
    pub(crate) direct: u64,
    pub(crate) caustic: u64,
    pub(crate) indirect: u64,
}

/// Time of pass 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct BuildSeconds {
    pub(crate) load: f64,
    pub(crate) trace: f64,
    pub(crate) tree: f64,
    pub(crate) write: f64,
    pub(crate) total: f64,
}

/// The account of `render-cached`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RenderStats {
    pub(crate) version: String,
    pub(crate) mode: String,
    pub(crate) resolution: [u32; 2],
    pub(crate) threads: u64,
    pub(crate) seconds: RenderSeconds,
    pub(crate) cpu_seconds: RenderSeconds,
    pub(crate) traced: Components<u64>,
    pub(crate) interpolated: Components<u64>,
    pub(crate) rays: Rays,
    pub(crate) photons_visited: u64,
    /// The mode's own measure of its error, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) error: Option<ErrorStats>,
    pub(crate) peak_rss_bytes: u64,
}

/// Time of pass 2, by stage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RenderSeconds {
    pub(crate) load: f64,
    pub(crate) primary: f64,
    pub(crate) direct: f64,
    pub(crate) indirect: f64,
    pub(crate) specular: f64,
    pub(crate) caustic: f64,
    pub(crate) cache: f64,
    pub(crate) write: f64,
    pub(crate) total: f64,
}

/// Rays by kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Rays {
    pub(crate) eye: u64,
    pub(crate) specular: u64,
    pub(crate) shadow: u64,
    pub(crate) gather: u64,
}

/// An error in FLIP: aimed at, and measured at pixels that were held out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ErrorStats {
    pub(crate) target: f64,
    pub(crate) measured_mean: f64,
    pub(crate) measured_p995: f64,
    pub(crate) held_out_pixels: u64,
}

impl RenderSeconds {
    /// Time of a component.
    pub(crate) fn of(&self, component: Component) -> f64 {
        match component {
            Component::Direct => self.direct,
            Component::Indirect => self.indirect,
            Component::Specular => self.specular,
            Component::Caustic => self.caustic,
        }
    }

    /// Pass 2 itself: eye rays, components, and what the cache costs.
    pub(crate) fn pass_2(&self) -> f64 {
        let components: f64 = Component::ALL.into_iter().map(|c| self.of(c)).sum();
        self.primary + components + self.cache
    }

    /// Opening scene and maps, writing the picture, and whatever else no stage counts as its own.
    pub(crate) fn rest(&self) -> f64 {
        self.total - self.pass_2()
    }
}

/// Reads an account.
///
/// # Errors
/// When the file can't be read, or lacks what the account should have.
pub(crate) fn read<T: DeserializeOwned>(path: &Path) -> anyhow::Result<T> {
    let text = fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    serde_json::from_str(&text).with_context(|| format!("reading {}", path.display()))
}
