//! Size: pictures, meshes and photons near what a machine of 24 GB can hold, and what was predicted for them.

use std::fs::File;
use std::io::{BufWriter, Write};

use anyhow::{Context, ensure};
use serde_json::Value;

use super::{Bench, remove};

/// A run that must end well; answers with its statistics.
fn run(bench: &Bench, program: &str, args: &str) -> anyhow::Result<Value> {
    bench.sound(program, &format!("{args} -q --force --stats scale.json"))?;
    Ok(serde_json::from_slice(&bench.read("scale.json")?)?)
}

fn number(stats: &Value, path: &str) -> anyhow::Result<f64> {
    stats.pointer(path).and_then(Value::as_f64).with_context(|| format!("{path} isn't told"))
}

/// What a run took, in words. It must not have held more than was predicted.
fn account(stats: &Value) -> anyhow::Result<String> {
    let [peak, predicted] = ["/peak_rss_bytes", "/predicted_rss_bytes"].map(|p| number(stats, p));
    let (peak, predicted) = (peak? / 1e9, predicted? / 1e9);
    ensure!(peak <= predicted, "{peak:.2} GB were held, and {predicted:.2} predicted");
    let seconds = number(stats, "/cpu_seconds/total")?;
    Ok(format!("{peak:.2} GB of {predicted:.2} predicted, {seconds:.0} CPU s"))
}

/// Pictures of 67 million pixels. The original traces little for a pixel: memory doesn't depend on it. Mode adaptive has its
/// usual rays, or it sees that no cache pays, and is the original.
pub(super) fn large_pictures(bench: &Bench) -> anyhow::Result<String> {
    let mut told = Vec::new();
    for (mode, rays) in [("original", "--shadow-rays 1 --gather 10"), ("adaptive", "")] {
        let args = format!(
            "SCENE --photons a.photons {rays} --resolution 8192x8192 --mode {mode} --checkpoint 0 \
             -o scale.exr"
        );
        let stats = run(bench, "render-cached", &args)?;
        told.push(format!("{mode} {}", account(&stats)?));
        remove(bench, &["scale.exr"]);
    }
    Ok(told.join("; "))
}

/// A field of hills, 5,000 cells by 5,000, two triangles each, and a picture of it.
pub(super) fn large_mesh(bench: &Bench) -> anyhow::Result<String> {
    const SIDE: u32 = 5000;
    const SCENE: &str = r#"
camera = { origin = [50, 30, 120], target = [50, 0, 40], fov = 45 }

[materials.ground]
type = "diffuse"
albedo = [0.6, 0.5, 0.4]

[[meshes]]
file = "scale.ply"
material = "ground"

[[lights]]
type = "point"
position = [50, 60, 50]
intensity = 5000
"#;
    hills(bench, SIDE).context("cannot write the mesh")?;
    std::fs::write(bench.path("scale.toml"), SCENE).context("cannot write the scene")?;
    let built = run(bench, "photon-build", "scale.toml -o scale.photons --photons 100K")?;
    let args =
        "scale.toml --photons scale.photons --resolution 512x512 --mode adaptive -o scale.exr";
    let rendered = run(bench, "render-cached", args)?;
    remove(bench, &["scale.ply", "scale.toml", "scale.photons", "scale.exr"]);
    Ok(format!(
        "{} M triangles: photons {}; a picture of 512x512 {}",
        2 * SIDE * SIDE / 1_000_000,
        account(&built)?,
        account(&rendered)?
    ))
}

/// Writes a height field over a square of side 100, as binary PLY.
fn hills(bench: &Bench, side: u32) -> anyhow::Result<()> {
    let mut out = BufWriter::new(File::create(bench.path("scale.ply"))?);
    let row = side + 1;
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        row * row,
        2 * side * side
    )?;
    for i in 0..row * row {
        let [x, z] = [i % row, i / row].map(|n| 100.0 * f64::from(n) / f64::from(side));
        let y = 2.0 * (0.4 * x).sin() * (0.3 * z).cos() + 0.05 * (7.0 * x).sin() * (9.0 * z).sin();
        [x, y, z].iter().try_for_each(|v| out.write_all(&(*v as f32).to_le_bytes()))?;
    }
    for i in 0..side * side {
        let first = i / side * row + i % side;
        for corners in [[first, first + row, first + 1], [first + 1, first + row, first + row + 1]]
        {
            out.write_all(&[3])?;
            corners.iter().try_for_each(|corner| out.write_all(&corner.to_le_bytes()))?;
        }
    }
    Ok(out.flush()?)
}

/// CPU time of a photon where 100 million are stored, beside that where one million is: just before, and just after.
pub(super) fn time_per_photon(bench: &Bench) -> anyhow::Result<String> {
    let build = |emitted: &str| -> anyhow::Result<(f64, Value)> {
        let args = format!("SCENE -o scale.photons --photons {emitted} --checkpoint 0");
        let stats = run(bench, "photon-build", &args)?;
        let per_photon = number(&stats, "/cpu_seconds/total")? / number(&stats, "/emitted")?;
        Ok((per_photon * 1e6, stats))
    };
    let (before, _) = build("1500K")?;
    let (many, stats) = build("150M")?;
    let (after, _) = build("1500K")?;
    remove(bench, &["scale.photons"]);
    let stored = stats["stored"].as_object().context("no photons are told")?;
    let n: u64 = stored.values().filter_map(Value::as_u64).sum();
    ensure!(n >= 100_000_000, "only {n} photons were stored");
    let times = 2.0 * many / (before + after);
    ensure!(times <= 1.6, "a photon takes {times:.2} times as long where {n} are stored");
    Ok(format!(
        "{:.0} M stored: {many:.2} \u{b5}s for each that is emitted, and {before:.2} and {after:.2} where 1 M are ({times:.2} \
         times); {}",
        n as f64 / 1e6,
        account(&stats)?
    ))
}
