//! A scene rendered in mode adaptive and in mode original by the programs.

use std::fs;
use std::path::{Path, PathBuf};

use base::{Grid, Rgb};
use clap::Parser;
use film::{Difference, Existing, Picture};
use serde_json::Value;
use tempfile::TempDir;

/// A folder with a scene and photon maps of it.
pub(super) struct Bench {
    folder: TempDir,
    scene: PathBuf,
}

impl Bench {
    /// Of a scene file's text, with this many photons.
    pub(super) fn of_text(scene: &str, photons: &str) -> Self {
        Self::of_files(&[("scene.toml", scene)], photons)
    }

    /// Of a scene file, which comes first, and what it names.
    pub(super) fn of_files(files: &[(&str, &str)], photons: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        files.iter().for_each(|(name, text)| fs::write(folder.path().join(name), text).unwrap());
        let scene = folder.path().join(files[0].0);
        Self::new(folder, scene, photons)
    }

    /// Of a scene of the folder `scenes`.
    pub(super) fn of_scene(name: &str, photons: &str) -> Self {
        let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
        let files = ["scene.toml", "scene.xml"].map(|file| scenes.join(name).join(file));
        let scene = files.into_iter().find(|file| file.exists()).unwrap();
        Self::new(tempfile::tempdir().unwrap(), scene, photons)
    }

    fn new(folder: TempDir, scene: PathBuf, photons: &str) -> Self {
        let bench = Self { folder, scene };
        let maps = bench.file("a.photons");
        let args = format!("photon-build {} -o {maps} --photons {photons} -q", bench.scene());
        let args = photon_build::Args::parse_from(args.split_whitespace());
        photon_build::run(&args).unwrap();
        bench
    }

    fn scene(&self) -> String {
        self.scene.display().to_string()
    }

    fn file(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    /// Renders with these options besides the mode.
    pub(super) fn picture(&self, options: &str) -> Picture {
        self.picture_and_stats(options).0
    }

    /// The same, with what `--stats` tells.
    fn picture_and_stats(&self, options: &str) -> (Picture, Value) {
        let (exr, maps, stats) = (self.file("a.exr"), self.file("a.photons"), self.file("a.json"));
        let args = format!(
            "render-cached {} --photons {maps} -o {exr} --stats {stats} --force -q {options}",
            self.scene()
        );
        let args = render_cached::Args::parse_from(args.split_whitespace());
        render_cached::run(&args).unwrap();
        let stats = serde_json::from_slice(&fs::read(stats).unwrap()).unwrap();
        (film::read_exr(Path::new(&exr)).unwrap(), stats)
    }

    /// Renders in both modes.
    pub(super) fn both(&self, options: &str) -> Pair {
        let [adaptive, original] = ["adaptive", "original"]
            .map(|mode| self.picture_and_stats(&format!("--mode {mode} {options}")));
        let scene = fs::read(&self.scene).unwrap();
        let stats = [adaptive.1, original.1];
        Pair { scene, adaptive: adaptive.0, original: original.0, stats }
    }
}

/// The same in both modes.
pub(super) struct Pair {
    scene: Vec<u8>,
    pub(super) adaptive: Picture,
    pub(super) original: Picture,
    /// What the runs did: mode adaptive, mode original.
    pub(super) stats: [Value; 2],
}

impl Pair {
    /// How far a layer is off; the whole picture has no name.
    pub(super) fn difference(&self, layer: &str) -> Difference {
        self.compare(layer).0
    }

    fn compare(&self, layer: &str) -> (Difference, Grid<f32>) {
        let [ours, truth] = [&self.adaptive, &self.original].map(|p| p.rgb(layer).unwrap());
        film::compare(&ours, &truth, 0.0).unwrap()
    }

    /// Writes what tells why a layer is off, for a person to look at; returns the folder.
    pub(super) fn show(&self, name: &str, layer: &str) -> PathBuf {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("failed").join(name);
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("scene.toml"), &self.scene).unwrap();
        let write = |what: &str, grid: &Grid<Rgb>| {
            let path = folder.join(format!("{what}.png"));
            film::write_png(&path, Existing::Replace, grid, 0.0).unwrap();
        };
        write("adaptive", &self.adaptive.rgb(layer).unwrap());
        write("original", &self.original.rgb(layer).unwrap());
        write("flip", &film::flip_picture(&self.compare(layer).1));
        for component in ["direct", "indirect", "specular", "caustics"] {
            // A gray for each reason.
            let reasons = self.adaptive.channel(&format!("reason.{component}")).unwrap();
            let grays = reasons.iter().map(|&r| Rgb::splat(r / 8.0)).collect();
            write(&format!("reason-{component}"), &Grid::from_values(self.adaptive.size(), grays));
        }
        for (what, picture) in [("adaptive", &self.adaptive), ("original", &self.original)] {
            film::write_exr(&folder.join(format!("{what}.exr")), Existing::Replace, picture)
                .unwrap();
        }
        folder
    }
}

/// What a picture says of itself.
pub(super) fn metadata(picture: &Picture) -> Value {
    serde_json::from_str(picture.metadata()).unwrap()
}

/// Rays of all kinds and photons visited, by `--stats`.
pub(super) fn work(stats: &Value) -> u64 {
    let rays = ["eye", "specular", "shadow"].map(|kind| stats["rays"][kind].as_u64().unwrap());
    rays.into_iter().sum::<u64>() + stats["photons_visited"].as_u64().unwrap()
}
