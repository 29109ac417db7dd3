//! One ray against one primitive.

use glam::{Vec3, Vec3A};
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

    /// The distance at which the ray meets the primitive within `0 < t < t_max`, and the weights of the second and
    /// third corner there.
    #[inline(always)]
    pub(crate) fn intersect(&self, ray: &ShearedRay, t_max: f32) -> Option<(f32, f32, f32)> {
        if self.id & SPHERE == 0 {
            ray.triangle(&self.corners, t_max)
        } else {
            ray.sphere(self.corners[0].into(), self.corners[1].x, t_max).map(|t| (t, 0.0, 0.0))
        }
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
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearedRay {
    origin: Vec3A,
    dir: Vec3A,
    axes: [usize; 3],
    shear: [f32; 3],
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
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if dir[z] < 0.0 {
            // Keeps the winding of triangles.
            (x, y) = (y, x);
        }
        let inverse = 1.0 / dir[z];
        Self { origin, dir, axes: [x, y, z], shear: [dir[x] * inverse, dir[y] * inverse, inverse] }
    }

    #[inline(always)]
    fn triangle(&self, corners: &[Vec3; 3], t_max: f32) -> Option<(f32, f32, f32)> {
        let [x, y, z] = self.axes;
        let [shear_x, shear_y, shear_z] = self.shear;
        let o = self.origin.to_array();
        let [a, b, c] = corners.map(|p| {
            let p = p.to_array();
            let depth = p[z] - o[z];
            (p[x] - o[x] - shear_x * depth, p[y] - o[y] - shear_y * depth, shear_z * depth)
        });
        let mut u = c.0 * b.1 - c.1 * b.0;
        let mut v = a.0 * c.1 - a.1 * c.0;
        let mut w = b.0 * a.1 - b.1 * a.0;
        // On an edge, single precision can't tell the sides apart, and neighbours must decide alike.
        if u == 0.0 || v == 0.0 || w == 0.0 {
            let cross = |p: (f32, f32, f32), q: (f32, f32, f32)| {
                (f64::from(p.0) * f64::from(q.1) - f64::from(p.1) * f64::from(q.0)) as f32
            };
            (u, v, w) = (cross(c, b), cross(a, c), cross(b, a));
        }
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let det = u + v + w;
        if det == 0.0 {
            return None;
        }
        let inverse = 1.0 / det;
        let t = (u * a.2 + v * b.2 + w * c.2) * inverse;
        (t > 0.0 && t < t_max).then_some((t, v * inverse, w * inverse))
    }

    /// Haines, Günther and Akenine-Möller 2019 ("Precision Improvements for Ray/Sphere Intersection").
    #[inline(always)]
    fn sphere(&self, center: Vec3A, radius: f32, t_max: f32) -> Option<f32> {
        let f = self.origin - center;
        let b = -f.dot(self.dir);
        let discriminant = radius * radius - (f + self.dir * b).length_squared();
        if discriminant < 0.0 {
            return None;
        }
        // Factored, since the difference of the squares would lose the height above the surface.
        let distance = f.length();
        let c = (distance - radius) * (distance + radius);
        let q = b + discriminant.sqrt().copysign(b);
        let (near, far) = if b > 0.0 { (c / q, q) } else { (q, c / q) };
        let t = if near > 0.0 { near } else { far };
        (t > 0.0 && t < t_max).then_some(t)
    }
}
