//! A folder to run the program in, with a scene and photon maps.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use assert_cmd::assert::OutputAssertExt;
use clap::Parser;
use film::Picture;
use serde_json::Value;
use tempfile::TempDir;

/// A lamp and a bulb over a floor, a ball of glass and one of metal between them.
pub(crate) const SCENE: &str = r#"
camera = { origin = [0, 1, 4], target = [0, 1, 0], fov = 40 }

[materials]
white = { type = "diffuse", albedo = [0.8, 0.7, 0.6] }
lamp = { type = "diffuse", albedo = 0.5, emission = [10, 9, 8] }
glass = { type = "glass", ior = 1.5 }
metal = { type = "metal", preset = "silver" }

[[quads]]
name = "floor"
corner = [-2, 0, -2]
edges = [[0, 0, 4], [4, 0, 0]]
material = "white"

[[quads]]
name = "wall"
corner = [-2, 0, -2]
edges = [[4, 0, 0], [0, 3, 0]]
material = "white"

[[quads]]
name = "lamp"
corner = [-0.5, 2, -0.5]
edges = [[1, 0, 0], [0, 0, 1]]
material = "lamp"

[[spheres]]
name = "ball"
center = [0.6, 0.7, 0.5]
radius = 0.5
material = "glass"

[[spheres]]
name = "mirror"
center = [-0.8, 0.6, 0]
radius = 0.5
material = "metal"

[[lights]]
name = "bulb"
type = "point"
position = [1.5, 1.5, 1]
intensity = 1
"#;

/// Qualities for small pictures; `scene.toml` and `a.photons` are what is rendered.
pub(crate) const SMALL: &str = "scene.toml --photons a.photons --resolution 48x32 --shadow-rays 4 --gather 20 --caustic-gather 10";

/// What `--mode` can be.
pub(crate) const MODES: [&str; 3] = ["original", "paper", "adaptive"];

/// A folder that holds `scene.toml`, its `a.photons`, and goes away with its contents.
pub(crate) struct Bench {
    folder: TempDir,
}

impl Bench {
    pub(crate) fn new() -> Self {
        Self::of(SCENE)
    }

    /// The folder of a scene.
    pub(crate) fn of(scene: &str) -> Self {
        Self::with(scene, |_| {})
    }

    /// The folder of a scene that names other files, which are written first.
    pub(crate) fn with(scene: &str, write_files: impl FnOnce(&Self)) -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        write_files(&bench);
        bench.write("scene.toml", scene);
        bench.photon_build("scene.toml -o a.photons --photons 5K");
        bench
    }

    pub(crate) fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    pub(crate) fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&self.read(name)).unwrap()
    }

    pub(crate) fn picture(&self, name: &str) -> Picture {
        film::read_exr(&self.path(name)).unwrap()
    }

    /// The names of all files in the folder with what they hold; folders hold nothing.
    pub(crate) fn files(&self) -> BTreeMap<String, Vec<u8>> {
        let entries = fs::read_dir(self.folder.path()).unwrap().map(Result::unwrap);
        entries
            .map(|entry| {
                let name = entry.file_name().into_string().unwrap();
                let content = if entry.file_type().unwrap().is_file() {
                    fs::read(entry.path()).unwrap()
                } else {
                    Vec::new()
                };
                (name, content)
            })
            .collect()
    }

    /// Runs `photon-build` in this process, as if it were in the folder: names of files are those with a dot.
    pub(crate) fn photon_build(&self, args: &str) {
        let words = args.split_whitespace().map(|word| {
            let word = word.trim_matches('\'');
            if word.contains('.') { self.path(word).into() } else { word.to_owned().into() }
        });
        let words = std::iter::once("photon-build".into()).chain(words).chain(["-q".into()]);
        photon_build::run(&photon_build::Args::parse_from::<_, std::ffi::OsString>(words)).unwrap();
    }

    /// The program in the folder, with arguments that are separated by blanks.
    pub(crate) fn command(&self, args: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_render-cached"));
        command.args(args.split_whitespace()).current_dir(self.folder.path());
        command.env_remove("TETRALUX_THREADS");
        command
    }

    /// A run that ends well; answers standard output and standard error.
    #[track_caller]
    pub(crate) fn run(&self, args: &str) -> (String, String) {
        let output = self.command(args).assert().success().get_output().clone();
        (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
    }

    /// A run of [`SMALL`] that ends well.
    #[track_caller]
    pub(crate) fn render(&self, args: &str) {
        self.run(&format!("{SMALL} {args}"));
    }

    /// A run that ends with this code and this line, and leaves all files as they were.
    #[track_caller]
    pub(crate) fn refuses(&self, args: &str, code: i32, message: &str) {
        let before = self.files();
        self.command(args)
            .assert()
            .code(code)
            .stdout("")
            .stderr(format!("render-cached: {message}\n"));
        assert!(self.files() == before, "`{args}` has changed files");
    }
}

/// Whether two pictures have the same channels with the same values, those of a name aside that starts like one of these.
#[track_caller]
pub(crate) fn assert_same_layers(a: &Picture, b: &Picture, but: &[&str]) {
    let compared = |picture: &Picture| -> Vec<(String, Vec<u32>)> {
        let is_compared = |name: &str| !but.iter().any(|prefix| name.starts_with(prefix));
        let channels = picture.channels().filter(|(name, _)| is_compared(name));
        channels
            .map(|(name, values)| (name.into(), values.iter().map(|v| v.to_bits()).collect()))
            .collect()
    };
    let (a, b) = (compared(a), compared(b));
    assert!(a.len() > 3);
    for ((name, a), (other, b)) in a.iter().zip(&b) {
        assert_eq!(name, other);
        let n = a.iter().zip(b).filter(|(a, b)| a != b).count();
        assert_eq!(n, 0, "{n} of {} values of {name} differ", a.len());
    }
    assert_eq!(a.len(), b.len());
}
