//! How much one surface point may say about another.

use crate::SurfacePoint;

/// The error of taking what is known at `b` for what is at `a`: 1 / w of Eq. (2), without unit.
///
/// Distance in units of `r0` plus the square root of one minus the cosine between the unit normals. 0 where the points
/// coincide; opposed normals give at least `sqrt(2)`.
#[inline]
pub fn error_between(a: &SurfacePoint, b: &SurfacePoint, r0: f32) -> f32 {
    let turn = (1.0 - a.normal.dot(b.normal)).max(0.0);
    (a.position - b.position).length() / r0 + turn.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn grows_with_distance_and_turn_and_is_symmetric() {
        let point = |x: f32, normal: Vec3| SurfacePoint { position: Vec3::X * x, normal };
        let a = point(0.0, Vec3::Y);
        assert_eq!(error_between(&a, &a, 2.0), 0.0);
        assert_eq!(error_between(&a, &point(3.0, Vec3::Y), 2.0), 1.5);
        let turned = point(3.0, Vec3::Z);
        assert_eq!(error_between(&a, &turned, 2.0), 2.5);
        assert_eq!(error_between(&a, &turned, 2.0), error_between(&turned, &a, 2.0));
        assert!(error_between(&a, &point(0.0, -Vec3::Y), 2.0) >= std::f32::consts::SQRT_2);
    }
}
