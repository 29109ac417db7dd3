//! An orthonormal frame around a direction.

use glam::Vec3A;

/// A right-handed frame whose third axis is a given unit vector.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// First tangent.
    pub s: Vec3A,
    /// Second tangent.
    pub t: Vec3A,
    /// The axis the frame was made from.
    pub n: Vec3A,
}

impl Frame {
    /// The frame of Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    #[inline]
    pub fn new(n: Vec3A) -> Self {
        let sign = 1.0_f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: Vec3A::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3A::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// From coordinates in this frame to world coordinates.
    #[inline]
    pub fn to_world(&self, v: Vec3A) -> Vec3A {
        self.s * v.x + self.t * v.y + self.n * v.z
    }

    /// From world coordinates to coordinates in this frame.
    #[inline]
    pub fn to_local(&self, v: Vec3A) -> Vec3A {
        Vec3A::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_orthonormal() {
        for n in [Vec3A::Z, -Vec3A::Z, Vec3A::X, Vec3A::new(0.6, -0.48, -0.64)] {
            let f = Frame::new(n);
            assert!(
                f.s.dot(f.t).abs() < 1e-6 && f.s.dot(n).abs() < 1e-6 && f.t.dot(n).abs() < 1e-6,
                "{f:?}"
            );
            assert!((f.s.cross(f.t) - n).length() < 1e-6, "{f:?}");
            let v = Vec3A::new(0.3, -0.5, 0.7);
            assert!((f.to_world(f.to_local(v)) - v).length() < 1e-6, "{f:?}");
        }
    }
}
