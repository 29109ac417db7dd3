//! Microfacets: surfaces made of tiny mirrors whose normals follow the GGX distribution, in a frame whose z axis is the
//! normal (Walter, Marschner, Li and Torrance 2007, "Microfacet Models for Refraction through Rough Surfaces").
//!
//! `alpha` in (0, 1] is the width of the distribution: the slopes of half of the projected area are below it. Directions
//! are unit vectors.

use base::math::{PI, sin_cos};
use glam::{Vec2, Vec3A};

/// Area of microfacets per steradian around the normal `h`, for a unit of area of the surface (Walter et al., Eq. 33).
pub(crate) fn distribution(h: Vec3A, alpha: f32) -> f32 {
    // By x and y rather than by 1 - z^2, which has no digits left close to the normal.
    let tan2_cos2 = (h.x * h.x + h.y * h.y) / (alpha * alpha);
    let k = tan2_cos2 + h.z * h.z;
    1.0 / (PI * alpha * alpha * k * k)
}

/// Share of the microfacets turned to `w` that nothing hides on its side, over its cosine (Walter et al., Eq. 34).
pub(crate) fn masking_over_cos(w: Vec3A, alpha: f32) -> f32 {
    let (cos, sin2) = (w.z.abs(), w.x * w.x + w.y * w.y);
    2.0 / (cos + (cos * cos + alpha * alpha * sin2).sqrt())
}

/// Share of the microfacets turned to `w` that nothing hides on its side.
pub(crate) fn masking(w: Vec3A, alpha: f32) -> f32 {
    (masking_over_cos(w, alpha) * w.z.abs()).min(1.0)
}

/// A normal from the distribution of those that `w_o`, above the surface, sees (Dupuy and Benyoub 2023, "Sampling Visible
/// GGX Normals with Spherical Caps", listing 3). Density: [`visible_normal_pdf`].
pub(crate) fn visible_normal(w_o: Vec3A, alpha: f32, u: Vec2) -> Vec3A {
    let stretch = |v: Vec3A| Vec3A::new(alpha * v.x, alpha * v.y, v.z).normalize();
    // To where the surface is a hemisphere, whose reflections of w fill a cap of the sphere evenly.
    let w = stretch(w_o);
    let z = (1.0 - u.y) * (1.0 + w.z) - w.z;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = sin_cos(2.0 * PI * u.x);
    stretch(Vec3A::new(r * cos, r * sin, z) + w)
}

/// Density of [`visible_normal`] per steradian.
pub(crate) fn visible_normal_pdf(w_o: Vec3A, h: Vec3A, alpha: f32) -> f32 {
    masking_over_cos(w_o, alpha) * w_o.dot(h).max(0.0) * distribution(h, alpha)
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Rng, Stream, warp};

    /// The mean of `f` over the sphere, times `4 pi`; directions close to the normal are dense.
    fn integral(alpha: f32, f: impl Fn(Vec3A) -> f32) -> f64 {
        const SIDE: u32 = 600;
        let mut sum = 0.0;
        for i in 0..SIDE * SIDE {
            let x = (i % SIDE) as f32 + 0.5;
            let y = (i / SIDE) as f32 + 0.5;
            // tan^2 = alpha^2 v / (1 - v): densities like that of the distribution itself become flat. Normals along the
            // surface, at v = 1, need more points.
            let rest = 1.0 - x / SIDE as f32;
            let v = 1.0 - rest * rest;
            let width = 1.0 - v + alpha * alpha * v;
            let (cos, sin) = (((1.0 - v) / width).sqrt(), alpha * (v / width).sqrt());
            let (y, x) = sin_cos(2.0 * PI * y / SIDE as f32);
            let jacobian = alpha * alpha * rest / (cos * width * width);
            let value = f(Vec3A::new(sin * x, sin * y, cos)) * jacobian;
            sum += f64::from(value);
        }
        sum * 2.0 * std::f64::consts::PI / f64::from(SIDE * SIDE)
    }

    #[test]
    fn facets_cover_the_surface_and_those_in_view_what_is_seen_of_it() {
        for alpha in [0.0004, 0.01, 0.1, 0.5, 1.0] {
            let area = integral(alpha, |h| distribution(h, alpha) * h.z);
            assert!((area - 1.0).abs() < 2e-3, "alpha {alpha}: {area}");
            for w_o in [Vec3A::Z, Vec3A::new(0.6, 0.0, 0.8), Vec3A::new(0.0, -0.96, 0.28)] {
                let seen = integral(alpha, |h| visible_normal_pdf(w_o, h, alpha));
                assert!((seen - 1.0).abs() < 4e-3, "alpha {alpha}, {w_o}: {seen}");
            }
        }
    }

    #[test]
    fn normals_in_view_are_in_view() {
        let mut rng = Rng::new(0, Stream::Test, 3);
        for alpha in [0.0004, 0.05, 1.0] {
            for _ in 0..20_000 {
                let mut w_o = warp::uniform_sphere(rng.next_2d());
                w_o.z = w_o.z.abs();
                let h = visible_normal(w_o, alpha, rng.next_2d());
                assert!((h.length() - 1.0).abs() < 1e-5 && h.z > 0.0, "{h}");
                assert!(h.dot(w_o) > -1e-5, "{h} from {w_o}");
            }
        }
    }
}
