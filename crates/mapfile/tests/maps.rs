//! What is written is read, whatever else is there is refused.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use atomic_file::Existing;
use base::{Fingerprint, Inventory};
use bytemuck::{Pod, Zeroable};
use mapfile::{Error, Header, MapFile, Section, read_header, write};
use proptest::prelude::*;
use serde::{Deserialize, Serialize};

/// A kind of map with a bit of everything.
const KIND: &str = "example map";
const VERSION: u32 = 3;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Metadata {
    name: String,
    bounds: [[f32; 3]; 2],
    seed: Option<u64>,
    inputs: Inventory,
}

#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct Photon {
    position: [f32; 3],
    flux: u32,
    direction: [u8; 4],
}

#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
struct Line([u64; 8]);

fn header() -> Header {
    Header {
        kind: KIND.into(),
        version: VERSION,
        made_by: "mapfile-tests 0.1.0".into(),
        command: "make-map \"a scene.toml\" -o a.map --force".into(),
        inputs: inventory().fingerprint(),
        notes: vec![("stored".into(), "3".into()), ("emitted".into(), "5".into())],
    }
}

fn inventory() -> Inventory {
    let mut inventory = Inventory::new();
    inventory.add("mesh `box`", Fingerprint(7));
    inventory.add("light 0", Fingerprint(8));
    inventory
}

fn metadata() -> Metadata {
    Metadata {
        name: "Ümlaut".into(),
        bounds: [[-1.0, 0.0, -0.5], [1.0, 2.0, 0.5]],
        seed: Some(1 << 40),
        inputs: inventory(),
    }
}

fn photons() -> [Photon; 3] {
    [0, 1, 2].map(|i| Photon {
        position: [i as f32, 0.5, -1.25],
        flux: 0x0102_0304 * i,
        direction: [i as u8, 255, 0, 9],
    })
}

fn write_example(path: &Path) {
    let photons = photons();
    let sections = [
        Section::new("photons", &photons),
        Section::new::<f64>("nothing", &[]),
        Section::new("flags", b"abcde"),
    ];
    write(path, Existing::Refuse, &header(), &metadata(), &sections).expect("the folder is ours");
}

/// The bytes of the example.
static EXAMPLE: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let scratch = Scratch::new();
    write_example(&scratch.path);
    fs::read(&scratch.path).expect("it was just written")
});

fn open(path: &Path) -> Result<(MapFile, Metadata), Error> {
    MapFile::open(path, KIND, VERSION)
}

/// A file for one version of a map after the other.
struct Scratch {
    _folder: tempfile::TempDir,
    path: PathBuf,
}

impl Scratch {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("there is room for a folder");
        Self { path: folder.path().join("a.map"), _folder: folder }
    }

    fn open(&self, bytes: &[u8]) -> Result<(MapFile, Metadata), Error> {
        // A new file, since some systems wait for the disk when an old one is cut to nothing.
        let _ = fs::remove_file(&self.path);
        fs::write(&self.path, bytes).expect("the folder is ours");
        open(&self.path)
    }
}

#[test]
fn what_is_written_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.map");
    let floats: Vec<f32> = (0..1000).map(|i| i as f32 * 0.1).collect();
    let lines = [Line([1, 2, 3, 4, 5, 6, 7, u64::MAX]), Line([0; 8])];
    let photons = photons();
    let sections = [
        Section::new("photons", &photons),
        Section::new("u8", &[1_u8, 2, 3]),
        Section::new("u16", &[1_u16, 2, 65535]),
        Section::new("nothing", &[] as &[u64]),
        Section::new("i64", &[i64::MIN, -1]),
        Section::new("lines", &lines),
        Section::new("floats", &floats),
        Section::new("", &[[1_u32, 2, 3]]),
        Section::new("nothing at the end", &[] as &[Line]),
    ];
    let bytes = write(&path, Existing::Refuse, &header(), &metadata(), &sections).unwrap();
    assert_eq!(bytes, fs::metadata(&path).unwrap().len());

    let (map, read) = open(&path).unwrap();
    assert_eq!(read, metadata());
    assert_eq!(*map.header(), header());
    assert_eq!(*map.array::<Photon>("photons").unwrap(), photons);
    assert_eq!(*map.array::<u8>("u8").unwrap(), [1, 2, 3]);
    assert_eq!(*map.array::<u16>("u16").unwrap(), [1, 2, 65535]);
    assert_eq!(*map.array::<i64>("i64").unwrap(), [i64::MIN, -1]);
    assert_eq!(*map.array::<Line>("lines").unwrap(), lines);
    assert_eq!(*map.array::<f32>("floats").unwrap(), *floats);
    assert_eq!(*map.array::<[u32; 3]>("").unwrap(), [[1, 2, 3]]);
    assert!(map.array::<u64>("nothing").unwrap().is_empty());
    assert!(map.array::<Line>("nothing at the end").unwrap().is_empty());

    // In place, and alive for as long as anyone looks.
    let floats_again = map.array::<f32>("floats").unwrap().clone();
    assert_eq!(floats_again.as_ptr() as usize % 64, 0);
    drop(map);
    fs::remove_file(&path).unwrap();
    assert!(floats_again.is_in_file());
    assert_eq!(*floats_again, *floats);
}

#[test]
fn a_map_may_have_no_arrays() {
    let scratch = Scratch::new();
    write(&scratch.path, Existing::Refuse, &header(), &metadata(), &[]).unwrap();
    assert_eq!(open(&scratch.path).unwrap().1, metadata());
}

#[test]
fn arrays_are_taken_for_what_they_are() {
    let scratch = Scratch::new();
    write_example(&scratch.path);
    let (map, _) = open(&scratch.path).unwrap();
    let says = |error: Error, what: &str| {
        let path = scratch.path.display();
        let remedy = "make it anew with: make-map \"a scene.toml\" -o a.map --force";
        assert_eq!(error.to_string(), format!("{path} is damaged: {what}; {remedy}"));
    };
    says(map.array::<u8>("tree").unwrap_err(), "it has no section `tree`");
    says(
        map.array::<u8>("photons").unwrap_err(),
        "elements of `photons` have 20 bytes instead of 1",
    );
    says(map.corrupt("photon 2 is outside"), "photon 2 is outside");
}

#[test]
fn other_files_are_told_apart() {
    let scratch = Scratch::new();
    write_example(&scratch.path);
    let path = scratch.path.display();
    let error = MapFile::open::<Metadata>(&scratch.path, "cache map", VERSION).unwrap_err();
    assert_eq!(
        error.to_string(),
        format!(
            "{path} is of kind `example map`, not `cache map`; it was made with: {}",
            header().command
        )
    );
    for (expected, age) in [(VERSION - 1, "newer"), (VERSION + 1, "older")] {
        let error = MapFile::open::<Metadata>(&scratch.path, KIND, expected).unwrap_err();
        assert!(matches!(error, Error::OtherVersion { found: VERSION, .. }), "{error}");
        assert!(error.to_string().contains(age), "{error}");
    }
    for text in ["", "#", "#?tetralux-map", "PNG", "#?RADIANCE\n\n"] {
        let error = scratch.open(text.as_bytes()).unwrap_err();
        assert!(matches!(error, Error::NotAMap { .. }), "{error}");
    }
    let missing = scratch.path.with_extension("missing");
    assert!(matches!(open(&missing), Err(Error::Read { .. })));
    assert!(matches!(read_header(&missing), Err(Error::Read { .. })));
    let folder = scratch.path.parent().unwrap();
    assert!(matches!(open(folder), Err(Error::Read { .. })));
    // Another layout under the same version.
    scratch.open(&EXAMPLE).unwrap();
    let error = MapFile::open::<[[u64; 32]; 32]>(&scratch.path, KIND, VERSION).unwrap_err();
    assert!(error.to_string().contains("the metadata makes no sense"), "{error}");
    let error = MapFile::open::<u64>(&scratch.path, KIND, VERSION).unwrap_err();
    assert!(error.to_string().contains("something follows the metadata"), "{error}");
}

#[test]
fn headers_of_any_kind_are_read() {
    let scratch = Scratch::new();
    write_example(&scratch.path);
    assert_eq!(read_header(&scratch.path).unwrap(), header());
    // The header is whole, whatever happened to the rest.
    let bytes = fs::read(&scratch.path).unwrap();
    let end = bytes.windows(2).position(|pair| pair == b"\n\n").unwrap() + 2;
    fs::write(&scratch.path, &bytes[..end]).unwrap();
    assert_eq!(read_header(&scratch.path).unwrap(), header());
    assert!(open(&scratch.path).unwrap_err().to_string().contains("make it anew with: make-map"));
    fs::write(&scratch.path, &bytes[..end - 1]).unwrap();
    assert!(matches!(read_header(&scratch.path), Err(Error::Corrupt { remedy: None, .. })));
}

#[test]
fn stale_maps_say_what_changed() {
    let scratch = Scratch::new();
    write_example(&scratch.path);
    let (map, metadata) = open(&scratch.path).unwrap();
    map.check_inputs(&metadata.inputs, &inventory()).unwrap();
    let mut now = Inventory::new();
    now.add("mesh `box`", Fingerprint(9));
    now.add("light 0", Fingerprint(8));
    now.add("material `glass`", Fingerprint(1));
    assert_eq!(
        map.check_inputs(&metadata.inputs, &now).unwrap_err().to_string(),
        format!(
            "{} is stale: mesh `box` changed, material `glass` is new; make it anew with: {}",
            scratch.path.display(),
            header().command
        )
    );
}

#[test]
fn headers_that_could_not_be_read_are_not_written() {
    let scratch = Scratch::new();
    let long = Header { command: "x".repeat(70_000), ..header() };
    let error = write(&scratch.path, Existing::Refuse, &long, &metadata(), &[]).unwrap_err();
    assert!(matches!(error, Error::TooLarge { part: "header", .. }), "{error}");
    assert!(!scratch.path.exists());
}

#[test]
fn existing_maps_are_replaced_only_on_demand() {
    let scratch = Scratch::new();
    write_example(&scratch.path);
    let before = fs::read(&scratch.path).unwrap();
    let again = |existing| write(&scratch.path, existing, &header(), &metadata(), &[]);
    let error = again(Existing::Refuse).unwrap_err();
    assert!(matches!(error, Error::Write(atomic_file::Error::Exists { .. })), "{error}");
    assert_eq!(fs::read(&scratch.path).unwrap(), before);
    // Whoever has the old one mapped keeps it.
    let (map, _) = open(&scratch.path).unwrap();
    again(Existing::Replace).unwrap();
    assert_eq!(*map.array::<Photon>("photons").unwrap(), photons());
}

#[cfg(unix)]
#[test]
fn maps_come_through_pipes() {
    let scratch = Scratch::new();
    let made = std::process::Command::new("mkfifo").arg(&scratch.path).status().unwrap();
    assert!(made.success());
    let writer = std::thread::spawn({
        let path = scratch.path.clone();
        move || fs::write(path, &*EXAMPLE).unwrap()
    });
    let (map, metadata_read) = open(&scratch.path).unwrap();
    writer.join().unwrap();
    assert_eq!(metadata_read, metadata());
    let array = map.array::<Photon>("photons").unwrap();
    assert_eq!(*array, photons());
    assert!(array.is_in_file());
}

#[test]
fn a_map_cut_anywhere_is_refused() {
    let (scratch, bytes) = (Scratch::new(), EXAMPLE.clone());
    scratch.open(&bytes).unwrap();
    for len in 0..bytes.len() {
        let error = scratch.open(&bytes[..len]).unwrap_err();
        assert!(matches!(error, Error::NotAMap { .. } | Error::Corrupt { .. }), "{len}: {error}");
    }
    for more in [&b"\0"[..], b"\n", &[0; 64]] {
        let error = scratch.open(&[&bytes, more].concat()).unwrap_err();
        assert!(error.to_string().contains("goes on after the end of the map"), "{error}");
    }
}

#[test]
fn a_map_with_any_bit_flipped_is_refused() {
    let (scratch, mut bytes) = (Scratch::new(), EXAMPLE.clone());
    for at in 0..bytes.len() {
        for bit in 0..8 {
            bytes[at] ^= 1 << bit;
            let outcome = scratch.open(&bytes);
            assert!(outcome.is_err(), "byte {at}, bit {bit}");
            bytes[at] ^= 1 << bit;
        }
    }
    scratch.open(&bytes).unwrap();
}

#[test]
fn a_map_opened_in_part_is_verified_by_section() {
    let (scratch, mut bytes) = (Scratch::new(), EXAMPLE.clone());
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    let refusal = scratch.open(&bytes).unwrap_err().to_string();
    let (map, there) = MapFile::open_in_part::<Metadata>(&scratch.path, KIND, VERSION).unwrap();
    assert_eq!(there, metadata());
    assert_eq!(*map.array::<Photon>("photons").unwrap(), photons());
    assert_eq!(map.array::<u8>("flags").unwrap_err().to_string(), refusal);
    assert!(refusal.contains("section `flags` does not match its digest"), "{refusal}");
}

/// If this fails, maps on people's disks are no longer read: raise `FORMAT`, don't just replace the file.
#[test]
fn the_committed_map_is_read_and_written_byte_for_byte() {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden.map");
    let (map, read) = open(&golden).unwrap();
    assert_eq!(*map.header(), header());
    assert_eq!(read, metadata());
    assert_eq!(*map.array::<Photon>("photons").unwrap(), photons());
    assert_eq!(*map.array::<u8>("flags").unwrap(), *b"abcde");
    assert!(map.array::<f64>("nothing").unwrap().is_empty());
    let (expected, actual) = (fs::read(&golden).unwrap(), &*EXAMPLE);
    assert!(
        expected == *actual,
        "committed:\n{}\nwritten:\n{}",
        String::from_utf8_lossy(&expected),
        String::from_utf8_lossy(actual)
    );
}

/// Overwrites, inserts or removes a few bytes.
#[derive(Clone, Debug)]
enum Mutation {
    Overwrite(usize, Vec<u8>),
    Insert(usize, Vec<u8>),
    Remove(usize, usize),
    Move(usize, usize, usize),
}

impl Mutation {
    fn apply(&self, bytes: &mut Vec<u8>) {
        let at = |i: usize| i % (bytes.len() + 1);
        let span = |i: usize, len: usize| at(i)..(at(i) + len).min(bytes.len());
        match self {
            Self::Overwrite(i, new) => {
                let span = span(*i, new.len());
                let new = &new[..span.len()];
                bytes[span].copy_from_slice(new);
            }
            Self::Insert(i, new) => {
                let at = at(*i);
                bytes.splice(at..at, new.iter().copied());
            }
            Self::Remove(i, len) => {
                let span = span(*i, *len);
                bytes.drain(span);
            }
            Self::Move(from, len, to) => {
                let moved: Vec<u8> = bytes[span(*from, *len)].to_vec();
                Self::Overwrite(*to, moved).apply(bytes);
            }
        }
    }
}

fn mutation() -> impl Strategy<Value = Mutation> {
    let bytes = || proptest::collection::vec(any::<u8>(), 1..40);
    prop_oneof![
        (any::<usize>(), bytes()).prop_map(|(i, new)| Mutation::Overwrite(i, new)),
        (any::<usize>(), bytes()).prop_map(|(i, new)| Mutation::Insert(i, new)),
        (any::<usize>(), 1_usize..100).prop_map(|(i, len)| Mutation::Remove(i, len)),
        (any::<usize>(), 1_usize..100, any::<usize>())
            .prop_map(|(from, len, to)| Mutation::Move(from, len, to)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 2000,
        rng_seed: proptest::test_runner::RngSeed::Fixed(1),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn random_bytes_are_refused(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let scratch = Scratch::new();
        prop_assert!(scratch.open(&bytes).is_err());
        let bytes = [&b"#?tetralux-map 1\n"[..], &bytes].concat();
        prop_assert!(scratch.open(&bytes).is_err());
        prop_assert!(read_header(&scratch.path).is_err());
    }

    #[test]
    fn mutated_maps_are_refused(mutations in proptest::collection::vec(mutation(), 1..4)) {
        let (scratch, mut bytes) = (Scratch::new(), EXAMPLE.clone());
        mutations.iter().for_each(|mutation| mutation.apply(&mut bytes));
        prop_assert!(scratch.open(&bytes).is_err() || bytes == *EXAMPLE);
    }
}
