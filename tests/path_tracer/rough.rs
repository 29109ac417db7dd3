//! Rough mirrors, metals, glass and coats: microfacets as Walter, Marschner, Li and Torrance have published them in 2007, in terms
//! of angles; those in view are sampled as in Heitz 2018, "Sampling the GGX Distribution of Visible Normals".

use std::f64::consts::PI;

use glam::DVec3;
use scene::Specular;

use super::optics::{conductor_reflectance, dielectric_reflectance, refracted, relative_index};
use super::{Random, Vertex, color};

/// Where a path goes on, and what is left of radiance.
pub(super) struct RoughBounce {
    pub(super) dir: DVec3,
    pub(super) weight: DVec3,
    /// Density per steradian.
    pub(super) pdf: f64,
    /// What refraction makes of radiance.
    pub(super) squeeze: f64,
}

/// A direction chosen by the microfacets, if it leads anywhere.
pub(super) fn bounce(at: &Vertex<'_>, random: &mut Random) -> Option<RoughBounce> {
    let n = normal(at);
    let alpha = f64::from(at.material.roughness).powi(2);
    let tangent = n.any_orthonormal_vector();
    let u = [random.uniform(), random.uniform()];
    let facet = visible_facet([tangent, n.cross(tangent), n], at.w_o, alpha, u);
    let cos = facet.dot(at.w_o);
    if cos <= 0.0 {
        return None;
    }
    let mut reflects = true;
    let dir = match at.material.specular {
        Specular::Glass { ior, .. } => {
            let eta = relative_index(at, ior);
            if random.uniform() < dielectric_reflectance(cos, eta) {
                facet * (2.0 * cos) - at.w_o
            } else {
                reflects = false;
                refracted(at.w_o, facet, eta)?
            }
        }
        _ => facet * (2.0 * cos) - at.w_o,
    };
    // What facets send to the wrong side meets others, and is lost.
    if (dir.dot(n) > 0.0) != reflects {
        return None;
    }
    let (value, pdf, squeeze) = value(at, dir)?;
    Some(RoughBounce { dir, weight: value / pdf, pdf, squeeze })
}

/// The facet under a random point of the surface as it is seen: stretched so that the surface is a hemisphere, its outline
/// is half a disc and half an ellipse.
pub(super) fn visible_facet(axes: [DVec3; 3], w_o: DVec3, alpha: f64, u: [f64; 2]) -> DVec3 {
    let [x, y, z] = axes.map(|axis| axis.dot(w_o));
    let view = DVec3::new(alpha * x, alpha * y, z).normalize();
    let across = DVec3::new(-view.y, view.x, 0.0).normalize_or(DVec3::X);
    let up = view.cross(across);
    let r = u[0].sqrt();
    let (sin, cos) = (2.0 * PI * u[1]).sin_cos();
    let t1 = r * cos;
    let s = 0.5 * (1.0 + view.z);
    let t2 = (1.0 - s) * (1.0 - t1 * t1).sqrt() + s * r * sin;
    let h = across * t1 + up * t2 + view * (1.0 - t1 * t1 - t2 * t2).max(0.0).sqrt();
    let local = DVec3::new(alpha * h.x, alpha * h.y, h.z.max(0.0)).normalize();
    axes[0] * local.x + axes[1] * local.y + axes[2] * local.z
}

/// Scattering times cosine towards `w_o` of light from `dir`, the density of [`bounce`], and apart from the first what
/// refraction makes of radiance.
pub(super) fn value(at: &Vertex<'_>, dir: DVec3) -> Option<(DVec3, f64, f64)> {
    let n = normal(at);
    let alpha = f64::from(at.material.roughness).powi(2);
    let (cos_o, cos_i) = (n.dot(at.w_o), n.dot(dir));
    let reflects = cos_i > 0.0;
    if (dir.dot(at.geometric_normal) > 0.0) != reflects || cos_o <= 0.0 {
        return None;
    }
    let glass = match at.material.specular {
        Specular::Glass { ior, .. } => Some(relative_index(at, ior)),
        _ => None,
    };
    let eta = if reflects { 1.0 } else { glass? };
    let sum = at.w_o + dir * eta;
    let facet = if reflects { sum.normalize() } else { -sum.normalize() * (eta - 1.0).signum() };
    let (facet_o, facet_i) = (facet.dot(at.w_o), facet.dot(dir));
    let cos_facet = facet.dot(n);
    if cos_facet <= 0.0 || facet_o <= 0.0 || (facet_i > 0.0) != reflects {
        return None;
    }
    // Eqs. (33) and (34).
    let d = alpha * alpha / (PI * cos_facet.powi(4) * (alpha * alpha + tan2(cos_facet)).powi(2));
    let g = hidden(alpha, cos_o) * hidden(alpha, cos_i);
    // Eqs. (13), (14) and (17).
    let jacobian = if reflects {
        1.0 / (4.0 * facet_i)
    } else {
        eta * eta * -facet_i / (facet_o + eta * facet_i).powi(2)
    };
    let (reflectance, chance) = match (at.material.specular, glass) {
        (_, Some(eta)) => {
            let f = dielectric_reflectance(facet_o, eta);
            let f = if reflects { f } else { 1.0 - f };
            (DVec3::splat(f), f)
        }
        (Specular::Mirror { reflectance }, _) => (color(reflectance), 1.0),
        (Specular::Metal { eta, k }, _) => {
            let [eta, k] = [eta, k].map(|c| c.to_array().map(f64::from));
            let channel = |i: usize| conductor_reflectance(facet_o, eta[i], k[i]);
            (DVec3::new(channel(0), channel(1), channel(2)), 1.0)
        }
        (Specular::Coat(coat), _) => {
            let f = dielectric_reflectance(facet_o, f64::from(coat.ior()));
            (color(coat.reflectance()) * f, 1.0)
        }
        _ => return None,
    };
    // Eqs. (20) and (21), times the cosine; the first without the jacobian in it.
    let value = reflectance * (facet_o * g * d * jacobian / cos_o);
    let pdf = chance * hidden(alpha, cos_o) * facet_o * d / cos_o * jacobian;
    (pdf > 0.0).then_some((value, pdf, 1.0 / (eta * eta)))
}

/// The part of the facets turned to a direction at a cosine that others leave free.
pub(super) fn hidden(alpha: f64, cos: f64) -> f64 {
    2.0 / (1.0 + (1.0 + alpha * alpha * tan2(cos)).sqrt())
}

fn tan2(cos: f64) -> f64 {
    (1.0 - cos * cos).max(0.0) / (cos * cos)
}

/// The normal that tells angles: that for shading, unless it is turned away.
fn normal(at: &Vertex<'_>) -> DVec3 {
    if at.shading_normal.dot(at.w_o) > 0.0 { at.shading_normal } else { at.geometric_normal }
}
