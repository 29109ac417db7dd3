//! Weighted sums of packed fluxes, several photons at a time.

use base::Rgb;

use crate::{Kernel, flux};

/// How many sums are made side by side, for the compiler to put into vectors. A fixed number: it decides how sums round.
const LANES: usize = 8;

/// A sum that is being made.
#[derive(Default)]
pub(crate) struct Sum {
    channels: [[f32; LANES]; 3],
}

impl Sum {
    /// Adds photons within a radius, given by squared distance and packed flux.
    pub(crate) fn add(&mut self, dist2: &[f32], flux: &[u32], radius2: f32, kernel: Kernel) {
        // The kernel is chosen outside the loop.
        match kernel {
            Kernel::Box => self.add_by(dist2, flux, |d2| Kernel::Box.weight(d2 / radius2)),
            Kernel::Cone => self.add_by(dist2, flux, |d2| Kernel::Cone.weight(d2 / radius2)),
            Kernel::Epanechnikov => {
                self.add_by(dist2, flux, |d2| Kernel::Epanechnikov.weight(d2 / radius2));
            }
            Kernel::Biweight => {
                self.add_by(dist2, flux, |d2| Kernel::Biweight.weight(d2 / radius2));
            }
        }
    }

    #[inline(always)]
    fn add_by(&mut self, dist2: &[f32], flux: &[u32], weight: impl Fn(f32) -> f32) {
        let (dist2, last_dist2) = dist2.as_chunks::<LANES>();
        let (flux, last_flux) = flux.as_chunks::<LANES>();
        for (dist2, flux) in dist2.iter().zip(flux) {
            self.add_lanes(dist2, flux, &weight);
        }
        if !last_dist2.is_empty() {
            // No flux at distance 0 adds nothing.
            let (mut dist2, mut flux) = ([0.0; LANES], [0; LANES]);
            dist2[..last_dist2.len()].copy_from_slice(last_dist2);
            flux[..last_flux.len()].copy_from_slice(last_flux);
            self.add_lanes(&dist2, &flux, &weight);
        }
    }

    #[inline(always)]
    fn add_lanes(
        &mut self,
        dist2: &[f32; LANES],
        flux: &[u32; LANES],
        weight: impl Fn(f32) -> f32,
    ) {
        let [r, g, b] = &mut self.channels;
        for lane in 0..LANES {
            let weighted = flux::unpack(flux[lane]) * weight(dist2[lane]);
            r[lane] += weighted.r;
            g[lane] += weighted.g;
            b[lane] += weighted.b;
        }
    }

    /// The sum.
    pub(crate) fn total(&self) -> Rgb {
        Rgb::from(self.channels.map(|lanes| lanes.iter().sum::<f32>()))
    }
}
