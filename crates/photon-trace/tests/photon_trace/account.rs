//! Nothing is lost, nothing is made, and nothing depends on threads.

use std::f64::consts::PI;
use std::sync::atomic::{AtomicU64, Ordering};

use base::{Interrupted, Rgb};
use glam::{Vec3, Vec3A};
use photon_trace::{Account, Budget, Config, Traced};
use scene::{LightKind, Scene, Specular, Spot};

use crate::world::{World, assert_share, flux, trace};

/// An open scene with everything in it.
fn still_life() -> Scene {
    let mut world = World::new();
    let gray = world.diffuse(Rgb::new(0.7, 0.5, 0.3));
    let lamp = world.glowing(Rgb::splat(0.2), Rgb::new(5.0, 4.0, 3.0));
    let mirror = world.shiny(Rgb::splat(0.2), Specular::Mirror { reflectance: Rgb::splat(0.7) });
    let metal = Specular::Metal { eta: Rgb::new(0.2, 0.9, 1.1), k: Rgb::new(3.9, 2.4, 2.2) };
    let metal = world.shiny(Rgb::BLACK, metal);
    let glass = world.glass(1.5, Rgb::new(0.1, 0.2, 0.4));
    let brushed = world.rough(Specular::Mirror { reflectance: Rgb::new(0.9, 0.6, 0.3) }, 0.4);
    let frosted = Specular::Glass { ior: 1.5, absorption: Rgb::new(0.4, 0.2, 0.1) };
    let frosted = world.rough(frosted, 0.5);
    world
        .sphere(Vec3::new(1.0, 3.2, 0.5), 0.4, brushed)
        .sphere(Vec3::new(3.2, 3.2, 0.6), 0.5, frosted)
        .quad(Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 4.0, gray)
        .quad(Vec3::ZERO, Vec3::Y * 4.0, Vec3::Z * 4.0, mirror)
        .quad(Vec3::new(1.0, 1.0, 3.5), Vec3::Y, Vec3::X, lamp)
        .sphere(Vec3::new(1.0, 1.5, 1.0), 0.6, glass)
        .sphere(Vec3::new(2.5, 1.5, 1.0), 0.6, metal)
        .block(Vec3::new(2.0, 2.5, 0.1), Vec3::new(2.5, 3.5, 1.0), glass)
        .light(LightKind::Point { position: Vec3A::splat(2.0), intensity: Rgb::ONE })
        .light(LightKind::Environment { radiance: Rgb::new(0.1, 0.2, 0.3) })
        .assemble()
}

fn config(budget: Budget) -> Config {
    Config { budget, seed: 3, max_bounces: 100, store_direct: true, aim: 0.0 }
}

fn photons(traced: &Traced) -> usize {
    traced.direct.len() + traced.caustic.len() + traced.indirect.len()
}

#[test]
fn every_photon_is_absorbed_or_gone_or_cut() {
    let scene = still_life();
    let balanced = |a: &Account| a.emitted == a.absorbed + a.escaped + a.cut;
    for max_bounces in [0, 1, 2, 5, 100] {
        let config = Config { max_bounces, ..config(Budget::Total(50_000)) };
        let traced = photon_trace::trace(&scene, &config, &|_| true).unwrap();
        let account = traced.account;
        assert!(balanced(&account), "{account:?}");
        assert!(account.energy.imbalance() < 1e-5, "{account:?}");
        let watts = f64::from(account.flux.mean());
        // What a start of the environment carries is a matter of chance.
        assert!((account.energy.emitted - watts).abs() < 1e-2 * watts, "{account:?}");
        assert_eq!(account.emitted, 50_000);
        assert!(account.rays <= u64::from(max_bounces) * account.emitted, "{account:?}");
        assert!(photons(&traced) as u64 <= account.rays, "{account:?}");
        assert_eq!(account.cut > 0, max_bounces < 100, "{account:?}");
        assert!(account.escaped > 0 || max_bounces == 0, "{account:?}");
        // Whatever a path met before it was cut is stored: the bound only leaves things out.
        if max_bounces == 1 {
            assert!(traced.caustic.is_empty() && traced.indirect.is_empty());
            assert_eq!(account.rays, account.emitted);
        }
    }
    let per_light = photon_trace::trace(&scene, &config(Budget::PerLight(20_000)), &|_| true);
    let account = per_light.unwrap().account;
    assert!(balanced(&account) && account.emitted == 60_000, "{account:?}");
}

#[test]
fn first_hits_and_those_gone_are_all_that_was_emitted() {
    let mut world = World::new();
    let gray = world.diffuse(Rgb::splat(0.5));
    let scene = world
        .quad(Vec3::ZERO, Vec3::X, Vec3::Y, gray)
        .light(LightKind::Point { position: Vec3A::new(0.5, 0.5, 0.5), intensity: Rgb::ONE })
        .assemble();
    let traced = trace(&scene, 300_000, 0);
    let Account { emitted, absorbed, escaped, cut, .. } = traced.account;
    // One flat surface: what is scattered by it is gone.
    assert!(traced.caustic.is_empty() && traced.indirect.is_empty() && cut == 0);
    assert_eq!(absorbed + escaped, emitted);
    let scattered = traced.direct.len() - absorbed as usize;
    assert_share(scattered, traced.direct.len(), 0.5, "scattered");
    // A face of a cube around the point.
    assert_share(traced.direct.len(), emitted as usize, 1.0 / 6.0, "first hits");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let scene = still_life();
    let run = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        let config = config(Budget::Total(60_000));
        pool.install(|| photon_trace::trace(&scene, &config, &|_| true)).unwrap()
    };
    let one = run(1);
    let sizes = [one.direct.len(), one.caustic.len(), one.indirect.len()];
    assert!(sizes.iter().all(|n| *n > 500), "{sizes:?}");
    for n_threads in [1, 2, 3] {
        let again = run(n_threads);
        assert!(again.direct == one.direct, "{n_threads} threads");
        assert!(again.caustic == one.caustic, "{n_threads} threads");
        assert!(again.indirect == one.indirect, "{n_threads} threads");
        assert_eq!(again.account, one.account);
    }
}

#[test]
fn seeds_differ_and_direct_photons_are_stored_when_asked_for() {
    let scene = still_life();
    let run = |seed, store_direct| {
        let config = Config { seed, store_direct, ..config(Budget::Total(20_000)) };
        photon_trace::trace(&scene, &config, &|_| true).unwrap()
    };
    let (with, without, other) = (run(3, true), run(3, false), run(4, true));
    assert!(without.direct.is_empty() && !with.direct.is_empty());
    assert!(without.indirect == with.indirect && without.caustic == with.caustic);
    assert!(other.indirect != with.indirect);
}

#[test]
fn the_watch_counts_and_stops() {
    let scene = still_life();
    let done = AtomicU64::new(0);
    let config = config(Budget::Total(50_000));
    let watch = |n| {
        done.fetch_add(n, Ordering::Relaxed);
        true
    };
    photon_trace::trace(&scene, &config, &watch).unwrap();
    assert_eq!(done.load(Ordering::Relaxed), 50_000);
    let stopped = photon_trace::trace(&scene, &config, &|_| false);
    assert_eq!(stopped.err(), Some(Interrupted));
}

#[test]
fn a_scene_without_light_emits_nothing() {
    let mut world = World::new();
    let gray = world.diffuse(Rgb::splat(0.5));
    let dark = World::new().assemble();
    let unlit = world.quad(Vec3::ZERO, Vec3::X, Vec3::Y, gray).assemble();
    for scene in [dark, unlit] {
        let traced = trace(&scene, 1000, 0);
        assert_eq!((photons(&traced), traced.account), (0, Account::default()));
    }
}

/// One light above a floor that is large enough to catch everything that goes down.
fn lit_by(kind: LightKind) -> Traced {
    let mut world = World::new();
    let gray = world.diffuse(Rgb::new(0.5, 0.25, 0.1));
    let corner = Vec3::new(-100.0, -100.0, 0.0);
    let scene = world.quad(corner, Vec3::X * 200.0, Vec3::Y * 200.0, gray).light(kind).assemble();
    trace(&scene, 200_000, 1)
}

fn assert_flux(account: &Account, expected: [f64; 3], what: &str) {
    for (flux, e) in account.flux.to_array().into_iter().zip(expected) {
        assert!((f64::from(flux) / e - 1.0).abs() < 1e-6, "{what}: {flux}, not {e}");
    }
}

#[test]
fn emitted_flux_is_that_of_the_closed_form() {
    let color = Rgb::new(3.0, 2.0, 0.5);
    let times = |x: f64| color.to_array().map(|c| f64::from(c) * x);

    let mut world = World::new();
    let lamp = world.glowing(Rgb::splat(0.2), color);
    let (a, b) = (Vec3::new(1.1, 0.1, 0.4), Vec3::new(0.3, 0.2, -0.7));
    let scene = world.quad(Vec3::ONE, a, b, lamp).assemble();
    let area = a.as_dvec3().cross(b.as_dvec3()).length();
    assert_flux(&trace(&scene, 1000, 0).account, times(PI * area), "area");

    let point = lit_by(LightKind::Point { position: Vec3A::Z, intensity: color });
    assert_flux(&point.account, times(4.0 * PI), "point");
    // All photons of a light carry the same, and what it emits is what they carry.
    let n = point.account.emitted as f64;
    let each = point.direct[0].flux;
    assert!(point.direct.iter().all(|p| p.flux == each));
    assert!((f64::from(each.r) * n / (12.0 * PI) - 1.0).abs() < 1e-6);

    let spot = Spot {
        position: Vec3A::Z,
        direction: -Vec3A::Z,
        intensity: color,
        cos_outer: 0.5,
        cos_inner: 0.75,
    };
    let spot = lit_by(LightKind::Spot(spot));
    assert_flux(&spot.account, times(2.0 * PI * 0.25 + PI * 0.25), "spot");
    assert_eq!(spot.direct.len() as u64, spot.account.emitted);

    let radius2 = 2.0 * 100.0 * 100.0;
    let direction = Vec3A::new(0.6, 0.0, -0.8);
    let sun = lit_by(LightKind::Directional { direction, irradiance: color });
    assert_flux(&sun.account, times(PI * radius2), "directional");
    let share = 0.8 * 200.0 * 200.0 / (PI * radius2);
    assert_share(sun.direct.len(), sun.account.emitted as usize, share, "directional");

    let sky = lit_by(LightKind::Environment { radiance: color });
    assert_flux(&sky.account, times(4.0 * PI * PI * radius2), "environment");
    // Both sides of the floor have the irradiance pi L.
    let share = 2.0 * PI * 200.0 * 200.0 / (4.0 * PI * PI * radius2);
    assert_share(sky.direct.len(), sky.account.emitted as usize, share, "environment");
}

#[test]
fn parallel_light_is_even_over_a_floor() {
    let sun = LightKind::Directional { direction: -Vec3A::Z, irradiance: Rgb::ONE };
    let traced = lit_by(sun);
    let mut counts = [0_u32; 256];
    for photon in &traced.direct {
        let at = (photon.position / 200.0 + 0.5) * 16.0;
        counts[(at.y as usize).min(15) * 16 + (at.x as usize).min(15)] += 1;
    }
    // The floor is the square in the disc of the emission, which low-discrepancy points fill more evenly than chance.
    let expected = traced.account.emitted as f64 * 4.0 / (2.0 * PI) / 256.0;
    let chi2: f64 = counts.iter().map(|&n| (f64::from(n) - expected).powi(2) / expected).sum();
    assert!(chi2 < 255.0, "{chi2}");
}

/// A closed box of one albedo that glows itself: the mean number of surfaces that a photon meets is 1 / (1 - albedo).
#[test]
fn furnaces_store_as_many_photons_as_the_geometric_series_says() {
    for (i, albedo) in [0.25, 0.5, 0.73, 0.9].into_iter().enumerate() {
        let mut world = World::new();
        let glow = world.glowing(Rgb::splat(albedo), Rgb::splat(2.0));
        let scene =
            world.room(Vec3::new(-1.0, 2.0, 0.0), Vec3::new(2.0, 3.0, 1.5), glow).assemble();
        let traced = trace(&scene, 200_000, i as u64);
        let Account { emitted, absorbed, escaped, cut, .. } = traced.account;
        assert_eq!((absorbed, escaped, cut), (emitted, 0, 0), "albedo {albedo}");
        assert_eq!(traced.direct.len() as u64, emitted, "albedo {albedo}");
        assert!(traced.caustic.is_empty());

        let (n, albedo) = (emitted as f64, f64::from(albedo));
        let mean = photons(&traced) as f64 / n;
        let sigma = albedo.sqrt() / (1.0 - albedo) / n.sqrt();
        let expected = 1.0 / (1.0 - albedo);
        assert!((mean - expected).abs() < 3.0 * sigma, "{mean} +- {sigma}, not {expected}");
        // Irradiance is the same everywhere: pi L / (1 - albedo).
        let area = 2.0 * (3.0 * 1.0 + 3.0 * 1.5 + 1.0 * 1.5);
        let sum = flux(traced.direct.iter().chain(&traced.indirect))[1];
        let irradiance = sum / area / (2.0 * PI);
        assert!((irradiance / expected - 1.0).abs() < 3.0 * sigma / expected, "{irradiance}");
    }
}

/// Roulette by the mean of the channels keeps the flux of each.
#[test]
fn colored_furnaces_hold_the_flux_of_each_channel() {
    let albedo = Rgb::new(0.2, 0.5, 0.8);
    let mut world = World::new();
    let glow = world.glowing(albedo, Rgb::new(1.0, 2.0, 3.0));
    let scene = world.room(Vec3::ZERO, Vec3::ONE, glow).assemble();
    let traced = trace(&scene, 400_000, 0);
    let emitted = traced.account.flux.to_array().map(f64::from);
    let sum = flux(traced.direct.iter().chain(&traced.indirect));
    for (c, a) in albedo.to_array().map(f64::from).into_iter().enumerate() {
        let ratio = sum[c] / emitted[c] * (1.0 - a);
        assert!((ratio - 1.0).abs() < 0.01, "channel {c}: {ratio}");
    }
}
