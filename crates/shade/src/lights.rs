//! Many lights at once, at a cost that doesn't grow with their number.

use base::{Rgb, Stream, hash_u64};
use geometry::Surface;

use crate::direct::{Rays, ratio};
use crate::shader::scramble;
use crate::{PixelStream, Shader, Work};

/// The least number of shadow rays that tell how much of each color arrives.
const FEWEST_BY_CHANNEL: usize = 16;

impl Shader<'_> {
    /// Irradiance from some lights as if nothing cast a shadow: in closed form where there is one, else the mean over the
    /// places that shadow rays would go to.
    pub fn unshadowed_irradiance(
        &self,
        lights: &[usize],
        surface: &Surface,
        stream: PixelStream,
    ) -> Rgb {
        lights.iter().map(|&light| self.unshadowed(light, surface, stream)).sum()
    }

    /// The share of [`Shader::unshadowed_irradiance`] that arrives, by channel.
    ///
    /// About so many shadow rays are shared among the lights by their unshadowed irradiance; a light whose share is less
    /// than one ray gets one by chance, in one sweep over all, and counts for those that got none. Without bias, but
    /// for that of the ratio of each light.
    pub fn visibility_of_lights(
        &self,
        lights: &[usize],
        surface: &Surface,
        stream: PixelStream,
        rays: u32,
        work: &mut Work,
    ) -> Rgb {
        let unshadowed: Vec<Rgb> =
            lights.iter().map(|&light| self.unshadowed(light, surface, stream)).collect();
        let all: Rgb = unshadowed.iter().copied().sum();
        let per_ray = all.mean() / rays as f32;
        if per_ray <= 0.0 {
            return Rgb::BLACK;
        }
        let start = (hash_u64(stream.0, Stream::Shadow as u64) >> 40) as f32 * (1.0 / 16_777_216.0);
        let (mut sum, mut next) = (Rgb::BLACK, start);
        let mut arrived = Rgb::BLACK;
        for (&light, &irradiance) in lights.iter().zip(&unshadowed) {
            let share = irradiance.mean() / per_ray;
            if share <= 0.0 {
                continue;
            }
            let is_many_colored = !self.scene.lights[light].has_one_color();
            if share >= 1.0 || is_many_colored {
                let least = if is_many_colored { FEWEST_BY_CHANNEL } else { 1 };
                let rays = Rays::all((share as usize).max(least));
                arrived += irradiance * self.arriving(light, rays, surface, stream, work);
                continue;
            }
            sum += irradiance;
            // Of all lights with a share below one, every so much of what they send gets a ray.
            while sum.mean() / per_ray > next {
                let free = self.visibility_by(light, Rays::all(1), surface, stream, work);
                arrived += irradiance * (free / share);
                next += 1.0;
            }
        }
        ratio(arrived, all)
    }

    fn unshadowed(&self, light: usize, surface: &Surface, stream: PixelStream) -> Rgb {
        self.closed_form(light, surface, stream).unwrap_or_else(|| {
            let (position, normal) = (surface.position, surface.shading_normal);
            let of_light = &self.scene.lights[light];
            let bits = hash_u64(stream.part(light as u64).0, Stream::Shadow as u64);
            let points = self.shadow_points.iter().map(|&point| scramble(point, bits));
            let view = of_light.seen_from(position, normal);
            let sent: Rgb = points
                .filter_map(|u| Some(self.received(surface, view.sample(u)?).irradiance))
                .sum();
            sent / self.shadow_points.len() as f32
        })
    }
}
