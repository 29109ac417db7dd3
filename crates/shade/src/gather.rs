//! Indirect light by final gathering (Jensen 1996): rays over the hemisphere ask what surfaces around reflect.
//!
//! Where they end, irradiance is known ahead ([`IrradiancePoints`]). It holds all light but what emitters send straight to
//! the shaded point, which is direct light: rays that find an emitter add nothing for it. Nor do rays that find mirrors
//! or glass: what comes by these from emitters is a caustic, and what comes from diffuse surfaces is as focused as a
//! caustic. It has photons of its own ([`base::PhotonClass::Focused`]), and an estimate of these is better than what
//! few rays would find by luck. So no light is counted twice.
//!
//! All points of a picture use the same directions, turned with their normals and without a seam: the direction is that
//! of `n + s`, for points `s` of the unit sphere (cosine-distributed if `s` is uniform). What finitely many directions
//! miss then varies slowly over a surface, where independent ones would grain, and interpolates as well as the light.

use base::math::{FRAC_1_PI, PI};
use base::{OwenSobol, Ray, Rgb, Rng, Stream, hash_u64, warp};
use geometry::Surface;
use glam::{Vec2, Vec3A};
use photon_map::Estimate;

use crate::irradiance_points::{GatherPhotons, IrradianceAhead, IrradiancePoints};
use crate::spots::Spots;
use crate::{PixelStream, Shader, ShadingPoint, Work};

/// Strong light on small areas is gathered from one photon for so many rays.
const RAYS_PER_SPOT: usize = 8;

/// Of more lights than this, so many are asked where a ray ends near by.
const LIGHTS: usize = 4;

/// What final gathering needs to know.
#[derive(Debug)]
pub(crate) struct Gathering<'a> {
    points: IrradiancePoints<'a>,
    /// Points of the unit sphere; every part of them in this order is spread evenly, too.
    sphere: Vec<Vec3A>,
    /// All of them in an order in which neighbors are close, so that their rays visit the same memory.
    ordered: Vec<u32>,
    spots: Spots,
    /// Where a ray ends nearer than this, in world units, the blur of the irradiance there would show, as in corners: the
    /// path goes on by one direction more, and emitters are asked.
    near: f32,
}

impl<'a> Shader<'a> {
    /// Indirect light by final gathering from now on, with so many rays, at least 1. `ahead` is what
    /// [`Shader::irradiance_ahead`] has found at [`GatherPhotons::places`].
    #[must_use]
    pub fn gathering(
        mut self,
        rays: u32,
        photons: GatherPhotons<'a>,
        ahead: &[IrradianceAhead],
    ) -> Self {
        let points = IrradiancePoints::new(photons, ahead);
        let near = points.near();
        let n_spots = (rays as usize).div_ceil(RAYS_PER_SPOT);
        let spots = Spots::new(&self, &points, n_spots);
        let sobol = OwenSobol::new(hash_u64(self.settings.seed, Stream::Gather as u64));
        let sphere: Vec<Vec3A> = (0..u64::from(rays.max(1)))
            .map(|i| warp::uniform_sphere(Vec2::from(sobol.point::<2>(i))))
            .collect();
        let mut ordered: Vec<u32> = (0..sphere.len() as u32).collect();
        ordered.sort_by_key(|&i| place_on_curve(sphere[i as usize]));
        self.gathering = Some(Gathering { points, sphere, ordered, spots, near });
        self
    }

    /// Whether indirect light comes from final gathering.
    pub fn is_gathering(&self) -> bool {
        self.gathering.is_some()
    }

    /// Irradiance of indirect light by all gather rays. Its radius is the mean distance (harmonic) of what is around.
    pub(crate) fn gather_all(
        &self,
        gathering: &Gathering<'_>,
        surface: &Surface,
        work: &mut Work,
    ) -> Estimate {
        let spots = &gathering.spots;
        let from_spots = spots.irradiance(self, surface, 0..spots.len(), work);
        let gathered = self.gather_by(gathering, surface, &gathering.ordered, work);
        let focused = self.focused(gathering, surface, work);
        Estimate { irradiance: gathered.irradiance + from_spots + focused, ..gathered }
    }

    /// The same by one in `parts` of the rays, which ones by chance.
    pub(crate) fn gather_part(
        &self,
        gathering: &Gathering<'_>,
        surface: &Surface,
        parts: u32,
        stream: PixelStream,
        work: &mut Work,
    ) -> Rgb {
        let which = hash_u64(stream.0, Stream::Gather as u64);
        let part = |n_all: usize| {
            let n = (n_all / parts as usize).max(1).min(n_all);
            let first = if n > 0 { n * (which % (n_all / n) as u64) as usize } else { 0 };
            first..first + n
        };
        let rays: Vec<u32> = part(gathering.sphere.len()).map(|i| i as u32).collect();
        let spots = part(gathering.spots.len());
        self.gather_by(gathering, surface, &rays, work).irradiance
            + gathering.spots.irradiance(self, surface, spots, work)
            + self.focused(gathering, surface, work)
    }

    fn gather_by(
        &self,
        gathering: &Gathering<'_>,
        surface: &Surface,
        rays: &[u32],
        work: &mut Work,
    ) -> Estimate {
        let normal = surface.shading_normal;
        let (mut sum, mut nearness) = (Rgb::BLACK, 0.0);
        for &i in rays {
            let dir = (normal + gathering.sphere[i as usize]).normalize_or(normal);
            // Below the true surface there is only its inside.
            if dir.dot(surface.geometric_normal) <= 0.0 {
                continue;
            }
            let ray = Ray::unbounded(surface.leave(dir), dir);
            let (radiance, distance) = self.reflected_along(gathering, ray, i, work);
            sum += radiance * self.passage(surface, dir);
            nearness += 1.0 / distance.max(f32::MIN_POSITIVE);
        }
        let n = rays.len() as f32;
        Estimate { irradiance: sum * (PI / n), radius: n / nearness, found: 0, visited: 0 }
    }

    /// Radiance that comes back along gather ray number `i` from diffuse surfaces, and how far the first surface is.
    fn reflected_along(
        &self,
        gathering: &Gathering<'_>,
        mut ray: Ray,
        i: u32,
        work: &mut Work,
    ) -> (Rgb, f32) {
        let mut chance = None;
        let (mut sum, mut weight) = (Rgb::BLACK, Rgb::ONE);
        let mut first = f32::INFINITY;
        for length in 1.. {
            work.counts.gather_rays += 1;
            let Some((ShadingPoint { facing, albedo, .. }, distance)) = self.arrive(&ray) else {
                break;
            };
            if length == 1 {
                first = distance;
            }
            if albedo.is_black() {
                break;
            }
            weight *= albedo;
            if distance >= gathering.near {
                let mut irradiance = gathering.points.irradiance(self, &facing, work);
                if length == 1 {
                    irradiance = irradiance * gathering.spots.rest(irradiance, distance);
                }
                sum += weight * irradiance * FRAC_1_PI;
                break;
            }
            let rng = chance
                .get_or_insert_with(|| Rng::new(self.settings.seed, Stream::Gather, u64::from(i)));
            let irradiance = self.emitted_onto(&facing, rng, work)
                + gathering.points.specular_irradiance(self, &facing, work);
            sum += weight * irradiance * FRAC_1_PI;
            let normal = facing.shading_normal;
            let dir = (normal + warp::uniform_sphere(rng.next_2d())).normalize_or(normal);
            // Between white walls close together paths would never end.
            let survival = if length > 2 { weight.max_channel().min(1.0) } else { 1.0 };
            if dir.dot(facing.geometric_normal) <= 0.0 || rng.next_f32() >= survival {
                break;
            }
            weight = weight * (self.passage(&facing, dir) / survival);
            ray = Ray::unbounded(facing.leave(dir), dir);
        }
        (sum, first)
    }

    /// Irradiance of indirect light that comes by mirrors or glass, from photons.
    fn focused(&self, gathering: &Gathering<'_>, surface: &Surface, work: &mut Work) -> Rgb {
        let gather = &self.settings.indirect;
        let guess = work.last_indirect.guess(surface.position);
        let focused = gathering.points.photons().focused;
        let estimate = self.estimate(focused, surface, gather, guess, work);
        work.last_indirect.remember(surface.position, &estimate);
        estimate.irradiance
    }

    /// Irradiance straight from emitters, with one shadow ray for a light.
    fn emitted_onto(&self, surface: &Surface, rng: &mut Rng, work: &mut Work) -> Rgb {
        let lights = &self.scene.lights;
        let n = lights.len().min(LIGHTS);
        let start = rng.next_f32();
        let mut sum = Rgb::BLACK;
        for j in 0..n {
            let place = (j as f32 + start) / n as f32 * lights.len() as f32;
            let light = &lights[(place as usize).min(lights.len() - 1)];
            let view = light.seen_from(surface.position, surface.shading_normal);
            let Some(sample) = view.sample(rng.next_2d()) else { continue };
            let passing = self.passing(surface, sample.toward, work);
            if passing > 0.0 {
                let sample = self.received(surface, sample);
                sum += sample.irradiance * (passing * lights.len() as f32 / n as f32);
            }
        }
        sum
    }
}

/// The place of a point of the unit sphere on a curve that fills space.
fn place_on_curve(s: Vec3A) -> u32 {
    let cell = ((s + 1.0) * 127.5).to_array().map(|x| x as u32);
    (0..8)
        .map(|bit| (0..3).map(|axis| (cell[axis] >> bit & 1) << (3 * bit + axis)).sum::<u32>())
        .sum()
}
