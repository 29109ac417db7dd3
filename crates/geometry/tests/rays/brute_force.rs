//! The BVH against every primitive in turn, in double precision (Möller and Trumbore 1997; the quadratic formula).

use base::{Ray, Rng};
use geometry::{Accel, MaterialId, Mesh, Sphere};
use glam::{DVec3, Quat, Vec3A};

use crate::shapes::{Placement, direction, in_ball, rng};

pub(crate) struct Found {
    pub(crate) t: f64,
    pub(crate) normal: DVec3,
    pub(crate) material: MaterialId,
    pub(crate) object: u32,
}

/// The nearest hit of all, or what makes it doubtful: an edge or a tangent closer than rounding can tell.
pub(crate) fn nearest(
    meshes: &[Mesh],
    spheres: &[Sphere],
    ray: &Ray,
) -> Result<Option<Found>, Doubtful> {
    let (o, d) = (ray.origin().as_dvec3(), ray.dir().as_dvec3());
    let mut nearest: Option<Found> = None;
    let mut consider = |t: f64, normal: DVec3, material: MaterialId, object: usize| {
        if t > 0.0 && t < f64::from(ray.t_max()) && nearest.as_ref().is_none_or(|n| t < n.t) {
            nearest = Some(Found { t, normal, material, object: object as u32 });
        }
    };
    for (object, mesh) in meshes.iter().enumerate() {
        for i in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(i).map(|p| p.as_dvec3());
            let (ab, ac) = (b - a, c - a);
            let p = d.cross(ac);
            let det = ab.dot(p);
            let u = (o - a).dot(p) / det;
            let q = (o - a).cross(ab);
            let v = d.dot(q) / det;
            let inside = u.min(v).min(1.0 - u - v);
            if inside.abs() < 1e-9 {
                return Err(Doubtful);
            }
            if inside > 0.0 {
                consider(ac.dot(q) / det, ab.cross(ac).normalize(), mesh.materials[i], object);
            }
        }
    }
    for (i, sphere) in spheres.iter().enumerate() {
        let (center, radius) = (sphere.center.as_dvec3(), f64::from(sphere.radius));
        let f = o - center;
        let (a, b, c) = (d.dot(d), 2.0 * f.dot(d), f.dot(f) - radius * radius);
        let discriminant = b * b - 4.0 * a * c;
        if discriminant.abs() < 1e-9 * radius * radius {
            return Err(Doubtful);
        }
        for sign in [-1.0, 1.0] {
            let t = (-b + sign * discriminant.sqrt()) / (2.0 * a);
            consider(t, (f + d * t) / radius, sphere.material, meshes.len() + i);
        }
    }
    Ok(nearest)
}

#[derive(Debug)]
pub(crate) struct Doubtful;

/// Compares one ray in every respect; returns whether it hit.
pub(crate) fn check(
    accel: &Accel,
    meshes: &[Mesh],
    spheres: &[Sphere],
    ray: &Ray,
) -> Result<bool, Doubtful> {
    let expected = nearest(meshes, spheres, ray)?;
    let hit = accel.closest_hit(ray);
    assert_eq!(accel.occluded(ray), expected.is_some(), "{ray:?}");
    assert_eq!(hit.is_some(), expected.is_some(), "{ray:?}");
    let (Some(hit), Some(expected)) = (hit, expected) else { return Ok(false) };
    let surface = accel.surface(ray, &hit);
    let named = accel.surface_on(ray, surface.primitive);
    assert_eq!(format!("{named:?}"), format!("{:?}", Some(surface)), "the same to the bit");
    // Units in the last place of the distance; the direction's length is 1 only to single precision.
    assert!((f64::from(hit.t) - expected.t).abs() < 5e-7 * expected.t, "{} {}", hit.t, expected.t);
    assert_eq!((surface.material, surface.object), (expected.material, expected.object), "{ray:?}");
    let normal = surface.geometric_normal.as_dvec3();
    assert!((normal - expected.normal).length() < 1e-5, "{normal} {}", expected.normal);
    let position = ray.origin().as_dvec3() + ray.dir().as_dvec3() * expected.t;
    let off = (surface.position.as_dvec3() - position).abs();
    assert!(off.cmple(position.abs() * 1.2e-7 + 1e-6 * expected.t).all(), "{off} at {position}");
    let height = (surface.position.as_dvec3() - position).dot(expected.normal).abs();
    assert!(
        height <= f64::from(surface.error) + 1e-15 * expected.t,
        "{height} above {}",
        surface.error
    );
    Ok(true)
}

/// Triangles and spheres of all sizes up to a few tenths in the unit ball; no two triangles of a material in a mesh.
fn soup(
    rng: &mut Rng,
    place: Placement,
    n_meshes: usize,
    n_triangles: usize,
    n_spheres: usize,
) -> (Vec<Mesh>, Vec<Sphere>) {
    let mut size = {
        let mut rng = rng.clone();
        move || 0.4 * 10.0_f64.powf(-2.0 * f64::from(rng.next_f32()))
    };
    let meshes = (0..n_meshes)
        .map(|m| {
            let mut mesh = Mesh::default();
            for t in 0..n_triangles {
                let (middle, size) = (in_ball(rng), size());
                let first = mesh.positions.len() as u32;
                mesh.positions.extend((0..3).map(|_| place.point(middle + in_ball(rng) * size)));
                mesh.triangles.push([first, first + 1, first + 2]);
                mesh.materials.push(MaterialId((m * n_triangles + t) as u16));
            }
            mesh
        })
        .collect();
    let spheres = (0..n_spheres)
        .map(|i| Sphere {
            center: place.point(in_ball(rng)),
            radius: (size() * 0.3 * place.scale) as f32,
            rotation: Quat::IDENTITY,
            material: MaterialId(60_000 + i as u16),
        })
        .collect();
    (meshes, spheres)
}

#[test]
fn soups_agree_with_every_primitive_in_turn() {
    let rng = &mut rng(1);
    let mut total_hits = 0;
    for place in Placement::all() {
        for (n_meshes, n_triangles, n_spheres) in [(1, 1, 0), (0, 0, 1), (3, 40, 15), (2, 300, 60)]
        {
            let (meshes, spheres) = soup(rng, place, n_meshes, n_triangles, n_spheres);
            let accel = Accel::build(&meshes, &spheres);
            assert_eq!(accel.n_primitives(), n_meshes * n_triangles + n_spheres);
            let (mut n_doubtful, mut n_hits) = (0, 0);
            const RAYS: u32 = 2000;
            for i in 0..RAYS {
                let origin = place.point(in_ball(rng) * 1.5).into();
                let target = Vec3A::from(place.point(in_ball(rng)));
                let ends = [f32::INFINITY, (0.7 * place.scale) as f32];
                let ray = Ray::new(origin, (target - origin).normalize(), ends[i as usize % 2]);
                match check(&accel, &meshes, &spheres, &ray) {
                    Ok(hit) => n_hits += u32::from(hit),
                    Err(Doubtful) => n_doubtful += 1,
                }
            }
            assert!(n_doubtful <= 2, "{n_doubtful} rays in doubt for {place:?}");
            total_hits += n_hits;
        }
    }
    assert!(total_hits > 7000, "{total_hits} hits");
}

#[test]
fn rays_from_far_away_agree() {
    let rng = &mut rng(2);
    let place = Placement { scale: 1.0, offset: 0.0 };
    let (meshes, spheres) = soup(rng, place, 2, 300, 60);
    let accel = Accel::build(&meshes, &spheres);
    for distance in [5.0, 30.0, 1e3, 1e5] {
        let mut n_hits = 0;
        for _ in 0..2000 {
            let origin = direction(rng) * distance;
            let dir = (Vec3A::from(in_ball(rng).as_vec3()) - origin).normalize();
            // What an origin's last digit moves isn't this test's matter: the same ray for both, near the scene.
            let near = (origin.as_dvec3() + dir.as_dvec3() * f64::from(distance - 2.0)).as_vec3a();
            let (far, near) = (Ray::unbounded(origin, dir), Ray::unbounded(near, dir));
            let (a, b) = (accel.closest_hit(&far), nearest(&meshes, &spheres, &near));
            let Ok(b) = b else { continue };
            let tolerance = 2e-7 * distance;
            if let (Some(a), Some(b)) = (&a, &b) {
                n_hits += 1;
                let t = f64::from(distance - 2.0) + b.t;
                let same = (f64::from(a.t) - t).abs() < 20.0 * f64::from(tolerance);
                let surface = accel.surface(&far, a);
                let on_it =
                    (surface.position - near.at(b.t as f32)).length() < 50.0 * tolerance + 1e-6;
                // Beside an edge the two may part.
                n_hits -= u32::from(!(same && on_it));
            }
        }
        assert!(n_hits > 500, "{n_hits} hits from {distance}");
    }
}

#[test]
fn shading_normals_are_interpolated_and_never_behind() {
    let rng = &mut rng(3);
    let (mut meshes, _) = soup(rng, Placement { scale: 1.0, offset: 0.0 }, 2, 200, 0);
    // One mesh has normals that point anywhere; the other has none.
    meshes[0].normals = meshes[0].positions.iter().map(|_| direction(rng).into()).collect();
    let accel = Accel::build(&meshes, &[]);
    let mut n_interpolated = 0;
    for _ in 0..20_000 {
        let ray = Ray::unbounded(in_ball(rng).as_vec3().into(), direction(rng));
        let Some(hit) = accel.closest_hit(&ray) else { continue };
        let surface = accel.surface(&ray, &hit);
        let (n_g, n_s) = (surface.geometric_normal, surface.shading_normal);
        assert!(n_s.dot(n_g) > 0.0 && (n_s.length() - 1.0).abs() < 1e-5, "{n_s} of {n_g}");
        for w_o in [-ray.dir(), ray.dir()] {
            let side = surface.facing(w_o);
            assert!(side.geometric_normal.dot(w_o) >= 0.0);
            assert!(side.shading_normal.dot(side.geometric_normal) > 0.0);
        }
        if surface.object == 1 {
            assert_eq!(n_s, n_g);
            continue;
        }
        let mesh = &meshes[0];
        let triangle = usize::from(surface.material.0);
        let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
        let [na, nb, nc] = mesh.triangles[triangle].map(|i| mesh.normals[i as usize].as_dvec3());
        let p = surface.position.as_dvec3();
        let area = |p: DVec3, q: DVec3, r: DVec3| (q - p).cross(r - p).dot(n_g.as_dvec3());
        let n = (na * area(p, b, c) + nb * area(a, p, c) + nc * area(a, b, p)).normalize();
        let n = n * n.dot(n_g.as_dvec3()).signum();
        if n.dot(n_g.as_dvec3()) > 0.05 {
            n_interpolated += 1;
            assert!((n - n_s.as_dvec3()).length() < 2e-3, "{n} {n_s}");
        }
    }
    assert!(n_interpolated > 1000, "{n_interpolated}");
}
