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
                false => self.irradiance(facing, stream, work),
            };
            sum += leaf.weight * leaf.point.albedo * FRAC_1_PI * irradiance;
        });
        emitted + sum
    }

    /// Irradiance of all light at the end of a chain, on the side of the surface's normals.
    fn irradiance(&self, surface: &Surface, stream: PixelStream, work: &mut Work) -> Rgb {
        self.irradiance_with(surface, work, |light, work| {
            self.irradiance_from(light, surface, stream, work)
        })
    }

    /// The same by at most so many shadow rays to each light, and by less where the first of all agree.
    pub fn irradiance_by(
        &self,
        surface: &Surface,
        stream: PixelStream,
        rays: u32,
        work: &mut Work,
    ) -> Rgb {
        self.irradiance_with(surface, work, |light, work| {
            if rays < self.settings.shadow_rays {
                self.irradiance_by_few(light, surface, stream, rays, work)
            } else {
                self.irradiance_until_sure(light, surface, stream, work)
            }
        })
    }

    fn irradiance_with(
        &self,
        surface: &Surface,
        work: &mut Work,
        direct: impl Fn(usize, &mut Work) -> Rgb,
    ) -> Rgb {
        let indirect = self.indirect_estimate(surface, work).irradiance;
        indirect + self.direct_and_caustic(surface, work, direct)
    }

    /// [`Shader::irradiance_by`] at a glossy end: all of a sharp one share its shadow rays and its gather rays.
    pub fn irradiance_of_glossy(
        &self,
        surface: &Surface,
        stream: PixelStream,
        work: &mut Work,
    ) -> Rgb {
        let Settings { shadow_rays, glossy_rays, .. } = self.settings;
        let rays = (shadow_rays / glossy_rays).max(1);
        let indirect = self.indirect_by_few(surface, stream, glossy_rays, work);
        let direct_and_caustic = self.direct_and_caustic(surface, work, |light, work| {
            self.irradiance_by_few(light, surface, stream, rays, work)
        });
        indirect + direct_and_caustic
    }

    fn direct_and_caustic(
        &self,
        surface: &Surface,
        work: &mut Work,
        direct: impl Fn(usize, &mut Work) -> Rgb,
    ) -> Rgb {
        let direct: Rgb = (0..self.scene.lights.len()).map(|light| direct(light, work)).sum();
        direct + self.caustic_estimate(surface, work).irradiance
    }
}
