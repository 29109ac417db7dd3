//! Saved values in place of computed ones, and what a run adds to them.
//!
//! Wherever a value would be computed, records are asked first. In a view that the file has recorded in full only those
//! at the very point count, so that a picture is that of a run without the file, to the bit. In other views records
//! around the point may tell its value, under the tolerance that holds between pixels; what they told is asked again
//! whenever the tolerance becomes stricter, and is never recorded, so that errors don't chain.

use std::path::Path;

use anyhow::bail;
use base::{Fingerprint, FingerprintBuilder, Interrupted, Inventory, Pixel};
use cache_map::{
    Lattice, Layer, Nearby, Reason, RecordIndex, RecordPoint, RecordSet, Records, Rule,
    SurfacePoint, Tolerance, Trace, Value, refine,
};
use mapfile::{Error, MapFile};

use super::Account;
use crate::frame::Frame;
use crate::{Args, output};

/// Across an edge a record may stand for points at this part of the distance of samples. Elsewhere at all of it.
pub(crate) const CLOSE: f32 = 0.4;

/// What has been saved of a scene.
#[derive(Debug, Default)]
pub(crate) struct Saved {
    pub(crate) set: RecordSet,
    /// Whether this view is recorded in full, so that only records at the very point count.
    is_same_view: bool,
    file: Option<MapFile>,
}

/// The saved records of one quantity.
#[derive(Debug)]
pub(crate) struct Source<T: Value> {
    records: Records<T>,
    /// For records around a point, where they count.
    index: Option<RecordIndex>,
}

/// A place where a value is wanted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub(crate) surface: SurfacePoint,
    /// What a pixel spans there, in world units.
    pub(crate) pixel: f32,
}

impl Saved {
    /// Opens the file that the command line names, if it names one.
    pub(crate) fn open(args: &Args, frame: &Frame<'_>, inputs: &Inventory) -> anyhow::Result<Self> {
        let Some(path) = &args.paper.from_cache else { return Ok(Self::default()) };
        let remedy = output::cache_command(args, path);
        let (set, file) = match RecordSet::open(path, inputs, &remedy) {
            Err(Error::OtherKind { path, found, .. }) if found == cache_map::KIND => bail!(
                "{} was saved in mode paper, which keeps radiance of one view only; render with --mode paper, or \
                 replace it with: {remedy}",
                path.display()
            ),
            opened => opened?,
        };
        let is_same_view = set.views.contains(&view_of(frame));
        Ok(Self { set, is_same_view, file: Some(file) })
    }

    /// To be asked when all was taken from them, and before anything is shown.
    ///
    /// # Errors
    /// When the file was changed meanwhile.
    pub(crate) fn check_untouched(&self) -> Result<(), Error> {
        self.file.as_ref().map_or(Ok(()), MapFile::check_untouched)
    }

    /// Records that count where they are, and around that if the view is another.
    pub(crate) fn source<T: Value>(&self, records: &Records<T>) -> Source<T> {
        let asks_around = !self.is_same_view && !records.is_empty();
        Source { records: records.clone(), index: asks_around.then(|| records.index()) }
    }

    /// Records that count only where they are.
    pub(crate) fn exact_source<T: Value>(&self, records: &Records<T>) -> Source<T> {
        Source { records: records.clone(), index: None }
    }

    /// Those of the visibility of a light.
    pub(crate) fn visibility(&self, light: usize) -> Source<f32> {
        let found = self.set.visibility.iter().find(|v| v.0 as usize == light);
        found.map_or_else(|| self.exact_source(&Records::default()), |v| self.source(&v.1))
    }
}

/// Saves what was loaded and what a run has added.
pub(crate) fn save(
    path: &Path,
    args: &Args,
    frame: &Frame<'_>,
    inputs: &Inventory,
    set: &mut RecordSet,
    is_complete: bool,
) -> Result<(), Error> {
    let view = view_of(frame);
    if is_complete && !set.views.contains(&view) {
        set.views.push(view);
    }
    let made_by = concat!("render-cached ", env!("CARGO_PKG_VERSION"));
    let command = output::cache_command(args, Path::new("{file}"));
    set.save(path, args.common.existing(), inputs, made_by, &command)?;
    Ok(())
}

/// A digest of the camera and the pixels.
fn view_of(frame: &Frame<'_>) -> Fingerprint {
    let size = frame.size();
    let mut digest = FingerprintBuilder::new();
    digest.pod(&[frame.shader().scene.view_fingerprint().0]).pod(&[size.width, size.height]);
    digest.finish()
}

impl<T: Value> Source<T> {
    /// The value at a point, its reach, and whether it is of this very point or `is_good` from around it; `step` is the
    /// distance of samples there, in pixels.
    pub(crate) fn take(
        &self,
        place: &Place,
        step: u32,
        is_good: impl Fn(&Nearby<T>) -> bool,
    ) -> Option<(T, f32, Reason)> {
        if let Some((value, reach)) = self.records.at(&place.surface) {
            return Some((value, reach, Reason::Reused));
        }
        let limit = step as f32 * place.pixel;
        let near = self.records.near(self.index.as_ref()?, &place.surface, limit)?;
        is_good(&near).then_some((near.value, near.reach, Reason::Nearby))
    }

    /// These records and those that a layer adds: all that was computed there.
    pub(crate) fn with(
        &self,
        layer: &Layer<T>,
        point: impl Fn(usize) -> Option<RecordPoint>,
    ) -> Records<T> {
        let is_new = |&i: &usize| layer.is_exact(i) && layer.reasons[i] != Reason::Reused;
        let new = (0..layer.values.len()).filter(is_new);
        self.records.with(new.filter_map(|i| Some((point(i)?, layer.values[i]))).collect())
    }

    /// These records and others.
    pub(crate) fn with_all(&self, others: Vec<(RecordPoint, T)>) -> Records<T> {
        self.records.with(others)
    }

    /// [`cache_map::refine`], but values are taken from the records if they can be. The pixels have these places.
    #[expect(
        clippy::too_many_arguments,
        reason = "those of what it extends, and where values come from"
    )]
    pub(crate) fn refine(
        &self,
        lattice: &Lattice,
        layer: &mut Layer<T>,
        coarsest: u32,
        rule: &impl Rule<T>,
        tolerance: Tolerance,
        place: impl Fn(usize) -> Option<Place> + Sync,
        account: &mut Account<'_, '_>,
        trace: impl Fn(&mut Account<'_, '_>, &[Pixel]) -> Result<Vec<T>, Interrupted>,
    ) -> Result<(), Interrupted> {
        let run = |layer: &mut Layer<T>, trace: &mut Trace<'_, T, Interrupted>| {
            refine(lattice, layer, coarsest, rule, tolerance, trace)
        };
        self.refine_by(run, lattice, layer, coarsest, rule, tolerance, place, account, trace)
    }

    /// The same, but `run` fills the layer: it says what to compute.
    #[expect(
        clippy::too_many_arguments,
        reason = "those of what it extends, and where values come from"
    )]
    pub(crate) fn refine_by(
        &self,
        run: impl FnOnce(&mut Layer<T>, &mut Trace<'_, T, Interrupted>) -> Result<(), Interrupted>,
        lattice: &Lattice,
        layer: &mut Layer<T>,
        coarsest: u32,
        rule: &impl Rule<T>,
        tolerance: Tolerance,
        place: impl Fn(usize) -> Option<Place> + Sync,
        account: &mut Account<'_, '_>,
        trace: impl Fn(&mut Account<'_, '_>, &[Pixel]) -> Result<Vec<T>, Interrupted>,
    ) -> Result<(), Interrupted> {
        let size = lattice.size();
        layer.forget_nearby();
        let mut taken = Vec::new();
        run(layer, &mut |pixels: &[Pixel]| {
            let take = |&pixel: &Pixel| {
                let i = size.index(pixel);
                let step = lattice.step(i).min(rule.spacing(pixel) as u32).min(coarsest);
                let place = place(i)?;
                let close = CLOSE * step as f32 * place.pixel;
                let is_good = |near: &Nearby<T>| near.is_within(i, close, rule, tolerance);
                let (value, _, reason) = self.take(&place, step, is_good)?;
                Some((value, Some(reason)))
            };
            let trace = |account: &mut Account<'_, '_>, pixels: &[Pixel]| {
                Ok(trace(account, pixels)?.into_iter().map(|value| (value, None)).collect())
            };
            let values = self.fill(account, pixels, take, trace)?;
            let reasons = pixels.iter().zip(&values).filter_map(|(&p, v)| Some((p, v.1?)));
            taken.extend(reasons.map(|(pixel, reason)| (size.index(pixel), reason)));
            Ok(values.into_iter().map(|v| v.0).collect())
        })?;
        taken.into_iter().for_each(|(i, reason)| layer.reasons[i] = reason);
        Ok(())
    }

    /// What `take` has for some items, and what `trace` computes for the others.
    pub(crate) fn fill<I: Copy + Sync, A: Send>(
        &self,
        account: &mut Account<'_, '_>,
        items: &[I],
        take: impl Fn(&I) -> Option<A> + Sync,
        trace: impl FnOnce(&mut Account<'_, '_>, &[I]) -> Result<Vec<A>, Interrupted>,
    ) -> Result<Vec<A>, Interrupted> {
        if self.records.is_empty() {
            return trace(account, items);
        }
        let taken = account.overhead(items, |item, _| take(item))?;
        let missing = items.iter().zip(&taken).filter(|t| t.1.is_none());
        let missing: Vec<I> = missing.map(|(&item, _)| item).collect();
        let mut traced = trace(account, &missing)?.into_iter();
        Ok(taken.into_iter().filter_map(|t| t.or_else(|| traced.next())).collect())
    }
}
