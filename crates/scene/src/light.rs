//! Everything that emits light.

use base::{Frame, Rgb, math::PI, warp};
use geometry::{Bounds, Patch};
use glam::{Vec2, Vec3, Vec3A};

use crate::{AreaLight, EnvironmentMap, SphereLight};

/// A light. Each has its own photons and, at a surface point, its own visibility.
#[derive(Clone, Debug)]
pub struct Light {
    /// The name in the scene file, or that of the mesh that emits.
    pub name: String,
    /// What it is.
    pub kind: LightKind,
}

/// The kinds of light. A new kind needs an arm in each function of [`Light`], its digest in `world.rs`, its keys in
/// the scene file, and a row in the tests of light transport.
#[derive(Clone, Debug)]
pub enum LightKind {
    /// Emissive surfaces.
    Area(AreaLight),
    /// An emissive sphere.
    Sphere(SphereLight),
    /// The same intensity in all directions.
    Point {
        /// Where it is.
        position: Vec3A,
        /// Radiant intensity, W/sr.
        intensity: Rgb,
    },
    /// A cone of light.
    Spot(Spot),
    /// Parallel light.
    Directional {
        /// Unit direction in which the light travels.
        direction: Vec3A,
        /// Irradiance on a surface perpendicular to it.
        irradiance: Rgb,
    },
    /// The same radiance from everywhere beyond the scene.
    Environment {
        /// Radiance.
        radiance: Rgb,
    },
    /// A radiance for each direction beyond the scene.
    EnvironmentMap(EnvironmentMap),
}

impl LightKind {
    /// Whether it emits nothing at all.
    pub fn is_black(&self) -> bool {
        match self {
            Self::Area(light) => light.mean_radiance().is_black(),
            Self::Sphere(light) => light.mean_radiance().is_black(),
            Self::Point { intensity, .. } => intensity.is_black(),
            Self::Spot(spot) => spot.intensity.is_black(),
            Self::Directional { irradiance, .. } => irradiance.is_black(),
            Self::Environment { radiance } => radiance.is_black(),
            Self::EnvironmentMap(map) => map.total().is_black(),
        }
    }
}

/// A point that shines into a cone: full intensity up to one angle, none beyond another, smoothstep of the cosine
/// between.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// Where it is.
    pub position: Vec3A,
    /// Unit vector along the axis.
    pub direction: Vec3A,
    /// Radiant intensity along the axis, W/sr.
    pub intensity: Rgb,
    /// Cosine of the angle beyond which it is dark.
    pub cos_outer: f32,
    /// Cosine of the angle up to which it has full intensity; at least `cos_outer`.
    pub cos_inner: f32,
}

impl Spot {
    /// Share of the intensity at an angle to the axis.
    pub fn falloff(&self, cos: f32) -> f32 {
        if cos >= self.cos_inner {
            1.0
        } else if cos <= self.cos_outer {
            0.0
        } else {
            let x = (cos - self.cos_outer) / (self.cos_inner - self.cos_outer);
            x * x * (3.0 - 2.0 * x)
        }
    }

    /// Solid angle of the full cone, and that of the rest weighted by the falloff.
    fn solid_angles(&self) -> (f32, f32) {
        (2.0 * PI * (1.0 - self.cos_inner), PI * (self.cos_inner - self.cos_outer))
    }

    /// A direction with density proportional to the falloff.
    fn emit(&self, u: Vec2) -> Vec3A {
        let (inner, outer) = self.solid_angles();
        let share = inner / (inner + outer);
        let cos = if u.x < share {
            1.0 - (u.x / share) * (1.0 - self.cos_inner)
        } else {
            let x = warp::smoothstep(((u.x - share) / (1.0 - share)).clamp(0.0, 1.0));
            self.cos_outer + x * (self.cos_inner - self.cos_outer)
        };
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (s, c) = base::math::sin_cos(2.0 * PI * u.y);
        Frame::new(self.direction).to_world(Vec3A::new(sin * c, sin * s, cos)).normalize()
    }
}

/// Where a photon starts.
#[derive(Clone, Copy, Debug)]
pub struct Emission {
    /// Origin of its ray.
    pub origin: Vec3A,
    /// Unit direction of its ray.
    pub dir: Vec3A,
    /// The flux of the light as far as this one start tells, in watts: the mean over all starts is [`Light::flux`].
    pub flux: Rgb,
}

/// Where a shadow ray goes.
#[derive(Clone, Copy, Debug)]
pub enum Toward {
    /// To a point just before the surface of the light.
    Point(Vec3A),
    /// Out of the scene, along a unit vector.
    Direction(Vec3A),
}

/// One sample of a light as seen from a surface point.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Where the shadow ray goes.
    pub toward: Toward,
    /// Estimate of the unshadowed irradiance from this one sample, cosine included.
    pub irradiance: Rgb,
}

/// One direction towards a light, as seen from a point in space.
#[derive(Clone, Copy, Debug)]
pub struct Beam {
    /// Unit direction towards the light.
    pub dir: Vec3A,
    /// Where the shadow ray goes.
    pub toward: Toward,
    /// How far it is; infinite if the light is beyond the scene.
    pub distance: f32,
    /// Estimate of the unshadowed irradiance, from this one sample, on a surface that faces the direction.
    pub irradiance: Rgb,
    /// Density of the direction per steradian; infinite if there is no other.
    pub pdf: f32,
}

impl Light {
    /// Emitted flux in watts; for lights beyond the scene, what passes the sphere around it.
    pub fn flux(&self, bounds: &Bounds) -> Rgb {
        let radius = bounds.diagonal() * 0.5;
        match &self.kind {
            LightKind::Area(light) => light.flux(),
            LightKind::Sphere(light) => light.flux(),
            LightKind::Point { intensity, .. } => *intensity * (4.0 * PI),
            LightKind::Spot(spot) => {
                let (inner, outer) = spot.solid_angles();
                spot.intensity * (inner + outer)
            }
            LightKind::Directional { irradiance, .. } => *irradiance * (PI * radius * radius),
            LightKind::Environment { radiance } => *radiance * (4.0 * PI * PI * radius * radius),
            LightKind::EnvironmentMap(map) => map.total() * (PI * radius * radius),
        }
    }

    /// The start of a photon, from four uniform numbers. The density is that of the emitted flux, in the mean over the
    /// channels, so that all photons of a light carry about the same.
    pub fn emit(&self, bounds: &Bounds, u: [f32; 4]) -> Emission {
        // A disc before the sphere around the scene, perpendicular to the direction.
        let from_beyond = |dir: Vec3A, u: Vec2| {
            let radius = bounds.diagonal() * 0.5;
            let disc = warp::uniform_disc(u) * radius;
            let frame = Frame::new(dir);
            Vec3A::from(bounds.center()) + frame.s * disc.x + frame.t * disc.y - dir * radius
        };
        let (first, second) = (Vec2::new(u[0], u[1]), Vec2::new(u[2], u[3]));
        let (origin, dir) = match &self.kind {
            LightKind::Area(light) => {
                let (origin, dir, flux) = light.emit(u);
                return Emission { origin, dir, flux };
            }
            LightKind::Sphere(light) => {
                let (origin, dir, flux) = light.emit(u);
                return Emission { origin, dir, flux };
            }
            LightKind::Point { position, .. } => {
                (*position, warp::uniform_sphere(first).normalize())
            }
            LightKind::Spot(spot) => (spot.position, spot.emit(first)),
            LightKind::Directional { direction, .. } => {
                (from_beyond(*direction, first), *direction)
            }
            LightKind::Environment { .. } => {
                let dir = warp::uniform_sphere(second).normalize();
                (from_beyond(dir, first), dir)
            }
            LightKind::EnvironmentMap(map) => {
                let drawn = map.draw(second);
                let share = drawn.map_or(Rgb::BLACK, |d| d.radiance / (d.pdf * map.total().mean()));
                let dir = drawn.map_or(Vec3A::NEG_Y, |d| -d.dir);
                let flux = share * self.flux(bounds).mean();
                return Emission { origin: from_beyond(dir, first), dir, flux };
            }
        };
        let flux = self.flux(bounds);
        Emission { origin, dir, flux }
    }

    /// Irradiance at a surface point if nothing were in the way, `U_l`; `None` where there is neither a closed form nor a
    /// table.
    pub fn unshadowed_irradiance(&self, point: Vec3A, normal: Vec3A) -> Option<Rgb> {
        match &self.kind {
            LightKind::Area(light) => light.irradiance(point, normal),
            LightKind::Sphere(light) => light.irradiance(point, normal),
            LightKind::Environment { radiance } => Some(*radiance * PI),
            LightKind::EnvironmentMap(map) => Some(map.irradiance(normal)),
            _ => Some(self.sample(point, normal, Vec2::ZERO).map_or(Rgb::BLACK, |s| s.irradiance)),
        }
    }

    /// Whether [`Light::unshadowed_irradiance`] has a closed form or a table.
    pub fn has_closed_form(&self) -> bool {
        match &self.kind {
            LightKind::Area(light) => light.has_closed_form(),
            LightKind::Sphere(light) => light.is_uniform(),
            _ => true,
        }
    }

    /// Whether light from all its places has the same color, so that one number tells how much of it arrives.
    pub fn has_one_color(&self) -> bool {
        match &self.kind {
            LightKind::Area(light) => light.is_uniform(),
            LightKind::Sphere(light) => light.is_uniform(),
            LightKind::EnvironmentMap(_) => false,
            _ => true,
        }
    }

    /// Whether all shadow rays from a point go the same way, so that one tells everything.
    pub fn is_delta(&self) -> bool {
        matches!(
            self.kind,
            LightKind::Point { .. } | LightKind::Spot(_) | LightKind::Directional { .. }
        )
    }

    /// The center and radius, in world units, of a sphere around its surface; nothing if it has none.
    pub fn enclosing_sphere(&self) -> Option<(Vec3A, f32)> {
        match &self.kind {
            LightKind::Area(light) => Some(light.enclosing_sphere()),
            LightKind::Sphere(light) => Some(light.enclosing_sphere()),
            _ => None,
        }
    }

    /// Where shadow rays from a patch of surface end; nothing if that isn't known.
    pub fn patch(&self, from: &Patch, bounds: &Bounds) -> Option<Patch> {
        match &self.kind {
            LightKind::Area(light) => light.patch(),
            LightKind::Point { position, .. } | LightKind::Spot(Spot { position, .. }) => {
                let position = Vec3::from(*position);
                Some(Patch { bounds: Bounds { min: position, max: position }, plane: None })
            }
            LightKind::Directional { direction, .. } => {
                let away = Vec3::from(*direction) * (-2.0 * bounds.diagonal());
                let Bounds { min, max } = from.bounds;
                Some(Patch { bounds: Bounds { min: min + away, max: max + away }, plane: None })
            }
            _ => None,
        }
    }

    /// One direction towards the light, uniform by area if it has one, or by brightness if it is textured, or by solid angle if
    /// it is a sphere; `None` if the light sends nothing that way.
    pub fn sample(&self, point: Vec3A, normal: Vec3A, u: Vec2) -> Option<LightSample> {
        let from_point = |position: Vec3A, intensity: &dyn Fn(Vec3A) -> Rgb| {
            let to_light = position - point;
            let distance2 = to_light.length_squared();
            let cos = to_light.dot(normal);
            (cos > 0.0 && distance2 > 0.0).then(|| {
                let distance = distance2.sqrt();
                let irradiance = intensity(-to_light / distance) * (cos / (distance2 * distance));
                LightSample { toward: Toward::Point(position), irradiance }
            })
        };
        let sample = match &self.kind {
            LightKind::Area(light) => light.sample(point, normal, u),
            LightKind::Sphere(light) => light.sample(point, normal, u),
            LightKind::Point { position, intensity } => from_point(*position, &|_| *intensity),
            LightKind::Spot(spot) => from_point(spot.position, &|dir| {
                spot.intensity * spot.falloff(dir.dot(spot.direction))
            }),
            LightKind::Directional { direction, irradiance } => {
                let cos = -direction.dot(normal);
                (cos > 0.0).then(|| LightSample {
                    toward: Toward::Direction(-*direction),
                    irradiance: *irradiance * cos,
                })
            }
            LightKind::Environment { radiance } => {
                let dir = Frame::new(normal).to_world(warp::cosine_hemisphere(u)).normalize();
                Some(LightSample { toward: Toward::Direction(dir), irradiance: *radiance * PI })
            }
            LightKind::EnvironmentMap(map) => map.sample(normal, u).map(|(dir, irradiance)| {
                LightSample { toward: Toward::Direction(dir), irradiance }
            }),
        };
        sample.filter(|s| !s.irradiance.is_black())
    }

    /// One direction towards the light, for surfaces that scatter by direction; `None` if the light sends nothing that
    /// way. What comes alike from everywhere beyond the scene is better found by following directions: always `None`.
    pub fn beam(&self, point: Vec3A, u: Vec2) -> Option<Beam> {
        let dir = match &self.kind {
            LightKind::Area(light) => return light.beam(point, u),
            LightKind::Sphere(light) => return light.beam(point, u),
            LightKind::Environment { .. } => return None,
            LightKind::EnvironmentMap(map) => {
                return map.draw(u).map(|drawn| Beam {
                    dir: drawn.dir,
                    toward: Toward::Direction(drawn.dir),
                    distance: f32::INFINITY,
                    irradiance: drawn.radiance / drawn.pdf,
                    pdf: drawn.pdf,
                });
            }
            LightKind::Point { position, .. } => *position - point,
            LightKind::Spot(spot) => spot.position - point,
            LightKind::Directional { direction, .. } => -*direction,
        };
        let facing = dir.try_normalize()?;
        let LightSample { toward, irradiance } = self.sample(point, facing, u)?;
        let distance = match toward {
            Toward::Point(_) => dir.length(),
            Toward::Direction(_) => f32::INFINITY,
        };
        Some(Beam { dir: facing, toward, distance, irradiance, pdf: f32::INFINITY })
    }

    /// Density per steradian at which [`Light::beam`] chooses a place of an emitter, given the cosine there and the
    /// distance; 0 for lights that aren't surfaces.
    pub fn beam_pdf(&self, cos: f32, distance: f32) -> f32 {
        match &self.kind {
            LightKind::Area(light) => light.beam_pdf(cos, distance),
            LightKind::Sphere(light) => light.beam_pdf(cos, distance),
            _ => 0.0,
        }
    }

    /// Radiance from beyond the scene in a direction out of it, and the density per steradian at which [`Light::beam`]
    /// chooses that direction.
    pub fn from_beyond(&self, dir: Vec3A) -> (Rgb, f32) {
        match &self.kind {
            LightKind::Environment { radiance } => (*radiance, 0.0),
            LightKind::EnvironmentMap(map) => {
                let radiance = map.radiance(dir);
                (radiance, map.pdf(radiance))
            }
            _ => (Rgb::BLACK, 0.0),
        }
    }
}
