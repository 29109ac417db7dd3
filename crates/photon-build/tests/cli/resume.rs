//! Runs that are killed and go on: `--resume`, `--checkpoint`.

use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::bench::Bench;

/// A second or so.
const RUN: &str = "scene.toml --photons 1M --store direct -t 1 -q -o";

/// Numbers that look random, the same in every run.
struct Dice(u64);

impl Dice {
    /// A number from 0 up to `end`.
    fn throw(&mut self, end: u64) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % end
    }
}

/// How long a run takes on this machine now.
fn time(bench: &Bench, args: &str) -> Duration {
    let start = Instant::now();
    bench.run(args);
    start.elapsed()
}

/// Kills a run with `--resume` somewhere in the first half of the time that a whole one takes, unless it has ended; answers
/// whether it was killed.
fn kill(bench: &Bench, args: &str, whole: Duration, dice: &mut Dice) -> bool {
    let mut child = bench.command(args).stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(whole * dice.throw(500) as u32 / 1000);
    if child.try_wait().unwrap().is_some() {
        return false;
    }
    child.kill().unwrap();
    child.wait().unwrap().code().is_none()
}

#[test]
fn a_run_that_is_killed_again_and_again_makes_the_same_file() {
    let bench = Bench::new();
    let whole = time(&bench, &format!("{RUN} whole.photons"));
    let mut dice = Dice(1);
    let args = format!("{RUN} a.photons --resume --checkpoint 0.01");
    let n_killed = (0..6).filter(|_| kill(&bench, &args, whole, &mut dice)).count();
    assert!(n_killed > 0);
    bench.run(&format!("{args} --force"));
    assert!(bench.read("a.photons") == bench.read("whole.photons"));
    let left: Vec<_> = bench.files().into_keys().filter(|name| !name.starts_with('.')).collect();
    assert_eq!(left, ["a.photons", "scene.toml", "whole.photons"]);
}

#[test]
fn an_interrupted_run_keeps_what_was_done_and_says_how_to_go_on() {
    let bench = Bench::new();
    let whole = time(&bench, &format!("{RUN} whole.photons --seed 5"));
    let args = format!("{RUN} a.photons --seed 5");
    let child = bench.command(&args).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(whole * 3 / 10);
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-s", "INT", &id]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{said}");
    let way = "photon-build: no photon map was written, but what is done is kept in a.photons.journal; go on with: \
               photon-build scene.toml --photons 1M --store direct -t 1 -q -o a.photons --seed 5 --resume: interrupted\n";
    assert_eq!(said, way);

    bench.refuses(&args, 1, "a.photons.journal holds what an interrupted run has done; go on with --resume, or start anew with --force");
    let other = |args: &str| args.replace("1M", "500K").replace("--seed 5", "--seed 6");
    bench.refuses(
        &format!("{} --resume", other(&args)),
        1,
        "a.photons.journal is of a run with other settings: --photons was 1000000 and is 500000, --seed was 5 and is 6; \
         give those, or start anew with --force",
    );
    let scene = bench.read("scene.toml");
    bench.write(
        "scene.toml",
        String::from_utf8(scene.clone()).unwrap().replace("radius = 0.6", "radius = 0.5"),
    );
    let output = bench.command(&format!("{args} --resume")).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("other settings: sphere `ball` was "), "{said}");
    bench.write("scene.toml", scene);

    // Of a journal that a power cut has left with holes the good part counts.
    let journal = bench.read("a.photons.journal");
    for end in [journal.len() / 3, journal.len() - 1] {
        let mut damaged = journal[..end].to_vec();
        let at = end / 2;
        damaged[at] ^= 16;
        bench.write("a.photons.journal", damaged);
        bench.run(&format!("{args} --resume --force"));
        assert!(bench.read("a.photons") == bench.read("whole.photons"));
        assert!(!bench.path("a.photons.journal").exists());
    }
    bench.write("a.photons.journal", "something else");
    fs::remove_file(bench.path("a.photons")).unwrap();
    let message = "a.photons.journal is damaged or no journal; start anew with --force";
    bench.refuses(&format!("{args} --resume"), 1, message);
}
