//! Where shadow rays go: places on a light as seen from one point.
//!
//! Visibility is a ratio of two sums over the same shadow rays. It is too low by a share that grows with the variance of
//! what each ray stands for, and near a light, or one that begins right beside what it lights, that has no bound if
//! places are uniform by area. There they are uniform by solid angle, on each flat part as often as its irradiance
//! demands. Farther off there is little between the two, and area is faster.

use glam::{DVec2, DVec3, Vec2, Vec3A};

use crate::area_light::{AreaLight, Piece};
use crate::light::{Light, LightKind, LightSample, Toward};
use crate::polygon_irradiance;
use crate::spherical_triangle::SphericalTriangle;

/// A light is near within this many of its radii.
const NEAR: f32 = 2.0;

/// Parts of a smaller solid angle, in steradians, are left out: they are seen from their edge, and light nothing.
const LEAST_SOLID_ANGLE: f64 = 1e-7;

/// A light as seen from a surface point.
#[derive(Debug)]
pub struct LightView<'a> {
    light: &'a Light,
    point: Vec3A,
    normal: Vec3A,
    /// The light's parts, if it is near.
    near: Option<NearLight<'a>>,
}

/// What is seen of a light that is near.
///
/// Places are uniform by solid angle on a triangle that is chosen by its irradiance.
#[derive(Debug)]
struct NearLight<'a> {
    light: &'a AreaLight,
    parts: Vec<Part<'a>>,
}

/// A triangle of a light.
#[derive(Debug)]
struct Part<'a> {
    piece: &'a Piece,
    triangle: SphericalTriangle,
    /// Irradiance from this part and all before it, for a radiance of 1.
    cumulative: f32,
    /// Irradiance from this part alone.
    irradiance: f32,
}

impl Light {
    /// The light as seen from a surface point.
    pub fn seen_from(&self, point: Vec3A, normal: Vec3A) -> LightView<'_> {
        let near = match &self.kind {
            LightKind::Area(light) if light.is_near(point, NEAR) => {
                Some(NearLight { light, parts: parts(light, point, normal) })
            }
            _ => None,
        };
        LightView { light: self, point, normal, near }
    }
}

impl LightView<'_> {
    /// One direction towards the light; `None` if the light sends nothing that way.
    #[inline]
    pub fn sample(&self, u: Vec2) -> Option<LightSample> {
        match &self.near {
            None => self.light.sample(self.point, self.normal, u),
            Some(near) => near.sample(self.point, self.normal, u),
        }
    }
}

fn parts<'a>(light: &'a AreaLight, point: Vec3A, normal: Vec3A) -> Vec<Part<'a>> {
    let mut parts = Vec::new();
    let mut cumulative = 0.0;
    for piece in light.pieces_facing(point) {
        for corners in piece.triangles() {
            let [a, b, c] = corners.map(|v| (v.as_dvec3() - point.as_dvec3()).normalize_or_zero());
            let triangle = SphericalTriangle::new(a, b, c);
            let irradiance = polygon_irradiance(point, normal, &corners);
            if irradiance > 0.0 && triangle.area() > LEAST_SOLID_ANGLE {
                cumulative += irradiance;
                parts.push(Part { piece, triangle, cumulative, irradiance });
            }
        }
    }
    parts
}

impl NearLight<'_> {
    fn sample(&self, point: Vec3A, normal: Vec3A, u: Vec2) -> Option<LightSample> {
        let all = self.parts.last()?.cumulative;
        let at = u.x * all;
        let i = self.parts.partition_point(|p| p.cumulative <= at).min(self.parts.len() - 1);
        let part = &self.parts[i];
        let x = 1.0 - (part.cumulative - at) / part.irradiance;
        let u = DVec2::new(f64::from(x).clamp(0.0, 1.0), f64::from(u.y));
        let dir: DVec3 = part.triangle.sample(u);
        let target = part.piece.meet(point, dir)?;
        let cos = dir.dot(normal.as_dvec3());
        let share = f64::from(part.irradiance / all);
        let weight = (cos * part.triangle.area() / share) as f32;
        (weight > 0.0).then(|| LightSample {
            toward: Toward::Point(target),
            irradiance: self.light.mean_radiance() * weight,
        })
    }
}
