//! Photon maps that fit, that don't, and that are damaged.

use crate::bench::{Bench, SCENE, SMALL};

#[test]
fn inputs_that_are_not_there_are_told() {
    let bench = Bench::new();
    let refuses =
        |inputs: &str, message: &str| bench.refuses(&format!("{inputs} -o a.exr"), 1, message);
    refuses("none.toml --photons a.photons", "cannot read none.toml: there is no such file");
    refuses(". --photons a.photons", "cannot read .: it is a folder; add the name of a file");
    refuses(
        "scene.toml --photons none.photons",
        "there is no none.photons; make it with: photon-build scene.toml -o none.photons",
    );
    refuses("scene.toml --photons .", "cannot read .: Is a directory (os error 21)");
    refuses(
        "scene.toml --photons scene.toml",
        "scene.toml is not a map: its first line is not `#?tetralux-map`; check the name",
    );
    bench.run(&format!("{SMALL} --mode paper --save-cache a.cache"));
    let command = "render-cached scene.toml --photons a.photons --resolution 48x32 --seed 0 --shadow-rays 4 \
        --glossy-rays 16 --gather 20 --caustic-gather 10 --kernel epanechnikov --mode paper --tau-direct 0.05 --tau-indirect 0.05 --tau-specular 0.02 \
        --region 8 --save-cache 'a.cache' --force";
    refuses(
        "scene.toml --photons a.cache",
        &format!("a.cache is of kind `cache map`, not `photon map`; it was made with: {command}"),
    );
}

/// A change to the scene, and what a refusal says of it.
const CHANGES: [(&str, &str, &str); 6] = [
    ("albedo = [0.8, 0.7, 0.6]", "albedo = [0.8, 0.7, 0.5]", "material `white` changed"),
    ("emission = [10, 9, 8]", "emission = [10, 9, 9]", "material `lamp` changed"),
    ("edges = [[0, 0, 4], [4, 0, 0]]", "edges = [[0, 0, 5], [4, 0, 0]]", "mesh `floor` changed"),
    (
        "radius = 0.5\nmaterial = \"glass\"",
        "radius = 0.4\nmaterial = \"glass\"",
        "sphere `ball` changed",
    ),
    ("intensity = 1", "intensity = 2", "light `bulb` changed"),
    ("name = \"bulb\"", "name = \"lantern\"", "light `bulb` is gone, light `lantern` is new"),
];

#[test]
fn a_changed_scene_is_told_and_the_command_helps() {
    let bench = Bench::new();
    let render = format!("{SMALL} -o a.exr --mode original --force");
    for (old, new, change) in CHANGES {
        assert!(SCENE.contains(old), "{old}");
        bench.write("scene.toml", SCENE.replace(old, new));
        // The maps were made under the full name of the scene, so the command is put together anew.
        let command = "photon-build scene.toml -o a.photons --photons 5000 --seed 0 --max-bounces 1024 --force";
        let message = format!("a.photons is stale: {change}; make it anew with: {command}");
        bench.refuses(&render, 1, &message);
        bench.photon_build(command.strip_prefix("photon-build ").unwrap());
        bench.run(&render);
        bench.write("scene.toml", SCENE);
        bench.photon_build("scene.toml -o a.photons --photons 5K --force");
    }
}

#[test]
fn the_command_of_the_map_is_kept_where_it_helps() {
    let bench = Bench::new();
    let options = "--photons-per-light 1000 --seed 5 --max-bounces 9 --store direct --force";
    bench.photon_build(&format!("scene.toml -o a.photons {options}"));
    bench.write("scene.toml", SCENE.replace("ior = 1.5", "ior = 1.6"));
    let scene = bench.path("scene.toml").display().to_string();
    let render = SMALL.replace("scene.toml", &scene) + " -o a.exr --mode original";
    let stale = "a.photons is stale: material `glass` changed; make it anew with:";
    bench.refuses(&render, 1, &format!("{stale} photon-build {scene} -o 'a.photons' {options}"));
    // From elsewhere, or with another scene, that would not help; the share of each light isn't known any more.
    let command = "photon-build scene.toml -o a.photons --photons 2000 --seed 5 --max-bounces 9 --store direct --force";
    bench.refuses(&format!("{SMALL} -o a.exr"), 1, &format!("{stale} {command}"));
    bench.photon_build(command.strip_prefix("photon-build ").unwrap());
    bench.run(&render);
}

#[test]
fn a_map_of_another_scene_names_the_scene_at_hand() {
    let bench = Bench::new();
    let other = r#"
        camera = { origin = [0, 0, 4], target = [0, 0, 0], fov = 40 }
        materials.gray = { type = "diffuse", albedo = 0.5 }
        boxes = [{ name = "block", min = [-1, -1, -1], max = [1, 1, 1], material = "gray" }]
        lights = [{ type = "point", name = "sun", position = [0, 3, 3], intensity = 5 }]
    "#;
    bench.write("my other.toml", other);
    let render = ["my other.toml", "--photons", "a.photons", "-o", "a.exr", "--resolution", "9x9"];
    let output = bench.command("").args(render).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(
        String::from_utf8(output.stderr).unwrap(),
        "render-cached: a.photons is stale: material `glass` is gone, material `lamp` is gone, material `metal` is gone, \
         material `white` is gone, mesh `floor` is gone, and 8 more; make it anew with: \
         photon-build 'my other.toml' -o a.photons --photons 5000 --seed 0 --max-bounces 1024 --force\n"
    );
    bench.write("other.toml", other);
    bench.photon_build("other.toml -o a.photons --photons 5000 --force");
    assert!(bench.command("").args(render).status().unwrap().success());
}

#[test]
fn camera_and_resolution_are_free() {
    let bench = Bench::new();
    bench.write(
        "scene.toml",
        SCENE.replace("fov = 40", "fov = 60").replace("[0, 1, 4]", "[1, 1, 3]"),
    );
    for resolution in ["1x1", "17x5", "64x64"] {
        bench.run(&format!("{} -o a.exr --force", SMALL.replace("48x32", resolution)));
    }
}

#[test]
fn a_damaged_map_is_refused() {
    let bench = Bench::new();
    bench.photon_build("scene.toml -o a.photons --photons 300 --force");
    let map = bench.read("a.photons");
    let header = map.windows(2).position(|pair| pair == b"\n\n").unwrap() + 2;
    let refused = |content: &[u8]| {
        bench.write("a.photons", content);
        let before = bench.files();
        let output = bench.command(&format!("{SMALL} -o a.exr")).output().unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), message.lines().count()), (Some(1), 1), "{message}");
        assert!(message.starts_with("render-cached: a.photons is "), "{message}");
        assert!(bench.files() == before);
    };
    let blocks = (0..map.len()).step_by(64);
    for end in blocks.clone().chain([header - 1, header, map.len() - 1]) {
        refused(&map[..end]);
    }
    for at in blocks {
        let mut bad = map.clone();
        bad[at] ^= 1 << (at / 64 % 8);
        refused(&bad);
    }
    bench.write("a.photons", &map);
    bench.render("-o a.exr");
}
