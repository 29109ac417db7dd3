//! Aimed photons: many more caustics, and the same light.

use base::{Photon, Rgb};
use glam::{Mat3A, Vec3, Vec3A};
use photon_trace::{Budget, Config, Traced};
use scene::{EnvironmentMap, LightKind, Scene, Specular};

use crate::world::{World, flux};

const N: u64 = 150_000;

/// A hall of 20 by 20 by 8 with a ball of glass and a small mirror on its floor, under one light.
fn hall(light: Option<LightKind>, is_open: bool) -> Scene {
    let mut world = World::new();
    let gray = world.diffuse(Rgb::splat(0.6));
    let lamp = world.glowing(Rgb::BLACK, Rgb::new(9.0, 8.0, 7.0));
    let glass = world.glass(1.5, Rgb::BLACK);
    let mirror = world.shiny(Rgb::splat(0.3), Specular::Mirror { reflectance: Rgb::splat(0.6) });
    let (min, max) = (Vec3::new(-10.0, -10.0, 0.0), Vec3::new(10.0, 10.0, 8.0));
    let world = if is_open {
        world.quad(min, Vec3::X * 20.0, Vec3::Y * 20.0, gray)
    } else {
        world.room(min, max, gray)
    };
    let world = world.sphere(Vec3::new(3.0, 2.0, 0.5), 0.4, glass).quad(
        Vec3::new(-4.0, -3.0, 0.3),
        Vec3::X * 0.6,
        Vec3::Y * 0.5,
        mirror,
    );
    match light {
        Some(kind) => world.light(kind),
        None => world.quad(Vec3::new(-0.5, -0.5, 7.5), Vec3::Y, Vec3::X, lamp),
    }
    .assemble()
}

fn trace(scene: &Scene, aim: f32, seed: u64) -> Traced {
    let config =
        Config { budget: Budget::Total(N), seed, max_bounces: 1000, store_direct: false, aim };
    photon_trace::trace(scene, &config, &|_| true).expect("nobody stops it")
}

/// Mean and variance of the mean over seeds of the flux of photons and of where it lands.
fn moments(seeds: std::ops::Range<u64>, f: impl Fn(u64) -> [f64; 3]) -> [(f64, f64); 3] {
    let n = (seeds.end - seeds.start) as f64;
    let values: Vec<[f64; 3]> = seeds.map(f).collect();
    std::array::from_fn(|i| {
        let mean = values.iter().map(|v| v[i]).sum::<f64>() / n;
        let variance = values.iter().map(|v| (v[i] - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean, variance / n)
    })
}

/// Flux, and its moments along x and y.
fn where_it_lands(photons: &[Photon]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for p in photons {
        let watts = f64::from(p.flux.mean());
        sum[0] += watts;
        sum[1] += watts * f64::from(p.position.x);
        sum[2] += watts * f64::from(p.position.y);
    }
    sum
}

fn assert_same(a: [(f64, f64); 3], b: [(f64, f64); 3], what: &str) {
    for i in 0..3 {
        let sigma = (a[i].1 + b[i].1).sqrt();
        let off = (a[i].0 - b[i].0).abs();
        // The spread of four runs is roughly known; a wrong share is off by a multiple.
        assert!(off <= 7.0 * sigma + 0.002 * a[i].0.abs(), "{what} {i}: {a:?}, {b:?}");
    }
}

#[test]
fn aimed_photons_find_caustics_and_change_no_light() {
    let down = Vec3A::new(0.3, 0.1, -1.0).normalize();
    let texel = |i: usize| if i == 70 { Rgb::splat(300.0) } else { Rgb::splat(0.2) };
    // Up is z here.
    let to_world = Mat3A::from_rotation_x(std::f32::consts::FRAC_PI_2);
    let map = EnvironmentMap::new([32, 16], (0..512).map(texel).collect(), to_world);
    let point = LightKind::Point { position: Vec3A::new(0.0, 1.0, 7.0), intensity: Rgb::ONE };
    #[rustfmt::skip]
    let cases = [
        ("sun", Some(LightKind::Directional { direction: down, irradiance: Rgb::ONE }), true, 20.0),
        ("point", Some(point), false, 10.0),
        ("lamp", None, false, 5.0),
        ("image", Some(LightKind::EnvironmentMap(map)), true, 3.0),
    ];
    for (name, light, is_open, gain) in cases {
        let scene = hall(light, is_open);
        let runs = |aim: f32| -> Vec<Traced> { (0..4).map(|s| trace(&scene, aim, s)).collect() };
        let (plain, aimed) = (runs(0.0), runs(0.5));
        let caustics = |runs: &[Traced]| runs.iter().map(|t| t.caustic.len()).sum::<usize>() as f64;
        let found = caustics(&aimed) / caustics(&plain);
        println!("{name}: {found} times as many caustic photons");
        assert!(found > gain, "{name}: {found} times as many caustic photons");
        let of = |runs: &[Traced], f: fn(&Traced) -> &Vec<Photon>| {
            moments(0..4, |i| where_it_lands(f(&runs[i as usize])))
        };
        assert_same(
            of(&plain, |t| &t.caustic),
            of(&aimed, |t| &t.caustic),
            &format!("{name}, caustics"),
        );
        assert_same(
            of(&plain, |t| &t.indirect),
            of(&aimed, |t| &t.indirect),
            &format!("{name}, indirect"),
        );
        let account = aimed[0].account;
        assert_eq!(account.emitted, N);
        assert_eq!(account.emitted, account.absorbed + account.escaped + account.cut);
        // Energy is that of the photons that aren't aimed, which is all.
        let energy = account.energy.emitted / f64::from(account.flux.mean());
        assert!((energy - 1.0).abs() < 1e-3, "{name}: {energy}");
    }
}

#[test]
fn without_anything_to_aim_at_nothing_changes() {
    let mut world = World::new();
    let gray = world.diffuse(Rgb::splat(0.6));
    let scene = world.quad(Vec3::ZERO, Vec3::X, Vec3::Y, gray).beam().assemble();
    let (plain, aimed) = (trace(&scene, 0.0, 1), trace(&scene, 0.9, 1));
    assert_eq!(flux(&plain.indirect), flux(&aimed.indirect));
    assert_eq!(plain.account, aimed.account);
}
