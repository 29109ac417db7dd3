//! One ray against one primitive.

use glam::{BVec4A, DVec3, Vec3, Vec3A, Vec4, Vec4Swizzles};
use obvhs::aabb::Aabb;

use crate::MaterialId;
use crate::corner_normals::CornerNormals;

/// A triangle or a sphere, as the traversal meets it.
///
/// The first three lanes of each vector are one coordinate of the corners. The bits of the last lane of x tell a sphere by
/// their highest, and which of the spheres it is; of that the first lane is the center, and the second lane of x the radius. Those
/// of the last lanes of y and z are the object and the material. Each has a line of the cache of its own, in which normals find
/// room, too: fetching them is an eighth of the time of rays through large meshes.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Primitive {
    coordinates: [Vec4; 3],
    normals: CornerNormals,
}

const SPHERE: u32 = 1 << 31;

impl Primitive {
    pub(crate) fn triangle([a, b, c]: [Vec3; 3], owner: Owner) -> Self {
        Self::new([a.x, b.x, c.x], [a.y, b.y, c.y], [a.z, b.z, c.z], 0, owner)
    }

    pub(crate) fn with_normals(self, normals: CornerNormals) -> Self {
        Self { normals, ..self }
    }

    /// The sphere of a number below 2^31.
    pub(crate) fn sphere(center: Vec3, radius: f32, number: u32, owner: Owner) -> Self {
        let Vec3 { x, y, z } = center;
        Self::new([x, radius, 0.0], [y, 0.0, 0.0], [z, 0.0, 0.0], number | SPHERE, owner)
    }

    fn new(x: [f32; 3], y: [f32; 3], z: [f32; 3], bits: u32, owner: Owner) -> Self {
        let row = |of: [f32; 3], bits| Vec3::from_array(of).extend(f32::from_bits(bits));
        let material = owner.material.0.into();
        let coordinates = [row(x, bits), row(y, owner.object), row(z, material)];
        Self { coordinates, normals: CornerNormals::default() }
    }

    fn bits(&self) -> u32 {
        self.coordinates[0].w.to_bits()
    }

    pub(crate) fn owner(&self) -> Owner {
        let [_, y, z] = self.coordinates;
        Owner { material: MaterialId(z.w.to_bits() as u16), object: y.w.to_bits() }
    }

    /// Shading normals, of a triangle that has them.
    #[inline(always)]
    pub(crate) fn normals(&self) -> &CornerNormals {
        &self.normals
    }

    pub(crate) fn corners(&self) -> [Vec3; 3] {
        let [x, y, z] = self.coordinates;
        [Vec3::new(x.x, y.x, z.x), Vec3::new(x.y, y.y, z.y), Vec3::new(x.z, y.z, z.z)]
    }

    pub(crate) fn shape(&self) -> Shape {
        let bits = self.bits();
        if bits & SPHERE == 0 {
            Shape::Triangle
        } else {
            let [x, y, z] = self.coordinates;
            let (center, radius) = (Vec3::new(x.x, y.x, z.x), x.y);
            Shape::Sphere { number: bits & !SPHERE, center, radius }
        }
    }

    /// The box around it, widened by `margin` on every side.
    pub(crate) fn aabb(&self, margin: f32) -> Aabb {
        let (min, max) = match self.shape() {
            Shape::Triangle => {
                let [a, b, c] = self.corners();
                (a.min(b).min(c), a.max(b).max(c))
            }
            Shape::Sphere { center, radius, .. } => (center - radius, center + radius),
        };
        Aabb::new(Vec3A::from(min - margin), Vec3A::from(max + margin))
    }

    /// The distance at which the ray meets the primitive, or infinity. Only what lies ahead is met; what surely lies
    /// beyond `t_max` need not be found.
    #[inline(always)]
    pub(crate) fn intersect(&self, ray: &ShearedRay, t_max: f32) -> f64 {
        let t = if self.bits() & SPHERE == 0 {
            if ray.surely_misses_triangle(&self.coordinates, t_max) {
                return f64::INFINITY;
            }
            ray.triangle(&self.corners())
        } else {
            let [x, y, z] = self.coordinates;
            let (center, radius) = (Vec3A::new(x.x, y.x, z.x), x.y);
            if ray.surely_misses_sphere(center, radius) {
                return f64::INFINITY;
            }
            ray.sphere(center.as_dvec3(), radius.into())
        };
        if t > 0.0 { t } else { f64::INFINITY }
    }
}

/// What a [`Primitive`] is.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    Triangle,
    /// Which of the spheres it is, and where.
    Sphere {
        number: u32,
        center: Vec3,
        radius: f32,
    },
}

/// What a [`Primitive`] is a part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Owner {
    pub(crate) material: MaterialId,
    pub(crate) object: u32,
}

/// A ray prepared for the watertight triangle test of Woop, Benthin and Wald 2013 ("Watertight Ray/Triangle
/// Intersection"): the axis along which it runs most becomes z, and a shear makes it run exactly along it.
///
/// The tests run in double precision, in which numbers of single precision are multiplied without rounding. So
/// triangles of any size find their distance to the origin of a ray as it is, however close, and no ray needs a
/// minimal distance. Before them stands a test in single precision that refuses what is missed beyond its rounding
/// errors, which is most of what a ray comes by; it changes no result.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearedRay {
    origin: DVec3,
    dir: DVec3,
    axes: [usize; 3],
    shear: [f64; 2],
    rough: Rough,
}

/// The same in single precision.
#[derive(Clone, Copy, Debug)]
struct Rough {
    /// In the order of the axes.
    origin: [f32; 3],
    shear: [f32; 2],
    /// Of the direction along z.
    speed: f32,
    /// No corner's difference to the origin has been rounded by more.
    rounding: f32,
    whole_origin: Vec3A,
    dir: Vec3A,
}

/// Half a unit in the last place of 1 in single precision.
const EPSILON: f32 = f32::EPSILON / 2.0;

impl ShearedRay {
    /// A ray among primitives none of which lies farther from its origin than `reach`, along any axis.
    #[inline]
    pub(crate) fn new(origin: Vec3A, dir: Vec3A, reach: f32) -> Self {
        let size = dir.abs();
        let z = if size.x > size.y && size.x > size.z {
            0
        } else if size.y > size.z {
            1
        } else {
            2
        };
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let (whole_origin, rough_dir) = (origin, dir);
        let dir = dir.as_dvec3();
        let shear = [dir[x] / dir[z], dir[y] / dir[z]];
        let rough = Rough {
            origin: [origin[x], origin[y], origin[z]],
            shear: [shear[0] as f32, shear[1] as f32],
            speed: rough_dir[z],
            rounding: reach * EPSILON,
            whole_origin,
            dir: rough_dir,
        };
        Self { origin: origin.as_dvec3(), dir, axes: [x, y, z], shear, rough }
    }

    /// Whether [`ShearedRay::triangle`] finds no distance between 0 and `t_max`, beyond doubt.
    ///
    /// With `e` half a unit in the last place and no corner farther than `D`, a sheared coordinate is wrong by at most
    /// `e (|dx| + 3 |dz| + |x|) <= 6 e D`, so a product of two, `p q`, by `6 e D (|p| + |q|) + e |p q|`, and an edge, the
    /// difference of two products, by `9 e D` times the sum of its four coordinates. We allow `12 e D`.
    #[inline(always)]
    fn surely_misses_triangle(&self, coordinates: &[Vec4; 3], t_max: f32) -> bool {
        const CORNERS: u32 = 0b111;
        let Rough { origin, shear, speed, rounding, .. } = self.rough;
        let [x, y, z] = self.axes;
        let dz = coordinates[z] - origin[2];
        let px = (coordinates[x] - origin[0]) - dz * shear[0];
        let py = (coordinates[y] - origin[1]) - dz * shear[1];
        let bits = |mask: BVec4A| mask.bitmask() & CORNERS;

        // All corners behind the origin, or all beyond the end.
        let ahead = dz * speed.signum();
        if bits(ahead.cmplt(Vec4::splat(-2.0 * rounding))) == CORNERS
            || bits(
                ahead.cmpgt(Vec4::splat(
                    t_max * speed.abs() * (1.0 + 4.0 * EPSILON) + 2.0 * rounding,
                )),
            ) == CORNERS
        {
            return true;
        }

        let (px1, py1) = (px.zxyw(), py.zxyw());
        let (px2, py2) = (px.yzxw(), py.yzxw());
        let edges = px1 * py2 - py1 * px2;
        let doubt = (px1.abs() + py1.abs() + px2.abs() + py2.abs()) * (12.0 * rounding);
        bits(edges.cmpgt(doubt)) != 0 && bits(edges.cmplt(-doubt)) != 0
    }

    /// Whether [`ShearedRay::sphere`] finds no distance above 0, beyond doubt: the square of the ray's distance from the
    /// center is wrong by less than 32 half units in the last place of that of the origin's.
    #[inline(always)]
    fn surely_misses_sphere(&self, center: Vec3A, radius: f32) -> bool {
        let f = self.rough.whole_origin - center;
        let b = -f.dot(self.rough.dir);
        let doubt = 32.0 * EPSILON * f.length_squared();
        let beside = (f + self.rough.dir * b).length_squared() > radius * radius + doubt;
        let behind = b < 0.0 && b * b > doubt && f.length_squared() > radius * radius + doubt;
        beside || behind
    }

    /// The distance of a triangle, of either sign; infinite or not a number if it is missed.
    #[inline(always)]
    fn triangle(&self, corners: &[Vec3; 3]) -> f64 {
        // Written out, here and below, since the compiler doesn't unroll `map` over arrays of this size.
        let [a, b, c] = *corners;
        let a = a.as_dvec3() - self.origin;
        let b = b.as_dvec3() - self.origin;
        let c = c.as_dvec3() - self.origin;
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
    fn edges(&self, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
        let [x, y, z] = self.axes;
        let sheared = |p: DVec3| {
            let p = p.to_array();
            [p[x] - self.shear[0] * p[z], p[y] - self.shear[1] * p[z]]
        };
        let (a, b, c) = (sheared(a), sheared(b), sheared(c));
        let cross = |p: [f64; 2], q: [f64; 2]| p[0] * q[1] - p[1] * q[0];
        [cross(c, b), cross(a, c), cross(b, a)]
    }

    /// The weights of the corners of a triangle that the ray hits.
    #[inline(always)]
    pub(crate) fn weights(&self, [a, b, c]: [DVec3; 3]) -> DVec3 {
        let corners = [a - self.origin, b - self.origin, c - self.origin];
        let weights = DVec3::from(self.edges(corners));
        weights / weights.element_sum()
    }

    /// The same of corners that are seen from the origin of the ray, one coordinate of all three in each vector.
    #[inline(always)]
    pub(crate) fn weights_of_seen(&self, seen: &[DVec3; 3]) -> DVec3 {
        let [x, y, z] = self.axes.map(|axis| seen[axis]);
        // By the same operations in the same order as in `edges`.
        let (px, py) = (x - self.shear[0] * z, y - self.shear[1] * z);
        let cross = |i: usize, j: usize| px[i] * py[j] - py[i] * px[j];
        let weights = DVec3::new(cross(2, 1), cross(0, 2), cross(1, 0));
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
            let ray = ShearedRay::new(Vec3A::ZERO, point().as_vec3a().normalize(), 1.0);
            // Opposite to c in one triangle and to d in the other lies the edge from a to b.
            assert_eq!(ray.edges([a, b, c])[2], -ray.edges([b, a, d])[2]);
            assert_eq!(ray.edges([a, b, c])[2], ray.edges([d, a, b])[0]);
        }
    }

    const OWNER: Owner = Owner { material: MaterialId(u16::MAX), object: u32::MAX - 1 };

    #[test]
    fn what_is_in_the_last_lanes_is_found_again() {
        let corners = [Vec3::X, Vec3::Y * 2.0, Vec3::new(3.0, 4.0, 5.0)];
        let normals = CornerNormals::new([Vec3::X, Vec3::Y, Vec3::Z]);
        let triangle = Primitive::triangle(corners, OWNER).with_normals(normals);
        assert_eq!((triangle.corners(), triangle.owner()), (corners, OWNER));
        assert_eq!(triangle.normals(), &normals);
        assert!(matches!(triangle.shape(), Shape::Triangle));
        let (center, number) = (corners[2], SPHERE - 1);
        let sphere = Primitive::sphere(center, 0.5, number, OWNER);
        assert_eq!(sphere.owner(), OWNER);
        let Shape::Sphere { number: n, center: c, radius } = sphere.shape() else { panic!() };
        assert_eq!((n, c, radius), (number, center, 0.5));
    }

    #[test]
    fn spheres_are_met_from_outside_inside_and_behind() {
        let sphere = Primitive::sphere(Vec3::new(0.0, 0.0, 5.0), 2.0, 0, OWNER);
        let t = |z: f32, dir| {
            sphere.intersect(&ShearedRay::new(Vec3A::Z * z, dir, 10.0), f32::INFINITY)
        };
        assert_eq!(t(0.0, Vec3A::Z), 3.0);
        assert_eq!(t(4.0, Vec3A::Z), 3.0);
        assert_eq!(t(4.0, -Vec3A::Z), 1.0);
        assert_eq!(t(3.0, Vec3A::Z), 4.0, "the surface that the ray starts on");
        assert_eq!(t(8.0, Vec3A::Z), f64::INFINITY);
        assert_eq!(t(0.0, Vec3A::X), f64::INFINITY);
    }
}
