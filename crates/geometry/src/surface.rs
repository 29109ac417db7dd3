//! The place on a surface where a ray has arrived.

use glam::Vec3A;

use crate::MaterialId;

/// The most that interpolated normals may increase flux at a surface. Without a limit photons that graze the true surface
/// would carry any amount; what this one cuts off is next to nothing.
pub const MAX_SHADING_GAIN: f32 = 32.0;

/// A point of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Where it is: computed from the surface, not along the ray.
    pub position: Vec3A,
    /// Unit normal of the true surface, on its front side.
    pub geometric_normal: Vec3A,
    /// Unit normal for shading, never behind the true surface: `dot(geometric_normal) > 0`.
    pub shading_normal: Vec3A,
    /// What it is made of.
    pub material: MaterialId,
    /// The mesh or sphere it belongs to; meshes come first.
    pub object: u32,
    /// The triangle or sphere, as [`crate::Accel::uv`] finds it.
    pub primitive: u32,
    /// How far a ray must be moved off `position` to start surely on its side of the true surface, in world units: a few
    /// units in the last place of `position`, along the normal.
    pub error: f32,
}

impl Surface {
    /// The origin of a ray that leaves towards `dir`, moved off the surface by as much as rounding can have moved it in.
    #[inline]
    pub fn leave(&self, dir: Vec3A) -> Vec3A {
        let side = 1.0_f32.copysign(dir.dot(self.geometric_normal));
        self.position + self.geometric_normal * (self.error * side)
    }

    /// The same point with both normals on the side of `dir`.
    #[inline]
    pub fn facing(&self, dir: Vec3A) -> Self {
        if dir.dot(self.geometric_normal) < 0.0 {
            Self {
                geometric_normal: -self.geometric_normal,
                shading_normal: -self.shading_normal,
                ..*self
            }
        } else {
            *self
        }
    }

    /// How much more light from `dir` the surface receives by its shading normal than lands on it (Veach 1997, section
    /// 5.3): radiance is weighted by the cosine at the shading normal, and photons land in proportion to that at the
    /// true one. Both normals are on the side of `dir`.
    #[inline]
    pub fn shading_gain(&self, dir: Vec3A) -> f32 {
        if self.shading_normal == self.geometric_normal {
            return 1.0;
        }
        let lands = dir.dot(self.geometric_normal);
        (dir.dot(self.shading_normal).max(0.0) / lands).min(MAX_SHADING_GAIN)
    }
}
