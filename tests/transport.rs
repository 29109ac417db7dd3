//! What the renderer shows, against the path tracer, on every kind of light and material.

use std::path::{Path, PathBuf};

use base::Rgb;
use glam::{Mat3A, Vec3, Vec3A};
use scene::{Camera, EnvironmentMap, FovAxis, LightKind, Material, Parts, Specular, Spot};

use crate::agreement::{Case, assert_agreement};
use crate::scenes::{
    add_light, add_mesh, add_sphere, black, cuboid, diffuse, emissive, empty, faceted_ball, glass,
    mirror, pane, quad, room, smooth_ball,
};

pub(crate) fn from_file(name: &str) -> Parts {
    let path: PathBuf =
        [env!("CARGO_MANIFEST_DIR"), "..", "scenes", name, "scene.toml"].iter().collect();
    let options = scene::Options { definitions: Vec::new(), lenient: false, no_external: false };
    let (parts, warnings) = scene::load_parts(Path::new(&path), &options).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    parts
}

/// The room, seen from where no edge runs through the middles of pixels: there it is up to rounding what they show.
fn room_from_aside(lamp_side: f32) -> Parts {
    let eye = Vec3::new(0.13, 0.94, 3.9);
    let camera = Camera::look_at(eye, Vec3::new(0.02, 1.01, 0.0), Vec3::Y, 38.0, FovAxis::Y);
    Parts { camera, ..room(lamp_side) }
}

fn gold() -> Material {
    let (eta, k) = (Rgb::new(0.18, 0.42, 1.37), Rgb::new(3.42, 2.35, 1.77));
    Material { specular: Specular::Metal { eta, k }, ..black() }
}

fn green_glass() -> Material {
    let absorption = Rgb::new(2.0, 0.3, 1.0);
    Material { specular: Specular::Glass { ior: 1.5, absorption }, ..black() }
}

/// Reflects diffusely and as a mirror.
fn polished() -> Material {
    Material { albedo: Rgb::new(0.2, 0.4, 0.5), ..mirror(0.3) }
}

#[test]
fn cornell_box() {
    assert_agreement(&Case {
        name: "cornell-box".into(),
        parts: from_file("cornell-box"),
        samples_per_pixel: 512,
        photons: 4_000_000,
        radius: 0.06,
        side: 64,
    });
}

#[test]
fn rabbit() {
    assert_agreement(&Case {
        name: "rabbit".into(),
        parts: from_file("rabbit"),
        samples_per_pixel: 256,
        photons: 3_000_000,
        radius: 0.07,
        side: 64,
    });
}

/// A quad, a mesh, a point, a spot, a sun and a sky, all surfaces diffuse.
#[test]
fn each_light() {
    assert_agreement(&Case {
        name: "each-light".into(),
        parts: from_file("tests/each-light"),
        samples_per_pixel: 256,
        photons: 6_000_000,
        radius: 0.06,
        side: 64,
    });
}

/// A light of too many pieces for a sum in closed form, between metal and a polished floor.
#[test]
fn glowing_ball() {
    let mut parts = room_from_aside(0.3);
    parts.meshes.remove(0);
    let floor = quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    add_mesh(&mut parts, floor, polished());
    let ball = Material { albedo: Rgb::splat(0.4), ..emissive(Rgb::new(4.0, 2.0, 1.0)) };
    add_mesh(&mut parts, faceted_ball(Vec3::new(-0.35, 1.2, -0.2), 0.3, 6), ball);
    add_sphere(&mut parts, Vec3::new(0.4, 0.4, 0.1), 0.35, gold());
    assert_agreement(&Case {
        name: "glowing-ball".into(),
        parts,
        samples_per_pixel: 512,
        photons: 2_000_000,
        radius: 0.03,
        side: 64,
    });
}

/// Caustics of a lamp that paths through glass find often: clear and absorbing glass, round and flat, and a mirror.
#[test]
fn glass_and_mirrors() {
    let mut parts = room_from_aside(1.5);
    add_sphere(&mut parts, Vec3::new(-0.45, 0.45, 0.2), 0.4, glass(1.5));
    let block = cuboid(Vec3::new(0.15, 0.1, 0.1), Vec3::new(0.7, 0.8, 0.5));
    add_mesh(&mut parts, block, green_glass());
    add_sphere(&mut parts, Vec3::new(0.3, 1.3, -0.5), 0.4, mirror(0.9));
    assert_agreement(&Case {
        name: "glass-and-mirrors".into(),
        parts,
        samples_per_pixel: 512,
        photons: 2_000_000,
        radius: 0.03,
        side: 64,
    });
}

/// Only the sky shines, on the ground and through glass, and is seen directly, mirrored and refracted.
#[test]
fn under_the_sky() {
    let mut parts = empty(Vec3::new(0.31, 1.7, 6.1), Vec3::new(0.0, 0.62, 0.1), 34.0);
    add_light(&mut parts, LightKind::Environment { radiance: Rgb::new(0.6, 0.8, 1.2) });
    let ground = quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0);
    add_mesh(&mut parts, ground, diffuse(Rgb::new(0.7, 0.6, 0.4)));
    let block = cuboid(Vec3::new(-1.5, 0.0, -1.4), Vec3::new(-0.3, 1.3, -0.4));
    add_mesh(&mut parts, block, diffuse(Rgb::splat(0.6)));
    add_sphere(&mut parts, Vec3::new(-0.4, 0.5, 0.6), 0.45, glass(1.5));
    add_sphere(&mut parts, Vec3::new(0.7, 0.5, -0.3), 0.5, gold());
    add_sphere(&mut parts, Vec3::new(1.0, 0.3, 0.9), 0.28, polished());
    assert_agreement(&Case {
        name: "under-the-sky".into(),
        parts,
        samples_per_pixel: 256,
        photons: 6_000_000,
        radius: 0.05,
        side: 64,
    });
}

/// Sun, sky and ground of an image, on the ground, through glass and on rough metal; a lamp besides.
#[test]
fn under_an_image() {
    let mut parts = empty(Vec3::new(0.31, 1.7, 6.1), Vec3::new(0.0, 0.62, 0.1), 34.0);
    let texel = |i: u32| match (i % 32, i / 32) {
        // As large as paths find it often.
        (6..10, 3..6) => Rgb::new(9.0, 7.0, 4.0),
        (x, 0..8) => Rgb::new(0.2, 0.3, 0.5) * (1.0 + 0.05 * x as f32),
        _ => Rgb::new(0.15, 0.1, 0.05),
    };
    let to_world = Mat3A::from_rotation_y(0.4) * Mat3A::from_rotation_x(0.2);
    let map = EnvironmentMap::new([32, 16], (0..512).map(texel).collect(), to_world);
    add_light(&mut parts, LightKind::EnvironmentMap(map));
    let ground = quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0);
    add_mesh(&mut parts, ground, diffuse(Rgb::new(0.7, 0.6, 0.4)));
    let block = cuboid(Vec3::new(-1.5, 0.0, -1.4), Vec3::new(-0.3, 1.3, -0.4));
    add_mesh(&mut parts, block, diffuse(Rgb::splat(0.6)));
    let lamp = quad(Vec3::new(-1.4, 1.9, -0.3), Vec3::X * 0.8, Vec3::Z * 0.6);
    add_mesh(&mut parts, lamp, emissive(Rgb::new(2.0, 3.0, 4.0)));
    add_sphere(&mut parts, Vec3::new(-0.4, 0.5, 0.6), 0.45, glass(1.5));
    add_sphere(&mut parts, Vec3::new(0.7, 0.5, -0.3), 0.5, Material { roughness: 0.3, ..gold() });
    add_sphere(&mut parts, Vec3::new(1.0, 0.3, 0.9), 0.28, polished());
    assert_agreement(&Case {
        name: "under-an-image".into(),
        parts,
        samples_per_pixel: 512,
        photons: 6_000_000,
        radius: 0.05,
        side: 64,
    });
}

/// A lamp behind a pane, which shows the room twice.
#[test]
fn behind_a_pane() {
    let mut parts = room_from_aside(1.5);
    let ceiling = quad(Vec3::new(-0.99, 1.7, -0.99), Vec3::X * 1.98, Vec3::Z * 1.98);
    add_mesh(&mut parts, ceiling, pane(1.5));
    let window = quad(Vec3::new(-0.8, 0.1, 0.5), Vec3::X * 1.1, Vec3::new(0.0, 1.2, -0.6));
    add_mesh(&mut parts, window, pane(2.2));
    let block = cuboid(Vec3::new(0.15, 0.1, -0.5), Vec3::new(0.7, 0.8, 0.0));
    add_mesh(&mut parts, block, diffuse(Rgb::new(0.2, 0.5, 0.7)));
    assert_agreement(&Case {
        name: "behind-a-pane".into(),
        parts,
        samples_per_pixel: 512,
        photons: 2_000_000,
        radius: 0.03,
        side: 64,
    });
}

/// A room through a wide lens: a block in focus, a glass ball before and a mirror behind.
#[test]
fn through_a_lens() {
    let eye = Vec3::new(0.13, 0.94, 3.9);
    let camera = Camera::look_at(eye, Vec3::new(0.02, 0.6, 0.0), Vec3::Y, 30.0, FovAxis::Y);
    let mut parts = Parts { camera: camera.with_lens(0.25, 3.6), ..room(1.5) };
    add_sphere(&mut parts, Vec3::new(-0.4, 0.3, 0.7), 0.25, glass(1.5));
    let block = cuboid(Vec3::new(0.15, 0.1, 0.1), Vec3::new(0.7, 0.8, 0.5));
    add_mesh(&mut parts, block, diffuse(Rgb::new(0.2, 0.5, 0.7)));
    add_sphere(&mut parts, Vec3::new(-0.3, 0.5, -0.6), 0.35, mirror(0.9));
    assert_agreement(&Case {
        name: "through-a-lens".into(),
        parts,
        samples_per_pixel: 512,
        photons: 2_000_000,
        radius: 0.03,
        side: 64,
    });
}

/// A spot at one side of a room; a mirror and a glass ball at the other see by its light, but none of it comes to them
/// directly, since the path tracer couldn't follow it further.
#[test]
fn spot_and_mirrors() {
    let mut parts = room_from_aside(0.5);
    parts.meshes.pop();
    let position = Vec3A::new(-0.5, 1.7, 0.3);
    let direction = (Vec3A::new(-0.6, 0.0, -0.3) - position).normalize();
    let intensity = Rgb::new(9.0, 8.0, 7.0);
    let spot = Spot { position, direction, intensity, cos_outer: 0.95, cos_inner: 0.98 };
    add_light(&mut parts, LightKind::Spot(spot));
    add_sphere(&mut parts, Vec3::new(0.5, 0.4, 0.2), 0.35, glass(1.5));
    let panel = quad(Vec3::new(0.99, 0.3, 0.6), Vec3::Y * 1.2, Vec3::Z * -1.2);
    add_mesh(&mut parts, panel, mirror(0.8));
    assert_agreement(&Case {
        name: "spot-and-mirrors".into(),
        parts,
        samples_per_pixel: 256,
        photons: 2_000_000,
        radius: 0.03,
        side: 64,
    });
}

/// Rough metal, glass and a brushed plate, under a lamp and a point.
#[test]
fn rough_surfaces() {
    assert_agreement(&Case {
        name: "rough".into(),
        parts: from_file("tests/rough"),
        samples_per_pixel: 512,
        photons: 3_000_000,
        radius: 0.03,
        side: 64,
    });
}

/// Triangles with normals that lie far from those of the surface: balls of few triangles, and a floor whose normals all
/// lean by 35 degrees.
#[test]
fn smooth_meshes() {
    // From close by: the balls and the floor fill the picture.
    let eye = Vec3::new(-0.1, 1.1, 2.2);
    let camera = Camera::look_at(eye, Vec3::new(0.02, 0.35, 0.0), Vec3::Y, 40.0, FovAxis::Y);
    let mut parts = Parts { camera, ..room(0.7) };
    let floor = &mut parts.meshes[0].1;
    let leaning = Vec3::new(-0.5, 0.82, 0.28).normalize();
    floor.normals = vec![leaning; floor.positions.len()];
    add_mesh(
        &mut parts,
        smooth_ball(Vec3::new(-0.35, 0.55, 0.1), 0.5, 4),
        diffuse(Rgb::splat(0.8)),
    );
    add_mesh(&mut parts, smooth_ball(Vec3::new(0.5, 0.35, 0.4), 0.3, 4), gold());
    assert_agreement(&Case {
        name: "smooth-meshes".into(),
        parts,
        samples_per_pixel: 256,
        photons: 2_000_000,
        radius: 0.03,
        side: 64,
    });
}
