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
            let (facing, stream) = (&leaf.point.facing, leaf.stream);
            let irradiance = match leaf.is_glossy {
                true => self.irradiance_of_glossy(facing, stream, work),
                false => self.irradiance(facing, stream, self.settings.shadow_rays, work),
            };
            sum += leaf.weight * leaf.point.albedo * FRAC_1_PI * irradiance;
        });
        emitted.all + sum
    }

    /// Irradiance of all light at the end of a chain, on the side of the surface's normals, by so many shadow rays to each light.
    pub fn irradiance(
        &self,
        surface: &Surface,
        stream: PixelStream,
        rays: u32,
        work: &mut Work,
    ) -> Rgb {
        let indirect = self.indirect_estimate(surface, work).irradiance;
        indirect + self.irradiance_but_indirect(surface, stream, rays, work)
    }

    /// The same at a glossy end: all of a sharp one share its shadow rays and its gather rays.
    pub fn irradiance_of_glossy(
        &self,
        surface: &Surface,
        stream: PixelStream,
        work: &mut Work,
    ) -> Rgb {
        let Settings { shadow_rays, glossy_rays, .. } = self.settings;
        let rays = (shadow_rays / glossy_rays).max(1);
        let indirect = self.indirect_by_few(surface, stream, glossy_rays, work);
        indirect + self.irradiance_but_indirect(surface, stream, rays, work)
    }

    fn irradiance_but_indirect(
        &self,
        surface: &Surface,
        stream: PixelStream,
        rays: u32,
        work: &mut Work,
    ) -> Rgb {
        let direct: Rgb = (0..self.scene.lights.len())
            .map(|light| self.irradiance_by_few(light, surface, stream, rays, work))
            .sum();
        direct + self.caustic_estimate(surface, work).irradiance
    }
}
