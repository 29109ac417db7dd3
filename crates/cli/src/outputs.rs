//! Outputs that can't be meant.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::bail;
use atomic_file::Existing;

use crate::WrongUsage;

/// Finds out before hours of work whether all outputs can be written, no two are the same file, and none is an input.
///
/// # Errors
/// [`WrongUsage`] for outputs that are named twice or are inputs, and those of [`atomic_file::check`].
pub fn check_outputs(
    outputs: &[&Path],
    inputs: &[&Path],
    existing: Existing,
) -> anyhow::Result<()> {
    let inputs: Vec<PathBuf> = inputs.iter().map(|path| place(path)).collect();
    let mut seen = Vec::new();
    for path in outputs {
        let place = place(path);
        if inputs.contains(&place) {
            bail!(WrongUsage(format!(
                "{} is an input; give the output another name",
                path.display()
            )));
        }
        if seen.contains(&place) {
            bail!(WrongUsage(format!(
                "{} is named as an output twice; give each its own name",
                path.display()
            )));
        }
        seen.push(place);
    }
    for path in outputs {
        atomic_file::check(path, existing)?;
    }
    Ok(())
}

/// Where a path leads, the same for all ways to write it.
fn place(path: &Path) -> PathBuf {
    let in_folder = || {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = fs::canonicalize(folder.unwrap_or(Path::new("."))).ok()?;
        Some(folder.join(path.file_name()?))
    };
    fs::canonicalize(path).ok().or_else(in_folder).unwrap_or_else(|| path.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_file_is_found_under_other_names() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("scene.toml"), "").unwrap();
        fs::create_dir(at("out")).unwrap();
        let check = |outputs: &[&str], inputs: &[&str]| {
            let outputs: Vec<_> = outputs.iter().map(|name| at(name)).collect();
            let inputs: Vec<_> = inputs.iter().map(|name| at(name)).collect();
            let outputs: Vec<_> = outputs.iter().map(PathBuf::as_path).collect();
            let inputs: Vec<_> = inputs.iter().map(PathBuf::as_path).collect();
            let error = check_outputs(&outputs, &inputs, Existing::Replace).err()?;
            assert!(error.is::<WrongUsage>(), "{error}");
            Some(error.to_string().replace(&*folder.path().to_string_lossy(), ""))
        };
        assert_eq!(check(&["a.exr", "out/a.exr", "a.png"], &["scene.toml", "none"]), None);
        assert_eq!(
            check(&["a.exr", "out/../a.exr"], &[]).as_deref(),
            Some("/out/../a.exr is named as an output twice; give each its own name")
        );
        assert_eq!(
            check(&["a.exr", "out/../scene.toml"], &["scene.toml"]).as_deref(),
            Some("/out/../scene.toml is an input; give the output another name")
        );
        assert_eq!(
            check(&["new"], &["out/../new"]).as_deref(),
            Some("/new is an input; give the output another name")
        );
    }
}
