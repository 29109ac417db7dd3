//! Irradiance computed ahead at a part of the photons (Christensen 1999, "Faster Photon Map Global Illumination").
//!
//! Where a gather ray ends, light of all kinds counts: the irradiance of direct, caustic and indirect photons together,
//! Jensen's global map. To estimate it at every end would take most of the time. So it is estimated once at each of some
//! photons, which lie where the light is, and an end takes that of the nearest on its surface.
//!
//! What all ends together receive is what the photons bring: each spreads its flux over the same area (a kernel estimate of
//! fixed width; Silverman 1986, section 4.2). The `k` nearest wouldn't do: from the shade around a bright patch the disc grows until
//! it takes in photons of the patch, which lose nothing by it, and the sum over the shade grows with the logarithm of its extent (Silverman
//! 1986, section 5.2). Nor do places that lie as densely as photons, since around them the mean is one of the brighter ones.

use std::ops::Mul;

use base::{Photon, PhotonClass, Rgb, encode_octahedral};
use geometry::{MaterialId, Surface};
use glam::Vec3A;
use photon_map::{Estimate, Gather, PhotonMaps, PhotonSet, Scratch, StoredPhoton};

use crate::{Shader, Work};

/// Photons in an estimate, in the mean over all photons of a class. A gather averages over hundreds of ends, but neighbors
/// share them.
const K: usize = 256;

/// Photons of a class that are asked how far their neighbors lie.
const ASKED: usize = 256;

/// One in so many photons is a place where irradiance may be known ahead, ...
const EVERY: usize = 16;

/// ... and one of these in each cell of a grid is such a place. Its side is so many radii of the estimates.
const SPACING: f32 = 0.7;

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
    /// How far photons of each class count, by class.
    radii: [f32; PhotonClass::ALL.len()],
    /// Their mean over all light before the others were raised to it: how finely irradiance is known.
    blur: f32,
}

impl<'a> GatherPhotons<'a> {
    /// Those of some maps; nothing if some that are needed weren't stored. No radius will be greater than that of `gather`.
    pub fn of(maps: &'a PhotonMaps, gather: &Gather) -> Option<Self> {
        let PhotonMaps { direct, caustic, indirect, focused, .. } = maps;
        let (direct, focused) = (direct.as_ref()?, focused.as_ref()?);
        let sets = [direct, caustic, indirect, focused];
        let gather = Gather { k: K, ..*gather };
        let radii = sets.map(|set| usual_radius(set, &gather));
        let all = || sets.into_iter().zip(radii).take(3);
        let n: usize = all().map(|(set, _)| set.len()).sum();
        let sum: f64 = all().map(|(set, radius)| set.len() as f64 * f64::from(radius)).sum();
        let blur = if n > 0 { (sum / n as f64) as f32 } else { gather.max_radius };
        // What is finer than the places where irradiance is known would be missed between them, or overrated at them.
        let radii = radii.map(|radius| radius.max(blur));
        Some(Self { direct, caustic, indirect, focused, radii, blur })
    }

    /// The photons that together are all light.
    pub(crate) fn all(&self) -> [(PhotonClass, &'a PhotonSet); 3] {
        [
            (PhotonClass::Direct, self.direct),
            (PhotonClass::Caustic, self.caustic),
            (PhotonClass::Indirect, self.indirect),
        ]
    }

    /// Where irradiance is to be known ahead: evenly over all that is lit, however brightly.
    pub fn places(&self) -> Vec<StoredPhoton> {
        let scale = 1.0 / (SPACING * self.blur).max(f32::MIN_POSITIVE);
        let mut found = Vec::new();
        for (which, (_, set)) in self.all().into_iter().enumerate() {
            for i in (0..set.len()).step_by(EVERY) {
                let StoredPhoton { position, normal, .. } = set.photon(i);
                let relative = position * scale;
                let corner = relative.floor();
                let off = (relative - corner - 0.5).length_squared();
                let cell = corner.to_array().map(|x| x as i32);
                found.push(((cell, side(normal)), off.to_bits(), which, i as u32));
            }
        }
        // Of each cell that in the middle: where light and dark meet, any other would rather be one in the light.
        found.sort_unstable();
        found.dedup_by_key(|place| place.0);
        found.iter().map(|&(_, _, set, i)| self.all()[set].1.photon(i as usize)).collect()
    }
}

/// The distance of the `k`-th neighbor, in the mean over photons; the greatest radius where there are too few.
fn usual_radius(set: &PhotonSet, gather: &Gather) -> f32 {
    let mut scratch = Scratch::default();
    let radius = |i: usize| {
        let StoredPhoton { position, normal, .. } = set.photon(i);
        f64::from(set.irradiance(position, normal, gather, None, &mut scratch).radius)
    };
    let asked = (0..set.len()).step_by(set.len().div_ceil(ASKED).max(1));
    let n = asked.len();
    let sum: f64 = asked.map(radius).sum();
    if n > 0 { (sum / n as f64) as f32 } else { gather.max_radius }
}

/// Which of the six sides of a cube a normal points to.
fn side(normal: Vec3A) -> u8 {
    let axis = normal.abs().max_position() as u8;
    2 * axis + u8::from(normal[usize::from(axis)] < 0.0)
}

/// Irradiance at a place.
#[derive(Clone, Copy, Debug, Default)]
pub struct IrradianceAhead {
    /// Of all light.
    all: Rgb,
    /// Of what comes by mirrors or glass.
    specular: Rgb,
}

impl Shader<'_> {
    /// Irradiance at a place, from photons.
    ///
    /// Those that places were chosen from are left out, and the others count for more: where a place is tells where
    /// chosen ones lie, and nothing of the others.
    pub fn irradiance_ahead(
        &self,
        photons: &GatherPhotons<'_>,
        place: &StoredPhoton,
        work: &mut Work,
    ) -> IrradianceAhead {
        let StoredPhoton { position, normal, .. } = *place;
        let surface = Surface {
            position,
            geometric_normal: normal,
            shading_normal: normal,
            material: MaterialId(0),
            object: 0,
            primitive: 0,
            error: position.abs().max_element() * ROUNDING,
        };
        self.irradiance_of_photons(photons, &surface, |i| i % EVERY != 0, work)
            * (EVERY as f32 / (EVERY - 1) as f32)
    }

    /// Irradiance from those of the photons around a point that count, by their number in their set.
    fn irradiance_of_photons(
        &self,
        photons: &GatherPhotons<'_>,
        surface: &Surface,
        counts: impl Fn(usize) -> bool,
        work: &mut Work,
    ) -> IrradianceAhead {
        let Surface { position, geometric_normal, .. } = *surface;
        let kernel = self.settings.indirect.kernel;
        let mut estimate = |class: PhotonClass, set: &PhotonSet| {
            let radius = photons.radii[class as usize];
            let scale = 1.0 / (radius * radius);
            let of_sheet = |height: f32| {
                let (mut sum, mut found) = (Rgb::BLACK, 0);
                let add = |dist2: f32, i| {
                    if counts(i) {
                        sum += set.flux_of(i) * kernel.weight(dist2 * scale);
                        found += 1;
                    }
                };
                let visited = set.each_within(position, geometric_normal, height, radius, add);
                work.counts.photons_visited += visited as u64;
                let irradiance = if found > 0 { sum * scale } else { Rgb::BLACK };
                Estimate { irradiance, radius, found, visited }
            };
            self.made_up(surface, kernel, of_sheet).irradiance
        };
        let [direct, caustic, indirect] = photons.all().map(|(class, set)| estimate(class, set));
        let focused = estimate(PhotonClass::Focused, photons.focused);
        IrradianceAhead { all: direct + caustic + indirect, specular: caustic + focused }
    }
}

impl Mul<f32> for IrradianceAhead {
    type Output = Self;

    fn mul(self, factor: f32) -> Self {
        Self { all: self.all * factor, specular: self.specular * factor }
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
    /// Luminance of irradiance, in the mean over the lit area.
    mean: f32,
}

impl<'a> IrradiancePoints<'a> {
    /// Puts together what is known at places.
    pub(crate) fn new(
        photons: GatherPhotons<'a>,
        max_radius: f32,
        places: &[StoredPhoton],
        irradiance: &[IrradianceAhead],
    ) -> Self {
        // Places lie evenly.
        let sum: f64 = irradiance.iter().map(|e| f64::from(e.all.luminance())).sum();
        let mean = (sum / irradiance.len().max(1) as f64) as f32;
        let set_of = |value: fn(&IrradianceAhead) -> Rgb| {
            let photon = |(place, value): (&StoredPhoton, Rgb)| Photon {
                position: place.position.into(),
                normal: encode_octahedral(place.normal),
                flux: value,
            };
            let values = irradiance.iter().map(value);
            PhotonSet::build(&places.iter().zip(values).map(photon).collect::<Vec<_>>())
        };
        let (points, specular) = (set_of(|e| e.all), set_of(|e| e.specular));
        Self { photons, points, specular, max_radius, mean }
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
        NEAR * self.photons.blur
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
        let blur = self.photons.blur;
        let scale = 1.0 / (blur * blur);
        let (mut sum, mut weights) = (Rgb::BLACK, 0.0);
        self.points.each_within(position, normal, f32::INFINITY, blur, |dist2, i| {
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
        shader.irradiance_of_photons(&self.photons, surface, |_| true, work)
    }
}
