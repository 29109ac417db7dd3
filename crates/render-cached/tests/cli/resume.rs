//! Runs that are killed and go on: `--resume`, `--checkpoint`.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::bench::{Bench, MODES};

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

/// Large enough for a cache to pay.
const RUN: &str = "scene.toml --photons a.photons --resolution 150x120 --shadow-rays 200 --gather 50 --caustic-gather 20 -q";

#[test]
fn a_run_that_is_killed_again_and_again_makes_the_same_picture() {
    let bench = Bench::new();
    let mut dice = Dice(2);
    for mode in MODES {
        let start = Instant::now();
        bench.run(&format!("{RUN} --mode {mode} -o whole.exr -o whole.png --force"));
        let whole = start.elapsed();
        let args = format!("{RUN} --mode {mode} -o b.exr -o b.png --resume --checkpoint 0.001");
        let mut n_killed = 0;
        for _ in 0..40 {
            let mut child = bench.command(&args).stderr(Stdio::null()).spawn().unwrap();
            std::thread::sleep(whole * dice.throw(90) as u32 / 100);
            child.kill().unwrap();
            n_killed += usize::from(child.wait().unwrap().code().is_none());
            // Some are faster than the whole run was: they begin anew.
            for name in ["b.exr", "b.png"] {
                let _ = std::fs::remove_file(bench.path(name));
            }
            if n_killed == 3 {
                break;
            }
        }
        assert!(n_killed > 0, "{mode}");
        // On another number of threads, too.
        bench.run(&format!("{args} -t 3 --force"));
        assert!(bench.read("b.exr") == bench.read("whole.exr"), "{mode}");
        assert!(bench.read("b.png") == bench.read("whole.png"), "{mode}");
        let left = bench.files().into_keys().filter(|name| name.ends_with(".journal")).count();
        assert_eq!(left, 0, "{mode}");
    }
}

#[test]
fn an_interrupted_run_keeps_what_was_done_and_says_how_to_go_on() {
    let bench = Bench::new();
    let run = RUN.replace("--shadow-rays 200", "--shadow-rays 2000");
    for mode in MODES {
        let args = format!("{run} --mode {mode} --checkpoint 0.01 -o c.exr");
        let mut child = bench.command(&args).stderr(Stdio::piped()).spawn().unwrap();
        // Something is done as soon as there is a journal; most is still to do.
        while !bench.path("c.exr.journal").exists() && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(2));
        }
        let id = child.id().to_string();
        assert!(Command::new("kill").args(["-s", "INT", &id]).status().unwrap().success());
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(130), "{mode}: {said}");
        let start = "render-cached: no picture was written, but what is done is kept in c.exr.journal; go on with: \
                     render-cached scene.toml ";
        assert!(
            said.starts_with(start) && said.ends_with(" -o c.exr --resume: interrupted\n"),
            "{said}"
        );
        let other = args.replace("--gather 50", "--gather 60");
        let output = bench.command(&format!("{other} --resume")).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        let start = "render-cached: c.exr.journal is of a run with other settings: --gather was 50 and is 60, the estimate \
                     of indirect light was ";
        assert!(output.status.code() == Some(1) && said.starts_with(start), "{said}");
        std::fs::remove_file(bench.path("c.exr.journal")).unwrap();
    }
}
