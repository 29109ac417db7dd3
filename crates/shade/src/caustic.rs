//! Caustics: the density of photons that came through specular bounces only.

use base::{Rgb, math::FRAC_1_PI};
use geometry::Surface;
use photon_map::Estimate;

use crate::{Shader, ShadingPoint, Work};

impl Shader<'_> {
    /// Radiance of the third term of Eq. (8): light that came through specular bounces only, scattered diffusely.
    pub fn caustic(&self, at: &ShadingPoint<'_>, work: &mut Work) -> Rgb {
        if !at.material.is_diffuse() {
            return Rgb::BLACK;
        }
        at.albedo * self.caustic_estimate(&at.facing, work).irradiance * FRAC_1_PI
    }

    /// Irradiance of caustics on the side of the surface's normals.
    pub fn caustic_estimate(&self, surface: &Surface, work: &mut Work) -> Estimate {
        let guess = work.last_caustic.guess(surface.position);
        let gather = &self.settings.caustic;
        let estimate = self.estimate(&self.photons.caustic, surface, gather, guess, work);
        work.last_caustic.remember(surface.position, &estimate);
        estimate
    }
}
