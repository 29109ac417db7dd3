//! Photons count for the surface on which they landed, and for no other.

use base::{Photon, Rgb};
use glam::{Vec3, Vec3A};
use photon_map::{Gather, Kernel, PhotonSet, Scratch};

use crate::fields::{photon, rng};

const RED: Rgb = Rgb::new(1.0, 0.0, 0.0);
const GREEN: Rgb = Rgb::new(0.0, 1.0, 0.0);

/// Photons on a unit square, spanned from `corner` by the axes other than that of the normal.
fn sheet(seed: u64, corner: Vec3, normal: Vec3A, flux: Rgb) -> Vec<Photon> {
    let mut rng = rng(seed);
    (0..20_000)
        .map(|_| {
            let u = rng.next_2d();
            let (s, t) = if normal.z.abs() > 0.5 { (Vec3::X, Vec3::Y) } else { (Vec3::Y, Vec3::Z) };
            photon(corner + s * u.x + t * u.y, normal, flux)
        })
        .collect()
}

/// Irradiance at points of z = 0 that faces up, from red photons on it and green ones elsewhere.
fn check(other: Vec<Photon>, max_radius: f32) {
    let own = sheet(1, Vec3::ZERO, Vec3A::Z, RED);
    let alone = PhotonSet::build(&other);
    let both = PhotonSet::build(&[own, other].concat());
    let mut scratch = Scratch::default();
    let mut rng = rng(3);
    for i in 0..500 {
        let mut point = rng.next_2d().extend(0.0);
        // Half of them close to the edge x = 0.
        if i % 2 == 0 {
            point.x *= 0.01;
        }
        for kernel in Kernel::ALL {
            let gather = Gather { k: 100, max_radius, kernel };
            let here = (point.into(), Vec3A::Z);
            let none = alone.irradiance(here.0, here.1, &gather, None, &mut scratch);
            assert_eq!((none.irradiance, none.found), (Rgb::BLACK, 0), "at {point}");
            assert_eq!(none.radius, max_radius);
            let none = alone.irradiance_within(here.0, here.1, max_radius, kernel);
            assert_eq!((none.irradiance, none.found), (Rgb::BLACK, 0), "at {point}");
            let some = both.irradiance(here.0, here.1, &gather, None, &mut scratch).irradiance;
            assert!(some.r > 0.0 && some.g == 0.0 && some.b == 0.0, "{some:?} at {point}");
        }
    }
}

#[test]
fn the_far_side_of_a_sheet_counts_for_nothing() {
    check(sheet(2, Vec3::ZERO, -Vec3A::Z, GREEN), 0.2);
}

#[test]
fn the_far_side_of_a_thin_wall_counts_for_nothing() {
    check(sheet(2, Vec3::new(0.0, 0.0, -1e-3), -Vec3A::Z, GREEN), 0.2);
}

#[test]
fn a_wall_around_a_corner_counts_for_nothing() {
    check(sheet(2, Vec3::ZERO, Vec3A::X, GREEN), 0.2);
    check(sheet(2, Vec3::ZERO, -Vec3A::X, GREEN), 0.2);
}

/// The height of a step is measured against the distance: photons count from four heights on.
#[test]
fn a_parallel_surface_counts_for_nothing_nearby() {
    for height in [0.05, -0.05] {
        check(sheet(2, Vec3::new(0.0, 0.0, height), Vec3A::Z, GREEN), 3.99 * 0.05);
    }
}

/// Half of the neighborhood is empty at an edge: the estimate halves, and nothing else happens.
#[test]
fn at_an_edge_half_remains() {
    let set = PhotonSet::build(&sheet(1, Vec3::ZERO, Vec3A::Z, RED));
    let mut sum = 0.0;
    for i in 0..100 {
        let point = Vec3A::new(0.0, 0.1 + 0.008 * i as f32, 0.0);
        sum += set.irradiance_within(point, Vec3A::Z, 0.05, Kernel::Epanechnikov).irradiance.r;
    }
    let mean = sum / 100.0 / 20_000.0;
    assert!((mean - 0.5).abs() < 0.04, "{mean}");
}
