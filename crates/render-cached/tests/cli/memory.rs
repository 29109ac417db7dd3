//! Memory is predicted, and what doesn't fit is refused before it starts.

use std::process::{Command, Output};

use crate::bench::Bench;

/// The program within a limit of kilobytes that `ulimit` knows by a letter.
fn limited(bench: &Bench, limit: &str, args: &str) -> Output {
    let script = format!("ulimit {limit}; exec $PROGRAM scene.toml --photons a.photons {args}");
    Command::new("sh")
        .args(["-c", &script])
        .env("PROGRAM", env!("CARGO_BIN_EXE_render-cached"))
        .current_dir(bench.path(""))
        .output()
        .unwrap()
}

#[test]
fn pictures_beyond_memory_are_refused() {
    let bench = Bench::new();
    let before = bench.files();
    for (limit, by) in [("-v 4000000", "ulimit -v"), ("-d 4000000", "ulimit -d")] {
        let output = limited(&bench, limit, "-t 1 -o a.exr --mode paper --resolution 5000x5000");
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.starts_with("render-cached: this run needs 5."), "{said}");
        assert!(said.contains(&format!("GB are left (the limit of {by}); ")), "{said}");
        let remedy = "ask for fewer pixels with --resolution or --supersample than 5000x5000, for parts with --tile, \
                      or for --mode original, or go on all the same with --ignore-memory\n";
        assert!(said.ends_with(remedy), "{said}");
        assert!(bench.files() == before);
    }
}

#[test]
fn what_is_said_to_fit_does_and_the_user_has_the_last_word() {
    let bench = Bench::new();
    // Mode original takes a band of this at a time.
    let narrow = "-v 1500000";
    let args = "-t 1 --resolution 3000x800 --mode original --shadow-rays 1 --gather 2 --caustic-gather 2 -q -o a.exr";
    let output = limited(&bench, narrow, &format!("{args} --checkpoint 0"));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // What is predicted is refused, whatever would really be held.
    let tight = "-t 1 --resolution 400x400 --mode paper --shadow-rays 1 --gather 2 --caustic-gather 2 -q -o b.exr";
    let output = limited(&bench, "-d 60000", tight);
    assert_eq!(output.status.code(), Some(1));
    let going_on = limited(&bench, "-d 200000", &format!("{tight} --ignore-memory"));
    assert!(going_on.status.success(), "{}", String::from_utf8_lossy(&going_on.stderr));
}

#[test]
fn predictions_hold() {
    let bench = Bench::new();
    for options in [
        "--mode original --resolution 500x400",
        "--mode original --resolution 260x220 --supersample 2 --filter mitchell",
        "--mode original --resolution 500x400 --crop 3,400,5,390",
        "--mode paper --resolution 400x300",
        "--mode adaptive --resolution 400x300",
        "--mode adaptive --error 0 --resolution 400x300",
    ] {
        bench.run(&format!(
            "scene.toml --photons a.photons --shadow-rays 8 --gather 20 --caustic-gather 10 -t 2 {options} -o a.exr --force \
             --stats a.json"
        ));
        let stats = bench.json("a.json");
        let bytes = |name: &str| stats[name].as_u64().unwrap();
        let (peak, predicted) = (bytes("peak_rss_bytes"), bytes("predicted_rss_bytes"));
        let share = peak as f64 / predicted as f64;
        assert!((0.6..=1.0).contains(&share), "{options}: {peak} of {predicted} bytes");
    }
}
