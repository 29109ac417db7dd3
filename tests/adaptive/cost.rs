//! Mode adaptive never costs more than what it saves.

use serde_json::Value;

use super::bench::Bench;

/// Sides of the pictures. The smaller ones are computed in full.
const SIDES: [u32; 3] = [32, 64, 128];

/// The work that mode adaptive may do, as a multiple of that of mode original.
const MOST: f64 = 1.05;

/// A ray takes as long as visiting so many photons.
const PHOTONS_PER_RAY: u64 = 17;

/// Rays and photons visited by `--stats`, in photons.
fn work(stats: &Value) -> u64 {
    let rays = ["eye", "specular", "shadow"].map(|kind| stats["rays"][kind].as_u64().unwrap());
    PHOTONS_PER_RAY * rays.into_iter().sum::<u64>() + stats["photons_visited"].as_u64().unwrap()
}

#[test]
fn never_more_work_than_the_original() {
    let scenes = [
        "cornell-box",
        "interior",
        // Rough glass under a sky: most of the work can't be spared.
        "perfume",
        "pool",
        "rabbit",
        "rough",
        "tests/each-light",
        "tests/form-factor",
        "tests/furnace",
        "tests/glass-slab",
        "tests/point-over-plane",
        "tests/sphere-caustic",
    ];
    let mut faults = Vec::new();
    for scene in scenes {
        let bench = Bench::of_scene(scene, "50K");
        for side in SIDES {
            let pair = bench.both(&format!("--resolution {side}x{side} --shadow-rays 16"));
            let [ours, theirs] = pair.stats.each_ref().map(work);
            let share = ours as f64 / theirs as f64;
            println!("{scene}, {side}x{side}: {share:.3} of the work of mode original");
            if share > MOST {
                faults.push(format!(
                    "{scene}, {side}x{side}: work of {ours} photons instead of {theirs}"
                ));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn chains_to_rough_surfaces_are_followed_once_where_the_rest_is_noise() {
    let side = SIDES[2];
    for (scene, is_whole) in [("perfume", true), ("rough", false)] {
        let pair = Bench::of_scene(scene, "200K")
            .both(&format!("--resolution {side}x{side} --shadow-rays 16"));
        let [ours, theirs] = [&pair.adaptive, &pair.original].map(|p| p.rgb("").unwrap());
        assert_eq!(ours.values() == theirs.values(), is_whole, "{scene}");
    }
}
