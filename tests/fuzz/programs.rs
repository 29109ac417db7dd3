//! Both programs, within the process of the fuzzer, on a scene so small that a run takes milliseconds.

use std::fs;
use std::thread;

use clap::Parser;
use xxhash_rust::xxh3::xxh3_64;

use crate::{file, folder};

const SCENE: &str = r#"camera = { origin = [0, 1, 4], target = [0, 1, 0], fov = 60 }
materials.white = { type = "diffuse", albedo = 0.5 }
materials.lamp = { type = "diffuse", albedo = 0, emission = 5 }
materials.mirror = { type = "mirror", reflectance = 0.9 }
quads = [
    { corner = [-2, 0, -2], edges = [[0, 0, 4], [4, 0, 0]], material = "white" },
    { corner = [-0.5, 3, -0.5], edges = [[1, 0, 0], [0, 0, 1]], material = "lamp" },
    { corner = [-2, 0, -2], edges = [[2, 0, 0], [0, 3, 0]], material = "mirror" },
]
"#;

/// Runs of `photon-build`.
pub const BUILD: &str = "photon-build FOLDER/scene.toml --photons 40 -o FOLDER/out.photons";

/// Runs of `render-cached`, a mode each.
pub const RENDER: [&str; 2] = [
    "render-cached FOLDER/scene.toml --photons FOLDER/a.photons --resolution 6x6 --shadow-rays 2 --mode original -o FOLDER/out.png",
    "render-cached FOLDER/scene.toml --photons FOLDER/a.photons --resolution 6x6 --shadow-rays 2 --mode paper -o FOLDER/out.png",
];

/// A run that saves the layers of a picture, and one that makes the picture of them.
pub const LAYERS: [&str; 2] = [
    "render-cached FOLDER/scene.toml --photons FOLDER/a.photons --resolution 6x6 --shadow-rays 2 --mode adaptive --save-layers FOLDER/a.layers",
    "render-cached FOLDER/scene.toml --photons FOLDER/a.photons --resolution 6x6 --shadow-rays 2 --mode adaptive --from-layers FOLDER/a.layers -o FOLDER/out.png",
];

/// Writes the scene and its maps.
pub fn prepare() {
    file("scene.toml", SCENE.as_bytes());
    run("photon-build FOLDER/scene.toml --photons 300 -o FOLDER/a.photons").expect("maps of the scene");
}

/// Runs a program, quietly, with one thread; `FOLDER` is that of this process.
pub fn run(line: &str) -> anyhow::Result<()> {
    let words: Vec<String> = line
        .split(' ')
        .chain(["-q", "--force", "-t", "1"])
        .map(|word| word.replace("FOLDER", &folder().display().to_string()))
        .collect();
    match words[0].as_str() {
        "photon-build" => photon_build::run(&photon_build::Args::try_parse_from(words)?),
        _ => render_cached::run(&render_cached::Args::try_parse_from(words)?),
    }
}

/// The journal of a run: its header, and the pieces as [`pieces`] takes them. It lasts no longer than the run, so it is
/// read while that goes on, again and again until it was seen.
pub fn journal_of(line: &str) -> (Vec<u8>, Vec<u8>) {
    let output = line.rsplit("FOLDER/").next().expect("an output is named last");
    let path = folder().join(format!("{output}.journal"));
    let line = format!("{line} --checkpoint 0.000001");
    loop {
        let mut seen = Vec::new();
        thread::scope(|scope| {
            let run = scope.spawn(|| run(&line).expect("a sound run"));
            while !run.is_finished() {
                let now = fs::read(&path).unwrap_or_default();
                if now.len() > seen.len() {
                    seen = now;
                }
            }
        });
        let Some(end) = find_end(&seen).filter(|end| *end < seen.len()) else { continue };
        let pieces = seen.split_off(end);
        return (seen, bare(&pieces));
    }
}

/// Puts a journal where the run will look for it, and resumes.
pub fn resume(line: &str, header: &[u8], pieces: &[u8]) {
    let output = line.rsplit("FOLDER/").next().expect("an output is named last");
    file(&format!("{output}.journal"), &[header, pieces].concat());
    let _ = std::hint::black_box(run(&format!("{line} --resume")));
}

/// Where the header of a journal ends.
fn find_end(journal: &[u8]) -> Option<usize> {
    journal.windows(2).position(|w| w == b"\n\n").map(|at| at + 2 + 8)
}

/// Pieces of a journal with the digests that they must have: length, stage and index, 4 bytes each, then the piece.
pub fn pieces(data: &[u8]) -> Vec<u8> {
    let mut journal = Vec::new();
    let mut rest = data;
    while let Some((prefix, after)) = rest.split_first_chunk::<12>() {
        let len = u32::from_le_bytes([0, 1, 2, 3].map(|i| prefix[i])) as usize;
        let (piece, next) = after.split_at(len.min(after.len()));
        let mut prefix = *prefix;
        prefix[..4].copy_from_slice(&(piece.len() as u32).to_le_bytes());
        let mut digested = 12_u64.to_le_bytes().to_vec();
        digested.extend(prefix);
        digested.extend((piece.len() as u64).to_le_bytes());
        digested.extend(piece);
        journal.extend(prefix);
        journal.extend(xxh3_64(&digested).to_le_bytes());
        journal.extend(piece);
        rest = next;
    }
    journal
}

/// The pieces of a journal without their digests.
fn bare(journal: &[u8]) -> Vec<u8> {
    let mut pieces = Vec::new();
    let mut rest = journal;
    while let Some((prefix, after)) = rest.split_first_chunk::<20>() {
        let len = u32::from_le_bytes([0, 1, 2, 3].map(|i| prefix[i])) as usize;
        let Some((piece, next)) = after.split_at_checked(len) else { break };
        pieces.extend(&prefix[..12]);
        pieces.extend(piece);
        rest = next;
    }
    pieces
}
