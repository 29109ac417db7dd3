//! Rays from one point that meet one triangle, and nothing before it (Reshetov, Soupikov and Hurley 2005, "Multi-Level Ray
//! Tracing Algorithm").

use glam::{DVec3, Vec3, Vec3A, Vec4};

use crate::primitive::{Owner, Primitive, ShearedRay};

/// How far beyond the sides of a frustum a unit direction may point, so that rounding puts no ray out that lies between its
/// corners.
pub(crate) const SLACK: f32 = 1.0 / (1 << 21) as f32;

/// A pyramid of rays from one point that meet one triangle before anything else, if they meet it: see
/// [`crate::Accel::frustum`].
#[derive(Debug)]
pub struct Frustum {
    /// Outer unit normals of its sides, one coordinate of all four in each vector.
    sides: [Vec4; 3],
    /// In scaled units.
    origin: Vec3A,
    pub(crate) facet: Facet,
    /// The triangle as seen from the origin, one coordinate of its corners in each vector.
    seen: [DVec3; 3],
}

/// What is the same at all points of a triangle, in scaled units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facet {
    pub(crate) slot: u32,
    pub(crate) owner: Owner,
    pub(crate) corners: [DVec3; 3],
    /// Unit normal.
    pub(crate) normal: DVec3,
    /// No part lies farther from the origin.
    pub(crate) largest: DVec3,
}

impl Facet {
    #[inline(always)]
    pub(crate) fn new(slot: u32, primitive: &Primitive) -> Self {
        let corners = primitive.corners().map(Vec3::as_dvec3);
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a).normalize();
        let owner = primitive.owner();
        Self { slot, owner, corners, normal, largest: a.abs().max(b.abs()).max(c.abs()) }
    }
}

impl Frustum {
    /// `sides` are outer unit normals.
    pub(crate) fn new(origin: Vec3A, sides: [DVec3; 4], facet: Facet) -> Self {
        let [a, b, c, d] = sides.map(|side| side.as_vec3());
        let [p, q, r] = facet.corners.map(|corner| corner - origin.as_dvec3());
        Self {
            sides: [
                Vec4::new(a.x, b.x, c.x, d.x),
                Vec4::new(a.y, b.y, c.y, d.y),
                Vec4::new(a.z, b.z, c.z, d.z),
            ],
            origin,
            facet,
            seen: [DVec3::new(p.x, q.x, r.x), DVec3::new(p.y, q.y, r.y), DVec3::new(p.z, q.z, r.z)],
        }
    }

    /// Whether all rays between four directions, which lie in the frustum, surely meet the triangle: all of these point into it by
    /// more than rounding can move any.
    pub fn fills(&self, dirs: [Vec3A; 4]) -> bool {
        let [x, y, z] = self.seen;
        let corner = |i: usize| DVec3::new(x[i], y[i], z[i]);
        let [a, b, c] = [corner(0), corner(1), corner(2)];
        let inside = a.dot(b.cross(c)).signum();
        let sides = [a.cross(b), b.cross(c), c.cross(a)].map(|side| side.normalize() * inside);
        let least = 2.0 * f64::from(SLACK);
        // Also if any of it isn't a number.
        dirs.iter().all(|dir| sides.iter().all(|side| side.dot(dir.as_dvec3()) >= least))
    }

    /// The weights of the triangle's corners where a ray from the origin of the frustum meets it, if that is in the frustum.
    #[inline]
    pub(crate) fn weights(&self, dir: Vec3A) -> Option<DVec3> {
        let [x, y, z] = self.sides;
        let beyond = x * dir.x + y * dir.y + z * dir.z;
        if !beyond.cmple(Vec4::splat(SLACK)).all() {
            return None;
        }
        let weights = ShearedRay::new(self.origin, dir, 0.0).weights_of_seen(&self.seen);
        weights.cmpge(DVec3::ZERO).all().then_some(weights)
    }
}

#[cfg(test)]
mod tests {
    use base::{Ray, Rng, Stream};
    use glam::{Quat, Vec3};

    use super::*;
    use crate::{Accel, MaterialId, Mesh, Sphere, Surface};

    /// Rays in a row of a block.
    const SIDE: usize = 9;

    /// The numbers of those at the corners.
    const CORNERS: [usize; 4] = [0, SIDE - 1, SIDE * SIDE - 1, SIDE * (SIDE - 1)];

    fn random(rng: &mut Rng) -> Vec3 {
        Vec3::new(rng.next_f32(), rng.next_f32(), rng.next_f32()) * 2.0 - 1.0
    }

    fn add(mesh: &mut Mesh, corners: [Vec3; 3]) {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners);
        mesh.triangles.push([first, first + 1, first + 2]);
        mesh.materials.push(MaterialId(0));
    }

    /// The rays of a block of pixels of that width around the middle of a view, row by row.
    fn block(eye: Vec3A, forward: Vec3A, width: f32) -> Vec<Ray> {
        let right = forward.any_orthonormal_vector();
        let up = right.cross(forward);
        let ray = |i: usize| {
            let at = |k: usize| (k as f32 / (SIDE - 1) as f32 - 0.5) * width;
            let dir = forward + right * at(i % SIDE) - up * at(i / SIDE);
            Ray::unbounded(eye, dir.normalize())
        };
        (0..SIDE * SIDE).map(ray).collect()
    }

    fn bits(surface: &Surface) -> String {
        format!("{surface:?}")
    }

    /// The triangle that the corners of a block meet, if it is one.
    fn met_by_corners(accel: &Accel, rays: &[Ray]) -> Option<u32> {
        let [first, others @ ..] =
            CORNERS.map(|i| accel.closest_surface(&rays[i]).map(|(s, _)| s.primitive));
        others.iter().all(|&other| other == first).then_some(first?)
    }

    fn frustum(accel: &Accel, rays: &[Ray], triangle: u32) -> Option<Frustum> {
        accel.frustum(rays[0].origin(), CORNERS.map(|i| rays[i].dir()), triangle)
    }

    #[test]
    fn rays_in_a_frustum_meet_what_a_search_finds() {
        let mut rng = Rng::new(0, Stream::Test, 0);
        let (mut n_clear, mut n_blocked, mut n_filled, mut n_beside, mut n_rays) = (0, 0, 0, 0, 0);
        for round in 0..600 {
            let mut mesh = Mesh::default();
            // Walls, some of them seen at a low angle, some smooth, and clutter all around.
            for _ in 0..3 {
                let middle = random(&mut rng) * 60.0;
                add(&mut mesh, [(); 3].map(|()| middle + random(&mut rng) * 300.0));
            }
            let mut spheres = Vec::new();
            for _ in 0..round % 60 {
                let middle = random(&mut rng) * 50.0;
                let size = 0.05 + rng.next_f32().powi(3) * 8.0;
                add(&mut mesh, [(); 3].map(|()| middle + random(&mut rng) * size));
                let (center, radius) = (random(&mut rng) * 50.0, 0.02 + rng.next_f32().powi(4));
                let (rotation, material) = (Quat::IDENTITY, MaterialId(0));
                spheres.push(Sphere { center, radius, rotation, material });
            }
            if round % 2 == 0 {
                mesh.normals = mesh.positions.iter().map(|_| random(&mut rng)).collect();
            }
            let away = if round % 3 == 0 { Vec3::new(0.0, 1e4, 300.0) } else { Vec3::ZERO };
            mesh.positions.iter_mut().for_each(|p| *p += away);
            spheres.iter_mut().for_each(|s| s.center += away);
            let accel = Accel::build(&[mesh], &spheres);
            for _ in 0..40 {
                let distance = if round % 5 == 0 { 5000.0 } else { 60.0 };
                let eye = away + random(&mut rng).normalize_or_zero() * distance;
                let target = away + random(&mut rng) * 40.0;
                let forward = Vec3A::from(target - eye).normalize_or(Vec3A::Z);
                let width = 20.0 / distance * rng.next_f32().powi(3);
                let rays = block(eye.into(), forward, width);
                let Some(triangle) = met_by_corners(&accel, &rays) else { continue };
                let Some(frustum) = frustum(&accel, &rays, triangle) else {
                    let meets = |ray| accel.closest_surface(ray).map(|(s, _)| s.primitive);
                    n_blocked += u32::from(rays.iter().any(|ray| meets(ray) != Some(triangle)));
                    continue;
                };
                n_clear += 1;
                let is_filled = frustum.fills(CORNERS.map(|i| rays[i].dir()));
                n_filled += u32::from(is_filled);
                for ray in &rays {
                    let surface = accel.surface_in(&frustum, ray);
                    assert!(surface.is_some() || !is_filled, "round {round}, {ray:?}");
                    let Some(surface) = surface else { continue };
                    let (expected, _) = accel.closest_surface(ray).expect("a surface");
                    assert_eq!(bits(&surface), bits(&expected), "round {round}, {ray:?}");
                    n_rays += 1;
                }
                // Rays beyond the sides are none of the frustum's.
                let wide = block(eye.into(), forward, width * 3.0 + 1e-3);
                if CORNERS.iter().any(|&i| accel.surface_on(&wide[i], triangle).is_none()) {
                    assert!(!frustum.fills(CORNERS.map(|i| wide[i].dir())), "round {round}");
                    n_beside += 1;
                }
                for ray in &wide {
                    if let Some(surface) = accel.surface_in(&frustum, ray) {
                        let (expected, _) = accel.closest_surface(ray).expect("a surface");
                        assert_eq!(bits(&surface), bits(&expected), "round {round}, {ray:?}");
                    }
                }
            }
        }
        assert!(n_clear > 3000 && n_blocked > 100, "{n_clear} clear, {n_blocked} blocked");
        assert!(n_filled > n_clear * 9 / 10, "{n_filled} of {n_clear} filled");
        assert!(n_beside > 100, "{n_beside} reach beyond the triangle");
        assert!(n_rays > n_clear * 70, "{n_rays} rays in {n_clear} frusta");
    }

    /// Seen from above, a wall at z = -10.
    fn wall(more: impl FnOnce(&mut Mesh)) -> Accel {
        let mut mesh = Mesh::default();
        add(&mut mesh, WALL);
        more(&mut mesh);
        Accel::build(&[mesh], &[])
    }

    const WALL: [Vec3; 3] = [
        Vec3::new(-30.0, -20.0, -10.0),
        Vec3::new(30.0, -20.0, -10.0),
        Vec3::new(0.0, 40.0, -10.0),
    ];

    #[test]
    fn what_is_thinner_than_a_pixel_or_coincides_is_in_the_way() {
        let rays = block(Vec3A::ZERO, -Vec3A::Z, 0.1);
        let is_clear = |accel: Accel| {
            let Some(triangle) = met_by_corners(&accel, &rays) else { return false };
            let Some(frustum) = frustum(&accel, &rays, triangle) else { return false };
            assert!(rays.iter().all(|ray| accel.surface_in(&frustum, ray).is_some()));
            true
        };
        assert!(is_clear(wall(|_| ())));
        // Between two columns of rays, and none of them meets it.
        let rod = [(0.018, -20.0), (0.0181, -20.0), (0.018, 20.0)];
        let rod = rod.map(|(x, y)| Vec3::new(x, y, -5.0));
        assert!(!is_clear(wall(|mesh| add(mesh, rod))));
        assert!(is_clear(wall(|mesh| add(mesh, rod.map(|p| p + Vec3::X)))));
        // Copies, in the same order of corners and in another, and neighbours in the same plane.
        let [a, b, c] = WALL;
        assert!(!is_clear(wall(|mesh| add(mesh, [a, b, c]))));
        assert!(!is_clear(wall(|mesh| add(mesh, [c, b, a]))));
        assert!(is_clear(wall(|mesh| add(mesh, [b, a, Vec3::new(0.0, -50.0, -10.0)]))));
        for (behind, clear) in [(1e-5, false), (0.01, true)] {
            let moved = WALL.map(|p| p - Vec3::Z * behind);
            assert_eq!(is_clear(wall(|mesh| add(mesh, moved))), clear);
        }
        // An edge that the block touches.
        let half = [a, c, Vec3::new(0.0, -20.0, -10.0)];
        let other = [half[2], c, b];
        let split = |shift: f32| {
            let mut mesh = Mesh::default();
            [half, other].iter().for_each(|t| add(&mut mesh, t.map(|p| p + Vec3::X * shift)));
            Accel::build(&[mesh], &[])
        };
        assert!(is_clear(split(0.6)) && !is_clear(split(0.5)));
        // The diagonal of a square, whose halves have the same box.
        let square = |shift: f32| {
            let corner = |x: f32, y: f32| Vec3::new(x * 20.0 + shift, y * 20.0, -10.0);
            let [a, b, c, d] =
                [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            let mut mesh = Mesh::default();
            [[a, b, c], [a, c, d]].into_iter().for_each(|t| add(&mut mesh, t));
            Accel::build(&[mesh], &[])
        };
        assert!(is_clear(square(1.2)) && !is_clear(square(0.8)) && is_clear(square(-1.2)));
    }
}
