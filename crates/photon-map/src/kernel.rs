//! How a photon's weight falls with its distance.

use base::math::PI;

/// A radially symmetric kernel on the unit disc, with integral 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kernel {
    /// All photons alike. The least noise, the hardest edges.
    Box,
    /// A cone of slope 1/1.1 (Jensen 2001, section 7.3.1).
    Cone,
    /// A parabola (Epanechnikov 1969): continuous, and the best trade of noise against blur.
    Epanechnikov,
    /// The square of it (Silverman 1986): smooth, sharper and noisier.
    Biweight,
}

/// The constant of [`Kernel::Cone`].
const CONE: f32 = 1.1;

impl Kernel {
    /// All kernels.
    pub const ALL: [Self; 4] = [Self::Box, Self::Cone, Self::Epanechnikov, Self::Biweight];

    /// The name used on command lines and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Cone => "cone",
            Self::Epanechnikov => "epanechnikov",
            Self::Biweight => "biweight",
        }
    }

    /// Weight per unit of area on the unit disc, at squared distance `x2` in [0, 1).
    #[inline(always)]
    pub fn weight(self, x2: f32) -> f32 {
        match self {
            Self::Box => 1.0 / PI,
            Self::Cone => (1.0 - x2.sqrt() / CONE) / (PI * (1.0 - 2.0 / (3.0 * CONE))),
            Self::Epanechnikov => (1.0 - x2) * (2.0 / PI),
            Self::Biweight => (1.0 - x2) * (1.0 - x2) * (3.0 / PI),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrals_are_one() {
        for kernel in Kernel::ALL {
            // Uniform in x2 means uniform by area.
            let n = 100_000;
            let mean =
                (0..n).map(|i| f64::from(kernel.weight((i as f32 + 0.5) / n as f32))).sum::<f64>()
                    / f64::from(n);
            let integral = mean * std::f64::consts::PI;
            assert!((integral - 1.0).abs() < 1e-4, "{kernel:?}: {integral}");
        }
    }
}
