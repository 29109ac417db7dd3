//! Coarse-to-fine interpolation with an embedded error pair.
//!
//! On each line a value is predicted twice, from two neighbours and from four; their difference bounds the error as an
//! embedded pair of an integrator does (it is a discrete second derivative). Where it is too large, where the two
//! lines disagree, or where the neighbours span an edge, the pixel is traced. Predictions read only coarser ranks, so
//! the order of work changes nothing.

use std::f32::consts::SQRT_2;
use std::ops::{Add, Mul, Sub};

use base::{ImageSize, Pixel};
use rayon::prelude::*;

use crate::calm::{is_calm, sees_traced_center};
use crate::lattice::{BLOCK, FAR_AFTER, FAR_BEFORE, Lattice, NEAR, Rank, lines, rank as rank_of};
use crate::layer::{Layer, Reason, Value};

/// What decides between interpolating and tracing.
pub trait Rule<T>: Sync {
    /// Radiance towards the eye, in luminance, for a value of size 1 at a pixel; 0 where the value doesn't matter.
    fn gain(&self, index: usize) -> f32;
    /// The luminance against which errors are measured at a pixel with this predicted value.
    fn reference(&self, index: usize, predicted: T) -> f32;
    /// The widest spacing, in pixels, of samples from which a pixel may be predicted: the same in each square of 16 pixels a
    /// side that starts at a multiple of that. Samples can lie powers of the square root of two apart.
    fn spacing(&self, pixel: Pixel) -> f32;
}

/// How strict the decision is.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// Greatest error of the embedded pair, relative to the reference.
    pub error: f32,
    /// Greatest span of the neighbours, likewise.
    pub edge: f32,
}

pub(crate) enum Decision<T> {
    Trace(Reason),
    Take(T),
}

/// Computes values at pixels.
pub type Trace<'x, T, E> = dyn FnMut(&[Pixel]) -> Result<Vec<T>, E> + 'x;

/// Fills a layer from a lattice of spacing `coarsest` (a power of two) down to every pixel. Pixels that are traced
/// already keep their values. `trace` computes values at the pixels that it is given.
///
/// # Errors
/// Those of `trace`.
pub fn refine<T: Value, E>(
    lattice: &Lattice,
    layer: &mut Layer<T>,
    coarsest: u32,
    rule: &impl Rule<T>,
    tolerance: Tolerance,
    trace: &mut Trace<'_, T, E>,
) -> Result<(), E> {
    let size = lattice.size();
    // The coarsest lattice is traced, but for pixels where the value doesn't matter.
    let mut coarse = Vec::new();
    for y in (0..size.height).step_by(coarsest as usize) {
        for x in (0..size.width).step_by(coarsest as usize) {
            let pixel = Pixel { x, y };
            let i = size.index(pixel);
            if lattice.has_site(i) && rule.gain(i) > 0.0 && !layer.is_traced(i) {
                coarse.push((pixel, Reason::Lattice));
            }
        }
    }
    settle(layer, lattice, coarsest, coarse, trace)?;

    let mut h = coarsest / 2;
    while h >= 1 {
        let mut calm = vec![false; lattice.n_blocks()];
        for rank in [Rank::Center, Rank::Midpoint] {
            let pass = Pass { lattice, tolerance, h, rank };
            pass.find_calm(layer, rule, &mut calm);
            let to_trace = pass.predict(layer, rule, &calm);
            settle(layer, lattice, coarsest, to_trace, trace)?;
        }
        h /= 2;
    }
    Ok(())
}

/// Computes the values of pixels.
pub(crate) fn settle<T: Value, E>(
    layer: &mut Layer<T>,
    lattice: &Lattice,
    coarsest: u32,
    traced: Vec<(Pixel, Reason)>,
    trace: &mut Trace<'_, T, E>,
) -> Result<(), E> {
    let pixels: Vec<Pixel> = traced.iter().map(|t| t.0).collect();
    let values = trace(&pixels)?;
    for ((pixel, reason), value) in traced.into_iter().zip(values) {
        let i = lattice.size().index(pixel);
        layer.values[i] = value;
        layer.reasons[i] = reason;
        layer.levels[i] = lattice.step(i).min(coarsest).trailing_zeros() as u8;
    }
    Ok(())
}

/// Keeps what was predicted, in rows from the first on and so far apart, from neighbours `step` away. The others are to be
/// traced.
pub(crate) fn keep<T: Value>(
    layer: &mut Layer<T>,
    size: ImageSize,
    (first, apart): (u32, u32),
    rows: Vec<Row<T>>,
    step: u32,
) -> Vec<(Pixel, Reason)> {
    let width = size.width as usize;
    let (first, apart) = ((first as usize * width).min(size.n_pixels()), apart as usize * width);
    let values = layer.values[first..].par_chunks_mut(apart);
    let values = values.zip(layer.levels[first..].par_chunks_mut(apart));
    values.zip(&rows).for_each(|((values, levels), row)| {
        for &(x, value) in &row.predicted {
            (values[x as usize], levels[x as usize]) = (value, step.trailing_zeros() as u8);
        }
    });
    rows.into_iter().flat_map(|row| row.to_trace).collect()
}

/// The prediction of all pixels of a rank.
#[derive(Clone, Copy)]
struct Pass<'x> {
    lattice: &'x Lattice,
    tolerance: Tolerance,
    h: u32,
    rank: Rank,
}

/// What a row has of a rank.
pub(crate) struct Row<T> {
    /// By column.
    pub(crate) predicted: Vec<(u32, T)>,
    pub(crate) to_trace: Vec<(Pixel, Reason)>,
}

impl Pass<'_> {
    /// Finds the blocks without structure: for centers among all, for midpoints among those of the centers.
    fn find_calm<T: Value>(self, layer: &Layer<T>, rule: &impl Rule<T>, calm: &mut [bool]) {
        let Self { lattice, tolerance, h, rank } = self;
        calm.par_iter_mut().with_min_len(64).enumerate().for_each(|(i, calm)| {
            let block = lattice.block(i);
            *calm = match rank {
                Rank::Center => is_calm(lattice, layer, rule, tolerance, h, block),
                Rank::Midpoint => *calm && !sees_traced_center(lattice, layer, h, block),
            };
        });
    }

    /// Predicts the pixels that can be predicted. The others are to be traced.
    fn predict<T: Value>(
        self,
        layer: &mut Layer<T>,
        rule: &impl Rule<T>,
        calm: &[bool],
    ) -> Vec<(Pixel, Reason)> {
        let (size, h, this) = (self.lattice.size(), self.h, &*layer);
        let rows = (0..size.height).into_par_iter().step_by(h as usize);
        let rows: Vec<Row<T>> = rows.map(|y| self.row(this, rule, y, calm)).collect();
        keep(layer, size, (0, h), rows, h)
    }

    fn row<T: Value>(self, layer: &Layer<T>, rule: &impl Rule<T>, y: u32, calm: &[bool]) -> Row<T> {
        let Self { lattice, h, rank, .. } = self;
        let width = lattice.size().width;
        // In a row of odd multiples of the step lie centers and midpoints, in one of even multiples midpoints.
        let (first, step) = match (rank, y & h != 0) {
            (Rank::Center, true) | (Rank::Midpoint, false) => (h, 2 * h),
            (Rank::Center, false) => (width, 2 * h),
            (Rank::Midpoint, true) => (0, 2 * h),
        };
        let calm = &calm[lattice.blocks_of_row(y)];
        let empty = lattice.empty_blocks_of_row(y);
        let n_full = empty.iter().filter(|is_empty| !**is_empty).count() as u32;
        let mut predicted = Vec::with_capacity((n_full * BLOCK).div_ceil(step) as usize);
        let mut to_trace = Vec::new();
        // What was predicted from a pixel on, up to the end of its block.
        let (mut start, mut end) = (0, 0);
        let mut stretch = [T::default(); BLOCK as usize];
        for x in (first..width).step_by(step as usize) {
            if empty[(x / BLOCK) as usize] {
                continue;
            }
            debug_assert_eq!(rank_of(x, y), (h, rank));
            let pixel = Pixel { x, y };
            let i = lattice.size().index(pixel);
            if !lattice.has_site(i) || layer.is_traced(i) {
                continue;
            }
            let gain = rule.gain(i);
            if gain > 0.0 {
                let decision = if calm[(x / BLOCK) as usize] {
                    if x >= end {
                        (start, end) = (x, x / BLOCK * BLOCK + BLOCK);
                        let last = (end - 1 - start) / step * step;
                        self.even(layer, i, &mut stretch[..=last as usize]);
                    }
                    Decision::Take(stretch[(x - start) as usize].sound())
                } else {
                    self.decide(layer, rule, pixel, gain)
                };
                match decision {
                    Decision::Take(value) => predicted.push((x, value)),
                    Decision::Trace(reason) => to_trace.push((pixel, reason)),
                }
            }
        }
        Row { predicted, to_trace }
    }

    /// The predictions for a stretch of pixels, from one on that is of the rank to another, which have all their neighbours,
    /// without tests. Pixels of other ranks between them are treated likewise, to no use: numbers that lie side by side are
    /// worked on several at a time.
    #[inline]
    fn even<T: Value>(self, layer: &Layer<T>, first: usize, stretch: &mut [T]) {
        let n = stretch.len();
        let [first, second] = lines(self.rank).map(|direction| {
            [-3, -1, 1, 3].map(|steps| {
                let from = self.neighbour(first, direction, steps);
                bytemuck::cast_slice::<T, f32>(&layer.values[from..from + n])
            })
        });
        let along =
            |[before, a, b, after]: [&[f32]; 4], k: usize| cubic(before[k], a[k], b[k], after[k]);
        let stretch = bytemuck::cast_slice_mut::<T, f32>(stretch);
        let n = stretch.len();
        let [first, second] = [first, second].map(|line| line.map(|values| &values[..n]));
        for (k, value) in stretch.iter_mut().enumerate() {
            *value = (along(first, k) + along(second, k)) * 0.5;
        }
    }

    /// The pixel that lies so many steps away on a line.
    #[inline]
    fn neighbour(self, i: usize, (dx, dy): (i64, i64), steps: i64) -> usize {
        let width = i64::from(self.lattice.size().width);
        (i as i64 + steps * i64::from(self.h) * (dx + dy * width)) as usize
    }

    #[inline]
    fn decide<T: Value>(
        self,
        layer: &Layer<T>,
        rule: &impl Rule<T>,
        pixel: Pixel,
        gain: f32,
    ) -> Decision<T> {
        let Self { lattice, tolerance, h, rank } = self;
        if spacing(h, rank) > rule.spacing(pixel) {
            return Decision::Trace(Reason::Lattice);
        }
        let i = lattice.size().index(pixel);
        let mask = lattice.mask(i);
        let mut predictions = [T::default(); 2];
        let mut n = 0;
        let (mut error, mut span) = (0.0_f32, 0.0_f32);
        for (line, direction) in lines(rank).into_iter().enumerate() {
            let mask = mask >> (4 * line);
            let at = |steps| layer.values[self.neighbour(i, direction, steps)];
            let Some(line) = Line::new(mask, at) else { continue };
            (error, span) = (error.max(line.error), span.max(line.span));
            predictions[n] = line.predicted;
            n += 1;
        }
        let predicted = match n {
            0 => return Decision::Trace(Reason::NoNeighbours),
            1 => predictions[0],
            _ => {
                error = error.max((predictions[0] - predictions[1]).size());
                (predictions[0] + predictions[1]) * 0.5
            }
        };
        let predicted = predicted.sound();
        let limit = rule.reference(i, predicted);
        if gain * error > tolerance.error * limit {
            Decision::Trace(Reason::Error)
        } else if gain * span > tolerance.edge * limit {
            Decision::Trace(Reason::Edge)
        } else {
            Decision::Take(predicted)
        }
    }
}

/// What neighbours on a line through a pixel tell.
pub(crate) struct Line<T> {
    pub(crate) predicted: T,
    /// The difference of the embedded pair.
    pub(crate) error: f32,
    /// The difference of the two that are near.
    pub(crate) span: f32,
    /// The difference of what lies straight on from the two before and the two behind: as large as the span where an edge lies
    /// between, of third order elsewhere. 0 if one of the far ones is missing.
    pub(crate) jump: f32,
}

impl<T: Value> Line<T> {
    /// Of the neighbours that a mask names, at these steps; nothing if one of the near ones is missing.
    #[inline]
    pub(crate) fn new(mask: u8, at: impl Fn(i64) -> T) -> Option<Self> {
        if mask & NEAR != NEAR {
            return None;
        }
        let (a, b) = (at(-1), at(1));
        let linear = (a + b) * 0.5;
        let mut jump = 0.0;
        let predicted = match (mask & FAR_BEFORE != 0, mask & FAR_AFTER != 0) {
            (true, true) => {
                let (before, after) = (at(-3), at(3));
                jump = ((a - b) * 1.5 - (before - after) * 0.5).size();
                cubic(before, a, b, after)
            }
            (true, false) => a * (6.0 / 8.0) + b * (3.0 / 8.0) - at(-3) * (1.0 / 8.0),
            (false, true) => b * (6.0 / 8.0) + a * (3.0 / 8.0) - at(3) * (1.0 / 8.0),
            (false, false) => linear,
        };
        Some(Self { predicted, error: (predicted - linear).size(), span: (a - b).size(), jump })
    }
}

/// The spacing of all pixels that are coarser than those of a rank. Those of steps from `2 h` form squares of that side; with
/// the centers among them it is the root of two finer.
fn spacing(h: u32, rank: Rank) -> f32 {
    match rank {
        Rank::Center => 2.0 * h as f32,
        Rank::Midpoint => SQRT_2 * h as f32,
    }
}

/// The value in the middle of four that lie evenly on a line.
#[inline]
fn cubic<T>(before: T, a: T, b: T, after: T) -> T
where
    T: Add<Output = T> + Sub<Output = T> + Mul<f32, Output = T>,
{
    (a + b) * (9.0 / 16.0) - (before + after) * (1.0 / 16.0)
}
