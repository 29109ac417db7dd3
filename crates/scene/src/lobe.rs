//! How rough mirrors, metals, glass and coats scatter: reflection and refraction by microfacets.
//!
//! Light that microfacets hide from each other is lost, as usual (Walter, Marschner, Li and Torrance 2007). What is lost
//! grows with roughness: of light from all sides on a white mirror 1.9 % at a roughness of 0.3, 12 % at 0.5, 42 % at 0.8
//! and 63 % at 1.

use base::{Frame, Rgb};
use geometry::{MAX_SHADING_GAIN, Surface};
use glam::{Vec2, Vec3A};

use crate::ggx::{masking, visible_normal, visible_normal_pdf};
use crate::material::refract;
use crate::{Material, Specular, SpecularBounce, Transport, fresnel_conductor, fresnel_dielectric};

/// Below this roughness surfaces are perfectly sharp: lobes are then narrower than a pixel of most pictures, and single
/// precision can't tell their directions apart.
pub const LEAST_ROUGHNESS: f32 = 0.02;

/// Glass that bends light less than this is sharp, however rough its surface: all that passes keeps its direction.
const LEAST_BEND: f32 = 0.01;

/// The scattering of a rough surface, seen from one direction.
#[derive(Clone, Copy, Debug)]
pub struct Lobe {
    interface: Specular,
    alpha: f32,
    /// Around the normal that tells angles, on the side of `w_o`.
    frame: Frame,
    /// In that frame; above the surface.
    w_o: Vec3A,
    /// The normal that tells sides, on that of `w_o`.
    n_g: Vec3A,
    /// Index of refraction of the other side relative to this one's; 1 if nothing passes.
    eta: f32,
    transport: Transport,
}

/// A direction chosen by a lobe.
#[derive(Clone, Copy, Debug)]
pub struct LobeSample {
    /// Unit direction, away from the surface.
    pub dir: Vec3A,
    /// What is left of radiance or flux: scattering times cosine over density.
    pub weight: Rgb,
    /// Density per steradian.
    pub pdf: f32,
    /// Whether it passes through the surface.
    pub transmitted: bool,
}

impl From<LobeSample> for SpecularBounce {
    fn from(sample: LobeSample) -> Self {
        let LobeSample { dir, weight, transmitted, .. } = sample;
        Self { dir, weight, transmitted }
    }
}

/// What a lobe makes of one direction.
#[derive(Clone, Copy, Debug)]
pub struct LobeValue {
    /// Scattering times cosine, per steradian.
    pub value: Rgb,
    /// Density per steradian at which [`Lobe::sample`] chooses this direction.
    pub pdf: f32,
    /// Whether it passes through the surface.
    pub transmitted: bool,
}

impl Material {
    /// Whether the specular part is rough. Then [`Material::lobe`] tells how it scatters.
    #[inline]
    pub fn is_rough(&self) -> bool {
        self.roughness >= LEAST_ROUGHNESS
            && match self.specular {
                Specular::None | Specular::Pane { .. } => false,
                Specular::Mirror { .. } | Specular::Metal { .. } | Specular::Coat(_) => true,
                Specular::Glass { ior, .. } => (ior - 1.0).abs() >= LEAST_BEND,
            }
    }

    /// How the rough specular part scatters what arrives along `-w_o`, or sends towards `w_o`; nothing if it is sharp, or
    /// isn't there. `w_o` points away from the surface.
    ///
    /// Angles are told by the shading normal, sides by both: directions about which they disagree get nothing.
    pub fn lobe(&self, surface: &Surface, w_o: Vec3A, transport: Transport) -> Option<Lobe> {
        if !self.is_rough() {
            return None;
        }
        let front = w_o.dot(surface.geometric_normal) > 0.0;
        let side = surface.facing(w_o);
        let n_g = side.geometric_normal;
        let n = if side.shading_normal.dot(w_o) > 0.0 { side.shading_normal } else { n_g };
        let frame = Frame::new(n);
        let mut local = frame.to_local(w_o);
        // Exactly along the surface there is nothing to be seen, but the ray came from somewhere.
        local.z = local.z.max(1e-6);
        let eta = match self.specular {
            Specular::Glass { ior, .. } if front => ior,
            Specular::Glass { ior, .. } => 1.0 / ior,
            _ => 1.0,
        };
        let alpha = self.roughness * self.roughness;
        let interface = self.specular;
        Some(Lobe { interface, alpha, frame, w_o: local.normalize(), n_g, eta, transport })
    }
}

impl Lobe {
    /// Chooses a direction, from a point of the unit square and a number in [0, 1) that decides between reflection and
    /// transmission; nothing where the microfacet sends light into its neighbours.
    pub fn sample(&self, u: Vec2, choice: f32) -> Option<LobeSample> {
        let h = visible_normal(self.w_o, self.alpha, u);
        let facet = self.facet(h);
        let transmitted = choice >= facet.share_reflected;
        let w_i = if transmitted {
            refract(self.w_o, h, self.eta)?
        } else {
            (h * (2.0 * h.dot(self.w_o)) - self.w_o).normalize()
        };
        let dir = self.frame.to_world(w_i).normalize();
        let value = self.along(w_i, dir, h, &facet, transmitted)?;
        Some(LobeSample { dir, weight: value.0, pdf: value.1, transmitted })
    }

    /// The value of a unit direction that points away from the surface; nothing if none is scattered there.
    pub fn evaluate(&self, dir: Vec3A) -> Option<LobeValue> {
        let w_i = self.frame.to_local(dir);
        let transmitted = w_i.z < 0.0;
        let h = if transmitted {
            if self.eta == 1.0 {
                return None;
            }
            // Of the two normals that refract one direction into the other the one on this side.
            let h = -(self.w_o + w_i * self.eta);
            h * 1.0_f32.copysign(h.z)
        } else {
            self.w_o + w_i
        };
        let h = h.try_normalize()?;
        let (weight, pdf) = self.along(w_i, dir, h, &self.facet(h), transmitted)?;
        Some(LobeValue { value: weight * pdf, pdf, transmitted })
    }

    fn facet(&self, h: Vec3A) -> Facet {
        let cos = h.dot(self.w_o).clamp(0.0, 1.0);
        match self.interface {
            Specular::None | Specular::Pane { .. } => {
                Facet { reflectance: Rgb::BLACK, share_reflected: 1.0 }
            }
            Specular::Mirror { reflectance } => Facet { reflectance, share_reflected: 1.0 },
            Specular::Coat(coat) => {
                Facet { reflectance: coat.reflected(cos), share_reflected: 1.0 }
            }
            Specular::Metal { eta, k } => {
                Facet { reflectance: fresnel_conductor(cos, eta, k), share_reflected: 1.0 }
            }
            // Chosen by what they carry, so that weights are those of a mirror.
            Specular::Glass { .. } => {
                Facet { reflectance: Rgb::ONE, share_reflected: fresnel_dielectric(cos, self.eta) }
            }
        }
    }

    /// Weight and density of a direction, in both frames, that the facet `h` scatters to.
    fn along(
        &self,
        w_i: Vec3A,
        dir: Vec3A,
        h: Vec3A,
        facet: &Facet,
        transmitted: bool,
    ) -> Option<(Rgb, f32)> {
        let (o, i) = (self.w_o.dot(h), w_i.dot(h));
        let side = if transmitted { -1.0 } else { 1.0 };
        let lands = dir.dot(self.n_g);
        if o <= 0.0 || i * side <= 0.0 || w_i.z * side <= 0.0 || lands * side <= 0.0 {
            return None;
        }
        let normals = visible_normal_pdf(self.w_o, h, self.alpha);
        // Solid angle of normals for a solid angle of directions (Walter et al., Eqs. 14 and 17).
        let (chosen, jacobian) = if transmitted {
            let sum = o + self.eta * i;
            (1.0 - facet.share_reflected, self.eta * self.eta * -i / (sum * sum))
        } else {
            (facet.share_reflected, 0.25 / o)
        };
        let pdf = chosen * normals * jacobian;
        let squeeze = match self.transport {
            Transport::Radiance if transmitted => 1.0 / (self.eta * self.eta),
            _ => 1.0,
        };
        let weight = masking(w_i, self.alpha) * squeeze * self.gain(w_i, lands);
        (pdf > 0.0 && pdf.is_finite()).then(|| (facet.reflectance * weight, pdf))
    }

    /// The factor by which interpolated normals are not symmetric (Veach 1997, section 5.3).
    fn gain(&self, w_i: Vec3A, lands: f32) -> f32 {
        if self.transport == Transport::Radiance || self.frame.n == self.n_g {
            return 1.0;
        }
        let leaves = self.frame.to_world(self.w_o).dot(self.n_g);
        (self.w_o.z * lands / (leaves * w_i.z)).abs().min(MAX_SHADING_GAIN)
    }
}

/// What a microfacet does.
struct Facet {
    /// The color of what it sends on.
    reflectance: Rgb,
    /// The share that isn't refracted.
    share_reflected: f32,
}
