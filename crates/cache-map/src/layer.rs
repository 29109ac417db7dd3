//! A quantity at every pixel.

use std::ops::{Add, Mul, Sub};

use base::Rgb;
use bytemuck::Pod;

/// Something that can be interpolated, and saved as it lies in memory: one number or several, each on its own.
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

    /// Whether the value was computed, now or before, or taken from records.
    #[inline]
    pub fn is_traced(self) -> bool {
        self != Self::Interpolated
    }

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
        self.reasons[index].is_traced()
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
