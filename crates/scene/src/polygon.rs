//! Irradiance from a polygon of uniform radiance, in closed form.

use base::math;
use glam::{DVec3, Vec3, Vec3A};

/// Irradiance at `point` on a surface with unit normal `normal`, from a convex polygon of unit radiance, by Lambert's
/// formula after the polygon is cut at the horizon (Arvo 1994, "The Irradiance Jacobian for Partially Occluded
/// Polyhedral Sources", Eq. 2). In [0, pi]; the side of the polygon doesn't matter.
///
/// At most four corners.
pub fn polygon_irradiance(point: Vec3A, normal: Vec3A, corners: &[Vec3]) -> f32 {
    let (point, normal) = (point.as_dvec3(), normal.as_dvec3());
    // Cutting a convex polygon of four corners leaves five at most.
    let mut clipped = [DVec3::ZERO; 5];
    let mut n_clipped = 0;
    let mut push = |v: DVec3| {
        if n_clipped < clipped.len() {
            clipped[n_clipped] = v.normalize_or_zero();
            n_clipped += 1;
        }
    };
    let direction = |i: usize| corners[i % corners.len()].as_dvec3() - point;
    let mut rises = false;
    for i in 0..corners.len() {
        let (a, b) = (direction(i), direction(i + 1));
        let (height_a, height_b) = (a.dot(normal), b.dot(normal));
        rises |= height_a > 0.0;
        // Corners exactly on the horizon belong to what is left.
        if height_a >= 0.0 {
            push(a);
        }
        if height_a * height_b < 0.0 {
            push(a + (b - a) * (height_a / (height_a - height_b)));
        }
    }
    if !rises {
        return 0.0;
    }
    let mut sum = 0.0;
    for i in 0..n_clipped {
        let (a, b) = (clipped[i], clipped[(i + 1) % n_clipped]);
        let cross = a.cross(b);
        let sin = cross.length();
        if sin > 0.0 {
            sum += math::atan2_f64(sin, a.dot(b)) / sin * cross.dot(normal);
        }
    }
    (0.5 * sum.abs()) as f32
}
