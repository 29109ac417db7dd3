//! Shards of a run, and the maps that they are joined to.

use std::fs::OpenOptions;
use std::io::{Seek, SeekFrom, Write};
use std::process::Stdio;
use std::thread::sleep;
use std::time::{Duration, Instant};

use assert_cmd::assert::OutputAssertExt;

use crate::bench::{Bench, SCENE};

const RUN: &str = "scene.toml --photons 100K --store direct --seed 5";

/// Shards 1 to `of` of [`RUN`], as `1.shard` and so on.
fn shards(bench: &Bench, of: u32) {
    for i in 1..=of {
        bench.run(&format!("{RUN} --shard {i}/{of} -o {i}.shard -t {}", i % 3 + 1));
    }
}

#[test]
fn any_split_gives_the_bytes_of_one_run() {
    let bench = Bench::new();
    bench.run(&format!("{RUN} -o whole.photons --stats whole.json"));
    // The photons come in 13 batches: some shards of 20 are empty.
    for (of, order) in
        [(1, "1"), (3, "3 1 2"), (20, "20 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19")]
    {
        shards(&bench, of);
        let names: String = order.split(' ').map(|i| format!("{i}.shard ")).collect();
        bench.run(&format!("merge {names} -o {of}.photons --stats {of}.json"));
        assert!(bench.read(&format!("{of}.photons")) == bench.read("whole.photons"), "{of} shards");
        let (whole, merged) = (bench.json("whole.json"), bench.json(&format!("{of}.json")));
        for same in ["fingerprint", "stored", "emitted", "absorbed", "escaped", "cut", "rays"] {
            assert_eq!(merged[same], whole[same], "{same}");
        }
        for i in 1..=of {
            std::fs::remove_file(bench.path(format!("{i}.shard"))).unwrap();
        }
    }
}

#[test]
fn several_lights_and_threads_change_nothing() {
    let bench = Bench::new();
    let second = "[[quads]]\nname = \"lamp 2\"\ncorner = [1, 2, -0.5]\nedges = [[0.3, 0, 0], [0, 0, 0.3]]\nmaterial = \"lamp\"\n";
    bench.write("two.toml", [SCENE, second].concat());
    bench.run("two.toml --photons-per-light 20K -o whole.photons");
    for i in 1..=4 {
        bench.run(&format!("two.toml --photons-per-light 20K --shard {i}/4 -o {i}.shard"));
    }
    for threads in 1..=3 {
        let output = format!("{threads}.photons");
        bench.run(&format!("merge 1.shard 2.shard 3.shard 4.shard -o {output} -t {threads}"));
        assert!(bench.read(&output) == bench.read("whole.photons"), "{threads} threads");
    }
}

#[test]
fn what_is_missing_double_or_foreign_is_named() {
    let bench = Bench::new();
    shards(&bench, 4);
    let command = |i: u32, file: &str| {
        format!(
            "photon-build scene.toml -o {file} --photons 100000 --seed 5 --max-bounces 1024 --store direct --shard {i}/4 --force"
        )
    };
    let merge = |shards: &str| format!("merge {shards} -o a.photons");
    bench.refuses(
        &merge("4.shard 1.shard 3.shard"),
        1,
        &format!("shard 2/4 is missing; name it, or make it with: {}", command(2, "SHARD")),
    );
    bench.refuses(
        &merge("3.shard"),
        1,
        &format!(
            "shard 1/4, 2/4, 4/4 is missing; name it, or make it with: {}",
            command(1, "SHARD")
        ),
    );
    bench.write("again.shard", bench.read("2.shard"));
    bench.refuses(
        &merge("1.shard 2.shard 3.shard 4.shard again.shard"),
        1,
        "2.shard and again.shard are both shard 2/4; leave one of them out",
    );
    bench.refuses(
        &merge("1.shard 1.shard"),
        1,
        "1.shard and 1.shard are both shard 1/4; leave one of them out",
    );

    let foreign = |args: &str, what: &str| {
        bench.run(&format!("{args} --shard 2/4 -o other.shard --force"));
        let message = refusal(&bench, &merge("1.shard other.shard 3.shard 4.shard"));
        let start = format!(
            "photon-build: other.shard belongs to another run than 1.shard: they differ in {what}; it was made with: photon-build "
        );
        assert!(message.starts_with(&start), "{message}");
    };
    foreign("scene.toml --photons 100K --store direct --seed 6", "--seed");
    foreign("scene.toml --photons 100K --seed 5", "--store");
    foreign(&format!("{RUN} --max-bounces 7"), "--max-bounces");
    foreign("scene.toml --photons 99K --store direct --seed 5", "the number of photons");
    bench.write("red.toml", SCENE.replace("albedo = [0.8, 0.7, 0.6]", "albedo = [0.8, 0.1, 0.1]"));
    foreign(
        "red.toml --photons 100K --store direct --seed 5",
        "the scene (material `white` changed)",
    );
    bench.run(&format!("{RUN} --shard 2/3 -o other.shard --force"));
    let message = refusal(&bench, &merge("1.shard other.shard"));
    assert!(message.contains("they differ in the number of shards"), "{message}");

    bench.run(&format!("{RUN} -o map.photons"));
    let message = refusal(&bench, &merge("1.shard map.photons"));
    assert!(
        message
            .starts_with("photon-build: map.photons is of kind `photon map`, not `photon shard`"),
        "{message}"
    );
    let message = refusal(&bench, "info 1.shard");
    assert!(message.contains("1.shard is of kind `photon shard`, not `photon map`"), "{message}");
}

/// What a run that fails says.
fn refusal(bench: &Bench, args: &str) -> String {
    let before = bench.files();
    let output = bench.command(args).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{args}");
    assert!(bench.files() == before, "`{args}` has changed files");
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn a_damaged_shard_is_named_and_made_anew() {
    let bench = Bench::new();
    bench.run(&format!("{RUN} -o whole.photons"));
    shards(&bench, 2);
    let good = bench.read("2.shard");
    let mut flipped = good.clone();
    *flipped.last_mut().unwrap() ^= 1;
    for bad in [&good[..good.len() / 2], &flipped] {
        bench.write("2.shard", bad);
        let message = refusal(&bench, "merge 1.shard 2.shard -o a.photons");
        assert!(message.starts_with("photon-build: 2.shard is damaged: "), "{message}");
        let remedy = message.trim_end().split("make it anew with: photon-build ").nth(1).unwrap();
        bench.run(&remedy.replace('\'', ""));
        assert!(bench.read("2.shard") == good);
    }
    bench.run("merge 1.shard 2.shard -o a.photons");
    assert!(bench.read("a.photons") == bench.read("whole.photons"));
}

/// A machine that fails leaves no shard, and whoever tries again makes the right one: also where the first one, taken for
/// dead, writes its own in the end.
#[test]
fn a_killed_shard_leaves_nothing_to_be_taken_for_one() {
    let bench = Bench::new();
    let run = "scene.toml --photons 400K";
    bench.run(&format!("{run} -o whole.photons"));
    bench.run(&format!("{run} --shard 1/2 -o 1.shard"));
    let mut child = bench.command(&format!("{run} --shard 2/2 -o 2.shard -t 1")).spawn().unwrap();
    sleep(Duration::from_millis(60));
    child.kill().unwrap();
    child.wait().unwrap();
    // Where it was faster than the signal, the shard is whole.
    if !bench.path("2.shard").exists() {
        let message = refusal(&bench, "merge 1.shard -o a.photons");
        assert!(message.contains("shard 2/2 is missing"), "{message}");
    }
    let (mut a, mut b) = (
        bench.command(&format!("{run} --shard 2/2 -o 2.shard --force")).spawn().unwrap(),
        bench.command(&format!("{run} --shard 2/2 -o 2.shard --force")).spawn().unwrap(),
    );
    assert!(a.wait().unwrap().success() && b.wait().unwrap().success());
    bench.run("merge 1.shard 2.shard -o a.photons");
    assert!(bench.read("a.photons") == bench.read("whole.photons"));
}

#[test]
fn shares_that_do_not_exist_are_wrong_usage() {
    let bench = Bench::new();
    for share in ["0/4", "5/4", "4", "x/y"] {
        bench.refuses(
            &format!("{RUN} --shard {share} -o a.shard"),
            2,
            &format!(
                "invalid value '{share}' for '--shard <I/N>': expected a share such as 3/8, from 1/8 to 8/8; try --help"
            ),
        );
    }
    bench.command("merge -o a.photons").assert().code(2);
}

#[test]
fn shards_that_are_overwritten_in_use_make_no_wrong_map() {
    let bench = Bench::new();
    shards(&bench, 2);
    let merge = "merge 1.shard 2.shard -o a.photons";
    let start = Instant::now();
    bench.run(merge);
    let unbroken = start.elapsed();
    let (right, shard) = (bench.read("a.photons"), bench.read("2.shard"));
    for part in 0..8 {
        bench.write("a.photons", "precious");
        let mut merging = bench.command(&format!("{merge} --force"));
        let merging = merging.stderr(Stdio::piped()).spawn().unwrap();
        sleep(unbroken * part / 8);
        let mut damaged = OpenOptions::new().write(true).open(bench.path("2.shard")).unwrap();
        damaged.seek(SeekFrom::End(-9000)).unwrap();
        damaged.write_all(&[0x5a; 3000]).unwrap();
        drop(damaged);
        let output = merging.wait_with_output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        // It was done by then, or ends in words.
        if output.status.success() {
            assert!(bench.read("a.photons") == right, "at {part}/8");
        } else {
            assert_eq!(output.status.code(), Some(1), "{said}");
            let faults = ["2.shard was changed while it was in use", "2.shard is damaged"]
                .map(|f| said.contains(f));
            assert_ne!(faults, [false; 2], "{said}");
            assert_eq!(bench.read("a.photons"), b"precious");
        }
        bench.write("2.shard", &shard);
    }
}
