//! Writes files to start from, a folder of `corpus` for each target: sound ones of every kind that a reader takes.

use std::fs;
use std::path::{Path, PathBuf};

use base::{Component, Fingerprint, Grid, ImageSize, Inventory, Photon, Pixel, Rgb, encode_octahedral};
use cache_map::{CacheMap, Origin, SurfacePoint};
use film::{Existing, Picture};
use glam::{Vec3, Vec3A};
use photon_map::{Metadata, PhotonMaps, PhotonSet};
use tetralux_fuzz::{folder, programs};

fn main() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let top = here.join("../..");
    let into = |target: &str, name: &str| -> PathBuf {
        let folder = here.join("corpus").join(target);
        fs::create_dir_all(&folder).expect("a folder for seeds");
        folder.join(name)
    };
    let write = |target: &str, name: &str, bytes: &[u8]| {
        fs::write(into(target, name), bytes).expect("a seed");
    };

    photon_maps(&into("photon_map", "a.photons"));
    cache_map(&into("cache_map", "a.cache"));
    for target in ["records", "map_header"] {
        let golden = fs::read(top.join("crates/cache-map/tests/golden.records")).expect("it is in the repository");
        write(target, "golden", &golden);
    }
    write("map_header", "golden.map", &fs::read(top.join("crates/mapfile/tests/golden.map")).expect("it is in the repository"));

    for scene in scenes(&top.join("scenes")) {
        let bytes = fs::read(&scene).expect("a scene of the repository");
        write("scene_toml", &scene.to_string_lossy().replace('/', "_"), &bytes);
    }
    write("scene_toml", "everything", include_bytes!("../seeds/everything.toml"));
    write("mitsuba", "everything", include_bytes!("../seeds/everything.xml"));
    let gltf = fs::read_to_string(top.join("crates/scene/tests/everything.gltf")).expect("it is in the repository");
    write("gltf", "everything", &binary_gltf(&gltf));
    write("obj", "everything", include_bytes!("../seeds/everything.obj"));
    for (name, bytes) in plys() {
        write("ply", name, &bytes);
    }
    on_the_way(&write);
    for (name, bytes) in serialized() {
        write("serialized", name, &bytes);
    }
    images(&into("image", ""), &into("exr", ""));
}

/// A PNG of two texels, one of them clear.
const PNG: &[u8] = b"\x89\x50\x4e\x47\x0d\x0a\x1a\x0a\x00\x00\x00\x0d\x49\x48\x44\x52\x00\x00\x00\x02\x00\x00\x00\x01\x08\x06\x00\x00\
    \x00\xf4\x22\x7f\x8a\x00\x00\x00\x0f\x49\x44\x41\x54\x78\x9c\x63\x38\x91\x62\xc4\x00\xc4\xff\x01\x0f\xe0\x03\xbc\
    \x48\x3e\x6a\xa1\x00\x00\x00\x00\x49\x45\x4e\x44\xae\x42\x60\x82";

/// A binary file of that text and the buffer that it names.
fn binary_gltf(text: &str) -> Vec<u8> {
    let floats = [
        &[-1.0_f32, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0, -1.0, -1.0, 0.0, -1.0][..],
        &[0.0, 1.0, 0.0].repeat(4),
        &[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0],
    ]
    .concat();
    let mut bin: Vec<u8> = floats.iter().flat_map(|x| x.to_le_bytes()).collect();
    bin.extend([0, 1, 2, 0, 2, 3, 2, 0]);
    bin.extend([1.0_f32, 0.5, -1.0].iter().flat_map(|x| x.to_le_bytes()));
    let start = bin.len();
    bin.extend(PNG);
    bin.resize(bin.len().next_multiple_of(4), 0);
    let text = text
        .replace("\"START\"", &start.to_string())
        .replace("\"LENGTH\"", &PNG.len().to_string())
        .replace("\"BYTES\"", &bin.len().to_string())
        .replace("\"uri\": \"everything.bin\",", "");
    let mut json = text.into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let word = |n: usize| (n as u32).to_le_bytes();
    let chunk = |kind: &[u8], data: &[u8]| [&word(data.len())[..], kind, data].concat();
    let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &bin)].concat();
    [b"glTF\x02\0\0\0", &word(chunks.len() + 12)[..], &chunks].concat()
}

/// What the target packs: a triangle with a normal each, in single and in double precision.
fn serialized() -> Vec<(&'static str, Vec<u8>)> {
    let numbers = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0];
    let mesh = |first: &[u8], places: Vec<u8>| {
        let counts = [3_u64, 1].map(u64::to_le_bytes).concat();
        [first, &counts, &places, &[0_u32, 1, 2].map(u32::to_le_bytes).concat()].concat()
    };
    vec![
        ("single", mesh(&[1, 1, 0x10, 0, 0], numbers.map(|x: f64| (x as f32).to_le_bytes()).concat())),
        ("double", mesh(&[3, 1, 0x20, 0, 0, b'a', 0], numbers.map(f64::to_le_bytes).concat())),
    ]
}

fn scenes(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder of the repository").map(|e| e.expect("an entry").path());
    let mut found = Vec::new();
    for path in entries {
        if path.is_dir() {
            found.extend(scenes(&path));
        } else if path.ends_with("scene.toml") {
            found.push(path);
        }
    }
    found
}

fn photon_maps(path: &Path) {
    let photons: Vec<Photon> = (0..70)
        .map(|i| Photon {
            position: Vec3::new(i as f32 * 0.01, (i * i % 17) as f32 * 0.1, 0.5),
            normal: encode_octahedral(Vec3A::Z),
            flux: Rgb::new(1.0, 0.5, 0.25),
        })
        .collect();
    let mut metadata = Metadata { emitted: 100, absorbed: 100, flux: Rgb::ONE, ..Metadata::default() };
    metadata.inventory.add("mesh `box`", Fingerprint(7));
    let maps = PhotonMaps {
        metadata,
        direct: Some(PhotonSet::build(&photons[..1])),
        caustic: PhotonSet::build(&photons[..33]),
        indirect: PhotonSet::build(&photons),
        focused: None,
    };
    maps.save(path, Existing::Replace, "seeds", "make {file}").expect("a seed");
}

/// What the programs write and read on the way to a picture.
fn on_the_way(write: &impl Fn(&str, &str, &[u8])) {
    programs::prepare();
    write("resume_photons", "whole", &programs::journal_of(programs::BUILD).1);
    for (mode, line) in programs::RENDER.iter().enumerate() {
        let pieces = programs::journal_of(line).1;
        write("resume_picture", &mode.to_string(), &[&[mode as u8][..], &pieces].concat());
    }
    let settings = "#?tetralux-journal 1\n\"--seed\" = \"0\"\n\n";
    let digest = Fingerprint::of(settings.as_bytes()).0.to_le_bytes();
    let pieces = programs::pieces(&[3, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 7, 7, 7]);
    write("journal", "whole", &[settings.as_bytes(), &digest, &pieces].concat());
    let run = |line: &str, file: &str| -> Vec<u8> {
        programs::run(line).expect("a sound run");
        fs::read(folder().join(file)).expect("it was just written")
    };
    write("layers", "whole", &run(programs::LAYERS[0], "a.layers"));
    let shard = format!("{} --shard 1/1", programs::BUILD);
    write("shard", "whole", &run(&shard, "out.photons"));
    let part = format!("{} --tile 1/1 -o FOLDER/a.exr", programs::RENDER[0]);
    write("part", "whole", &run(&part, "a.exr"));
}

fn cache_map(path: &Path) {
    let size = ImageSize { width: 7, height: 7 };
    let surface = |p: Pixel| SurfacePoint { position: Vec3::new(p.x as f32, p.y as f32, 0.0), normal: Vec3::Z };
    let mut map = CacheMap::new(Grid::from_fn(size, |p| Some(surface(p))));
    let pixels: Vec<Pixel> = (0..7).map(|i| Pixel { x: i, y: i }).collect();
    for component in Component::ALL {
        map.record(component, &pixels, &[Rgb::ONE; 7], Origin::Sampled);
    }
    let mut inputs = Inventory::new();
    inputs.add("camera", Fingerprint(1));
    map.save(path, Existing::Replace, &inputs, "seeds", "make {file}").expect("a seed");
}

fn plys() -> Vec<(&'static str, Vec<u8>)> {
    let ascii = b"ply\nformat ascii 1.0\ncomment x\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
        property float nx\nproperty float ny\nproperty float nz\nelement face 4\nproperty list uchar int vertex_indices\n\
        end_header\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n0 0 1 0 1 0\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
    let binary = |format: &str, order: fn([u8; 4]) -> [u8; 4]| {
        let mut bytes = format!(
            "ply\nformat {format} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
             property float u\nproperty float v\nelement face 1\nproperty list uchar uint vertex_index\nend_header\n"
        )
        .into_bytes();
        for i in 0..15 {
            bytes.extend(order((i as f32 * 0.37 % 1.0).to_le_bytes()));
        }
        bytes.push(3);
        (0..3_u32).for_each(|i| bytes.extend(order(i.to_le_bytes())));
        bytes
    };
    vec![
        ("ascii", ascii.to_vec()),
        ("little", binary("binary_little_endian", |b| b)),
        ("big", binary("binary_big_endian", |[a, b, c, d]| [d, c, b, a])),
    ]
}

fn images(folder: &Path, exrs: &Path) {
    let size = ImageSize { width: 5, height: 3 };
    let grid = Grid::from_fn(size, |p| Rgb::new(p.x as f32 * 0.2, p.y as f32 * 0.3, 0.1));
    let scratch = exrs.join("a.exr");
    let mut picture = Picture::new(size, "{}".into());
    picture.push_rgb("", &grid);
    film::write_exr(&scratch, Existing::Replace, &picture).expect("a seed");
    picture.push("Z", vec![1.0; 15]);
    film::write_exr(&exrs.join("b.exr"), Existing::Replace, &picture).expect("a seed");

    // The first byte says which ending the file gets.
    let write = |name: &str, ending: u8, bytes: &[u8]| {
        fs::write(folder.join(name), [&[ending], bytes].concat()).expect("a seed");
    };
    let png = folder.join("png");
    film::write_png(&png, Existing::Replace, &grid, 0.0).expect("a seed");
    let bytes = fs::read(&png).expect("it was just written");
    write("png", 0, &bytes);
    write("tga", 2, &[&[0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 2, 0, 24, 0][..], &[90; 12]].concat());
    write("tga-packed", 2, &[0, 0, 10, 0, 0, 0, 0, 0, 0, 0, 0, 0, 4, 0, 1, 0, 24, 0, 0x83, 1, 2, 3]);
    let bmp = [
        &b"BM"[..], &[70, 0, 0, 0, 0, 0, 0, 0, 54, 0, 0, 0, 40, 0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 1, 0, 24, 0], &[0; 24],
        &[200; 16],
    ];
    write("bmp", 3, &bmp.concat());
    let hdr = [&b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n"[..], &[128, 128, 128, 129, 10, 20, 30, 128]];
    write("hdr", 4, &hdr.concat());
}
