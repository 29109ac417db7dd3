//! Rough surfaces: sampling, values and densities agree, light goes both ways alike, and none is made.

use std::f64::consts::PI;

use base::{Rgb, Rng, Stream, math, warp};
use geometry::{MaterialId, Surface};
use glam::{Vec2, Vec3A};
use scene::{Coat, Lobe, Material, Specular, Transport};

fn rng(index: u64) -> Rng {
    Rng::new(0, Stream::Test, index)
}

fn surface(shading_normal: Vec3A) -> Surface {
    Surface {
        position: Vec3A::ZERO,
        geometric_normal: Vec3A::Z,
        shading_normal,
        material: MaterialId(0),
        object: 0,
        primitive: 0,
        error: 0.0,
    }
}

fn material(specular: Specular, roughness: f32) -> Material {
    Material { specular, roughness, ..Material::black("m") }
}

fn white(roughness: f32) -> Material {
    material(Specular::Mirror { reflectance: Rgb::ONE }, roughness)
}

fn gold(roughness: f32) -> Material {
    let (eta, k) = (Rgb::new(0.18, 0.42, 1.37), Rgb::new(3.42, 2.35, 1.77));
    material(Specular::Metal { eta, k }, roughness)
}

fn glass(ior: f32, roughness: f32) -> Material {
    material(Specular::Glass { ior, absorption: Rgb::BLACK }, roughness)
}

fn plastic(roughness: f32) -> Material {
    let coat = Coat::new(1.5, Rgb::new(1.0, 0.8, 0.6), false, roughness);
    Material { albedo: Rgb::ONE, ..material(Specular::Coat(coat), roughness) }
}

fn direction(degrees: f32) -> Vec3A {
    let (sin, cos) = math::sin_cos(degrees.to_radians());
    Vec3A::new(0.8 * sin, 0.6 * sin, cos)
}

fn lobe(material: &Material, w_o: Vec3A) -> Lobe {
    material.lobe(&surface(Vec3A::Z), w_o, Transport::Radiance).expect("it is rough")
}

/// Counts of sampled directions against the integral of the density over bins of the sphere.
fn assert_chi_square(what: &str, lobe: &Lobe) {
    const N: usize = 200_000;
    const ROWS: usize = 40;
    const COLUMNS: usize = 24;
    const FINE: usize = 16;
    let mut rng = rng(1);
    let mut counts = vec![0.0; ROWS * COLUMNS];
    let mut lost = 0.0;
    for _ in 0..N {
        match lobe.sample(rng.next_2d(), rng.next_f32()) {
            None => lost += 1.0,
            Some(sample) => {
                let row = (math::acos(sample.dir.z) / std::f32::consts::PI * ROWS as f32) as usize;
                let angle = math::atan2(sample.dir.y, sample.dir.x) / std::f32::consts::TAU + 0.5;
                let column = (angle * COLUMNS as f32) as usize;
                counts[row.min(ROWS - 1) * COLUMNS + column.min(COLUMNS - 1)] += 1.0;
            }
        }
    }
    let mut expected = vec![0.0; ROWS * COLUMNS];
    for y in 0..ROWS * FINE {
        let (r, z) = (PI * (y as f64 + 0.5) / (ROWS * FINE) as f64).sin_cos();
        for x in 0..COLUMNS * FINE {
            let phi = ((x as f64 + 0.5) / (COLUMNS * FINE) as f64 - 0.5) * 2.0 * PI;
            let dir = Vec3A::new((r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32);
            if let Some(value) = lobe.evaluate(dir) {
                expected[y / FINE * COLUMNS + x / FINE] += f64::from(value.pdf) * r;
            }
        }
    }
    let solid_angle = 2.0 * PI * PI / (ROWS * COLUMNS * FINE * FINE) as f64;
    expected.iter_mut().for_each(|e| *e *= solid_angle * N as f64);
    let all = expected.iter().sum::<f64>() + lost;
    assert!((all / N as f64 - 1.0).abs() < 0.004, "{what}: density and losses add up to {all}");
    // Bins that expect little are put together.
    let (mut chi2, mut n, mut rest) = (0.0, 0.0_f64, (0.0, 0.0));
    for (&count, &e) in counts.iter().zip(&expected) {
        if e < 10.0 {
            rest = (rest.0 + count, rest.1 + e);
        } else {
            // The integral is a sum of few terms where the density is steep.
            chi2 += (count - e).powi(2) / (e + (0.004 * e).powi(2));
            n += 1.0;
        }
    }
    if rest.1 > 5.0 {
        chi2 += (rest.0 - rest.1).powi(2) / rest.1;
        n += 1.0;
    }
    assert!(n > 5.0, "{what}: only {n} bins");
    // Of a sound sampler one in 30,000 lies beyond.
    let limit = n + 4.0 * (2.0 * n).sqrt() + 6.0;
    assert!(chi2 < limit, "{what}: chi-square {chi2:.1} of {n} bins, at most {limit:.1}");
}

#[test]
fn directions_are_chosen_by_their_density() {
    for roughness in [0.45, 0.7, 1.0] {
        for degrees in [0.0, 40.0, 75.0, 105.0, 140.0] {
            let w_o = direction(degrees);
            for (name, material) in [
                ("white", white(roughness)),
                ("gold", gold(roughness)),
                ("glass", glass(1.5, roughness)),
                ("bubble", glass(0.7, roughness)),
                ("plastic", plastic(roughness)),
            ] {
                let what = format!("{name}, roughness {roughness}, {degrees} degrees");
                assert_chi_square(&what, &lobe(&material, w_o));
            }
        }
    }
}

#[test]
fn samples_weigh_what_values_say() {
    let mut rng = rng(2);
    for roughness in [0.05, 0.3, 1.0] {
        for material in [
            white(roughness),
            gold(roughness),
            glass(1.5, roughness),
            glass(0.7, roughness),
            plastic(roughness),
        ] {
            let (mut transmitted, mut n) = (0, 0);
            for _ in 0..3000 {
                let w_o = warp::uniform_sphere(rng.next_2d());
                let normal = warp::uniform_cone(rng.next_2d(), 0.9);
                for transport in [Transport::Radiance, Transport::Flux] {
                    let lobe =
                        material.lobe(&surface(normal), w_o, transport).expect("it is rough");
                    let Some(sample) = lobe.sample(rng.next_2d(), rng.next_f32()) else { continue };
                    assert_eq!(sample.dir.z * w_o.z < 0.0, sample.transmitted, "the wrong side");
                    // Narrow lobes grazing the surface are steeper than single precision can tell.
                    if sample.dir.dot(normal).abs() < 0.05 || w_o.dot(normal).abs() < 0.05 {
                        continue;
                    }
                    let value = lobe.evaluate(sample.dir).expect("it is rough");
                    assert_eq!(value.transmitted, sample.transmitted);
                    let tolerance = if roughness < 0.1 { 0.05 } else { 0.01 };
                    let ratio = value.pdf / sample.pdf;
                    assert!(
                        (ratio - 1.0).abs() < tolerance,
                        "{material:?} {w_o} {}: {ratio}",
                        sample.dir
                    );
                    let weight = value.value.g / value.pdf;
                    assert!((weight / sample.weight.g - 1.0).abs() < 1e-3, "{weight}, {sample:?}");
                    transmitted += u32::from(sample.transmitted);
                    n += 1;
                }
            }
            assert!(n > 3000, "{material:?}: {n}");
            assert_eq!(transmitted > 1000, material.is_glass());
        }
    }
}

/// Scattering per steradian, without the cosine.
fn scattering(material: &Material, w_o: Vec3A, w_i: Vec3A, transport: Transport) -> f32 {
    let lobe = material.lobe(&surface(Vec3A::Z), w_o, transport).expect("it is rough");
    lobe.evaluate(w_i).map_or(0.0, |v| v.value.g / w_i.z.abs())
}

#[test]
fn light_goes_both_ways_alike() {
    let mut rng = rng(3);
    let glasses = [glass(1.5, 0.4), glass(1.5, 1.0), glass(0.7, 0.6)];
    let others = [white(0.4), gold(0.8), plastic(0.5)];
    for material in glasses.into_iter().chain(others) {
        let index = |w: Vec3A| match material.specular {
            Specular::Glass { ior, .. } if w.z < 0.0 => ior,
            _ => 1.0,
        };
        let mut n = 0;
        for _ in 0..20_000 {
            let [a, b] = [0; 2].map(|_| warp::uniform_sphere(rng.next_2d()));
            // Radiance over the square of the index is what stays the same (Veach 1997, section 5.2).
            let there = scattering(&material, a, b, Transport::Radiance) * index(b) * index(b);
            let back = scattering(&material, b, a, Transport::Radiance) * index(a) * index(a);
            let close = |x: f32, y: f32| (x - y).abs() <= 2e-3 * x.abs().max(y.abs()) + 2e-5;
            assert!(close(there, back), "{material:?}: {there} from {a} to {b}, {back} back");
            // Photons go the way of radiance backwards.
            let flux = scattering(&material, b, a, Transport::Flux);
            let radiance = scattering(&material, a, b, Transport::Radiance);
            assert!(close(flux, radiance), "{material:?}: {flux} and {radiance}");
            n += u32::from(there > 1e-4);
        }
        assert!(n > 2000, "{material:?}: {n} of 20000 pairs");
    }
}

/// The share of flux that a white interface sends on, seen from one direction.
fn sent_on(material: &Material, w_o: Vec3A, rng: &mut Rng) -> f64 {
    const N: u32 = 4000;
    let lobe = material.lobe(&surface(Vec3A::Z), w_o, Transport::Flux).expect("it is rough");
    let sum: f64 = (0..N)
        .filter_map(|_| lobe.sample(rng.next_2d(), rng.next_f32()))
        .map(|sample| f64::from(sample.weight.g))
        .sum();
    sum / f64::from(N)
}

/// What microfacets hide from each other is lost, and nothing is ever gained. The mean over a cosine-distributed
/// hemisphere is what the documentation of `lobe.rs` says.
#[test]
fn white_furnace() {
    let mut rng = rng(4);
    for (roughness, loss) in [(0.3, 0.019), (0.5, 0.12), (0.8, 0.42), (1.0, 0.63)] {
        let material = white(roughness);
        let mut mean = 0.0;
        for i in 0..100 {
            let u = Vec2::new((i % 10) as f32 + 0.5, (i / 10) as f32 + 0.5) / 10.0;
            let share = sent_on(&material, warp::cosine_hemisphere(u), &mut rng);
            assert!(share <= 1.0 + 1e-6, "{share}");
            mean += share / 100.0;
        }
        println!("roughness {roughness}: {:.4} lost", 1.0 - mean);
        assert!((1.0 - mean - loss).abs() < 0.02 * loss + 1e-3, "roughness {roughness}: {mean}");
    }
    // Of plastic what the coat reflects and what its white base sends back through it are all the light there is, but for
    // what the facets of the coat lose on both sides.
    for (roughness, least) in [(0.1, 0.9), (0.5, 0.6), (1.0, 0.1)] {
        let material = plastic(roughness);
        let Specular::Coat(coat) = material.specular else { panic!("{material:?}") };
        for degrees in [5.0, 40.0, 70.0, 85.0] {
            let w_o = direction(degrees);
            let base = coat.albedo(Rgb::ONE).r * material.passage(w_o.z);
            let lobe = lobe(&material, w_o);
            let coat: f64 = (0..4000)
                .filter_map(|_| lobe.sample(rng.next_2d(), rng.next_f32()))
                .map(|sample| f64::from(sample.weight.r) / 4000.0)
                .sum();
            let total = coat + f64::from(base);
            let what = format!("{total} at {degrees} degrees, roughness {roughness}");
            assert!(total < 1.01 && total > least, "{what}");
        }
    }
    // Glass loses on both sides, and least where it is least rough.
    for degrees in [10.0, 60.0, 120.0, 170.0] {
        let shares = [0.1, 0.4, 1.0].map(|r| sent_on(&glass(1.5, r), direction(degrees), &mut rng));
        assert!(shares[0] > 0.99 && shares.iter().all(|s| *s <= 1.0 + 1e-6), "{shares:?}");
        assert!(shares[0] > shares[1] && shares[1] > shares[2] && shares[2] > 0.4, "{shares:?}");
    }
}

/// The least rough surfaces send nearly all light where sharp ones do.
#[test]
fn rough_becomes_sharp() {
    let w_o = direction(35.0);
    for specular in [gold(0.0).specular, glass(1.5, 0.0).specular] {
        let sharp = material(specular, 0.0);
        assert!(!sharp.is_rough() && !material(specular, 0.019).is_rough());
        let bounces = sharp.specular_bounces(&surface(Vec3A::Z), w_o, Transport::Radiance);
        let rough = lobe(&material(specular, 0.021), w_o);
        let mut rng = rng(5);
        let mut sums = [Rgb::BLACK; 2];
        for _ in 0..20_000 {
            let Some(sample) = rough.sample(rng.next_2d(), rng.next_f32()) else { continue };
            let bounce = bounces[usize::from(sample.transmitted)].expect("it is rough");
            if sample.dir.dot(bounce.dir) > 0.9998 {
                sums[usize::from(sample.transmitted)] += sample.weight / 20_000.0;
            }
        }
        for (sum, bounce) in sums.into_iter().zip(bounces) {
            let expected = bounce.map_or(Rgb::BLACK, |b| b.weight);
            let error = (sum - expected).map(f32::abs).max_channel();
            assert!(error < 0.008, "{specular:?}: {sum:?}, not {expected:?}");
        }
    }
    // Light goes straight through glass of index 1, whatever its surface.
    assert!(
        !glass(1.0, 0.5).is_rough()
            && glass(1.0, 0.5).lobe(&surface(Vec3A::Z), w_o, Transport::Flux).is_none()
    );
    let through = glass(1.0, 0.5).specular_bounces(&surface(Vec3A::Z), w_o, Transport::Flux)[1];
    assert!((through.unwrap().dir + w_o).length() < 1e-6);
}
