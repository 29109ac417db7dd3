//! Texture coordinates at hits.

use base::Ray;
use geometry::{Accel, MaterialId, Mesh, Sphere};
use glam::{DVec3, Quat, Vec2, Vec3, Vec3A};

use crate::shapes::{direction, icosphere, in_ball, mesh, rng};

/// Where a ray meets the scene, and its texture coordinates.
fn hit(accel: &Accel, origin: Vec3A, dir: Vec3A) -> (Vec3A, Option<Vec2>) {
    let ray = Ray::unbounded(origin, dir.normalize());
    let surface = accel.surface(&ray, &accel.closest_hit(&ray).expect("it is aimed at"));
    (surface.position, accel.uv(&surface))
}

#[test]
fn they_are_interpolated_over_triangles() {
    // Coordinates that are affine in the place are so everywhere, whatever the triangles.
    let map = |p: Vec3| Vec2::new(0.3 * p.x - 0.2 * p.y + p.z + 4.0, p.y * 2.0 - p.x);
    let mut body = icosphere(2);
    body.uvs = body.positions.iter().map(|&p| map(p)).collect();
    let bare = mesh(
        vec![Vec3::new(0.0, 9.0, 0.0), Vec3::new(1.0, 9.0, 0.0), Vec3::new(0.0, 9.0, 1.0)],
        vec![[0, 1, 2]],
    );
    let accel = Accel::build(&[bare, body], &[]);
    let mut rng = rng(7);
    for _ in 0..1000 {
        let dir = direction(&mut rng);
        let origin = Vec3A::from((in_ball(&mut rng) * 0.5).as_vec3());
        let (position, uv) = hit(&accel, origin, dir);
        let error = (uv.unwrap() - map(position.into())).abs().max_element();
        assert!(error < 4e-6, "{error} at {position}");
    }
    assert_eq!(hit(&accel, Vec3A::new(0.2, 8.0, 0.2), Vec3A::Y).1, None, "on a mesh without");
}

#[test]
fn spheres_carry_a_map_of_the_world() {
    let sphere = |rotation| Sphere {
        center: Vec3::new(5.0, -2.0, 1.0),
        radius: 0.5,
        rotation,
        material: MaterialId(0),
    };
    let at = |rotation, out: Vec3A| {
        let accel = Accel::build(&[] as &[Mesh], &[sphere(rotation)]);
        let center = Vec3A::new(5.0, -2.0, 1.0);
        hit(&accel, center + out * 3.0, -out).1.unwrap()
    };
    let places = [
        (Vec3A::X, [0.0, 0.5]),
        (-Vec3A::Z, [0.25, 0.5]),
        (-Vec3A::X, [0.5, 0.5]),
        (Vec3A::Z, [0.75, 0.5]),
        (Vec3A::new(1.0, 1.0, -1e-3), [0.0, 0.75]),
        (Vec3A::new(1e-3, -1.0, -1e-3), [0.125, 0.0]),
    ];
    for (out, expected) in places {
        let uv = at(Quat::IDENTITY, out.normalize());
        let error = (uv - Vec2::from_array(expected)).abs();
        assert!(error.max_element() < 1e-3, "{uv} at {out}");
        // Turned about the pole by a quarter, the map is a quarter further.
        let turned = at(Quat::from_rotation_y(std::f32::consts::FRAC_PI_2), out.normalize());
        let back = (uv.x - turned.x).rem_euclid(1.0);
        assert!((back - 0.25).abs() < 1e-5 && (turned.y - uv.y).abs() < 1e-5, "{uv} {turned}");
    }
    // Turned so that +z is the pole, as in other programs.
    let tilted = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    let pole = at(tilted, DVec3::new(1e-4, 0.0, 1.0).normalize().as_vec3a());
    assert!((pole.y - 1.0).abs() < 1e-3, "{pole}");
}
