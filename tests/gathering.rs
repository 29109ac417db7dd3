//! Final gathering against what is known and against the path tracer.

use base::{Component, ImageSize, Rgb};
use glam::Vec3;
use photon_map::{Gather, Kernel};
use scene::{Material, Parts, Scene};
use shade::Settings;

use crate::agreement::{Case, assert_agreement_of_gathering};
use crate::renderer::{self, Rendering};
use crate::scenes::{add_mesh, add_sphere, cuboid, emissive, furnace, glass, mirror};

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
