//! Plastic, as the plugins `plastic` and `roughplastic` of Mitsuba have it: what passes a coat is what it doesn't reflect.

use glam::DVec3;
use scene::{Coat, Material, Parts, Specular};

use super::optics::{dielectric_reflectance, refracted};
use super::rough::{hidden, visible_facet};

/// Entries of a table by the cosine.
const N: usize = 256;
/// Facets that an entry is the mean of, along a side.
const FACETS: usize = 24;

/// What passes the coats of a scene, by material.
pub(super) struct Coats(Vec<Option<Passing>>);

/// What passes one coat.
struct Passing {
    coat: Coat,
    /// The part that passes from outside, by the root of the cosine.
    outside: Vec<f64>,
    mean: f64,
    /// The part of light from the base that is thrown back.
    inner: f64,
}

impl Coats {
    pub(super) fn new(parts: &Parts) -> Self {
        let of = |material: &Material| match material.specular {
            Specular::Coat(coat) => Some(Passing::new(coat, material)),
            _ => None,
        };
        Self(parts.materials.iter().map(of).collect())
    }

    /// Of light that falls on a material, by the cosine, the part that gets to its diffuse base; that in the mean of light
    /// from all sides; and what becomes of the albedo of the base if all light passes both ways.
    pub(super) fn of(&self, material: usize, cos: f64, base: DVec3) -> (f64, f64, DVec3) {
        match &self.0[material] {
            None => (1.0, 1.0, base),
            Some(passing) => {
                let again = if passing.coat.is_nonlinear() { base } else { DVec3::ONE };
                let eta = f64::from(passing.coat.ior());
                let albedo = base / (DVec3::ONE - again * passing.inner) / (eta * eta);
                (look_up(&passing.outside, cos), passing.mean, albedo)
            }
        }
    }
}

impl Passing {
    fn new(coat: Coat, material: &Material) -> Self {
        let eta = f64::from(coat.ior());
        let alpha = material.is_rough().then(|| f64::from(material.roughness).powi(2));
        let outside: Vec<f64> = table(|cos| match alpha {
            None => 1.0 - dielectric_reflectance(cos, eta),
            Some(alpha) => of_facets(cos, alpha, |w, h| {
                let dir = refracted(w, h, eta).filter(|dir| dir.z < 0.0)?;
                let passes = 1.0 - dielectric_reflectance(w.dot(h), eta);
                Some(passes * hidden(alpha, dir.z.abs()))
            }),
        });
        let inside: Vec<f64> = table(|cos| match alpha {
            None => dielectric_reflectance(cos, 1.0 / eta),
            Some(alpha) => of_facets(cos, alpha, |w, h| {
                let dir = h * (2.0 * h.dot(w)) - w;
                let back = dielectric_reflectance(w.dot(h), 1.0 / eta);
                (dir.z > 0.0).then(|| back * hidden(alpha, dir.z))
            }),
        });
        Self { coat, mean: hemisphere(&outside), inner: hemisphere(&inside), outside }
    }
}

/// Values at cosines whose roots are evenly spaced.
fn table(value: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..N).map(|i| value(((i as f64 + 0.5) / N as f64).powi(2))).collect()
}

fn look_up(table: &[f64], cos: f64) -> f64 {
    let x = cos.clamp(0.0, 1.0).sqrt() * table.len() as f64 - 0.5;
    let low = x.floor().clamp(0.0, (table.len() - 2) as f64);
    let f = (x - low).clamp(0.0, 1.0);
    table[low as usize] * (1.0 - f) + table[low as usize + 1] * f
}

/// The mean over light from all sides: the weight of a cosine `c` is `2 c dc`, and `c = x^2`.
fn hemisphere(table: &[f64]) -> f64 {
    let n = table.len() as f64;
    let weighted = |(i, value): (usize, &f64)| value * 4.0 * ((i as f64 + 0.5) / n).powi(3) / n;
    table.iter().enumerate().map(weighted).sum()
}

/// The mean over the facets that a direction sees; of none where they send light into others.
fn of_facets(cos: f64, alpha: f64, value: impl Fn(DVec3, DVec3) -> Option<f64>) -> f64 {
    let w = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let sum: f64 = (0..FACETS * FACETS)
        .map(|i| {
            let u = [(i % FACETS) as f64 + 0.5, (i / FACETS) as f64 + 0.5];
            let h = visible_facet(DVec3::AXES, w, alpha, u.map(|u| u / FACETS as f64));
            value(w, h).unwrap_or(0.0)
        })
        .sum();
    sum / (FACETS * FACETS) as f64
}
