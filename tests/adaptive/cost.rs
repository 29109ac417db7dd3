//! Mode adaptive never costs more than what it saves.

use super::bench::{Bench, work};

/// Sides of the pictures. The smaller ones are computed in full.
const SIDES: [u32; 3] = [32, 64, 128];

/// The work that mode adaptive may do, as a multiple of that of mode original.
const MOST: f64 = 1.05;

#[test]
fn never_more_work_than_the_original() {
    let scenes = [
        "cornell-box",
        "rabbit",
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
                    "{scene}, {side}x{side}: {ours} rays and photons instead of {theirs}"
                ));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
