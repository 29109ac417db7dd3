//! The scenes that come with the project.

use std::fs;
use std::path::{Path, PathBuf};

use base::math::PI;
use base::{Ray, Rgb};
use glam::Vec3A;
use scene::{Loaded, Scene, load};

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes")
}

fn load_scene(name: &str) -> Loaded {
    load(&scenes().join(name).join("scene.toml")).unwrap_or_else(|e| panic!("{e}"))
}

/// All folders below `scenes/` that hold a scene.
fn all(folder: &Path, found: &mut Vec<PathBuf>) {
    let entries = fs::read_dir(folder).expect("the folder of scenes");
    let mut entries: Vec<_> = entries.map(|e| e.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            all(&path, found);
        } else if path.file_name().is_some_and(|n| n == "scene.toml" || n == "scene.xml") {
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

#[test]
fn small_scenes_have_the_light_their_comments_promise() {
    let irradiance = |scene: &Scene, at: Vec3A| {
        scene.lights[0].unshadowed_irradiance(at, Vec3A::Y).map_or(0.0, |e| e.g)
    };
    let scene = load_scene("tests/point-over-plane").scene;
    assert!((irradiance(&scene, Vec3A::ZERO) - 2.5).abs() < 1e-6);
    let scene = load_scene("tests/form-factor").scene;
    assert!((irradiance(&scene, Vec3A::ZERO) - 0.752275).abs() < 1e-6);
    let n = 200;
    let place = |i: i32| (i as f32 + 0.5) / n as f32 - 0.5;
    let sum: f64 = (0..n * n)
        .map(|i| f64::from(irradiance(&scene, Vec3A::new(place(i % n), 0.0, place(i / n)))))
        .sum();
    let factor = sum / f64::from(n * n) / f64::from(PI);
    assert!((factor - 0.1998249).abs() < 1e-5, "{factor}");
    let scene = load_scene("tests/furnace").scene;
    let flux = scene.lights[0].flux(&scene.bounds()).r;
    assert!((flux / (24.0 * PI) - 1.0).abs() < 1e-6, "{flux}");
    let scene = load_scene("tests/each-light").scene;
    let names: Vec<_> = scene.lights.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(names, ["panel", "ember", "point", "spot", "sun", "sky"]);
}

#[test]
fn the_rabbit_stands_just_above_the_floor() {
    let scene = load_scene("rabbit").scene;
    let names: Vec<_> = scene.lights.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(names, ["lamp", "side lamp"]);
    let n = scene.accel.n_primitives() - 2 * 7;
    assert!((60_000..80_000).contains(&n), "{n} triangles");
    // From below, the first surface above the floor: many rays, since the feet are small.
    let lowest = (0..10_000)
        .filter_map(|i| {
            let (x, z) = ((i % 100) as f32 * 0.02 - 1.0, (i / 100) as f32 * 0.02 - 1.0);
            let ray = Ray::unbounded(Vec3A::new(x, 1e-3, z), Vec3A::Y);
            let hit = scene.accel.closest_hit(&ray)?;
            let surface = scene.accel.surface(&ray, &hit);
            let is_glass = scene.material(&surface).name == "glass";
            is_glass.then_some(surface.position.y)
        })
        .fold(f32::INFINITY, f32::min);
    assert!((0.009..0.05).contains(&lowest), "{lowest}");
}
