//! Machine-readable accounts.

use std::io::Write;
use std::path::Path;

use atomic_file::Existing;
use serde::Serialize;

/// Writes `stats` as one JSON object.
///
/// # Errors
/// When the file can't be written, or exists and isn't to be replaced.
pub fn write_stats(path: &Path, existing: Existing, stats: &impl Serialize) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(stats)?;
    atomic_file::write(path, existing, |out| writeln!(out, "{text}"))?;
    Ok(())
}
