//! From the unit square to directions and points, each with its density.

use glam::{Vec2, Vec3A};

use crate::math::{FRAC_1_PI, PI, sin_cos};

/// A point of the unit disc, uniform by area (Shirley and Chiu 1997, concentric map). Density 1/pi.
#[inline]
pub fn uniform_disc(u: Vec2) -> Vec2 {
    let v = u * 2.0 - Vec2::ONE;
    if v.x == 0.0 && v.y == 0.0 {
        return Vec2::ZERO;
    }
    let (r, phi) = if v.x.abs() > v.y.abs() {
        (v.x, PI / 4.0 * (v.y / v.x))
    } else {
        (v.y, PI / 2.0 - PI / 4.0 * (v.x / v.y))
    };
    let (sin, cos) = sin_cos(phi);
    Vec2::new(cos, sin) * r
}

/// A direction around +z with density proportional to its cosine.
#[inline]
pub fn cosine_hemisphere(u: Vec2) -> Vec3A {
    let d = uniform_disc(u);
    Vec3A::new(d.x, d.y, (1.0 - d.length_squared()).max(0.0).sqrt())
}

/// Density of [`cosine_hemisphere`] per steradian.
#[inline]
pub fn cosine_hemisphere_pdf(cos_theta: f32) -> f32 {
    cos_theta.max(0.0) * FRAC_1_PI
}

/// A direction, uniform over the sphere. Density 1/(4 pi) per steradian.
#[inline]
pub fn uniform_sphere(u: Vec2) -> Vec3A {
    let z = 1.0 - 2.0 * u.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = sin_cos(2.0 * PI * u.y);
    Vec3A::new(r * cos, r * sin, z)
}

/// Density of [`uniform_sphere`] per steradian.
pub const UNIFORM_SPHERE_PDF: f32 = FRAC_1_PI / 4.0;

/// A direction around +z, uniform over the cone of the given half angle.
#[inline]
pub fn uniform_cone(u: Vec2, cos_half_angle: f32) -> Vec3A {
    let z = 1.0 - u.x * (1.0 - cos_half_angle);
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = sin_cos(2.0 * PI * u.y);
    Vec3A::new(r * cos, r * sin, z)
}

/// Density of [`uniform_cone`] per steradian.
#[inline]
pub fn uniform_cone_pdf(cos_half_angle: f32) -> f32 {
    1.0 / (2.0 * PI * (1.0 - cos_half_angle))
}

/// Barycentric weights of the second and third corner of a triangle, uniform by area (Heitz 2019, low distortion).
#[inline]
pub fn uniform_triangle(u: Vec2) -> Vec2 {
    if u.y > u.x {
        let x = u.x * 0.5;
        Vec2::new(x, u.y - x)
    } else {
        let y = u.y * 0.5;
        Vec2::new(u.x - y, y)
    }
}

/// x in [0, 1] with density 2 (3 x^2 - 2 x^3), by bisection and Newton steps on its integral 2 x^3 - x^4.
#[inline]
pub fn smoothstep(u: f32) -> f32 {
    let (mut low, mut high, mut x) = (0.0_f32, 1.0_f32, 0.5_f32);
    for _ in 0..24 {
        let value = x * x * x * (2.0 - x) - u;
        if value < 0.0 {
            low = x;
        } else {
            high = x;
        }
        let slope = 2.0 * x * x * (3.0 - 2.0 * x);
        let newton = x - value / slope;
        x = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
    }
    x
}
