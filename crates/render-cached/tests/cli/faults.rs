//! Faults that are really made: maps that somebody changes while they are in use, light that is no number.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::Path;
use std::process::Stdio;
use std::thread::sleep;
use std::time::Instant;

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
    assert!(said.any(|line| line.contains("caustic photons")));
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

/// Overwrites bytes of `file` at several moments of runs that read it. Each run must end with the right picture, if it was
/// done by then, or in words, with the picture before it untouched.
fn overwrite_during(bench: &Bench, run: &str, file: &str) {
    let whole = bench.read(file);
    let start = Instant::now();
    bench.run(&format!("{run} -o a.exr"));
    let unbroken = start.elapsed();
    let right = bench.read("a.exr");
    for part in 0..8 {
        bench.write("a.exr", "precious");
        let child = bench
            .command(&format!("{run} -o a.exr --force"))
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        sleep(unbroken * part / 8);
        let mut damaged = OpenOptions::new().write(true).open(bench.path(file)).unwrap();
        damaged.seek(SeekFrom::End(-900)).unwrap();
        damaged.write_all(&[0x5a; 300]).unwrap();
        drop(damaged);
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        let picture = bench.read("a.exr");
        if output.status.success() {
            assert!(picture == right, "{file} at {part}/8");
        } else {
            assert_eq!(output.status.code(), Some(1), "{said}");
            let last = said.lines().last().unwrap();
            let faults =
                [format!("{file} was changed while it was in use"), format!("{file} is damaged")];
            assert!(faults.iter().any(|fault| last.contains(fault)), "{last}");
            assert_eq!(picture, b"precious");
        }
        bench.write(file, &whole);
    }
}

#[test]
fn caches_and_layers_that_are_overwritten_in_use_make_no_wrong_picture() {
    let bench = Bench::new();
    let run = "scene.toml --photons a.photons --shadow-rays 32";
    let paper = format!("{run} --mode paper");
    bench.run(&format!("{paper} --resolution 100x100 --save-cache paper.cache"));
    let paper = format!("{paper} --resolution 150x150");
    overwrite_during(&bench, &format!("{paper} --from-cache paper.cache"), "paper.cache");
    std::fs::remove_file(bench.path("a.exr")).unwrap();

    let adaptive = format!("{run} --resolution 150x150 --mode adaptive --error 0.005");
    bench.run(&format!("{adaptive} --save-cache adaptive.cache --save-layers a.layers"));
    overwrite_during(&bench, &format!("{adaptive} --from-cache adaptive.cache"), "adaptive.cache");
    std::fs::remove_file(bench.path("a.exr")).unwrap();
    overwrite_during(&bench, &format!("{adaptive} --from-layers a.layers"), "a.layers");
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
