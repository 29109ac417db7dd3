//! Pixels and row-major grids of them.

use serde::{Deserialize, Serialize};

use crate::Window;

/// Width and height of a picture, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct ImageSize {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl ImageSize {
    /// The number of pixels.
    pub fn n_pixels(self) -> usize {
        self.width as usize * self.height as usize
    }

    /// All pixels, row by row.
    pub fn pixels(self) -> impl Iterator<Item = Pixel> {
        (0..self.height).flat_map(move |y| (0..self.width).map(move |x| Pixel { x, y }))
    }

    /// The pixel at a row-major index.
    #[inline]
    pub fn pixel(self, index: usize) -> Pixel {
        let width = self.width as usize;
        Pixel { x: (index % width) as u32, y: (index / width) as u32 }
    }

    /// The row-major index of a pixel.
    #[inline]
    pub fn index(self, pixel: Pixel) -> usize {
        pixel.y as usize * self.width as usize + pixel.x as usize
    }
}

/// A pixel; (0, 0) is the upper left corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Pixel {
    /// Column, from the left.
    pub x: u32,
    /// Row, from the top.
    pub y: u32,
}

/// A value per pixel, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<T> {
    size: ImageSize,
    values: Vec<T>,
}

impl<T> Grid<T> {
    /// `f` of each pixel.
    pub fn from_fn(size: ImageSize, mut f: impl FnMut(Pixel) -> T) -> Self {
        let mut values = Vec::with_capacity(size.n_pixels());
        size.pixels().for_each(|pixel| values.push(f(pixel)));
        Self { size, values }
    }

    /// The values in row-major order.
    ///
    /// # Panics
    /// When there are not as many values as pixels.
    pub fn from_values(size: ImageSize, values: Vec<T>) -> Self {
        assert_eq!(values.len(), size.n_pixels(), "a grid needs a value per pixel");
        Self { size, values }
    }

    /// The values in window `to`, of a grid that holds those in window `from`.
    ///
    /// # Panics
    /// When the grid isn't of the size of `from`, or `to` doesn't lie within it.
    pub fn cut(&self, from: Window, to: Window) -> Self
    where
        T: Clone,
    {
        assert_eq!(self.size, from.size, "a grid of the window");
        let (x, y) = (to.corner.x - from.corner.x, to.corner.y - from.corner.y);
        let mut values = Vec::with_capacity(to.size.n_pixels());
        for y in y..y + to.size.height {
            let start = self.size.index(Pixel { x, y });
            values.extend_from_slice(&self.values[start..start + to.size.width as usize]);
        }
        Self::from_values(to.size, values)
    }

    /// Width and height.
    pub fn size(&self) -> ImageSize {
        self.size
    }

    /// The values in row-major order.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// The values in row-major order, to be changed.
    pub fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    /// The value at a pixel, if it lies inside.
    #[inline]
    pub fn get(&self, at: Pixel) -> Option<&T> {
        (at.x < self.size.width && at.y < self.size.height)
            .then(|| &self.values[self.size.index(at)])
    }
}

impl<T> std::ops::Index<Pixel> for Grid<T> {
    type Output = T;
    #[inline]
    fn index(&self, at: Pixel) -> &T {
        &self.values[self.size.index(at)]
    }
}

impl<T> std::ops::IndexMut<Pixel> for Grid<T> {
    #[inline]
    fn index_mut(&mut self, at: Pixel) -> &mut T {
        let index = self.size.index(at);
        &mut self.values[index]
    }
}
