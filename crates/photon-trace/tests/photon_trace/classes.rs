//! Scenes in which the class of every photon is known.

use base::{Photon, Rgb, decode_octahedral};
use glam::{Vec3, Vec3A};
use photon_trace::Traced;
use scene::{LightKind, Specular};

use crate::world::{World, assert_share, flux, trace};

/// How many photons of each class landed on surfaces that the condition picks.
fn counts(traced: &Traced, on: impl Fn(&Photon) -> bool) -> [usize; 3] {
    [&traced.direct, &traced.caustic, &traced.indirect]
        .map(|photons| photons.iter().filter(|p| on(p)).count())
}

#[test]
fn from_floor_to_wall_is_indirect() {
    let mut world = World::new();
    let gray = world.diffuse(Rgb::splat(0.5));
    // The beam runs along the wall.
    let scene = world
        .quad(Vec3::ZERO, Vec3::X, Vec3::Y, gray)
        .quad(Vec3::ZERO, Vec3::Y, Vec3::Z, gray)
        .beam()
        .assemble();
    let traced = trace(&scene, 200_000, 0);
    let on_wall = |p: &Photon| p.position.x.abs() < 1e-4 && p.position.z > 1e-4;
    let [direct, caustic, indirect] = counts(&traced, on_wall);
    assert_eq!((direct, caustic), (0, 0));
    // From the floor to the wall: half of it is scattered, and 0.2000438 of that arrives; then to and fro.
    let once = 0.5 * 0.200_043_8;
    let n_floor = traced.direct.len();
    let expected = once / (1.0 - once * once);
    let sigma = (expected / n_floor as f64).sqrt();
    let share = indirect as f64 / n_floor as f64;
    assert!((share - expected).abs() < 3.5 * sigma, "{share} +- {sigma}, not {expected}");
    for p in &traced.direct {
        assert!(decode_octahedral(p.normal).z > 0.999, "{p:?}");
    }
    assert!(counts(&traced, |p| !on_wall(p))[2] > 0);
    assert!(traced.focused.is_empty(), "{:?}", traced.focused.first());
}

/// A mirror at 45 degrees turns the beam onto a wall that it cannot reach itself.
#[test]
fn from_mirror_to_wall_is_caustic() {
    let metal = Specular::Metal { eta: Rgb::splat(1.5), k: Rgb::splat(0.0) };
    // At 45 degrees a surface of index 1.5 reflects 0.0502.
    for (specular, reflectance) in
        [(Specular::Mirror { reflectance: Rgb::splat(0.8) }, 0.8), (metal, 0.050_240)]
    {
        let mut world = World::new();
        let gray = world.diffuse(Rgb::splat(0.5));
        let mirror = world.shiny(Rgb::BLACK, specular);
        let scene = world
            .quad(Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0), Vec3::Y, mirror)
            .quad(-Vec3::X, Vec3::Y, Vec3::Z * 2.0, gray)
            .beam()
            .assemble();
        let traced = trace(&scene, 300_000, 0);
        assert!(traced.direct.is_empty(), "{:?}", traced.direct.first());
        let lost = 1.0 - flux(&traced.caustic)[0] / reflectance;
        let sigma = 1.0 / (traced.caustic.len() as f64).sqrt();
        assert!(lost.abs() < 3.0 * sigma, "{lost} +- {sigma}");
        for p in &traced.caustic {
            assert!((p.position.x + 1.0).abs() < 1e-4, "{p:?}");
        }
        // What goes back to the mirror and from there to the wall was scattered before.
        assert!(reflectance < 0.5 || !traced.indirect.is_empty());
        assert!(traced.indirect.len() < traced.caustic.len() / 2);
        // All of it came back from the wall by the mirror.
        assert_eq!(traced.focused, traced.indirect);
    }
}

#[test]
fn any_number_of_mirrors_is_caustic() {
    let mut world = World::new();
    let gray = world.diffuse(Rgb::splat(0.5));
    let mirror = world.shiny(Rgb::BLACK, Specular::Mirror { reflectance: Rgb::ONE });
    // A periscope: down, to the left, down again.
    let scene = world
        .quad(Vec3::Z * 2.0, Vec3::new(1.0, 0.0, 1.0), Vec3::Y, mirror)
        .quad(Vec3::new(-3.0, 0.0, 2.0), Vec3::new(1.0, 0.0, 1.0), Vec3::Y, mirror)
        .quad(Vec3::new(-3.0, 0.0, 0.0), Vec3::X, Vec3::Y, gray)
        .beam()
        .assemble();
    let traced = trace(&scene, 300_000, 0);
    // The beam meets the back of the second mirror, which shades the floor.
    assert!(traced.direct.is_empty(), "{:?}", traced.direct.first());
    let arrived = flux(&traced.caustic)[0];
    let sigma = 1.0 / (traced.caustic.len() as f64).sqrt();
    assert!((arrived - 1.0).abs() < 3.5 * sigma, "{arrived} +- {sigma}");
}

/// A surface that is both diffuse and a mirror stores what arrives, and sends on either way.
#[test]
fn mixed_surfaces_share_out_by_weight() {
    let mut world = World::new();
    let polished = world.shiny(Rgb::splat(0.3), Specular::Mirror { reflectance: Rgb::splat(0.5) });
    let gray = world.diffuse(Rgb::splat(0.01));
    // The ceiling is where the mirror sends the beam, and too far away to get much that is scattered diffusely.
    let scene = world
        .quad(Vec3::ZERO, Vec3::X, Vec3::Y, polished)
        .light(LightKind::Directional {
            direction: Vec3A::new(0.6, 0.0, -0.8),
            irradiance: Rgb::ONE,
        })
        .quad(Vec3::new(3.0, 0.0, 4.0), Vec3::Y, Vec3::X, gray)
        .assemble();
    let traced = trace(&scene, 1_000_000, 0);
    let on_floor = counts(&traced, |p| p.position.z < 1e-3);
    let on_ceiling = counts(&traced, |p| decode_octahedral(p.normal).z < -0.9);
    assert!(on_floor[0] > 10_000 && on_floor[1] == 0, "{on_floor:?}");
    assert_share(on_ceiling[1], on_floor[0], 0.5, "reflected");
    // Off to the side by 3 and up by 4: cosines of 0.8 at both ends, at a distance of 5.
    let share = 0.3 * 0.8 * 0.8 / (25.0 * std::f64::consts::PI);
    let sigma = (share / on_floor[0] as f64).sqrt();
    let found = on_ceiling[2] as f64 / on_floor[0] as f64;
    assert!((found - share).abs() < 4.0 * sigma + 0.05 * share, "{found}, not {share} +- {sigma}");
}

#[test]
fn what_a_black_surface_gets_is_not_stored() {
    let mut world = World::new();
    let black = world.diffuse(Rgb::BLACK);
    let scene = world.quad(Vec3::ZERO, Vec3::X, Vec3::Y, black).beam().assemble();
    let traced = trace(&scene, 10_000, 0);
    assert_eq!(counts(&traced, |_| true), [0; 3]);
    assert!(traced.account.absorbed > 0);
}

/// What is there in part gets the irradiance of what is there, and lets the rest of the light through.
#[test]
fn photons_on_a_thin_sheet_are_its_irradiance() {
    const N: u64 = 20_000;
    for opacity in [0.3, 0.8] {
        let mut world = World::new();
        let (sheet, floor) = (world.thin(Rgb::splat(0.5), opacity), world.diffuse(Rgb::ONE));
        let square = |world: World, z: f32, material| {
            world.quad(Vec3::new(-1.0, -1.0, z), 2.0 * Vec3::X, 2.0 * Vec3::Y, material)
        };
        let scene = square(square(world, 0.0, floor), 1.0, sheet).beam().assemble();
        let traced = trace(&scene, N, 1);
        let on = |z: f32| traced.direct.iter().filter(move |p| (p.position.z - z).abs() < 1e-3);
        let irradiance = |z: f32| flux(on(z))[1] / 4.0;
        let (above, below) = (irradiance(1.0), irradiance(0.0));
        assert!((above - 1.0).abs() < 0.03, "{above} on the sheet of {opacity}");
        assert!((below / f64::from(1.0 - opacity) - 1.0).abs() < 0.04, "{below} below {opacity}");
        assert!(on(1.0).count() < on(0.0).count() * 5, "only those that land are stored");
    }
}
