//! What shading needs to know.

use base::{OwenSobol, Ray, Rgb};
use geometry::Surface;
use glam::{Vec2, Vec3A};
use photon_map::{Gather, PhotonMaps};
use scene::Scene;

use crate::gather::Gathering;
use crate::glossy::LightShares;
use crate::{ShadingPoint, Work};

/// How components are computed. All that changes a picture is here, the scene, the photons and [`Shader::gathering`]
/// aside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Shadow rays for each light that isn't a point or a direction.
    pub shadow_rays: u32,
    /// Directions in which the first rough surface of a chain is followed; at least 1.
    pub glossy_rays: u32,
    /// Estimate of indirect light.
    pub indirect: Gather,
    /// Estimate of caustics.
    pub caustic: Gather,
    /// Seed of all random streams.
    pub seed: u64,
}

/// Computes components.
#[derive(Debug)]
pub struct Shader<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its photons.
    pub photons: &'a PhotonMaps,
    /// How.
    pub settings: Settings,
    /// The points on the unit square that shadow rays use, before each pixel scrambles them.
    pub(crate) shadow_points: Vec<[u32; 2]>,
    pub(crate) light_shares: LightShares,
    /// What indirect light is gathered from; without it, photons are counted.
    pub(crate) gathering: Option<Gathering<'a>>,
}

impl<'a> Shader<'a> {
    /// Gets ready to shade, with indirect light by density estimates.
    pub fn new(scene: &'a Scene, photons: &'a PhotonMaps, settings: Settings) -> Self {
        let sobol = OwenSobol::new(settings.seed);
        let bits = |x: f32| ((x * 16_777_216.0) as u32) << 8;
        let shadow_points =
            (0..u64::from(settings.shadow_rays)).map(|i| sobol.point::<2>(i).map(bits)).collect();
        let light_shares = LightShares::new(scene);
        Self { scene, photons, settings, shadow_points, light_shares, gathering: None }
    }

    /// The surface at which a ray from the eye arrives.
    #[inline]
    pub fn eye_surface(&self, ray: &Ray, work: &mut Work) -> Option<Surface> {
        work.counts.eye_rays += 1;
        self.scene.arrive(ray, self.settings.seed).map(|(surface, _)| surface)
    }

    /// Where a ray from the eye arrives.
    pub fn eye_point(&self, ray: &Ray, work: &mut Work) -> Option<ShadingPoint<'a>> {
        self.eye_surface(ray, work).map(|surface| self.shading_point(surface, -ray.dir()))
    }

    /// Where a ray arrives, and after what distance.
    #[inline]
    pub(crate) fn arrive(&self, ray: &Ray) -> Option<(ShadingPoint<'a>, f32)> {
        let (surface, distance) = self.scene.arrive(ray, self.settings.seed)?;
        Some((self.shading_point(surface, -ray.dir()), distance))
    }

    /// A surface as seen from the unit direction `w_o`.
    #[inline]
    pub fn shading_point(&self, surface: Surface, w_o: Vec3A) -> ShadingPoint<'a> {
        ShadingPoint {
            surface,
            facing: surface.facing(w_o),
            material: self.scene.material(&surface),
            albedo: self.scene.albedo_from(&surface, w_o),
            emitted: self.scene.emitted(&surface, w_o),
            w_o,
        }
    }

    /// Radiance along a ray that meets nothing, by its direction.
    pub fn background(&self, dir: Vec3A) -> Rgb {
        self.scene.background(dir)
    }
}

/// A point of a fixed set, moved by the random bits of a pixel: a random digital shift keeps the stratification of a
/// Sobol' set.
#[inline(always)]
pub(crate) fn scramble([x, y]: [u32; 2], bits: u64) -> Vec2 {
    let to_unit = |v: u32| (v >> 8) as f32 * (1.0 / 16_777_216.0);
    Vec2::new(to_unit(x ^ bits as u32), to_unit(y ^ (bits >> 32) as u32))
}
