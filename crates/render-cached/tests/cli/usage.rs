//! Wrong command lines.

use crate::bench::{Bench, SMALL};

#[test]
fn what_is_missing_is_told() {
    let bench = Bench::new();
    let refuses = |args: &str, missing: &str| {
        let message =
            format!("the following required arguments were not provided: {missing}; try --help");
        bench.refuses(args, 2, &message);
    };
    refuses("", "--photons <MAPS.photons> --output <IMAGE> <SCENE>");
    refuses("scene.toml --photons a.photons", "--output <IMAGE>");
    refuses("scene.toml -o a.exr", "--photons <MAPS.photons>");
    refuses("diff a.exr", "<B>");
}

#[test]
fn wrong_values_are_told() {
    let bench = Bench::new();
    let refuses = |option: &str, value: &str, shown: &str, message: &str| {
        bench.refuses(
            &format!("scene.toml --photons a.photons -o a.exr {option}={value}"),
            2,
            &format!("invalid value '{value}' for '{option} <{shown}>': {message}; try --help"),
        );
    };
    for (value, message) in [
        ("0x0", "a picture needs one pixel at least each way"),
        ("5x0", "a picture needs one pixel at least each way"),
        ("1x", "expected a width and a height such as 640x480"),
        ("-1x5", "expected a width and a height such as 640x480"),
        ("640", "expected a width and a height such as 640x480"),
        ("640x480x3", "expected a width and a height such as 640x480"),
        ("99999999999x1", "expected a width and a height such as 640x480"),
        ("100000x100000", "a picture may have 2^32 pixels at most"),
    ] {
        refuses("--resolution", value, "WxH", message);
    }
    bench.refuses(
        "scene.toml --photons a.photons -o a.exr --resolution -1x5",
        2,
        "invalid value '-1x5' for '--resolution <WxH>': expected a width and a height such as 640x480; try --help",
    );
    let least = "expected a count from 2 to 1M; the farthest photon only tells the radius";
    for value in ["0", "1", "2M"] {
        refuses("--gather", value, "K", least);
        refuses("--caustic-gather", value, "K", least);
    }
    for value in ["0", "-1", "nan", "inf", "1e300", "1e-300", "1m"] {
        refuses("--gather-radius", value, "R", "expected a length above 0");
        refuses("--caustic-radius", value, "R", "expected a length above 0");
        refuses("--r0", value, "R", "expected a length above 0");
    }
    for value in ["-0.1", "nan", "1e300", "low"] {
        refuses("--tau-direct", value, "TAU", "expected a number from 0 up");
    }
    for value in ["0", "1.1", "nan", "1e-7"] {
        refuses("--fraction", value, "SHARE", "expected a share from 0.000001 to 1");
    }
    refuses("--error", "1.5", "E", "expected a FLIP value from 0 to 1");
    refuses("--region", "1", "PIXELS", "1 is not in 2..=256");
    refuses("--shadow-rays", "0", "N", "0 is not in 1..=65536");
    refuses("--exposure", "200", "EV", "expected a number of stops between -100 and 100");
    refuses("--kernel", "square", "NAME", "expected one of box, cone, epanechnikov, biweight");
}

#[test]
fn combinations_without_sense_are_told() {
    let bench = Bench::new();
    let refuses = |args: &str, message: &str| {
        bench.refuses(&format!("scene.toml --photons a.photons {args}"), 2, message);
    };
    for mode in ["original", "adaptive --error 0"] {
        for option in ["--save-cache", "--from-cache"] {
            refuses(
                &format!("-o a.exr --mode {mode} {option} a.cache"),
                "--save-cache and --from-cache need --mode paper, or --mode adaptive with an --error above 0",
            );
        }
    }
    for (option, value) in
        [("--tau-direct", "0.1"), ("--tau-specular", "0"), ("--region", "6"), ("--r0", "1")]
    {
        for mode in ["", "--mode original", "--mode adaptive"] {
            let message = format!("{option} needs --mode paper");
            refuses(&format!("-o a.exr {mode} {option} {value}"), &message);
        }
    }
    refuses(
        "-o a.exr --mode papr",
        "invalid value 'papr' for '--mode <MODE>' [possible values: original, paper, adaptive]; tip: a similar value exists: 'paper'; try --help",
    );
    refuses("-o a.exr -q -v", "the argument '--quiet' cannot be used with '--verbose'; try --help");
    for name in ["a.jpg", "a", "a.exr.gz"] {
        refuses(
            &format!("-o a.exr -o {name}"),
            &format!("cannot tell the format of {name}; end its name in .exr or .png"),
        );
    }
}

#[test]
fn a_scene_of_a_stranger_reads_its_folder_only() {
    let bench = Bench::new();
    bench.render("--mode original -o a.exr");
    bench.render("--mode original --no-external -o b.exr");
    assert!(bench.read("a.exr") == bench.read("b.exr"));
    std::fs::create_dir(bench.path("theirs")).unwrap();
    std::os::unix::fs::symlink(bench.path("scene.toml"), bench.path("theirs/scene.toml")).unwrap();
    bench.refuses(
        &format!("theirs/{SMALL} --no-external -o c.exr"),
        1,
        "cannot read theirs/scene.toml: it lies outside the folder of the scene, where nothing is read with --no-external; \
         copy it there, or leave that option out if you trust the scene",
    );
}
