//! Faults: kills, interrupts, disks and files that change under a run.

use std::fs::{self, OpenOptions};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};

use super::{Bench, Dice, RENDER, remove, same, words};

const MODES: [&str; 3] = ["original", "paper", "adaptive"];

/// Each program and mode in turn is killed, goes on, is killed, until it ends by itself.
pub(super) fn kills(bench: &Bench) -> anyhow::Result<String> {
    let mut jobs = vec![("photon-build", "SCENE --photons 1M -q".to_owned(), "photons")];
    jobs.extend(MODES.map(|mode| {
        ("render-cached", format!("{RENDER} --resolution 256x256 --mode {mode}"), "exr")
    }));
    let mut dice = Dice(1);
    let (mut n_killed, mut n_whole) = (0, 0);
    while n_killed < bench.kills {
        for (program, args, ending) in &jobs {
            let (whole, name) = (format!("whole.{ending}"), format!("killed.{ending}"));
            remove(bench, &[&whole, &name]);
            let start = Instant::now();
            bench.sound(program, &format!("{args} -o {whole}"))?;
            let most = start.elapsed().as_millis() as u64;
            let resumed = format!("{args} -o {name} --resume --checkpoint 0.001");
            for _ in 0..8 {
                let mut child = bench.start(program, &resumed)?;
                sleep(Duration::from_millis(dice.throw(most)));
                child.kill().context("cannot kill a run")?;
                let ended = child.wait_with_output().context("cannot wait for a run")?;
                n_killed += u32::from(ended.status.code().is_none());
                if bench.path(&name).exists() {
                    break;
                }
            }
            bench.sound(program, &format!("{resumed} --force"))?;
            same(bench, &name, &whole)?;
            let journal = format!("{name}.journal");
            ensure!(!bench.path(&journal).exists(), "{journal} was left behind");
            n_whole += 1;
        }
    }
    // What was being written when a run was killed has a name of its own, and nobody to remove it.
    for entry in fs::read_dir(bench.path("")).context("cannot read the folder")?.flatten() {
        if entry.file_name().to_string_lossy().ends_with(".partial") {
            fs::remove_file(entry.path()).context("cannot remove a file")?;
        }
    }
    Ok(format!(
        "killed {n_killed} times; all {n_whole} results are those of unbroken runs, byte for byte"
    ))
}

pub(super) fn interrupts(bench: &Bench) -> anyhow::Result<String> {
    let mut dice = Dice(2);
    let mut longest = Duration::ZERO;
    let mut n_interrupted = 0;
    remove(bench, &["old.exr.journal"]);
    fs::write(bench.path("old.exr"), "precious").context("cannot write a file")?;
    for i in 0..15 {
        let args = format!(
            "{RENDER} --resolution 1500x1500 --mode {} -o old.exr --force --checkpoint 0",
            MODES[i % 3]
        );
        let child = bench.start("render-cached", &args)?;
        sleep(Duration::from_millis(100 + dice.throw(4000)));
        let start = Instant::now();
        let id = child.id().to_string();
        Command::new("kill").args(["-s", "INT", &id]).status().context("cannot send a signal")?;
        let output = child.wait_with_output().context("cannot wait for a run")?;
        if output.status.success() {
            fs::write(bench.path("old.exr"), "precious").context("cannot write a file")?;
            continue;
        }
        longest = longest.max(start.elapsed());
        n_interrupted += 1;
        ensure!(output.status.code() == Some(130), "{}", words(&output));
        ensure!(bench.read("old.exr")? == b"precious", "the picture that was there is gone");
        bench.nothing_partial()?;
    }
    ensure!(longest < Duration::from_secs(3), "one took {longest:?}");
    Ok(format!(
        "{n_interrupted} runs ended with 130, the slowest after {:.2} s; nothing was left behind",
        longest.as_secs_f64()
    ))
}

pub(super) fn shortened(bench: &Bench) -> anyhow::Result<String> {
    let mut dice = Dice(3);
    let mut n_told = 0;
    for i in 0..12 {
        fs::copy(bench.path("a.photons"), bench.path("b.photons")).context("cannot copy maps")?;
        remove(bench, &["b.exr"]);
        let args = format!(
            "{RENDER} --resolution 512x512 --mode {} -o b.exr --checkpoint 0",
            MODES[i % 3]
        );
        let child = bench.start("render-cached", &args.replace("a.photons", "b.photons"))?;
        sleep(Duration::from_millis(dice.throw(800)));
        let file = OpenOptions::new().write(true).open(bench.path("b.photons"));
        file.and_then(|file| file.set_len(dice.throw(100_000))).context("cannot shorten maps")?;
        let output = child.wait_with_output().context("cannot wait for a run")?;
        let is_whole = output.status.success();
        ensure!(is_whole || output.status.code() == Some(1), "{}", words(&output));
        ensure!(is_whole == bench.path("b.exr").exists(), "{}", words(&output));
        n_told += usize::from(!is_whole);
    }
    Ok(format!(
        "12 runs: {n_told} ended with 1 and named the file, the others were done before; no wrong picture"
    ))
}

pub(super) fn full_disk(bench: &Bench) -> anyhow::Result<String> {
    let disk = bench.path("disk");
    fs::create_dir_all(&disk).context("cannot make a folder")?;
    let mount = Command::new("mount")
        .args(["-t", "tmpfs", "-o", "size=300k", "tmpfs"])
        .arg(&disk)
        .stderr(Stdio::null())
        .status();
    if !mount.is_ok_and(|status| status.success()) {
        return Ok("skipped: this user may not mount a small disk".into());
    }
    let result = on_full_disk(bench);
    Command::new("umount").arg(&disk).status().context("cannot unmount")?;
    result
}

fn on_full_disk(bench: &Bench) -> anyhow::Result<String> {
    fs::write(bench.path("disk/a.exr"), "precious").context("cannot write a file")?;
    let args = format!("{RENDER} --resolution 256x256 --mode original -o disk/a.exr --force");
    let output = bench.output("render-cached", &format!("{args} --checkpoint 0.001"))?;
    ensure!(output.status.code() == Some(1), "{}", words(&output));
    ensure!(bench.read("disk/a.exr")? == b"precious", "the picture that was there is gone");
    let said = words(&output);
    Command::new("mount")
        .args(["-o", "remount,size=64m"])
        .arg(bench.path("disk"))
        .status()
        .context("cannot make the disk larger")?;
    bench.sound("render-cached", &format!("{args} --resume"))?;
    bench.sound("render-cached", &args.replace("disk/a.exr", "roomy.exr"))?;
    let same_bytes = bench.read("disk/a.exr")? == bench.read("roomy.exr")?;
    ensure!(same_bytes, "what was resumed is another picture");
    Ok(format!("\"{said}\"; the old picture stayed, and with more room --resume made the new one"))
}

pub(super) fn two_writers(bench: &Bench) -> anyhow::Result<String> {
    let args = format!("{RENDER} --resolution 200x200 --mode paper --force -o");
    bench.sound("render-cached", &format!("{args} one.exr"))?;
    for _ in 0..5 {
        let both = [0, 1]
            .map(|_| bench.start("render-cached", &format!("{args} both.exr --checkpoint 0.001")));
        for child in both {
            let output = child?.wait_with_output().context("cannot wait for a run")?;
            ensure!(output.status.success(), "{}", words(&output));
        }
        same(bench, "both.exr", "one.exr")?;
    }
    Ok("5 pairs: both ended well each time, and the picture is whole".into())
}

pub(super) fn replaced(bench: &Bench) -> anyhow::Result<String> {
    let args =
        format!("{RENDER} --resolution 200x200 --mode original --force --checkpoint 0 -o r.exr");
    bench.sound("render-cached", &args.replace("r.exr", "before.exr"))?;
    let mut n = 0;
    for i in 0..6 {
        let child = bench.start("render-cached", &args)?;
        sleep(Duration::from_millis(30 * i));
        bench.sound("photon-build", "SCENE -o a.photons --photons 200K -q --force")?;
        let output = child.wait_with_output().context("cannot wait for a run")?;
        ensure!(output.status.success(), "{}", words(&output));
        same(bench, "r.exr", "before.exr")?;
        n += 1;
    }
    Ok(format!("{n} runs were the same as without, byte for byte"))
}

pub(super) fn slow_and_closed(bench: &Bench) -> anyhow::Result<String> {
    let args = format!("{RENDER} --resolution 64x64 --mode paper --force");
    bench.sound("render-cached", &format!("{args} -o file.png"))?;
    let pipe = bench.path("pipe.png");
    remove(bench, &["pipe.png"]);
    Command::new("mkfifo").arg(&pipe).status().context("cannot make a pipe")?;
    let child =
        bench.command("exec 2>&-;", "render-cached", &format!("{args} -o pipe.png")).spawn();
    let child = child.context("cannot run render-cached")?;
    let slowly = format!(
        "while dd bs=512 count=1 status=none >>got.png && [ $(stat -c %s got.png) -gt ${{n:--1}} ]; do \
         n=$(stat -c %s got.png); sleep 0.02; done <'{}'",
        pipe.display()
    );
    remove(bench, &["got.png"]);
    let reader = Command::new("bash").arg("-c").arg(slowly).current_dir(bench.path("")).status();
    reader.context("cannot read the pipe")?;
    let output = child.wait_with_output().context("cannot wait for a run")?;
    ensure!(output.status.success(), "{}", words(&output));
    same(bench, "got.png", "file.png")?;
    Ok("the picture came through the pipe as it is in a file".into())
}
