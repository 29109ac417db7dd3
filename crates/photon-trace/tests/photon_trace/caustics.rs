//! The caustics of a glass sphere of radius 1 in a parallel beam.
//!
//! The glass absorbs next to nothing, but in one channel only: so the color of a photon tells how long it was inside.
//! All chords of a ray inside a sphere are of one length, which tells how many of them there were.

use base::{Photon, Rgb};
use glam::{Vec3, Vec3A};
use scene::{LightKind, Spot};

use crate::world::{World, flux, trace};

/// Absorption of the second channel.
const TINT: f32 = 0.01;

/// How many chords inside the sphere a photon has behind it.
fn chords(photon: &Photon, ior: f32) -> usize {
    let length = (f64::from(photon.flux.r) / f64::from(photon.flux.g)).ln() / f64::from(TINT);
    let shortest = 2.0 * (1.0 - 1.0 / f64::from(ior * ior)).sqrt();
    let n = (length / shortest + 1e-3).floor();
    // Chords are between the shortest and 2, so that sums of up to two tell their number.
    assert!(n > 2.0 || length <= 2.0 * n + 1e-3, "{length} is no sum of chords");
    n as usize
}

/// The flux of photons by the number of their chords, as shares of `all`; the last is that of two and more.
fn shares(photons: &[Photon], ior: f32, all: f64) -> [f64; 3] {
    [0, 1, 2].map(|n| flux(photons.iter().filter(|p| chords(p, ior).min(2) == n))[0] / all)
}

/// Fresnel's factors, averaged over the disc: what is reflected at once, goes through two interfaces, and is reflected
/// inside.
#[test]
fn flux_is_shared_out_as_fresnel_says() {
    const N: u64 = 400_000;
    for (ior, expected) in [(1.5, [0.0918, 0.8355, 0.0727]), (1.33, [0.0659, 0.8823, 0.0518])] {
        // A point 40 radii away, in a closed room: where the photons meet the sphere is even but for 0.03 %.
        let distance = 40.0_f32;
        let cos = (1.0 - 1.0 / (distance * distance)).sqrt();
        let spot = Spot {
            position: Vec3A::Z * distance,
            direction: -Vec3A::Z,
            intensity: Rgb::ONE,
            cos_outer: cos,
            cos_inner: cos,
        };
        let mut world = World::new();
        let glass = world.glass(ior, Rgb::new(0.0, TINT, 0.0));
        let black = world.diffuse(Rgb::splat(1e-6));
        let scene = world
            .sphere(Vec3::ZERO, 1.0, glass)
            .room(Vec3::new(-9.0, -9.0, -9.0), Vec3::new(9.0, 9.0, 41.0), black)
            .light(LightKind::Spot(spot))
            .assemble();
        let traced = trace(&scene, N, 0);
        // The edge of the cone is rounded.
        assert!(traced.direct.len() < N as usize / 1000, "{} missed", traced.direct.len());
        assert_eq!(traced.account.escaped, 0);
        let all = f64::from(traced.account.flux.r);
        let found = shares(&traced.caustic, ior, all);
        for (f, e) in found.into_iter().zip(expected) {
            let sigma = f64::sqrt(e * (1.0 - e) / N as f64);
            assert!((f - e).abs() < 3.5 * sigma + 4e-4, "{ior}: {found:?}, not {expected:?}");
        }
    }
}

/// Shares of the flux through two interfaces that land within a radius of a plane behind the sphere.
#[test]
fn the_focus_is_as_sharp_as_ray_tracing_says() {
    let radii = [0.1, 0.25, 0.5, 1.0];
    for (height, expected) in
        [(1.5, [0.447, 0.679, 0.847, 0.952]), (2.0, [0.082, 0.297, 0.560, 0.808])]
    {
        let mut world = World::new();
        let glass = world.glass(1.5, Rgb::new(0.0, TINT, 0.0));
        let black = world.diffuse(Rgb::splat(1e-6));
        let corner = Vec3::new(-1.05, -1.05, -height);
        let scene = world
            .sphere(Vec3::ZERO, 1.0, glass)
            .quad(corner, Vec3::X * 2.1, Vec3::Y * 2.1, black)
            .beam()
            .assemble();
        let traced = trace(&scene, 1_000_000, 0);
        let through: Vec<&Photon> = traced.caustic.iter().filter(|p| chords(p, 1.5) == 1).collect();
        // The irradiance of the beam is 1.
        let all = 0.8355 * std::f64::consts::PI;
        for (a, e) in radii.into_iter().zip(expected) {
            let inside = through.iter().filter(|p| p.position.truncate().length() < a);
            let share = flux(inside.copied())[0] / all;
            let sigma = f64::sqrt(e * (1.0 - e) / through.len() as f64);
            let what = format!("within {a} at {height}: {share:.4} +- {sigma:.4}, not {e}");
            assert!((share - e).abs() < 3.5 * sigma + 6e-4, "{what}");
        }
    }
}
