//! Irradiance of caustics: exactly zero where no photon reaches, sampled densely where some do.

use std::f32::consts::SQRT_2;

use base::{Component, Interrupted, Pixel, Rgb};
use cache_map::{Layer, RecordPoint, Records, Rule, Tolerance};
use photon_map::Reach;
use rayon::prelude::*;

use super::direct::Direct;
use super::indirect::Indirect;
use super::records::{Saved, Source};
use super::{Account, View};

/// The side of the squares of samples in reach of caustic photons, in pixels.
const COARSEST: u32 = 8;

/// Samples in these squares and in their centers leave no pixel farther from all of them than this.
const FARTHEST: f32 = 4.0;

/// Their spacing, and that where an estimate doesn't look as far.
const WIDE: f32 = 4.0 * SQRT_2;
const NARROW: f32 = 4.0;

/// Irradiance of caustics at every pixel.
#[derive(Debug)]
pub(crate) struct Caustic {
    pub(crate) layer: Layer<Rgb>,
    in_reach: Vec<bool>,
    /// The widest spacing in each cell of the coarsest lattice of the view.
    spacing: Vec<f32>,
    source: Source<Rgb>,
}

impl Caustic {
    /// Finds the pixels that photons reach. The others are black, without any error.
    pub(crate) fn start(view: &View, saved: &Saved, account: &Account<'_, '_>) -> Self {
        let shader = account.frame.shader();
        let reach = Reach::new(&shader.photons.caustic, shader.settings.caustic.max_radius);
        let sites = view.sites.values().par_iter().with_min_len(4096);
        let in_reach =
            sites.map(|s| s.is_some_and(|s| reach.may_reach(s.position.into()))).collect();
        // To look around takes longer than most estimates do.
        let source = saved.exact_source(&saved.set.caustic);
        let spacing = spacing(view, shader.settings.caustic.max_radius);
        Self { layer: Layer::new(view.size().n_pixels()), in_reach, spacing, source }
    }

    /// All that is known of caustics, for good.
    pub(crate) fn records(&self, view: &View, reach: f32) -> Records<Rgb> {
        self.source
            .with(&self.layer, |i| Some(RecordPoint { surface: view.sites.values()[i]?, reach }))
    }

    pub(crate) fn irradiance(&self, index: usize) -> Rgb {
        self.layer.values[index]
    }

    pub(crate) fn refine(
        &mut self,
        view: &View,
        direct: &Direct,
        indirect: &Indirect,
        tolerance: Tolerance,
        account: &mut Account<'_, '_>,
    ) -> Result<(), Interrupted> {
        struct CausticRule<'x> {
            view: &'x View,
            direct: &'x Direct,
            indirect: &'x Indirect,
            in_reach: &'x [bool],
            spacing: &'x [f32],
        }
        impl Rule<Rgb> for CausticRule<'_> {
            fn gain(&self, index: usize) -> f32 {
                if self.in_reach[index] { self.view.gain(index) } else { 0.0 }
            }
            fn reference(&self, index: usize, predicted: Rgb) -> f32 {
                let others =
                    self.direct.luminance(index) + self.indirect.irradiance(index).luminance();
                self.indirect.floor() + (others + predicted.luminance()) * self.view.gain(index)
            }
            fn spacing(&self, pixel: Pixel) -> f32 {
                self.spacing[self.view.cell(pixel)]
            }
        }
        let (in_reach, spacing) = (&self.in_reach, &self.spacing);
        let rule = CausticRule { view, direct, indirect, in_reach, spacing };
        let shader = account.frame.shader();
        self.source.refine(
            &view.lattice,
            &mut self.layer,
            COARSEST,
            &rule,
            tolerance,
            |i| view.place(i),
            account,
            |account, pixels: &[Pixel]| {
                account.pixels(Component::Caustic, pixels, |point, _, work| {
                    shader.caustic_estimate(&point.facing, work).irradiance
                })
            },
        )
    }
}

/// The widest spacing of samples in each cell with which no photon is missed: an estimate feels all within `radius`, as long
/// as they are few, and where they are many its value tells so.
fn spacing(view: &View, radius: f32) -> Vec<f32> {
    let cells = 0..view.n_cells();
    let spacing = |cell| {
        let sites = view.some_pixels(cell).filter_map(|pixel| view.sites[pixel].as_ref());
        let longest = sites.map(|site| view.longest_footprint(site)).fold(0.0, f32::max);
        let widest = if FARTHEST * longest <= radius { WIDE } else { NARROW };
        widest / view.apart() as f32
    };
    cells.into_par_iter().with_min_len(64).map(spacing).collect()
}
