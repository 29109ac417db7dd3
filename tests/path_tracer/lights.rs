//! Light straight from where it is emitted.

use std::f64::consts::PI;

use base::Ray;

use glam::{DVec3, Vec3A};
use scene::{Light, LightKind, Material, Parts, Scene};

use super::{Random, Vertex, color, optics};

/// An emissive triangle or sphere. What it emits is asked of the scene at the place found.
struct Emitter {
    shape: Shape,
    /// Of the material.
    brightness: f64,
}

enum Shape {
    Triangle { corners: [DVec3; 3], normal: DVec3 },
    Sphere { center: DVec3, radius: f64 },
}

/// All lights. What comes from beyond the scene is found by following directions only.
pub(super) struct Lights<'a> {
    parts: &'a Parts,
    scene: &'a Scene,
    emitters: Vec<Emitter>,
    /// Sums of area times brightest channel, up to and including each emitter.
    cumulative: Vec<f64>,
}

impl<'a> Lights<'a> {
    pub(super) fn new(parts: &'a Parts, scene: &'a Scene) -> Self {
        let (mut emitters, mut cumulative, mut sum) = (Vec::new(), Vec::new(), 0.0);
        for mesh in parts.meshes.iter().map(|(_, mesh)| mesh) {
            for (t, id) in mesh.materials.iter().enumerate() {
                let brightness = brightness(&parts.materials[usize::from(id.0)]);
                if brightness > 0.0 {
                    let corners = mesh.corners(t).map(|p| p.as_dvec3());
                    let double_area = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
                    sum += 0.5 * double_area.length() * brightness;
                    cumulative.push(sum);
                    let shape = Shape::Triangle { corners, normal: double_area.normalize() };
                    emitters.push(Emitter { shape, brightness });
                }
            }
        }
        for sphere in parts.spheres.iter().map(|(_, sphere)| sphere) {
            let brightness = brightness(&parts.materials[usize::from(sphere.material.0)]);
            if brightness > 0.0 {
                let (center, radius) = (sphere.center.as_dvec3(), f64::from(sphere.radius));
                sum += 4.0 * PI * radius * radius * brightness;
                cumulative.push(sum);
                emitters.push(Emitter { shape: Shape::Sphere { center, radius }, brightness });
            }
        }
        Self { parts, scene, emitters, cumulative }
    }

    /// Radiance that arrives from beyond the scene.
    pub(super) fn beyond(&self, dir: Vec3A) -> DVec3 {
        let of_light = |light: &Light| match &light.kind {
            LightKind::Environment { radiance } => color(*radiance),
            LightKind::EnvironmentMap(map) => color(map.radiance(dir)),
            _ => DVec3::ZERO,
        };
        self.parts.lights.iter().map(of_light).sum()
    }

    /// The density per steradian at which [`Lights::irradiance`] would choose a point of an emitter.
    pub(super) fn emitter_pdf(&self, material: &Material, cos: f64, distance: f64) -> f64 {
        self.pdf(brightness(material), cos, distance)
    }

    fn pdf(&self, brightness: f64, cos: f64, distance: f64) -> f64 {
        let sum = self.cumulative.last().expect("what emits is in the list of emitters");
        brightness / sum * distance * distance / cos
    }

    /// Radiance that a surface scatters, one estimate. Of emitters it is the share that following directions leaves over.
    /// `scatter` gives scattering times cosine for a direction, and the density at which it is followed.
    pub(super) fn scattered(
        &self,
        at: &Vertex<'_>,
        medium: Option<&Material>,
        random: &mut Random,
        scatter: impl Fn(DVec3) -> Option<(DVec3, f64)>,
    ) -> DVec3 {
        let mut sum = DVec3::ZERO;
        if let Some(total) = self.cumulative.last() {
            let chosen = random.uniform() * total;
            let index = self.cumulative.partition_point(|&c| c <= chosen);
            let emitter = &self.emitters[index.min(self.emitters.len() - 1)];
            let (u, v) = (random.uniform(), random.uniform());
            let (target, normal) = match emitter.shape {
                Shape::Triangle { corners: [a, b, c], normal } => {
                    let root = u.sqrt();
                    (a * (1.0 - root) + b * (root * (1.0 - v)) + c * (root * v), normal)
                }
                Shape::Sphere { center, radius } => {
                    let (z, (sin, cos)) = (2.0 * u - 1.0, (2.0 * PI * v).sin_cos());
                    let r = (1.0 - z * z).sqrt();
                    let out = DVec3::new(r * cos, r * sin, z);
                    (center + out * radius, out)
                }
            };
            let to_light = target - at.position;
            let (distance, dir) = (to_light.length(), to_light.normalize());
            let cos_light = -dir.dot(normal);
            if cos_light > 0.0
                && let Some((value, followed)) = scatter(dir)
            {
                let pdf = self.pdf(emitter.brightness, cos_light, distance);
                let visibility = self.visibility(at, dir, distance, medium);
                if visibility != DVec3::ZERO {
                    let radiance = self.emitted_at(target, normal);
                    sum += radiance * visibility * value / (pdf + followed);
                }
            }
        }
        for light in &self.parts.lights {
            let (dir, distance, received) = match &light.kind {
                // Found by following directions.
                LightKind::Area(_)
                | LightKind::Sphere(_)
                | LightKind::Environment { .. }
                | LightKind::EnvironmentMap(_) => continue,
                LightKind::Point { position, intensity } => {
                    let to_light = position.as_dvec3() - at.position;
                    (
                        to_light.normalize(),
                        to_light.length(),
                        color(*intensity) / to_light.length_squared(),
                    )
                }
                LightKind::Spot(spot) => {
                    let to_light = spot.position.as_dvec3() - at.position;
                    let cos = -to_light.normalize().dot(spot.direction.as_dvec3());
                    let (outer, inner) = (f64::from(spot.cos_outer), f64::from(spot.cos_inner));
                    let share =
                        if cos >= inner { 1.0 } else { ((cos - outer) / (inner - outer)).max(0.0) };
                    let intensity = color(spot.intensity) * (share * share * (3.0 - 2.0 * share));
                    (to_light.normalize(), to_light.length(), intensity / to_light.length_squared())
                }
                LightKind::Directional { direction, irradiance } => {
                    (-direction.as_dvec3(), f64::INFINITY, color(*irradiance))
                }
            };
            if received != DVec3::ZERO
                && let Some((value, _)) = scatter(dir)
            {
                sum += received * value * self.visibility(at, dir, distance, medium);
            }
        }
        sum
    }

    /// Radiance emitted by the front at a place of an emitter.
    fn emitted_at(&self, target: DVec3, normal: DVec3) -> DVec3 {
        // From close by, against the normal: textures are asked as for any ray.
        let size = f64::from(self.scene.bounds().diagonal()) + target.length();
        let origin = (target + normal * (1e-4 * size)).as_vec3a();
        let ray = Ray::unbounded(origin, -normal.as_vec3a().normalize());
        self.scene.accel.closest_hit(&ray).map_or(DVec3::ZERO, |hit| {
            color(self.scene.emitted(&self.scene.accel.surface(&ray, &hit), -ray.dir()))
        })
    }

    /// What arrives of light from a direction: all or nothing, but for masks and the medium around.
    fn visibility(
        &self,
        at: &Vertex<'_>,
        dir: DVec3,
        distance: f64,
        medium: Option<&Material>,
    ) -> DVec3 {
        let passes = dir.dot(at.geometric_normal) < 0.0;
        let medium = if passes { at.front.then_some(at.material) } else { medium };
        let dir = dir.as_vec3a().normalize();
        // Ends before the light's own surface.
        let end = distance * (1.0 - 1e-5);
        let (mut origin, mut gone, mut passing) = (at.surface.leave(dir), 0.0, 1.0);
        while let ray = Ray::new(origin, dir, (end - gone).max(0.0) as f32)
            && let Some(hit) = self.scene.accel.closest_hit(&ray)
            && passing > 0.0
        {
            let surface = self.scene.accel.surface(&ray, &hit);
            passing *= 1.0 - f64::from(self.scene.opacity(&surface));
            (origin, gone) = (surface.leave(dir), gone + f64::from(hit.t));
        }
        optics::transmittance(medium, distance) * passing
    }
}

/// How often a material is chosen for its light, for an area of 1.
fn brightness(material: &Material) -> f64 {
    color(material.emission).max_element()
}
