//! Indirect light: the density of photons that were scattered diffusely before, or what surfaces around reflect.

use base::{Rgb, math::FRAC_1_PI};
use geometry::Surface;
use photon_map::Estimate;

use crate::{PixelStream, Shader, ShadingPoint, Work};

impl Shader<'_> {
    /// Radiance of the last term of Eq. (8): light that was scattered diffusely at least once, scattered diffusely.
    pub fn indirect(&self, at: &ShadingPoint<'_>, work: &mut Work) -> Rgb {
        if !at.material.is_diffuse() {
            return Rgb::BLACK;
        }
        at.albedo * self.indirect_estimate(&at.facing, work).irradiance * FRAC_1_PI
    }

    /// Irradiance of indirect light on the side of the surface's normals, with the length over which it varies.
    pub fn indirect_estimate(&self, surface: &Surface, work: &mut Work) -> Estimate {
        match &self.gathering {
            Some(gathering) => self.gather_all(gathering, surface, work),
            None => self.indirect_photons(surface, work),
        }
    }

    /// Its irradiance at one of so many ends of glossy chains of a pixel, which together do the work of one.
    pub(crate) fn indirect_by_few(
        &self,
        surface: &Surface,
        stream: PixelStream,
        parts: u32,
        work: &mut Work,
    ) -> Rgb {
        match &self.gathering {
            Some(gathering) => self.gather_part(gathering, surface, parts, stream, work),
            None => self.indirect_photons(surface, work).irradiance,
        }
    }

    fn indirect_photons(&self, surface: &Surface, work: &mut Work) -> Estimate {
        let guess = work.last_indirect.guess(surface.position);
        let gather = &self.settings.indirect;
        let estimate = self.estimate(&self.photons.indirect, surface, gather, guess, work);
        work.last_indirect.remember(surface.position, &estimate);
        estimate
    }
}
