//! `render-cached diff`.

use crate::bench::{Bench, SMALL};

#[test]
fn pictures_are_compared() {
    let bench = Bench::new();
    bench.render("--mode original -o a.exr");
    bench.render("--mode original -o b.exr --seed 1");
    let (out, err) = bench.run("diff a.exr a.exr");
    assert_eq!(err, "");
    assert_eq!(
        out,
        "mean error  0.000000\nRMS error   0.000000\nrelMSE      0.000000\npeak error  0.000000 at 0,0\n\
         FLIP mean   0.00000\nFLIP p99    0.00000\nFLIP block  0.00000\nFLIP > 0.1  0.0000 %\n"
    );
    let figures = |args: &str| -> Vec<f64> {
        let (out, _) = bench.run(&format!("diff a.exr b.exr {args}"));
        let number =
            |line: &str| line.split_whitespace().find_map(|word| word.parse().ok()).unwrap();
        out.lines().map(number).collect()
    };
    let whole = figures("");
    assert_eq!(whole.len(), 8);
    assert!(whole[0] > 0.0 && whole[0] <= whole[1] && whole[1] <= whole[3], "{whole:?}");
    // The seed of the renderer is no part of the photons.
    assert_eq!(figures("--layer indirect")[3], 0.0);
    assert_eq!(figures("--layer direct")[3], figures("--layer direct --exposure 3")[3]);
    bench.run("diff a.exr b.exr -o diff.png");
    assert!(bench.read("diff.png").starts_with(b"\x89PNG\r\n\x1a\n"));
}

#[test]
fn what_cannot_be_compared_is_told() {
    let bench = Bench::new();
    bench.render("--mode original -o a.exr");
    bench.run(&format!("{} -o small.exr", SMALL.replace("48x32", "5x4")));
    bench.write("cut.exr", &bench.read("a.exr")[..1000]);
    let refuses = |args: &str, code: i32, message: &str| {
        bench.refuses(&format!("diff {args}"), code, message);
    };
    refuses("a.exr none.exr", 1, "cannot read none.exr: No such file or directory (os error 2)");
    refuses("scene.toml a.exr", 1, "scene.toml is not an OpenEXR file");
    refuses(
        "a.exr small.exr",
        1,
        "the pictures differ in size, 48x32 and 5x4; compare pictures of the same resolution",
    );
    let png = "the picture of a difference is a PNG; end its name in .png, unlike";
    refuses("a.exr a.exr -o d.jpg", 2, &format!("{png} d.jpg"));
    refuses("a.exr a.exr -o d.exr --force", 2, &format!("{png} d.exr"));
    bench.write("old.png", "precious");
    refuses(
        "a.exr a.exr -o old.png",
        1,
        "old.png exists; give another name or --force to replace it",
    );
    std::fs::copy(bench.path("a.exr"), bench.path("exr.png")).unwrap();
    refuses(
        "exr.png a.exr -o exr.png --force",
        2,
        "exr.png is an input; give the output another name",
    );
    let output = bench.command("diff a.exr a.exr --layer glow").output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(
        message.starts_with("render-cached: a.exr has no channel glow.R; it has Albedo.B, "),
        "{message}"
    );
    let output = bench.command("diff cut.exr a.exr").output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(message.starts_with("render-cached: cut.exr is damaged ("), "{message}");
}
