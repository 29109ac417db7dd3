//! Where pictures, cache maps and accounts may go.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::PathBuf;
use std::process::Command;

use assert_cmd::assert::OutputAssertExt;

use crate::bench::{Bench, SMALL};

#[test]
fn outputs_that_cannot_be_meant_are_refused() {
    let bench = Bench::new();
    bench.write("old.exr", "precious");
    bench.write("old.png", "precious");
    bench.write("old.cache", "precious");
    symlink("a.photons", bench.path("link.exr")).unwrap();
    fs::create_dir(bench.path("out.exr")).unwrap();
    let refuses = |args: &str, code: i32, message: &str| {
        bench.refuses(&format!("{SMALL} --mode paper {args}"), code, message);
    };
    let exists = "exists; give another name or --force to replace it";
    refuses("-o old.exr", 1, &format!("old.exr {exists}"));
    refuses("-o new.exr -o old.png", 1, &format!("old.png {exists}"));
    refuses("-o new.exr --save-cache old.cache", 1, &format!("old.cache {exists}"));
    refuses("-o new.exr --stats old.cache", 1, &format!("old.cache {exists}"));
    refuses("-o out.exr", 1, "cannot write out.exr: it is a folder; add the name of a file");
    let folder = "there is no folder no; create it or give another name";
    refuses("-o no/a.exr", 1, &format!("cannot write no/a.exr: {folder}"));
    refuses("-o a.png --save-cache no/a.cache", 1, &format!("cannot write no/a.cache: {folder}"));
    refuses("-o a.png --stats no/a.json", 1, &format!("cannot write no/a.json: {folder}"));
    let twice = "is named as an output twice; give each its own name";
    refuses("-o a.exr -o a.exr", 2, &format!("a.exr {twice}"));
    refuses("-o a.exr -o b.png -o ./a.exr", 2, &format!("./a.exr {twice}"));
    refuses("-o a.exr --save-cache a.exr", 2, &format!("a.exr {twice}"));
    refuses("-o a.exr --save-cache b --stats out.exr/../b", 2, &format!("b {twice}"));
    let input = "is an input; give the output another name";
    refuses("-o link.exr --force", 2, &format!("link.exr {input}"));
    refuses("-o a.exr --save-cache a.photons --force", 2, &format!("a.photons {input}"));
    refuses("-o a.exr --stats scene.toml --force", 2, &format!("scene.toml {input}"));
}

#[test]
fn force_replaces_and_leaves_nothing_else() {
    let bench = Bench::new();
    for name in ["a.exr", "a.png", "a.cache", "a.json"] {
        bench.write(name, "precious");
    }
    bench.render("--mode paper -o a.exr -o a.png --save-cache a.cache --stats a.json --force");
    bench.render("--mode paper -o b.EXR -o b.Png --save-cache b.cache");
    assert!(bench.picture("a.exr").channels().count() > 20);
    for (a, b) in [("a.exr", "b.EXR"), ("a.png", "b.Png"), ("a.cache", "b.cache")] {
        assert!(bench.read(a) == bench.read(b), "{a}");
    }
    assert!(bench.read("a.png").starts_with(b"\x89PNG\r\n\x1a\n"));
    assert_eq!(bench.json("a.json")["program"], "render-cached");
    let names: Vec<_> = bench.files().into_keys().collect();
    let all = "a.cache a.exr a.json a.photons a.png b.EXR b.Png b.cache scene.toml";
    assert_eq!(names.join(" "), all);
}

#[test]
fn a_full_device_is_told() {
    let bench = Bench::new();
    let full = "No space left on device (os error 28)";
    for name in ["full.exr", "full.png"] {
        symlink("/dev/full", bench.path(name)).unwrap();
        bench.refuses(
            &format!("{SMALL} -o {name} --force"),
            1,
            &format!("cannot write {name}: {full}"),
        );
    }
    bench.refuses(
        &format!("{SMALL} --mode paper --save-cache /dev/full --force"),
        1,
        &format!("cannot write /dev/full: {full}"),
    );
    bench.refuses(
        &format!("{SMALL} -o full.exr"),
        1,
        "full.exr exists; give another name or --force to replace it",
    );
    bench
        .command(&format!("{SMALL} -q -o a.exr --stats /dev/full --force"))
        .assert()
        .code(1)
        .stderr(format!("render-cached: cannot write /dev/full: {full}\n"));
}

#[test]
fn a_full_disk_keeps_what_it_holds() {
    let bench = Bench::new();
    fs::create_dir(bench.path("disk")).unwrap();
    let Some(_disk) = SmallDisk::mount(bench.path("disk")) else { return };
    for name in ["disk/a.exr", "disk/a.png", "disk/a.cache"] {
        bench.write(name, "precious");
    }
    bench.write("disk/almost-all", [0; 48 << 10]);
    let large = "scene.toml --photons a.photons --resolution 200x200 --shadow-rays 1 --gather 5 --mode paper --force -q";
    for args in ["-o disk/a.exr", "-o disk/a.png", "--save-cache disk/a.cache"] {
        let name = args.split_once(' ').unwrap().1;
        let message =
            format!("render-cached: cannot write {name}: No space left on device (os error 28)\n");
        bench.command(&format!("{large} {args}")).assert().code(1).stdout("").stderr(message);
        assert_eq!(bench.read(name), b"precious");
        assert_eq!(fs::read_dir(bench.path("disk")).unwrap().count(), 4, "{args}");
    }
}

/// A file system of 64 kB, if this user may mount one.
struct SmallDisk(PathBuf);

impl SmallDisk {
    #[expect(clippy::print_stderr, reason = "who reads the log should know what was not tested")]
    fn mount(at: PathBuf) -> Option<Self> {
        let output = Command::new("mount")
            .args(["-t", "tmpfs", "-o", "size=64k", "tmpfs"])
            .arg(&at)
            .output();
        let mounted = output.is_ok_and(|output| output.status.success());
        if !mounted {
            eprintln!("no small disk could be mounted: full disks were not tested");
        }
        mounted.then_some(Self(at))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}
