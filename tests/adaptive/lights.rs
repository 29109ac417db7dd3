//! Many lights.

use serde_json::Value;

use super::bench::Bench;

/// A long hall seen from its end, lamps in rows close above the floor: of each a few pixels around see much.
fn hall(n_lights: u32) -> String {
    let mut scene = String::from(
        r#"
camera = { origin = [0, 6, 13], target = [0, 0, 0], fov = 42 }
[materials.white]
type = "diffuse"
albedo = 0.7
[[quads]]
corner = [-5, 0, -5]
edges = [[0, 0, 10], [10, 0, 0]]
material = "white"
[[spheres]]
center = [1, 0.4, 1]
radius = 0.4
material = "white"
[[boxes]]
min = [-2, 0, -1]
max = [-1.2, 0.7, 0]
material = "white"
"#,
    );
    let columns = f64::from(n_lights).sqrt().ceil() as u32;
    let spacing = 10.0 / columns as f32;
    // The same light in all, however many there are.
    let emission = 2.0 * 100.0 / (n_lights as f32 * 0.01);
    for i in 0..n_lights {
        let [x, z] = [i % columns, i / columns].map(|k| (k as f32 + 0.45) * spacing - 5.0);
        scene += &format!(
            "[materials.lamp{i}]\ntype = \"diffuse\"\nalbedo = 0\nemission = {emission}\n\
             [[quads]]\ncorner = [{x}, 0.9, {z}]\nedges = [[0.1, 0, 0], [0, 0, 0.1]]\nmaterial = \"lamp{i}\"\n"
        );
    }
    scene
}

#[test]
fn many_lights_cost_less_than_in_the_original() {
    for n in [1, 10, 300] {
        let pair = Bench::of_text(&hall(n), "20K").both("--resolution 192x192 --shadow-rays 8");
        let of = |stats: &Value| stats["rays"]["shadow"].as_u64().unwrap();
        let [ours, theirs] = pair.stats.each_ref().map(of);
        let flip = pair.difference("").flip;
        println!("{n} lights: {ours} shadow rays, {theirs} in mode original; {flip:?}");
        // Half of this is usual; lights that got a ray by chance and count for no others make it 0.017.
        if flip.mean > 0.01 {
            let folder = pair.show(&format!("adaptive-{n}-lights"), "");
            panic!("{n} lights: {flip:?}, see {}", folder.display());
        }
        // Four lights have a visibility of their own; all others share one, and few rays. With one light all may be
        // computed, where that takes less time than interpolating.
        let most = match n {
            1 => theirs + theirs / 20,
            10 => theirs / 2,
            _ => theirs / 10,
        };
        assert!(ours <= most, "{n} lights: {ours} shadow rays instead of {theirs}");
    }
}

/// A block and a ball under an image of seven by four texels, one of them a hundred times as bright as the others.
#[test]
fn images_around_the_scene_are_cached() {
    let mut image = String::from("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 7\n");
    for i in 0..28 {
        // Mantissas and an exponent: texels of few bits, in letters.
        image += match i {
            9 => "}zx~",
            0..14 => "@Pdx",
            _ => "0( w",
        };
    }
    let scene = r#"
camera = { origin = [0, 3, 9], target = [0, 0.6, 0], fov = 34 }
lights = [{ type = "environment", file = "sky.hdr", radiance = 50, rotate = { axis = [1, 0, 0], degrees = 20 } }]
materials.white = { type = "diffuse", albedo = 0.7 }
quads = [{ corner = [-4, 0, -4], edges = [[0, 0, 8], [8, 0, 0]], material = "white" }]
spheres = [{ center = [1, 0.8, 0.4], radius = 0.8, material = "white" }]
boxes = [{ min = [-2, 0, -1], max = [-0.8, 1.4, 0], material = "white" }]
"#;
    let pair = Bench::of_files(&[("scene.toml", scene), ("sky.hdr", &image)], "50K")
        .both("--resolution 192x192 --shadow-rays 64");
    let flip = pair.difference("").flip;
    let of = |stats: &Value| stats["rays"]["shadow"].as_u64().unwrap();
    let [ours, theirs] = pair.stats.each_ref().map(of);
    println!("image: {ours} shadow rays, {theirs} in mode original; {flip:?}");
    if flip.mean > 0.015 {
        panic!("{flip:?}, see {}", pair.show("adaptive-image", "").display());
    }
    assert!(ours <= theirs / 2, "{ours} shadow rays instead of {theirs}");
}
