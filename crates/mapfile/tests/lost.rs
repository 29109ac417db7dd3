//! Maps that somebody changes while they are in use: really, in a process of its own.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "it talks to itself in another process"
)]
#![cfg(target_os = "linux")] // The signal comes when Linux sends it.

use std::fs::{self, OpenOptions};
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::process::{Command, Stdio};

use atomic_file::Existing;
use base::Fingerprint;
use mapfile::{Header, MapFile, Section};

const KIND: &str = "example map";

/// What a process of its own makes of a map that `damage` meets while it is in use: its exit code and its words.
///
/// The process is this test again, told by a variable what to do.
fn child_meets(test: &str, damage: impl Fn(&Path)) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.map");
    let values: Vec<u64> = (0..100_000).collect();
    let header = Header {
        kind: KIND.into(),
        version: 3,
        made_by: "tests 1".into(),
        command: "make {file}".into(),
        inputs: Fingerprint(1),
        notes: Vec::new(),
    };
    mapfile::write(&path, Existing::Refuse, &header, &0_u8, &[Section::new("values", &values)])
        .unwrap();
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args([test, "--exact", "--nocapture"])
        .env("TETRALUX_TEST_MAP", &path)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(said.any(|line| line.unwrap().ends_with("open")));
    damage(&path);
    drop(child.stdin.take());
    let output = child.wait_with_output().unwrap();
    let words = String::from_utf8(output.stderr).unwrap();
    (output.status.code(), words.replace(&*path.to_string_lossy(), "a.map"))
}

/// In the process of its own: opens the map, waits, reads all of it. Answers whether this is that process.
fn meet_damage() -> bool {
    let Some(path) = std::env::var_os("TETRALUX_TEST_MAP") else { return false };
    let (map, _) = MapFile::open::<u8>(Path::new(&path), KIND, 3).unwrap();
    let values = map.array::<u64>("values").unwrap();
    println!("open");
    std::io::stdin().read_to_end(&mut Vec::new()).unwrap();
    let sum = values.iter().fold(0_u64, |sum, v| sum.wrapping_add(*v));
    let check = map.check_untouched().map_err(|e| e.to_string());
    eprintln!("{}: {check:?}", sum == 100_000 * 99_999 / 2);
    std::process::exit(if check.is_ok() { 0 } else { 7 });
}

#[test]
fn a_map_that_is_shortened_in_use_ends_the_process_in_words() {
    if meet_damage() {
        return;
    }
    let name = "a_map_that_is_shortened_in_use_ends_the_process_in_words";
    let (code, words) = child_meets(name, |path| {
        OpenOptions::new().write(true).open(path).unwrap().set_len(4096).unwrap();
    });
    let expected = "cannot read a.map: it was shortened while it was in use, or its disk or network failed; put it back \
                    or make it anew\n";
    assert_eq!((code, &*words), (Some(1), expected));
}

#[test]
fn a_map_that_is_overwritten_in_use_is_found_out() {
    if meet_damage() {
        return;
    }
    let name = "a_map_that_is_overwritten_in_use_is_found_out";
    let (code, words) = child_meets(name, |path| {
        let mut file = OpenOptions::new().write(true).open(path).unwrap();
        file.seek(SeekFrom::End(-8)).unwrap();
        file.write_all(&[0xff; 8]).unwrap();
    });
    assert_eq!(code, Some(7), "{words}");
    assert!(words.contains("a.map was changed while it was in use"), "{words}");
    // Replaced and removed, as programs of this project do it, a map stays what it was for whoever uses it.
    let (code, words) = child_meets(name, |path| {
        fs::write(path.with_extension("new"), b"other").unwrap();
        fs::rename(path.with_extension("new"), path).unwrap();
        fs::remove_file(path).unwrap();
    });
    assert_eq!((code, &*words), (Some(0), "true: Ok(())\n"));
}
