//! Final gathering against what is known and against the path tracer.

use base::{Component, ImageSize, Photon, Ray, Rgb, Rng, Stream, encode_octahedral};
use glam::{Vec3, Vec3A};
use photon_map::{Gather, Kernel, Metadata, PhotonMaps, PhotonSet};
use scene::{Material, Parts, Scene};
use shade::{Settings, Work};

use crate::agreement::{Case, assert_agreement_of_gathering};
use crate::renderer::{self, Rendering};
use crate::scenes::{
    add_mesh, add_sphere, cuboid, diffuse, emissive, empty, furnace, glass, mirror, quad,
};

/// A furnace as the programs show it, a small picture of few rays.
fn of_furnace(parts: Parts, seed: u64) -> Rendering {
    let scene = Scene::assemble(parts);
    let photons = renderer::photons_for_gathering(&scene, 100_000, seed);
    let max_radius = scene.bounds().diagonal() * 0.05;
    let gather = |k| Gather { k, max_radius, kernel: Kernel::Epanechnikov };
    let settings = Settings {
        shadow_rays: 16,
        glossy_rays: 4,
        indirect: gather(500),
        caustic: gather(100),
        seed,
    };
    let shader = renderer::gathering(&scene, &photons, settings, 64);
    renderer::original(&shader, ImageSize { width: 32, height: 32 })
}

/// A furnace shows the same everywhere, in corners and behind glass, too. See `furnace.rs`.
#[test]
fn furnaces() {
    for (seed, rho) in [0.3_f32, 0.6, 0.9].into_iter().enumerate() {
        let walls = Material { albedo: Rgb::splat(rho), ..emissive(Rgb::ONE) };
        let rho = f64::from(rho);
        let with_things = {
            let mut parts = furnace(walls.clone());
            add_sphere(&mut parts, Vec3::new(-0.5, 0.3, -0.4), 0.35, mirror(1.0));
            add_sphere(&mut parts, Vec3::new(0.2, -0.3, -0.5), 0.35, glass(1.5));
            let prism = cuboid(Vec3::new(-0.8, -0.9, -0.8), Vec3::new(-0.3, -0.4, -0.3));
            add_mesh(&mut parts, prism, glass(1.3));
            parts
        };
        let picture = of_furnace(furnace(walls), seed as u64);
        let indirect = picture.components[Component::Indirect].values();
        let expected = rho * rho / (1.0 - rho);
        let n = indirect.len() as f64;
        let mean = indirect.iter().map(|c| f64::from(c.g)).sum::<f64>() / n;
        let squares = indirect.iter().map(|c| (f64::from(c.g) / expected - 1.0).powi(2));
        let rms = (squares.sum::<f64>() / n).sqrt();
        println!("albedo {rho:.1}: indirect {mean:.5} of {expected:.5}, rms error {rms:.5}");
        assert!((mean / expected - 1.0).abs() < 0.01, "albedo {rho}: {mean} of {expected}");
        assert!(rms < 0.03, "albedo {rho}: rms error {rms}");

        let expected = 1.0 / (1.0 - rho);
        let total = of_furnace(with_things, seed as u64).total();
        let mean = total.values().iter().map(|c| f64::from(c.g)).sum::<f64>() / n;
        println!("albedo {rho:.1}: with mirrors and glass {mean:.5} of {expected:.5}");
        assert!((mean / expected - 1.0).abs() < 0.01, "albedo {rho}: {mean} of {expected}");
    }
}

#[test]
fn cornell_box() {
    assert_agreement_of_gathering(
        &Case {
            name: "gathered-cornell-box".into(),
            parts: crate::transport::from_file("cornell-box"),
            samples_per_pixel: 512,
            photons: 4_000_000,
            radius: 0.06,
            side: 64,
        },
        64,
    );
}

/// A floor shines on a plate above it as much as it receives, by an irradiance of at most `most` and that many photons.
///
/// The bounds leave room for the mean over places around an end, which is still one of the brighter ones where light ends
/// within the radius of an estimate. By the nearest 256 photons stripes were 29 % too bright.
fn assert_floor_reflects(what: &str, n: usize, most: f32, irradiance: impl Fn(f32, f32) -> f32) {
    const ALBEDO: f32 = 0.8;
    const HEIGHT: f32 = 0.3;
    let mut parts = empty(Vec3::ONE, Vec3::ZERO, 40.0);
    add_mesh(&mut parts, quad(Vec3::ZERO, Vec3::Z, Vec3::X), diffuse(Rgb::splat(ALBEDO)));
    let plate = quad(Vec3::new(0.45, HEIGHT, 0.45), Vec3::X * 0.1, Vec3::Z * 0.1);
    add_mesh(&mut parts, plate, diffuse(Rgb::ONE));
    let scene = Scene::assemble(parts);

    let side = 500;
    let at = |i: i32| (i as f32 + 0.5) / side as f32;
    let cells = || (0..side * side).map(|i| (at(i % side), at(i / side)));
    let mean =
        cells().map(|(x, z)| f64::from(irradiance(x, z))).sum::<f64>() / cells().count() as f64;
    // By rejection.
    let mut rng = Rng::new(0, Stream::Test, 0);
    let flux = Rgb::splat(mean as f32 / n as f32);
    let mut photons = Vec::new();
    while photons.len() < n {
        let position = Vec3::new(rng.next_f32(), 0.0, rng.next_f32());
        if rng.next_f32() * most < irradiance(position.x, position.z) {
            photons.push(Photon { position, normal: encode_octahedral(Vec3A::Y), flux });
        }
    }
    let none = || PhotonSet::build(&[]);
    let maps = PhotonMaps {
        metadata: Metadata::default(),
        direct: Some(PhotonSet::build(&photons)),
        caustic: none(),
        indirect: none(),
        focused: Some(none()),
    };
    let gather = Gather { k: 500, max_radius: 0.3, kernel: Kernel::Epanechnikov };
    let settings =
        Settings { shadow_rays: 1, glossy_rays: 4, indirect: gather, caustic: gather, seed: 0 };
    let shader = renderer::gathering(&scene, &maps, settings, 16_384);
    let ray = Ray::unbounded(Vec3A::new(0.5, 0.1, 0.5), Vec3A::Y);
    let point = shader.eye_point(&ray, &mut Work::default()).expect("the plate is above");
    let found = shader.indirect_estimate(&point.facing, &mut Work::default()).irradiance.g;

    // What each place of the floor sends to the middle of the plate.
    let sum: f64 = cells()
        .map(|(x, z)| {
            let distance2 = (x - 0.5).powi(2) + (z - 0.5).powi(2) + HEIGHT * HEIGHT;
            f64::from(irradiance(x, z) * HEIGHT * HEIGHT / (distance2 * distance2))
        })
        .sum();
    let expected = sum as f32 * ALBEDO * std::f32::consts::FRAC_1_PI / cells().count() as f32;
    println!("{what}: {found} of {expected}, {:+.4}", found / expected - 1.0);
    assert!((found / expected - 1.0).abs() < 0.08, "{what}: {found} of {expected}");
}

/// Stripes, dark and ten times as bright, about as narrow as what an estimate blurs: bright ones give nothing to dark
/// ones but what they lose.
#[test]
fn stripes_of_light_reflect_what_falls_on_them() {
    let stripes = |x: f32, _| if x % 0.1 < 0.03 { 10.0 } else { 1.0 };
    assert_floor_reflects("stripes", 200_000, 10.0, stripes);
}

/// A bright patch in deep shade, as where the sun comes in: the shade isn't lit by the patch.
#[test]
fn a_patch_of_light_reflects_what_falls_on_it() {
    let patch = |x: f32, z: f32| {
        let is_lit = (x - 0.38).abs() < 0.05 && (z - 0.46).abs() < 0.05;
        if is_lit { 100.0 } else { 0.05 }
    };
    assert_floor_reflects("patch", 20_000, 100.0, patch);
}
