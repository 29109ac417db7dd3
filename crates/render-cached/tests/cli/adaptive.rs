//! `--mode adaptive` against `--mode original`: nothing lost, and an error that is told as it is.

use film::{Difference, compare};

use crate::bench::Bench;

/// Compares a layer of two pictures.
fn difference(bench: &Bench, a: &str, b: &str, layer: &str) -> Difference {
    let layer_of = |name: &str| bench.picture(name).rgb(layer).unwrap();
    compare(&layer_of(a), &layer_of(b), 0.0).unwrap().0
}

#[test]
fn an_error_of_zero_is_the_original() {
    let bench = Bench::new();
    bench.render("--mode original -o original.exr");
    bench.render("--mode adaptive --error 0 -o adaptive.exr");
    let (original, adaptive) = (bench.picture("original.exr"), bench.picture("adaptive.exr"));
    let names = |p: &film::Picture| p.channels().map(|c| c.0.to_owned()).collect::<Vec<_>>();
    assert_eq!(names(&original), names(&adaptive));
    for ((name, a), (_, b)) in original.channels().zip(adaptive.channels()) {
        assert!(a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits()), "{name} differs");
    }
}

#[test]
fn the_error_follows_its_target_and_is_told() {
    let bench = Bench::new();
    bench.photon_build("scene.toml -o b.photons --photons 100K");
    let size = "scene.toml --photons b.photons --resolution 240x160 --shadow-rays 16 --gather 200";
    bench.run(&format!("{size} --mode original -o original.exr"));
    let mut last = (f64::INFINITY, 0);
    for target in [0.04, 0.02, 0.01] {
        bench.run(&format!(
            "{size} --mode adaptive --error {target} -o a.exr --stats a.json --force"
        ));
        let stats = bench.json("a.json");
        let told = stats["error"]["measured_mean"].as_f64().unwrap();
        let traced = stats["traced"]["indirect"].as_u64().unwrap();
        let flip = difference(&bench, "a.exr", "original.exr", "").flip;
        assert!(flip.mean < 1.3 * target, "{} for {target}", flip.mean);
        assert!((told / flip.mean - 1.0).abs() < 0.4, "told {told}, is {}", flip.mean);
        assert!(flip.mean < last.0 && traced > last.1, "{target}: {flip:?}, {traced} traced");
        last = (flip.mean, traced);
    }
    // Computed pixels are what they are in the original.
    let (original, adaptive) = (bench.picture("original.exr"), bench.picture("a.exr"));
    let traced = adaptive.channel("traced.indirect").unwrap();
    let layers = ["indirect.R", "indirect.G", "indirect.B"].map(|name| {
        (original.channel(name).unwrap().to_vec(), adaptive.channel(name).unwrap().to_vec())
    });
    for (a, b) in &layers {
        for i in (0..a.len()).filter(|&i| traced[i] == 1.0) {
            assert!((a[i] - b[i]).abs() <= 1e-6 * a[i].abs(), "pixel {i}: {} and {}", a[i], b[i]);
        }
    }
}

/// A floor under a lamp, with many small things between.
fn occluders(things: impl Iterator<Item = String>) -> String {
    let mut scene = String::from(
        r#"
camera = { origin = [0, 5, 0.01], target = [0, 0, 0], fov = 42 }
materials.white = { type = "diffuse", albedo = 0.7 }
materials.lamp = { type = "diffuse", albedo = 0, emission = 12 }
[[quads]]
name = "floor"
corner = [-2, 0, -2]
edges = [[0, 0, 4], [4, 0, 0]]
material = "white"
[[quads]]
name = "lamp"
corner = [2.5, 3, -0.2]
edges = [[0.4, 0, 0], [0, 0, 0.4]]
material = "lamp"
"#,
    );
    scene.extend(things);
    scene
}

/// The shadows of a scene at 320x320, in both modes.
fn shadows(scene: &str) -> Difference {
    let bench = Bench::of(scene);
    let size = "scene.toml --photons a.photons --resolution 320x320 --shadow-rays 64 --gather 50";
    bench.run(&format!("{size} --mode original -o original.exr"));
    bench.run(&format!("{size} --mode adaptive -o adaptive.exr"));
    difference(&bench, "adaptive.exr", "original.exr", "direct")
}

#[test]
fn small_occluders_keep_their_shadows() {
    let balls = (0..60).map(|i| {
        let (x, z) = (f64::from(i % 10) * 0.37 - 1.7, f64::from(i / 10) * 0.61 - 1.6);
        let radius = 0.015 + 0.002 * f64::from(i % 7);
        format!("[[spheres]]\ncenter = [{x:.3}, 0.2, {z:.3}]\nradius = {radius:.4}\nmaterial = \"white\"\n")
    });
    let flip = shadows(&occluders(balls)).flip;
    assert!(flip.worst_block_8x8 <= 0.15 && flip.share_above_0_1 <= 0.0002, "{flip:?}");
}

/// Light is interpolated, and what reflects it isn't: edges of a texture cost nothing, and stay where they are.
#[test]
fn textures_stay_sharp() {
    let plain = occluders(std::iter::once(
        "[[spheres]]\ncenter = [0, 0.5, 0]\nradius = 0.5\nmaterial = \"white\"\n".into(),
    ));
    let textured = plain.replace(
        "albedo = 0.7 }",
        "albedo_texture = \"tiles\" }\ntextures.tiles = { type = \"checkerboard\", colors = [0.1, [0.9, 0.6, 0.3]], scale = [23, 29], rotate = 20 }",
    );
    let render = |scene: &str| {
        let bench = Bench::of(scene);
        let size =
            "scene.toml --photons a.photons --resolution 320x320 --shadow-rays 64 --gather 50";
        bench.run(&format!("{size} --mode original -o original.exr"));
        bench.run(&format!("{size} --mode adaptive -o adaptive.exr --stats a.json"));
        let traced = bench.json("a.json")["traced"]["direct"].as_u64().unwrap();
        (difference(&bench, "adaptive.exr", "original.exr", "").flip, traced, bench)
    };
    let (_, n_plain, _) = render(&plain);
    let (flip, n_textured, bench) = render(&textured);
    assert!(flip.mean <= 0.013 && flip.worst_block_8x8 <= 0.15, "{flip:?}");
    assert!(n_textured as f64 <= 1.3 * n_plain as f64, "{n_textured} instead of {n_plain}");
    let [original, adaptive] =
        ["original.exr", "adaptive.exr"].map(|name| bench.picture(name).rgb("Albedo").unwrap());
    assert_eq!(original, adaptive);
    let green: std::collections::BTreeSet<u32> =
        adaptive.values().iter().map(|a| a.g.to_bits()).collect();
    assert_eq!(green.len(), 2, "the two colors of the texture");
}

#[test]
fn thin_rods_keep_their_shadows() {
    let rods = (0..12).map(|i| {
        let x = f64::from(i) * 0.3 - 1.65;
        let width = 0.008 + 0.002 * f64::from(i);
        format!(
            "[[boxes]]\nmin = [{x:.3}, 0.3, -1.8]\nmax = [{:.4}, {:.4}, 1.8]\nmaterial = \"white\"\n",
            x + width,
            0.3 + width
        )
    });
    let flip = shadows(&occluders(rods)).flip;
    assert!(flip.worst_block_8x8 <= 0.15 && flip.share_above_0_1 <= 0.0002, "{flip:?}");
}
