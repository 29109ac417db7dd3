//! `photon-build info`: what is in a map.

use std::io::{self, ErrorKind, Write};
use std::path::Path;

use anyhow::Context;
use photon_map::PhotonMaps;

/// Writes an account of the map to standard output.
///
/// # Errors
/// When the map can't be read.
pub(crate) fn info(path: &Path) -> anyhow::Result<()> {
    let (maps, file) = PhotonMaps::open(path)?;
    let header = file.header();
    let m = &maps.metadata;
    let mut text = format!(
        "{}: {} of version {}, made by {}\n",
        path.display(),
        header.kind,
        header.version,
        header.made_by
    );
    let mut line = |name: &str, value: String| text.push_str(&format!("  {name:<12} {value}\n"));
    line("command", header.remedy(path));
    line("scene", header.inputs.to_string());
    line("photons", maps.fingerprint().to_string());
    line("seed", m.seed.to_string());
    line(
        "emitted",
        format!("{} ({} W)", m.emitted, m.flux.to_array().map(|w| w.to_string()).join(" ")),
    );
    let share = |n: u64| format!("{n} ({:.2} %)", n as f64 / m.emitted.max(1) as f64 * 100.0);
    line("absorbed", share(m.absorbed));
    line("escaped", share(m.escaped));
    line("cut", share(m.cut));
    for (class, set) in maps.sets() {
        let flux = set.total_flux().map(|w| format!("{w:.6}")).join(" ");
        line(
            class.name(),
            format!("{} photons, {:.1} MB, {flux} W", set.len(), set.n_bytes() as f64 * 1e-6),
        );
    }
    match io::stdout().write_all(text.as_bytes()) {
        // Whoever reads has seen enough.
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(()),
        result => result.context("cannot write to standard output"),
    }
}
