//! Irradiance computed ahead at a part of the photons (Christensen 1999, "Faster Photon Map Global Illumination").
//!
//! Where a gather ray ends, light of all kinds counts: the irradiance of direct, caustic and indirect photons together,
//! Jensen's global map. To estimate it at every end would take most of the time. So it is estimated once at each of some
//! photons, which lie where the light is, and an end takes that of the nearest on its surface.

use base::{Photon, PhotonClass, Rgb, encode_octahedral};
use geometry::{MaterialId, Surface};
use glam::Vec3A;
use photon_map::{Gather, PhotonMaps, PhotonSet, StoredPhoton};

use crate::{Shader, Work};

/// Photons in an estimate. A gather averages over hundreds of ends, but neighbors share them.
const K: usize = 256;

/// One in so many photons gets an estimate, so that four lie within the radius of each; ...
const EVERY: usize = 64;

/// ... but one in fewer where there would be less than so many.
const FEWEST: usize = 20_000;

/// Ends nearer than so many radii of the estimates are blurred visibly.
const NEAR: f32 = 2.0;

/// Stored positions are off by so much of their size at most, more or less.
const ROUNDING: f32 = 1e-6;

/// The photons from which light is gathered.
#[derive(Clone, Copy, Debug)]
pub struct GatherPhotons<'a> {
    /// Of class direct.
    pub direct: &'a PhotonSet,
    /// Of class caustic.
    pub caustic: &'a PhotonSet,
    /// Of class indirect.
    pub indirect: &'a PhotonSet,
    /// Of class focused.
    pub focused: &'a PhotonSet,
}

impl<'a> GatherPhotons<'a> {
    /// Those of some maps; nothing if some that are needed weren't stored.
    pub fn of(maps: &'a PhotonMaps) -> Option<Self> {
        let PhotonMaps { direct, caustic, indirect, focused, .. } = maps;
        Some(Self { direct: direct.as_ref()?, caustic, indirect, focused: focused.as_ref()? })
    }

    /// The photons that together are all light.
    pub(crate) fn all(&self) -> [(PhotonClass, &'a PhotonSet); 3] {
        [
            (PhotonClass::Direct, self.direct),
            (PhotonClass::Caustic, self.caustic),
            (PhotonClass::Indirect, self.indirect),
        ]
    }

    /// Where irradiance is to be known ahead.
    pub fn places(&self) -> Vec<GatherPlace> {
        let n_photons: usize = self.all().iter().map(|(_, set)| set.len()).sum();
        let every = (n_photons / FEWEST).clamp(1, EVERY);
        // In the order of the trees, so they are spread as evenly as the photons.
        let of_set = |(class, set): (PhotonClass, &'a PhotonSet)| {
            (0..set.len()).step_by(every).map(move |i| GatherPlace { class, photon: set.photon(i) })
        };
        self.all().into_iter().flat_map(of_set).collect()
    }
}

/// A photon where irradiance is to be known ahead.
#[derive(Clone, Copy, Debug)]
pub struct GatherPlace {
    class: PhotonClass,
    photon: StoredPhoton,
}

/// Irradiance at a place.
#[derive(Clone, Copy, Debug, Default)]
pub struct IrradianceAhead {
    /// Of all light.
    all: Rgb,
    /// Of what comes by mirrors or glass.
    specular: Rgb,
    /// The smallest radius from which any of it comes.
    radius: f32,
}

impl Shader<'_> {
    /// Irradiance at a place, from photons.
    ///
    /// The photon of the place itself is left out: that there is one says that there are more than usual.
    pub fn irradiance_ahead(
        &self,
        photons: &GatherPhotons<'_>,
        place: &GatherPlace,
        work: &mut Work,
    ) -> IrradianceAhead {
        let StoredPhoton { position, normal, flux } = place.photon;
        let surface = Surface {
            position,
            geometric_normal: normal,
            shading_normal: normal,
            material: MaterialId(0),
            object: 0,
            primitive: 0,
            error: position.abs().max_element() * ROUNDING,
        };
        self.irradiance_of_photons(photons, &surface, Some((place.class, flux)), work)
    }

    /// Irradiance from the photons around a point; `but` is one at the very point that doesn't count.
    fn irradiance_of_photons(
        &self,
        photons: &GatherPhotons<'_>,
        surface: &Surface,
        but: Option<(PhotonClass, Rgb)>,
        work: &mut Work,
    ) -> IrradianceAhead {
        let Surface { position, geometric_normal, .. } = *surface;
        let Gather { max_radius, kernel, .. } = self.settings.indirect;
        let gather = Gather { k: K, max_radius, kernel };
        let mut radius = max_radius;
        let mut estimate = |class: PhotonClass, set: &PhotonSet| {
            let last = &mut work.last_ahead[class as usize];
            let guess = last.guess(position);
            let scratch = &mut work.scratch;
            let mut estimate = set.irradiance(position, geometric_normal, &gather, guess, scratch);
            work.counts.photons_visited += estimate.visited as u64;
            last.remember(position, &estimate);
            radius = radius.min(estimate.radius);
            if let Some((_, flux)) = but.filter(|b| b.0 == class)
                && estimate.radius > 0.0
            {
                let own = flux * (kernel.weight(0.0) / (estimate.radius * estimate.radius));
                let rest = |all: f32, own: f32| (all - own).max(0.0);
                let Rgb { r, g, b } = estimate.irradiance;
                estimate.irradiance = Rgb::new(rest(r, own.r), rest(g, own.g), rest(b, own.b));
            }
            self.made_up(estimate, surface, kernel).irradiance
        };
        let [direct, caustic, indirect] = photons.all().map(|(class, set)| estimate(class, set));
        let focused = estimate(PhotonClass::Focused, photons.focused);
        IrradianceAhead { all: direct + caustic + indirect, specular: caustic + focused, radius }
    }
}

/// Irradiance of all light at points of diffuse surfaces.
#[derive(Debug)]
pub(crate) struct IrradiancePoints<'a> {
    photons: GatherPhotons<'a>,
    /// Irradiance in place of flux.
    points: PhotonSet,
    /// At the same points, in the same order, of what comes by mirrors or glass alone.
    specular: PhotonSet,
    /// How far a point may be away.
    max_radius: f32,
    /// The radius of the estimates, in the mean.
    blur: f32,
    /// Luminance of irradiance, in the mean over the lit area.
    mean: f32,
}

impl<'a> IrradiancePoints<'a> {
    /// Puts together what is known at places.
    pub(crate) fn new(
        photons: GatherPhotons<'a>,
        max_radius: f32,
        places: &[GatherPlace],
        irradiance: &[IrradianceAhead],
    ) -> Self {
        let n = irradiance.len().max(1) as f64;
        let blur = (irradiance.iter().map(|e| f64::from(e.radius)).sum::<f64>() / n) as f32;
        // Photons lie as densely as they light: each stands for an area in inverse proportion.
        let luminances = irradiance.iter().map(|e| f64::from(e.all.luminance()));
        let areas: f64 = luminances.filter(|l| *l > 0.0).map(f64::recip).sum();
        let mean = (n / areas.max(f64::MIN_POSITIVE)) as f32;
        let set_of = |value: fn(&IrradianceAhead) -> Rgb| {
            let photon = |(place, value): (&GatherPlace, Rgb)| Photon {
                position: place.photon.position.into(),
                normal: encode_octahedral(place.photon.normal),
                flux: value,
            };
            let values = irradiance.iter().map(value);
            PhotonSet::build(&places.iter().zip(values).map(photon).collect::<Vec<_>>())
        };
        let (points, specular) = (set_of(|e| e.all), set_of(|e| e.specular));
        Self { photons, points, specular, max_radius, blur, mean }
    }

    /// The photons from which light is gathered.
    pub(crate) fn photons(&self) -> &GatherPhotons<'a> {
        &self.photons
    }

    /// Luminance of irradiance, in the mean over the lit area.
    pub(crate) fn mean(&self) -> f32 {
        self.mean
    }

    /// Where a ray ends nearer than this, the blur of the estimates there would show, as in corners.
    pub(crate) fn near(&self) -> f32 {
        NEAR * self.blur
    }

    /// Irradiance of all light at a surface, on the side of its normals.
    #[inline]
    pub(crate) fn irradiance(
        &self,
        shader: &Shader<'_>,
        surface: &Surface,
        work: &mut Work,
    ) -> Rgb {
        let known = self.mean_around(&self.points, surface.position, surface.geometric_normal);
        known.unwrap_or_else(|| self.estimate_alone(shader, surface, work).all)
    }

    /// The same of what comes by mirrors and glass.
    pub(crate) fn specular_irradiance(
        &self,
        shader: &Shader<'_>,
        surface: &Surface,
        work: &mut Work,
    ) -> Rgb {
        let known = self.mean_around(&self.specular, surface.position, surface.geometric_normal);
        known.unwrap_or_else(|| self.estimate_alone(shader, surface, work).specular)
    }

    /// Irradiance of all light at a place, as far as points tell.
    pub(crate) fn known(&self, position: Vec3A, normal: Vec3A) -> Option<Rgb> {
        self.mean_around(&self.points, position, normal)
    }

    /// The mean over the points within the radius of an estimate, so that it varies without steps; where there are none,
    /// the nearest.
    #[inline(always)]
    fn mean_around(&self, values: &PhotonSet, position: Vec3A, normal: Vec3A) -> Option<Rgb> {
        let scale = 1.0 / (self.blur * self.blur);
        let (mut sum, mut weights) = (Rgb::BLACK, 0.0);
        self.points.each_within(position, normal, self.blur, |dist2, i| {
            let weight = 1.0 - dist2 * scale;
            sum += values.flux_of(i) * weight;
            weights += weight;
        });
        if weights > 0.0 {
            return Some(sum / weights);
        }
        self.points.nearest_one(position, normal, self.max_radius).map(|i| values.flux_of(i))
    }

    /// Irradiance on a surface so small that no point lies on it.
    fn estimate_alone(
        &self,
        shader: &Shader<'_>,
        surface: &Surface,
        work: &mut Work,
    ) -> IrradianceAhead {
        shader.irradiance_of_photons(&self.photons, surface, None, work)
    }
}
