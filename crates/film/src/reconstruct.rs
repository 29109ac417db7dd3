//! From subpixels to pixels.

use base::{Grid, ImageSize, Pixel, Rgb, math};
use rayon::prelude::*;

/// How much the subpixels around the middle of a pixel count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// Those of the pixel, all the same.
    #[default]
    Box,
    /// Less in proportion to the distance, up to a pixel.
    Tent,
    /// By a normal distribution with a standard deviation of half a pixel, up to 1.5 pixels.
    Gaussian,
    /// By the cubics of Mitchell and Netravali 1988, with B = C = 1/3, up to two pixels. Some of them are negative:
    /// edges become sharp, and very bright ones ring.
    Mitchell,
}

impl Filter {
    /// As the command line has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Tent => "tent",
            Self::Gaussian => "gaussian",
            Self::Mitchell => "mitchell",
        }
    }

    /// How many pixels on each side of a pixel the filter looks at.
    pub fn margin(self) -> u32 {
        (self.radius() - 0.5).ceil() as u32
    }

    /// How far the filter reaches, in pixels.
    fn radius(self) -> f32 {
        match self {
            Self::Box => 0.5,
            Self::Tent => 1.0,
            Self::Gaussian => 1.5,
            Self::Mitchell => 2.0,
        }
    }

    /// The weight at a distance along one axis, in pixels, but for a factor.
    fn weight(self, x: f32) -> f32 {
        let x = x.abs();
        match self {
            Self::Box => 1.0,
            Self::Tent => 1.0 - x,
            Self::Gaussian => math::exp(-2.0 * x * x),
            Self::Mitchell if x < 1.0 => (7.0 * x - 12.0) * x * x + 16.0 / 3.0,
            Self::Mitchell => ((-7.0 / 3.0 * x + 12.0) * x - 20.0) * x + 32.0 / 3.0,
        }
    }

    /// The weights of the subpixels around the middle of a pixel along one axis, and the offset of the first from the
    /// pixel's own first.
    fn taps(self, n: u32) -> (i64, Vec<f32>) {
        let n = i64::from(n);
        let middle = n as f32 * 0.5;
        let reach = (self.radius() * n as f32 + 0.5).ceil() as i64;
        let place = |i: i64| (i as f32 + 0.5 - middle) / n as f32;
        let inside: Vec<i64> =
            (-reach..n + reach).filter(|&i| place(i).abs() < self.radius()).collect();
        (inside[0], inside.iter().map(|&i| self.weight(place(i))).collect())
    }
}

/// The picture of pixels that consist of `n` x `n` subpixels each. Beyond its border there is nothing: weights are
/// divided by the sum of those inside.
///
/// # Panics
/// When a side isn't a multiple of `n`.
pub fn reconstruct(subpixels: &Grid<Rgb>, n: u32, filter: Filter) -> Grid<Rgb> {
    let fine = subpixels.size();
    let is_whole = fine.width.is_multiple_of(n) && fine.height.is_multiple_of(n);
    assert!(is_whole, "{fine:?} in parts of {n}");
    let size = ImageSize { width: fine.width / n, height: fine.height / n };
    let (first, weights) = filter.taps(n);
    // First along rows, then along columns.
    let narrow: Vec<Rgb> = (0..fine.height as usize * size.width as usize)
        .into_par_iter()
        .with_min_len(4096)
        .map(|i| {
            let (x, y) = ((i % size.width as usize) as i64, (i / size.width as usize) as u32);
            gather(x * i64::from(n) + first, &weights, fine.width, |x| subpixels[Pixel { x, y }])
        })
        .collect();
    let pixels = (0..size.n_pixels())
        .into_par_iter()
        .with_min_len(4096)
        .map(|i| {
            let Pixel { x, y } = size.pixel(i);
            let at = |y: u32| narrow[y as usize * size.width as usize + x as usize];
            gather(i64::from(y) * i64::from(n) + first, &weights, fine.height, at)
        })
        .collect();
    Grid::from_values(size, pixels)
}

/// The weighted mean of what lies inside.
fn gather(first: i64, weights: &[f32], end: u32, at: impl Fn(u32) -> Rgb) -> Rgb {
    let (mut sum, mut total) = (Rgb::BLACK, 0.0);
    for (i, &weight) in (first..).zip(weights) {
        if (0..i64::from(end)).contains(&i) {
            sum += at(i as u32) * weight;
            total += weight;
        }
    }
    sum / total
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Filter; 4] = [Filter::Box, Filter::Tent, Filter::Gaussian, Filter::Mitchell];

    fn size(width: u32, height: u32) -> ImageSize {
        ImageSize { width, height }
    }

    #[test]
    fn what_is_even_stays() {
        for filter in ALL {
            for n in 1..5 {
                let even = Grid::from_fn(size(7 * n, 3 * n), |_| Rgb::new(0.25, 1.0, 3.0));
                for value in reconstruct(&even, n, filter).values() {
                    let error = (*value - Rgb::new(0.25, 1.0, 3.0)).map(f32::abs).max_channel();
                    assert!(error < 1e-6, "{filter:?} {n}: {value:?}");
                }
            }
        }
    }

    #[test]
    fn one_subpixel_in_a_box_is_the_pixel_itself() {
        let picture = Grid::from_fn(size(5, 4), |p| Rgb::splat((p.x * 7 + p.y) as f32 * 0.1));
        assert_eq!(reconstruct(&picture, 1, Filter::Box).values(), picture.values());
        assert_eq!(reconstruct(&picture, 1, Filter::Tent).values(), picture.values());
    }

    #[test]
    fn a_box_is_the_mean() {
        let picture = Grid::from_fn(size(4, 2), |p| Rgb::splat((p.x + 10 * p.y) as f32));
        let values: Vec<f32> =
            reconstruct(&picture, 2, Filter::Box).values().iter().map(|v| v.r).collect();
        assert_eq!(values, [5.5, 7.5]);
    }

    #[test]
    fn a_ramp_stays_a_ramp_away_from_the_border() {
        // All are symmetric, so the mean place is the middle.
        for filter in ALL {
            let n = 3;
            let ramp =
                Grid::from_fn(size(11 * n, n), |p| Rgb::splat((p.x as f32 + 0.5) / n as f32));
            let row = reconstruct(&ramp, n, filter);
            for x in 2..9 {
                let value = row[Pixel { x, y: 0 }].g;
                assert!((value - (x as f32 + 0.5)).abs() < 1e-5, "{filter:?} at {x}: {value}");
            }
        }
    }

    #[test]
    fn wider_filters_reach_farther() {
        let n = 4;
        let spot = Grid::from_fn(size(7 * n, 7 * n), |p| {
            if p.x / n == 3 && p.y / n == 3 { Rgb::ONE } else { Rgb::BLACK }
        });
        let beside = |filter| reconstruct(&spot, n, filter)[Pixel { x: 4, y: 3 }].g;
        assert_eq!(beside(Filter::Box), 0.0);
        assert!(beside(Filter::Tent) > 0.05 && beside(Filter::Gaussian) > 0.05);
        let two_away = |filter| reconstruct(&spot, n, filter)[Pixel { x: 5, y: 3 }].g;
        assert_eq!(two_away(Filter::Tent), 0.0);
        assert!(two_away(Filter::Mitchell) < 0.0, "the negative part");
    }
}
