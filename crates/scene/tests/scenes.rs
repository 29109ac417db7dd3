//! The scenes that come with the project.

use std::fs;
use std::path::{Path, PathBuf};

use base::Rgb;
use base::math::PI;
use glam::Vec3A;
use scene::{Loaded, load};

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes")
}

fn load_scene(name: &str) -> Loaded {
    load(&scenes().join(name).join("scene.toml")).unwrap_or_else(|e| panic!("{e}"))
}

/// All folders below `scenes/` that hold a scene.
fn all(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            all(&path, found);
        } else if path.file_name().is_some_and(|n| n == "scene.toml") {
            found.push(path);
        }
    }
}

#[test]
fn load_without_warnings() {
    let mut paths = Vec::new();
    all(&scenes(), &mut paths);
    assert!(!paths.is_empty(), "no scenes");
    for path in paths {
        let loaded = load(&path).unwrap_or_else(|e| panic!("{e}"));
        assert!(loaded.warnings.is_empty(), "{}", loaded.warnings.join("\n"));
    }
}

#[test]
fn lamp_of_the_cornell_box_gives_the_known_irradiance() {
    let scene = load_scene("cornell-box").scene;
    assert_eq!(scene.lights.len(), 1);
    let e = scene.lights[0].unshadowed_irradiance(Vec3A::ZERO, Vec3A::Y).unwrap();
    let expected = Rgb::new(17.0, 12.0, 4.0) * (PI * 0.01425808);
    for (e, expected) in e.to_array().into_iter().zip(expected.to_array()) {
        assert!((e / expected - 1.0).abs() < 1e-6, "{e}, not {expected}");
    }
}
