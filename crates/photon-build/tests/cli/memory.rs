//! Memory is predicted, and what doesn't fit is refused before it starts.

use std::process::Command;

use crate::bench::Bench;

#[test]
fn photons_beyond_memory_are_refused() {
    let bench = Bench::new();
    let before = bench.files();
    let script = "ulimit -v 2000000; exec $PROGRAM scene.toml -o a.photons --photons 200M -t 1";
    let output = Command::new("sh")
        .args(["-c", script])
        .env("PROGRAM", env!("CARGO_BIN_EXE_photon-build"))
        .current_dir(bench.path(""))
        .output()
        .unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.starts_with("photon-build: this run needs "), "{said}");
    let remedy = "ask for fewer with --photons, or for shards with --shard, or go on all the same with --ignore-memory\n";
    assert!(said.ends_with(remedy), "{said}");
    assert!(bench.files() == before);
}

#[test]
fn predictions_hold() {
    let bench = Bench::new();
    let check = |args: &str| {
        bench.run(&format!("{args} --force --stats a.json -t 2"));
        let stats = bench.json("a.json");
        let bytes = |name: &str| stats[name].as_u64().unwrap();
        let (peak, predicted) = (bytes("peak_rss_bytes"), bytes("predicted_rss_bytes"));
        let share = peak as f64 / predicted as f64;
        assert!((0.6..=1.0).contains(&share), "{args}: {peak} of {predicted} bytes");
    };
    check("scene.toml -o a.photons --photons 400K");
    check("scene.toml -o a.photons --photons 800K --store gather");
    check("scene.toml -o a.shard --photons 800K --shard 1/2");
    check("scene.toml -o b.shard --photons 800K --shard 2/2");
    check("merge a.shard b.shard -o m.photons");
}
