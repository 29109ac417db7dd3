//! Each kind of light on each class of material: 27 small scenes, of which both pictures must be the same.
//!
//! Three objects stand on a floor before a wall. Those that mirror sharply are kept in the shadow of lights which have no
//! extent, since the path tracer couldn't follow such light any further.

use base::Rgb;
use geometry::Mesh;
use glam::{Affine2, Mat3A, Vec2, Vec3, Vec3A};
use scene::{
    Coat, EnvironmentMap, Filter, LightKind, Material, Parts, Pattern, Specular, Spot, Texels,
    Texture, TextureId, Wrap,
};

use crate::agreement::{Case, assert_agreement};
use crate::scenes::{
    add_light, add_mesh, add_sphere, black, diffuse, emissive, empty, glass, mirror, pane, quad,
};

#[derive(Clone, Copy, Debug)]
enum Lamp {
    Quad,
    Sphere,
    TexturedQuad,
    TexturedSphere,
    Point,
    Spot,
    Sun,
    Sky,
    Image,
}

#[derive(Clone, Copy, Debug)]
enum Group {
    /// A textured wall with holes, rough plastic, rough metal.
    Broad,
    /// A mirror, smooth plastic, glass.
    Sharp,
    /// Rough glass, a pane, a half transparent wall; smooth plastic of a saturated color.
    Passing,
}

/// The texture of a lamp: a spot, off the middle.
const SPOTTED: TextureId = TextureId(0);
/// Two colors.
const BOARD: TextureId = TextureId(1);
/// Holes.
const HOLES: TextureId = TextureId(2);

fn textures() -> Vec<(String, Texture)> {
    let texel = |i: usize| match (i % 8, i / 8) {
        (1..6, 1..5) => Rgb::new(6.0, 4.0, 2.0),
        (x, y) => Rgb::new(0.2, 0.3, 0.1 * (x + y) as f32),
    };
    let spotted = Pattern::Bitmap {
        size: [8, 8],
        texels: Texels::Floats((0..64).map(texel).collect()),
        filter: Filter::Bilinear,
        wrap: Wrap::Repeat,
    };
    let board = Pattern::Checkerboard([Rgb::new(0.9, 0.4, 0.2), Rgb::new(0.2, 0.5, 0.8)]);
    let holes = Pattern::Checkerboard([Rgb::BLACK, Rgb::ONE]);
    [("spotted", spotted, 1.0), ("board", board, 2.0), ("holes", holes, 1.0)]
        .map(|(name, pattern, scale)| {
            let placement = Affine2::from_scale(Vec2::splat(scale));
            (name.to_owned(), Texture { placement, pattern })
        })
        .into()
}

/// A parallelogram with the unit square on it.
fn papered(corner: Vec3, a: Vec3, b: Vec3) -> Mesh {
    Mesh { uvs: vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y], ..quad(corner, a, b) }
}

fn plastic(color: Rgb, is_nonlinear: bool, roughness: f32) -> Material {
    let coat = Coat::new(1.49, Rgb::new(1.0, 0.9, 0.8), is_nonlinear, roughness);
    Material { specular: Specular::Coat(coat), roughness, ..diffuse(color) }
}

fn stage(lamp: Lamp, group: Group) -> Parts {
    let mut parts = empty(Vec3::new(0.1, 1.5, 4.2), Vec3::new(0.0, 0.45, 0.0), 32.0);
    parts.textures = textures();
    let floor = quad(Vec3::new(-1.5, 0.0, -1.0), Vec3::Z * 2.5, Vec3::X * 3.0);
    add_mesh(&mut parts, floor, diffuse(Rgb::new(0.7, 0.6, 0.5)));
    let wall = quad(Vec3::new(-1.5, 0.0, -1.0), Vec3::X * 3.0, Vec3::Y * 2.0);
    add_mesh(&mut parts, wall, diffuse(Rgb::new(0.5, 0.6, 0.7)));

    let (left, middle, right) =
        (Vec3::new(-0.75, 0.38, -0.1), Vec3::new(0.0, 0.32, 0.35), Vec3::new(0.75, 0.38, -0.1));
    let upright = |center: Vec3| {
        let (a, b) = (Vec3::new(0.6, 0.0, 0.3), Vec3::Y * 0.7);
        papered(center - 0.5 * (a + b), a, b)
    };
    match group {
        Group::Broad => {
            let holey = Material {
                albedo_texture: Some(BOARD),
                opacity_texture: Some(HOLES),
                ..diffuse(Rgb::splat(0.8))
            };
            add_mesh(&mut parts, upright(left), holey);
            add_sphere(&mut parts, middle, 0.3, plastic(Rgb::new(0.2, 0.5, 0.3), false, 0.4));
            let (eta, k) = (Rgb::new(0.18, 0.42, 1.37), Rgb::new(3.42, 2.35, 1.77));
            let gold = Material { specular: Specular::Metal { eta, k }, roughness: 0.5, ..black() };
            add_sphere(&mut parts, right, 0.35, gold);
        }
        Group::Sharp => {
            add_sphere(&mut parts, left, 0.35, mirror(0.8));
            add_sphere(&mut parts, middle, 0.3, plastic(Rgb::new(0.6, 0.2, 0.2), false, 0.0));
            add_sphere(&mut parts, right, 0.35, glass(1.5));
        }
        Group::Passing => {
            let half = Material { opacity: 0.4, ..plastic(Rgb::new(0.7, 0.5, 0.1), true, 0.0) };
            add_mesh(&mut parts, upright(left), half);
            add_sphere(&mut parts, middle, 0.3, Material { roughness: 0.4, ..glass(1.5) });
            add_mesh(&mut parts, upright(right), pane(1.5));
        }
    }
    light(&mut parts, lamp);
    let has_extent = !matches!(lamp, Lamp::Point | Lamp::Spot | Lamp::Sun);
    if !has_extent && !matches!(group, Group::Broad) {
        let roof = quad(Vec3::new(-1.25, 1.05, -0.45), Vec3::X * 2.5, Vec3::Z * 1.25);
        add_mesh(&mut parts, roof, diffuse(Rgb::splat(0.4)));
    }
    parts
}

fn light(parts: &mut Parts, lamp: Lamp) {
    let above = papered(Vec3::new(-0.5, 1.9, 0.3), Vec3::X * 1.1, Vec3::Z * 0.9);
    let center = Vec3::new(0.3, 1.7, 0.7);
    let (position, direction) = (Vec3A::new(0.05, 2.4, 0.15), Vec3A::NEG_Y);
    match lamp {
        Lamp::Quad => add_mesh(parts, above, emissive(Rgb::new(5.0, 4.0, 3.0))),
        Lamp::TexturedQuad => {
            let glowing = emissive(Rgb::new(3.0, 4.0, 5.0));
            add_mesh(parts, above, Material { emission_texture: Some(SPOTTED), ..glowing });
        }
        Lamp::Sphere => add_sphere(parts, center, 0.4, emissive(Rgb::new(4.0, 3.0, 5.0))),
        Lamp::TexturedSphere => {
            let glowing = emissive(Rgb::new(3.0, 3.0, 3.0));
            let glowing = Material { emission_texture: Some(BOARD), ..glowing };
            add_sphere(parts, center, 0.4, glowing);
        }
        Lamp::Point => {
            add_light(parts, LightKind::Point { position, intensity: Rgb::new(5.0, 4.0, 6.0) });
        }
        Lamp::Spot => {
            let intensity = Rgb::new(9.0, 7.0, 5.0);
            let spot = Spot { position, direction, intensity, cos_outer: 0.7, cos_inner: 0.85 };
            add_light(parts, LightKind::Spot(spot));
        }
        Lamp::Sun => {
            let direction = Vec3A::new(0.1, -1.0, -0.15).normalize();
            let irradiance = Rgb::new(2.0, 1.8, 1.5);
            add_light(parts, LightKind::Directional { direction, irradiance });
        }
        Lamp::Sky => {
            add_light(parts, LightKind::Environment { radiance: Rgb::new(0.6, 0.8, 1.0) });
        }
        Lamp::Image => {
            let texel = |i: u32| match (i % 32, i / 32) {
                (6..10, 3..6) => Rgb::new(9.0, 7.0, 4.0),
                (x, 0..8) => Rgb::new(0.2, 0.3, 0.5) * (1.0 + 0.05 * x as f32),
                _ => Rgb::new(0.15, 0.1, 0.05),
            };
            let to_world = Mat3A::from_rotation_y(0.9);
            let map = EnvironmentMap::new([32, 16], (0..512).map(texel).collect(), to_world);
            add_light(parts, LightKind::EnvironmentMap(map));
        }
    }
}

fn check(lamp: Lamp, group: Group) {
    // Where bright places are small, few paths find them, and few rays of the rough glass.
    let (samples_per_pixel, side) = match (lamp, group) {
        (Lamp::TexturedQuad, Group::Passing) => (1024, 80),
        (Lamp::TexturedQuad, Group::Sharp) | (Lamp::Image, Group::Broad | Group::Passing) => {
            (4096, 32)
        }
        _ => (1024, 32),
    };
    assert_agreement(&Case {
        name: format!("table-{lamp:?}-{group:?}"),
        parts: stage(lamp, group),
        samples_per_pixel,
        photons: 1_200_000,
        radius: 0.05,
        side,
    });
}

#[test]
fn a_quad() {
    check(Lamp::Quad, Group::Passing);
}

#[test]
fn a_sphere() {
    check(Lamp::Sphere, Group::Sharp);
}

#[test]
fn a_textured_quad() {
    check(Lamp::TexturedQuad, Group::Broad);
}

#[test]
fn a_textured_sphere() {
    check(Lamp::TexturedSphere, Group::Passing);
}

#[test]
fn a_point() {
    check(Lamp::Point, Group::Broad);
}

#[test]
fn a_spot() {
    check(Lamp::Spot, Group::Sharp);
}

#[test]
fn parallel_light() {
    check(Lamp::Sun, Group::Passing);
}

#[test]
fn a_sky() {
    check(Lamp::Sky, Group::Broad);
}

#[test]
fn an_image() {
    check(Lamp::Image, Group::Sharp);
}

#[test]
fn quads_on_the_rest() {
    check(Lamp::Quad, Group::Broad);
    check(Lamp::Quad, Group::Sharp);
}

#[test]
fn spheres_on_the_rest() {
    check(Lamp::Sphere, Group::Broad);
    check(Lamp::Sphere, Group::Passing);
}

#[test]
fn textured_quads_on_the_rest() {
    check(Lamp::TexturedQuad, Group::Sharp);
    check(Lamp::TexturedQuad, Group::Passing);
}

#[test]
fn textured_spheres_on_the_rest() {
    check(Lamp::TexturedSphere, Group::Broad);
    check(Lamp::TexturedSphere, Group::Sharp);
}

#[test]
fn points_on_the_rest() {
    check(Lamp::Point, Group::Sharp);
    check(Lamp::Point, Group::Passing);
}

#[test]
fn spots_on_the_rest() {
    check(Lamp::Spot, Group::Broad);
    check(Lamp::Spot, Group::Passing);
}

#[test]
fn suns_on_the_rest() {
    check(Lamp::Sun, Group::Broad);
    check(Lamp::Sun, Group::Sharp);
}

#[test]
fn skies_on_the_rest() {
    check(Lamp::Sky, Group::Sharp);
    check(Lamp::Sky, Group::Passing);
}

#[test]
fn images_on_the_rest() {
    check(Lamp::Image, Group::Broad);
    check(Lamp::Image, Group::Passing);
}
