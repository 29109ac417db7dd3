//! Environment maps: what arrives from where, and whether directions are drawn as they should be.

use base::{Rgb, Rng, Stream, warp};
use geometry::Bounds;
use glam::{DVec3, Mat3A, Quat, Vec2, Vec3, Vec3A};
use scene::{EnvironmentMap, Light, LightKind};
use std::f64::consts::PI;

fn rng(index: u64) -> Rng {
    Rng::new(0, Stream::Test, index)
}

fn light(map: EnvironmentMap) -> Light {
    Light { name: "sky".into(), kind: LightKind::EnvironmentMap(map) }
}

fn turned() -> Mat3A {
    Mat3A::from_quat(Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.7))
}

/// Maps of many sizes with a lamp or two among dim colors.
fn maps() -> Vec<(String, Light)> {
    let mut maps = Vec::new();
    for (i, size) in [[1, 1], [1, 3], [2, 1], [5, 2], [16, 9], [64, 32]].into_iter().enumerate() {
        let mut rng = rng(i as u64);
        let mut color = || Rgb::from([0; 3].map(|_| rng.next_f32()));
        let n = (size[0] * size[1]) as usize;
        let mut texels: Vec<Rgb> = (0..n).map(|_| color() * 0.3).collect();
        texels[n / 2] = Rgb::BLACK;
        texels[n / 3] = Rgb::new(40.0, 30.0, 20.0);
        let matrix = if i % 2 == 0 { turned() } else { Mat3A::IDENTITY };
        let map = EnvironmentMap::new(size, texels.clone(), matrix);
        maps.push((format!("{size:?}"), light(map)));
        let map = EnvironmentMap::from_pole_to_pole(size, texels, matrix);
        maps.push((format!("{size:?} from pole to pole"), light(map)));
    }
    maps
}

const BINS: usize = 16;
const SUB: usize = 48;

/// Radiance, integrated over boxes of turn and height of equal solid angle.
fn bins(light: &Light) -> Vec<DVec3> {
    let side = BINS * SUB;
    let mut bins = vec![DVec3::ZERO; BINS * BINS];
    for y in 0..side {
        for x in 0..side {
            let turn = (x as f64 + 0.5) / side as f64 * 2.0 * PI;
            let height = 1.0 - 2.0 * (y as f64 + 0.5) / side as f64;
            let r = (1.0 - height * height).sqrt();
            let dir = DVec3::new(r * turn.cos(), height, r * turn.sin()).as_vec3a();
            let radiance = light.from_beyond(dir.normalize()).0.to_array().map(f64::from);
            let solid_angle = 4.0 * PI / (side * side) as f64;
            bins[y / SUB * BINS + x / SUB] += DVec3::from_array(radiance) * solid_angle;
        }
    }
    bins
}

fn bin(dir: Vec3A) -> usize {
    let turn = f64::from(dir.z).atan2(f64::from(dir.x)) / (2.0 * PI);
    let scaled = |x: f64| ((x * BINS as f64) as usize).min(BINS - 1);
    scaled((1.0 - f64::from(dir.y)) * 0.5) * BINS + scaled(turn.rem_euclid(1.0))
}

fn mean(c: Rgb) -> f64 {
    f64::from(c.mean())
}

#[test]
fn rows_may_reach_the_poles() {
    let texels = (0..6).map(|i| Rgb::splat((i / 2) as f32)).collect();
    let light = light(EnvironmentMap::from_pole_to_pole([2, 3], texels, Mat3A::IDENTITY));
    let at = |height: f32| {
        let across = (1.0 - height * height).max(0.0).sqrt();
        light.from_beyond(Vec3A::new(across, height, 0.0)).0.r
    };
    for (height, expected) in [(1.0, 0.0), (0.5, 0.5), (0.0, 1.0), (-0.25, 1.25), (-1.0, 2.0)] {
        assert!((at(height) - expected).abs() < 1e-5, "{height}: {}", at(height));
    }
}

#[test]
fn images_lie_around_the_scene_as_promised() {
    let texels = (0..8).map(|i| Rgb::splat(i as f32)).collect();
    let light = light(EnvironmentMap::new([4, 2], texels, Mat3A::IDENTITY));
    let at = |x: f32, y: f32, z: f32| light.from_beyond(Vec3A::new(x, y, z).normalize()).0.r;
    // The centers of columns lie an eighth of a turn beside the axes, those of rows 45 degrees from the poles.
    let h = 0.5_f32.sqrt();
    for (x, z, column) in [(1.0, -1.0, 0.0), (1.0, 1.0, 1.0), (-1.0, 1.0, 2.0), (-1.0, -1.0, 3.0)] {
        assert!((at(x * h, 1.0, z * h) - column).abs() < 1e-5);
        assert!((at(x * h, -1.0, z * h) - (column + 4.0)).abs() < 1e-5);
    }
    // Between the second column and the third, and halfway down; and over the seam.
    assert!((at(0.0, 0.0, 1.0) - 3.5).abs() < 1e-5);
    assert!((at(0.0, 0.0, -1.0) - 3.5).abs() < 1e-5);
    assert!((at(1.0, 0.0, 0.0) - 2.5).abs() < 1e-5);
    // Towards the poles a row goes on as it is.
    assert!((at(0.1, 1.0, 0.1) - 1.0).abs() < 1e-4);

    let to_world = Mat3A::from_quat(Quat::from_rotation_y(0.5 * std::f32::consts::PI));
    let texels = (0..8).map(|i| Rgb::splat(i as f32)).collect();
    let turned = self::light(EnvironmentMap::new([4, 2], texels, to_world));
    // A quarter turn about +y moves +z to +x.
    let dir = Vec3A::new(0.3, 0.4, 0.7).normalize();
    assert!((turned.from_beyond(to_world * dir).0.r - light.from_beyond(dir).0.r).abs() < 1e-5);
}

#[test]
fn directions_are_drawn_by_radiance() {
    const N: u32 = 200_000;
    for (name, light) in maps() {
        let expected = bins(&light);
        let total: DVec3 = expected.iter().sum();
        let LightKind::EnvironmentMap(map) = &light.kind else { panic!("it is a map") };
        let found = DVec3::from_array(map.total().to_array().map(f64::from));
        assert!(
            (found - total).abs().max_element() < 2e-3 * total.max_element(),
            "{name}: {found}"
        );

        let mut rng = rng(20);
        let mut counts = vec![0_u32; BINS * BINS];
        for _ in 0..N {
            let beam = light.beam(Vec3A::ZERO, rng.next_2d()).expect("somewhere there is light");
            counts[bin(beam.dir)] += 1;
            let (radiance, pdf) = light.from_beyond(beam.dir);
            assert!((pdf / beam.pdf - 1.0).abs() < 1e-3, "{name}: {beam:?}, not {pdf}");
            let value = beam.irradiance * beam.pdf - radiance;
            assert!(value.map(f32::abs).max_channel() < 1e-3 * radiance.max_channel(), "{name}");
            // All samples stand for the same flux.
            let stands_for = mean(beam.irradiance);
            assert!((stands_for / mean(map.total()) - 1.0).abs() < 1e-3, "{name}: {stands_for}");
        }
        let chi2: f64 = (counts.iter().zip(&expected))
            .map(|(&n, e)| {
                let e = e.element_sum() / total.element_sum() * f64::from(N);
                (f64::from(n) - e).powi(2) / e.max(5.0)
            })
            .sum();
        // 255 degrees of freedom: 99.997 % lie below 357.
        assert!(chi2 < 357.0, "{name}: chi-square {chi2}");
    }
}

#[test]
fn irradiance_is_that_of_the_hemisphere() {
    for (name, light) in maps() {
        let mut rng = rng(30);
        let LightKind::EnvironmentMap(map) = &light.kind else { panic!("it is a map") };
        let all = map.total().max_channel();
        for _ in 0..20 {
            let normal = warp::uniform_sphere(rng.next_2d()).normalize();
            let found = light.unshadowed_irradiance(Vec3A::ZERO, normal).expect("there is a table");
            // Points of a lattice, which leave little noise.
            const N: u32 = 10_000;
            let mut sum = Rgb::BLACK;
            for i in 0..N {
                let x = i as f32 / N as f32;
                let u = Vec2::new(x, (f64::from(i) * 0.618_033_988_749_895).fract() as f32);
                sum += light.sample(Vec3A::ZERO, normal, u).map_or(Rgb::BLACK, |s| s.irradiance);
            }
            let expected = sum / N as f32;
            let off = (found - expected).map(f32::abs).max_channel();
            // The table rounds off the terminator of a sun.
            assert!(off < 0.004 * all, "{name}: {found:?}, not {expected:?} of {all}");
        }
    }
    // A gray day is known in closed form.
    let gray = light(EnvironmentMap::new([8, 4], vec![Rgb::splat(2.0); 32], turned()));
    for normal in [Vec3A::Y, Vec3A::NEG_X, Vec3A::new(0.6, 0.0, 0.8)] {
        let e = mean(gray.unshadowed_irradiance(Vec3A::ZERO, normal).expect("there is a table"));
        assert!((e / (2.0 * PI) - 1.0).abs() < 2e-3, "{e}");
    }
}

#[test]
fn photons_carry_the_flux_and_cover_the_scene() {
    let bounds = Bounds { min: Vec3::new(-1.0, 2.0, 0.5), max: Vec3::new(3.0, 2.5, 1.5) };
    let radius = f64::from(bounds.diagonal()) * 0.5;
    for (name, light) in maps() {
        let expected = light.flux(&bounds);
        let mut rng = rng(40);
        let (mut sum, mut ring, n) = (Rgb::BLACK, 0, 20_000);
        for _ in 0..n {
            let e = light.emit(&bounds, [0; 4].map(|_| rng.next_f32()));
            sum += e.flux;
            let from_center = (e.origin - Vec3A::from(bounds.center())).as_dvec3();
            let along = from_center.dot(e.dir.as_dvec3());
            assert!((along + radius).abs() < 1e-4, "{name}: {e:?} starts at {along}");
            let aside = (from_center - e.dir.as_dvec3() * along).length() / radius;
            assert!(aside < 1.0 + 1e-4, "{name}: {aside}");
            ring += i32::from(aside * aside < 0.5);
            assert!((mean(e.flux) / mean(expected) - 1.0).abs() < 1e-3, "{name}: {e:?}");
        }
        let off = (sum / n as f32 - expected).map(f32::abs).max_channel();
        assert!(off < 0.02 * expected.max_channel(), "{name}: off by {off} of {expected:?}");
        let sigmas = f64::from(ring - n / 2) / (0.25 * f64::from(n)).sqrt();
        assert!(sigmas.abs() < 4.5, "{name}: {ring} of {n} in the inner half");
    }
}
