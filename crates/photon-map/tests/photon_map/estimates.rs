//! The statistics of estimates on a uniform field: mean and spread are known exactly.

use base::Rgb;
use glam::{Vec3, Vec3A};
use photon_map::{Gather, Kernel, PhotonSet, Scratch};
use rayon::prelude::*;

use crate::fields::{photon, rng};

/// Photons on the unit square, which goes on periodically.
const N: usize = 100_000;
const FIELDS: u64 = 16;
/// Queries along a side.
const SIDE: usize = 40;

fn field(index: u64) -> PhotonSet {
    let mut rng = rng(index);
    let mut photons = Vec::new();
    for _ in 0..N {
        let at = rng.next_2d();
        for i in 0..9 {
            let copy = Vec3::new(at.x + (i % 3) as f32 - 1.0, at.y + (i / 3) as f32 - 1.0, 0.0);
            if copy.min_element() > -0.1 && copy.max_element() < 1.1 {
                photons.push(photon(copy, Vec3A::Z, Rgb::splat(1.0 / N as f32)));
            }
        }
    }
    PhotonSet::build(&photons)
}

/// The mean of the squared kernel over the unit disc, in units of its squared mean.
fn second_moment(kernel: Kernel) -> f64 {
    match kernel {
        Kernel::Box => 1.0,
        Kernel::Cone => (1.0 - 4.0 / 3.3 + 0.5 / 1.21) / (1.0 - 2.0 / 3.3_f64).powi(2),
        Kernel::Epanechnikov => 4.0 / 3.0,
        Kernel::Biweight => 9.0 / 5.0,
    }
}

/// Means over the queries of each field, and the relative spread of single estimates, at irradiance 1.
fn statistics(sets: &[PhotonSet], gather: &Gather) -> (Vec<f64>, f64) {
    let per_field: Vec<(f64, f64)> = (sets.par_iter())
        .map(|set| {
            let mut scratch = Scratch::default();
            let (mut sum, mut sum2) = (0.0, 0.0);
            for i in 0..SIDE * SIDE {
                let at = Vec3A::new((i % SIDE) as f32 + 0.5, (i / SIDE) as f32 + 0.5, 0.0);
                let at = at / SIDE as f32;
                let x = set.irradiance(at, Vec3A::Z, gather, None, &mut scratch).irradiance.g;
                sum += f64::from(x);
                sum2 += f64::from(x) * f64::from(x);
            }
            let n = (SIDE * SIDE) as f64;
            (sum / n, sum2 / n)
        })
        .collect();
    let means: Vec<f64> = per_field.iter().map(|f| f.0).collect();
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    let mean2 = per_field.iter().map(|f| f.1).sum::<f64>() / means.len() as f64;
    (means, (mean2 - mean * mean).sqrt() / mean)
}

#[test]
fn estimates_are_unbiased_and_as_noisy_as_theory_says() {
    let sets: Vec<PhotonSet> = (0..FIELDS).into_par_iter().map(field).collect();
    for k in [50, 150, 500] {
        for kernel in Kernel::ALL {
            let gather = Gather { k, max_radius: 0.1, kernel };
            let (means, spread) = statistics(&sets, &gather);
            let n = means.len() as f64;
            let mean = means.iter().sum::<f64>() / n;
            let sigma =
                (means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
            let what =
                format!("k {k} {kernel:?}: mean {mean:.5} +- {sigma:.5}, spread {spread:.4}");
            // Dividing all k by the area of the k-th would show k / (k - 1): the test must be able to tell.
            assert!(4.0 * sigma < 1.0 / k as f64, "{what}");
            assert!((mean - 1.0).abs() < 3.5 * sigma, "{what}");

            // The area of the k-th is Gamma-distributed, and the other k - 1 lie in it uniformly.
            let expected = (second_moment(kernel) / (k as f64 - 2.0)).sqrt();
            let independent = (FIELDS as usize * N.div_euclid(k).min(SIDE * SIDE)) as f64;
            let tolerance = 4.0 / (2.0 * independent).sqrt();
            assert!((spread / expected - 1.0).abs() < tolerance, "{what}, not {expected:.4}");
        }
    }
}

#[test]
fn a_fixed_radius_is_unbiased_too() {
    let sets: Vec<PhotonSet> = (0..4).map(field).collect();
    for kernel in Kernel::ALL {
        let (mut sum, mut n) = (0.0, 0);
        for set in &sets {
            for i in 0..SIDE * SIDE {
                let at = Vec3A::new((i % SIDE) as f32, (i / SIDE) as f32, 0.0) / SIDE as f32;
                let estimate = set.irradiance_within(at, Vec3A::Z, 0.025, kernel);
                sum += f64::from(estimate.irradiance.g);
                n += 1;
            }
        }
        // Discs cover every photon about once a field: the error is at most that of counting them.
        let mean = sum / f64::from(n);
        let sigma = second_moment(kernel).sqrt() / (4.0 * N as f64).sqrt();
        assert!((mean - 1.0).abs() < 3.5 * sigma, "{kernel:?}: {mean} +- {sigma}");
    }
}

#[test]
fn where_photons_are_few_the_largest_radius_counts() {
    let set = field(0);
    let radius = 0.01;
    let gather = Gather { k: 500, max_radius: radius, kernel: Kernel::Epanechnikov };
    let at = Vec3A::new(0.4, 0.3, 0.0);
    let few = set.irradiance(at, Vec3A::Z, &gather, None, &mut Scratch::default());
    let within = set.irradiance_within(at, Vec3A::Z, radius, Kernel::Epanechnikov);
    assert!(few.found < gather.k, "{few:?}");
    assert_eq!((few.irradiance, few.radius), (within.irradiance, radius));
    assert_eq!(few.found, within.found);
}
