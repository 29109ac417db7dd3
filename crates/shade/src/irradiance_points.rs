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

use base::{Frame, Photon, PhotonClass, Ray, Rgb, Rng, Stream, encode_octahedral, math};
use geometry::{MaterialId, Surface};
use glam::{Vec2, Vec3A};
use photon_map::{Estimate, Gather, PhotonMaps, PhotonSet, Scratch, StoredPhoton};

use crate::{Shader, ShadingPoint, Work};

/// Photons in an estimate, in the mean over all photons of a class. A gather averages over hundreds of ends, but neighbors
/// share them.
const K: usize = 256;

/// Photons of a class that are asked how far their neighbors lie.
const ASKED: usize = 256;

/// One in so many photons is a place where irradiance may be known ahead, ...
const EVERY: usize = 8;

/// ... and one of these in each cell of a grid is such a place. Its side is so many radii of the estimates.
const SPACING: f32 = 0.7;

/// Ends nearer than so many radii of the estimates are blurred visibly.
const NEAR: f32 = 2.0;

/// A surface goes on where it rises by less than this to one of nearly the same normal, as for photons: ...
const MAX_SLOPE: f32 = 0.25;

/// ... within this cosine.
const MIN_COS_NORMALS: f32 = 0.9;

/// A surface is looked for within so much of the size of a stored position, at least.
const HEIGHT: f32 = 1e-4;

/// The first of the streams that move photons.
const MOVES: u64 = 1 << 40;

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
    ///
    /// Places are photons moved by as much as an estimate blurs them, so that they lie wherever estimates aren't dark:
    /// beside a bright patch, too.
    pub fn places(&self, seed: u64) -> Vec<GatherPlace> {
        let scale = 1.0 / (SPACING * self.blur).max(f32::MIN_POSITIVE);
        let mut found = Vec::new();
        for (which, (class, set)) in self.all().into_iter().enumerate() {
            for i in (0..set.len()).step_by(EVERY) {
                let StoredPhoton { position, normal, .. } = set.photon(i);
                let mut rng = Rng::new(seed, Stream::Gather, MOVES + (3 * i + which) as u64);
                let moved =
                    position + blurred_by(normal, rng.next_2d()) * self.radii[class as usize];
                let relative = moved * scale;
                let corner = relative.floor();
                let off = (relative - corner - 0.5).length_squared();
                let cell = corner.to_array().map(|x| x as i32);
                let order = ((cell, side(normal)), off.to_bits(), which, i as u32);
                found.push((order, moved.to_array()));
            }
        }
        // Of each cell that in the middle: where light and dark meet, any other would rather be one in the light.
        found.sort_unstable_by_key(|place| place.0);
        found.dedup_by_key(|place| place.0.0);
        let place = |&((_, _, set, i), moved): &((_, u32, usize, u32), [f32; 3])| GatherPlace {
            photon: self.all()[set].1.photon(i as usize),
            moved: moved.into(),
        };
        found.iter().map(place).collect()
    }
}

/// A photon moved to where irradiance is to be known ahead.
#[derive(Clone, Copy, Debug)]
pub struct GatherPlace {
    photon: StoredPhoton,
    /// In the plane of the photon. The surface may not go on there.
    moved: Vec3A,
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

/// A point of the unit disc around a normal, as often as the kernel of Epanechnikov weighs it: others blur about as far.
fn blurred_by(normal: Vec3A, u: Vec2) -> Vec3A {
    let radius = (1.0 - u.x.sqrt()).max(0.0).sqrt();
    let (sin, cos) = math::sin_cos(2.0 * math::PI * u.y);
    Frame::new(normal).to_world(Vec3A::new(cos * radius, sin * radius, 0.0))
}

/// Which of the six sides of a cube a normal points to.
fn side(normal: Vec3A) -> u8 {
    let axis = normal.abs().max_position() as u8;
    2 * axis + u8::from(normal[usize::from(axis)] < 0.0)
}

/// Irradiance at a place.
#[derive(Clone, Copy, Debug, Default)]
pub struct IrradianceAhead {
    position: Vec3A,
    normal: Vec3A,
    irradiance: EndIrradiance,
}

/// Irradiance where gather rays end.
#[derive(Clone, Copy, Debug, Default)]
struct EndIrradiance {
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
        place: &GatherPlace,
        work: &mut Work,
    ) -> IrradianceAhead {
        let surface = self.surface_at(place);
        let is_left = |i: usize| !i.is_multiple_of(EVERY);
        let EndIrradiance { all, specular } =
            self.irradiance_of_photons(photons, &surface, is_left, work);
        let more = EVERY as f32 / (EVERY - 1) as f32;
        IrradianceAhead {
            position: surface.position,
            normal: surface.geometric_normal,
            irradiance: EndIrradiance { all: all * more, specular: specular * more },
        }
    }

    /// Where the surface of a photon goes on at the place to which it was moved; where it doesn't, or can't be seen from
    /// there, at the photon.
    fn surface_at(&self, place: &GatherPlace) -> Surface {
        let GatherPlace { photon: StoredPhoton { position, normal, .. }, moved } = *place;
        let way = moved - position;
        let distance = way.length();
        let height = (MAX_SLOPE * distance).max(position.abs().max_element() * HEIGHT);
        let surface = || {
            let along = Ray::new(position + normal * height, way / distance, distance);
            if distance > 0.0 && self.arrive(&along).is_some() {
                return None;
            }
            let down = Ray::new(moved + normal * height, -normal, 2.0 * height);
            let (ShadingPoint { facing, material, .. }, _) = self.arrive(&down)?;
            let goes_on =
                material.is_diffuse() && facing.geometric_normal.dot(normal) > MIN_COS_NORMALS;
            goes_on.then_some(facing)
        };
        surface().unwrap_or(Surface {
            position,
            geometric_normal: normal,
            shading_normal: normal,
            material: MaterialId(0),
            object: 0,
            primitive: 0,
            error: position.abs().max_element() * ROUNDING,
        })
    }

    /// Irradiance from those of the photons around a point that count, by their number in their set.
    fn irradiance_of_photons(
        &self,
        photons: &GatherPhotons<'_>,
        surface: &Surface,
        counts: impl Fn(usize) -> bool,
        work: &mut Work,
    ) -> EndIrradiance {
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
        EndIrradiance { all: direct + caustic + indirect, specular: caustic + focused }
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
    /// Luminance of irradiance, in the mean over the lit area.
    mean: f32,
}

impl<'a> IrradiancePoints<'a> {
    /// Puts together what is known at places.
    pub(crate) fn new(photons: GatherPhotons<'a>, ahead: &[IrradianceAhead]) -> Self {
        // Places lie evenly.
        let sum: f64 = ahead.iter().map(|e| f64::from(e.irradiance.all.luminance())).sum();
        let mean = (sum / ahead.len().max(1) as f64) as f32;
        let set_of = |value: fn(&EndIrradiance) -> Rgb| {
            let photon = |place: &IrradianceAhead| Photon {
                position: place.position.into(),
                normal: encode_octahedral(place.normal),
                flux: value(&place.irradiance),
            };
            PhotonSet::build(&ahead.iter().map(photon).collect::<Vec<_>>())
        };
        let (points, specular) = (set_of(|e| e.all), set_of(|e| e.specular));
        Self { photons, points, specular, mean }
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

    /// The mean over the points within the radius of an estimate, so that it varies without steps; nothing where there are
    /// none.
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
        (weights > 0.0).then(|| sum / weights)
    }

    /// Irradiance where no point is near: on small things, and where hardly any light falls. The nearest point would rather
    /// be one in the light.
    fn estimate_alone(
        &self,
        shader: &Shader<'_>,
        surface: &Surface,
        work: &mut Work,
    ) -> EndIrradiance {
        shader.irradiance_of_photons(&self.photons, surface, |_| true, work)
    }
}
