//! A photon that has landed.

use glam::Vec3;

use crate::Rgb;

/// A share of the emitted flux that has landed on a diffuse surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photon {
    /// Where it landed.
    pub position: Vec3,
    /// The normal of the true surface there, on the side that was hit, as [`crate::encode_octahedral`] packs it.
    pub normal: u16,
    /// Flux, in watts.
    pub flux: Rgb,
}

/// What happened to a photon before it landed, Eq. (7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhotonClass {
    /// Nothing: it came straight from the light.
    Direct,
    /// One or more specular bounces, sharp or rough, nothing else (L S+ D).
    Caustic,
    /// At least one diffuse bounce, whatever else.
    Indirect,
    /// Those of class indirect whose last bounce was specular (L (S|D)* D S+ D), once more: only final gathering asks for
    /// them.
    Focused,
}

impl PhotonClass {
    /// All, in order.
    pub const ALL: [Self; 4] = [Self::Direct, Self::Caustic, Self::Indirect, Self::Focused];

    /// The name used in files and statistics.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Direct => "direct",
            Self::Caustic => "caustic",
            Self::Indirect => "indirect",
            Self::Focused => "focused",
        }
    }
}
