//! `cargo xtask validate`: the scenes in XML rendered by Mitsuba 3, too, and how far the pictures are apart.

mod mitsuba;
mod picture;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use base::{Grid, Rgb};
use film::{Difference, Existing};

use crate::bench::environment::Environment;
use crate::programs::{self, Call, Programs, root};
use crate::stats::{self, BuildStats, RenderStats};
use crate::table::Table;
use mitsuba::{Python, Reference};
use picture::{channels, mean, strip};

/// Render the scenes in XML with Mitsuba 3 as well, and compare the pictures
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Folders below scenes/ that hold a scene.xml; all of them by default
    scenes: Vec<String>,
    /// Make a virtual environment of Python in target/validate, and install Mitsuba there
    #[arg(long)]
    install: bool,
    /// A Python that has Mitsuba, instead of that of --install
    #[arg(long, value_name = "FILE")]
    python: Option<PathBuf>,
    /// Variant of Mitsuba: `llvm_ad_rgb` needs LLVM (libllvm19 of Debian), `scalar_rgb` nothing
    #[arg(long, value_name = "NAME", default_value = "llvm_ad_rgb")]
    variant: String,
    /// Side of the square pictures, in pixels
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u32).range(16..=1024))]
    side: u32,
    /// Samples of Mitsuba for each pixel, in passes of 64
    #[arg(long, value_name = "N", default_value_t = 2048, value_parser = clap::value_parser!(u32).range(128..=1 << 20))]
    samples: u32,
    /// Our eye rays for each pixel: the square of this
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=8))]
    supersample: u32,
    /// Photons to emit, such as 4M
    #[arg(long, value_name = "COUNT", default_value = "4M", value_parser = programs::parse_count_text)]
    photons: String,
    /// Keep table and pictures in xtask/runs/NAME
    #[arg(long, value_name = "NAME")]
    record: Option<String>,
}

const FOLDER: &str = "target/validate";

/// Samples of a pass: few enough for the memory that Mitsuba takes, whose passes are wide.
const SAMPLES_OF_PASS: u32 = 64;

/// Our ways to indirect light.
const WAYS: [&str; 2] = ["estimate", "gather"];

/// Builds the programs, renders every scene with both renderers, and writes a page.
///
/// # Errors
/// When Mitsuba isn't there, with what to install; when a program can't be built or fails.
#[expect(clippy::print_stdout, reason = "the table is the command's result")]
#[expect(clippy::print_stderr, reason = "a user wants to see how it goes on")]
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let folder = root().join(FOLDER);
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {FOLDER}"))?;
    let python = Python::find(args.python.as_deref(), &folder, args.install, &args.variant)?;
    let scenes = if args.scenes.is_empty() { all_scenes()? } else { args.scenes.clone() };
    let programs = programs::build()?;
    // Of what was built: the sources may change while Mitsuba renders.
    let commit = Environment::here("cargo xtask validate".into())?.commit;

    let header = [
        "scene, indirect light",
        "mean of Mitsuba",
        "difference of ours",
        "Mitsuba's standard error",
        "relMSE",
        "of it Mitsuba's noise",
        "FLIP",
        "CPU s, Mitsuba",
        "CPU s, ours",
    ];
    let mut table = Table::new("Against Mitsuba 3", header);
    let mut page = String::new();
    let mut version = String::new();
    for scene in &scenes {
        let path = PathBuf::from(format!("scenes/{scene}/scene.xml"));
        ensure!(root().join(&path).is_file(), "there is no {}", path.display());
        eprintln!("{scene}: Mitsuba ...");
        let passes = (args.samples / SAMPLES_OF_PASS / 2 * 2).max(2);
        let samples = args.samples / passes;
        let reference = python.render(&root().join(&path), scene, args.side, passes, samples)?;
        version.clone_from(&reference.version);
        let mut pictures = vec![reference.picture.clone()];
        for way in WAYS {
            eprintln!("{scene}: ours, --indirect {way} ...");
            let (picture, seconds) = ours(&programs, args, scene, &path, way)?;
            let (difference, map) = film::compare(&picture, &reference.picture, 0.0)?;
            table
                .push(format!("{scene}, {way}"), cells(&reference, &picture, &difference, seconds));
            pictures.push(picture);
            pictures.push(film::flip_picture(&map));
        }
        film::write_png(
            &folder.join(scene).with_extension("png"),
            Existing::Replace,
            &strip(&pictures),
            0.0,
        )?;
        page += &format!(
            "\n![{scene}: Mitsuba, and our estimate and gathering, each with its FLIP]({scene}.png)\n"
        );
    }
    let page = format!("{}\n{}{page}", heading(args, &commit, &version), table.to_markdown());
    println!("{page}");
    fs::write(folder.join("README.md"), &page).context("cannot write the page")?;
    if let Some(name) = &args.record {
        let kept = root().join("xtask/runs").join(name);
        fs::create_dir_all(&kept).context("cannot make the folder of the run")?;
        let pictures = scenes.iter().map(|scene| format!("{scene}.png"));
        for file in pictures.chain(["README.md".to_owned()]) {
            fs::copy(folder.join(&file), kept.join(&file))
                .with_context(|| format!("cannot keep {file}"))?;
        }
    }
    Ok(())
}

/// The folders below `scenes/` that hold a scene in XML, by name.
fn all_scenes() -> anyhow::Result<Vec<String>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(root().join("scenes")).context("cannot read scenes")? {
        let entry = entry.context("cannot read scenes")?;
        if entry.path().join("scene.xml").is_file() {
            found.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    found.sort();
    Ok(found)
}

/// Our picture of a scene, and the CPU seconds of photons and picture.
fn ours(
    programs: &Programs,
    args: &Args,
    scene: &str,
    path: &Path,
    way: &str,
) -> anyhow::Result<(Grid<Rgb>, f64)> {
    let file = |ending: &str| format!("{FOLDER}/{scene}-{way}.{ending}");
    let (maps, image) = (file("photons"), file("exr"));
    let (build, render) = (file("photons.json"), file("json"));
    let photons = Call::new(&programs.photon_build).args([path]).args([
        "--photons",
        &args.photons,
        "-o",
        &maps,
        "--stats",
        &build,
        "--force",
        "-q",
    ]);
    let photons = if way == "gather" { photons.args(["--store", "gather"]) } else { photons };
    photons.run()?;
    let resolution = format!("{0}x{0}", args.side);
    let supersample = args.supersample.to_string();
    Call::new(&programs.render_cached)
        .args([path])
        .args(["--photons", &maps, "--mode", "adaptive", "--indirect", way])
        .args(["--resolution", &resolution, "--supersample", &supersample])
        .args(["-o", &image, "--stats", &render, "--force", "-q"])
        .run()?;
    let build: BuildStats = stats::read(&root().join(build))?;
    let render: RenderStats = stats::read(&root().join(render))?;
    let picture = film::read_rgb(&root().join(image), "")?;
    Ok((picture, build.cpu_seconds.total + render.cpu_seconds.total))
}

fn cells(
    reference: &Reference,
    ours: &Grid<Rgb>,
    difference: &Difference,
    seconds: f64,
) -> [String; 8] {
    let (theirs, ours) = (mean(&reference.picture), mean(ours));
    let shares = |values: [f64; 3]| {
        let mut share = theirs.into_iter();
        values.map(|value| value / share.next().unwrap_or(1.0) * 100.0)
    };
    let off = shares([0, 1, 2].map(|c| ours[c] - theirs[c]));
    let error = shares(reference.standard_error);
    [
        channels(theirs, |c| format!("{c:.4}")),
        channels(off, |c| format!("{c:+.2} %")),
        channels(error, |c| format!("{c:.2} %")),
        format!("{:.5}", difference.rel_mse),
        format!("{:.5}", reference.noise),
        format!("{:.4}", difference.flip.mean),
        format!("{:.0}", reference.cpu_seconds),
        format!("{seconds:.1}"),
    ]
}

/// What was done, and what the columns are.
fn heading(args: &Args, commit: &str, version: &str) -> String {
    let Args { side, samples, supersample, photons, variant, .. } = args;
    format!(
        "# Against Mitsuba 3\n\n`cargo xtask validate --side {side} --samples {samples} --supersample {supersample} --photons {photons}` \
         at commit {commit}, with Mitsuba {version} ({variant}).\n\n\
         Mitsuba: integrator `path` without a limit of depth, {samples} samples a pixel, box filter. Ours: `--mode adaptive` with its \
         default `--error`, {n} eye rays a pixel, {photons} photons; indirect light once as an estimate, once gathered, for which the map \
         was made with `--store gather`. Both {side}x{side}.\n\n\
         Means are those of the red, green and blue of all pixels. relMSE is the mean of (ours - Mitsuba's)^2 / (Mitsuba's^2 + 0.01); \
         Mitsuba's noise is a quarter of that between the halves of its samples. FLIP is the mean, at exposure 0. CPU seconds of ours \
         are photons and picture; of Mitsuba, rendering without loading. In the pictures: Mitsuba; ours by estimate, and its FLIP; ours by gathering, \
         and its FLIP.\n",
        n = supersample * supersample
    )
}
