//! Where much light falls on little area, as in a caustic or where the sun comes through a window, gather rays find it by
//! luck. There photons themselves become lights (Keller 1997, "Instant Radiosity"): a few stand for all that such spots
//! reflect, and gather rays count the rest.

use base::math::FRAC_1_PI;
use base::{PhotonClass, Ray, Rgb, Rng, Stream};
use geometry::{MaterialId, Surface};
use glam::Vec3A;
use photon_map::{PhotonSet, StoredPhoton};
use scene::Toward;

use crate::irradiance_points::IrradiancePoints;
use crate::{Shader, Work};

/// A spot is where irradiance is so many times the mean over all lit area.
const CONTRAST: f32 = 4.0;

/// One in so many photons is asked whether it lies in a spot.
const EVERY: usize = 4;

/// A photon's light has no bound as a point comes near. Up to so many times the distance between two of them spots are
/// left to gather rays, from twice as far on to photons.
const NEAR: f32 = 4.0;

/// Places of strong light.
#[derive(Debug)]
pub(crate) struct Spots {
    /// Every part of them in this order is spread evenly, too.
    photons: Vec<Spot>,
    /// Luminance of irradiance that makes a spot.
    least: f32,
    /// Where photons begin to count, in world units.
    near: f32,
}

#[derive(Debug)]
struct Spot {
    position: Vec3A,
    normal: Vec3A,
    /// What the surface reflects of the photons it stands for, in watts over pi.
    intensity: Rgb,
    material: MaterialId,
}

impl Spots {
    /// At most so many photons for all spots of a scene.
    pub(crate) fn new<'p>(shader: &Shader<'_>, points: &IrradiancePoints<'p>, n: usize) -> Self {
        let least = CONTRAST * points.mean();
        let mut found = Vec::new();
        let (mut sum, mut area) = (0.0, 0.0);
        let sets = points.photons().all();
        let some = |(_, set): (PhotonClass, &'p PhotonSet)| {
            (0..set.len()).step_by(EVERY).map(move |i| set.photon(i))
        };
        let photons = sets.into_iter().flat_map(some);
        for photon in photons {
            let irradiance =
                points.known(photon.position, photon.normal).map_or(0.0, Rgb::luminance);
            if irradiance > least {
                sum += photon.flux.mean() * EVERY as f32;
                area += photon.flux.luminance() * EVERY as f32 / irradiance;
                found.push((sum, photon));
            }
        }
        let start = Rng::new(shader.settings.seed, Stream::Gather, u64::MAX).next_f32();
        let chosen = (0..n as u32).filter_map(|i| {
            // Bits in reverse (van der Corput) leave no gap in any part of the sequence.
            let place = (start + (i.reverse_bits() >> 8) as f32 * (1.0 / 16_777_216.0)).fract();
            let at = found.partition_point(|f| f.0 <= place * sum);
            let (_, photon) = found.get(at)?;
            let share = sum / (n as f32 * photon.flux.mean());
            spot(shader, photon, photon.flux * share)
        });
        let photons: Vec<Spot> = chosen.collect();
        let spacing = (area / n.max(1) as f32).sqrt();
        Self { photons, least, near: (NEAR * spacing).max(points.near()) }
    }

    /// How many photons there are.
    pub(crate) fn len(&self) -> usize {
        self.photons.len()
    }

    /// The part of light from a surface of this irradiance, at this distance, that is left to gather rays.
    pub(crate) fn rest(&self, irradiance: Rgb, distance: f32) -> f32 {
        match irradiance.luminance() > self.least && !self.photons.is_empty() {
            true => 1.0 - self.part(distance),
            false => 1.0,
        }
    }

    /// The part of light from spots at a distance that is counted by their photons.
    fn part(&self, distance: f32) -> f32 {
        let x = (distance / self.near - 1.0).clamp(0.0, 1.0);
        x * x * (3.0 - 2.0 * x)
    }

    /// Irradiance by the photons of spots, from so many of them.
    pub(crate) fn irradiance(
        &self,
        shader: &Shader<'_>,
        surface: &Surface,
        range: std::ops::Range<usize>,
        work: &mut Work,
    ) -> Rgb {
        let scale = self.len() as f32 / range.len().max(1) as f32;
        let mut sum = Rgb::BLACK;
        for spot in &self.photons[range] {
            let to = spot.position - surface.position;
            let distance2 = to.length_squared();
            let distance = distance2.sqrt();
            let cosines = to.dot(surface.shading_normal).max(0.0) * -to.dot(spot.normal).min(0.0);
            let part = self.part(distance);
            if cosines * part <= 0.0 {
                continue;
            }
            let passing = shader.passing(surface, Toward::Point(spot.position), work);
            if passing > 0.0 {
                let dir = to / distance;
                let material = &shader.scene.materials[usize::from(spot.material.0)];
                let coats = shader.passage(surface, dir) * material.passage(-dir.dot(spot.normal));
                let factor = passing * coats * part * cosines / (distance2 * distance2);
                sum += spot.intensity * factor;
            }
        }
        sum * scale
    }
}

/// What a photon with this flux makes of the surface it lies on; nothing if the surface isn't found.
fn spot(shader: &Shader<'_>, photon: &StoredPhoton, flux: Rgb) -> Option<Spot> {
    // Its place is rounded: the surface is close by.
    let height = photon.position.abs().max_element() * 1e-4;
    let dir = -photon.normal;
    let ray = Ray::new(photon.position - dir * height, dir, 2.0 * height);
    let (point, _) = shader.arrive(&ray)?;
    let Surface { position, geometric_normal: normal, material, .. } = point.facing;
    let intensity = flux * shader.scene.albedo(&point.surface) * FRAC_1_PI;
    Some(Spot { position, normal, intensity, material })
}
