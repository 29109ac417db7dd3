//! Damaged files: an error or a scene, never a panic.

mod common;

use common::load_files;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

const SCENE: &str = r#"[camera]
origin = [0, 1, 9]
target = [0, 1, 0]
fov = 40

[materials]
white = { type = "diffuse", albedo = [0.7, 0.7, 0.7], emission = 1 }
gold = { type = "metal", preset = "gold", opacity = 0.5 }
red = { type = "plastic", albedo = [0.7, 0.1, 0.1], ior = 1.5, roughness = 0.2 }
glass = { type = "glass", ior = 1.5, absorption = [0, 0.1, 0.2] }

[[meshes]]
file = "a.obj"
transform = { scale = [1, 2, 1], rotate = [{ axis = [0, 1, 0], degrees = 30 }], translate = [0, 1, 0] }

[[meshes]]
file = "b.ply"
material = "glass"

[[meshes]]
file = "c.ply"
material = "gold"
smooth = false

[[quads]]
corner = [-1, 0, -1]
edges = [[2, 0, 0], [0, 0, 2]]
material = "white"

[[boxes]]
center = [0, 3, 0]
size = [1, 1, 1]
material = "red"

[[spheres]]
center = [0, 5, 0]
radius = 1
material = "gold"

[[lights]]
type = "spot"
position = [0, 3, 0]
target = [0, 0, 0]
intensity = 1
cone_angle = 30
"#;

const OBJ: &str = "# an object\nmtllib a.mtl\no thing\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 1\nvt 0 0\nvn 0 0 1\n\
    vn 1 0 0\nusemtl red\nf 1/1/1 2/1/1 3/1/2 4/1/1\ng more\ns off\nusemtl mirror\nf -1 -2 \\\n -3\nf 1 2 5 # top\n";

const MTL: &str = "newmtl red\nKd 0.5 0.25 0.125\nKs 0.5\nNs 10\nillum 2\nmap_Kd -s 1 1 a.tga\nd 0.9\n\
    newmtl mirror\nKd 0.1\nKs 0.9 0.8 0.7\nillum 3\nNi 1.5\nKe 0\n";

fn ascii_ply() -> Vec<u8> {
    b"ply\nformat ascii 1.0\ncomment x\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
      property float nx\nproperty float ny\nproperty float nz\nelement face 4\n\
      property list uchar int vertex_indices\nend_header\n\
      0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n0 0 1 0 1 0\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
        .to_vec()
}

fn binary_ply(order: fn([u8; 4]) -> [u8; 4], format: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element face 3\nproperty list uchar uint vertex_index\nend_header\n"
    )
    .into_bytes();
    for x in [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0] {
        bytes.extend(order(x.to_le_bytes()));
    }
    for face in [vec![0_u32, 1, 2], vec![0, 2, 3], vec![3, 2, 1, 0]] {
        bytes.push(face.len() as u8);
        face.iter().for_each(|i| bytes.extend(order(i.to_le_bytes())));
    }
    bytes
}

/// One change of a file, at a place given as a share of its length.
#[derive(Clone, Debug)]
enum Damage {
    Overwrite(f64, u8),
    Insert(f64, Vec<u8>),
    Remove(f64, usize),
    Repeat(f64, usize),
    Cut(f64),
}

fn damage() -> impl Strategy<Value = Damage> {
    let words: Vec<Vec<u8>> = [
        "nan",
        "-inf",
        "-1",
        "0",
        "99999999999999999999",
        "4294967295",
        "1e308",
        "1e-320",
        "-0.0",
        "[",
        "]",
        "{",
        "\"",
        "'",
        "\\\n",
        "\n",
        "\r",
        "#",
        " ",
        "/",
        "//",
        "\0",
        "\u{fffd}",
        "f 1 2 3\n",
        "usemtl red\n",
        "element face 9\n",
        "property list int int x\n",
        "end_header\n",
        "newmtl x\n",
        "[[quads]]\n",
        ",\"mode\":5",
        ",\"byteStride\":4",
        "BIN\0",
    ]
    .iter()
    .map(|w| w.as_bytes().to_vec())
    .chain([b"\xff\xfe".to_vec(), vec![0; 40]])
    .collect();
    prop_oneof![
        (0.0..1.0, any::<u8>()).prop_map(|(at, b)| Damage::Overwrite(at, b)),
        (0.0..1.0, proptest::sample::select(words)).prop_map(|(at, w)| Damage::Insert(at, w)),
        (0.0..1.0, 1_usize..12).prop_map(|(at, n)| Damage::Remove(at, n)),
        (0.0..1.0, 1_usize..60).prop_map(|(at, n)| Damage::Repeat(at, n)),
        (0.0..1.0).prop_map(Damage::Cut),
    ]
}

fn apply(damage: &Damage, bytes: &mut Vec<u8>) {
    let place = |share: f64| (share * bytes.len() as f64) as usize;
    match damage {
        Damage::Overwrite(at, b) => {
            let at = place(*at);
            bytes[at..].iter_mut().take(1).for_each(|old| *old = *b);
        }
        Damage::Insert(at, word) => {
            let at = place(*at);
            bytes.splice(at..at, word.iter().copied());
        }
        Damage::Remove(at, n) => {
            let at = place(*at);
            bytes.drain(at..bytes.len().min(at + n));
        }
        Damage::Repeat(at, n) => {
            let at = place(*at);
            let piece = bytes[at..bytes.len().min(at + n)].to_vec();
            bytes.splice(at..at, piece);
        }
        Damage::Cut(at) => bytes.truncate(place(*at)),
    }
}

/// The files of the scene, whole.
fn files() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("scene.toml", SCENE.into()),
        ("a.obj", OBJ.into()),
        ("a.mtl", MTL.into()),
        ("b.ply", ascii_ply()),
        ("c.ply", binary_ply(|b| b, "binary_little_endian")),
        // Two texels of 24 bits.
        ("a.tga", vec![0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 1, 0, 24, 0, 0, 0, 9, 7, 8, 255]),
    ]
}

fn load(files: &[(&str, Vec<u8>)]) -> Result<scene::Loaded, String> {
    let files: Vec<_> = files.iter().map(|(name, bytes)| (*name, bytes.as_slice())).collect();
    load_files(&files)
}

/// A glTF file of everything, its buffer, and both in one: a lamp that two nodes show, by a sparse accessor and a texture.
fn gltf_files() -> Vec<(&'static str, Vec<u8>)> {
    let floats = |floats: &[f32]| floats.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>();
    let bin = [
        floats(&[-1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0, -1.0, -1.0, 0.0, -1.0]),
        floats(&[0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0]),
        floats(&[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]),
        vec![0, 1, 2, 0, 2, 3, 2, 0],
        floats(&[1.0, 0.5, -1.0]),
        image(),
    ]
    .concat();
    let start = bin.len() - image().len();
    let text = include_str!("everything.gltf")
        .replace("\"START\"", &start.to_string())
        .replace("\"LENGTH\"", &image().len().to_string())
        .replace("\"BYTES\"", &bin.len().to_string());
    let mut json = text.replace("\"uri\": \"everything.bin\",", "").into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut padded = bin.clone();
    padded.resize(bin.len().next_multiple_of(4), 0);
    let word = |n: usize| (n as u32).to_le_bytes();
    let chunk = |kind: &[u8], data: &[u8]| [&word(data.len()), kind, data].concat();
    let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &padded)].concat();
    let glb = [b"glTF\x02\0\0\0", &word(chunks.len() + 12)[..], &chunks].concat();
    vec![("everything.gltf", text.into()), ("everything.bin", bin), ("everything.glb", glb)]
}

/// A PNG of two texels.
fn image() -> Vec<u8> {
    let image = image::RgbaImage::from_fn(2, 1, |x, _| image::Rgba([200, 100, 50, 255 * x as u8]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("bytes take it");
    bytes.into_inner()
}

/// Loads the first or the last of the files of glTF, as far as it can be.
fn load_gltf(files: &[(&str, Vec<u8>)], last: bool) -> Result<Vec<String>, String> {
    let files: Vec<_> = files.iter().map(|(name, bytes)| (*name, bytes.as_slice())).collect();
    let folder = common::folder(&files);
    let path = folder.path().join(if last { files[2].0 } else { files[0].0 });
    let options = scene::Options { definitions: Vec::new(), lenient: true, no_external: true };
    let loaded = scene::load_with(&path, &options).map_err(|e| e.to_string())?;
    assert!(loaded.scene.accel.n_primitives() > 0);
    Ok(loaded.warnings)
}

#[test]
fn whole_files_of_gltf_load() {
    for last in [false, true] {
        let warnings = load_gltf(&gltf_files(), last).unwrap();
        assert!(warnings.is_empty(), "{warnings:?}");
    }
}

#[test]
fn whole_files_load() {
    let loaded = load(&files()).unwrap();
    assert_eq!(loaded.scene.accel.n_primitives(), 4 + 4 + 4 + 2 + 12 + 1);
    let mut big_endian = files();
    big_endian[4].1 = binary_ply(
        |mut b| {
            b.reverse();
            b
        },
        "binary_big_endian",
    );
    assert_eq!(load(&big_endian).unwrap().scene.inventory(), loaded.scene.inventory());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, rng_seed: RngSeed::Fixed(0), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files_give_one_line_or_a_scene(
        which in 0_usize..6,
        damages in proptest::collection::vec(damage(), 1..5),
    ) {
        let mut files = files();
        for damage in &damages {
            apply(damage, &mut files[which].1);
        }
        match load(&files) {
            Ok(loaded) => {
                prop_assert!(loaded.scene.accel.n_primitives() > 0);
                prop_assert!(loaded.warnings.iter().all(|w| !w.chars().any(char::is_control)), "{:?}", loaded.warnings);
            }
            Err(message) => {
                prop_assert!(!message.chars().any(char::is_control), "{message:?}");
            }
        }
    }

    #[test]
    fn damaged_files_of_gltf_give_one_line_or_a_scene(
        which in 0_usize..3,
        damages in proptest::collection::vec(damage(), 1..5),
    ) {
        let mut files = gltf_files();
        for damage in &damages {
            apply(damage, &mut files[which].1);
        }
        match load_gltf(&files, which == 2) {
            Ok(warnings) => {
                prop_assert!(warnings.iter().all(|w| !w.chars().any(char::is_control)), "{warnings:?}");
            }
            Err(message) => prop_assert!(!message.chars().any(char::is_control), "{message:?}"),
        }
    }
}
