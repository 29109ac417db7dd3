//! Emissive spheres.

use std::f64::consts::{FRAC_1_PI, PI};
use std::sync::Arc;

use base::{Frame, Rgb, warp};
use geometry::{Sphere, sphere_uv};
use glam::{Quat, Vec2, Vec3A};

use crate::Texture;
use crate::bright_cells::BrightCells;
use crate::light::{Beam, LightSample, Toward};

/// A sphere that emits outward, diffusely. A surface point sees it as a cone; places are drawn from that part alone,
/// uniform by solid angle.
#[derive(Clone, Debug)]
pub struct SphereLight {
    center: Vec3A,
    radius: f32,
    /// Emitted radiance, or what that of the texture is multiplied with.
    radiance: Rgb,
    paint: Option<Paint>,
    /// Mean radiance over the surface.
    mean: Rgb,
    /// See [`geometry::Surface::error`].
    error: f32,
}

/// What makes radiance differ from place to place.
#[derive(Clone, Debug)]
struct Paint {
    texture: Arc<Texture>,
    rotation: Quat,
    /// Of the sphere as one piece: see [`SphereLight::out`].
    cells: BrightCells,
}

/// A sphere as seen from a point outside.
struct Cone {
    /// The frame around the direction to the center.
    frame: Frame,
    /// Distance to the center over the radius.
    distance: f64,
    /// Square of the sine of half the cone's angle.
    sin2_max: f64,
    /// Solid angle.
    solid_angle: f32,
}

impl SphereLight {
    pub(crate) fn enclosing_sphere(&self) -> (Vec3A, f32) {
        (self.center, self.radius)
    }

    /// The light of a sphere that emits `radiance`, times the texture if there is one.
    pub fn new(sphere: &Sphere, radiance: Rgb, texture: Option<Arc<Texture>>) -> Self {
        let (center, radius) = (Vec3A::from(sphere.center), sphere.radius);
        let error = (center.abs().element_sum() + radius) * (8.0 * f32::EPSILON);
        let mut light = Self { center, radius, radiance, paint: None, mean: radiance, error };
        if let Some(texture) = texture {
            let rotation = sphere.rotation;
            let of = |at: Vec2| texture.at(sphere_uv(rotation, warp::uniform_sphere(at).into()));
            let cells = BrightCells::new(&[1.0], |_, at| (radiance * of(at)).mean());
            light.mean = radiance * cells.mean(&[1.0], |_, at| of(at));
            light.paint = Some(Paint { texture, rotation, cells });
        }
        light
    }

    /// Mean emitted radiance over the surface; of a texture, by lookups at some places.
    pub fn mean_radiance(&self) -> Rgb {
        self.mean
    }

    /// Emitted flux: pi A L.
    pub fn flux(&self) -> Rgb {
        self.mean * (4.0 * PI * PI * f64::from(self.radius).powi(2)) as f32
    }

    /// Whether all places emit the same.
    pub(crate) fn is_uniform(&self) -> bool {
        self.paint.is_none()
    }

    /// Radiance emitted outward in a unit direction from the center.
    fn radiance(&self, out: Vec3A) -> Rgb {
        match &self.paint {
            None => self.radiance,
            Some(Paint { texture, rotation, .. }) => {
                self.radiance * texture.at(sphere_uv(*rotation, out.into()))
            }
        }
    }

    /// A photon's origin and direction, and the flux of the whole light as far as this one start tells.
    pub(crate) fn emit(&self, u: [f32; 4]) -> (Vec3A, Vec3A, Rgb) {
        let at = Vec2::new(u[0], u[1]);
        let (at, weight) = match &self.paint {
            None => (at, 1.0),
            Some(paint) => {
                let place = paint.cells.draw(at);
                (place.at, place.weight)
            }
        };
        let out = warp::uniform_sphere(at).normalize();
        let dir = Frame::new(out).to_world(warp::cosine_hemisphere(Vec2::new(u[2], u[3])));
        let area = (4.0 * PI * PI * f64::from(self.radius).powi(2)) as f32;
        let flux = if self.paint.is_none() { self.flux() } else { self.radiance(out) * area };
        (self.place(out), dir.normalize(), flux * weight)
    }

    /// The point of the surface in a direction from the center, moved off it by what rounding may be wrong.
    fn place(&self, out: Vec3A) -> Vec3A {
        self.center + out * (self.radius + self.error)
    }

    /// What a point outside sees.
    fn cone(&self, point: Vec3A) -> Option<Cone> {
        let to_center = self.center.as_dvec3() - point.as_dvec3();
        let distance = to_center.length();
        // Nothing is emitted inward, and on the surface rounding decides.
        if distance <= f64::from(self.radius + 2.0 * self.error) {
            return None;
        }
        let frame = Frame::new((to_center / distance).as_vec3a().normalize());
        let distance = distance / f64::from(self.radius);
        let sin2_max = 1.0 / (distance * distance);
        Some(Cone { frame, distance, sin2_max, solid_angle: solid_angle(sin2_max) })
    }

    /// One place within the cone: the direction to it, and that from the center to it.
    fn draw(&self, cone: &Cone, u: Vec2) -> (Vec3A, Vec3A) {
        let height = f64::from(u.x) * cone.sin2_max / (1.0 + (1.0 - cone.sin2_max).sqrt());
        // Sine and cosine at the point, then at the center.
        let (cos, sin2) = (1.0 - height, height * (2.0 - height));
        let (d, sin) = (cone.distance, sin2.sqrt());
        let across = (d * sin).min(1.0);
        let along = (1.0 - across * across).sqrt();
        // The angle at the center is that at the sphere less that at the point.
        let (sin_center, cos_center) = (across * cos - along * sin, along * cos + across * sin);
        let (sin_turn, cos_turn) = base::math::sin_cos(base::math::PI * 2.0 * u.y);
        let turned = |sin: f64, z: f64| {
            let local = Vec3A::new(sin as f32 * cos_turn, sin as f32 * sin_turn, z as f32);
            cone.frame.to_world(local).normalize()
        };
        (turned(sin, cos), turned(sin_center, -cos_center))
    }

    /// One place, uniform by solid angle, for a surface with this normal.
    pub(crate) fn sample(&self, point: Vec3A, normal: Vec3A, u: Vec2) -> Option<LightSample> {
        let cone = self.cone(point)?;
        let (dir, out) = self.draw(&cone, u);
        let cos = dir.dot(normal);
        (cos > 0.0).then(|| LightSample {
            toward: Toward::Point(self.place(out)),
            irradiance: self.radiance(out) * (cos * cone.solid_angle),
        })
    }

    /// One place, uniform by solid angle, for surfaces that scatter by direction.
    pub(crate) fn beam(&self, point: Vec3A, u: Vec2) -> Option<Beam> {
        let cone = self.cone(point)?;
        let (dir, out) = self.draw(&cone, u);
        let target = self.place(out);
        Some(Beam {
            dir,
            toward: Toward::Point(target),
            distance: (target - point).length(),
            irradiance: self.radiance(out) * cone.solid_angle,
            pdf: 1.0 / cone.solid_angle,
        })
    }

    /// Density of [`SphereLight::beam`] per steradian, given the cosine at the sphere and the distance to it.
    pub(crate) fn beam_pdf(&self, cos: f32, distance: f32) -> f32 {
        let (cos, distance, r) = (f64::from(cos), f64::from(distance), f64::from(self.radius));
        let to_center2 = distance * distance + r * r + 2.0 * distance * r * cos;
        1.0 / solid_angle((r * r / to_center2).min(1.0))
    }

    /// Unshadowed irradiance: that of the part of the sphere above the horizon, if all emits the same (Snyder 1996, "Area
    /// Light Sources for Real-Time Graphics").
    pub(crate) fn irradiance(&self, point: Vec3A, normal: Vec3A) -> Option<Rgb> {
        if !self.is_uniform() {
            return None;
        }
        let Some(cone) = self.cone(point) else { return Some(Rgb::BLACK) };
        let to_center = self.center.as_dvec3() - point.as_dvec3();
        let cos = (to_center.dot(normal.as_dvec3()) / to_center.length()).clamp(-1.0, 1.0);
        let (h, h2) = (cone.distance, cone.distance * cone.distance);
        let share = if cos * h >= 1.0 {
            cos / h2
        } else if cos * h <= -1.0 {
            0.0
        } else {
            let (sin, root) = ((1.0 - cos * cos).sqrt(), (h2 - 1.0).sqrt());
            let beyond = libm::acos((-root * cos / sin).clamp(-1.0, 1.0));
            let across = (1.0 - h2 * cos * cos).max(0.0).sqrt();
            let seen = cos * beyond - root * across;
            FRAC_1_PI * (seen / h2 + libm::atan(across / root))
        };
        Some(self.radiance * (share.max(0.0) * PI) as f32)
    }
}

/// Solid angle of a cone by the square of the sine of half its angle.
fn solid_angle(sin2_max: f64) -> f32 {
    (2.0 * PI * sin2_max / (1.0 + (1.0 - sin2_max).sqrt())) as f32
}
