//! Plastic: a diffuse base under a dielectric coat.
//!
//! Light passes the coat, is scattered by the base, and what the coat throws back inside is scattered again. As in
//! Mitsuba (Weidlich and Wilkie 2007, "Arbitrarily Layered Micro-Facet Surfaces", simplified): the diffuse part is the base's,
//! times the part that passes on the way in, times that which passes on the way out, both by their angles. Each of these
//! is a mean times a *passage*, whose mean over light from all sides is 1: so albedo and irradiance are what they are
//! elsewhere, and passages are factors of what is received and of what is seen.

use base::Rgb;
use glam::{Vec2, Vec3A};

use crate::fresnel_dielectric;
use crate::ggx::{masking, visible_normal};
use crate::material::refract;

/// Entries of the table of what passes a rough coat, at squares of evenly spaced numbers.
const KNOTS: usize = 32;

/// Microfacets that an entry is the mean of, along a side of the unit square.
const FACETS: usize = 24;

/// A dielectric coat over a diffuse base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coat {
    ior: f32,
    reflectance: Rgb,
    is_nonlinear: bool,
    /// The part that passes into a rough coat, by the cosine.
    table: Option<[f32; KNOTS]>,
    /// The part that passes of light from all sides.
    mean: f32,
    /// The part of what the base scatters that the coat throws back.
    inner: f32,
}

impl Coat {
    /// A coat of an index of refraction relative to the outside, whose reflections are multiplied with `reflectance`, and of
    /// a roughness as [`crate::Material::roughness`]; 0 is smooth. If it is nonlinear the color of the base becomes more saturated
    /// each time light is thrown back to it.
    pub fn new(ior: f32, reflectance: Rgb, is_nonlinear: bool, roughness: f32) -> Self {
        let mut coat = Self { ior, reflectance, is_nonlinear, table: None, mean: 1.0, inner: 0.0 };
        let alpha = roughness * roughness;
        if roughness > 0.0 {
            coat.table = Some(std::array::from_fn(|i| passing(cos_of(i), alpha, ior)));
        }
        coat.mean = mean_over_hemisphere(|cos| coat.passing(cos));
        coat.inner = match roughness > 0.0 {
            true => {
                let inside: [f32; KNOTS] =
                    std::array::from_fn(|i| reflected(cos_of(i), alpha, 1.0 / ior));
                mean_over_hemisphere(|cos| look_up(&inside, cos))
            }
            false => mean_over_hemisphere(|cos| fresnel_dielectric(cos, 1.0 / ior)),
        };
        coat
    }

    /// Index of refraction relative to the outside.
    pub fn ior(&self) -> f32 {
        self.ior
    }

    /// What reflections by the coat are multiplied with.
    pub fn reflectance(&self) -> Rgb {
        self.reflectance
    }

    /// Whether the color of the base becomes more saturated by light that is thrown back to it.
    pub fn is_nonlinear(&self) -> bool {
        self.is_nonlinear
    }

    /// The passage of light at a cosine to the normal: the part that passes the coat over its mean.
    #[inline]
    pub fn passage(&self, cos: f32) -> f32 {
        self.passing(cos) / self.mean
    }

    /// Albedo over a base of the given albedo, for light from all sides towards all sides.
    pub fn albedo(&self, base: Rgb) -> Rgb {
        let through = self.mean * self.mean / (self.ior * self.ior);
        base.map(|b| {
            let again = if self.is_nonlinear { b * self.inner } else { self.inner };
            b * through / (1.0 - again)
        })
    }

    /// What the coat reflects of light at a cosine to the normal of its surface or of a microfacet.
    #[inline]
    pub(crate) fn reflected(&self, cos: f32) -> Rgb {
        self.reflectance * fresnel_dielectric(cos.min(1.0), self.ior)
    }

    fn passing(&self, cos: f32) -> f32 {
        match &self.table {
            None => 1.0 - fresnel_dielectric(cos.clamp(0.0, 1.0), self.ior),
            Some(table) => look_up(table, cos),
        }
    }
}

/// The cosine of an entry.
fn cos_of(i: usize) -> f32 {
    let x = i as f32 / (KNOTS - 1) as f32;
    (x * x).max(1e-4)
}

fn look_up(table: &[f32; KNOTS], cos: f32) -> f32 {
    let x = cos.clamp(0.0, 1.0).sqrt() * (KNOTS - 1) as f32;
    let low = (x as usize).min(KNOTS - 2);
    table[low] + (table[low + 1] - table[low]) * (x - low as f32)
}

/// The mean of a function of the cosine for light from all sides.
fn mean_over_hemisphere(f: impl Fn(f32) -> f32) -> f32 {
    const N: u32 = 4096;
    // Uniform in the square of the cosine, which is the share of the light from above it.
    let sum: f64 = (0..N).map(|i| f64::from(f(((i as f32 + 0.5) / N as f32).sqrt()))).sum();
    (sum / f64::from(N)) as f32
}

/// Microfacets that a direction at a cosine sees, as normals, with that direction.
fn facets(cos: f32, alpha: f32) -> (Vec3A, impl Iterator<Item = Vec3A>) {
    let w = Vec3A::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let points = (0..FACETS * FACETS).map(move |i| {
        let at = Vec2::new((i % FACETS) as f32 + 0.5, (i / FACETS) as f32 + 0.5);
        visible_normal(w, alpha, at / FACETS as f32)
    });
    (w, points)
}

/// The part that passes into a rough surface from a direction at a cosine.
fn passing(cos: f32, alpha: f32, eta: f32) -> f32 {
    let (w, normals) = facets(cos, alpha);
    let sum: f32 = normals
        .map(|h| {
            let within = refract(w, h, eta).filter(|dir| dir.z < 0.0);
            let share = |dir| {
                (1.0 - fresnel_dielectric(h.dot(w).clamp(0.0, 1.0), eta)) * masking(dir, alpha)
            };
            within.map_or(0.0, share)
        })
        .sum();
    sum / (FACETS * FACETS) as f32
}

/// The part that a rough surface reflects from a direction at a cosine.
fn reflected(cos: f32, alpha: f32, eta: f32) -> f32 {
    let (w, normals) = facets(cos, alpha);
    let sum: f32 = normals
        .map(|h| {
            let dir = h * (2.0 * h.dot(w)) - w;
            let f = fresnel_dielectric(h.dot(w).clamp(0.0, 1.0), eta);
            if dir.z > 0.0 { f * masking(dir, alpha) } else { 0.0 }
        })
        .sum();
    sum / (FACETS * FACETS) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::math::{PI, sin_cos};

    #[test]
    fn smooth_coats_lose_nothing() {
        // Diffuse Fresnel reflectance of 1.5 is 0.0918 from outside, and 0.5964 from inside.
        let coat = Coat::new(1.5, Rgb::ONE, false, 0.0);
        assert!((coat.mean - (1.0 - 0.0918)).abs() < 3e-4, "{}", coat.mean);
        assert!((coat.inner - 0.5964).abs() < 3e-4, "{}", coat.inner);
        // A white base sends back all that the coat lets in, from every angle.
        for is_nonlinear in [false, true] {
            let coat = Coat::new(1.5, Rgb::ONE, is_nonlinear, 0.0);
            let albedo = coat.albedo(Rgb::ONE).g;
            for cos in [0.05, 0.3, 0.7, 1.0] {
                let total = coat.reflected(cos).g + albedo * coat.passage(cos);
                assert!((total - 1.0).abs() < 2e-3, "{total} at {cos}");
            }
        }
        let gray = Rgb::splat(0.5);
        let [linear, saturated] =
            [false, true].map(|nonlinear| Coat::new(1.5, Rgb::ONE, nonlinear, 0.0).albedo(gray).g);
        assert!(saturated < 0.7 * linear, "{saturated} and {linear}");
    }

    #[test]
    fn rough_coats_come_near_smooth_ones_and_make_no_light() {
        let smooth = Coat::new(1.49, Rgb::ONE, true, 0.0);
        for roughness in [0.02, 0.1, 0.3, 0.6, 1.0] {
            let rough = Coat::new(1.49, Rgb::ONE, true, roughness);
            let mean = mean_over_hemisphere(|cos| rough.passage(cos));
            assert!((mean - 1.0).abs() < 1e-4, "{mean}");
            for cos in [0.02, 0.1, 0.35, 0.8, 1.0] {
                let (a, b) = (rough.passing(cos), smooth.passing(cos));
                let near = roughness > 0.1 || cos < 0.1 || (a - b).abs() < 0.02;
                assert!(near, "{a} {b} at {cos}, {roughness}");
                let alpha = roughness * roughness;
                let total =
                    rough.albedo(Rgb::ONE).g * rough.passage(cos) + reflected(cos, alpha, 1.49);
                assert!(total < 1.01, "{total} at {cos}, {roughness}");
            }
        }
    }

    #[test]
    fn passages_have_a_mean_of_one() {
        for ior in [1.1, 1.5, 2.4] {
            let coat = Coat::new(ior, Rgb::ONE, false, 0.0);
            // By angles this time.
            let n = 20_000;
            let sum: f64 = (0..n)
                .map(|i| {
                    let (sin, cos) = sin_cos(0.5 * PI * (i as f32 + 0.5) / n as f32);
                    f64::from(coat.passage(cos) * 2.0 * sin * cos * 0.5 * PI)
                })
                .sum();
            assert!((sum / f64::from(n) - 1.0).abs() < 1e-3, "{}", sum / f64::from(n));
        }
    }
}
