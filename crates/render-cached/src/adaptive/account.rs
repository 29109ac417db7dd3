//! Who did what, and how long it took.

use base::{Component, Components, Grid, Interrupted, Pixel, Rgb, Watch};
use cache_map::{Origin, Reason};
use cli::{Clock, Seconds};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use shade::{Counts, PixelStream, ShadingPoint, Work};

use crate::frame::{Frame, for_each};
use crate::render::{AdaptiveLayers, Progress, Rendered};
use crate::resume::Piece;

/// The error aimed at and reached.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct ErrorReport {
    /// The mean FLIP asked for.
    pub(crate) target: f32,
    /// The mean FLIP estimated from the pixels held out.
    pub(crate) measured_mean: f64,
    /// The value that 99.5 % of them don't exceed.
    pub(crate) measured_p995: f64,
    /// How many there were.
    pub(crate) held_out_pixels: u64,
}

impl ErrorReport {
    /// This, but for a share of the pixels, of which `other` tells.
    pub(crate) fn with(self, other: Self, share: f64) -> Self {
        let mean = |a: f64, b: f64| a + (b - a) * share;
        Self {
            target: self.target,
            measured_mean: mean(self.measured_mean, other.measured_mean),
            measured_p995: mean(self.measured_p995, other.measured_p995),
            held_out_pixels: self.held_out_pixels + other.held_out_pixels,
        }
    }
}

/// Runs the work of components and books its time; all other time is the cache's own.
pub(crate) struct Account<'x, 'a> {
    pub(crate) frame: &'x Frame<'a>,
    clock: &'x mut Clock,
    progress: &'x Progress<'x>,
    counts: Counts,
    seconds: Components<Seconds>,
    cache: Seconds,
}

impl<'x, 'a> Account<'x, 'a> {
    pub(crate) fn new(
        frame: &'x Frame<'a>,
        clock: &'x mut Clock,
        progress: &'x Progress<'x>,
    ) -> Self {
        let (seconds, cache) = (Components::default(), Seconds::default());
        Self { frame, clock, progress, counts: Counts::default(), seconds, cache }
    }

    /// `f` of the surface points of some pixels, booked to a component.
    pub(crate) fn pixels<T: Default + Piece>(
        &mut self,
        component: Component,
        pixels: &[Pixel],
        f: impl Fn(&ShadingPoint<'a>, PixelStream, &mut Work) -> T + Sync,
    ) -> Result<Vec<T>, Interrupted> {
        let frame = self.frame;
        self.items(component, pixels, |&pixel, work| frame.at(pixel, work, &f))
    }

    /// `f` of some items, booked to a component.
    pub(crate) fn items<I: Sync, T: Piece>(
        &mut self,
        component: Component,
        items: &[I],
        f: impl Fn(&I, &mut Work) -> T + Sync,
    ) -> Result<Vec<T>, Interrupted> {
        let resume = &self.progress.resume;
        self.booked(component, items, |watch| {
            resume.chunks(items, watch, |items| for_each(items, watch, &f))
        })
    }

    /// As [`Account::items`], of what is too long for a journal.
    pub(crate) fn fleeting<I: Sync, T: Send>(
        &mut self,
        component: Component,
        items: &[I],
        f: impl Fn(&I, &mut Work) -> T + Sync,
    ) -> Result<Vec<T>, Interrupted> {
        self.booked(component, items, |watch| for_each(items, watch, f))
    }

    fn booked<I, T>(
        &mut self,
        component: Component,
        items: &[I],
        work: impl FnOnce(Watch<'_>) -> Result<(Vec<T>, Counts), Interrupted>,
    ) -> Result<Vec<T>, Interrupted> {
        self.cache += self.clock.lap();
        let (values, counts) = self.progress.run(component.name(), items.len(), work)?;
        self.counts += counts;
        self.seconds[component] += self.clock.lap();
        Ok(values)
    }

    /// `f` of some items, booked to the cache.
    pub(crate) fn overhead<I: Sync, T: Send>(
        &mut self,
        items: &[I],
        f: impl Fn(&I, &mut Work) -> T + Sync,
    ) -> Result<Vec<T>, Interrupted> {
        let (values, counts) =
            self.progress.run("cache", items.len(), |watch| for_each(items, watch, f))?;
        self.counts += counts;
        Ok(values)
    }

    /// Work of the cache that tells its watch of each of so many units done, and ends with nothing when that says stop.
    pub(crate) fn watched<T>(
        &self,
        units: usize,
        work: impl FnOnce(Watch<'_>) -> Option<T>,
    ) -> Result<T, Interrupted> {
        self.progress.run("cache", units, work).ok_or(Interrupted)
    }

    /// As [`Account::overhead`], of what is worth a journal.
    pub(crate) fn probe<I: Sync, T: Piece>(
        &mut self,
        items: &[I],
        f: impl Fn(&I, &mut Work) -> T + Sync,
    ) -> Result<Vec<T>, Interrupted> {
        let resume = &self.progress.resume;
        let (values, counts) = self.progress.run("cache", items.len(), |watch| {
            resume.chunks(items, watch, |items| for_each(items, watch, &f))
        })?;
        self.counts += counts;
        Ok(values)
    }

    /// Work done so far.
    pub(crate) fn counts(&self) -> Counts {
        self.counts
    }

    /// Work done and time spent, where all of it was the cache's own.
    pub(crate) fn close(mut self) -> (Counts, Seconds) {
        self.cache += self.clock.lap();
        (self.counts, self.cache)
    }

    pub(crate) fn finish(
        mut self,
        values: Components<Grid<Rgb>>,
        reasons: Components<Vec<Reason>>,
        levels: Components<Vec<u8>>,
        error: ErrorReport,
    ) -> Rendered {
        let origins = origins(self.frame, &reasons);
        let traced = Components::from_fn(|component| {
            origins[component].values().iter().filter(|&&o| o == Origin::Traced).count() as u64
        });
        self.cache += self.clock.lap();
        let adaptive = Some(AdaptiveLayers { reasons, levels, error });
        Rendered {
            values,
            origins,
            traced,
            counts: self.counts,
            seconds: self.seconds,
            cache: self.cache,
            adaptive,
        }
    }
}

/// Where the values of each pixel come from.
pub(crate) fn origins(
    frame: &Frame<'_>,
    reasons: &Components<Vec<Reason>>,
) -> Components<Grid<Origin>> {
    let size = frame.size();
    // Surfaces are large: they are gone through once.
    let pixels = (0..size.n_pixels()).into_par_iter().with_min_len(4096);
    let shows_surface: Vec<bool> = pixels.map(|i| frame.shows_surface(i)).collect();
    Components::from_fn(|component| {
        let pixels = reasons[component].par_iter().zip(&shows_surface).with_min_len(4096);
        let origin = |(&reason, &shows_surface): (&Reason, &bool)| match reason {
            _ if !shows_surface => Origin::None,
            Reason::Interpolated => Origin::Interpolated,
            reason if reason.is_reuse() => Origin::Known,
            _ => Origin::Traced,
        };
        Grid::from_values(size, pixels.map(origin).collect())
    })
}
