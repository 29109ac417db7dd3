//! The tree against a look at every photon.

use base::Rgb;
use glam::Vec3A;
use photon_map::{Estimate, Gather, Kernel, LEAF, PhotonSet, Scratch};

use crate::fields::{Field, rng};

const SIZES: [usize; 14] = [
    0,
    1,
    2,
    3,
    LEAF - 1,
    LEAF,
    LEAF + 1,
    2 * LEAF - 1,
    2 * LEAF,
    2 * LEAF + 1,
    3 * LEAF + 1,
    7 * LEAF,
    1000,
    3000,
];

/// Squared distance and index of the photons that count for a surface, near ones first: none whose normal differs by
/// more than the cosine 0.9, none that lies higher above the surface than a quarter of its distance.
fn scan(set: &PhotonSet, point: Vec3A, normal: Vec3A, max_radius: f32) -> Vec<(f32, u32)> {
    let mut found: Vec<(f32, u32)> = (0..set.len())
        .filter_map(|i| {
            let photon = set.photon(i);
            let d = photon.position - point;
            let height = d.dot(normal);
            let counts = d.length_squared() <= max_radius * max_radius
                && height * height <= 0.0625 * d.length_squared()
                && photon.normal.dot(normal) > 0.9;
            counts.then_some((d.length_squared(), i as u32))
        })
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    found
}

/// The weighted sum over photons, over the square of the radius.
fn sum(set: &PhotonSet, photons: &[(f32, u32)], kernel: Kernel, radius2: f32) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for &(dist2, i) in photons {
        let flux = set.photon(i as usize).flux.to_array();
        let weight = f64::from(kernel.weight(dist2 / radius2)) / f64::from(radius2);
        (0..3).for_each(|c| sum[c] += f64::from(flux[c]) * weight);
    }
    sum
}

fn assert_close(estimate: &Estimate, expected: [f64; 3], what: &str) {
    let Rgb { r, g, b } = estimate.irradiance;
    for (x, e) in [r, g, b].into_iter().zip(expected) {
        assert!((f64::from(x) - e).abs() <= 1e-5 * e, "{x}, not {e}, {what}");
    }
}

#[test]
fn finds_what_a_scan_finds() {
    let mut n_queries = 0;
    for field in Field::ALL {
        for n in SIZES {
            let photons = field.photons(n);
            let set = PhotonSet::build(&photons);
            assert_eq!((set.len(), set.is_empty()), (n, n == 0));
            let mut rng = rng(n as u64);
            for _ in 0..110 {
                let (point, normal) = field.query(&photons, &mut rng);
                let k = [1, 2, 10, 100, 4000][rng.next_u32() as usize % 5];
                let max_radius = [0.01, 0.1, 0.5, 10.0][rng.next_u32() as usize % 4];
                let mut expected = scan(&set, point, normal, max_radius);
                expected.truncate(k);
                let found = set.nearest(point, normal, k, max_radius);
                assert_eq!(found, expected, "{field:?} {n} k {k} at {point} within {max_radius}");
                n_queries += 1;
            }
        }
    }
    assert!(n_queries > 10_000, "{n_queries}");
}

#[test]
fn estimates_are_sums_over_what_a_scan_finds_whatever_the_guess() {
    let mut scratch = Scratch::default();
    for field in Field::ALL {
        for n in SIZES {
            let photons = field.photons(n);
            let set = PhotonSet::build(&photons);
            let mut rng = rng(1000 + n as u64);
            for i in 0..40 {
                let (point, normal) = field.query(&photons, &mut rng);
                let gather = Gather {
                    k: [2, 3, 10, 100, 1000][i % 5],
                    max_radius: [0.02, 0.3, 10.0][i % 3],
                    kernel: Kernel::ALL[i % 4],
                };
                let all = scan(&set, point, normal, gather.max_radius);
                let what = format!("{field:?} {n} {gather:?} at {point}");
                let guess = 0.3 * rng.next_f32();
                let first = set.irradiance(point, normal, &gather, None, &mut scratch);

                let full = all.len() >= gather.k;
                let max_radius2 = gather.max_radius * gather.max_radius;
                let radius2 = if full { all[gather.k - 1].0 } else { max_radius2 };
                let radius = radius2.sqrt();
                assert_eq!(first.radius, radius, "{what}");
                assert_eq!(first.found, all.len().min(gather.k), "{what}");
                if radius > 0.0 && !matches!(field, Field::Ties | Field::Equal) {
                    let within = if full { &all[..gather.k - 1] } else { &all };
                    assert_close(&first, sum(&set, within, gather.kernel, radius2), &what);
                }
                let hints = [0.0, 1e-30, 0.5 * radius, radius, 3.0 * radius, f32::INFINITY, guess];
                for hint in hints {
                    let again = set.irradiance(point, normal, &gather, Some(hint), &mut scratch);
                    assert_eq!(
                        (again.irradiance, again.radius, again.found),
                        (first.irradiance, first.radius, first.found),
                        "{what}, guess {hint}"
                    );
                }
            }
        }
    }
}

#[test]
fn estimates_within_a_radius_are_sums_over_what_a_scan_finds() {
    for field in Field::ALL {
        for n in SIZES {
            let photons = field.photons(n);
            let set = PhotonSet::build(&photons);
            let mut rng = rng(2000 + n as u64);
            for i in 0..40 {
                let (point, normal) = field.query(&photons, &mut rng);
                let radius = [0.001, 0.02, 0.3, 10.0][i % 4];
                let kernel = Kernel::ALL[i / 4 % 4];
                let mut all = scan(&set, point, normal, radius);
                all.retain(|photon| photon.0 < radius * radius);
                let what = format!("{field:?} {n} {kernel:?} at {point} within {radius}");
                let found = set.irradiance_within(point, normal, radius, kernel);
                assert_eq!((found.found, found.radius), (all.len(), radius), "{what}");
                let mut each = Vec::new();
                set.each_within(point, normal, f32::INFINITY, radius, |dist2, i| {
                    each.push((dist2, i as u32));
                });
                each.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                assert_eq!(each, all, "{what}");
                assert_close(&found, sum(&set, &all, kernel, radius * radius), &what);
            }
        }
    }
}

#[test]
fn the_nearest_one_is_the_first_that_a_scan_finds() {
    let mut n_found = 0;
    for field in Field::ALL {
        for n in SIZES {
            let photons = field.photons(n);
            let set = PhotonSet::build(&photons);
            let mut rng = rng(3000 + n as u64);
            for i in 0..60 {
                let (point, normal) = field.query(&photons, &mut rng);
                let max_radius = [0.02, 0.3, 10.0][i % 3];
                let all = scan(&set, point, normal, max_radius);
                let found = set.nearest_one(point, normal, max_radius);
                // Of photons at equal distances any will do.
                let mut nearest = all.iter().take_while(|photon| photon.0 == all[0].0);
                match found {
                    None => assert_eq!(nearest.next(), None, "{field:?} {n} at {point}"),
                    Some(i) => {
                        assert!(nearest.any(|p| p.1 as usize == i), "{field:?} {n} at {point}");
                    }
                }
                n_found += usize::from(found.is_some());
            }
        }
    }
    assert!(n_found > 2000, "{n_found}");
}

/// Photons at the distance of number `k` are more than one: `k - 1` in all are summed, no matter which.
#[test]
fn of_equal_distances_no_more_than_k_count() {
    let set = PhotonSet::build(&Field::Ties.photons(900));
    let mut scratch = Scratch::default();
    let (point, normal) = (Vec3A::new(0.5, 0.5, 0.0), Vec3A::Z);
    let gather = Gather { k: 250, max_radius: 1.0, kernel: Kernel::Box };
    let estimate = set.irradiance(point, normal, &gather, None, &mut scratch);
    assert_eq!((estimate.radius, estimate.found), (0.125, 250));
    let mean = set.total_flux()[0] / 900.0;
    let expected = 249.0 * mean / (std::f64::consts::PI * 0.125 * 0.125);
    let ratio = f64::from(estimate.irradiance.r) / expected;
    assert!((ratio - 1.0).abs() < 0.03, "{ratio}");

    // All at one place: there is no area to spread them over.
    let set = PhotonSet::build(&Field::Equal.photons(900));
    let point = set.photon(0).position;
    let estimate = set.irradiance(point, normal, &gather, None, &mut scratch);
    assert_eq!((estimate.irradiance, estimate.radius), (Rgb::BLACK, 0.0));
    let estimate = set.irradiance_within(point, normal, 0.0, Kernel::Cone);
    assert_eq!((estimate.irradiance, estimate.found), (Rgb::BLACK, 0));
}
