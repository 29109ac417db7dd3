//! What is to be run.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};

use crate::bench::Args;
use crate::bench::settings::Settings;
use crate::programs::{Call, Programs, from_root, root};

/// Exposure of the pictures in the report, in stops: mode adaptive aims at an error of what is shown, so FLIP is that of the
/// same. The Cornell box is dim at its published emission.
pub(crate) const EXPOSURE: f32 = 1.0;

/// The scenes of the paper.
const SCENES: [&str; 2] = ["cornell-box", "rabbit"];
/// The picture sizes of the paper, and those of `--quick`.
const SIZES: [u32; 4] = [128, 256, 512, 1024];
const QUICK_SIZES: [u32; 3] = [128, 256, 512];
/// Measured runs of everything, and of `--quick`.
const RUNS: u32 = 5;
const QUICK_RUNS: u32 = 3;

/// What is run, and with which options. All paths start at the folder of the workspace.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub(crate) programs: Programs,
    pub(crate) scenes: Vec<SceneFile>,
    /// In ascending order.
    pub(crate) sizes: Vec<u32>,
    /// `original` first.
    pub(crate) modes: Vec<String>,
    /// Measured runs of each, besides the warm-up.
    pub(crate) runs: u32,
    pub(crate) settings: Settings,
    pub(crate) out: PathBuf,
}

/// A scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SceneFile {
    /// Name of its folder.
    pub(crate) name: String,
    pub(crate) path: PathBuf,
}

impl Plan {
    /// What the options ask for.
    ///
    /// # Errors
    /// When a scene or mode isn't there.
    pub(crate) fn new(args: &Args, programs: Programs) -> anyhow::Result<Self> {
        let known = programs.modes()?;
        let unknown = args.mode.iter().find(|mode| !known.contains(mode));
        if let Some(mode) = unknown {
            bail!("render-cached has no mode {mode}; choose from {}", known.join(", "));
        }
        // The original is what the others are held against, so it always runs.
        let is_wanted =
            |mode: &String| mode == "original" || args.mode.is_empty() || args.mode.contains(mode);
        let modes = known.into_iter().filter(is_wanted).collect();

        let names: Vec<String> = match args.scene.as_slice() {
            [] => SCENES.map(Into::into).into(),
            [all] if all == "all" => all_scenes()?,
            chosen => chosen.to_vec(),
        };
        let mut scenes: Vec<SceneFile> = Vec::new();
        for name in names {
            let scene = scene(&name)?;
            if let Some(other) = scenes.iter().find(|s| s.name == scene.name) {
                bail!(
                    "{} and {} are both called {}; name each scene once",
                    other.path.display(),
                    scene.path.display(),
                    scene.name
                );
            }
            scenes.push(scene);
        }

        let mut sizes = match args.size.as_slice() {
            [] if args.quick => QUICK_SIZES.into(),
            [] => SIZES.into(),
            chosen => chosen.to_vec(),
        };
        sizes.sort_unstable();
        sizes.dedup();
        let runs = args.runs.unwrap_or(if args.quick { QUICK_RUNS } else { RUNS });
        let usual = || root().join(format!("target/bench{}", args.settings.suffix()));
        let out = from_root(&std::path::absolute(args.out.clone().unwrap_or_else(usual))?);
        Ok(Self { programs, scenes, sizes, modes, runs, settings: args.settings.clone(), out })
    }

    /// The photon map from which all pictures of a scene are made.
    pub(crate) fn maps(&self, scene: &str) -> PathBuf {
        self.out.join(scene).join("maps.photons")
    }

    /// The picture of a size and mode: an EXR file, with a PNG file of the same name beside it.
    pub(crate) fn picture(&self, scene: &str, size: u32, mode: &str) -> PathBuf {
        self.out.join(scene).join(format!("{size:04}-{mode}.exr"))
    }

    /// The run of `photon-build` in a round, what it writes, and its account. The first round leaves the maps that all
    /// pictures are made from; the others must make the same.
    pub(crate) fn build(&self, scene: &SceneFile, round: u32) -> (Call, PathBuf, PathBuf) {
        let maps = self.maps(&scene.name);
        let output = if round == 0 { maps } else { maps.with_file_name("maps-again.photons") };
        let stats = output.with_extension("json");
        let call = Call::new(&self.programs.photon_build)
            .args([&scene.path])
            .args(["--photons-per-light", &self.settings.photons, "-o"])
            .args([&output])
            .args(["--stats"])
            .args([&stats])
            .args(["--force", "-q"]);
        (call, output, stats)
    }

    /// The run of `render-cached` in a round, the PNG file it writes, and its account. The first round writes an EXR file
    /// as well, which the others leave out: ten times the work of a PNG file, and the same in all modes.
    pub(crate) fn render(
        &self,
        scene: &SceneFile,
        size: u32,
        mode: &str,
        round: u32,
    ) -> (Call, PathBuf, PathBuf) {
        let picture = self.picture(&scene.name, size, mode);
        let (png, stats) = (picture.with_extension("png"), picture.with_extension("json"));
        let mut call = Call::new(&self.programs.render_cached)
            .args([&scene.path])
            .args(["--photons"])
            .args([self.maps(&scene.name)])
            .args(["--mode", mode, "--resolution", &format!("{size}x{size}")])
            .args(self.settings.render_args())
            .args(["--exposure", &EXPOSURE.to_string(), "-o"])
            .args([&png]);
        if round == 0 {
            call = call.args(["-o"]).args([&picture]);
        }
        let call = call.args(["--stats"]).args([&stats]).args(["--force", "-q"]);
        (call, png, stats)
    }

    /// The modes in the order in which a round runs them: forth and back, so that a machine that slows down or speeds up
    /// is fair to all.
    pub(crate) fn order(&self, round: u32) -> Vec<&String> {
        if round.is_multiple_of(2) {
            self.modes.iter().rev().collect()
        } else {
            self.modes.iter().collect()
        }
    }
}

/// All folders in `scenes` that hold a scene, and in their folders, by their path from there and in order.
fn all_scenes() -> anyhow::Result<Vec<String>> {
    let scenes = root().join("scenes");
    let (mut folders, mut found) = (vec![scenes.clone()], Vec::new());
    while let Some(folder) = folders.pop() {
        let entries =
            fs::read_dir(&folder).with_context(|| format!("reading {}", folder.display()))?;
        for entry in entries {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.ends_with("scene.toml") {
                let below = folder.strip_prefix(&scenes).unwrap_or(&folder);
                found.push(below.to_string_lossy().into_owned());
            }
        }
    }
    found.sort();
    Ok(found)
}

/// A scene by the name of its folder in `scenes`, or by the path of its file.
fn scene(text: &str) -> anyhow::Result<SceneFile> {
    let is_file = text.ends_with(".toml") || text.ends_with(".xml");
    let path = if is_file {
        from_root(&std::path::absolute(text)?)
    } else {
        Path::new("scenes").join(text).join("scene.toml")
    };
    ensure!(
        root().join(&path).is_file(),
        "there is no scene {text}: {} is missing",
        path.display()
    );
    let folder = path.parent().and_then(Path::file_name).unwrap_or_default();
    Ok(SceneFile { name: folder.to_string_lossy().into_owned(), path })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A plan that is never run.
    pub(crate) fn plan(modes: &[&str], runs: u32) -> Plan {
        Plan {
            programs: Programs {
                photon_build: "target/release/photon-build".into(),
                render_cached: "target/release/render-cached".into(),
            },
            scenes: vec![scene("cornell-box").unwrap()],
            sizes: vec![16, 32],
            modes: modes.iter().map(|&m| m.into()).collect(),
            runs,
            settings: Settings::usual(),
            out: "target/bench".into(),
        }
    }

    #[test]
    fn command_lines_are_what_one_would_type() {
        let plan = plan(&["original", "paper"], 5);
        let scene = &plan.scenes[0];
        assert_eq!(
            plan.build(scene, 0).0.to_string(),
            "target/release/photon-build scenes/cornell-box/scene.toml --photons-per-light 1M \
             -o target/bench/cornell-box/maps.photons --stats target/bench/cornell-box/maps.json --force -q"
        );
        assert_eq!(
            plan.render(scene, 512, "paper", 2).0.to_string(),
            "target/release/render-cached scenes/cornell-box/scene.toml --photons target/bench/cornell-box/maps.photons \
             --mode paper --resolution 512x512 --shadow-rays 64 --gather 500 --exposure 1 -o target/bench/cornell-box/0512-paper.png \
             --stats target/bench/cornell-box/0512-paper.json --force -q"
        );
        assert!(
            plan.render(scene, 512, "paper", 0)
                .0
                .to_string()
                .contains(" -o target/bench/cornell-box/0512-paper.exr ")
        );
    }

    #[test]
    fn rounds_go_forth_and_back() {
        let plan = plan(&["original", "paper", "adaptive"], 5);
        assert_eq!(plan.order(1), ["original", "paper", "adaptive"]);
        assert_eq!(plan.order(2), ["adaptive", "paper", "original"]);
    }

    #[test]
    fn scenes_are_found_by_name_and_by_path() {
        let named = scene("cornell-box").unwrap();
        assert_eq!(named.path, Path::new("scenes/cornell-box/scene.toml"));
        let path = root().join(&named.path);
        assert_eq!(scene(path.to_str().unwrap()).unwrap(), named);
        let all = all_scenes().unwrap();
        for name in ["cornell-box", "rabbit", "tests/furnace"] {
            assert!(all.iter().any(|n| n == name), "{all:?}");
        }
        assert_eq!(
            scene("teapot").unwrap_err().to_string(),
            "there is no scene teapot: scenes/teapot/scene.toml is missing"
        );
    }
}
