//! Coarse-to-fine interpolation with an embedded error pair.
//!
//! On each line a value is predicted twice, from two neighbours and from four; their difference bounds the error as an
//! embedded pair of an integrator does (it is a discrete second derivative). Where it is too large, where the two
//! lines disagree, or where the neighbours span an edge, the pixel is traced. Predictions read only coarser ranks, so
//! the order of work changes nothing.

use std::ops::{Add, Mul, Sub};

use base::{Pixel, Rgb};
use bytemuck::Pod;
use rayon::prelude::*;

use crate::lattice::{FAR_AFTER, FAR_BEFORE, Lattice, NEAR, Rank, lines, rank};

/// Something that can be interpolated, and saved as it lies in memory.
pub trait Value:
    Pod + Default + Send + Sync + Add<Output = Self> + Sub<Output = Self> + Mul<f32, Output = Self>
{
    /// How much of it there is: the luminance of its absolute value.
    fn size(self) -> f32;
    /// The nearest value that makes sense: none is negative.
    fn sound(self) -> Self;
}

/// Visibility.
impl Value for f32 {
    #[inline]
    fn size(self) -> f32 {
        self.abs()
    }
    #[inline]
    fn sound(self) -> Self {
        self.clamp(0.0, 1.0)
    }
}

/// Irradiance.
impl Value for Rgb {
    #[inline]
    fn size(self) -> f32 {
        self.map(f32::abs).luminance()
    }
    #[inline]
    fn sound(self) -> Self {
        self.map(|v| v.max(0.0))
    }
}

/// Why a pixel was traced, or why it didn't need to be. The numbers stand in the `reason.*` layers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Reason {
    /// It wasn't: it was interpolated, or needs no value.
    #[default]
    Interpolated = 0,
    /// It lies on the coarsest lattice, or the estimate there is too fine for a wider spacing.
    Lattice = 1,
    /// No line of neighbours lies on its surface.
    NoNeighbours = 2,
    /// The embedded pair differs too much.
    Error = 3,
    /// The neighbours differ too much: an edge.
    Edge = 4,
    /// A verification ray contradicted the interpolation, or a neighbour that was wrong.
    Verification = 5,
    /// It was held out to measure the error.
    HoldOut = 6,
    /// It wasn't: a saved record lies at this very point.
    Reused = 7,
    /// It wasn't: saved records around it agree what it is.
    Nearby = 8,
    /// The whole picture was computed: it is too small, or too cheap, for a cache to pay.
    Whole = 9,
}

impl Reason {
    /// All of them, in order.
    pub const ALL: [Self; 10] = [
        Self::Interpolated,
        Self::Lattice,
        Self::NoNeighbours,
        Self::Error,
        Self::Edge,
        Self::Verification,
        Self::HoldOut,
        Self::Reused,
        Self::Nearby,
        Self::Whole,
    ];

    /// Whether the value comes from saved records instead of being computed.
    pub fn is_reuse(self) -> bool {
        matches!(self, Self::Reused | Self::Nearby)
    }
}

/// A quantity at every pixel, with its history.
#[derive(Clone, Debug)]
pub struct Layer<T> {
    /// The values, row-major.
    pub values: Vec<T>,
    /// Why each was traced, or that it was interpolated.
    pub reasons: Vec<Reason>,
    /// The step from which each was predicted or at which it was traced, as a power of two.
    pub levels: Vec<u8>,
}

impl<T: Value> Layer<T> {
    /// A layer of zeros.
    pub fn new(n_pixels: usize) -> Self {
        Self {
            values: vec![T::default(); n_pixels],
            reasons: vec![Reason::default(); n_pixels],
            levels: vec![0; n_pixels],
        }
    }

    /// Whether the value was computed, now or before, or taken from records: it isn't interpolated from pixels.
    pub fn is_traced(&self, index: usize) -> bool {
        self.reasons[index] != Reason::Interpolated
    }

    /// Whether the value was computed at this very point, now or before.
    pub fn is_exact(&self, index: usize) -> bool {
        !matches!(self.reasons[index], Reason::Interpolated | Reason::Nearby)
    }

    /// Forgets what records around a pixel told, so that it is asked for again, perhaps more strictly.
    pub fn forget_nearby(&mut self) {
        for reason in self.reasons.iter_mut().filter(|r| **r == Reason::Nearby) {
            *reason = Reason::Interpolated;
        }
    }
}

/// What decides between interpolating and tracing.
pub trait Rule<T>: Sync {
    /// Radiance towards the eye, in luminance, for a value of size 1 at a pixel; 0 where the value doesn't matter.
    fn gain(&self, index: usize) -> f32;
    /// The luminance against which errors are measured at a pixel with this predicted value.
    fn reference(&self, index: usize, predicted: T) -> f32;
    /// The widest spacing from which a pixel may be predicted.
    fn spacing(&self, index: usize) -> u32;
}

/// How strict the decision is.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// Greatest error of the embedded pair, relative to the reference.
    pub error: f32,
    /// Greatest span of the neighbours, likewise.
    pub edge: f32,
}

enum Decision<T> {
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
    let mut settle =
        |layer: &mut Layer<T>, traced: Vec<(Pixel, Reason)>, h: u32| -> Result<(), E> {
            let pixels: Vec<Pixel> = traced.iter().map(|t| t.0).collect();
            let values = trace(&pixels)?;
            for ((pixel, reason), value) in traced.into_iter().zip(values) {
                let i = size.index(pixel);
                layer.values[i] = value;
                layer.reasons[i] = reason;
                layer.levels[i] = h.trailing_zeros() as u8;
            }
            Ok(())
        };

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
    settle(layer, coarse, coarsest)?;

    let mut h = coarsest / 2;
    while h >= 1 {
        for wanted in [Rank::Center, Rank::Midpoint] {
            let this = &*layer;
            let rows: Vec<u32> = (0..size.height).filter(|y| y % h == 0).collect();
            let decided: Vec<Vec<(Pixel, Decision<T>)>> = rows
                .par_iter()
                .map(|&y| {
                    // In a row of odd multiples of the step lie centers and midpoints, in one of even multiples midpoints.
                    let odd_row = y & h != 0;
                    let (first, step) = match (wanted, odd_row) {
                        (Rank::Center, true) | (Rank::Midpoint, false) => (h, 2 * h),
                        (Rank::Center, false) => return Vec::new(),
                        (Rank::Midpoint, true) => (0, 2 * h),
                    };
                    let mut decided = Vec::with_capacity((size.width / step) as usize + 1);
                    for x in (first..size.width).step_by(step as usize) {
                        debug_assert_eq!(rank(x, y), (h, wanted));
                        let pixel = Pixel { x, y };
                        let i = size.index(pixel);
                        if lattice.has_site(i) && !this.is_traced(i) {
                            let gain = rule.gain(i);
                            if gain > 0.0 {
                                decided.push((
                                    pixel,
                                    decide(lattice, this, i, (h, wanted), gain, rule, tolerance),
                                ));
                            }
                        }
                    }
                    decided
                })
                .collect();
            let mut traced = Vec::new();
            for (pixel, decision) in decided.into_iter().flatten() {
                match decision {
                    Decision::Trace(reason) => traced.push((pixel, reason)),
                    Decision::Take(value) => {
                        let i = size.index(pixel);
                        layer.values[i] = value;
                        layer.levels[i] = h.trailing_zeros() as u8;
                    }
                }
            }
            settle(layer, traced, h)?;
        }
        h /= 2;
    }
    Ok(())
}

#[inline]
fn decide<T: Value>(
    lattice: &Lattice,
    layer: &Layer<T>,
    i: usize,
    (h, rank): (u32, Rank),
    gain: f32,
    rule: &impl Rule<T>,
    tolerance: Tolerance,
) -> Decision<T> {
    if 2 * h > rule.spacing(i) {
        return Decision::Trace(Reason::Lattice);
    }
    let width = lattice.size().width as i64;
    let mask = lattice.mask(i);
    let mut predictions = [T::default(); 2];
    let mut n = 0;
    let (mut error, mut span) = (0.0_f32, 0.0_f32);
    for (line, (dx, dy)) in lines(rank).into_iter().enumerate() {
        let mask = mask >> (4 * line);
        if mask & NEAR != NEAR {
            continue;
        }
        let at = |steps: i64| {
            layer.values[(i as i64 + steps * i64::from(h) * (dx + dy * width)) as usize]
        };
        let (a, b) = (at(-1), at(1));
        let linear = (a + b) * 0.5;
        let cubic = match (mask & FAR_BEFORE != 0, mask & FAR_AFTER != 0) {
            (true, true) => (a + b) * (9.0 / 16.0) - (at(-3) + at(3)) * (1.0 / 16.0),
            (true, false) => a * (6.0 / 8.0) + b * (3.0 / 8.0) - at(-3) * (1.0 / 8.0),
            (false, true) => b * (6.0 / 8.0) + a * (3.0 / 8.0) - at(3) * (1.0 / 8.0),
            (false, false) => linear,
        };
        error = error.max((cubic - linear).size());
        span = span.max((a - b).size());
        predictions[n] = cubic;
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
