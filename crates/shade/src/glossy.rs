//! Glossy light: what rough mirrors, metals and glass show.
//!
//! The first rough surface of a chain is followed in [`crate::Settings::glossy_rays`] directions chosen by its lobe, later
//! ones in one. Emitters are found by both these rays and rays to points of them, weighted by the balance heuristic
//! (Veach 1997, section 9.2): a broad lobe would find a small lamp too rarely, and points of a large lamp would meet a
//! narrow lobe too rarely. Environment maps are found likewise, by directions drawn from them. Points, spots and parallel
//! light are found from the light only, an environment of one radiance by the lobe only.

use base::{OwenSobol, Rgb, Rng, Stream, hash_u64};
use glam::{Vec2, Vec3A};
use scene::{Light, LightKind, Lobe, Scene};

use crate::chain::{Chains, Origin};
use crate::{PixelStream, Shader, ShadingPoint, Work};

/// How a rough surface has chosen a direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chosen {
    /// Directions per steradian that were chosen there.
    density: f32,
    /// Whether it is the first rough surface of its chain.
    is_first: bool,
}

/// The lights among which rough surfaces choose, each with its share of the flux.
#[derive(Debug)]
pub(crate) struct LightShares {
    /// Of emissive surfaces and environment maps, by their number.
    extended: Vec<(usize, f32)>,
    /// Of points, spots and parallel light.
    delta: Vec<(usize, f32)>,
}

impl LightShares {
    pub(crate) fn new(scene: &Scene) -> Self {
        let bounds = scene.bounds();
        let of = |wanted: fn(&Light) -> bool| {
            let lights = scene.lights.iter().enumerate().filter(|(_, light)| wanted(light));
            let mut shares: Vec<_> = lights.map(|(i, l)| (i, l.flux(&bounds).mean())).collect();
            let sum: f32 = shares.iter().map(|s| s.1).sum();
            shares.iter_mut().for_each(|s| s.1 /= sum);
            shares
        };
        Self {
            extended: of(|light| {
                matches!(
                    light.kind,
                    LightKind::Area(_) | LightKind::Sphere(_) | LightKind::EnvironmentMap(_)
                )
            }),
            delta: of(Light::is_delta),
        }
    }
}

/// One light by chance, and its probability.
fn choose(shares: &[(usize, f32)], rng: &mut Rng) -> Option<(usize, f32)> {
    let mut u = rng.next_f32();
    let chosen = shares.iter().find(|(_, share)| {
        u -= share;
        u < 0.0
    });
    chosen.or(shares.last()).copied()
}

impl<'a> Shader<'a> {
    /// Adds the branches that leave a rough surface; the radiance towards the eye of lights that it shows.
    pub(crate) fn scatter_by_lobe(
        &self,
        lobe: &Lobe,
        at: &ShadingPoint<'a>,
        from: Origin<'a>,
        chains: &mut Chains<'a, '_>,
        work: &mut Work,
    ) -> Rgb {
        let is_first = !from.is_glossy;
        let n = if is_first { self.settings.glossy_rays } else { 1 };
        let shared = Origin { weight: from.weight / n as f32, is_glossy: true, ..from };
        let points = self.lobe_points(from.stream);
        for i in 0..u64::from(n) {
            let [x, y, choice] = points.point(i);
            let Some(sample) = lobe.sample(Vec2::new(x, y), choice) else { continue };
            let chosen = Chosen { density: n as f32 * sample.pdf, is_first };
            chains.push(at, &shared, sample.into(), Some(chosen));
        }
        let mut sum = Rgb::BLACK;
        if is_first && chains.follow.is_lit {
            for &(light, _) in &self.light_shares.delta {
                sum += self.shine(light, 1.0, n, Vec2::ZERO, lobe, at, &from, work);
            }
            for &(light, share) in &self.light_shares.extended {
                let n_points = self.points_of_light(share);
                let points = self.lobe_points(from.stream.part(!(light as u64)));
                for i in 0..n_points as u64 {
                    let u = Vec2::from(points.point::<2>(i));
                    sum += self.shine(light, n_points, n, u, lobe, at, &from, work);
                }
            }
        } else if !is_first {
            for shares in [&self.light_shares.delta, &self.light_shares.extended] {
                if let Some((light, p)) = choose(shares, &mut chains.rng) {
                    let u = chains.rng.next_2d();
                    // What is drawn is the same, whoever asks.
                    if chains.follow.is_lit {
                        sum += self.shine(light, p, n, u, lobe, at, &from, work);
                    }
                }
            }
        }
        sum
    }

    /// Points that a rough surface chooses by.
    fn lobe_points(&self, stream: PixelStream) -> OwenSobol {
        OwenSobol::new(hash_u64(hash_u64(self.settings.seed, Stream::Lobe as u64), stream.0))
    }

    /// How many points of a light with an extent the first rough surface of a chain asks for.
    fn points_of_light(&self, share: f32) -> f32 {
        (share * self.settings.glossy_rays as f32).round().max(1.0)
    }

    /// The share that the lobe has in finding the emitter where its ray has arrived; the rest is found from the light.
    pub(crate) fn share_of_lobe(
        &self,
        chosen: &Chosen,
        at: &ShadingPoint<'_>,
        distance: f32,
    ) -> f32 {
        let Some(light) = self.scene.light_of(&at.surface) else { return 1.0 };
        let cos = at.w_o.dot(at.facing.geometric_normal);
        self.share_by_density(chosen, light, self.scene.lights[light].beam_pdf(cos, distance))
    }

    /// What the lobe has found beyond the scene: of each light its share.
    pub(crate) fn background_by_lobe(&self, chosen: &Chosen, dir: Vec3A) -> Rgb {
        let of_light = |(i, light): (usize, &Light)| {
            let (radiance, pdf) = light.from_beyond(dir);
            radiance * self.share_by_density(chosen, i, pdf)
        };
        self.scene.lights.iter().enumerate().map(of_light).sum()
    }

    /// The share of the lobe, given the density at which one point of the light would have been found.
    fn share_by_density(&self, chosen: &Chosen, light: usize, pdf: f32) -> f32 {
        let extended = &self.light_shares.extended;
        let Ok(place) = extended.binary_search_by_key(&light, |s| s.0) else { return 1.0 };
        let share = extended[place].1;
        let points = if chosen.is_first { self.points_of_light(share) } else { share };
        chosen.density / (chosen.density + points * pdf)
    }

    /// Radiance towards the eye of a light that a rough surface scatters, from one point of the light out of `points`, in
    /// the mean; `rays` are as many as the lobe has chosen.
    #[expect(clippy::too_many_arguments, reason = "a place on a light and one on a surface")]
    fn shine(
        &self,
        light: usize,
        points: f32,
        rays: u32,
        u: Vec2,
        lobe: &Lobe,
        at: &ShadingPoint<'a>,
        from: &Origin<'a>,
        work: &mut Work,
    ) -> Rgb {
        let light = &self.scene.lights[light];
        let Some(beam) = light.beam(at.surface.position, u) else { return Rgb::BLACK };
        let Some(scattered) = lobe.evaluate(beam.dir) else { return Rgb::BLACK };
        let share = if light.is_delta() {
            1.0
        } else {
            let from_light = points * beam.pdf;
            from_light / (from_light + rays as f32 * scattered.pdf)
        };
        let mut radiance = from.weight * scattered.value * beam.irradiance * (share / points);
        if radiance.is_black() {
            return Rgb::BLACK;
        }
        let passing = self.passing(&at.surface.facing(beam.dir), beam.toward, work);
        if passing <= 0.0 {
            return Rgb::BLACK;
        }
        radiance = radiance * passing;
        if let Some(glass) = at.medium_beyond(scattered.transmitted, from.medium) {
            radiance *= glass.transmittance(beam.distance);
        }
        radiance
    }
}
