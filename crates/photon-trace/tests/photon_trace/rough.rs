//! Rough surfaces: photons go where microfacets send them, and lose what these hide.

use base::{Rgb, math};
use glam::Vec3;
use scene::{Scene, Specular};

use crate::world::{World, assert_share, flux, trace};

/// Parallel light falls on a small plate of a material, in the middle of a large black-bottomed box of diffuse walls. Of
/// what the plate gets, the share that lands above and below it.
fn scattered(specular: Specular, roughness: f32, n: u64) -> (Scene, f64) {
    let mut world = World::new();
    let plate = world.rough(specular, roughness);
    let black = world.diffuse(Rgb::splat(1e-9));
    let side = 0.5;
    let scene = world
        .room(Vec3::new(-50.0, -50.0, -50.0), Vec3::new(50.0, 50.0, 50.0), black)
        .quad(Vec3::new(-0.5 * side, -0.5 * side, 0.0), Vec3::X * side, Vec3::Y * side, plate)
        .beam_from(Vec3::new(0.0, 0.0, 40.0), 0.2)
        .assemble();
    (scene, n as f64)
}

#[test]
fn rough_mirrors_keep_their_class_and_lose_what_facets_hide() {
    let reflectance = Rgb::new(0.9, 0.6, 0.3);
    for (roughness, lost) in [(0.3, 0.007), (1.0, 2.0_f64.ln())] {
        let (scene, n) = scattered(Specular::Mirror { reflectance }, roughness, 200_000);
        let traced = trace(&scene, n as u64, 3);
        assert!(traced.direct.is_empty(), "the beam misses the plate");
        assert_eq!(traced.account.cut, 0);
        // Head on, a share 1 - lost of the reflectance is left, whatever the channel; at a roughness of 1 the integral over
        // all facets is 1 - ln 2.
        let (emitted, landed) = (traced.account.flux.to_array(), flux(&traced.caustic));
        for (c, r) in reflectance.to_array().into_iter().enumerate() {
            let share = landed[c] / f64::from(emitted[c] * r);
            assert!((share - (1.0 - lost)).abs() < 0.01, "roughness {roughness}: {share}");
        }
        // Above the plate.
        assert!(traced.caustic.iter().all(|p| p.position.z > 0.0));
        // Slopes of facets below tan(theta) = alpha are half of them; directions turn twice as far.
        let half = math::sin_cos(2.0 * math::atan2(roughness * roughness, 1.0)).1;
        let inside = traced.caustic.iter().filter(|p| p.position.z > p.position.length() * half);
        let share = inside.count() as f64 / traced.caustic.len() as f64;
        if roughness < 1.0 {
            assert!(
                (share - 0.5).abs() < 0.015,
                "roughness {roughness}: {share} within a cosine of {half}"
            );
        }
    }
}

#[test]
fn rough_glass_divides_flux_as_fresnel_says() {
    let specular = Specular::Glass { ior: 1.5, absorption: Rgb::BLACK };
    let (scene, n) = scattered(specular, 0.3, 200_000);
    let traced = trace(&scene, n as u64, 4);
    // A single interface: what passes is inside forever, and the walls are there, too.
    let below = traced.caustic.iter().filter(|p| p.position.z < 0.0).count();
    assert_share(traced.caustic.len() - below, n as usize, 0.04, "reflected");
    assert!(below as f64 > 0.955 * n, "{below} of {n} passed");
    assert_eq!(traced.account.absorbed + traced.account.escaped, traced.account.emitted);
}
