//! Tasks of a farm: lost nodes, parts written twice, clocks that jump, disks that are slow, and their memory.

use std::fs;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use anyhow::{Context, ensure};

use super::{Bench, remove, same, words};

const SHARDS: u32 = 3;
const TILES: u32 = 4;
const MODES: [&str; 2] = ["original", "adaptive"];
const RENDER: &str =
    "SCENE --photons FOLDER/a.photons --shadow-rays 16 --gather 50 --resolution 384x384 -q --force";

/// A task of a farm: a program, its arguments, and what it writes.
struct Task {
    program: &'static str,
    args: String,
    output: String,
}

/// All tasks of a picture in a folder, step by step. What the steps before have written lies in the folder, too.
fn steps(folder: &str, mode: &str) -> Vec<Vec<Task>> {
    let task = |program, args: &str, output: String| Task {
        program,
        args: format!("{args} -o {folder}/{output}").replace("FOLDER", folder),
        output: format!("{folder}/{output}"),
    };
    let shard = |i| {
        let args = format!("SCENE --photons 400K -q --force --shard {i}/{SHARDS}");
        task("photon-build", &args, format!("{i}.shard"))
    };
    let shards: Vec<String> = (1..=SHARDS).map(|i| format!("FOLDER/{i}.shard")).collect();
    let merge = format!("merge {} -q --force", shards.join(" "));
    let adaptive = mode == "adaptive";
    let layers = adaptive.then(|| {
        let mut task = task("render-cached", &format!("{RENDER} --mode {mode}"), "a.layers".into());
        task.args = task.args.replace(" -o ", " --save-layers ");
        vec![task]
    });
    let tile = |i| {
        let from = if adaptive { " --from-layers FOLDER/a.layers" } else { "" };
        let args = format!("{RENDER} --mode {mode}{from} --checkpoint 0 --tile {i}/{TILES}");
        task("render-cached", &args, format!("{i}.exr"))
    };
    let tiles: Vec<String> = (1..=TILES).map(|i| format!("FOLDER/{i}.exr")).collect();
    let assemble = format!("assemble {} -q --force", tiles.join(" "));
    [(1..=SHARDS).map(shard).collect(), vec![task("photon-build", &merge, "a.photons".into())]]
        .into_iter()
        .chain(layers)
        .chain([
            (1..=TILES).map(tile).collect(),
            vec![task("render-cached", &assemble, "picture.exr".into())],
        ])
        .collect()
}

/// Makes the picture of one run, in the same folder since pictures tell where their photons were.
fn whole(bench: &Bench, folder: &str, mode: &str) -> anyhow::Result<()> {
    let path = bench.path(folder);
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).context("cannot make a folder")?;
    bench.sound("photon-build", &format!("SCENE --photons 400K -q -o {folder}/a.photons"))?;
    let render = RENDER.replace("FOLDER", folder);
    bench.sound("render-cached", &format!("{render} --mode {mode} -o {folder}/whole.exr"))?;
    fs::rename(path.join("a.photons"), path.join("whole.photons")).context("cannot rename a file")
}

fn is_that_of_one_run(bench: &Bench, folder: &str) -> anyhow::Result<()> {
    same(bench, &format!("{folder}/a.photons"), &format!("{folder}/whole.photons"))?;
    same(bench, &format!("{folder}/picture.exr"), &format!("{folder}/whole.exr"))
}

/// Whether something is being written in a folder.
fn is_writing(folder: &Path) -> bool {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.file_name()).any(|name| name.to_string_lossy().ends_with(".partial"))
}

fn remove_partial(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().ends_with(".partial") {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Each task runs in a group of processes that is killed while its output is written, is done again, and so on.
pub(super) fn lost_nodes(bench: &Bench) -> anyhow::Result<String> {
    let (mut n_killed, mut n_writing) = (0, 0);
    for mode in MODES {
        whole(bench, "lost", mode)?;
        let folder = bench.path("lost");
        for task in steps("lost", mode).into_iter().flatten() {
            let mut command = bench.command("", task.program, &task.args);
            let mut child = command.process_group(0).spawn().context("cannot run a task")?;
            while !is_writing(&folder) && child.try_wait().context("cannot wait")?.is_none() {
                sleep(Duration::from_micros(200));
            }
            let group = format!("-{}", child.id());
            Command::new("kill")
                .args(["-KILL", "--", &group])
                .stderr(Stdio::null())
                .status()
                .context("cannot kill a group")?;
            let ended = child.wait_with_output().context("cannot wait for a task")?;
            n_killed += u32::from(ended.status.code().is_none());
            n_writing += u32::from(is_writing(&folder));
            // It may have come into its place just before: whole.
            let left = fs::read(bench.path(&task.output)).ok();
            // What a lost node leaves lies there while the task is done again elsewhere.
            bench.sound(task.program, &task.args)?;
            let again = bench.read(&task.output)?;
            ensure!(left.is_none_or(|left| left == again), "{} was half written", task.output);
            remove_partial(&folder);
        }
        is_that_of_one_run(bench, "lost")?;
    }
    ensure!(n_writing > 0, "no task was caught while it was writing");
    Ok(format!(
        "{n_killed} tasks were killed with all their processes, {n_writing} of them while writing, and done again: the bytes \
         of one run in modes original and adaptive"
    ))
}

/// Each task runs twice at once.
pub(super) fn twice(bench: &Bench) -> anyhow::Result<String> {
    let mut n = 0;
    for mode in MODES {
        whole(bench, "twice", mode)?;
        for task in steps("twice", mode).into_iter().flatten() {
            let both = [0, 1].map(|_| bench.start(task.program, &task.args));
            for child in both {
                let output = child?.wait_with_output().context("cannot wait for a task")?;
                ensure!(output.status.success(), "{}: {}", task.output, words(&output));
            }
            n += 1;
        }
        ensure!(!is_writing(&bench.path("twice")), "something half written was left");
        is_that_of_one_run(bench, "twice")?;
    }
    Ok(format!(
        "{n} tasks, each in two processes with one output: all ended well, the bytes are those of one run"
    ))
}

/// Each task starts in another year, the clock of some runs fast, and files were changed in the future or in 1970.
pub(super) fn clocks(bench: &Bench) -> anyhow::Result<String> {
    let has_faketime = Command::new("faketime")
        .args(["2000-01-01", "true"])
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success());
    // The last jumps a day ahead every second.
    let clocks = ["@1971-02-03 04:05:06", "@2100-01-01 00:00:00", "@2026-01-01 00:00:00 x86400"];
    let mut n = 0;
    for mode in MODES {
        whole(bench, "clocks", mode)?;
        for task in steps("clocks", mode).into_iter().flatten() {
            for entry in fs::read_dir(bench.path("clocks")).context("cannot read a folder")? {
                let path = entry.context("cannot read a folder")?.path();
                let year = ["1970-01-02", "2199-12-31", "2026-02-28"][n % 2];
                let touched = Command::new("touch").args(["-d", year]).arg(path).status();
                touched.context("cannot touch a file")?;
            }
            let clock = clocks[n % clocks.len()];
            let limit = match has_faketime {
                true => format!(
                    "export FAKETIME='{clock}' LD_PRELOAD=\"$(ls /usr/lib/*/faketime/libfaketimeMT.so.1)\";"
                ),
                false => String::new(),
            };
            let output = bench.command(&limit, task.program, &task.args).output();
            let output = output.context("cannot run a task")?;
            ensure!(output.status.success(), "{}: {}", task.output, words(&output));
            n += 1;
        }
        is_that_of_one_run(bench, "clocks")?;
    }
    let how = if has_faketime {
        "under clocks of 1971, of 2100 and one that runs 86,400 times too fast (libfaketime)"
    } else {
        "(without other clocks: faketime isn't installed)"
    };
    Ok(format!("{n} tasks {how}, their inputs changed in 1970 or 2199: the bytes of one run"))
}

/// All tasks on a disk that reads and writes a few megabytes a second.
pub(super) fn slow_disk(bench: &Bench) -> anyhow::Result<String> {
    let script = format!(
        "set -e; cd '{}'; truncate -s 200M slow.img; mkfs.ext4 -q -F slow.img; mkdir -p slow; \
         device=$(losetup --find --show slow.img); trap 'umount slow 2>/dev/null; losetup -d $device' ERR; \
         mount $device slow; echo $device; cg=/sys/fs/cgroup/blkio/tetralux-torture; mkdir -p $cg; \
         number=$(lsblk -dno MAJ:MIN $device | tr -d ' '); echo \"$number 4000000\" >$cg/blkio.throttle.read_bps_device; \
         echo \"$number 4000000\" >$cg/blkio.throttle.write_bps_device",
        bench.path("").display()
    );
    let made = Command::new("bash").args(["-c", &script]).stderr(Stdio::null()).output();
    let made = made.context("cannot run bash")?;
    let device = String::from_utf8_lossy(&made.stdout).trim().to_owned();
    if !made.status.success() {
        return Ok(
            "skipped: this user may not mount a disk and limit its speed (cgroups of version 1)"
                .into(),
        );
    }
    let result = on_slow_disk(bench);
    let clean = format!(
        "umount '{}'; losetup -d {device}; rmdir /sys/fs/cgroup/blkio/tetralux-torture",
        bench.path("slow").display()
    );
    Command::new("bash").args(["-c", &clean]).status().context("cannot unmount")?;
    remove(bench, &["slow.img"]);
    result
}

fn on_slow_disk(bench: &Bench) -> anyhow::Result<String> {
    let seconds = |folder: &str, limit: &str| -> anyhow::Result<f64> {
        let start = std::time::Instant::now();
        for task in steps(folder, "original").into_iter().flatten() {
            let output = bench.command(limit, task.program, &task.args).output();
            let output = output.context("cannot run a task")?;
            ensure!(output.status.success(), "{}: {}", task.output, words(&output));
        }
        Ok(start.elapsed().as_secs_f64())
    };
    let in_group = "echo $$ >/sys/fs/cgroup/blkio/tetralux-torture/tasks; sync; echo 1 >/proc/sys/vm/drop_caches;";
    whole(bench, "slow/a", "original")?;
    let usual = seconds("slow/a", "")?;
    let slow = seconds("slow/a", in_group)?;
    is_that_of_one_run(bench, "slow/a")?;
    Ok(format!(
        "at 4 MB/s to read and to write all tasks took {slow:.0} s instead of {usual:.0} s, and made the bytes of one run"
    ))
}

/// Merging takes 37 bytes a photon beside the files, a tile what its pixels take; `ulimit -d` counts all memory of their own.
pub(super) fn memory(bench: &Bench) -> anyhow::Result<String> {
    /// Program, threads, and what a small run takes.
    const BASE: u64 = 200_000_000;
    for i in 1..=4 {
        bench.sound(
            "photon-build",
            &format!("SCENE --photons 6M -q --force --shard {i}/4 -o m{i}.shard"),
        )?;
    }
    let shards = "m1.shard m2.shard m3.shard m4.shard";
    bench
        .sound("photon-build", &format!("merge {shards} -q --force -o m.photons --stats m.json"))?;
    let stats: serde_json::Value = serde_json::from_slice(&bench.read("m.json")?)?;
    let stored = &stats["stored"];
    let n: u64 = ["direct", "caustic", "indirect", "focused"]
        .iter()
        .filter_map(|c| stored[c].as_u64())
        .sum();
    ensure!(n > 1_000_000, "the statistics tell of {n} photons: {stats}");
    let limit = (BASE + 37 * n) / 1024;
    let args = format!("merge {shards} -q --force -t 1 -o limited.photons");
    let output = bench.command(&format!("ulimit -d {limit};"), "photon-build", &args).output();
    let output = output.context("cannot run photon-build")?;
    ensure!(output.status.success(), "{}", words(&output));
    same(bench, "limited.photons", "m.photons")?;
    let files: u64 = (1..=4)
        .map(|i| fs::metadata(bench.path(&format!("m{i}.shard"))).map_or(0, |m| m.len()))
        .sum();
    // A tile of a picture that is 64 times as large as the limit allows.
    let tile = "SCENE --photons m.photons --mode original --shadow-rays 1 --gather 4 --resolution 16384x16384 \
                --tile 100/4096 -q --force -t 1 -o m.exr";
    let pixels = 16384 * 16384 / 4096;
    let tile_limit = (BASE + 380 * pixels * 2) / 1024;
    let output = bench.command(&format!("ulimit -d {tile_limit};"), "render-cached", tile).output();
    let output = output.context("cannot run render-cached")?;
    ensure!(output.status.success(), "{}", words(&output));
    remove(
        bench,
        &["m1.shard", "m2.shard", "m3.shard", "m4.shard", "m.photons", "limited.photons", "m.exr"],
    );
    Ok(format!(
        "{:.1}M photons in {} MB of shards were merged within {} MB, and a tile of 1/4096 of 16384x16384 pixels, which as a \
         whole take 102 GB, was rendered within {} MB",
        n as f64 / 1e6,
        files / 1_000_000,
        limit * 1024 / 1_000_000,
        tile_limit * 1024 / 1_000_000
    ))
}
