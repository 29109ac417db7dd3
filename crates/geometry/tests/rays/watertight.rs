//! Nothing gets out of a closed surface.

use base::Ray;
use geometry::{Accel, Mesh};
use glam::{DVec3, Vec3A};

use crate::shapes::{Placement, direction, icosphere, in_ball, rng};

/// The number of rays that miss the surface around them.
fn leaks(accel: &Accel, rays: impl Iterator<Item = Ray>) -> usize {
    rays.filter(|ray| accel.closest_hit(ray).is_none() || !accel.occluded(ray)).count()
}

fn towards(origin: Vec3A, target: DVec3) -> Ray {
    Ray::unbounded(origin, (target - origin.as_dvec3()).normalize().as_vec3a())
}

/// Points on the edges of a mesh, in double precision, and its corners.
fn edge_points(mesh: &Mesh) -> impl Fn(u32, f64) -> DVec3 {
    |i, x| {
        let [a, b, _] = mesh.corners(i as usize % mesh.triangles.len()).map(|p| p.as_dvec3());
        a + (b - a) * x
    }
}

#[test]
fn no_ray_leaves_a_closed_mesh() {
    let rng = &mut rng(10);
    let accel = Accel::build(&[icosphere(5)], &[]);
    let mesh = icosphere(5);
    let edge_point = edge_points(&mesh);
    let mut inside = {
        let mut rng = rng.clone();
        move || (in_ball(&mut rng) * 0.9).as_vec3a()
    };
    const N: u32 = 1_000_000;
    let random = (0..N).map(|_| Ray::unbounded(inside(), direction(rng)));
    assert_eq!(leaks(&accel, random), 0, "random rays");
    let edges = (0..N).map(|i| towards(inside(), edge_point(i, f64::from(rng.next_f32()))));
    assert_eq!(leaks(&accel, edges), 0, "rays aimed at edges");
    let corners = (0..N).map(|i| towards(inside(), edge_point(i, 0.0)));
    assert_eq!(leaks(&accel, corners), 0, "rays aimed at corners");
    // From the middle, directions are the corners themselves, and many run along axes and planes of symmetry.
    let middle = mesh.positions.iter().map(|&p| towards(Vec3A::ZERO, p.as_dvec3()));
    assert_eq!(leaks(&accel, middle), 0, "rays from the middle");
}

#[test]
fn size_and_place_make_no_holes() {
    let rng = &mut rng(11);
    for place in Placement::all() {
        let mesh = place.mesh(&icosphere(4));
        let accel = Accel::build(std::slice::from_ref(&mesh), &[]);
        let edge_point = edge_points(&mesh);
        for kind in ["random", "edges", "corners"] {
            let rays = (0..50_000).map(|i| {
                let origin = Vec3A::from(place.point(in_ball(rng) * 0.9));
                match kind {
                    "random" => Ray::unbounded(origin, direction(rng)),
                    "edges" => towards(origin, edge_point(i, f64::from(rng.next_f32()))),
                    _ => towards(origin, edge_point(i, 0.0)),
                }
            });
            assert_eq!(leaks(&accel, rays), 0, "{kind} {place:?}");
        }
    }
}

#[test]
fn distance_makes_no_holes() {
    let rng = &mut rng(12);
    let mesh = icosphere(5);
    let accel = Accel::build(std::slice::from_ref(&mesh), &[]);
    let edge_point = edge_points(&mesh);
    for distance in [3.0, 100.0, 3000.0] {
        let rays = (0..100_000).filter_map(|i| {
            let target = edge_point(i, if i % 2 == 0 { 0.0 } else { f64::from(rng.next_f32()) });
            let origin = direction(rng) * distance;
            // Well away from the outline, where a ray may as well miss.
            let ray = towards(origin, target);
            (ray.dir().as_dvec3().dot(target) < -0.3).then_some(ray)
        });
        assert_eq!(leaks(&accel, rays), 0, "from {distance}");
    }
}
