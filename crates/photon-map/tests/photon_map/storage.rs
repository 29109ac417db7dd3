//! What is lost when photons are packed.

use base::{Photon, Rgb};
use glam::{Vec3, Vec3A};
use photon_map::{LEAF, PhotonMaps, PhotonSet};

use crate::fields::{Field, rng};
use crate::files::maps;

/// A flux that is stored exactly and tells the index: mantissas of nine bits, the first with its highest bit set.
fn flux_of_index(i: usize) -> Rgb {
    Rgb::new((256 + i % 255) as f32, (i / 255 % 511) as f32, (i / 255 / 511) as f32)
}

fn index_of_flux(flux: Rgb) -> usize {
    flux.r as usize - 256 + 255 * (flux.g as usize + 511 * flux.b as usize)
}

#[test]
fn positions_are_rounded_within_the_box_of_their_leaf() {
    for field in Field::ALL {
        for n in [1, LEAF - 1, LEAF + 1, 10_001] {
            let mut photons = field.photons(n);
            photons.iter_mut().enumerate().for_each(|(i, p)| p.flux = flux_of_index(i));
            // The largest flux that can be packed is stored as it is, and so are all others.
            photons[n - 1].flux = Rgb::splat(65408.0);
            let set = PhotonSet::build(&photons);
            let original = |i: usize| {
                let flux = set.photon(i).flux;
                if flux.r == 65408.0 { photons[n - 1] } else { photons[index_of_flux(flux)] }
            };
            let mut seen = vec![false; n];
            for first in (0..n).step_by(LEAF) {
                let leaf = first..n.min(first + LEAF);
                let (min, max) = (leaf.clone())
                    .map(|i| original(i).position)
                    .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| {
                        (low.min(p), high.max(p))
                    });
                for i in leaf {
                    let (stored, given) = (set.photon(i), original(i));
                    let position = Vec3::from(stored.position);
                    let what = format!("{field:?} {n}: {} became {position}", given.position);
                    // A step of the box, and the last digit of the coordinate.
                    let step = (max - min) / 65535.0 + position.abs() * f32::EPSILON;
                    assert!((position - given.position).abs().cmple(step).all(), "{what}");
                    assert!(position.cmpge(min).all() && position.cmple(max).all(), "{what}");
                    assert_eq!(stored.normal, base::decode_octahedral(given.normal));
                    let index = photons.iter().position(|p| p.flux == given.flux).unwrap();
                    assert!(!seen[index], "{what}, twice");
                    seen[index] = true;
                }
            }
            assert!(seen.iter().all(|s| *s), "{field:?} {n}");
        }
    }
}

#[test]
fn the_same_photons_make_the_same_tree_on_any_number_of_threads() {
    let photons = Field::Clustered.photons(50_000);
    let build = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        maps(pool.install(|| PhotonSet::build(&photons))).fingerprint()
    };
    let expected = build(1);
    for n_threads in [1, 2, 3] {
        assert_eq!(build(n_threads), expected, "{n_threads} threads");
    }
    let fewer = maps(PhotonSet::build(&photons[1..]));
    assert_ne!(fewer.fingerprint(), expected);
}

/// Photons of a class often carry one of few values: rounding must not pull all of them the same way.
#[test]
fn flux_is_kept() {
    let total = |photons: &[Photon]| {
        let sum = |f: fn(Rgb) -> f32| photons.iter().map(|p| f64::from(f(p.flux))).sum::<f64>();
        [sum(|f| f.r), sum(|f| f.g), sum(|f| f.b)]
    };
    let check = |photons: &[Photon], what: &str| {
        let (stored, given) = (PhotonSet::build(photons).total_flux(), total(photons));
        for (stored, given) in stored.into_iter().zip(given) {
            assert!((stored / given - 1.0).abs() < 1e-4, "{stored}, not {given}: {what}");
        }
    };
    let mut photons = Field::Plane.photons(100_000);
    check(&photons, "many values");
    for (a, b) in [(1.0, 0.5029), (3e-7, 1.7e-7), (2e9, 1.003e9)] {
        for (i, p) in photons.iter_mut().enumerate() {
            p.flux = Rgb::new(a, b, b * 0.503) * if i % 3 == 0 { 1.0 } else { 0.503 };
        }
        check(&photons, "few values");
    }
}

#[test]
fn a_million_photons_take_sixteen_bytes_each_at_most() {
    let n = 1_000_000;
    let mut rng = rng(7);
    let photons: Vec<Photon> = (0..n)
        .map(|_| crate::fields::photon(rng.next_2d().extend(0.0), Vec3A::Z, Rgb::ONE))
        .collect();
    let maps = maps(PhotonSet::build(&photons));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.photons");
    let bytes = maps.save(&path, atomic_file::Existing::Refuse, "tests", "").unwrap();
    assert_eq!(bytes, std::fs::metadata(&path).unwrap().len());
    let each = [maps.indirect.n_bytes(), bytes as usize].map(|b| b as f64 / f64::from(n));
    assert!(each[0] <= 13.0 && each[1] <= 13.0, "{each:?} bytes a photon");
    let (opened, _) = PhotonMaps::open(&path).unwrap();
    assert_eq!(opened.indirect.n_bytes(), maps.indirect.n_bytes());
}
