//! `--indirect gather`: in every mode, from maps that have what it needs.

use film::compare;

use crate::bench::{Bench, MODES, SMALL, assert_same_layers};

const GATHER: &str = "--photons b.photons --indirect gather --gather-rays 16";

/// A folder with maps for final gathering besides.
fn bench() -> Bench {
    let bench = Bench::new();
    bench.photon_build("scene.toml -o b.photons --photons 20K --store gather");
    bench
}

#[test]
fn maps_without_their_photons_are_refused_with_the_command_that_makes_them() {
    let bench = Bench::new();
    let render = format!("{SMALL} --mode original --indirect gather -o a.exr");
    let command = "photon-build scene.toml -o a.photons --photons 5000 --seed 0 --max-bounces 1024 --store gather --force";
    let message =
        format!("a.photons holds no photons for --indirect gather; make it with: {command}");
    bench.refuses(&render, 1, &message);
    bench.photon_build(command.strip_prefix("photon-build ").unwrap());
    bench.run(&render);
}

#[test]
fn threads_change_no_bit_in_any_mode() {
    let bench = bench();
    let size = "scene.toml --resolution 130x90 --shadow-rays 4 --caustic-gather 10";
    for mode in MODES {
        let render = format!("{size} {GATHER} --mode {mode} --force");
        bench.run(&format!("{render} -t 1 -o one.exr --stats one.json"));
        bench.run(&format!("{render} -t 3 -o three.exr --stats three.json"));
        assert_same_layers(&bench.picture("one.exr"), &bench.picture("three.exr"), &[]);
        let rays = |name: &str| bench.json(name)["rays"]["gather"].as_u64().unwrap();
        assert!(rays("one.json") > 0 && rays("one.json") == rays("three.json"), "{mode}");
    }
}

#[test]
fn only_indirect_and_specular_light_change() {
    let bench = bench();
    let small = SMALL.replace("a.photons", "b.photons");
    bench.run(&format!("{small} --mode original -o estimate.exr"));
    // All pixels share their directions, and what these miss.
    bench
        .run(&format!("{small} --mode original --indirect gather --gather-rays 512 -o gather.exr"));
    let (a, b) = (bench.picture("estimate.exr"), bench.picture("gather.exr"));
    for layer in ["direct", "caustics", "emission"] {
        assert_eq!(a.rgb(layer), b.rgb(layer), "{layer}");
    }
    for layer in ["indirect", "specular"] {
        let (a, b) = (a.rgb(layer).unwrap(), b.rgb(layer).unwrap());
        let mean = |g: &base::Grid<base::Rgb>| g.values().iter().map(|c| c.mean()).sum::<f32>();
        println!("{layer}: {} {}", mean(&a), mean(&b));
        assert!(
            a != b && (mean(&a) / mean(&b) - 1.0).abs() < 0.15,
            "{layer}: {} {}",
            mean(&a),
            mean(&b)
        );
    }
}

#[test]
fn an_error_of_zero_and_thresholds_of_zero_are_the_original() {
    let bench = bench();
    let small = SMALL.replace("--photons a.photons ", "");
    bench.run(&format!("{small} {GATHER} --mode original -o original.exr"));
    bench.run(&format!("{small} {GATHER} --mode adaptive --error 0 -o adaptive.exr"));
    let taus = "--tau-direct 0 --tau-indirect 0 --tau-specular 0";
    bench.run(&format!("{small} {GATHER} --mode paper {taus} -o paper.exr"));
    let original = bench.picture("original.exr");
    for name in ["adaptive.exr", "paper.exr"] {
        assert_same_layers(&original, &bench.picture(name), &["traced", "reason", "level"]);
    }
}

#[test]
fn the_error_holds_and_little_is_traced() {
    let bench = bench();
    let size = "scene.toml --resolution 240x160 --shadow-rays 16 --photons b.photons --indirect gather --gather-rays 64";
    bench.run(&format!("{size} --mode original -o original.exr --stats o.json"));
    for target in [0.02, 0.01] {
        bench.run(&format!(
            "{size} --mode adaptive --error {target} -o a.exr --stats a.json --force"
        ));
        let (a, original) = (bench.picture("a.exr"), bench.picture("original.exr"));
        let beauty = |p: &film::Picture| p.rgb("").unwrap();
        let flip = compare(&beauty(&a), &beauty(&original), 0.0).unwrap().0.flip;
        let told = bench.json("a.json")["error"]["measured_mean"].as_f64().unwrap();
        let traced = bench.json("a.json")["traced"]["indirect"].as_u64().unwrap();
        println!("{target}: {flip:?}, told {told}, traced {traced}");
        assert!(flip.mean < 1.3 * target, "{} for {target}", flip.mean);
        assert!((told / flip.mean - 1.0).abs() < 0.4, "told {told}, is {}", flip.mean);
        assert!(traced < 240 * 160 / 2, "{traced} traced");
    }
}
