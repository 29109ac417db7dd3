//! The cells between the pixels that the cache works on, and the subpixels in them.

use base::{ImageSize, Pixel};
use cache_map::Value;

use crate::frame::Frame;

/// The cells of the coarse picture, each between four of its pixels.
#[derive(Clone, Copy)]
pub(super) struct Cells {
    pub(super) size: ImageSize,
    /// Subpixels of a pixel, each way.
    pub(super) n: u32,
}

impl Cells {
    /// Those of a frame, given the one that is thinned.
    pub(super) fn new(frame: &Frame<'_>, coarse: &Frame<'_>) -> Self {
        Self { size: coarse.size(), n: coarse.step() / frame.step() }
    }

    pub(super) fn n_subpixels(self) -> u32 {
        self.n * self.n
    }

    /// The corners of the cell that begins at a coarse pixel. At the border of the picture some are the same.
    #[inline]
    pub(super) fn corners(self, Pixel { x, y }: Pixel) -> [usize; 4] {
        let (right, below) = ((x + 1).min(self.size.width - 1), (y + 1).min(self.size.height - 1));
        [(x, y), (right, y), (x, below), (right, below)]
            .map(|(x, y)| self.size.index(Pixel { x, y }))
    }

    /// Whether a subpixel is one that the cache works on.
    pub(super) fn is_first(self, Pixel { x, y }: Pixel) -> bool {
        x.is_multiple_of(self.n) && y.is_multiple_of(self.n)
    }

    /// The subpixels around one, in a picture of so many.
    pub(super) fn beside(
        self,
        Pixel { x, y }: Pixel,
        size: ImageSize,
    ) -> impl Iterator<Item = Pixel> {
        let rows = y.saturating_sub(1)..(y + 2).min(size.height);
        let columns = x.saturating_sub(1)..(x + 2).min(size.width);
        rows.flat_map(move |y| columns.clone().map(move |x| Pixel { x, y }))
    }

    /// Where in its cell a subpixel lies, from 0 to 1 both ways.
    #[inline]
    pub(super) fn place(self, Pixel { x, y }: Pixel) -> [f32; 2] {
        [x, y].map(|at| (at % self.n) as f32 / self.n as f32)
    }

    /// The coarse pixels around a subpixel of which something holds.
    pub(super) fn around(
        self,
        subpixel: Pixel,
        is_shown: impl Fn(usize) -> bool,
    ) -> Option<Corners> {
        let Pixel { x, y } = subpixel;
        let cell = self.corners(Pixel { x: x / self.n, y: y / self.n });
        Corners::new(&cell, bilinear(self.place(subpixel)), is_shown)
    }
}

/// The pixels of the coarse picture around a subpixel that show its surface, with weights that sum to 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corners {
    at: [usize; 4],
    weights: [f32; 4],
    n: usize,
    /// Whether none of those around it was left out.
    pub(super) is_whole: bool,
}

impl Corners {
    /// Of the corners of a cell those that `is_shown` says show the surface of a subpixel in it, for which they have these
    /// weights; nothing if none does.
    #[inline]
    pub(super) fn new(
        cell: &[usize; 4],
        weights: [f32; 4],
        is_shown: impl Fn(usize) -> bool,
    ) -> Option<Self> {
        let mut corners = Self { at: [0; 4], weights: [0.0; 4], n: 0, is_whole: true };
        let mut sum = 0.0;
        for (&at, weight) in cell.iter().zip(weights) {
            if weight > 0.0 {
                if is_shown(at) {
                    (corners.at[corners.n], corners.weights[corners.n]) = (at, weight);
                    corners.n += 1;
                    sum += weight;
                } else {
                    corners.is_whole = false;
                }
            }
        }
        if !corners.is_whole {
            corners.weights.iter_mut().for_each(|weight| *weight /= sum);
        }
        (corners.n > 0).then_some(corners)
    }

    /// The first of them.
    pub(super) fn first(&self) -> usize {
        self.at[0]
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, f32)> {
        self.at[..self.n].iter().copied().zip(self.weights)
    }

    /// The value in between.
    #[inline]
    pub(super) fn blend<T: Value>(&self, of: impl Fn(usize) -> T) -> T {
        self.iter().fold(T::default(), |sum, (at, weight)| sum + of(at) * weight)
    }

    /// How far the values differ.
    #[inline]
    pub(super) fn span<T: Value>(&self, of: impl Fn(usize) -> T) -> f32 {
        let first = of(self.at[0]);
        self.at[1..self.n].iter().map(|&at| (of(at) - first).size()).fold(0.0, f32::max)
    }
}

/// The weights of the corners of a cell at a place in it.
#[inline]
pub(super) fn bilinear([x, y]: [f32; 2]) -> [f32; 4] {
    [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y]
}
