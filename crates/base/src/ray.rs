//! A half-line in the scene.

use glam::Vec3A;

/// A ray from `origin` along a unit direction, valid for 0 <= t < `t_max`.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    origin: Vec3A,
    dir: Vec3A,
    t_max: f32,
}

impl Ray {
    /// `dir` is a unit vector. A component of -0.0 becomes 0.0: the BVH takes octants by sign and slabs by value.
    #[inline]
    pub fn new(origin: Vec3A, dir: Vec3A, t_max: f32) -> Self {
        debug_assert!(
            (dir.length_squared() - 1.0).abs() < 1e-3,
            "direction {dir} is not of unit length"
        );
        Self { origin, dir: dir + Vec3A::ZERO, t_max }
    }

    /// A ray without an end.
    #[inline]
    pub fn unbounded(origin: Vec3A, dir: Vec3A) -> Self {
        Self::new(origin, dir, f32::INFINITY)
    }

    /// Where it starts.
    #[inline]
    pub fn origin(&self) -> Vec3A {
        self.origin
    }

    /// Its unit direction.
    #[inline]
    pub fn dir(&self) -> Vec3A {
        self.dir
    }

    /// Where it ends.
    #[inline]
    pub fn t_max(&self) -> f32 {
        self.t_max
    }

    /// The point at distance `t`.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3A {
        self.origin + self.dir * t
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn negative_zero_is_gone() {
        let dir = Ray::unbounded(Vec3A::ZERO, -Vec3A::Z).dir();
        assert!(dir.x.is_sign_positive() && dir.y.is_sign_positive(), "{dir}");
    }
}
