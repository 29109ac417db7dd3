//! Several eye rays for each pixel.

use film::{Filter, reconstruct};

use crate::bench::{Bench, assert_same_layers};

/// The scene and its quality, without a size.
const FAST: &str = "scene.toml --photons a.photons --shadow-rays 4 --gather 20 --caustic-gather 10";

/// Layers of light.
const LAYERS: [&str; 6] = ["", "direct", "indirect", "specular", "caustics", "emission"];

#[test]
fn subpixels_are_the_pixels_of_a_larger_picture() {
    let bench = Bench::new();
    for (n, name, filter) in [
        (2, "box", Filter::Box),
        (3, "tent", Filter::Tent),
        (2, "gaussian", Filter::Gaussian),
        (1, "mitchell", Filter::Mitchell),
    ] {
        bench.run(&format!(
            "{FAST} --mode original --resolution 24x16 --supersample {n} --filter {name} -o a.exr --force"
        ));
        let (width, height) = (24 * n, 16 * n);
        bench
            .run(&format!("{FAST} --mode original --resolution {width}x{height} -o b.exr --force"));
        let (picture, larger) = (bench.picture("a.exr"), bench.picture("b.exr"));
        for layer in LAYERS.into_iter().filter(|layer| !layer.is_empty()) {
            let expected = reconstruct(&larger.rgb(layer).unwrap(), n, filter);
            assert_eq!(picture.rgb(layer).unwrap().values(), expected.values(), "{layer}, {name}");
        }
    }
}

#[test]
fn the_cached_modes_agree_with_the_original_on_subpixels() {
    let bench = Bench::new();
    let view = format!("{FAST} --resolution 24x16 --supersample 3");
    bench.run(&format!("{view} --mode original -o original.exr"));
    let original = bench.picture("original.exr");
    for (name, mode) in [
        ("paper", "paper --tau-direct 0 --tau-indirect 0 --tau-specular 0"),
        ("adaptive", "adaptive --error 0"),
    ] {
        bench.run(&format!("{view} --mode {mode} -o {name}.exr"));
        let picture = bench.picture(&format!("{name}.exr"));
        for layer in LAYERS {
            let [ours, theirs] = [&picture, &original].map(|p| p.rgb(layer).unwrap());
            assert_eq!(ours.values(), theirs.values(), "{layer} in mode {name}");
        }
    }
}

#[test]
fn supersampled_pictures_depend_on_no_threads() {
    let bench = Bench::new();
    // Enough work for a cache to pay.
    let view = "scene.toml --photons a.photons --shadow-rays 32 --gather 100 --resolution 72x48 \
                --supersample 3 --filter tent --mode adaptive";
    bench.run(&format!("{view} --threads 1 -o a.exr --stats a.json"));
    bench.run(&format!("{view} --threads 3 -o b.exr"));
    assert_same_layers(&bench.picture("a.exr"), &bench.picture("b.exr"), &[]);
    let stats = bench.json("a.json");
    assert_eq!(stats["supersample"], 3);
    assert_eq!(stats["resolution"], serde_json::json!([72, 48]));
    assert_eq!(stats["rays"]["eye"], 72 * 48 * 9);
    // The cache was at work.
    assert!(stats["interpolated"]["specular"].as_u64().unwrap() > 0);
    assert!(stats["error"]["held_out_pixels"].as_u64().unwrap() > 0);
}
