//! What mode adaptive saves: used again in the same view to the bit, elsewhere within the error asked for.

use base::Component;
use film::compare;
use serde_json::Value;

use crate::bench::{Bench, SCENE, SMALL, assert_same_layers};

/// Larger than [`SMALL`], so that there is something to interpolate.
const VIEW: &str =
    "scene.toml --photons b.photons --resolution 192x128 --shadow-rays 16 --gather 100";

/// The camera of [`SCENE`].
const CAMERA: &str = "camera = { origin = [0, 1, 4], target = [0, 1, 0], fov = 40 }";

fn bench() -> Bench {
    let bench = Bench::new();
    bench.photon_build("scene.toml -o b.photons --photons 100K");
    bench
}

/// How many values of each component a run has traced or reused.
fn counted(stats: &Value, what: &str) -> [u64; 4] {
    Component::ALL.map(|component| stats[what][component.name()].as_u64().unwrap())
}

/// What tells of the run and not of the picture.
const HISTORY: [&str; 2] = ["traced.", "reason."];

#[test]
fn the_same_view_is_reused_to_the_bit() {
    let bench = bench();
    let view = format!("{VIEW} --mode adaptive");
    bench.run(&format!("{view} --error 0.02 -o a.exr --save-cache a.cache --stats a.json"));
    bench.run(&format!("{view} --error 0.02 -o b.exr --from-cache a.cache --stats b.json"));
    assert_same_layers(&bench.picture("a.exr"), &bench.picture("b.exr"), &HISTORY);
    let (fresh, again) = (bench.json("a.json"), bench.json("b.json"));
    assert!(counted(&fresh, "traced").iter().all(|&n| n > 0), "{fresh}");
    assert_eq!(counted(&again, "traced"), [0; 4]);
    assert_eq!(counted(&again, "reused"), counted(&fresh, "traced"));
    assert_eq!(again["interpolated"], fresh["interpolated"]);
    assert_eq!(again["error"], fresh["error"]);
    let (fresh, again) = (bench.picture("a.exr"), bench.picture("b.exr"));
    for component in ["direct", "indirect", "specular", "caustics"] {
        let name = format!("reason.{component}");
        let reasons = fresh.channel(&name).unwrap().iter().zip(again.channel(&name).unwrap());
        for (fresh, again) in reasons {
            assert_eq!(*again, if *fresh == 0.0 { 0.0 } else { 7.0 }, "{name}");
        }
    }

    // Another error in the same view: the picture of a fresh run, for less.
    for error in ["0.01", "0.03"] {
        let view = format!("{view} --error {error} --force");
        bench.run(&format!("{view} -o a.exr --stats a.json"));
        bench.run(&format!("{view} -o b.exr --stats b.json --from-cache a.cache"));
        assert_same_layers(&bench.picture("a.exr"), &bench.picture("b.exr"), &HISTORY);
        let (fresh, again) = (bench.json("a.json"), bench.json("b.json"));
        let (traced, now) = (counted(&fresh, "traced"), counted(&again, "traced"));
        assert!(traced.iter().zip(now).all(|(traced, now)| now < *traced), "{traced:?}, {now:?}");
        assert_eq!(again["error"], fresh["error"]);
    }
}

#[test]
fn glossy_reflections_are_computed_again_from_what_was_saved() {
    let bench = Bench::new();
    let metal = "metal = { type = \"metal\", preset = \"silver\"";
    bench.write("scene.toml", SCENE.replace(metal, &format!("{metal}, roughness = 0.3")));
    bench.photon_build("scene.toml -o a.photons --photons 5K --force");
    let adaptive = "--mode adaptive --error 0.02";
    bench.render(&format!("{adaptive} -o a.exr --save-cache a.cache --stats a.json"));
    bench.render(&format!("{adaptive} -o b.exr --from-cache a.cache --stats b.json"));
    assert_same_layers(&bench.picture("a.exr"), &bench.picture("b.exr"), &HISTORY);
    let [_, _, fresh, _] = counted(&bench.json("a.json"), "traced");
    let [direct, indirect, specular, caustic] = counted(&bench.json("b.json"), "traced");
    assert_eq!([direct, indirect, caustic], [0; 3]);
    // What a rough surface shows depends on the eye, and isn't saved; the ends of its chains are.
    assert!(0 < specular && specular <= fresh, "{specular} of {fresh}");
}

#[test]
fn a_file_grows_and_depends_on_no_threads() {
    let bench = bench();
    let run = |args: &str| bench.run(&format!("{VIEW} --mode adaptive --force {args}"));
    run("--error 0.03 --save-cache a.cache");
    run("--error 0.03 --save-cache b.cache --threads 1");
    assert!(bench.read("a.cache") == bench.read("b.cache"));
    let small = bench.read("a.cache").len();
    run("--error 0.015 --from-cache a.cache --save-cache a.cache");
    assert!(bench.read("a.cache").len() > small);
    run("--error 0.015 -o a.exr --from-cache a.cache --stats a.json");
    assert_eq!(counted(&bench.json("a.json"), "traced"), [0; 4]);
    // What was loaded stays, whatever is asked for.
    let large = bench.read("a.cache");
    run("--error 0.03 --from-cache a.cache --save-cache a.cache");
    assert_eq!(bench.read("a.cache").len(), large.len());

    let moved = SCENE.replace("origin = [0, 1, 4]", "origin = [0.2, 1, 4]");
    bench.write("scene.toml", moved);
    run("--error 0.02 -o a.exr --from-cache a.cache --save-cache b.cache");
    run("--error 0.02 -o b.exr --from-cache a.cache --save-cache c.cache --threads 1");
    assert!(bench.read("b.cache") == bench.read("c.cache"));
    assert_same_layers(&bench.picture("a.exr"), &bench.picture("b.exr"), &[]);
}

/// Renders a view with and without a file; answers what both have traced, by component.
fn with_and_without(bench: &Bench, view: &str) -> [[u64; 4]; 2] {
    bench.run(&format!("{view} --mode original -o original.exr --force"));
    let original = bench.picture("original.exr").rgb("").unwrap();
    let target = 0.02;
    ["", "--from-cache a.cache"].map(|from| {
        let adaptive = format!("{view} --mode adaptive --error {target} --force");
        bench.run(&format!("{adaptive} -o a.exr --stats a.json {from}"));
        let stats = bench.json("a.json");
        let flip =
            compare(&bench.picture("a.exr").rgb("").unwrap(), &original, 0.0).unwrap().0.flip;
        let told = stats["error"]["measured_mean"].as_f64().unwrap();
        assert!(flip.mean < 1.3 * target, "{from}: {}", flip.mean);
        assert!((told / flip.mean - 1.0).abs() < 0.4, "{from}: told {told}, is {}", flip.mean);
        counted(&stats, "traced")
    })
}

#[test]
fn other_views_take_what_is_still_valid() {
    let bench = bench();
    bench.run(&format!("{VIEW} --mode adaptive --error 0.02 --save-cache a.cache"));
    let saved_part = |view: &str, component: usize| {
        let [fresh, again] = with_and_without(&bench, view);
        1.0 - again[component] as f64 / fresh[component] as f64
    };
    const INDIRECT: usize = 1;
    let larger = VIEW.replace("192x128", "384x256");
    let saved = saved_part(&larger, INDIRECT);
    assert!(saved > 0.25, "{saved}");

    let look = |from: &str, to: &str| {
        let camera = format!("camera = {{ origin = {from}, target = {to}, fov = 40 }}");
        bench.write("scene.toml", SCENE.replace(CAMERA, &camera));
    };
    look("[0.2, 1.05, 3.95]", "[0, 1, 0]");
    let saved = saved_part(VIEW, INDIRECT);
    assert!(saved > 0.4, "{saved}");
    // From the side only a part is what was seen before.
    look("[3.2, 1.5, 2]", "[0, 0.6, -0.5]");
    let saved = saved_part(VIEW, INDIRECT);
    assert!(saved > 0.05, "{saved}");
    // From below the other sides of all surfaces show, of which nothing is known.
    look("[0, -3, 0.1]", "[0, 0, 0]");
    let view = format!("{VIEW} --mode adaptive --force");
    bench.run(&format!("{view} -o fresh.exr"));
    bench.run(&format!("{view} -o again.exr --stats a.json --from-cache a.cache"));
    assert_same_layers(&bench.picture("fresh.exr"), &bench.picture("again.exr"), &[]);
    let stats = bench.json("a.json");
    assert_eq!(counted(&stats, "reused"), [0; 4]);
    assert!(counted(&stats, "traced")[INDIRECT] > 0, "{stats}");
}

#[test]
fn files_of_something_else_are_refused_by_name() {
    let bench = Bench::new();
    let adaptive = format!("{SMALL} --mode adaptive");
    bench.run(&format!("{adaptive} --save-cache a.cache"));
    let refused = |args: &str, change: &str| {
        let output = bench.command(&format!("{args} -o a.exr --from-cache a.cache")).output();
        let output = output.unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), message.lines().count()), (Some(1), 1), "{message}");
        let start = format!("render-cached: a.cache {change}: render-cached scene.toml ");
        assert!(message.starts_with(&start), "{message}{start}");
        assert!(message.ends_with("--save-cache a.cache --force\n"), "{message}");
    };
    let stale = |args: &str, change: &str| {
        refused(args, &format!("is stale: {change}; make it anew with"));
    };
    for (old, new, change) in [
        ("--shadow-rays 4", "--shadow-rays 5", "the number of shadow rays changed"),
        ("--gather 20", "--gather 21", "the estimate of indirect light changed"),
        ("--caustic-gather 10", "--caustic-gather 11", "the estimate of caustics changed"),
        ("scene.toml", "scene.toml --seed 1", "the seed changed"),
    ] {
        stale(&adaptive.replace(old, new), change);
    }
    for (old, new, change) in [
        ("intensity = 1", "intensity = 2", "light `bulb` changed"),
        ("albedo = 0.5", "albedo = 0.4", "material `lamp` changed"),
        (
            "radius = 0.5\nmaterial = \"metal\"",
            "radius = 0.4\nmaterial = \"metal\"",
            "sphere `mirror` changed",
        ),
    ] {
        bench.write("scene.toml", SCENE.replace(old, new));
        bench.photon_build("scene.toml -o a.photons --photons 5K --force");
        stale(&adaptive, &format!("{change}, the photon map changed"));
    }
    bench.write("scene.toml", SCENE);
    bench.photon_build("scene.toml -o a.photons --photons 5K --seed 1 --force");
    stale(&adaptive, "the photon map changed");
    bench.photon_build("scene.toml -o a.photons --photons 5K --force");

    // The other mode's file.
    let paper = format!("{SMALL} --mode paper");
    refused(
        &paper,
        "was saved in mode adaptive, which keeps no radiance; render with --mode adaptive, or replace it with",
    );
    bench.run(&format!("{paper} --save-cache a.cache --force"));
    refused(
        &adaptive,
        "was saved in mode paper, which keeps radiance of one view only; render with --mode paper, or replace it with",
    );
}

#[test]
fn damaged_records_are_refused() {
    let bench = Bench::new();
    let adaptive = format!("{SMALL} --mode adaptive").replace("48x32", "9x7");
    bench.run(&format!("{adaptive} --save-cache a.cache"));
    let cache = bench.read("a.cache");
    for at in (0..cache.len()).step_by(cache.len() / 12) {
        let mut bad = cache.clone();
        bad[at] ^= 1;
        for content in [&bad[..], &cache[..at]] {
            bench.write("bad.cache", content);
            let output = bench.command(&format!("{adaptive} -o a.exr --from-cache bad.cache"));
            let output = { output }.output().unwrap();
            let message = String::from_utf8(output.stderr).unwrap();
            assert_eq!((output.status.code(), message.lines().count()), (Some(1), 1), "{message}");
            assert!(message.starts_with("render-cached: bad.cache is "), "{message}");
        }
    }
}
