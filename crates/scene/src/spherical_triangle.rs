//! Triangles on the unit sphere.

use base::math::{atan2_f64, sin_cos_f64};
use glam::{DVec2, DVec3};

/// A triangle on the unit sphere, ready to be sampled (Arvo 1995).
#[derive(Clone, Copy, Debug)]
pub(crate) struct SphericalTriangle {
    a: DVec3,
    b: DVec3,
    /// Unit vector perpendicular to `a`, on the side of the third corner.
    a_to_c: DVec3,
    /// Of the angle at `a`: itself, its sine and its cosine.
    alpha: (f64, f64, f64),
    /// Cosine of the side from `a` to `b`.
    cos_c: f64,
    /// Solid angle.
    area: f64,
}

impl SphericalTriangle {
    /// The triangle of three unit vectors.
    pub(crate) fn new(a: DVec3, b: DVec3, c: DVec3) -> Self {
        let volume = a.cross(b).dot(c).abs();
        // van Oosterom and Strackee 1983, Eq. 8.
        let area = 2.0 * atan2_f64(volume, 1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        let [a_to_b, a_to_c] = [b, c].map(|v| (v - a * a.dot(v)).normalize_or_zero());
        let (sin, cos) = (a_to_b.cross(a_to_c).length(), a_to_b.dot(a_to_c));
        let alpha = (atan2_f64(sin, cos), sin, cos);
        Self { a, b, a_to_c, alpha, cos_c: a.dot(b), area }
    }

    /// Solid angle, in [0, 2 pi].
    pub(crate) fn area(&self) -> f64 {
        self.area
    }

    /// A unit vector of the triangle, uniform by solid angle, from a point of the unit square.
    pub(crate) fn sample(&self, u: DVec2) -> DVec3 {
        // The third corner of a triangle with the same `a`, `b` and angle between, of the area `u.x` of the whole.
        let (alpha, sin_alpha, cos_alpha) = self.alpha;
        let (s, t) = sin_cos_f64(u.x * self.area - alpha);
        let (p, q) = (t - cos_alpha, s + sin_alpha * self.cos_c);
        let cos = ((q * t - p * s) * cos_alpha - q) / ((q * s + p * t) * sin_alpha);
        let cos = if cos.is_finite() { cos.clamp(-1.0, 1.0) } else { 1.0 };
        let corner = self.a * cos + self.a_to_c * (1.0 - cos * cos).sqrt();
        // Somewhere on the arc to it.
        let z = 1.0 - u.y * (1.0 - corner.dot(self.b));
        let away = (corner - self.b * corner.dot(self.b)).normalize_or_zero();
        self.b * z + away * (1.0 - z * z).max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Rng, Stream, warp};
    use std::f64::consts::FRAC_PI_2;

    /// Corners of random triangles, from needles to a quarter of the sphere.
    fn triangles(rng: &mut Rng) -> [DVec3; 3] {
        let middle = warp::uniform_sphere(rng.next_2d());
        let size = rng.next_f32() * 1.5 + 0.01;
        std::array::from_fn(|_| {
            (middle + warp::uniform_sphere(rng.next_2d()) * size).as_dvec3().normalize()
        })
    }

    #[test]
    fn an_octant_has_an_eighth_of_the_sphere() {
        let area = SphericalTriangle::new(DVec3::X, DVec3::Y, DVec3::Z).area();
        assert!((area - FRAC_PI_2).abs() < 1e-12, "{area}");
    }

    /// A uniform density puts into each half of a triangle what its area says.
    #[test]
    fn samples_are_inside_and_uniform() {
        const SIDE: usize = 64;
        let mut rng = Rng::new(0, Stream::Test, 0);
        for _ in 0..300 {
            let [a, b, c] = triangles(&mut rng);
            let triangle = SphericalTriangle::new(a, b, c);
            let normals =
                [a.cross(b), b.cross(c), c.cross(a)].map(|n| n * a.cross(b).dot(c).signum());
            let middle = (b + c).normalize();
            let half = SphericalTriangle::new(a, b, middle).area() / triangle.area();
            let (cut, mut n_in_half) = (a.cross(middle), 0);
            for i in 0..SIDE * SIDE {
                let u = DVec2::new((i % SIDE) as f64 + 0.5, (i / SIDE) as f64 + 0.5) / SIDE as f64;
                let dir = triangle.sample(u);
                assert!((dir.length() - 1.0).abs() < 1e-9);
                let slack = 1e-9;
                assert!(normals.iter().all(|n| dir.dot(*n) > -slack), "{dir} out of {a} {b} {c}");
                n_in_half += usize::from(dir.dot(cut) * b.dot(cut) > 0.0);
            }
            let share = n_in_half as f64 / (SIDE * SIDE) as f64;
            assert!((share - half).abs() < 0.02, "{share} instead of {half} of {a} {b} {c}");
        }
    }
}
