//! Rays that leave a surface neither hit it again nor start behind it.

use base::Ray;
use geometry::{Accel, Surface};
use glam::{DMat3, DVec3, Vec3A};

use crate::shapes::{Placement, cuboid, direction, icosphere, in_ball, mesh, rng};

/// Directions closer to the surface than this may be on the wrong side of it by rounding alone.
const GRAZING: f32 = 1e-6;

/// Leaves a convex body outward and inward. `min_chord` is the shortest way through, divided by the cosine, for rays
/// that aren't grazing.
fn check(accel: &Accel, from: &Surface, dir: Vec3A, min_chord: f32) {
    let cos = dir.dot(from.geometric_normal);
    if cos.abs() < GRAZING {
        return;
    }
    let ray = Ray::unbounded(from.leave(dir), dir);
    let hit = accel.closest_hit(&ray);
    assert_eq!(hit.is_some(), cos < 0.0, "{ray:?} with cosine {cos} from {from:?}: {hit:?}");
    assert_eq!(accel.occluded(&ray), cos < 0.0);
    if let Some(hit) = hit {
        let other = accel.surface(&ray, &hit);
        assert!(
            dir.dot(other.geometric_normal) > 0.0,
            "{ray:?} met the near side, cosine {cos}: {hit:?}"
        );
        if cos < -0.1 {
            assert!(hit.t > -cos * min_chord, "{} with cosine {cos}", hit.t);
        }
    }
}

#[test]
fn convex_bodies_of_any_size_and_place() {
    let rng = &mut rng(20);
    let ball = icosphere(4);
    for place in Placement::all() {
        let meshes = [place.mesh(&ball)];
        let spheres = [place.unit_sphere()];
        for accel in [Accel::build(&meshes, &[]), Accel::build(&[], &spheres)] {
            for _ in 0..100_000 {
                let origin = Vec3A::from(place.point(in_ball(rng) * 0.9));
                let ray = Ray::unbounded(origin, direction(rng));
                let hit = accel.closest_hit(&ray).expect("the origin is inside");
                check(&accel, &accel.surface(&ray, &hit), direction(rng), place.scale as f32);
            }
        }
    }
}

fn turned() -> DMat3 {
    DMat3::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.7)
}

/// Near a corner at the origin a position has far more digits than at the others, and must use them.
#[test]
fn faces_ten_thousand_times_larger_than_what_is_looked_at() {
    let rng = &mut rng(21);
    for turn in [DMat3::IDENTITY, turned()] {
        let body = cuboid(DVec3::ZERO, DVec3::splat(1e4), |p| turn * p);
        let accel = Accel::build(&[body], &[]);
        for scale in [1.0, 1e-2] {
            for _ in 0..50_000 {
                let inside = (in_ball(rng) + 1.0) * scale;
                let outside = -(in_ball(rng) + 1.0) * scale;
                let (inside, outside) = ((turn * inside).as_vec3a(), (turn * outside).as_vec3a());
                let ray = Ray::unbounded(inside, (outside - inside).normalize());
                let Some(hit) = accel.closest_hit(&ray) else { panic!("{ray:?} leaks") };
                let surface = accel.surface(&ray, &hit);
                let along = ray.origin().as_dvec3() + ray.dir().as_dvec3() * f64::from(hit.t);
                assert!((surface.position.as_dvec3() - along).length() < 1e-6 * scale, "{ray:?}");
                check(&accel, &surface, direction(rng), 0.0);
            }
        }
    }
}

#[test]
fn large_floors() {
    let rng = &mut rng(22);
    let corner = |x, z| DVec3::new(x, 0.0, z);
    for turn in [DMat3::IDENTITY, turned()] {
        let corners = [corner(0.0, 0.0), corner(0.0, 1e4), corner(1e4, 1e4), corner(1e4, 0.0)];
        let floor = mesh(
            corners.iter().map(|&p| (turn * p).as_vec3()).collect(),
            vec![[0, 1, 2], [0, 2, 3]],
        );
        let accel = Accel::build(&[floor], &[]);
        for _ in 0..100_000 {
            let target = (in_ball(rng) + 1.0) * DVec3::new(0.5, 0.0, 0.5);
            let origin = (turn * (target + DVec3::Y + in_ball(rng))).as_vec3a();
            let ray = Ray::unbounded(origin, ((turn * target).as_vec3a() - origin).normalize());
            // Origins in the plane or targets beyond the edge.
            let Some(hit) = accel.closest_hit(&ray) else { continue };
            let surface = accel.surface(&ray, &hit);
            let dir = direction(rng);
            if dir.dot(surface.geometric_normal).abs() > GRAZING {
                let away = Ray::unbounded(surface.leave(dir), dir);
                assert!(!accel.occluded(&away), "{away:?} from {surface:?}");
            }
        }
    }
}

/// A ball on a floor, touching it: rays between them, where both are closer than any epsilon would allow.
#[test]
fn a_ball_that_touches_the_floor() {
    let rng = &mut rng(23);
    for place in Placement::all() {
        let floor = cuboid(DVec3::new(-9.0, -2.0, -9.0), DVec3::new(9.0, -1.0, 9.0), |p| p);
        let sphere = place.unit_sphere();
        let accel = Accel::build(&[place.mesh(&floor)], &[sphere]);
        // Where the floor is after rounding.
        let gap_error = f64::from(place.point(-DVec3::ONE).abs().max_element()) * 1.2e-7;
        for _ in 0..20_000 {
            let beside = DVec3::new(0.1, 0.0, 0.1) * in_ball(rng) - DVec3::Y;
            let gap = 0.5 * place.scale * (beside.x * beside.x + beside.z * beside.z);
            if gap < 20.0 * gap_error {
                continue;
            }
            let origin = Vec3A::from(place.point(beside + DVec3::Y * 0.999 + in_ball(rng) * 0.1));
            let ray =
                Ray::unbounded(origin, (Vec3A::from(place.point(beside)) - origin).normalize());
            let hit = accel.closest_hit(&ray).expect("the origin is inside the ball");
            // Down through the ball's lower side to the floor, and back up.
            let surface = accel.surface(&ray, &hit);
            assert_eq!(surface.object, 1);
            let down = Ray::unbounded(surface.leave(-Vec3A::Y), -Vec3A::Y);
            let hit = accel.closest_hit(&down).expect("the floor is below");
            let floor = accel.surface(&down, &hit);
            assert_eq!((floor.object, floor.geometric_normal), (0, Vec3A::Y), "{down:?}");
            let up = Ray::unbounded(floor.leave(Vec3A::Y), Vec3A::Y);
            let hit = accel.closest_hit(&up).expect("the ball is above");
            assert_eq!(accel.surface(&up, &hit).object, 1, "{up:?}");
        }
    }
}
