//! Specular light: what mirrors, metals and glass show, sharp or rough.

use base::{Rgb, math::FRAC_1_PI};
use geometry::Surface;

use crate::{PixelStream, Settings, Shader, ShadingPoint, Work};

impl Shader<'_> {
    /// Radiance of the second term of Eq. (8): any light, scattered specularly. At the ends of the chains the other three
    /// components are computed as for the eye itself.
    pub fn specular(&self, at: &ShadingPoint<'_>, stream: PixelStream, work: &mut Work) -> Rgb {
        if !at.material.is_specular() {
            return Rgb::BLACK;
        }
        let mut sum = Rgb::BLACK;
        let emitted = self.chain(at, stream, work, |leaf, work| {
            sum += leaf.weight
                * leaf.point.albedo
                * FRAC_1_PI
                * self.irradiance(&leaf.point.facing, leaf.stream, leaf.is_glossy, work);
        });
        emitted.all + sum
    }

    /// Irradiance of all light at the end of a chain, on the side of the surface's normals.
    ///
    /// Glossy ends share the shadow rays and the gather rays of one that is seen sharply.
    pub fn irradiance(
        &self,
        surface: &Surface,
        stream: PixelStream,
        is_glossy: bool,
        work: &mut Work,
    ) -> Rgb {
        let Settings { shadow_rays, glossy_rays, .. } = self.settings;
        let rays = if is_glossy { (shadow_rays / glossy_rays).max(1) } else { shadow_rays };
        let direct: Rgb = (0..self.scene.lights.len())
            .map(|light| self.irradiance_by_few(light, surface, stream, rays, work))
            .sum();
        let indirect = match is_glossy {
            true => self.indirect_by_few(surface, stream, glossy_rays, work),
            false => self.indirect_estimate(surface, work).irradiance,
        };
        direct + indirect + self.caustic_estimate(surface, work).irradiance
    }
}
