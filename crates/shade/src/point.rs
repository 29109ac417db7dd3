//! Where an eye ray, or a specular ray, arrives.

use base::{Rgb, hash_u64};
use geometry::Surface;
use glam::Vec3A;
use scene::Material;

/// A surface point to be shaded.
#[derive(Clone, Copy, Debug)]
pub struct ShadingPoint<'a> {
    /// The surface as it is, its front side not turned to the eye.
    pub surface: Surface,
    /// The same with both normals on the side of `w_o`.
    pub facing: Surface,
    /// What it is made of.
    pub material: &'a Material,
    /// Its diffuse albedo here, as seen from `w_o`: see [`scene::Scene::albedo_from`].
    pub albedo: Rgb,
    /// Radiance that it emits towards `w_o`, `L_e` of Eq. (4).
    pub emitted: Rgb,
    /// Unit direction back along the ray.
    pub w_o: Vec3A,
}

/// What makes the random numbers of a pixel its own. Subpixels and the ends of specular chains have streams derived
/// from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelStream(pub u64);

impl PixelStream {
    /// The stream of a part of what this one belongs to.
    #[inline]
    pub fn part(self, part: u64) -> Self {
        Self(hash_u64(self.0, part))
    }
}
