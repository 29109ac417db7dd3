//! Depth of field: eye rays scattered over a lens.

use super::bench::{Bench, metadata};
use base::Rgb;

/// Blocks at three distances on a floor, and a small lamp far behind what is in focus.
fn scene(lens: &str) -> String {
    format!(
        r#"
camera = {{ origin = [0, 1.6, 6], target = [0, 0.4, 0], fov = 38, {lens} }}
[materials]
white = {{ type = "diffuse", albedo = 0.7 }}
red = {{ type = "diffuse", albedo = [0.7, 0.2, 0.1] }}
lamp = {{ type = "diffuse", albedo = 0, emission = 12 }}
mirror = {{ type = "mirror", reflectance = 0.9 }}
[[quads]]
corner = [-5, 0, -5]
edges = [[0, 0, 10], [10, 0, 0]]
material = "white"
[[quads]]
corner = [-1, 1.6, -4]
edges = [[0.5, 0, 0], [0, 0.5, 0]]
material = "lamp"
[[quads]]
corner = [-1, 4, -1]
edges = [[2, 0, 0], [0, 0, 2]]
material = "lamp"
[[boxes]]
min = [-1.6, 0, 1.5]
max = [-1.1, 0.9, 2]
material = "red"
[[boxes]]
min = [0.2, 0, -0.4]
max = [1, 1, 0.4]
material = "white"
[[spheres]]
center = [-0.6, 0.5, -1.5]
radius = 0.5
material = "mirror"
"#
    )
}

#[test]
fn lenses_blur_in_every_mode() {
    let options = "--resolution 48x48 --supersample 8 --shadow-rays 16";
    let bench = Bench::of_text(&scene("aperture_radius = 0.2"), "50K");
    let pair = bench.both(options);
    let flip = pair.difference("").flip;
    let error = metadata(&pair.adaptive)["error"].clone();
    println!("lens: {flip:?}, measured {error}");
    if flip.mean > 0.01 {
        panic!("{flip:?}, see {}", pair.show("adaptive-lens", "").display());
    }
    // The lamp behind is spread over more pixels, and loses nothing.
    let sharp = Bench::of_text(&scene("fov_axis = \"x\""), "1K");
    let sharp = sharp.picture(&format!("--mode original {options}")).rgb("emission").unwrap();
    let blurred = pair.original.rgb("emission").unwrap();
    let sum = |picture: &base::Grid<Rgb>| picture.values().iter().map(|c| c.g).sum::<f32>();
    let share = sum(&blurred) / sum(&sharp);
    assert!((share - 1.0).abs() < 0.03, "{share} of the light of the lamp");
    let n_lit = |picture: &base::Grid<Rgb>| picture.values().iter().filter(|c| c.g > 0.0).count();
    assert!(3 * n_lit(&blurred) > 4 * n_lit(&sharp), "{} of {}", n_lit(&blurred), n_lit(&sharp));
    // Mode paper smears what is interpolated, as it does without a lens.
    let paper = bench.picture(&format!("--mode paper {options}")).rgb("").unwrap();
    let paper = film::compare(&paper, &pair.original.rgb("").unwrap(), 0.0).unwrap().0;
    assert!(paper.flip.mean < 0.05, "{:?}", paper.flip);
    let exact = bench.picture(&format!("--mode adaptive --error 0 {options}")).rgb("").unwrap();
    assert!(exact == pair.original.rgb("").unwrap());
}
