//! A folder to run the program in.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use assert_cmd::assert::OutputAssertExt;
use serde_json::Value;
use tempfile::TempDir;

/// A lamp over a floor, and a ball of glass between them.
pub(crate) const SCENE: &str = r#"
camera = { origin = [0, 1, 4], target = [0, 1, 0], fov = 40 }

[materials]
white = { type = "diffuse", albedo = [0.8, 0.7, 0.6] }
lamp = { type = "diffuse", albedo = 0, emission = [10, 9, 8] }
glass = { type = "glass", ior = 1.5 }

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
corner = [-0.5, 3, -0.5]
edges = [[1, 0, 0], [0, 0, 1]]
material = "lamp"

[[spheres]]
name = "ball"
center = [0, 1, 0]
radius = 0.6
material = "glass"
"#;

/// A folder that holds `scene.toml` and goes away with its contents.
pub(crate) struct Bench {
    folder: TempDir,
}

impl Bench {
    pub(crate) fn new() -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        bench.write("scene.toml", SCENE);
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

    /// The program in the folder, with arguments that are separated by blanks.
    pub(crate) fn command(&self, args: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_photon-build"));
        command.args(args.split_whitespace()).current_dir(self.folder.path());
        command.env_remove("TETRALUX_THREADS");
        command
    }

    /// A run that ends well; answers standard output and standard error.
    pub(crate) fn run(&self, args: &str) -> (String, String) {
        let output = self.command(args).assert().success().get_output().clone();
        (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
    }

    /// A run that ends with this code and this line, and leaves all files as they were.
    #[track_caller]
    pub(crate) fn refuses(&self, args: &str, code: i32, message: &str) {
        let before = self.files();
        self.command(args)
            .assert()
            .code(code)
            .stdout("")
            .stderr(format!("photon-build: {message}\n"));
        assert!(self.files() == before, "`{args}` has changed files");
    }
}
