//! A rectangle of a picture.

use crate::{ImageSize, Pixel};

/// Some columns and rows of a picture. What lies in a window counts its pixels from the corner of the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Window {
    /// The upper left pixel, in the whole picture.
    pub corner: Pixel,
    /// Columns and rows.
    pub size: ImageSize,
    /// Of the whole picture.
    pub whole: ImageSize,
}

impl Window {
    /// All of a picture.
    pub fn whole(whole: ImageSize) -> Self {
        Self { corner: Pixel { x: 0, y: 0 }, size: whole, whole }
    }

    /// Whether it is the whole picture.
    pub fn is_whole(&self) -> bool {
        self.size == self.whole
    }

    /// The columns from `x` up to `end_x`, the rows from `y` up to `end_y`; nothing if there are none, or they lie outside.
    pub fn new([x, end_x, y, end_y]: [u32; 4], whole: ImageSize) -> Option<Self> {
        let is_inside = x < end_x && y < end_y && end_x <= whole.width && end_y <= whole.height;
        let size = || ImageSize { width: end_x - x, height: end_y - y };
        is_inside.then(|| Self { corner: Pixel { x, y }, size: size(), whole })
    }

    /// First column, the one after the last, first row, the one after the last.
    pub fn bounds(&self) -> [u32; 4] {
        let Self { corner: Pixel { x, y }, size: ImageSize { width, height }, .. } = *self;
        [x, x + width, y, y + height]
    }

    /// The pixel of the whole picture that is pixel `at` of the window.
    #[inline]
    pub fn in_whole(&self, at: Pixel) -> Pixel {
        Pixel { x: self.corner.x + at.x, y: self.corner.y + at.y }
    }

    /// The window with `margin` more pixels on each side, as far as the picture goes.
    pub fn grown(&self, margin: u32) -> Self {
        let [x, end_x, y, end_y] = self.bounds();
        self.with_bounds([
            x.saturating_sub(margin),
            end_x.saturating_add(margin),
            y.saturating_sub(margin),
            end_y.saturating_add(margin),
        ])
    }

    /// The smallest window around this one whose borders lie at multiples of `step`, or at the border of the picture.
    pub fn aligned(&self, step: u32) -> Self {
        let up = |end: u32| end.div_ceil(step).saturating_mul(step);
        let [x, end_x, y, end_y] = self.bounds();
        self.with_bounds([x / step * step, up(end_x), y / step * step, up(end_y)])
    }

    /// The same with `n` x `n` pixels in place of each.
    pub fn subdivided(&self, n: u32) -> Self {
        let times = |size: ImageSize| ImageSize { width: size.width * n, height: size.height * n };
        Self {
            corner: Pixel { x: self.corner.x * n, y: self.corner.y * n },
            size: times(self.size),
            whole: times(self.whole),
        }
    }

    fn with_bounds(&self, [x, end_x, y, end_y]: [u32; 4]) -> Self {
        let (end_x, end_y) = (end_x.min(self.whole.width), end_y.min(self.whole.height));
        let size = ImageSize { width: end_x - x, height: end_y - y };
        Self { corner: Pixel { x, y }, size, whole: self.whole }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_grow_up_to_the_border() {
        let whole = ImageSize { width: 100, height: 70 };
        let window = |bounds| Window::new(bounds, whole).unwrap();
        assert_eq!(window([10, 20, 0, 70]).grown(4).bounds(), [6, 24, 0, 70]);
        assert_eq!(window([10, 20, 65, 66]).aligned(64).bounds(), [0, 64, 64, 70]);
        assert_eq!(window([10, 20, 5, 6]).subdivided(3).bounds(), [30, 60, 15, 18]);
        assert!(window([0, 100, 0, 70]).is_whole());
        for outside in [[10, 10, 0, 1], [0, 101, 0, 1], [0, 1, 0, 71], [5, 4, 0, 1]] {
            assert_eq!(Window::new(outside, whole), None);
        }
    }
}
