//! `cargo xtask demo`: the whole pipeline on the Cornell box, and what the cache saves.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;
use base::Component;
use film::{Difference, Existing, FlipStats};

use crate::bench::plan::EXPOSURE;
use crate::programs::{self, Call, Programs, root};
use crate::stats::{self, BuildStats, RenderSeconds, RenderStats};
use crate::table::Table;

/// Render the Cornell box in full and with the cache, and show what that costs
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Side of the square pictures, in pixels
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = clap::value_parser!(u32).range(8..=16384))]
    size: u32,
    /// Photons to emit, such as 1M or 50K
    #[arg(long, value_name = "COUNT", default_value = "1M", value_parser = programs::parse_count_text)]
    photons: String,
}

const SCENE: &str = "scenes/cornell-box/scene.toml";
const FOLDER: &str = "target/demo";

/// A picture that was rendered.
struct Rendered {
    mode: String,
    picture: PathBuf,
    stats: RenderStats,
}

/// Builds the programs, runs them, and prints a table.
///
/// # Errors
/// When a program can't be built or fails, or its picture can't be read.
#[expect(clippy::print_stdout, reason = "the table is the command's result")]
#[expect(clippy::print_stderr, reason = "a user wants to see what is run")]
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let programs = programs::build()?;
    let folder = Path::new(FOLDER);
    fs::create_dir_all(root().join(folder)).with_context(|| format!("cannot make {FOLDER}"))?;
    let go = |call: &Call| {
        eprintln!("$ {call}");
        call.run()
    };

    let maps = folder.join("cornell-box.photons");
    go(&photon_build(&programs, args, &maps))?;
    let pass_1: BuildStats = stats::read(&root().join(maps.with_extension("photons.json")))?;

    let mut pictures = Vec::new();
    for mode in programs.modes()? {
        let picture = folder.join(&mode).with_extension("exr");
        go(&render_cached(&programs, args, &maps, &mode, &picture))?;
        let stats = stats::read(&root().join(picture.with_extension("json")))?;
        pictures.push(Rendered { mode, picture, stats });
    }

    let reference = film::read_rgb(&root().join(&pictures[0].picture), "")?;
    let mut differences = vec![None];
    for rendered in &pictures[1..] {
        let picture = film::read_rgb(&root().join(&rendered.picture), "")?;
        let (difference, map) = film::compare(&picture, &reference, EXPOSURE)?;
        let path = difference_path(&rendered.picture);
        film::write_png(&root().join(path), Existing::Replace, &film::flip_picture(&map), 0.0)?;
        differences.push(Some(difference));
    }

    println!("\n{}", times(args.size, &pass_1, &pictures));
    println!("{}", origins(&pictures));
    println!("{}", quality(&pictures, &differences));
    for rendered in &pictures {
        let picture = rendered.picture.display();
        println!("{:>9}: {picture}, {}", rendered.mode, png(&rendered.picture).display());
        if rendered.mode != "original" {
            println!(
                "{:>9}  {} shows the difference",
                "",
                difference_path(&rendered.picture).display()
            );
        }
    }
    Ok(())
}

fn photon_build(programs: &Programs, args: &Args, maps: &Path) -> Call {
    Call::new(&programs.photon_build)
        .args([SCENE, "--photons", &args.photons, "--force", "-q", "-o"])
        .args([maps])
        .args(["--stats"])
        .args([maps.with_extension("photons.json")])
}

fn render_cached(
    programs: &Programs,
    args: &Args,
    maps: &Path,
    mode: &str,
    picture: &Path,
) -> Call {
    let resolution = format!("{0}x{0}", args.size);
    Call::new(&programs.render_cached)
        .args([SCENE, "--photons"])
        .args([maps])
        .args([
            "--mode",
            mode,
            "--resolution",
            &resolution,
            "--exposure",
            &EXPOSURE.to_string(),
            "--force",
            "-q",
            "-o",
        ])
        .args([picture])
        .args(["-o"])
        .args([png(picture)])
        .args(["--stats"])
        .args([picture.with_extension("json")])
}

fn png(picture: &Path) -> PathBuf {
    picture.with_extension("png")
}

fn difference_path(picture: &Path) -> PathBuf {
    picture.with_extension("difference.png")
}

fn header(pictures: &[Rendered]) -> impl Iterator<Item = String> {
    std::iter::once(String::new()).chain(pictures.iter().map(|r| r.mode.clone()))
}

/// CPU seconds by component, and what is saved.
fn times(size: u32, pass_1: &BuildStats, pictures: &[Rendered]) -> Table {
    let stored = pass_1.stored;
    let caption = format!(
        "CPU seconds, {size}x{size}; {} photons emitted, {} caustic and {} indirect stored",
        pass_1.emitted, stored.caustic, stored.indirect
    );
    let mut table = Table::new(caption, header(pictures));
    let mut row = |name: &str, f: &dyn Fn(&RenderSeconds) -> f64| {
        table.push(name, pictures.iter().map(|r| format!("{:.2}", f(&r.stats.cpu_seconds))));
    };
    for component in Component::ALL {
        row(component.name(), &|s| s.of(component));
    }
    row("cache", &|s| s.cache);
    row("eye rays", &|s| s.primary);
    row("load, write", &RenderSeconds::rest);
    row("pass 1", &|_| pass_1.cpu_seconds.total);
    row("total", &|s| s.total + pass_1.cpu_seconds.total);
    let original = pictures[0].stats.cpu_seconds.pass_2();
    table.push(
        "saved of pass 2",
        pictures
            .iter()
            .map(|r| format!("{:.1} %", (1.0 - r.stats.cpu_seconds.pass_2() / original) * 100.0)),
    );
    let wall = |r: &Rendered| format!("{:.2}", r.stats.seconds.total + pass_1.seconds.total);
    table.push("total on the wall", pictures.iter().map(wall));
    table
}

/// Shares of the pixels.
fn origins(pictures: &[Rendered]) -> Table {
    let caption = "Pixels traced, and interpolated from the cache";
    let mut table = Table::new(caption, header(pictures));
    for component in Component::ALL {
        let share = |r: &Rendered| {
            let [width, height] = r.stats.resolution.map(f64::from);
            let percent = |n: u64| n as f64 / (width * height) * 100.0;
            let (traced, interpolated) =
                (percent(r.stats.traced[component]), percent(r.stats.interpolated[component]));
            format!("{traced:.1} % + {interpolated:.1} %")
        };
        table.push(component.name(), pictures.iter().map(share));
    }
    table
}

/// How far the pictures are from the original.
fn quality(pictures: &[Rendered], differences: &[Option<Difference>]) -> Table {
    let mut table = Table::new("Difference from the original, in FLIP", header(pictures));
    let mut row = |name: &str, f: &dyn Fn(&FlipStats) -> String| {
        let cell = |d: &Option<Difference>| d.as_ref().map_or_else(String::new, |d| f(&d.flip));
        table.push(name, differences.iter().map(cell));
    };
    row("mean", &|flip| format!("{:.4}", flip.mean));
    row("99th percentile", &|flip| format!("{:.4}", flip.p99));
    row("worst 8x8 block", &|flip| format!("{:.4}", flip.worst_block_8x8));
    row("pixels above 0.1", &|flip| format!("{:.3} %", flip.share_above_0_1 * 100.0));
    table
}
