//! What surfaces are made of: a diffuse part and a specular part, Eq. (6), and emission.

use base::{Rgb, math};
use geometry::{MAX_SHADING_GAIN, Surface};
use glam::Vec3A;

use crate::{Coat, TextureId, fresnel_conductor, fresnel_dielectric};

/// A material. Diffuse and specular parts add up; the reader of scenes sees to it that they don't create energy.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The name in the scene file.
    pub name: String,
    /// Diffuse albedo, `pi f_d` of Eq. (6), in [0, 1], or what its texture is multiplied with; the same on both sides. See
    /// [`crate::Scene::albedo`] for that of a point. Under a coat it is that of the base alone.
    pub albedo: Rgb,
    /// What the diffuse albedo is multiplied with from place to place; its surfaces have texture coordinates.
    pub albedo_texture: Option<TextureId>,
    /// The specular part.
    pub specular: Specular,
    /// How rough the specular part is, from 0 to 1; the width `alpha` of its microfacets' distribution is the square
    /// (Burley 2012). Below [`crate::LEAST_ROUGHNESS`] it is perfectly sharp.
    pub roughness: f32,
    /// Radiance emitted by the front side, `L_e` of Eq. (4), or what its texture is multiplied with.
    pub emission: Rgb,
    /// What the emission is multiplied with from place to place; its surfaces have texture coordinates. See
    /// [`crate::Scene::emitted`] for that of a point.
    pub emission_texture: Option<TextureId>,
    /// The part of the surface that is there, in [0, 1], or what its texture is multiplied with; light passes the rest
    /// straight on. See [`crate::Scene::opacity`] for that of a point.
    pub opacity: f32,
    /// What the opacity is multiplied with from place to place, in the mean of its channels; its surfaces have texture
    /// coordinates.
    pub opacity_texture: Option<TextureId>,
}

/// Scattering by interfaces, `f_s` of Eq. (6), perfectly sharp unless the material is rough. A new kind needs its arm in
/// [`Material::specular_bounces`] and in `lobe.rs`, its digest in `world.rs`, its keys in the scene file, and its row in
/// the tests of `material.rs`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Specular {
    /// No specular part.
    None,
    /// The same reflectance at every angle, on both sides.
    Mirror {
        /// In [0, 1].
        reflectance: Rgb,
    },
    /// A conductor.
    Metal {
        /// Real part of the index of refraction.
        eta: Rgb,
        /// Imaginary part.
        k: Rgb,
    },
    /// A dielectric, of which the front side is the outside.
    Glass {
        /// Index of refraction of the inside relative to the outside.
        ior: f32,
        /// Absorption coefficient inside, per unit of length: radiance falls by `exp(-absorption * t)`.
        absorption: Rgb,
    },
    /// A pane of glass so thin that it has no inside: light goes on straight or is reflected, by all reflections between
    /// its two faces.
    Pane {
        /// Index of refraction of the glass relative to what is around it.
        ior: f32,
    },
    /// A dielectric coat over the diffuse part, which is seen through it: plastic.
    Coat(Coat),
}

/// What is carried along a path: radiance is squeezed when it enters a denser medium, flux isn't.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// From the eye: weights hold the factor `(eta_i / eta_t)^2` (Veach 1997, section 5.2).
    Radiance,
    /// From the light: weights hold the factor by which interpolated normals are not symmetric (Veach 1997, section 5.3),
    /// so that photons show what eye rays see.
    Flux,
}

/// A direction in which a specular surface sends on what arrives.
#[derive(Clone, Copy, Debug)]
pub struct SpecularBounce {
    /// Unit direction, away from the surface.
    pub dir: Vec3A,
    /// What is left of radiance or flux.
    pub weight: Rgb,
    /// Whether it passes through the surface.
    pub transmitted: bool,
}

impl Material {
    /// A material that neither reflects nor emits anything, to be filled in.
    pub fn black(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            albedo: Rgb::BLACK,
            albedo_texture: None,
            specular: Specular::None,
            roughness: 0.0,
            emission: Rgb::BLACK,
            emission_texture: None,
            opacity: 1.0,
            opacity_texture: None,
        }
    }

    /// Whether its surfaces need texture coordinates.
    pub fn is_textured(&self) -> bool {
        self.albedo_texture.is_some()
            || self.emission_texture.is_some()
            || self.opacity_texture.is_some()
    }

    /// Whether light may pass its surfaces as if they weren't there.
    #[inline]
    pub fn is_masked(&self) -> bool {
        self.opacity < 1.0 || self.opacity_texture.is_some()
    }

    /// Whether all light that arrives is reflected as by a mirror, or lost.
    pub(crate) fn is_screen(&self) -> bool {
        let lets_pass = matches!(self.specular, Specular::Glass { .. } | Specular::Pane { .. });
        !self.is_diffuse() && !lets_pass && !self.is_masked()
    }

    /// Whether the diffuse part lies under a coat.
    #[inline]
    pub fn is_coated(&self) -> bool {
        matches!(self.specular, Specular::Coat(_))
    }

    /// How much of the light at a cosine to the shading normal gets to the diffuse part, or out from it, over the mean for
    /// light from all sides; 1 without a coat.
    #[inline]
    pub fn passage(&self, cos: f32) -> f32 {
        match &self.specular {
            Specular::Coat(coat) => coat.passage(cos),
            _ => 1.0,
        }
    }

    /// Whether the specular part scatters anything.
    pub fn is_specular(&self) -> bool {
        self.specular != Specular::None
    }

    /// Whether light passes into it, so that it has an inside.
    #[inline]
    pub fn is_glass(&self) -> bool {
        matches!(self.specular, Specular::Glass { .. })
    }

    /// Whether the diffuse part scatters anything.
    #[inline]
    pub fn is_diffuse(&self) -> bool {
        !self.albedo.is_black()
    }

    /// The directions into which a sharp specular part sends light that arrives along `-w_o`, or from which light towards
    /// `w_o` comes: reflection, then transmission. None if it is rough: see [`Material::lobe`]. `w_o` points away from the
    /// surface.
    ///
    /// Sides are told by the geometric normal, angles by the shading normal, unless that would send the reflection
    /// through the surface or keep the transmission in front of it: then the geometric normal serves for both.
    pub fn specular_bounces(
        &self,
        surface: &Surface,
        w_o: Vec3A,
        transport: Transport,
    ) -> [Option<SpecularBounce>; 2] {
        let front = w_o.dot(surface.geometric_normal) > 0.0;
        let side = surface.facing(w_o);
        let reflected_about = |n: Vec3A| n * (2.0 * n.dot(w_o)) - w_o;
        let n_g = side.geometric_normal;
        let mut n = side.shading_normal;
        if n.dot(w_o) <= 0.0 || reflected_about(n).dot(n_g) <= 0.0 {
            n = n_g;
        }
        let gain = |n: Vec3A, dir: Vec3A| match transport {
            Transport::Radiance => 1.0,
            Transport::Flux => {
                let gained = (n.dot(w_o) * n_g.dot(dir)).abs();
                let lost = (n_g.dot(w_o) * n.dot(dir)).abs();
                if gained == lost { 1.0 } else { (gained / lost).min(MAX_SHADING_GAIN) }
            }
        };
        let reflection = |n: Vec3A, weight: Rgb| {
            let dir = reflected_about(n).normalize();
            SpecularBounce { dir, weight: weight * gain(n, dir), transmitted: false }
        };
        match self.specular {
            _ if self.is_rough() => [None, None],
            Specular::None => [None, None],
            Specular::Mirror { reflectance } => [Some(reflection(n, reflectance)), None],
            Specular::Metal { eta, k } => {
                [Some(reflection(n, fresnel_conductor(n.dot(w_o), eta, k))), None]
            }
            Specular::Coat(coat) => [Some(reflection(n, coat.reflected(n.dot(w_o)))), None],
            Specular::Glass { ior, .. } => {
                let eta = if front { ior } else { 1.0 / ior };
                let mut refracted = refract(w_o, n, eta);
                if refracted.is_some_and(|dir| dir.dot(n_g) >= 0.0) {
                    n = n_g;
                    refracted = refract(w_o, n, eta);
                }
                let f = fresnel_dielectric(n.dot(w_o).min(1.0), eta);
                let squeeze = match transport {
                    Transport::Radiance => 1.0 / (eta * eta),
                    Transport::Flux => 1.0,
                };
                let transmission = refracted.map(|dir| SpecularBounce {
                    dir,
                    weight: Rgb::splat((1.0 - f) * squeeze * gain(n, dir)),
                    transmitted: true,
                });
                [Some(reflection(n, Rgb::splat(f))), transmission]
            }
            Specular::Pane { ior } => {
                // What one face reflects, and the other sends back through it, and so on: f + t f t + t f f f t ...
                let f = fresnel_dielectric(n.dot(w_o).min(1.0), ior);
                let reflected = 2.0 * f / (1.0 + f);
                let weight = Rgb::splat(1.0 - reflected);
                let transmission = SpecularBounce { dir: -w_o, weight, transmitted: true };
                let passes = reflected < 1.0;
                [Some(reflection(n, Rgb::splat(reflected))), passes.then_some(transmission)]
            }
        }
    }

    /// What is left of light after `distance` inside this material.
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        match self.specular {
            Specular::Glass { absorption, .. } if !absorption.is_black() => {
                absorption.map(|a| math::exp(-a * distance))
            }
            _ => Rgb::ONE,
        }
    }
}

/// Snell's law: the direction on the other side, if there is one. `eta` is that side's index relative to this one's.
pub(crate) fn refract(w_o: Vec3A, n: Vec3A, eta: f32) -> Option<Vec3A> {
    let cos_i = n.dot(w_o);
    let sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    (sin2_t < 1.0).then(|| (n * (cos_i / eta - (1.0 - sin2_t).sqrt()) - w_o / eta).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Rng, Stream, warp};
    use geometry::MaterialId;

    fn surface(shading_normal: Vec3A) -> Surface {
        Surface {
            position: Vec3A::ZERO,
            geometric_normal: Vec3A::Z,
            shading_normal,
            material: MaterialId(0),
            object: 0,
            primitive: 0,
            error: 0.0,
        }
    }

    fn material(specular: Specular) -> Material {
        Material { specular, ..Material::black("m") }
    }

    #[test]
    fn glass_splits_all_flux_and_bends_by_snell() {
        let glass = material(Specular::Glass { ior: 1.5, absorption: Rgb::BLACK });
        let mut rng = Rng::new(0, Stream::Test, 1);
        for _ in 0..10_000 {
            let w_o = warp::uniform_sphere(rng.next_2d());
            let [r, t] = glass.specular_bounces(&surface(Vec3A::Z), w_o, Transport::Flux);
            let r = r.unwrap();
            let total = r.weight.g + t.map_or(0.0, |t| t.weight.g);
            assert!((total - 1.0).abs() < 1e-5, "{total} at {w_o}");
            assert!((r.dir - Vec3A::new(-w_o.x, -w_o.y, w_o.z)).length() < 1e-5);
            if let Some(t) = t {
                let (inner, outer) = if w_o.z > 0.0 { (t.dir, w_o) } else { (w_o, t.dir) };
                let sines = |v: Vec3A| v.truncate().length();
                assert!((1.5 * sines(inner) - sines(outer)).abs() < 1e-4, "{w_o} {}", t.dir);
            }
        }
    }

    #[test]
    fn panes_bend_nothing_and_are_alike_from_both_sides() {
        let pane = material(Specular::Pane { ior: 1.5 });
        let mut rng = Rng::new(0, Stream::Test, 3);
        for _ in 0..1000 {
            let w_o = warp::uniform_sphere(rng.next_2d());
            for transport in [Transport::Radiance, Transport::Flux] {
                let split = |w: Vec3A| {
                    pane.specular_bounces(&surface(Vec3A::Z), w, transport).map(Option::unwrap)
                };
                let ([r, t], [r_behind, _]) = (split(w_o), split(-w_o));
                assert!(((r.weight + t.weight).g - 1.0).abs() < 1e-6);
                assert!((t.dir + w_o).length() < 1e-6 && t.transmitted);
                assert!((r.weight.g - r_behind.weight.g).abs() < 1e-6);
                // The same by counting: what leaves the pane after so many reflections within.
                let f = fresnel_dielectric(w_o.z.abs(), 1.5);
                let series: f32 = (0..60).map(|i| (1.0 - f).powi(2) * f.powi(2 * i + 1)).sum();
                assert!((r.weight.g - (f + series)).abs() < 1e-2, "{} at {w_o}", r.weight.g);
            }
        }
        assert!((fresnel_dielectric(1.0, 1.5) - 0.04).abs() < 1e-6);
        let [head_on, _] = pane.specular_bounces(&surface(Vec3A::Z), Vec3A::Z, Transport::Flux);
        assert!((head_on.unwrap().weight.g - 0.08 / 1.04).abs() < 1e-6);
    }

    #[test]
    fn shading_normals_never_send_light_to_the_wrong_side() {
        let mut rng = Rng::new(0, Stream::Test, 2);
        let glass = material(Specular::Glass { ior: 1.33, absorption: Rgb::BLACK });
        let mirror = material(Specular::Mirror { reflectance: Rgb::ONE });
        for _ in 0..20_000 {
            let w_o = warp::uniform_sphere(rng.next_2d());
            let n = warp::uniform_cone(rng.next_2d(), 0.2);
            for m in [&glass, &mirror] {
                for bounce in
                    m.specular_bounces(&surface(n), w_o, Transport::Radiance).into_iter().flatten()
                {
                    let same_side = bounce.dir.z * w_o.z > 0.0;
                    assert_eq!(
                        same_side, !bounce.transmitted,
                        "{w_o} about {n} gives {}",
                        bounce.dir
                    );
                }
            }
        }
    }

    #[test]
    fn radiance_that_goes_in_and_out_is_not_squeezed() {
        let glass = material(Specular::Glass { ior: 1.5, absorption: Rgb::BLACK });
        let w_o = Vec3A::new(0.6, 0.0, 0.8);
        let into = glass.specular_bounces(&surface(Vec3A::Z), w_o, Transport::Radiance)[1].unwrap();
        let out =
            glass.specular_bounces(&surface(Vec3A::Z), into.dir, Transport::Radiance)[1].unwrap();
        assert!((out.dir - w_o).length() < 1e-5);
        let f = fresnel_dielectric(0.8, 1.5);
        assert!(((into.weight * out.weight).g - (1.0 - f) * (1.0 - f)).abs() < 1e-5);
    }
}
