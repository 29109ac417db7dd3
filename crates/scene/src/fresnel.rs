//! Fresnel reflectance of smooth interfaces, unpolarized.

use base::Rgb;

/// Reflectance of a dielectric. `cos_i` > 0 is the cosine on the side the light comes from, `eta` the index of
/// refraction of the other side relative to it. 1 under total internal reflection.
#[inline]
pub fn fresnel_dielectric(cos_i: f32, eta: f32) -> f32 {
    let sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    if sin2_t >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// Reflectance of a conductor with complex index of refraction `eta + i k`, per channel (Born and Wolf, section 14.2).
#[inline]
pub fn fresnel_conductor(cos_i: f32, eta: Rgb, k: Rgb) -> Rgb {
    let channel = |eta: f32, k: f32| {
        let cos2 = cos_i * cos_i;
        let sin2 = 1.0 - cos2;
        let (eta2, k2) = (eta * eta, k * k);
        let t0 = eta2 - k2 - sin2;
        let a2_plus_b2 = (t0 * t0 + 4.0 * eta2 * k2).sqrt();
        let t1 = a2_plus_b2 + cos2;
        let a = (0.5 * (a2_plus_b2 + t0)).max(0.0).sqrt();
        let t2 = 2.0 * cos_i * a;
        let perpendicular = (t1 - t2) / (t1 + t2);
        let t3 = cos2 * a2_plus_b2 + sin2 * sin2;
        let t4 = t2 * sin2;
        let parallel = perpendicular * (t3 - t4) / (t3 + t4);
        0.5 * (parallel + perpendicular)
    };
    Rgb::new(channel(eta.r, k.r), channel(eta.g, k.g), channel(eta.b, k.b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        // Normal incidence: ((n - 1) / (n + 1))^2 = 0.04 for glass of 1.5.
        assert!((fresnel_dielectric(1.0, 1.5) - 0.04).abs() < 1e-6);
        assert!((fresnel_dielectric(1.0, 1.0 / 1.5) - 0.04).abs() < 1e-6);
        assert_eq!(fresnel_dielectric(0.0, 1.5), 1.0);
        // Beyond the critical angle, 41.8 degrees, everything is reflected.
        assert_eq!(fresnel_dielectric(0.7, 1.0 / 1.5), 1.0);
        // Brewster's angle: half of the perpendicular part remains, (cos 2 theta_B)^2 / 2.
        let cos_b = 1.0 / (1.0_f32 + 1.5 * 1.5).sqrt();
        let expected = 0.5 * (2.0 * cos_b * cos_b - 1.0).powi(2);
        assert!((fresnel_dielectric(cos_b, 1.5) - expected).abs() < 1e-6);
        // A conductor without absorption is a dielectric; ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2) at normal incidence.
        for cos in [0.05, 0.3, 0.9] {
            let c = fresnel_conductor(cos, Rgb::splat(1.5), Rgb::BLACK).g;
            assert!((c - fresnel_dielectric(cos, 1.5)).abs() < 1e-5, "{cos}: {c}");
        }
        let gold = fresnel_conductor(1.0, Rgb::splat(0.2), Rgb::splat(3.0)).r;
        assert!((gold - (0.64 + 9.0) / (1.44 + 9.0)).abs() < 1e-5);
    }
}
