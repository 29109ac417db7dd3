//! How the program ends when nobody listens, and when it is interrupted.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::assert::OutputAssertExt;

use crate::bench::{Bench, MODES, SCENE, SMALL};

#[test]
fn nobody_needs_to_listen() {
    let bench = Bench::new();
    bench.render("-o a.exr");
    let render = format!("$PROGRAM {SMALL} -o b.exr --force -v");
    let shell = |script: &str| {
        let mut command = Command::new("sh");
        command.args(["-c", script]).current_dir(bench.path("")).env_remove("TETRALUX_THREADS");
        command.env("PROGRAM", env!("CARGO_BIN_EXE_render-cached"));
        command
    };
    for script in [
        "$PROGRAM diff a.exr a.exr >&-",
        "{ sleep 0.1; $PROGRAM diff a.exr a.exr; echo $? >code; } | head -c 0; exit $(cat code)",
        &format!("{render} 2>&-"),
        &format!("{render} 2>/dev/full"),
        &format!("{render} <&- >&- 2>&-"),
        &format!("{{ sleep 0.1; {render}; echo $? >code; }} 2>&1 | head -c 0; exit $(cat code)"),
    ] {
        shell(script).assert().success().stdout("").stderr("");
    }
    shell("$PROGRAM diff a.exr a.exr >/dev/full").assert().code(1).stderr(
        "render-cached: cannot write to standard output: No space left on device (os error 28)\n",
    );
    shell("$PROGRAM 2>/dev/full").assert().code(2);
    shell("$PROGRAM diff a.exr none.exr 2>&-").assert().code(1);
}

#[test]
fn interrupts_leave_nothing() {
    let bench = Bench::new();
    bench.write("old.exr", "precious");
    let before = bench.files();
    // Hours of work, of which single pixels take long.
    let long = "scene.toml --photons a.photons --resolution 1000x1000 --shadow-rays 65536 -o old.exr -o a.png --force -v --checkpoint 0";
    for mode in MODES {
        let mut child = bench
            .command(&format!("{long} --mode {mode} --stats a.json"))
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
        // Scene and maps are loaded.
        assert!(said.any(|line| line.contains("caustic photons")));
        std::thread::sleep(Duration::from_millis(400));
        let start = Instant::now();
        let id = child.id().to_string();
        assert!(Command::new("kill").args(["-s", "INT", &id]).status().unwrap().success());
        let status = child.wait().unwrap();
        let elapsed = start.elapsed();
        assert_eq!(status.code(), Some(130), "{mode}");
        assert_eq!(said.last().unwrap(), "render-cached: no picture was written: interrupted");
        assert!(elapsed < Duration::from_secs(2), "{mode}: {elapsed:?}");
        assert!(bench.files() == before, "{mode}");
    }
}

#[test]
fn an_end_is_heard_while_a_picture_is_written() {
    let bench = Bench::new();
    bench.write("a.exr", "precious");
    let before = bench.files();
    let large = "scene.toml --photons a.photons --mode original --resolution 1400x2400 --shadow-rays 1 --gather 2";
    let mut child = bench
        .command(&format!("{large} --caustic-gather 2 -o a.exr --force -q --checkpoint 0"))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // A picture that is being written has another name. When the first of two bands is there, it is begun.
    while bench.files().len() == before.len() {
        assert!(child.try_wait().unwrap().is_none(), "it was written before anybody saw it");
        std::thread::sleep(Duration::from_millis(2));
    }
    // It waits until the signal is there: on a busy machine it could be done before.
    let id = child.id().to_string();
    let signal = |name: &str| {
        assert!(Command::new("kill").args(["-s", name, &id]).status().unwrap().success());
    };
    signal("STOP");
    signal("INT");
    let start = Instant::now();
    signal("CONT");
    let output = child.wait_with_output().unwrap();
    let elapsed = start.elapsed();
    assert_eq!(output.status.code(), Some(130));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.ends_with("render-cached: no picture was written: interrupted\n"), "{said}");
    // Half a second on a machine with nothing else to do; one with much else has its own pace.
    assert!(elapsed < Duration::from_secs(20), "{elapsed:?}");
    assert!(bench.files() == before);
}

#[test]
fn warnings_are_errors_where_it_is_asked_for() {
    let unused = "\n[materials.unused]\ntype = \"diffuse\"\nalbedo = 0.5\n";
    let bench = Bench::of(&format!("{SCENE}{unused}"));
    let (_, said) = bench.run(&format!("{SMALL} -o a.exr -q"));
    let warning = said.strip_prefix("render-cached: warning: ").unwrap().trim_end().to_owned();
    bench.refuses(
        &format!("{SMALL} -o b.exr --strict"),
        1,
        &format!("{warning} (a warning, but for --strict)"),
    );
}
