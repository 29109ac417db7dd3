//! Scenes and sizes with little to interpolate, or much that is hard to.

use base::{Rng, Stream};

use super::bench::{Bench, metadata};

const MATERIALS: &str = r#"
[materials.white]
type = "diffuse"
albedo = 0.7
[materials.black]
type = "diffuse"
albedo = 0
[materials.lamp]
type = "diffuse"
albedo = 0
emission = 8
[materials.glass]
type = "glass"
ior = 1.5
absorption = [0.4, 0.1, 0.2]
[materials.mirror]
type = "mirror"
reflectance = 0.95
[materials.gold]
type = "metal"
preset = "gold"
"#;

const ABOVE: &str = "camera = { origin = [0, 2.2, 4.5], target = [0, 0.6, 0], fov = 45 }\n";
const LAMP: &str = "[[quads]]\ncorner = [-0.6, 2.9, -0.6]\nedges = [[1.2, 0, 0], [0, 0, 1.2]]\nmaterial = \"lamp\"\n";
const SKY: &str = "[[lights]]\ntype = \"environment\"\nradiance = [0.6, 0.8, 1.1]\n";

fn floor(material: &str) -> String {
    format!(
        "[[quads]]\ncorner = [-3, 0, -3]\nedges = [[0, 0, 6], [6, 0, 0]]\nmaterial = \"{material}\"\n"
    )
}

fn ball(x: f32, material: &str) -> String {
    format!("[[spheres]]\ncenter = [{x}, 0.7, 0]\nradius = 0.6\nmaterial = \"{material}\"\n")
}

fn scene(camera: &str, things: &[&str]) -> Bench {
    Bench::of_text(&[camera, MATERIALS, &things.concat()].concat(), "200K")
}

/// Asserts that both modes show the same within the error asked for, by twice at the most, and that what is told is honest
/// where there is anything to tell.
fn assert_fine(name: &str, bench: &Bench, sizes: &[&str]) {
    let mut faults = Vec::new();
    for size in sizes {
        let pair = bench.both(&format!("--resolution {size} --shadow-rays 16 --gather 200"));
        let flip = pair.difference("").flip;
        let told = metadata(&pair.adaptive)["error"]["measured_mean"].as_f64().unwrap();
        let line = format!("{name}, {size}: told {told:.5}, {flip:?}");
        println!("{line}");
        let is_honest = (told - flip.mean).abs() <= 0.3 * flip.mean + 0.001;
        if flip.mean > 0.02 || !is_honest {
            let folder = pair.show(&format!("adaptive-{name}"), "");
            faults.push(format!("{line}, see {}", folder.display()));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

const SQUARE: &[&str] = &["160x160"];

#[test]
fn no_diffuse_surface_in_view() {
    // The diffuse wall stands behind the camera: it is seen in mirrors only.
    let wall =
        "[[quads]]\ncorner = [3, 0, 5]\nedges = [[-6, 0, 0], [0, 4, 0]]\nmaterial = \"white\"\n";
    let bench =
        scene(ABOVE, &[wall, LAMP, &floor("mirror"), &ball(-0.8, "gold"), &ball(0.8, "glass")]);
    assert_fine("no-diffuse-surface", &bench, SQUARE);
}

#[test]
fn all_glass() {
    let bench = scene(ABOVE, &[LAMP, &floor("glass"), &ball(-0.8, "glass"), &ball(0.8, "glass")]);
    assert_fine("all-glass", &bench, SQUARE);
}

/// Glossy ends in view and out of it, seen directly, in a mirror and through glass.
#[test]
fn rough_surfaces() {
    let rough = "[materials.brushed]\ntype = \"metal\"\npreset = \"copper\"\nroughness = 0.35\n\
                 [materials.frosted]\ntype = \"glass\"\nior = 1.5\nroughness = 0.3\n\
                 [materials.varnish]\ntype = \"mirror\"\nreflectance = 0.1\nroughness = 0.2\nalbedo = 0.5\n";
    let wall = "[[quads]]\ncorner = [-3, 0, -1.5]\nedges = [[6, 0, 0], [0, 3, 0]]\nmaterial = \"mirror\"\n";
    let back =
        "[[quads]]\ncorner = [3, 0, 5]\nedges = [[-6, 0, 0], [0, 4, 0]]\nmaterial = \"white\"\n";
    let things =
        [rough, LAMP, wall, back, &floor("varnish"), &ball(-0.8, "brushed"), &ball(0.8, "frosted")];
    assert_fine("rough", &scene(ABOVE, &things), SQUARE);
}

#[test]
fn all_black() {
    let bench = scene(ABOVE, &[LAMP, &floor("black"), &ball(-0.8, "black")]);
    assert_fine("all-black", &bench, SQUARE);
}

#[test]
fn a_light_behind_a_grating() {
    let bars = (0..24).map(|i| {
        let x = -1.5 + 0.125 * i as f32;
        format!(
            "[[boxes]]\nmin = [{x}, 1.8, -1.5]\nmax = [{}, 1.85, 1.5]\nmaterial = \"white\"\n",
            x + 0.06
        )
    });
    let bench =
        scene(ABOVE, &[LAMP, &floor("white"), &bars.collect::<String>(), &ball(0.0, "white")]);
    assert_fine("grating", &bench, SQUARE);
}

/// A floor of 40 x 40 squares whose normals lean by up to 40 degrees, each corner's in a direction of its own.
fn ruffled_floor() -> String {
    const N: usize = 40;
    let mut rng = Rng::new(0, Stream::Test, 0);
    let (mut obj, mut faces) = (String::new(), String::new());
    for i in 0..=N {
        for j in 0..=N {
            let [x, z] = [i, j].map(|k| k as f32 * 6.0 / N as f32 - 3.0);
            let lean = (rng.next_2d() - 0.5) * 1.2;
            obj += &format!("v {x} 0 {z}\nvn {} 1 {}\n", lean.x, lean.y);
            if i < N && j < N {
                let a = i * (N + 1) + j + 1;
                let [a, b, c, d] = [a, a + 1, a + N + 2, a + N + 1].map(|k| format!("{k}//{k}"));
                faces += &format!("f {a} {b} {c} {d}\n");
            }
        }
    }
    obj + &faces
}

#[test]
fn strong_normal_variation() {
    let mesh = "[[meshes]]\nfile = \"floor.obj\"\nmaterial = \"white\"\n";
    let scene = [ABOVE, MATERIALS, LAMP, mesh, &ball(-0.8, "white"), &ball(0.8, "glass")].concat();
    let bench = Bench::of_files(&[("scene.toml", &scene), ("floor.obj", &ruffled_floor())], "200K");
    assert_fine("ruffled-floor", &bench, SQUARE);
}

/// Checkers from many pixels down to less than one, on the floor, around a ball, and in mirrors.
#[test]
fn strong_textures() {
    let checkers = "[textures.checkers]\ntype = \"checkerboard\"\ncolors = [0.05, 1]\nscale = [24, 24]\n\
                    [materials.checkered]\ntype = \"diffuse\"\nalbedo_texture = \"checkers\"\n";
    let things =
        [checkers, LAMP, &floor("checkered"), &ball(-0.8, "checkered"), &ball(0.8, "gold")];
    assert_fine("textures", &scene(ABOVE, &things), SQUARE);
}

#[test]
fn a_plane_up_to_the_horizon() {
    let camera = "camera = { origin = [0, 0.3, 4], target = [0, 0.25, 0], fov = 50 }\n";
    let plane = "[[quads]]\ncorner = [-500, 0, -1000]\nedges = [[0, 0, 1010], [1000, 0, 0]]\nmaterial = \"white\"\n";
    let posts = (0..12).map(|i| {
        let z = 2.0 - 4.0 * i as f32;
        format!(
            "[[boxes]]\nmin = [-0.8, 0, {z}]\nmax = [-0.6, 0.8, {}]\nmaterial = \"white\"\n",
            z + 0.2
        )
    });
    let sun = "[[lights]]\ntype = \"directional\"\ndirection = [1, -0.4, -0.3]\nirradiance = 2\n";
    let bench = scene(camera, &[plane, sun, SKY, &posts.collect::<String>(), &ball(0.5, "gold")]);
    assert_fine("horizon", &bench, SQUARE);
}

#[test]
fn an_open_scene_under_the_sky_alone() {
    let bench = scene(ABOVE, &[SKY, &floor("white"), &ball(-0.8, "white"), &ball(0.8, "glass")]);
    assert_fine("sky-alone", &bench, SQUARE);
}

#[test]
fn extreme_sizes() {
    let bench = scene(ABOVE, &[LAMP, &floor("white"), &ball(-0.8, "gold"), &ball(0.8, "glass")]);
    assert_fine("extreme-sizes", &bench, &["1x1", "2x2", "17x1", "1x1000", "7919x3"]);
}

#[test]
fn a_light_inside_glass() {
    let core = "[[boxes]]\ncenter = [0.8, 0.7, 0]\nsize = [0.3, 0.3, 0.3]\nmaterial = \"lamp\"\n";
    let bench = scene(ABOVE, &[core, &floor("white"), &ball(-0.8, "white"), &ball(0.8, "glass")]);
    assert_fine("light-inside-glass", &bench, SQUARE);
}

#[test]
fn a_mirror_facing_a_mirror() {
    let pair = "[[quads]]\ncorner = [-1.5, 0, -3]\nedges = [[0, 3, 0], [0, 0, 6]]\nmaterial = \"mirror\"\n\
                [[quads]]\ncorner = [1.5, 0, -3]\nedges = [[0, 0, 6], [0, 3, 0]]\nmaterial = \"mirror\"\n";
    let camera = "camera = { origin = [0.9, 1.3, 4], target = [-0.5, 0.7, 0], fov = 50 }\n";
    let bench = scene(camera, &[LAMP, pair, &floor("white"), &ball(0.0, "gold")]);
    assert_fine("mirrors", &bench, SQUARE);
}
