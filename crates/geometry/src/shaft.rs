//! The space between two sets of points (Haines and Wallace 1991, "Shaft Culling for Efficient Ray-Cast Radiosity").

use glam::{DVec3, Vec3, Vec3A};

use crate::Bounds;
use crate::frustum::SLACK;
use crate::primitive::{Primitive, Shape};

/// Points of which a box is known, and perhaps a plane.
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    /// The box around them, in world units.
    pub bounds: Bounds,
    /// A plane behind which none of them lies. Rays between them and others stay in front of it, so that what is behind, the
    /// surface on which the points lie among it, isn't in the way.
    pub plane: Option<Plane>,
}

/// A plane, and the side of it that counts.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// Unit normal, on the side that counts.
    pub normal: Vec3A,
    /// `dot(normal)` of the plane's points, in world units.
    pub offset: f64,
}

impl Plane {
    /// `dot(normal)` of a point.
    pub fn height(normal: Vec3A, point: Vec3A) -> f64 {
        normal.as_dvec3().dot(point.as_dvec3())
    }
}

/// The convex hull of two boxes, cut by the planes of the points in them: whatever isn't in it is on no line between a
/// point of one and a point of the other.
#[derive(Debug)]
pub(crate) struct Shaft {
    /// What lies beyond any of them, `dot(normal) > offset`, is outside.
    planes: [Side; MOST],
    n: usize,
    /// The corners of what is within the planes, if they are few, and how far from their hull it may reach.
    hull: Option<([DVec3; 5], f64)>,
}

/// Six faces, four slanted sides for each pair of axes, and the two planes of the points.
const MOST: usize = 6 + 3 * 4 + 2;

#[derive(Clone, Copy, Debug, Default)]
struct Side {
    normal: DVec3,
    offset: f64,
}

impl Shaft {
    /// Between two patches, in units of which `scale` make one of theirs.
    pub(crate) fn new(from: &Patch, to: &Patch, scale: f32) -> Self {
        let corners = |b: Bounds| [(b.min * scale).as_dvec3(), (b.max * scale).as_dvec3()];
        let (from_box, to_box) = (corners(from.bounds), corners(to.bounds));
        let mut shaft = Self { planes: [Side::default(); MOST], n: 0, hull: None };
        for axis in 0..3 {
            let (low, high) = (from_box[0].min(to_box[0])[axis], from_box[1].max(to_box[1])[axis]);
            let mut normal = DVec3::ZERO;
            normal[axis] = 1.0;
            shaft.push(normal, high);
            shaft.push(-normal, -low);
        }
        // Seen along one axis, the hull of two rectangles: its slanted sides join corners of the same kind, of which one
        // reaches farther along one axis, and the other along the other.
        for (x, y) in [(0, 1), (1, 2), (2, 0)] {
            for (at_x, at_y) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let (sign_x, sign_y) = (2.0 * at_x as f64 - 1.0, 2.0 * at_y as f64 - 1.0);
                let (a, b) =
                    ([from_box[at_x][x], from_box[at_y][y]], [to_box[at_x][x], to_box[at_y][y]]);
                let (dx, dy) = ((b[0] - a[0]) * sign_x, (b[1] - a[1]) * sign_y);
                if dx * dy < 0.0 {
                    let mut normal = DVec3::ZERO;
                    (normal[x], normal[y]) = (dy.abs() * sign_x, dx.abs() * sign_y);
                    let normal = normal.normalize();
                    shaft.push(normal, normal[x] * a[0] + normal[y] * a[1]);
                }
            }
        }
        for plane in [from.plane, to.plane].into_iter().flatten() {
            shaft.push(-plane.normal.as_dvec3(), -plane.offset * f64::from(scale));
        }
        shaft
    }

    /// What rays from a point, between four directions one after the other around them, come by until they have met a
    /// triangle, and the outer unit normals of the sides. Nothing if rounding counts for too much.
    ///
    /// A ray in the frustum points at most `1.5 SLACK` beyond any side, where 1/2 is for the rounding of [`crate::Frustum`]'s
    /// test. Where two sides meet at an angle whose sine is at least 1/4, it is by 8 times that from a direction between the
    /// four, so by `12 SLACK t` off at a distance `t`, and, on a triangle that it meets under a cosine of at least `c`, by
    /// twice that over `c`. We allow `32 SLACK t / c`. Distances themselves round by less than `SLACK t`, and spheres,
    /// which take directions to be of unit length, miss theirs by as little.
    pub(crate) fn between(
        eye: DVec3,
        dirs: [DVec3; 4],
        corners: &[DVec3; 3],
    ) -> Option<(Self, [DVec3; 4])> {
        /// The least cosine between the triangle's normal and a ray.
        const GRAZING: f64 = 1.0 / 256.0;
        /// The least sine between two sides.
        const SHARP: f64 = 0.25;

        let normal = certain_normal(corners)?;
        let height = normal.dot(corners[0] - eye);
        let normal = normal * height.signum();
        let cosines = dirs.map(|dir| normal.dot(dir));
        let least = cosines.into_iter().fold(f64::INFINITY, f64::min);
        let farthest = height.abs() / least;
        let doubt = farthest * 32.0 * f64::from(SLACK) / least;
        let turned: [DVec3; 4] =
            std::array::from_fn(|i| dirs[i].cross(dirs[(i + 1) % 4]).normalize());
        let inside = turned[0].dot(dirs[2]).signum();
        let sides = turned.map(|side| side * -inside);
        let is_convex = (0..4).all(|i| {
            let is_inside = |k: usize| sides[i].dot(dirs[(i + k) % 4]) < 0.0;
            let sine = sides[i].cross(sides[(i + 1) % 4]).length();
            is_inside(2) && is_inside(3) && sine > SHARP
        });
        // Also if any of it isn't a number.
        if !(least > GRAZING && height != 0.0 && is_convex) {
            return None;
        }

        let mut points = [eye; 5];
        for (point, (dir, cosine)) in points[1..].iter_mut().zip(dirs.iter().zip(cosines)) {
            *point += dir * (height.abs() / cosine);
        }
        let mut shaft = Self { planes: [Side::default(); MOST], n: 0, hull: Some((points, doubt)) };
        for side in sides {
            shaft.push(side, side.dot(eye) + doubt);
        }
        // Behind the triangle, so that what lies in it or touches it is in the way.
        shaft.push(normal, normal.dot(corners[0]) + doubt);
        let min = points.into_iter().fold(DVec3::INFINITY, DVec3::min);
        let max = points.into_iter().fold(DVec3::NEG_INFINITY, DVec3::max);
        for axis in 0..3 {
            let mut normal = DVec3::ZERO;
            normal[axis] = 1.0;
            shaft.push(normal, max[axis] + doubt);
            shaft.push(-normal, doubt - min[axis]);
        }
        Some((shaft, sides))
    }

    fn push(&mut self, normal: DVec3, offset: f64) {
        self.planes[self.n] = Side { normal, offset };
        self.n += 1;
    }

    /// For each of eight boxes whether it may reach into the shaft.
    pub(crate) fn may_hold(
        &self,
        min: &[[f32; 8]; 3],
        max: &[[f32; 8]; 3],
        doubt: f32,
    ) -> [bool; 8] {
        let mut may = [true; 8];
        for Side { normal, offset } in &self.planes[..self.n] {
            let normal = normal.as_vec3();
            let near = |axis: usize| if normal[axis] > 0.0 { &min[axis] } else { &max[axis] };
            let (x, y, z) = (near(0), near(1), near(2));
            let most = *offset as f32 + doubt;
            for i in 0..8 {
                may[i] &= normal.x * x[i] + normal.y * y[i] + normal.z * z[i] <= most;
            }
        }
        may
    }

    /// Whether a primitive may reach into the shaft.
    pub(crate) fn may_hold_primitive(&self, primitive: &Primitive) -> bool {
        let is_outside = |side: &Side| match primitive.shape() {
            Shape::Triangle => {
                let beyond = |p: Vec3| side.normal.dot(p.as_dvec3()) > side.offset;
                primitive.corners().into_iter().all(beyond)
            }
            Shape::Sphere { center, radius, .. } => {
                side.normal.dot(center.as_dvec3()) - f64::from(radius) > side.offset
            }
        };
        !self.planes[..self.n].iter().any(is_outside) && !self.lies_beside(primitive)
    }

    /// Whether all of the shaft lies on one side of a triangle's plane, or of one through the eye and an edge, beyond which
    /// the triangle isn't. The halves of a square have no other plane between them.
    fn lies_beside(&self, primitive: &Primitive) -> bool {
        let (Some((points, doubt)), Shape::Triangle) = (self.hull, primitive.shape()) else {
            return false;
        };
        let corners = primitive.corners().map(Vec3::as_dvec3);
        let is_before_plane = certain_normal(&corners).is_some_and(|normal| {
            let heights = points.map(|point| normal.dot(point - corners[0]));
            heights.iter().all(|&h| h > doubt) || heights.iter().all(|&h| h < -doubt)
        });
        let [eye, ends @ ..] = points;
        let is_beyond_edge = |i: usize| {
            let [p, q, opposite] = [0, 1, 2].map(|k| corners[(i + k) % 3]);
            certain_normal(&[eye, p, q]).is_some_and(|normal| {
                let inside = normal.dot(opposite - eye);
                let is_certain = inside.abs() > (opposite - eye).length() * 2.0_f64.powi(-30);
                let outer = normal * -inside.signum();
                is_certain && ends.iter().all(|&end| outer.dot(end - eye) > doubt)
            })
        };
        is_before_plane || (0..3).any(is_beyond_edge)
    }
}

/// The unit normal of a triangle that isn't so thin that rounding may turn it.
fn certain_normal([a, b, c]: &[DVec3; 3]) -> Option<DVec3> {
    let (along, beside) = (b - a, c - a);
    let normal = along.cross(beside);
    let (area, whole) = (normal.length(), along.length() * beside.length());
    (area > whole * 2.0_f64.powi(-12)).then(|| normal / area)
}

#[cfg(test)]
mod tests {
    use base::{Ray, Rng, Stream};
    use glam::Quat;

    use super::*;
    use crate::{Accel, MaterialId, Mesh, Sphere};

    fn random(rng: &mut Rng) -> Vec3 {
        Vec3::new(rng.next_f32(), rng.next_f32(), rng.next_f32())
    }

    fn around(points: &[Vec3]) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        points.iter().for_each(|&point| bounds.extend(point));
        bounds
    }

    /// Some small triangles and spheres in a box of side 100, away from its origin.
    fn clutter(rng: &mut Rng, n: u32) -> Accel {
        let mut mesh = Mesh::default();
        let mut spheres = Vec::new();
        for i in 0..n {
            let middle = random(rng) * 100.0 + 1000.0;
            mesh.positions.extend((0..3).map(|_| middle + random(rng) * 4.0));
            mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
            mesh.materials.push(MaterialId(0));
            let (center, radius) = (random(rng) * 100.0 + 1000.0, rng.next_f32());
            let (rotation, material) = (Quat::IDENTITY, MaterialId(0));
            spheres.push(Sphere { center, radius, rotation, material });
        }
        Accel::build(&[mesh], &spheres)
    }

    #[test]
    fn no_ray_between_what_is_clear_meets_anything() {
        let mut rng = Rng::new(0, Stream::Test, 0);
        let (mut n_clear, mut n_met) = (0, 0);
        for round in 0..400 {
            let accel = clutter(&mut rng, 1 + round % 40);
            let mut points = |side: f32| -> [Vec3; 4] {
                let corner = random(&mut rng) * 100.0 + 1000.0;
                std::array::from_fn(|_| corner + random(&mut rng) * side)
            };
            let (from, to) = (points(8.0), points(20.0));
            let patch = |points: &[Vec3]| Patch { bounds: around(points), plane: None };
            let is_clear = accel.is_clear(&patch(&from), &patch(&to));
            n_clear += u32::from(is_clear);
            for _ in 0..200 {
                let mut mixed = |points: [Vec3; 4]| {
                    let weights: [f32; 4] = std::array::from_fn(|_| rng.next_f32());
                    let sum: Vec3 = points.iter().zip(weights).map(|(&p, w)| p * w).sum();
                    Vec3A::from(sum / weights.iter().sum::<f32>())
                };
                let (a, b) = (mixed(from), mixed(to));
                let distance = (b - a).length();
                let is_met = accel.occluded(&Ray::new(a, (b - a) / distance, distance));
                assert!(!(is_met && is_clear), "round {round}: from {a} to {b}");
                n_met += u32::from(is_met);
            }
        }
        // Neither all nor nothing.
        assert!((100..350).contains(&n_clear) && n_met > 300, "{n_clear} clear, {n_met} met");
    }

    /// A floor and a lamp under a ceiling, all slanted alike: none is in the way, but what stands between is.
    #[test]
    fn surfaces_are_not_in_the_way_of_what_leaves_them() {
        let turned = Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.3);
        let quad = |mesh: &mut Mesh, center: Vec3, half: f32| {
            let first = mesh.positions.len() as u32;
            for (x, z) in [(-half, -half), (half, -half), (half, half), (-half, half)] {
                mesh.positions.push(turned * (center + Vec3::new(x, 0.0, z)));
            }
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            mesh.materials.extend([MaterialId(0); 2]);
        };
        let normal = Vec3A::from(turned * Vec3::Y);
        let lamp = [(-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (1.0, -1.0)]
            .map(|(x, z)| turned * Vec3::new(x, 9.99, z));
        let lowest = lamp.iter().map(|&p| Plane::height(-normal, p.into()));
        let offset = lowest.fold(f64::NEG_INFINITY, f64::max) + 1e-6;
        let to = Patch { bounds: around(&lamp), plane: Some(Plane { normal: -normal, offset }) };
        let patch = |x: f32| {
            let points = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
                .map(|(dx, z)| turned * Vec3::new(x + dx, 1e-5, z));
            let offset = Plane::height(normal, points[0].into()) - 2e-6;
            Patch { bounds: around(&points), plane: Some(Plane { normal, offset }) }
        };
        for (has_ball, clear) in [(false, [true, true]), (true, [false, true])] {
            let mut mesh = Mesh::default();
            quad(&mut mesh, Vec3::ZERO, 20.0);
            quad(&mut mesh, Vec3::Y * 10.0, 20.0);
            quad(&mut mesh, Vec3::Y * 9.99, 1.0);
            let ball = Sphere {
                center: turned * Vec3::new(0.3, 5.0, 0.4),
                radius: 0.1,
                rotation: Quat::IDENTITY,
                material: MaterialId(0),
            };
            let balls = if has_ball { vec![ball] } else { Vec::new() };
            let accel = Accel::build(&[mesh], &balls);
            assert_eq!([0.0, 12.0].map(|x| accel.is_clear(&patch(x), &to)), clear);
        }
    }
}
