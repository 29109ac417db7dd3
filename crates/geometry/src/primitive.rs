//! One ray against one primitive.

use glam::{DVec3, Vec3, Vec3A};
use obvhs::aabb::Aabb;

/// A triangle or a sphere, as the traversal meets it.
///
/// A sphere is marked by the highest bit of `id`; its center is the first corner, its radius the x of the second.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Primitive {
    corners: [Vec3; 3],
    id: u32,
}

const SPHERE: u32 = 1 << 31;

impl Primitive {
    pub(crate) fn triangle(corners: [Vec3; 3], id: u32) -> Self {
        assert!(id & SPHERE == 0, "at most 2^31 triangles");
        Self { corners, id }
    }

    pub(crate) fn sphere(center: Vec3, radius: f32, id: u32) -> Self {
        Self { corners: [center, Vec3::new(radius, 0.0, 0.0), Vec3::ZERO], id: id | SPHERE }
    }

    pub(crate) fn corners(&self) -> [Vec3; 3] {
        self.corners
    }

    pub(crate) fn shape(&self) -> Shape {
        if self.id & SPHERE == 0 {
            Shape::Triangle { id: self.id }
        } else {
            Shape::Sphere {
                id: self.id & !SPHERE,
                center: self.corners[0],
                radius: self.corners[1].x,
            }
        }
    }

    /// The box around it, widened by `margin` on every side.
    pub(crate) fn aabb(&self, margin: f32) -> Aabb {
        let (min, max) = match self.shape() {
            Shape::Triangle { .. } => {
                let [a, b, c] = self.corners;
                (a.min(b).min(c), a.max(b).max(c))
            }
            Shape::Sphere { center, radius, .. } => (center - radius, center + radius),
        };
        Aabb::new(Vec3A::from(min - margin), Vec3A::from(max + margin))
    }

    /// The distance at which the ray meets the primitive, or infinity. Only what lies ahead is met.
    #[inline(always)]
    pub(crate) fn intersect(&self, ray: &ShearedRay) -> f64 {
        let t = if self.id & SPHERE == 0 {
            ray.triangle(&self.corners)
        } else {
            ray.sphere(self.corners[0].as_dvec3(), self.corners[1].x.into())
        };
        if t > 0.0 { t } else { f64::INFINITY }
    }
}

/// What a [`Primitive`] is.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    Triangle { id: u32 },
    Sphere { id: u32, center: Vec3, radius: f32 },
}

/// A ray prepared for the watertight triangle test of Woop, Benthin and Wald 2013 ("Watertight Ray/Triangle
/// Intersection"): the axis along which it runs most becomes z, and a shear makes it run exactly along it.
///
/// The tests run in double precision, in which numbers of single precision are multiplied without rounding. So
/// triangles of any size find their distance to the origin of a ray as it is, however close, and no ray needs a
/// minimal distance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearedRay {
    origin: DVec3,
    dir: DVec3,
    axes: [usize; 3],
    shear: [f64; 2],
}

impl ShearedRay {
    #[inline]
    pub(crate) fn new(origin: Vec3A, dir: Vec3A) -> Self {
        let size = dir.abs();
        let z = if size.x > size.y && size.x > size.z {
            0
        } else if size.y > size.z {
            1
        } else {
            2
        };
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let dir = dir.as_dvec3();
        let shear = [dir[x] / dir[z], dir[y] / dir[z]];
        Self { origin: origin.as_dvec3(), dir, axes: [x, y, z], shear }
    }

    /// The distance of a triangle, of either sign; infinite or not a number if it is missed.
    #[inline(always)]
    fn triangle(&self, corners: &[Vec3; 3]) -> f64 {
        let [a, b, c] = corners.map(|p| p.as_dvec3() - self.origin);
        let [u, v, w] = self.edges([a, b, c]);
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return f64::INFINITY;
        }
        // 0 / 0 when the ray runs in the plane. Weighting the depths of the corners would be cheaper, but then a large
        // plane through the ray's origin could seem to lie before it.
        let normal = (b - a).cross(c - a);
        normal.dot(a) / normal.dot(self.dir)
    }

    /// Twice the signed areas that the ray's piercing point cuts from the sheared triangle: the weights of the corners,
    /// but for their sum.
    ///
    /// Triangles that share an edge find the same number there but for its sign. Differences of rounded products never
    /// have the wrong sign, only none, so that around a corner, too, at least one triangle is hit.
    #[inline(always)]
    fn edges(&self, corners: [DVec3; 3]) -> [f64; 3] {
        let [x, y, z] = self.axes;
        let [a, b, c] = corners.map(|p| {
            let p = p.to_array();
            [p[x] - self.shear[0] * p[z], p[y] - self.shear[1] * p[z]]
        });
        let cross = |p: [f64; 2], q: [f64; 2]| p[0] * q[1] - p[1] * q[0];
        [cross(c, b), cross(a, c), cross(b, a)]
    }

    /// The weights of the corners of a triangle that the ray hits.
    pub(crate) fn weights(&self, corners: [DVec3; 3]) -> DVec3 {
        let weights = DVec3::from(self.edges(corners.map(|p| p - self.origin)));
        weights / weights.element_sum()
    }

    /// The point at distance `t`.
    pub(crate) fn at(&self, t: f64) -> DVec3 {
        self.origin + self.dir * t
    }

    /// The distance of the nearer of a sphere's two intersections that lies ahead, or not a number (Haines, Günther and
    /// Akenine-Möller 2019, "Precision Improvements for Ray/Sphere Intersection").
    #[inline(always)]
    pub(crate) fn sphere(&self, center: DVec3, radius: f64) -> f64 {
        let f = self.origin - center;
        let b = -f.dot(self.dir);
        // The root of a negative number is not a number, and so is then everything below.
        let half_chord = (radius * radius - (f + self.dir * b).length_squared()).sqrt();
        // Factored, since the difference of the squares would lose the height above the surface.
        let distance = f.length();
        let c = (distance - radius) * (distance + radius);
        let q = b + half_chord.copysign(b);
        let (near, far) = if b > 0.0 { (c / q, q) } else { (q, c / q) };
        if near > 0.0 { near } else { far }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Rng, Stream, warp};

    #[test]
    fn neighbors_find_opposite_numbers_at_their_edge() {
        let mut rng = Rng::new(0, Stream::Test, 0);
        for _ in 0..10_000 {
            let mut point = || warp::uniform_sphere(rng.next_2d()).as_dvec3();
            let [a, b, c, d] = [point(), point(), point(), point()];
            let ray = ShearedRay::new(Vec3A::ZERO, point().as_vec3a().normalize());
            // Opposite to c in one triangle and to d in the other lies the edge from a to b.
            assert_eq!(ray.edges([a, b, c])[2], -ray.edges([b, a, d])[2]);
            assert_eq!(ray.edges([a, b, c])[2], ray.edges([d, a, b])[0]);
        }
    }

    #[test]
    fn spheres_are_met_from_outside_inside_and_behind() {
        let sphere = Primitive::sphere(Vec3::new(0.0, 0.0, 5.0), 2.0, 0);
        let t = |z: f32, dir| sphere.intersect(&ShearedRay::new(Vec3A::Z * z, dir));
        assert_eq!(t(0.0, Vec3A::Z), 3.0);
        assert_eq!(t(4.0, Vec3A::Z), 3.0);
        assert_eq!(t(4.0, -Vec3A::Z), 1.0);
        assert_eq!(t(3.0, Vec3A::Z), 4.0, "the surface that the ray starts on");
        assert_eq!(t(8.0, Vec3A::Z), f64::INFINITY);
        assert_eq!(t(0.0, Vec3A::X), f64::INFINITY);
    }
}
