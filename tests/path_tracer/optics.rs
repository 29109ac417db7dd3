//! Mirrors, metals and glass.

use glam::{DVec2, DVec3};
use scene::{Material, Specular};

use super::{Random, Vertex, color};

/// Where a path goes on.
pub(super) struct Bounce {
    pub(super) dir: DVec3,
    /// What refraction makes of radiance.
    pub(super) squeeze: f64,
    pub(super) transmitted: bool,
}

/// The normal that tells the angles of specular bounces, and how much is reflected. Sides are told by the geometric
/// normal; where the shading normal would contradict it, the geometric normal serves for both.
fn specular_frame(at: &Vertex<'_>) -> (DVec3, DVec3) {
    let mut n = at.shading_normal;
    if n.dot(at.w_o) <= 0.0 || mirrored(at.w_o, n).dot(at.geometric_normal) <= 0.0 {
        n = at.geometric_normal;
    }
    match at.material.specular {
        Specular::None => (n, DVec3::ZERO),
        Specular::Mirror { reflectance } => (n, color(reflectance)),
        Specular::Metal { eta, k } => {
            let channel = |i: usize| {
                let (eta, k) = (f64::from(eta.to_array()[i]), f64::from(k.to_array()[i]));
                conductor_reflectance(n.dot(at.w_o), eta, k)
            };
            (n, DVec3::new(channel(0), channel(1), channel(2)))
        }
        Specular::Glass { ior, .. } => {
            let eta = relative_index(at, ior);
            if refracted(at.w_o, n, eta).is_some_and(|dir| dir.dot(at.geometric_normal) >= 0.0) {
                n = at.geometric_normal;
            }
            (n, DVec3::splat(dielectric_reflectance(n.dot(at.w_o), eta)))
        }
        Specular::Coat(coat) => {
            let f = dielectric_reflectance(n.dot(at.w_o), f64::from(coat.ior()));
            (n, color(coat.reflectance()) * f)
        }
        Specular::Pane { ior } => {
            // The sum of a geometric series: each pass from face to face and back leaves f^2.
            let f = dielectric_reflectance(n.dot(at.w_o), f64::from(ior));
            (n, DVec3::splat(f + (1.0 - f).powi(2) * f / (1.0 - f * f)))
        }
    }
}

/// What the specular part scatters in all, reflected and transmitted.
pub(super) fn specular_reflectance(at: &Vertex<'_>) -> DVec3 {
    match at.material.specular {
        Specular::Glass { .. } | Specular::Pane { .. } => DVec3::ONE,
        // Rough ones weigh what they choose themselves.
        Specular::Metal { .. } if at.material.is_rough() => DVec3::ONE,
        _ => specular_frame(at).1,
    }
}

pub(super) fn specular_bounce(at: &Vertex<'_>, random: &mut Random) -> Bounce {
    let (n, reflectance) = specular_frame(at);
    if let Specular::Glass { ior, .. } = at.material.specular
        && random.uniform() >= reflectance.x
        && let eta = relative_index(at, ior)
        && let Some(dir) = refracted(at.w_o, n, eta)
    {
        // Radiance is per solid angle, which refraction changes: (eta_i / eta_t)^2 (Veach 1997, section 5.2).
        return Bounce { dir, squeeze: 1.0 / (eta * eta), transmitted: true };
    }
    if let Specular::Pane { .. } = at.material.specular
        && random.uniform() >= reflectance.x
    {
        return Bounce { dir: -at.w_o, squeeze: 1.0, transmitted: true };
    }
    Bounce { dir: mirrored(at.w_o, n), squeeze: 1.0, transmitted: false }
}

/// The index of refraction of the other side relative to this one's.
pub(super) fn relative_index(at: &Vertex<'_>, ior: f32) -> f64 {
    if at.front { f64::from(ior) } else { 1.0 / f64::from(ior) }
}

fn mirrored(w_o: DVec3, n: DVec3) -> DVec3 {
    n * (2.0 * n.dot(w_o)) - w_o
}

/// Snell's law: the tangential part is divided by the relative index, and the rest follows from the length of 1.
pub(super) fn refracted(w_o: DVec3, n: DVec3, eta: f64) -> Option<DVec3> {
    let tangential = (n * n.dot(w_o) - w_o) / eta;
    let cos2 = 1.0 - tangential.length_squared();
    (cos2 > 0.0).then(|| tangential - n * cos2.sqrt())
}

/// Fresnel's formulas by the angles of incidence and refraction: `sin^2(i - t) / sin^2(i + t)` and
/// `tan^2(i - t) / tan^2(i + t)`, averaged.
pub(super) fn dielectric_reflectance(cos: f64, eta: f64) -> f64 {
    let i = cos.clamp(-1.0, 1.0).acos();
    let sin_t = i.sin() / eta;
    if sin_t >= 1.0 {
        return 1.0;
    }
    if i < 1e-6 {
        return ((eta - 1.0) / (eta + 1.0)).powi(2);
    }
    let t = sin_t.asin();
    let s = (i - t).sin() / (i + t).sin();
    let p = (i - t).tan() / (i + t).tan();
    0.5 * (s * s + p * p)
}

/// Fresnel's formulas with a complex index of refraction, `eta + i k`; complex numbers are pairs here.
pub(super) fn conductor_reflectance(cos: f64, eta: f64, k: f64) -> f64 {
    let times = |a: DVec2, b: DVec2| DVec2::new(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
    let index2 = times(DVec2::new(eta, k), DVec2::new(eta, k));
    // The root of n^2 - sin^2, which is n times the cosine of the angle of refraction.
    let square = index2 - DVec2::X * (1.0 - cos * cos);
    let (length, angle) = (square.length().sqrt(), 0.5 * square.y.atan2(square.x));
    let root = DVec2::new(length * angle.cos(), length * angle.sin());
    let share = |a: DVec2, b: DVec2| (a - b).length_squared() / (a + b).length_squared();
    0.5 * (share(DVec2::X * cos, root) + share(index2 * cos, root))
}

/// What a medium leaves of light after a distance; between bodies nothing is lost.
pub(super) fn transmittance(medium: Option<&Material>, distance: f64) -> DVec3 {
    match medium.map(|material| material.specular) {
        Some(Specular::Glass { absorption, .. }) => {
            let left = |a: f64| if a > 0.0 { (-a * distance).exp() } else { 1.0 };
            color(absorption).to_array().map(left).into()
        }
        _ => DVec3::ONE,
    }
}
