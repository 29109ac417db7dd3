//! Loads: many runs, many lights, long pictures, many threads.

use std::fmt::Write;
use std::fs;

use anyhow::{Context, ensure};

use super::{Bench, RENDER, remove, same, words};

pub(super) fn crowd(bench: &Bench) -> anyhow::Result<String> {
    let args = format!("{RENDER} --resolution 96x96 --mode paper -t 1 --force -o");
    bench.sound("render-cached", &format!("{args} alone.exr"))?;
    let limited = |name: &str| {
        bench.command("ulimit -v 2000000;", "render-cached", &format!("{args} {name}")).spawn()
    };
    let names: Vec<String> = (0..bench.crowd).map(|i| format!("crowd-{i}.exr")).collect();
    let children: Result<Vec<_>, _> = names.iter().map(|name| limited(name)).collect();
    for (name, child) in names.iter().zip(children.context("cannot run render-cached")?) {
        let output = child.wait_with_output().context("cannot wait for a run")?;
        ensure!(output.status.success(), "{name}: {}", words(&output));
        same(bench, name, "alone.exr")?;
        remove(bench, &[name]);
    }
    Ok(format!("all {} ended well with the picture that one makes alone", bench.crowd))
}

pub(super) fn lights(bench: &Bench) -> anyhow::Result<String> {
    let mut scene =
        String::from("camera = { origin = [50, 60, 120], target = [50, 0, 50], fov = 50 }\n");
    for i in 0..1000 {
        let (r, g) = ((i % 10) as f32 * 0.09, (i / 10 % 10) as f32 * 0.09);
        writeln!(scene, "materials.m{i} = {{ type = \"diffuse\", albedo = [{r}, {g}, 0.5] }}")?;
    }
    for i in 0..1000 {
        let (x, z) = ((i % 32) as f32 * 3.2, (i / 32) as f32 * 3.2);
        writeln!(
            scene,
            "[[quads]]\ncorner = [{x}, 0, {z}]\nedges = [[0, 0, 3], [3, 0, 0]]\nmaterial = \"m{i}\""
        )?;
    }
    for i in 0..10_000 {
        let (x, z) = ((i % 100) as f32 + 0.5, (i / 100) as f32 + 0.5);
        writeln!(
            scene,
            "[[lights]]\ntype = \"point\"\nposition = [{x}, 2, {z}]\nintensity = 0.01"
        )?;
    }
    fs::write(bench.path("many.toml"), scene).context("cannot write the scene")?;
    bench.sound("photon-build", "many.toml -o many.photons --photons 100K --force -q")?;
    let mut told = Vec::new();
    for mode in ["original", "paper", "adaptive"] {
        let args = format!(
            "many.toml --photons many.photons --resolution 24x24 --gather 50 --mode {mode} -o many.exr --stats many.json \
             --force -q"
        );
        bench.sound("render-cached", &args)?;
        let stats: serde_json::Value = serde_json::from_slice(&bench.read("many.json")?)?;
        told.push(format!("{mode} {:.1} s", stats["seconds"]["total"].as_f64().unwrap_or(0.0)));
    }
    Ok(format!("rendered at 24x24 in every mode: {}", told.join(", ")))
}

pub(super) fn long_pictures(bench: &Bench) -> anyhow::Result<String> {
    for size in ["1000000x1", "1x1000000"] {
        for mode in ["original", "paper", "adaptive"] {
            let args = format!(
                "SCENE --photons a.photons --shadow-rays 1 --gather 10 --resolution {size} --mode {mode} -o long.exr --force \
                 -q --checkpoint 1"
            );
            bench.sound("render-cached", &args)?;
        }
    }
    remove(bench, &["long.exr"]);
    Ok("rendered in every mode".into())
}

pub(super) fn threads(bench: &Bench) -> anyhow::Result<String> {
    let counts = [1, 2, 3, 16, 64, 256];
    for mode in ["original", "paper", "adaptive"] {
        let args = format!("{RENDER} --resolution 150x150 --mode {mode} --force");
        bench.sound("render-cached", &format!("{args} -t 1 -o one.exr"))?;
        for n in counts {
            bench.sound("render-cached", &format!("{args} -t {n} -o many.exr"))?;
            same(bench, "many.exr", "one.exr")?;
        }
    }
    Ok(format!("{counts:?} threads make the same bytes in every mode"))
}

/// CPU seconds of renders with a checkpoint every second against those without, in pairs.
pub(super) fn checkpoints(bench: &Bench) -> anyhow::Result<String> {
    const PAIRS: usize = 9;
    let seconds = |options: &str| -> anyhow::Result<f64> {
        let args = format!(
            "SCENE --photons a.photons --mode original --resolution 640x640 {options} -q --force -o c.exr --stats c.json"
        );
        bench.sound("render-cached", &args)?;
        let stats: serde_json::Value = serde_json::from_slice(&bench.read("c.json")?)?;
        stats["cpu_seconds"]["total"].as_f64().context("no CPU seconds are told")
    };
    let mut ratios = Vec::new();
    for i in 0..PAIRS {
        // Each goes first in turn: the machine may get slower.
        let (with, without) = if i % 2 == 0 {
            let with = seconds("--checkpoint 1")?;
            (with, seconds("--checkpoint 0")?)
        } else {
            let without = seconds("--checkpoint 0")?;
            (seconds("--checkpoint 1")?, without)
        };
        ratios.push(with / without);
    }
    ratios.sort_by(f64::total_cmp);
    let percent = |ratio: f64| 100.0 * (ratio - 1.0);
    let median = percent(ratios[PAIRS / 2]);
    ensure!(median < 2.0, "they cost {median:.1} % of the CPU seconds");
    Ok(format!(
        "one a second: {median:+.1} % CPU seconds, the median of {PAIRS} pairs ({:+.1} to {:+.1} %)",
        percent(ratios[0]),
        percent(ratios[PAIRS - 1])
    ))
}

/// Shards one after the other, merged, then opened and rendered under the limit.
pub(super) fn hundred_million(bench: &Bench) -> anyhow::Result<String> {
    const SHARDS: u32 = 16;
    let mut names = Vec::new();
    for i in 1..=SHARDS {
        let name = format!("h{i}.shard");
        let args = format!(
            "SCENE --photons 160M -q --force --checkpoint 0 --shard {i}/{SHARDS} -o {name}"
        );
        bench.sound("photon-build", &args)?;
        names.push(name);
    }
    let merge = format!("merge {} -q --force -o h.photons --stats h.json", names.join(" "));
    bench.sound("photon-build", &merge)?;
    remove(bench, &names.iter().map(String::as_str).collect::<Vec<_>>());
    let stats: serde_json::Value = serde_json::from_slice(&bench.read("h.json")?)?;
    let stored = stats["stored"].as_object().context("no photons are told")?;
    let n: u64 = stored.values().filter_map(serde_json::Value::as_u64).sum();
    ensure!(n >= 100_000_000, "only {n} photons were stored");
    let mut told = Vec::new();
    for mode in ["original", "paper", "adaptive"] {
        let args = format!(
            "SCENE --photons h.photons --resolution 128x128 --mode {mode} -t 2 -q --force -o h.exr --stats h.json"
        );
        let output = bench.command("ulimit -v 4000000;", "render-cached", &args).output();
        let output = output.context("cannot run render-cached")?;
        ensure!(output.status.success(), "{}", words(&output));
        let stats: serde_json::Value = serde_json::from_slice(&bench.read("h.json")?)?;
        told.push(format!("{mode} {:.1} s", stats["seconds"]["total"].as_f64().unwrap_or(0.0)));
    }
    let bytes = fs::metadata(bench.path("h.photons")).context("the maps are gone")?.len();
    remove(bench, &["h.photons", "h.exr"]);
    Ok(format!(
        "{:.0}M photons in {:.1} GB, rendered at 128x128: {}",
        n as f64 / 1e6,
        bytes as f64 / 1e9,
        told.join(", ")
    ))
}
