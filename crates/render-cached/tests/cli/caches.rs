//! Cache maps: saved, loaded, refused.

use base::Component;
use serde_json::Value;

use crate::bench::{Bench, SCENE, SMALL, assert_same_layers};

const LOOSE: &str = "--mode paper --tau-direct 0.2 --tau-indirect 0.2 --tau-specular 0.2";
const TIGHT: &str =
    "--mode paper --tau-direct 0.1 --tau-indirect 0.05 --tau-specular 0.15 --r0 0.5";

/// How many values of each component a run has computed.
fn traced(stats: &Value) -> [u64; 4] {
    Component::ALL.map(|component| stats["traced"][component.name()].as_u64().unwrap())
}

#[test]
fn what_is_saved_is_not_computed_again() {
    let bench = Bench::new();
    bench.render(&format!("{LOOSE} -o fresh.exr --save-cache a.cache --stats fresh.json"));
    bench.render(&format!("{LOOSE} -o again.exr --from-cache a.cache --stats again.json"));
    assert_same_layers(&bench.picture("fresh.exr"), &bench.picture("again.exr"), &[]);
    let (fresh, again) = (bench.json("fresh.json"), bench.json("again.json"));
    assert!(traced(&fresh).iter().all(|&n| n > 0), "{fresh}");
    assert!(Component::ALL.iter().any(|c| fresh["interpolated"][c.name()] != 0), "{fresh}");
    assert_eq!(traced(&again), [0; 4]);
    assert_eq!(again["interpolated"], fresh["interpolated"]);
    assert_eq!(again["rays"]["shadow"], 0);
    assert_eq!(again["photons_visited"], 0);
    // The flags tell of the picture: these pixels were computed, if not now.
    assert!(bench.picture("again.exr").channel("traced.direct").unwrap().iter().sum::<f32>() > 0.0);
}

#[test]
fn other_settings_give_the_picture_of_a_fresh_run() {
    let bench = Bench::new();
    bench.render(&format!("{LOOSE} --save-cache a.cache"));
    for settings in [
        TIGHT.to_owned(),
        format!("{TIGHT} --region 6"),
        format!("{LOOSE} --region 16"),
        format!("{LOOSE} --fraction 0.2"),
        "--mode paper --tau-direct 0 --tau-indirect 0 --tau-specular 0".to_owned(),
    ] {
        bench.render(&format!("{settings} -o fresh.exr --stats fresh.json --force"));
        bench.render(&format!(
            "{settings} -o again.exr --from-cache a.cache --stats again.json --force"
        ));
        assert_same_layers(&bench.picture("fresh.exr"), &bench.picture("again.exr"), &[]);
        let (fresh, again) = (traced(&bench.json("fresh.json")), traced(&bench.json("again.json")));
        assert!(
            fresh.iter().zip(again).all(|(fresh, again)| again < *fresh),
            "{fresh:?}, {again:?}"
        );
    }
}

#[test]
fn a_cache_grows_in_place() {
    let bench = Bench::new();
    bench.render(&format!("{LOOSE} --save-cache a.cache"));
    let small = bench.read("a.cache").len();
    bench.refuses(
        &format!("{SMALL} {TIGHT} --from-cache a.cache --save-cache a.cache"),
        1,
        "a.cache exists; give another name or --force to replace it",
    );
    bench.render(&format!("{TIGHT} --from-cache a.cache --save-cache a.cache --force"));
    assert!(bench.read("a.cache").len() > small);
    bench.render(&format!("{TIGHT} -o a.exr --from-cache a.cache --stats a.json"));
    assert_eq!(traced(&bench.json("a.json")), [0; 4]);
    // It is the one of a fresh run.
    bench.render(&format!("{TIGHT} --save-cache b.cache"));
    assert!(bench.read("a.cache") == bench.read("b.cache"));
}

#[test]
fn a_higher_resolution_needs_fewer_samples() {
    let bench = Bench::new();
    bench.render(&format!("{LOOSE} --save-cache a.cache"));
    let large = SMALL.replace("48x32", "96x64");
    bench.run(&format!("{large} {LOOSE} -o fresh.exr --stats fresh.json"));
    bench.run(&format!("{large} {LOOSE} -o again.exr --stats again.json --from-cache a.cache"));
    let (fresh, again) = (traced(&bench.json("fresh.json")), traced(&bench.json("again.json")));
    assert!(fresh.iter().zip(again).all(|(fresh, again)| again < *fresh), "{fresh:?}, {again:?}");
    // Other candidates give other values, but not very.
    let green = |name: &str| bench.picture(name).channel("G").unwrap().to_vec();
    let (fresh, again) = (green("fresh.exr"), green("again.exr"));
    let difference: f32 = fresh.iter().zip(&again).map(|(a, b)| (a - b).abs()).sum();
    assert!(difference < 0.1 * fresh.iter().sum::<f32>(), "{difference}");
    // To a lower resolution it goes as well.
    bench
        .run(&format!("{} {LOOSE} -o low.exr --from-cache a.cache", SMALL.replace("48x32", "7x5")));
}

#[test]
fn a_cache_of_something_else_is_refused_by_name() {
    let bench = Bench::new();
    bench.render(&format!("{LOOSE} --save-cache a.cache"));
    let changed = |settings: &str, change: &str| {
        let message =
            bench.command(&format!("{SMALL} {LOOSE} -o a.exr --from-cache a.cache {settings}"));
        let output = { message }.output().unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{message}");
        let start =
            format!("render-cached: a.cache is stale: {change}; make it anew with: render-cached ");
        let command = message
            .strip_prefix(&*start)
            .unwrap_or_else(|| panic!("{message}\n{start}"))
            .trim_end();
        let before = bench.read("a.cache");
        // The command makes the one that was asked for.
        bench.run(&command.replace('\'', ""));
        bench.render(&format!(
            "{LOOSE} -o a.exr --from-cache a.cache {settings} --stats a.json --force"
        ));
        assert_eq!(traced(&bench.json("a.json")), [0; 4], "{command}");
        bench.write("a.cache", before);
        std::fs::remove_file(bench.path("a.exr")).unwrap();
    };
    changed("--seed 1", "the seed changed");
    changed("--glossy-rays 8", "the number of glossy rays changed");
    changed("--gather-radius 0.2", "the estimate of indirect light changed");
    changed("--caustic-radius 0.2", "the estimate of caustics changed");
    changed(
        "--kernel cone",
        "the estimate of indirect light changed, the estimate of caustics changed",
    );

    let scene = SCENE.replace("fov = 40", "fov = 41");
    bench.write("scene.toml", scene);
    changed("", "the camera changed");
    bench.write("scene.toml", SCENE);
    bench.photon_build("scene.toml -o a.photons --photons 5K --seed 1 --force");
    changed("", "the photon map changed");
    bench.photon_build("scene.toml -o a.photons --photons 5K --force");

    let small = |old: &str, new: &str| {
        format!("{} {LOOSE} -o a.exr --from-cache a.cache", SMALL.replace(old, new))
    };
    for (old, new, change) in [
        ("--shadow-rays 4", "--shadow-rays 5", "the number of shadow rays changed"),
        ("--gather 20", "--gather 21", "the estimate of indirect light changed"),
        ("--caustic-gather 10", "--caustic-gather 11", "the estimate of caustics changed"),
    ] {
        let command = format!(
            "render-cached scene.toml --photons a.photons --resolution 48x32 --seed 0 {} --kernel epanechnikov --mode paper \
             --tau-direct 0.2 --tau-indirect 0.2 --tau-specular 0.2 --region 8 --save-cache a.cache --force",
            "--shadow-rays 4 --glossy-rays 16 --gather 20 --caustic-gather 10".replace(old, new)
        );
        bench.refuses(
            &small(old, new),
            1,
            &format!("a.cache is stale: {change}; make it anew with: {command}"),
        );
    }
}

#[test]
fn what_is_no_sound_cache_is_refused() {
    let bench = Bench::new();
    bench.run(&format!("{SMALL} {LOOSE} --save-cache a.cache").replace("48x32", "9x7"));
    let cache = bench.read("a.cache");
    let render = format!("{SMALL} {LOOSE} -o a.exr --from-cache");
    bench.refuses(
        &format!("{render} none.cache"),
        1,
        "cannot read none.cache: No such file or directory (os error 2)",
    );
    bench.refuses(
        &format!("{render} scene.toml"),
        1,
        "scene.toml is not a map: its first line is not `#?tetralux-map`; check the name",
    );
    let scene = bench.path("scene.toml").display().to_string();
    bench.refuses(
        &format!("{render} a.photons"),
        1,
        &format!(
            "a.photons is of kind `photon map`, not `cache map`; it was made with: \
             photon-build {scene} -o 'a.photons' --photons 5000 --seed 0 --max-bounces 1024 --force"
        ),
    );
    let damaged = |content: &[u8]| {
        bench.write("bad.cache", content);
        let output = bench.command(&format!("{render} bad.cache")).output().unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), message.lines().count()), (Some(1), 1), "{message}");
        assert!(message.starts_with("render-cached: bad.cache is "), "{message}");
    };
    for at in (0..cache.len()).step_by(64) {
        damaged(&cache[..at]);
        let mut bad = cache.clone();
        bad[at] ^= 1 << (at / 64 % 8);
        damaged(&bad);
    }
    damaged(&cache[..cache.len() - 1]);
}
