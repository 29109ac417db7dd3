//! Indirect irradiance.

use base::{Component, Interrupted, Pixel, Rgb};
use cache_map::{Layer, Reason, Rule, Tolerance, refine};

use super::direct::Direct;
use super::{Account, COARSEST, View};

/// The estimate is band-limited by its own radius: samples closer than this share of it say nothing new.
const SPACING_PER_RADIUS: f32 = 0.5;

/// Indirect irradiance at every pixel.
#[derive(Debug)]
pub(crate) struct Indirect {
    pub(crate) layer: Layer<Rgb>,
    /// For each cell of the coarsest lattice the widest spacing that its radius allows.
    spacing: Vec<u32>,
    /// Luminance of the irradiance, likewise; before refinement this is all that is known.
    ambient: Vec<f32>,
    /// Luminance of a picture's indirect radiance, in the mean: errors far below it don't show.
    floor: f32,
}

impl Indirect {
    /// Traces the coarsest lattice.
    pub(crate) fn start(view: &View, account: &mut Account<'_, '_>) -> Result<Self, Interrupted> {
        let pixels = view.coarse_pixels();
        let shader = account.frame.shader();
        let estimates = account.pixels(Component::Indirect, &pixels, |point, _, work| {
            let estimate = shader.indirect_estimate(&point.facing, work);
            (estimate.irradiance, estimate.radius)
        })?;
        let mut layer = Layer::new(view.size().n_pixels());
        let mut spacing = vec![COARSEST; view.n_cells()];
        let mut ambient = vec![0.0; view.n_cells()];
        let mut sum = 0.0_f64;
        for (&pixel, &(irradiance, radius)) in pixels.iter().zip(&estimates) {
            let i = view.size().index(pixel);
            layer.values[i] = irradiance;
            layer.reasons[i] = Reason::Lattice;
            layer.levels[i] = COARSEST.trailing_zeros() as u8;
            let fits = radius * view.pixels_per_unit(i) * SPACING_PER_RADIUS;
            let widest = (fits.clamp(2.0, COARSEST as f32) as u32).next_power_of_two();
            spacing[view.cell(i)] = if widest as f32 > fits.max(2.0) { widest / 2 } else { widest };
            ambient[view.cell(i)] = irradiance.luminance();
            sum += f64::from(irradiance.luminance() * view.gain(i));
        }
        let floor = 0.1 * sum as f32 / pixels.len().max(1) as f32;
        Ok(Self { layer, spacing, ambient, floor })
    }

    pub(crate) fn irradiance(&self, index: usize) -> Rgb {
        self.layer.values[index]
    }

    /// A guess of the luminance of what isn't direct light at a pixel, for white albedo and times pi.
    pub(crate) fn ambient(&self, view: &View, index: usize) -> f32 {
        0.5 * self.ambient[view.cell(index)]
    }

    /// Radiance below which errors don't show.
    pub(crate) fn floor(&self) -> f32 {
        self.floor
    }

    /// Halves the spacing of samples.
    pub(crate) fn tighten(&mut self) {
        self.spacing.iter_mut().for_each(|s| *s = (*s / 2).max(1));
    }

    pub(crate) fn refine(
        &mut self,
        view: &View,
        direct: &Direct,
        tolerance: Tolerance,
        account: &mut Account<'_, '_>,
    ) -> Result<(), Interrupted> {
        struct IndirectRule<'x> {
            view: &'x View,
            direct: &'x Direct,
            spacing: &'x [u32],
            floor: f32,
        }
        impl Rule<Rgb> for IndirectRule<'_> {
            fn gain(&self, index: usize) -> f32 {
                self.view.gain(index)
            }
            fn reference(&self, index: usize, predicted: Rgb) -> f32 {
                self.floor
                    + (self.direct.luminance(index) + predicted.luminance()) * self.view.gain(index)
            }
            fn spacing(&self, index: usize) -> u32 {
                self.spacing[self.view.cell(index)]
            }
        }
        let rule = IndirectRule { view, direct, spacing: &self.spacing, floor: self.floor };
        let shader = account.frame.shader();
        refine(
            &view.lattice,
            &mut self.layer,
            COARSEST,
            &rule,
            tolerance,
            &mut |pixels: &[Pixel]| {
                account.pixels(Component::Indirect, pixels, |point, _, work| {
                    shader.indirect_estimate(&point.facing, work).irradiance
                })
            },
        )
    }
}
