//! How the program ends when nobody listens, when it is interrupted, when the system refuses.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::assert::OutputAssertExt;

use crate::bench::Bench;

/// A run in a shell, which has `$PROGRAM`.
fn shell(bench: &Bench, script: &str) -> Command {
    let mut command = Command::new("sh");
    command.args(["-c", script]).current_dir(bench.path("")).env_remove("TETRALUX_THREADS");
    command.env("PROGRAM", env!("CARGO_BIN_EXE_photon-build"));
    command
}

#[test]
fn nobody_needs_to_listen() {
    let bench = Bench::new();
    bench.run("scene.toml --photons 1K -o a.photons");
    let build = "$PROGRAM scene.toml --photons 1K -o a.photons --force -v";
    for script in [
        "$PROGRAM info a.photons >&-",
        "{ sleep 0.1; $PROGRAM info a.photons; echo $? >code; } | head -c 0; exit $(cat code)",
        "{ sleep 0.1; $PROGRAM --help; echo $? >code; } | head -c 0; exit $(cat code)",
        &format!("{build} 2>&-"),
        &format!("{build} 2>/dev/full"),
        &format!("{build} <&- >&- 2>&-"),
        &format!("{{ sleep 0.1; {build}; echo $? >code; }} 2>&1 | head -c 0; exit $(cat code)"),
    ] {
        shell(&bench, script).assert().success().stdout("").stderr("");
    }
    shell(&bench, "$PROGRAM info a.photons >/dev/full").assert().code(1).stderr(
        "photon-build: cannot write to standard output: No space left on device (os error 28)\n",
    );
    shell(&bench, "$PROGRAM none.toml -o b.photons 2>&-").assert().code(1);
    shell(&bench, "$PROGRAM 2>/dev/full").assert().code(2);
}

#[test]
fn help_and_version_go_to_standard_output() {
    let bench = Bench::new();
    let (version, _) = bench.run("--version");
    assert_eq!(version, format!("photon-build {}\n", env!("CARGO_PKG_VERSION")));
    let (help, err) = bench.run("--help");
    assert!(help.starts_with("Shoot photons into a scene and save photon maps\n"), "{help}");
    assert_eq!(err, "");
}

#[test]
fn interrupts_leave_nothing() {
    let bench = Bench::new();
    bench.write("old.photons", "precious");
    let before = bench.files();
    for signal in ["INT", "TERM"] {
        let mut child = bench
            .command(
                "scene.toml -o old.photons --photons 2G --stats a.json --force -v --checkpoint 0 \
                 --ignore-memory",
            )
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
        // The scene is loaded, the photons are on their way.
        assert!(said.any(|line| line.contains("1 lights")));
        std::thread::sleep(Duration::from_millis(100));
        let start = Instant::now();
        let id = child.id().to_string();
        assert!(Command::new("kill").args(["-s", signal, &id]).status().unwrap().success());
        let status = child.wait().unwrap();
        let elapsed = start.elapsed();
        assert_eq!(status.code(), Some(130));
        assert_eq!(said.last().unwrap(), "photon-build: no photon map was written: interrupted");
        assert!(elapsed < Duration::from_secs(2), "{elapsed:?}");
        assert!(bench.files() == before);
    }
}

#[test]
fn threads_that_cannot_be_had_are_told() {
    let bench = Bench::new();
    // Stacks of 64 MB do not fit 60 times.
    shell(&bench, "ulimit -v 3000000; $PROGRAM scene.toml -o a.photons --photons 1K -t 60")
        .assert()
        .code(1)
        .stderr("photon-build: cannot start 60 threads; ask for fewer with -t: Resource temporarily unavailable (os error 11)\n");
}

#[test]
fn warnings_are_errors_where_it_is_asked_for() {
    let bench = Bench::new();
    let cut = "scene.toml --photons 1K --max-bounces 1 -o a.photons";
    let (_, said) = bench.run(&format!("{cut} -q"));
    let warning = said.strip_prefix("photon-build: warning: ").unwrap().trim_end().to_owned();
    bench.refuses(
        &format!("{cut} --force --strict"),
        1,
        &format!("{warning} (a warning, but for --strict)"),
    );
    bench.run("scene.toml --photons 1K -o b.photons --strict");
}

#[test]
fn an_end_is_in_time_wherever_it_is_asked_for() {
    let bench = Bench::new();
    let before = bench.files();
    // Sorting millions of photons into a tree, and writing them, has no pieces between which anybody is asked.
    for delay in [2000, 2600, 3200] {
        let mut child = bench
            .command("scene.toml -o a.photons --photons 4M -q --store direct --checkpoint 0")
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(delay));
        let start = Instant::now();
        let id = child.id().to_string();
        if child.try_wait().unwrap().is_some() {
            break;
        }
        assert!(Command::new("kill").args(["-s", "INT", &id]).status().unwrap().success());
        let output = child.wait_with_output().unwrap();
        let elapsed = start.elapsed();
        if output.status.success() {
            break;
        }
        assert_eq!(output.status.code(), Some(130));
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(said, "photon-build: no photon map was written: interrupted\n");
        // Half a second on a machine with nothing else to do.
        assert!(elapsed < Duration::from_secs(3), "{elapsed:?}");
        assert!(bench.files() == before);
    }
}
