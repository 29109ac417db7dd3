//! Where maps and accounts may go, and what happens when they can't.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::PathBuf;
use std::process::Command;

use assert_cmd::assert::OutputAssertExt;

use crate::bench::Bench;

#[test]
fn outputs_that_cannot_be_meant_are_refused() {
    let bench = Bench::new();
    bench.write("old.photons", "precious");
    fs::create_dir(bench.path("out")).unwrap();
    symlink("scene.toml", bench.path("link.toml")).unwrap();
    let refuses = |args: &str, code: i32, message: &str| {
        bench.refuses(&format!("scene.toml --photons 1K {args}"), code, message);
    };
    let exists = "old.photons exists; give another name or --force to replace it";
    refuses("-o old.photons", 1, exists);
    refuses("-o a.photons --stats old.photons", 1, exists);
    refuses("-o out", 1, "cannot write out: it is a folder; add the name of a file");
    refuses(
        "-o none/a.photons",
        1,
        "cannot write none/a.photons: there is no folder none; create it or give another name",
    );
    refuses(
        "-o old.photons/a --force",
        1,
        "cannot write old.photons/a: there is no folder old.photons; create it or give another name",
    );
    refuses(
        "-o a.photons --stats none/a.json",
        1,
        "cannot write none/a.json: there is no folder none; create it or give another name",
    );
    let twice = "is named as an output twice; give each its own name";
    refuses("-o a.photons --stats a.photons", 2, &format!("a.photons {twice}"));
    refuses("-o out/../a --stats a", 2, &format!("out/../a {twice}"));
    for name in ["scene.toml", "./scene.toml", "link.toml"] {
        let message = format!("{name} is an input; give the output another name");
        refuses(&format!("-o {name} --force"), 2, &message);
        refuses(&format!("-o a.photons --stats {name} --force"), 2, &message);
    }
}

#[test]
fn force_replaces_and_leaves_nothing_else() {
    let bench = Bench::new();
    bench.write("old.photons", "precious");
    bench.write("old.json", "precious");
    bench.run("scene.toml --photons 1K -o new.photons");
    bench.run("scene.toml --photons 1K -o old.photons --stats old.json --force");
    assert!(bench.read("old.photons") == bench.read("new.photons"));
    assert_eq!(bench.json("old.json")["emitted"], 1000);
    let names: Vec<_> = bench.files().into_keys().collect();
    assert_eq!(names, ["new.photons", "old.json", "old.photons", "scene.toml"]);
}

#[test]
fn devices_are_written_to() {
    let bench = Bench::new();
    symlink("/dev/full", bench.path("full.photons")).unwrap();
    bench.refuses(
        "scene.toml --photons 1K -o full.photons --force",
        1,
        "cannot write full.photons: No space left on device (os error 28)",
    );
    bench.refuses(
        "scene.toml --photons 1K -o /dev/full",
        1,
        "/dev/full exists; give another name or --force to replace it",
    );
    bench.run("scene.toml --photons 1K -o /dev/null --stats stats.json --force");
    let (out, _) = bench.run("scene.toml --photons 1K -o /dev/null --stats /dev/stdout --force -q");
    let piped: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(piped["file_bytes"], bench.json("stats.json")["file_bytes"]);
}

#[test]
fn a_full_disk_keeps_what_it_holds() {
    let bench = Bench::new();
    fs::create_dir(bench.path("disk")).unwrap();
    let Some(_disk) = SmallDisk::mount(bench.path("disk")) else { return };
    bench.run("scene.toml --photons 100 -o disk/a.photons");
    let before = bench.read("disk/a.photons");
    for name in ["disk/b.photons", "disk/a.photons"] {
        bench
            .command(&format!("scene.toml --photons 50K -q --force -o {name}"))
            .assert()
            .code(1)
            .stdout("")
            .stderr(format!(
                "photon-build: cannot write {name}: No space left on device (os error 28)\n"
            ));
        assert!(bench.read("disk/a.photons") == before, "{name}");
        assert_eq!(fs::read_dir(bench.path("disk")).unwrap().count(), 1, "{name}");
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
