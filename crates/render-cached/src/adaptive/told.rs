//! How wrong pixels are that those around them tell: some are held out.

use base::{Components, Grid, Interrupted, Rgb, math::FRAC_1_PI};
use cache_map::same_surface;

use super::cells::Cells;
use super::holdout::HeldOut;
use super::primary::Primary;
use super::view::as_seen;
use super::{Account, ErrorReport, View};
use crate::Args;
use crate::frame::Frame;

/// Pixels of a frame between those that the cache works on.
pub(super) struct Told<'x, 'a> {
    frame: &'x Frame<'a>,
    cells: Cells,
    held_out: HeldOut,
}

impl<'x, 'a> Told<'x, 'a> {
    /// Chooses and computes them; the cache works on those of `coarse`, of which the account is.
    pub(super) fn new(
        args: &Args,
        frame: &'x Frame<'a>,
        coarse: &'x Frame<'a>,
        account: &mut Account<'x, 'a>,
    ) -> Result<Self, Interrupted> {
        let cells = Cells::new(frame, coarse);
        account.frame = frame;
        let held_out = HeldOut::between(args, cells.n, account);
        account.frame = coarse;
        Ok(Self { frame, cells, held_out: held_out? })
    }

    /// Their error in the view as it will be. That of the pixels that the cache works on tells too little: these are often
    /// computed.
    pub(super) fn in_view(&self, args: &Args, view: &View, primary: &Primary) -> ErrorReport {
        let Self { frame, cells, held_out } = self;
        let scene = frame.shader().scene;
        let shown = |i: usize, specular: Rgb| {
            let (pixel, surface) = (frame.size().pixel(i), frame.surface(i)?);
            if !scene.material(&surface).is_diffuse() {
                return None;
            }
            let (site, albedo) = as_seen(&surface, frame.eye(pixel), scene);
            let is_shown = |i: usize| {
                view.sites.values()[i].as_ref().is_some_and(|other| same_surface(other, &site))
            };
            let around = cells.around(pixel, is_shown)?;
            let albedo = albedo * FRAC_1_PI;
            Some(Components {
                direct: albedo * around.blend(|i| primary.direct.irradiance(i)),
                indirect: albedo * around.blend(|i| primary.indirect.irradiance(i)),
                caustic: albedo * around.blend(|i| primary.caustic.irradiance(i)),
                specular,
            })
        };
        held_out.measure(args, frame.size(), shown, |_| false).estimate
    }

    /// The error of all pixels of the frame, once their values are known.
    pub(super) fn at_last(
        &self,
        args: &Args,
        of_others: ErrorReport,
        values: &Components<Grid<Rgb>>,
    ) -> ErrorReport {
        let at = |i: usize, _| Some(Components::from_fn(|c| values[c].values()[i]));
        let told = self.held_out.measure(args, self.frame.size(), at, |_| false).estimate;
        of_others.with(told, self.share())
    }

    /// The share of the pixels that are told.
    pub(super) fn share(&self) -> f64 {
        1.0 - 1.0 / f64::from(self.cells.n_subpixels())
    }
}
