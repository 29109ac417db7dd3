//! The JSON of `--stats`. Names are a contract.

use serde::Serialize;

#[derive(Debug, Serialize)]
pub(crate) struct Stats {
    pub(crate) program: &'static str,
    pub(crate) version: &'static str,
    pub(crate) scene: String,
    pub(crate) fingerprint: String,
    pub(crate) seed: u64,
    pub(crate) threads: usize,
    pub(crate) emitted: u64,
    pub(crate) stored: Stored,
    pub(crate) absorbed: u64,
    pub(crate) escaped: u64,
    pub(crate) cut: u64,
    pub(crate) rays: u64,
    pub(crate) bytes_per_photon: f64,
    pub(crate) file_bytes: u64,
    pub(crate) seconds: Seconds,
    pub(crate) cpu_seconds: Seconds,
    pub(crate) peak_rss_bytes: u64,
}

#[derive(Debug, Serialize)]
pub(crate) struct Stored {
    pub(crate) direct: usize,
    pub(crate) caustic: usize,
    pub(crate) indirect: usize,
}

#[derive(Debug, Serialize)]
pub(crate) struct Seconds {
    pub(crate) load: f64,
    pub(crate) bvh: f64,
    pub(crate) trace: f64,
    pub(crate) tree: f64,
    pub(crate) write: f64,
    pub(crate) total: f64,
}
