//! Known ways in which ray tracing goes wrong, one test each.

use base::Ray;
use geometry::{Accel, MaterialId, Sphere};
use glam::{DVec3, Quat, Vec3, Vec3A};

use crate::brute_force;
use crate::shapes::{cuboid, direction, icosphere, in_ball, mesh, rng};

#[test]
fn an_empty_scene_is_never_hit() {
    let accel = Accel::build(&[], &[]);
    let ray = Ray::unbounded(Vec3A::ONE, Vec3A::Z);
    assert!(accel.closest_hit(&ray).is_none() && !accel.occluded(&ray));
    assert!(accel.bounds().is_empty());
    assert_eq!(accel.n_primitives(), 0);
    let nothing = mesh(vec![Vec3::ONE], Vec::new());
    assert!(Accel::build(&[nothing], &[]).closest_hit(&ray).is_none());
}

/// The BVH tells octants by `< 0.0`, and slabs by the sign bit.
#[test]
fn directions_along_axes_with_either_zero() {
    let body = [cuboid(DVec3::new(-1.0, -2.0, -0.5), DVec3::new(1.5, 1.0, 2.5), |p| p)];
    let accel = Accel::build(&body, &[]);
    let components = [-0.0, 0.0, 1.0, -1.0];
    let mut n_directions = 0;
    for (x, y, z) in (0..64).map(|i| (components[i % 4], components[i / 4 % 4], components[i / 16]))
    {
        let dir = Vec3A::new(x, y, z);
        if dir == Vec3A::ZERO {
            continue;
        }
        n_directions += 1;
        for origin in [Vec3A::new(0.1, 0.2, 0.3), Vec3A::ZERO, Vec3A::new(-0.25, 0.75, 2.25)] {
            let ray = Ray::unbounded(origin, dir.normalize());
            let hit = accel.closest_hit(&ray).unwrap_or_else(|| panic!("{dir:?} misses"));
            assert!(accel.occluded(&ray));
            // Along a diagonal of a face the brute force can't tell the triangles apart, but planes it can.
            let expected = (0..3)
                .filter(|&k| ray.dir()[k] != 0.0)
                .map(|k| {
                    let wall =
                        if ray.dir()[k] > 0.0 { accel.bounds().max } else { accel.bounds().min };
                    f64::from(wall[k] - origin[k]) / f64::from(ray.dir()[k])
                })
                .fold(f64::INFINITY, f64::min);
            assert!((f64::from(hit.t) - expected).abs() < 1e-6, "{dir}: {} {expected}", hit.t);
        }
    }
    assert_eq!(n_directions, 56);
}

/// obvhs skips boxes that end within 1e-4 of a ray's origin.
#[test]
fn surfaces_right_before_the_origin() {
    let rng = &mut rng(30);
    for size in [1.0, 1e-3, 1e-6, 1e3_f32] {
        let quad = |z: f32, reversed: bool| {
            let corner = |x: f32, y: f32| Vec3::new(x, y, z) * size;
            let positions =
                [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
            let triangles = if reversed { [[0, 2, 1], [0, 3, 2]] } else { [[0, 1, 2], [0, 2, 3]] };
            mesh(positions.to_vec(), triangles.to_vec())
        };
        let meshes = [quad(0.0, false), quad(1e-4, true)];
        let accel = Accel::build(&meshes, &[]);
        for i in 0..20_000 {
            let origin = Vec3A::new(rng.next_f32(), rng.next_f32(), 5e-5) * size;
            let dir = direction(rng);
            let ray = Ray::unbounded(origin, dir);
            let _ = brute_force::check(&accel, &meshes, &[], &ray);
            if i % 2 == 0 {
                let straight = Ray::unbounded(origin, Vec3A::Z * dir.z.signum());
                let hit = accel.closest_hit(&straight).expect("a quad on either side");
                assert!((hit.t / size - 5e-5).abs() < 1e-10, "{} in a scene of size {size}", hit.t);
            }
        }
    }
}

#[test]
fn a_thousand_triangles_on_one_spot() {
    let rng = &mut rng(31);
    let mut stack = mesh(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]; 1000]);
    stack.materials = (0..1000).map(MaterialId).collect();
    let mut ball = icosphere(2);
    ball.materials.fill(MaterialId(5000));
    let meshes = [stack, ball];
    let accel = Accel::build(&meshes, &[]);
    for _ in 0..3000 {
        let ray = Ray::unbounded((in_ball(rng) * 0.9).as_vec3a(), direction(rng));
        let Ok(expected) = brute_force::nearest(&meshes, &[], &ray) else { continue };
        let expected = expected.expect("the origin is inside the ball");
        let hit = accel.closest_hit(&ray).expect("the origin is inside the ball");
        assert!((f64::from(hit.t) - expected.t).abs() < 5e-7 * expected.t, "{ray:?}");
        assert_eq!(accel.surface(&ray, &hit).object, expected.object);
    }
}

#[test]
fn rays_in_the_plane_of_a_triangle_miss_it() {
    let floor = mesh(vec![Vec3::ZERO, Vec3::X, Vec3::Z], vec![[0, 1, 2]]);
    let accel = Accel::build(&[floor], &[]);
    for dir in [Vec3A::X, Vec3A::Z, Vec3A::new(0.6, 0.0, 0.8), Vec3A::new(0.8, 0.0, -0.6)] {
        for dir in [dir, -dir] {
            let ray = Ray::unbounded(Vec3A::new(0.25, 0.0, 0.25) - dir * 2.0, dir);
            assert!(accel.closest_hit(&ray).is_none(), "{dir}");
            let ray = Ray::unbounded(Vec3A::new(0.25, 0.0, 0.25), dir);
            assert!(accel.closest_hit(&ray).is_none(), "{dir} from within");
        }
    }
}

#[test]
fn rays_end_before_what_lies_at_their_end() {
    let wall = cuboid(DVec3::ZERO, DVec3::ONE, |p| p);
    let accel = Accel::build(&[wall], &[]);
    let ray = |t_max| Ray::new(Vec3A::new(0.25, 0.5, -1.0), Vec3A::Z, t_max);
    assert!(!accel.occluded(&ray(1.0)) && accel.closest_hit(&ray(1.0)).is_none());
    assert!(accel.occluded(&ray(1.0_f32.next_up())));
    assert!(!accel.occluded(&ray(0.0)) && !accel.occluded(&ray(-1.0)));
    let far = |t_max| Ray::new(Vec3A::new(0.25, 0.5, -100.0), Vec3A::Z, t_max);
    assert!(!accel.occluded(&far(99.99)) && accel.occluded(&far(100.01)));
}

#[test]
fn a_primitive_that_a_ray_passes_by_has_no_surface_on_it() {
    let sphere = Sphere {
        center: Vec3::new(5.0, 0.0, 0.0),
        radius: 1.0,
        rotation: Quat::IDENTITY,
        material: MaterialId(0),
    };
    let triangle = mesh(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
    let accel = Accel::build(&[triangle], &[sphere]);
    let [to_triangle, to_sphere, to_nothing] =
        [0.25, 5.0, 3.0].map(|x| Ray::unbounded(Vec3A::new(x, 0.25, -2.0), Vec3A::Z));
    for (ray, other) in [(&to_triangle, &to_sphere), (&to_sphere, &to_triangle)] {
        let hit = accel.closest_hit(ray).unwrap();
        let primitive = accel.surface(ray, &hit).primitive;
        assert!(accel.surface_on(ray, primitive).is_some());
        assert!(accel.surface_on(other, primitive).is_none());
        assert!(accel.surface_on(&to_nothing, primitive).is_none());
    }
    assert!(accel.surface_on(&to_triangle, 2).is_none());
    assert!(accel.surface_on(&to_triangle, u32::MAX).is_none());
}
