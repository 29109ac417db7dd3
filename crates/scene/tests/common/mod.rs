//! Scenes in folders of their own.

use std::fs;
use std::path::Path;

use scene::{Loaded, load};
use tempfile::TempDir;

/// A folder with these files.
pub(crate) fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = TempDir::new().expect("a folder for tests");
    for (name, bytes) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("files lie in the folder")).expect("a folder");
        fs::write(path, bytes).expect("a file for tests");
    }
    folder
}

/// What loading `scene.toml` gives: the scene, or the message. Names of files begin at the folder.
pub(crate) fn load_files(files: &[(&str, &[u8])]) -> Result<Loaded, String> {
    let folder = folder(files);
    let result = load(&folder.path().join("scene.toml"));
    let local = |text: &str| local(folder.path(), text);
    match result {
        Ok(mut loaded) => {
            loaded.warnings = loaded.warnings.iter().map(|w| local(w)).collect();
            Ok(loaded)
        }
        Err(error) => Err(local(&error.to_string())),
    }
}

fn local(folder: &Path, text: &str) -> String {
    text.replace(&format!("{}/", folder.display()), "")
}
