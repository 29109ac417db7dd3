//! Scenes and sizes with little to see.

use crate::bench::{Bench, MODES};

/// A floor of one material, and what else there is.
fn scene(camera: &str, material: &str, rest: &str) -> String {
    let materials = [
        ("lamp", r#"{ type = "diffuse", albedo = 0, emission = 5 }"#),
        ("glass", r#"{ type = "glass", ior = 1.5, absorption = [0.5, 0.1, 0] }"#),
        ("mirror", r#"{ type = "mirror", reflectance = 1 }"#),
    ];
    let mut scene = format!("camera = {{ {camera}, fov = 50 }}\nmaterials.floor = {material}\n");
    for (name, material) in
        materials.iter().filter(|(name, _)| rest.contains(&format!("\"{name}\"")))
    {
        scene += &format!("materials.{name} = {material}\n");
    }
    scene
        + rest
        + "\n[[quads]]\ncorner = [-1, 0, -1]\nedges = [[0, 0, 2], [2, 0, 0]]\nmaterial = \"floor\"\n"
}

const ABOVE: &str = "origin = [0, 2, 3], target = [0, 0, 0]";
const AWAY: &str = "origin = [0, 2, 3], target = [0, 4, 6]";
const GRAY: &str = r#"{ type = "diffuse", albedo = 0.5 }"#;
const BLACK: &str = r#"{ type = "diffuse", albedo = 0 }"#;
const BULB: &str = "lights = [{ type = \"point\", position = [0, 3, 0], intensity = 1 }]";
const GLASS: &str = "spheres = [{ center = [0, 1, 0], radius = 0.5, material = \"glass\" }]";

/// Renders in all modes and sizes; answers the sum of each layer's green, in mode original, by name.
fn render(scene: &str) -> Vec<(String, f32)> {
    let bench = Bench::of(scene);
    let mut sums = Vec::new();
    for mode in MODES {
        for size in ["1x1", "1x1000", "701x3", "40x40"] {
            bench.run(&format!(
                "scene.toml --photons a.photons --mode {mode} --resolution {size} --shadow-rays 2 --gather 10 \
                 -o a.exr -o a.png --force -q"
            ));
            let picture = bench.picture("a.exr");
            for (name, values) in picture.channels() {
                assert!(values.iter().all(|v| v.is_finite()), "{name}, {mode}, {size}");
            }
            if mode == "original" && size == "40x40" {
                let greens = picture.channels().filter(|(name, _)| name.ends_with('G'));
                sums = greens.map(|(name, values)| (name.into(), values.iter().sum())).collect();
            }
        }
    }
    sums
}

/// The names of the layers that aren't black.
fn lit(scene: &str) -> String {
    let sums = render(scene);
    let lit: Vec<_> = sums
        .iter()
        .filter(|(name, sum)| *sum != 0.0 && name != "Albedo.G")
        .map(|(name, _)| &**name)
        .collect();
    lit.join(" ")
}

#[test]
fn a_camera_that_sees_nothing() {
    assert_eq!(lit(&scene(AWAY, GRAY, BULB)), "");
    let environment = "lights = [{ type = \"environment\", radiance = 2 }]";
    assert_eq!(lit(&scene(AWAY, GRAY, environment)), "G emission.G");
}

#[test]
fn materials_that_scatter_nothing() {
    assert_eq!(lit(&scene(ABOVE, BLACK, BULB)), "");
}

#[test]
fn a_light_that_lights_nothing() {
    // It shines upwards.
    let lamp =
        "[[quads]]\ncorner = [-1, 3, -1]\nedges = [[0, 0, 2], [2, 0, 0]]\nmaterial = \"lamp\"";
    assert_eq!(lit(&scene(ABOVE, GRAY, lamp)), "");
}

#[test]
fn glass_and_a_point() {
    // A point can't be seen, not even through glass, but it draws a caustic. Light that the floor has scattered comes
    // back to it from the glass.
    let rest = format!("{BULB}\n{GLASS}");
    assert_eq!(lit(&scene(ABOVE, GRAY, &rest)), "G caustics.G direct.G indirect.G specular.G");
    let only_glass = scene(ABOVE, r#"{ type = "glass", ior = 1.3 }"#, &rest);
    assert_eq!(lit(&only_glass), "");
}

#[test]
fn a_camera_in_glass_and_one_on_a_wall() {
    let inside = "origin = [0, 1, 0.2], target = [0, 0, 0]";
    let rest = format!("{BULB}\n{GLASS}");
    assert!(lit(&scene(inside, GRAY, &rest)).contains("specular.G"));
    let on_the_floor = "origin = [0, 0, 0], target = [0, 1, 0], up = [0, 0, 1]";
    render(&scene(on_the_floor, GRAY, BULB));
}

#[test]
fn mirrors_that_face_each_other() {
    let walls =
        "boxes = [{ min = [-2, -2, -2], max = [2, 4, 4], inward = true, material = \"mirror\" }]";
    render(&scene(ABOVE, GRAY, &format!("{BULB}\n{walls}")));
}

#[test]
fn a_camera_in_a_wall_is_refused() {
    let wall =
        "boxes = [{ name = \"wall\", min = [-1, 1, 2], max = [1, 3, 4], material = \"floor\" }]";
    let bench = Bench::of(&scene(AWAY, GRAY, BULB));
    bench.write("scene.toml", scene(ABOVE, GRAY, &format!("{BULB}\n{wall}")));
    bench.refuses(
        "scene.toml --photons a.photons -o a.exr",
        1,
        "scene.toml: the camera is shut in by `wall`, which is opaque and has no light inside; move one of them",
    );
}

#[test]
fn wide_pictures_and_extreme_settings() {
    let bench = Bench::of(&scene(ABOVE, GRAY, &format!("{BULB}\n{GLASS}")));
    let finite = |mode: &str, options: &str| {
        bench.run(&format!(
            "scene.toml --photons a.photons --shadow-rays 2 --mode {mode} -o a.exr -o a.png --force -q {options}"
        ));
        let picture = bench.picture("a.exr");
        assert!(
            picture.channels().all(|(_, values)| values.iter().all(|v| v.is_finite())),
            "{options}"
        );
    };
    for options in [
        "--resolution 7919x3 --gather 5",
        "--resolution 9x9 --gather 1M --caustic-gather 1M",
        "--resolution 9x9 --gather-radius 1e30 --caustic-radius 1e-30",
        "--resolution 9x9 --gather-radius 1e-30 --caustic-radius 1e30",
        "--resolution 60x60 --error 1",
        "--resolution 60x60 --error 0.000001",
        "--resolution 20x20 --exposure 100",
        "--resolution 20x20 --exposure -100",
    ] {
        MODES.iter().for_each(|mode| finite(mode, options));
    }
    for options in [
        "--resolution 9x9 --r0 1e-30",
        "--resolution 9x9 --r0 1e30 --tau-direct 1e30",
        "--resolution 70x70 --gather 5 --region 256",
        "--resolution 60x60 --region 3 --fraction 0.97",
        "--resolution 60x60 --fraction 0.000001 --region 2",
    ] {
        finite("paper", options);
    }
}
