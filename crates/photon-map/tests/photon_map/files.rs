//! Maps in files.

use std::path::Path;

use atomic_file::Existing;
use base::{Fingerprint, Inventory, Photon, PhotonClass, Rgb, Share};
use glam::Vec3A;
use mapfile::{Error, Header, Section};
use photon_map::{
    Gather, KIND, Kernel, Metadata, PhotonMaps, PhotonSet, PhotonShard, Scratch, ShardMetadata,
    VERSION,
};
use serde::Serialize;

use crate::fields::{Field, rng};

/// Maps whose indirect photons are the given ones.
pub(crate) fn maps(indirect: PhotonSet) -> PhotonMaps {
    let mut metadata = Metadata::default();
    metadata.inventory.add("mesh `box`", Fingerprint(7));
    metadata.emitted = 1000;
    metadata.flux = Rgb::new(1.0, 2.0, 3.0);
    PhotonMaps { metadata, direct: None, caustic: PhotonSet::build(&[]), indirect, focused: None }
}

fn save(maps: &PhotonMaps, path: &Path) -> Vec<u8> {
    maps.save(path, Existing::Replace, "tests 1", "make it anew").expect("the folder is ours");
    std::fs::read(path).expect("it was just written")
}

/// Three photons, which every version of the layout must hold.
fn three() -> Vec<Photon> {
    let photon = |i: u16| Photon {
        position: [f32::from(i), 0.5, -2.0].into(),
        normal: 0x1234 + i,
        flux: Rgb::new(1.0, 0.5, 0.25 * f32::from(i)),
    };
    (0..3).map(photon).collect()
}

/// Checks that a file which was just written is the golden one, and that this can be opened.
fn assert_golden<T>(path: &Path, golden: &[u8], open: impl Fn(&Path) -> Result<T, Error>) -> T {
    let is_same = std::fs::read(path).expect("the folder is ours") == golden;
    assert!(is_same, "raise the version of {} with any change of layout", path.display());
    std::fs::write(path, golden).expect("the folder is ours");
    open(path).expect("it is of this version")
}

#[test]
fn the_layout_is_pinned() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("golden.photons");
    let mut made = maps(PhotonSet::build(&three()));
    (made.direct, made.focused) = (Some(PhotonSet::build(&three())), Some(PhotonSet::build(&[])));
    save(&made, &path);
    let (opened, _) = assert_golden(&path, include_bytes!("../golden.photons"), PhotonMaps::open);
    assert_eq!(opened.indirect.photon(2), made.indirect.photon(2));

    let about = ShardMetadata {
        share: Share::new(2, 3).unwrap(),
        metadata: made.metadata,
        emitted_by_light: vec![600, 400],
        stores_direct: true,
        stores_focused: false,
        aim: 0.25,
        made_by: "tests 1".into(),
        command_of_all: "make {file}".into(),
    };
    let path = folder.path().join("golden.shard");
    let photons = [three(), vec![], three(), vec![]];
    photon_map::save_shard(&path, Existing::Replace, about, photons, "make it anew").unwrap();
    let (opened, _) = assert_golden(&path, include_bytes!("../golden.shard"), PhotonShard::open);
    assert_eq!(opened.n_photons(PhotonClass::Indirect), 3);
}

#[test]
fn what_is_saved_is_opened_and_used_in_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.photons");
    for with_direct in [false, true] {
        let mut made = maps(PhotonSet::build(&Field::Plane.photons(5000)));
        made.caustic = PhotonSet::build(&Field::Clustered.photons(333));
        made.direct = with_direct.then(|| PhotonSet::build(&Field::Volume.photons(70)));
        let bytes = save(&made, &path);
        assert_eq!(save(&made, &path), bytes);

        let (opened, file) = PhotonMaps::open(&path).unwrap();
        assert_eq!(opened.fingerprint(), made.fingerprint());
        assert_eq!(opened.direct.is_some(), with_direct);
        assert_eq!(opened.metadata.inventory, made.metadata.inventory);
        assert_eq!((opened.metadata.emitted, opened.metadata.flux), (1000, made.metadata.flux));
        let notes = &file.header().notes;
        assert!(notes.contains(&("stored_indirect".into(), "5000".into())), "{notes:?}");
        assert!(notes.contains(&("stored_caustic".into(), "333".into())), "{notes:?}");
        // What was opened can be saved again, and is the same file.
        assert_eq!(save(&opened, &folder.path().join("b.photons")), bytes);

        let classes = |maps: &PhotonMaps| maps.sets().map(|s| s.0).collect::<Vec<_>>();
        assert_eq!(classes(&opened), classes(&made));
        let mut rng = rng(5);
        let mut scratch = Scratch::default();
        for ((_, a), (class, b)) in made.sets().zip(opened.sets()) {
            assert_eq!((a.len(), a.total_flux()), (b.len(), b.total_flux()));
            assert!((0..a.len()).all(|i| a.photon(i) == b.photon(i)));
            for kernel in Kernel::ALL {
                let gather = Gather { k: 50, max_radius: 0.3, kernel };
                for _ in 0..50 {
                    let at = rng.next_2d().extend(0.0).into();
                    let a = a.irradiance(at, Vec3A::Z, &gather, None, &mut scratch);
                    let b = b.irradiance(at, Vec3A::Z, &gather, None, &mut scratch);
                    assert_eq!(a, b, "{class:?} {kernel:?} at {at}");
                }
            }
        }
    }
}

#[test]
fn empty_sets_are_sets() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.photons");
    let made = maps(PhotonSet::build(&[]));
    save(&made, &path);
    let (opened, _) = PhotonMaps::open(&path).unwrap();
    let gather = Gather { k: 100, max_radius: 2.0, kernel: Kernel::Cone };
    for set in [&made.caustic, &opened.caustic, &opened.indirect] {
        assert!(set.is_empty());
        assert_eq!(set.total_flux(), [0.0; 3]);
        let none = set.irradiance(Vec3A::ZERO, Vec3A::Z, &gather, None, &mut Scratch::default());
        assert_eq!((none.irradiance, none.radius, none.found), (Rgb::BLACK, 2.0, 0));
        let none = set.irradiance_within(Vec3A::ZERO, Vec3A::Z, 2.0, Kernel::Cone);
        assert_eq!((none.irradiance, none.found), (Rgb::BLACK, 0));
        assert!(set.nearest(Vec3A::ZERO, Vec3A::Z, 3, 2.0).is_empty());
    }
}

#[test]
fn the_fingerprint_tells_classes_and_scenes_apart() {
    let set = PhotonSet::build(&Field::Plane.photons(100));
    let indirect = maps(set.clone());
    let mut caustic = maps(PhotonSet::build(&[]));
    caustic.caustic = set;
    assert_ne!(indirect.fingerprint(), caustic.fingerprint());
    let mut elsewhere = indirect.clone();
    elsewhere.metadata.inventory.add("light `sun`", Fingerprint(8));
    assert_ne!(indirect.fingerprint(), elsewhere.fingerprint());
}

/// The metadata as the file holds them, for files that the crate itself would never write.
#[derive(Clone, Serialize)]
struct Forged {
    inventory: Inventory,
    numbers: (u64, u32, u64, u64, u64, u64, u64),
    flux: Rgb,
    sets: Vec<(String, u64, f32)>,
}

/// The arrays of one set.
#[derive(Clone)]
struct Arrays {
    splits: Vec<f32>,
    boxes: Vec<LeafBox>,
    leaves: Vec<Leaf>,
}

/// Lower corner and steps along the axes.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct LeafBox([f32; 6]);

/// Positions, normals and fluxes.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
struct Leaf([u16; 128], [u32; 32]);

/// Opens a file, digests and all in order, with an empty set of caustic photons and these indirect ones.
fn open_forged(sets: &[(&str, u64, f32)], arrays: &Arrays) -> Result<PhotonMaps, Error> {
    let folder = tempfile::tempdir().expect("there is room for a folder");
    let path = folder.path().join("a.photons");
    let header = Header {
        kind: KIND.into(),
        version: VERSION,
        made_by: "tests".into(),
        command: "no command makes it".into(),
        inputs: Fingerprint(0),
        notes: Vec::new(),
    };
    let metadata = Forged {
        inventory: Inventory::new(),
        numbers: (0, 1, 2, 3, 4, 5, 6),
        flux: Rgb::ONE,
        sets: sets.iter().map(|s| (s.0.into(), s.1, s.2)).collect(),
    };
    let sections = [
        Section::new::<f32>("caustic.splits", &[]),
        Section::new::<LeafBox>("caustic.boxes", &[]),
        Section::new::<Leaf>("caustic.leaves", &[]),
        Section::new("indirect.splits", &arrays.splits),
        Section::new("indirect.boxes", &arrays.boxes),
        Section::new("indirect.leaves", &arrays.leaves),
    ];
    mapfile::write(&path, Existing::Refuse, &header, &metadata, &sections)
        .expect("the folder is ours");
    PhotonMaps::open(&path).map(|(maps, _)| maps)
}

const SETS: [(&str, u64, f32); 2] = [("caustic", 0, 1.0), ("indirect", 40, 1.0)];

fn forty() -> Arrays {
    let mut leaf = Leaf([0; 128], [u32::MAX; 32]);
    (0..96).for_each(|i| leaf.0[i] = i as u16 * 600);
    Arrays {
        splits: vec![0.0, 0.5],
        boxes: vec![LeafBox([0.0, 0.0, 0.0, 1e-5, 1e-5, 0.0]); 2],
        leaves: vec![leaf; 2],
    }
}

#[test]
fn well_formed_nonsense_is_refused() {
    let good = open_forged(&SETS, &forty()).unwrap();
    assert_eq!((good.indirect.len(), good.metadata.cut, good.metadata.rays), (40, 5, 6));

    let says = |sets: &[(&str, u64, f32)], arrays: &Arrays, message: &str| {
        let error = open_forged(sets, arrays).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    };
    let change = |f: &dyn Fn(&mut Arrays)| {
        let mut arrays = forty();
        f(&mut arrays);
        arrays
    };
    let differ = "the arrays of indirect photons differ in length";
    for n in [0, 1, 32, 65, 1 << 33, u64::MAX] {
        says(&[SETS[0], ("indirect", n, 1.0)], &forty(), differ);
    }
    says(&SETS, &change(&|a| a.splits.push(0.0)), differ);
    says(&SETS, &change(&|a| a.boxes.truncate(1)), differ);
    says(&SETS, &change(&|a| a.leaves.clear()), differ);

    let nowhere = "indirect photons lie at no place, or carry no number";
    for (i, x) in [(0, f32::NAN), (8, f32::INFINITY), (3, -1e-5), (10, f32::NAN), (4, 1e35)] {
        says(&SETS, &change(&|a| a.boxes[i / 6].0[i % 6] = x), nowhere);
    }
    for scale in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e37] {
        says(&[SETS[0], ("indirect", 40, scale)], &forty(), nowhere);
    }
    says(&SETS[..1], &forty(), "the set of indirect photons is missing");
    says(&SETS[1..], &forty(), "the set of caustic photons is missing");
    says(&[SETS[0], SETS[1], ("direct", 0, 1.0)], &forty(), "direct");
}

/// Planes and fluxes may be anything: searches end, and give numbers.
#[test]
fn any_planes_are_a_tree() {
    let gather = Gather { k: 10, max_radius: 5.0, kernel: Kernel::Cone };
    for plane in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1e38, f32::from_bits(3)] {
        let mut arrays = forty();
        arrays.splits = vec![plane; 2];
        let set = open_forged(&SETS, &arrays).unwrap().indirect;
        for normal in [set.photon(0).normal, Vec3A::Z] {
            let point = set.photon(5).position;
            let e = set.irradiance(point, normal, &gather, None, &mut Scratch::default());
            assert!(e.irradiance.is_finite(), "{e:?} with planes at {plane}");
        }
    }
}

#[test]
fn another_kind_of_map_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.photons");
    std::fs::write(&path, "P6 1 1 255\n...").unwrap();
    let error = PhotonMaps::open(&path).unwrap_err().to_string();
    assert!(error.contains("a.photons"), "{error}");
    assert_eq!(
        PhotonClass::ALL.map(PhotonClass::name),
        ["direct", "caustic", "indirect", "focused"]
    );
}
