//! Direct light: unshadowed irradiance in closed form, times visibility.
//!
//! The visibility of a light is the share of its unshadowed irradiance that arrives, estimated as a ratio of two sums
//! over the same shadow rays (Heitz, Hill and McGuire 2018, "Combining Analytic Direct Illumination and Stochastic
//! Shadows"). Where a light is wholly visible or wholly hidden there is no noise at all.

use base::{Ray, Rgb, Stream, hash_u64, math::FRAC_1_PI};
use geometry::Surface;
use glam::Vec3A;
use scene::{Light, LightSample, Toward};

use crate::shader::scramble;
use crate::{PixelStream, Shader, ShadingPoint, Work};

impl Shader<'_> {
    /// Radiance of the first term of Eq. (8): light straight from all lights, scattered diffusely.
    pub fn direct(&self, at: &ShadingPoint<'_>, stream: PixelStream, work: &mut Work) -> Rgb {
        if !at.material.is_diffuse() {
            return Rgb::BLACK;
        }
        let irradiance: Rgb = (0..self.scene.lights.len())
            .map(|light| self.irradiance_from(light, &at.facing, stream, work))
            .sum();
        at.albedo * irradiance * FRAC_1_PI
    }

    /// Irradiance from one light, shadows included.
    pub fn irradiance_from(
        &self,
        light: usize,
        surface: &Surface,
        stream: PixelStream,
        work: &mut Work,
    ) -> Rgb {
        self.irradiance_asking(self.all_rays(), light, surface, stream, work)
    }

    /// [`Shader::irradiance_from`], but that the first shadow rays stand for all if they agree.
    pub(crate) fn irradiance_until_sure(
        &self,
        light: usize,
        surface: &Surface,
        stream: PixelStream,
        work: &mut Work,
    ) -> Rgb {
        self.irradiance_asking(self.until_sure(), light, surface, stream, work)
    }

    fn irradiance_asking(
        &self,
        rays: Rays,
        light: usize,
        surface: &Surface,
        stream: PixelStream,
        work: &mut Work,
    ) -> Rgb {
        match self.closed_form(light, surface, stream) {
            Some(u) if u.is_black() => Rgb::BLACK,
            Some(u) => u * self.arriving(light, rays, surface, stream, work),
            // None stands for another where what each of them would bring isn't known.
            None => {
                let all = self.all_rays();
                self.shadow_sums(light, all, surface, stream, work).arrived / all.most as f32
            }
        }
    }

    /// The share of a light's irradiance that arrives, in [0, 1]; for lights of one color. The first shadow rays stand for all if
    /// they agree.
    pub fn visibility(
        &self,
        light: usize,
        surface: &Surface,
        stream: PixelStream,
        work: &mut Work,
    ) -> f32 {
        self.visibility_by(light, self.until_sure(), surface, stream, work)
    }

    fn all_rays(&self) -> Rays {
        Rays::all(self.shadow_points.len())
    }

    /// The first are spread over the whole light, as all are: where they agree, a shadow's edge cuts off a part of it so small
    /// that few of the others tell. Places on the light that send nothing don't count.
    fn until_sure(&self) -> Rays {
        let most = self.shadow_points.len();
        Rays { most, enough: (most / 4).max(FEWEST_THAT_AGREE) }
    }

    pub(crate) fn visibility_by(
        &self,
        light: usize,
        rays: Rays,
        surface: &Surface,
        stream: PixelStream,
        work: &mut Work,
    ) -> f32 {
        self.shadow_sums(light, rays, surface, stream, work).share()
    }

    /// The share of a light's irradiance that arrives, by channel.
    pub(crate) fn arriving(
        &self,
        light: usize,
        rays: Rays,
        surface: &Surface,
        stream: PixelStream,
        work: &mut Work,
    ) -> Rgb {
        let sums = self.shadow_sums(light, rays, surface, stream, work);
        if self.scene.lights[light].has_one_color() {
            Rgb::splat(sums.share())
        } else {
            ratio(sums.arrived, sums.sent_color)
        }
    }

    /// Irradiance from one light as if nothing cast a shadow, where there is a closed form. What a coat makes of it has none,
    /// but is a factor near 1, told by the places that shadow rays would go to.
    pub(crate) fn closed_form(
        &self,
        light: usize,
        surface: &Surface,
        stream: PixelStream,
    ) -> Option<Rgb> {
        let of_light = &self.scene.lights[light];
        let unshadowed =
            of_light.unshadowed_irradiance(surface.position, surface.shading_normal)?;
        if !self.scene.material(surface).is_coated() || unshadowed.is_black() {
            return Some(unshadowed);
        }
        let bits = hash_u64(stream.part(light as u64).0, Stream::Shadow as u64);
        let n = if of_light.is_delta() { 1 } else { self.shadow_points.len() };
        let view = of_light.seen_from(surface.position, surface.shading_normal);
        let (mut sent, mut received) = (Rgb::BLACK, Rgb::BLACK);
        for &point in &self.shadow_points[..n] {
            let Some(sample) = view.sample(scramble(point, bits)) else { continue };
            sent += sample.irradiance;
            received += self.received(surface, sample).irradiance;
        }
        Some(unshadowed * ratio(received, sent))
    }

    /// A sample of a light as the diffuse part of a surface receives it, through its coat if it has one.
    #[inline]
    pub(crate) fn received(&self, surface: &Surface, sample: LightSample) -> LightSample {
        if !self.scene.material(surface).is_coated() {
            return sample;
        }
        let dir = match sample.toward {
            Toward::Direction(dir) => dir,
            Toward::Point(point) => (point - surface.position).normalize_or_zero(),
        };
        LightSample { irradiance: sample.irradiance * self.passage(surface, dir), ..sample }
    }

    /// How much of the light from a unit direction gets to the diffuse part of a surface: see [`scene::Material::passage`].
    #[inline]
    pub(crate) fn passage(&self, surface: &Surface, dir: Vec3A) -> f32 {
        self.scene.material(surface).passage(surface.shading_normal.dot(dir))
    }

    fn shadow_sums(
        &self,
        light: usize,
        Rays { most, enough }: Rays,
        surface: &Surface,
        stream: PixelStream,
        work: &mut Work,
    ) -> ShadowSums {
        let bits = hash_u64(stream.part(light as u64).0, Stream::Shadow as u64);
        let light = &self.scene.lights[light];
        let n = if light.is_delta() { 1 } else { most.min(self.shadow_points.len()) };
        let view = light.seen_from(surface.position, surface.shading_normal);
        let mut sums = ShadowSums { sent: 0.0, sent_color: Rgb::BLACK, arrived: Rgb::BLACK };
        let (mut n_asked, mut any_passes, mut all_pass) = (0, false, true);
        for &point in &self.shadow_points[..n] {
            if n_asked == enough && any_passes == all_pass {
                break;
            }
            let u = scramble(point, bits);
            let Some(sample) = view.sample(u) else { continue };
            let sample = self.received(surface, sample);
            sums.sent += sample.irradiance.mean();
            sums.sent_color += sample.irradiance;
            let passing = self.passing(surface, sample.toward, work);
            n_asked += 1;
            any_passes |= passing > 0.0;
            all_pass &= passing == 1.0;
            if passing > 0.0 {
                sums.arrived += sample.irradiance * passing;
            }
        }
        sums
    }

    /// What [`Shader::irradiance_from`] gives in the mean, from fewer shadow rays: they go to points chosen among all
    /// that it would ask for, in proportion to the irradiance from there.
    pub(crate) fn irradiance_by_few(
        &self,
        light: usize,
        surface: &Surface,
        stream: PixelStream,
        rays: u32,
        work: &mut Work,
    ) -> Rgb {
        let (position, normal) = (surface.position, surface.shading_normal);
        let of_light = &self.scene.lights[light];
        if of_light.is_delta() || rays as usize >= self.shadow_points.len() {
            return self.irradiance_from(light, surface, stream, work);
        }
        let unshadowed = self.closed_form(light, surface, stream);
        if unshadowed.is_some_and(Rgb::is_black) {
            return Rgb::BLACK;
        }
        let bits = hash_u64(stream.part(light as u64).0, Stream::Shadow as u64);
        let mut samples = std::mem::take(&mut work.light_samples);
        samples.clear();
        let points = self.shadow_points.iter().map(|&point| scramble(point, bits));
        let view = of_light.seen_from(position, normal);
        samples.extend(points.filter_map(|u| Some(self.received(surface, view.sample(u)?))));
        let sent: Rgb = samples.iter().map(|s| s.irradiance).sum();
        // Every so much of what is sent, from a random start, a ray goes to the point that sends it.
        let step = sent.mean() / rays as f32;
        let mut next = step * (hash_u64(bits, 0) >> 40) as f32 * (1.0 / 16_777_216.0);
        let (mut before, mut arrived, mut color) = (0.0, 0.0, Rgb::BLACK);
        for sample in &samples {
            before += sample.irradiance.mean();
            if next < before {
                let chosen = ((before - next) / step).ceil();
                next += chosen * step;
                let passing = self.passing(surface, sample.toward, work);
                if passing > 0.0 {
                    arrived += chosen * passing;
                    color +=
                        sample.irradiance * (passing * chosen * step / sample.irradiance.mean());
                }
            }
        }
        work.light_samples = samples;
        if !of_light.has_one_color() {
            let unshadowed = unshadowed.unwrap_or(sent / self.shadow_points.len() as f32);
            return unshadowed * ratio(color, sent);
        }
        unshadowed.unwrap_or(sent / self.shadow_points.len() as f32)
            * (arrived / rays as f32).min(1.0)
    }

    /// The part of light that passes between a surface and a place on a light: all or nothing, but for masks.
    #[inline]
    pub(crate) fn passing(&self, surface: &Surface, toward: Toward, work: &mut Work) -> f32 {
        let ray = match toward {
            Toward::Direction(dir) => Ray::unbounded(surface.leave(dir), dir),
            Toward::Point(target) => {
                let origin = surface.leave(target - surface.position);
                let to_target = target - origin;
                let distance = to_target.length();
                if distance == 0.0 {
                    return 1.0;
                }
                // Stops short of the light, whose own surface casts no shadow on what it lights.
                Ray::new(origin, to_target / distance, distance * (1.0 - 2.0_f32.powi(-16)))
            }
        };
        // Below the true surface there is only its inside.
        if ray.dir().dot(surface.geometric_normal) <= 0.0 {
            return 0.0;
        }
        work.counts.shadow_rays += 1;
        self.scene.passing(&ray)
    }

    /// Whether one ray to a light gets through; nothing if the light sends nothing along it. Of the points on the light
    /// that [`Shader::visibility`] uses this takes number `which`, moved by the random bits of `block`.
    pub fn probe(
        &self,
        light: usize,
        surface: &Surface,
        which: u32,
        block: u64,
        work: &mut Work,
    ) -> Option<bool> {
        let bits = hash_u64(PixelStream(block).part(light as u64).0, Stream::Probe as u64);
        let point = self.shadow_points.get(which as usize % self.shadow_points.len())?;
        let u = scramble(*point, bits);
        let sample =
            self.scene.lights[light].sample(surface.position, surface.shading_normal, u)?;
        Some(self.passing(surface, sample.toward, work) > 0.5)
    }

    /// The light with a number.
    pub fn light(&self, light: usize) -> &Light {
        &self.scene.lights[light]
    }
}

/// Fewer shadow rays than so many don't stand for others.
const FEWEST_THAT_AGREE: usize = 16;

/// How many shadow rays go to a light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rays {
    most: usize,
    /// So many stand for all if they agree.
    enough: usize,
}

impl Rays {
    /// So many, whatever they tell; at most those of the settings.
    pub(crate) fn all(n: usize) -> Self {
        Self { most: n, enough: n }
    }
}

/// Sums over the shadow rays of a light.
struct ShadowSums {
    /// Mean over the channels of what would arrive without anything between.
    sent: f32,
    /// The same by channel.
    sent_color: Rgb,
    /// What arrives.
    arrived: Rgb,
}

impl ShadowSums {
    /// The share that arrives, over all channels.
    fn share(&self) -> f32 {
        if self.sent > 0.0 { self.arrived.mean() / self.sent } else { 0.0 }
    }
}

/// A part of a whole, by channel; nothing of nothing.
pub(crate) fn ratio(part: Rgb, whole: Rgb) -> Rgb {
    let of = |part: f32, whole: f32| if whole > 0.0 { part / whole } else { 0.0 };
    Rgb::new(of(part.r, whole.r), of(part.g, whole.g), of(part.b, whole.b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seen::each_pixel;

    #[test]
    fn shadow_rays_that_agree_stand_for_all() {
        const RAYS: u64 = 64;
        let (mut n, mut n_rays, mut n_cut_off) = (0, 0, 0);
        let (mut bias, mut worst) = (0.0, 0.0_f32);
        each_pixel("rabbit", RAYS as u32, |shader, point, stream, work| {
            for light in 0..shader.scene.lights.len() {
                let surface = &point.facing;
                if shader.closed_form(light, surface, stream).is_none_or(Rgb::is_black) {
                    continue;
                }
                let all = shader.shadow_sums(light, shader.all_rays(), surface, stream, work);
                let before = work.counts.shadow_rays;
                let told = shader.visibility(light, surface, stream, work);
                let rays = work.counts.shadow_rays - before;
                let wrong_by = told - all.share();
                // What tells of both light and shadow is told by all.
                if told > 1e-6 && told < 1.0 - 1e-6 {
                    assert_eq!(wrong_by, 0.0);
                }
                n += 1;
                n_rays += rays;
                n_cut_off += u32::from(wrong_by.abs() > 1e-6);
                bias += f64::from(wrong_by);
                worst = worst.max(wrong_by.abs());
            }
        });
        assert!(n > 3000 && n_rays < u64::from(n) * RAYS / 3, "{n_rays} rays of {n} places");
        assert!(n_cut_off > 0 && n_cut_off < n / 50, "{n_cut_off} of {n}");
        assert!((bias / f64::from(n)).abs() < 1e-4 && worst < 0.1, "{bias} {worst}");
    }
}
