//! How a photon's weight falls with its distance.

use base::math::{self, PI};

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

    /// The integral of the weight over the part of the unit disc that a wall hides from its center. The wall is a piece
    /// of a line at distance `h`, not negative, and reaches from `from` to `to`, counted along it from the foot of the
    /// perpendicular; `from <= to`.
    ///
    /// In each direction what lies beyond the wall, at distance `s = h / cos(angle)`, has a weight that is a polynomial of
    /// `s`; here are their integrals over the angle.
    pub fn hidden(self, h: f32, from: f32, to: f32) -> f32 {
        let h2 = h * h;
        if h2 >= 1.0 {
            return 0.0;
        }
        let half_chord = (1.0 - h2).sqrt();
        let up_to = |u: f32| {
            let u = u.clamp(-half_chord, half_chord);
            let (angle, hu, u2) = (math::atan2(u, h), h * u, u * u);
            match self {
                Self::Box => (angle - hu) / (2.0 * PI),
                Self::Cone => {
                    // The weight beyond s is 1/2 - 1/(3c) - s^2/2 + s^3/(3c).
                    let s = (h2 + u2).sqrt();
                    let log = if h > 0.0 { h2 * h * math::ln((u + s) / h) } else { 0.0 };
                    let cubic = (hu * s + log) / (6.0 * CONE);
                    let sum = angle * (0.5 - 1.0 / (3.0 * CONE)) - 0.5 * hu + cubic;
                    sum / (PI * (1.0 - 2.0 / (3.0 * CONE)))
                }
                // (1 - s^2)^2 and (1 - s^2)^3, over 2 pi.
                Self::Epanechnikov => (angle + hu * (h2 + u2 / 3.0 - 2.0)) / (2.0 * PI),
                Self::Biweight => {
                    let quartic = h2 * h2 + h2 * u2 * (2.0 / 3.0) + u2 * u2 * 0.2;
                    (angle + hu * (3.0 * h2 + u2 - 3.0 - quartic)) / (2.0 * PI)
                }
            }
        };
        up_to(to) - up_to(from)
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

    #[test]
    fn walls_hide_what_brute_force_says() {
        let n = 1200;
        let walls = [
            (1e-3, -9.0, 9.0),
            (0.3, -2.0, 2.0),
            (0.3, -0.1, 0.6),
            (0.7, 0.2, 0.3),
            (0.9, -1.0, 0.1),
            (0.1, -3.0, -0.4),
        ];
        for kernel in Kernel::ALL {
            for (h, from, to) in walls {
                let mut sum = 0.0;
                for i in 0..n * n {
                    let at = |i: i32| (i as f32 + 0.5) * (2.0 / n as f32) - 1.0;
                    let (x, y) = (at(i % n), at(i / n));
                    let foot = x * h / y;
                    if y > h && x * x + y * y < 1.0 && foot > from && foot < to {
                        sum += f64::from(kernel.weight(x * x + y * y));
                    }
                }
                let expected = sum * (2.0 / f64::from(n)).powi(2);
                let hidden = f64::from(kernel.hidden(h, from, to));
                assert!(
                    (hidden - expected).abs() < 1e-3,
                    "{kernel:?} beyond {from} to {to} at {h}: {hidden}, not {expected}"
                );
            }
            assert!((kernel.hidden(0.0, -2.0, 3.0) - 0.5).abs() < 1e-6, "{kernel:?}");
            assert_eq!(kernel.hidden(1.0, -2.0, 3.0), 0.0, "{kernel:?}");
        }
    }
}
