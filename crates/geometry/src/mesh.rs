//! What the BVH is built from.

use glam::{Quat, Vec2, Vec3};

use crate::Bounds;

/// An index into the list of materials of the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MaterialId(pub u16);

/// Triangles that belong together, in world space.
///
/// The front of a triangle is the side from which its corners run counterclockwise.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Corners, finite.
    pub positions: Vec<Vec3>,
    /// Shading normals, one a position and of unit length, or none at all.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, finite and one a position, or none at all.
    pub uvs: Vec<Vec2>,
    /// Three positions a triangle; no triangle is without area.
    pub triangles: Vec<[u32; 3]>,
    /// One a triangle.
    pub materials: Vec<MaterialId>,
}

impl Mesh {
    /// The corners of a triangle.
    #[inline]
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.of_corners(&self.positions, triangle)
    }

    /// What there is one of a position, at the corners of a triangle.
    #[inline]
    pub(crate) fn of_corners<T: Copy>(&self, values: &[T], triangle: usize) -> [T; 3] {
        self.triangles[triangle].map(|i| values[i as usize])
    }

    /// The box around all triangles.
    pub fn bounds(&self) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        self.triangles.iter().flatten().for_each(|&i| bounds.extend(self.positions[i as usize]));
        bounds
    }
}

/// A sphere in world space; its front is the outside.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    /// Center.
    pub center: Vec3,
    /// Radius, positive.
    pub radius: f32,
    /// How it is turned, which only its texture coordinates show: see [`crate::Accel::uv`].
    pub rotation: Quat,
    /// What it is made of.
    pub material: MaterialId,
}
