//! Faults that are really made: maps that somebody changes while they are in use, light that is no number.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::Path;
use std::process::Stdio;

use crate::bench::{Bench, MODES, SMALL};

/// Does `damage` to the photon maps during a run of a few seconds; answers its exit code and its last line.
fn run_through(bench: &Bench, mode: &str, damage: impl Fn(&Path)) -> (Option<i32>, String) {
    let mut child = bench
        .command(&format!(
            "scene.toml --photons b.photons --resolution 300x300 --shadow-rays 64 --mode {mode} -o a.exr --force -v"
        ))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(said.next().unwrap().contains("caustic photons"));
    damage(&bench.path("b.photons"));
    let last = said.last().unwrap();
    (child.wait().unwrap().code(), last)
}

#[test]
fn photon_maps_that_are_shortened_in_use_end_the_run_in_words() {
    let bench = Bench::new();
    bench.write("a.exr", "precious");
    for mode in MODES {
        bench.write("b.photons", bench.read("a.photons"));
        let (code, last) = run_through(&bench, mode, |path| {
            OpenOptions::new().write(true).open(path).unwrap().set_len(4096).unwrap();
        });
        let words = "cannot read b.photons: it was shortened while it was in use, or its disk or network failed; put it \
                     back or make it anew";
        assert_eq!((code, &*last), (Some(1), words), "{mode}");
        assert_eq!(bench.read("a.exr"), b"precious");
    }
}

#[test]
fn photon_maps_that_are_overwritten_in_use_make_no_picture() {
    let bench = Bench::new();
    bench.write("a.exr", "precious");
    bench.write("b.photons", bench.read("a.photons"));
    let (code, last) = run_through(&bench, "original", |path| {
        let mut file = OpenOptions::new().write(true).open(path).unwrap();
        file.seek(SeekFrom::Start(20_000)).unwrap();
        file.write_all(&[0x5a; 3000]).unwrap();
    });
    assert_eq!(code, Some(1), "{last}");
    assert!(last.starts_with("render-cached: b.photons was changed while it was in use"), "{last}");
    assert_eq!(bench.read("a.exr"), b"precious");
}

#[test]
fn photon_maps_may_be_replaced_while_they_are_in_use() {
    let bench = Bench::new();
    bench.write("b.photons", bench.read("a.photons"));
    let (code, last) = run_through(&bench, "paper", |path| {
        let other = path.with_extension("other");
        File::create(&other).unwrap().write_all(b"other").unwrap();
        std::fs::rename(other, path).unwrap();
    });
    assert_eq!(code, Some(0), "{last}");
    bench.write("b.photons", bench.read("a.photons"));
    let (code, _) = run_through(&bench, "paper", |path| std::fs::remove_file(path).unwrap());
    assert_eq!(code, Some(0));
}

#[test]
fn light_that_is_no_number_makes_no_picture() {
    // A bulb that touches the floor just where the middle of the picture shows it.
    let bench = Bench::of(
        r#"
camera = { origin = [0, 1, 0], target = [0, 0, 0], up = [0, 0, 1], fov = 40 }
materials.white = { type = "diffuse", albedo = 1 }
quads = [{ name = "floor", corner = [-2, 0, -2], edges = [[0, 0, 4], [4, 0, 0]], material = "white" }]
lights = [{ type = "point", position = [0, 1e-16, 0], intensity = 1e15 }]
"#,
    );
    bench.write("a.exr", "precious");
    for mode in MODES {
        let args = SMALL.replace("48x32", "3x3");
        bench.refuses(
            &format!("{args} --mode {mode} -o a.exr -o a.png --force"),
            1,
            "no picture was written, since direct light is (NaN, NaN, NaN) at pixel (1, 1); look for lights that touch \
             surfaces, or report it as a fault of the renderer",
        );
    }
}
