//! What the renderer shows of textures, against the path tracer, and against surfaces made of pieces.

use base::{ImageSize, Rgb};
use geometry::Mesh;
use glam::{Affine2, DVec3, Vec2, Vec3};
use scene::{
    Camera, Filter, FovAxis, Material, Parts, Pattern, Scene, Texels, Texture, TextureId, Wrap,
};

use crate::agreement::{Case, assert_agreement};
use crate::path_tracer;
use crate::scenes::{add_mesh, add_sphere, black, diffuse, mirror, quad, room};

/// Texture coordinates of a quad.
fn unit_square(mesh: Mesh) -> Mesh {
    Mesh { uvs: vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y], ..mesh }
}

/// A material of this texture.
fn textured(parts: &mut Parts, placement: Affine2, pattern: Pattern) -> Material {
    let id = TextureId(parts.textures.len() as u16);
    parts.textures.push((format!("texture {}", id.0), Texture { placement, pattern }));
    Material { albedo_texture: Some(id), ..diffuse(Rgb::new(0.9, 0.8, 0.7)) }
}

/// Gives a quad another material, and texture coordinates.
fn paint(parts: &mut Parts, mesh: usize, material: Material) {
    parts.meshes[mesh].1 = unit_square(parts.meshes[mesh].1.clone());
    let id = parts.meshes[mesh].1.materials[0];
    parts.materials[usize::from(id.0)] = material;
}

/// A few strong colors.
fn bitmap(filter: Filter, wrap: Wrap) -> Pattern {
    let size = [5, 4];
    let texels = (0..20).map(|i| {
        let share = |step: u32| (i * step % 20) as f32 / 19.0;
        Rgb::new(share(7), share(3), share(11))
    });
    Pattern::Bitmap { size, texels: Texels::Floats(texels.collect()), filter, wrap }
}

/// A bitmap as a floor and around a ball, tiles at the wall, a mirror that shows them all, and a polished board.
#[test]
fn textured_room() {
    let mut parts = room(0.7);
    let eye = Vec3::new(0.13, 0.94, 3.9);
    parts.camera = Camera::look_at(eye, Vec3::new(0.02, 1.01, 0.0), Vec3::Y, 38.0, FovAxis::Y);
    let placement = Affine2::from_scale(Vec2::new(1.5, 2.0));
    let floor = textured(&mut parts, placement, bitmap(Filter::Bilinear, Wrap::Mirror));
    paint(&mut parts, 0, floor);
    let turn = Affine2::from_scale_angle_translation(Vec2::splat(2.0), 0.4, Vec2::new(0.3, 0.1));
    let tiles = [Rgb::new(0.1, 0.2, 0.5), Rgb::new(0.9, 0.9, 0.6)];
    let wall = textured(&mut parts, turn, Pattern::Checkerboard(tiles));
    paint(&mut parts, 1, wall);
    let ball = textured(&mut parts, Affine2::IDENTITY, bitmap(Filter::Nearest, Wrap::Repeat));
    add_sphere(&mut parts, Vec3::new(0.45, 0.4, 0.3), 0.37, ball);
    let board = textured(&mut parts, Affine2::IDENTITY, Pattern::Checkerboard(tiles));
    let board = Material { albedo: Rgb::splat(0.6), specular: mirror(0.3).specular, ..board };
    let corner = Vec3::new(-0.75, 0.15, 0.1);
    let leaning = quad(corner, Vec3::new(0.7, 0.0, -0.5), Vec3::new(0.0, 0.65, -0.25));
    add_mesh(&mut parts, unit_square(leaning), board);
    add_sphere(&mut parts, Vec3::new(-0.1, 1.3, -0.3), 0.3, mirror(0.9));
    assert_agreement(&Case {
        name: "textured-room".into(),
        parts,
        samples_per_pixel: 256,
        photons: 4_000_000,
        radius: 0.06,
        side: 64,
    });
}

/// Four by four squares of a texture, and as many quads without: the same light comes back from both.
#[test]
fn a_checkerboard_is_as_good_as_tiles() {
    let size = ImageSize { width: 32, height: 32 };
    let colors = [Rgb::new(0.9, 0.1, 0.3), Rgb::new(0.05, 0.6, 0.2)];
    let corner = Vec3::new(-1.0, 0.01, -1.0);
    let mut board = room(0.7);
    let placement = Affine2::from_scale(Vec2::splat(2.0));
    let material = textured(&mut board, placement, Pattern::Checkerboard(colors));
    let material = Material { albedo: Rgb::ONE, ..material };
    add_mesh(&mut board, unit_square(quad(corner, Vec3::Z * 2.0, Vec3::X * 2.0)), material);
    let mut tiles = room(0.7);
    for i in 0..16 {
        let (along_z, along_x) = (i % 4, i / 4);
        let place = corner + Vec3::new(0.5 * along_x as f32, 0.0, 0.5 * along_z as f32);
        let color = colors[(along_z + along_x) % 2];
        add_mesh(
            &mut tiles,
            quad(place, Vec3::Z * 0.5, Vec3::X * 0.5),
            Material { albedo: color, ..black() },
        );
    }
    let means = [board, tiles].map(|parts| {
        let scene = Scene::assemble(parts.clone());
        let total = path_tracer::render(&parts, &scene, size, 64, 3).total();
        let color = |c: &Rgb| DVec3::from_array(c.to_array().map(f64::from));
        total.values().iter().map(color).sum::<DVec3>() / size.n_pixels() as f64
    });
    // Rays that meet an edge may see either side; all others are the same.
    let ratio = means[0] / means[1];
    assert!((ratio - 1.0).abs().max_element() < 2e-3, "{ratio}");
}
