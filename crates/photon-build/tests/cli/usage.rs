//! Wrong command lines, and inputs that can't be used.

use std::fs::{self, File, Permissions};
use std::os::unix::fs::PermissionsExt;

use mapfile::{Header, Section};

use crate::bench::{Bench, SCENE};

#[test]
fn wrong_command_lines_are_told_in_a_line() {
    let bench = Bench::new();
    let refuses = |args: &str, message: &str| bench.refuses(args, 2, message);
    refuses(
        "",
        "the following required arguments were not provided: --output <MAPS.photons> <SCENE>; try --help",
    );
    refuses(
        "scene.toml",
        "the following required arguments were not provided: --output <MAPS.photons>; try --help",
    );
    refuses("info", "the following required arguments were not provided: <MAP>; try --help");
    refuses(
        "scene.toml -o a.photons b.toml",
        "the subcommand 'b.toml' cannot be used with: <SCENE> --output <MAPS.photons>; try --help",
    );
    refuses(
        "scene.toml -o a.photons --photon 5",
        "unexpected argument '--photon' found; tip: a similar argument exists: '--photons'; try --help",
    );
    refuses(
        "scene.toml -o a.photons -q -v",
        "the argument '--quiet' cannot be used with '--verbose'; try --help",
    );
    refuses(
        "scene.toml -o a.photons --store caustic",
        "invalid value 'caustic' for '--store <CLASS>' [possible values: direct, gather]; try --help",
    );
    refuses(
        "scene.toml -o a.photons --seed -1",
        "unexpected argument '-1' found; tip: to pass '-1' as a value, use '-- -1'; try --help",
    );
    refuses(
        "scene.toml -o a.photons --max-bounces 0",
        "invalid value '0' for '--max-bounces <N>': 0 is not in 1..=4294967295; try --help",
    );
    refuses(
        "scene.toml -o a.photons --threads two",
        "invalid value 'two' for '--threads <N>': invalid digit found in string; try --help",
    );
}

#[test]
fn numbers_of_photons_are_checked() {
    let bench = Bench::new();
    let refuses = |args: &str, message: &str| {
        bench.refuses(&format!("scene.toml -o a.photons {args}"), 2, message);
    };
    refuses("--photons 0", "--photons 0 emits nothing; ask for one photon at least");
    refuses("--photons 0.0K", "--photons 0 emits nothing; ask for one photon at least");
    refuses("--photons-per-light 0", "--photons-per-light 0 emits nothing; ask for one at least");
    for wrong in ["-5", "many", "1e6", "M", "0x10"] {
        refuses(
            &format!("--photons {wrong}"),
            &format!(
                "invalid value '{wrong}' for '--photons <COUNT>': expected a count such as 500, 250K or 1.5M; try --help"
            ),
        );
    }
    refuses(
        "--photons 1.5",
        "invalid value '1.5' for '--photons <COUNT>': expected a whole number up to 10^15; try --help",
    );
    for option in ["--photons", "--photons-per-light"] {
        refuses(
            &format!("{option} 1000000G"),
            "1000000000000000 photons are too many; ask for 4294967295 at most",
        );
    }
    refuses(
        "--photons 1K --photons-per-light 1K",
        "the argument '--photons <COUNT>' cannot be used with '--photons-per-light <COUNT>'; try --help",
    );
}

#[test]
fn photons_of_all_lights_are_counted_together() {
    let bench = Bench::new();
    let mut scene = SCENE.to_owned();
    for x in ["-1", "1"] {
        scene += &format!("[[lights]]\ntype = \"point\"\nposition = [{x}, 2, 0]\nintensity = 1\n");
    }
    bench.write("three.toml", scene);
    bench.refuses(
        "three.toml -o a.photons --photons-per-light 2G",
        2,
        "6000000000 photons are too many; ask for 4294967295 at most",
    );
}

#[test]
fn scenes_that_cannot_be_read_are_named() {
    let bench = Bench::new();
    bench.write("broken.toml", "[camera\n");
    bench.write("dark.toml", SCENE.replace("emission = [10, 9, 8]", "emission = 0"));
    bench.write("binary.toml", [0xff, 0xfe, 0]);
    let refuses = |scene: &str, message: &str| {
        bench.refuses(&format!("{scene} -o a.photons"), 1, message);
    };
    refuses("none.toml", "cannot read none.toml: there is no such file");
    refuses(".", "cannot read .: it is a folder; add the name of a file");
    let error = |scene: &str| {
        let output = bench.command(&format!("{scene} -o a.photons")).output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8(output.stderr).unwrap()
    };
    // The wording of these belongs to the reader of scenes.
    for scene in ["broken.toml", "dark.toml", "binary.toml"] {
        let message = error(scene);
        assert!(message.starts_with("photon-build: ") && message.contains(scene), "{message}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }

    fs::set_permissions(bench.path("scene.toml"), Permissions::from_mode(0o0)).unwrap();
    // Root may read everything.
    if File::open(bench.path("scene.toml")).is_err() {
        let message = error("scene.toml");
        assert!(message.starts_with("photon-build: cannot read scene.toml: "), "{message}");
    }
}

#[test]
fn info_tells_what_is_not_a_map_of_photons() {
    let bench = Bench::new();
    let header = Header {
        kind: "cache map".into(),
        version: 1,
        made_by: "render-cached 0.1.0".into(),
        command: "render-cached scene.toml --save-cache {file}".into(),
        inputs: Default::default(),
        notes: Vec::new(),
    };
    let sections = [Section::new("entries", &[0_u32])];
    let path = bench.path("a.cache");
    mapfile::write(&path, atomic_file::Existing::Refuse, &header, &(), &sections).unwrap();
    bench.write("empty", "");
    let refuses = |name: &str, message: &str| bench.refuses(&format!("info {name}"), 1, message);
    refuses(
        "a.cache",
        "a.cache is of kind `cache map`, not `photon map`; it was made with: render-cached scene.toml --save-cache a.cache",
    );
    for name in ["scene.toml", "empty", "/dev/null", "/dev/zero"] {
        refuses(
            name,
            &format!("{name} is not a map: its first line is not `#?tetralux-map`; check the name"),
        );
    }
    refuses("none", "cannot read none: No such file or directory (os error 2)");
    refuses(".", "cannot read .: Is a directory (os error 21)");
}

#[test]
fn a_scene_of_a_stranger_reads_its_folder_only() {
    let bench = Bench::new();
    fs::create_dir(bench.path("theirs")).unwrap();
    bench.write(
        "theirs/scene.toml",
        format!("{SCENE}[[meshes]]\nfile = \"../mine.obj\"\nmaterial = \"white\"\n"),
    );
    bench.write("mine.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let line = SCENE.lines().count() + 2;
    let args = "theirs/scene.toml --photons 10 -o a.photons";
    bench.refuses(
        &format!("{args} --no-external"),
        1,
        &format!(
            "theirs/scene.toml:{line}:8: cannot read theirs/../mine.obj: it lies outside the folder of the scene, where \
             nothing is read with --no-external; copy it there, or leave that option out if you trust the scene; \
             paths are relative to the scene file"
        ),
    );
    bench.run(args);
    // It says nothing about what the scene is, so it leaves no trace.
    bench.write("theirs/scene.toml", SCENE);
    bench.run("theirs/scene.toml --photons 10 -o b.photons");
    bench.run("theirs/scene.toml --photons 10 --no-external -o c.photons");
    assert!(bench.read("b.photons") == bench.read("c.photons"));
}
