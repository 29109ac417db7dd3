//! Slabs of glass: Fresnel's factors and Beer's law.

use base::{Photon, Rgb};
use glam::Vec3;
use scene::Specular;

use crate::world::{World, flux, trace};

/// At normal incidence, for an index of 1.5.
const F: f64 = 0.04;

/// The flux of photons that landed below `z` within the unit square, by channel, and its relative error.
fn below(photons: &[Photon], z: f32) -> ([f64; 3], f64) {
    let inside = |p: &&Photon| p.position.z < z && p.position.truncate().abs().max_element() < 0.5;
    let photons: Vec<&Photon> = photons.iter().filter(inside).collect();
    (flux(photons.iter().copied()), 1.0 / (photons.len() as f64).sqrt())
}

fn assert_transmitted(photons: &[Photon], z: f32, expected: [f64; 3], what: &str) {
    let (found, sigma) = below(photons, z);
    for (f, e) in found.into_iter().zip(expected) {
        assert!(
            (f / e - 1.0).abs() < 4.0 * sigma,
            "{what}: {found:?} +- {sigma}, not {expected:?}"
        );
    }
}

const ABSORPTION: Rgb = Rgb::new(0.0, 1.0, 4.0);

fn transmittances(thickness: f64) -> [f64; 3] {
    ABSORPTION.to_array().map(|a| (-f64::from(a) * thickness).exp())
}

/// One slab of unit square, all inner reflections included: (1 - F)^2 t / (1 - F^2 t^2).
fn through_slab(t: f64) -> f64 {
    (1.0 - F) * (1.0 - F) * t / (1.0 - F * F * t * t)
}

#[test]
fn a_slab_absorbs_by_beers_law() {
    for thickness in [0.1_f32, 0.5] {
        let mut world = World::new();
        let glass = world.glass(1.5, ABSORPTION);
        let black = world.diffuse(Rgb::splat(1e-6));
        // Air between slab and floor must not absorb.
        let scene = world
            .block(Vec3::new(-0.5, -0.5, 0.3), Vec3::new(0.5, 0.5, 0.3 + thickness), glass)
            .quad(Vec3::new(-0.5, -0.5, -0.4), Vec3::X, Vec3::Y, black)
            .beam()
            .assemble();
        let traced = trace(&scene, 400_000, 0);
        assert!(traced.direct.is_empty(), "all goes through glass");
        let expected = transmittances(thickness.into()).map(through_slab);
        assert_transmitted(&traced.caustic, 0.0, expected, &format!("{thickness}"));
    }
}

#[test]
fn what_lies_in_glass_is_seen_through_it() {
    let mut world = World::new();
    let glass = world.glass(1.5, ABSORPTION);
    let black = world.diffuse(Rgb::splat(1e-6));
    let scene = world
        .block(Vec3::new(-0.6, -0.6, -0.5), Vec3::new(0.6, 0.6, 0.5), glass)
        .quad(Vec3::new(-0.5, -0.5, 0.25), Vec3::X, Vec3::Y, black)
        .beam()
        .assemble();
    let traced = trace(&scene, 400_000, 0);
    let on_top: Vec<Photon> =
        traced.caustic.iter().filter(|p| p.position.z > 0.2).copied().collect();
    let expected = transmittances(0.25).map(|t| (1.0 - F) * t);
    assert_transmitted(&on_top, 1.0, expected, "a floor inside");
}

/// A mirror inside sends on what is still inside: all of the way counts.
#[test]
fn reflection_inside_stays_inside() {
    let mut world = World::new();
    let glass = world.glass(1.5, ABSORPTION);
    let mirror = world.shiny(Rgb::BLACK, Specular::Mirror { reflectance: Rgb::splat(0.7) });
    let black = world.diffuse(Rgb::splat(1e-6));
    // The mirror turns the beam to the left, where the receiver stands.
    let scene = world
        .block(Vec3::new(-2.0, -0.6, -0.5), Vec3::new(0.6, 0.6, 0.7), glass)
        .quad(Vec3::new(-0.5, -0.5, -0.4), Vec3::new(1.0, 0.0, 1.0), Vec3::Y, mirror)
        .quad(Vec3::new(-1.5, -0.5, -0.4), Vec3::Y, Vec3::Z, black)
        .beam()
        .assemble();
    let traced = trace(&scene, 600_000, 0);
    let on_wall: Vec<Photon> =
        traced.caustic.iter().filter(|p| (p.position.x + 1.5).abs() < 1e-3).copied().collect();
    // A ray that enters at x goes down by 0.6 - x and then left by 1.5 + x: 2.1 in all.
    let found = flux(&on_wall);
    let sigma = 1.0 / (on_wall.len() as f64).sqrt();
    // In the second and third channel little is left: too little for a test.
    let expected = 0.7 * (1.0 - F);
    assert!((found[0] / expected - 1.0).abs() < 4.0 * sigma, "{} +- {sigma}", found[0]);
    for (c, a) in [(1, 1.0_f64), (2, 4.0)] {
        let t = found[c] / found[0];
        let expected = (-a * 2.1).exp();
        assert!((t / expected - 1.0).abs() < 0.05, "channel {c}: {t}, not {expected}");
    }
}
