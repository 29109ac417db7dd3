//! Irradiance of caustics: exactly zero where no photon reaches, sampled densely where some do.

use base::{Component, Interrupted, Pixel, Rgb};
use cache_map::{Layer, RecordPoint, Records, Rule, Tolerance};
use photon_map::Reach;
use rayon::prelude::*;

use super::direct::Direct;
use super::indirect::Indirect;
use super::records::{Saved, Source};
use super::{Account, View};

/// The widest spacing of samples in reach of caustic photons.
const COARSEST: u32 = 4;

/// Irradiance of caustics at every pixel.
#[derive(Debug)]
pub(crate) struct Caustic {
    pub(crate) layer: Layer<Rgb>,
    in_reach: Vec<bool>,
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
        Self { layer: Layer::new(view.size().n_pixels()), in_reach, source }
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
            fn spacing(&self, _: Pixel) -> f32 {
                COARSEST as f32
            }
        }
        let rule = CausticRule { view, direct, indirect, in_reach: &self.in_reach };
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
