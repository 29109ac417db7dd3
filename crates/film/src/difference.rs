//! Two pictures compared by numbers.

use base::{Grid, Pixel, Rgb};
use serde::Serialize;

use crate::Error;
use crate::flip::{check_comparable, flip};

/// How much two pictures differ. All but `flip` are of the linear values, over pixels and channels alike.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Mean of |a - b|.
    pub mean_abs: f64,
    /// Root of the mean of (a - b)^2.
    pub rms: f64,
    /// Mean of (a - b)^2 / (b^2 + 0.01), b the reference.
    pub rel_mse: f64,
    /// Largest |a - b|.
    pub peak: f32,
    /// The first pixel where that is reached.
    pub peak_pixel: Pixel,
    /// What a viewer sees.
    pub flip: FlipStats,
}

/// A FLIP map in numbers, each in [0, 1]. The mean alone says little of broken edges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FlipStats {
    /// Mean over all pixels.
    pub mean: f64,
    /// The least value that at least 99 % of the pixels do not exceed.
    pub p99: f64,
    /// Largest mean of a block of 8x8 pixels. The blocks tile the picture from its upper left corner; those cut by
    /// the right and lower border count like whole ones.
    pub worst_block_8x8: f64,
    /// Share of the pixels above 0.1.
    pub share_above_0_1: f64,
}

/// Compares `a` with the reference `b`. Returns the FLIP map as well.
///
/// The exposure, in stops, is for FLIP alone, see [`flip`].
///
/// # Errors
/// When the sizes differ, when a value is NaN or infinite, or when there are no pixels.
pub fn compare(
    a: &Grid<Rgb>,
    b: &Grid<Rgb>,
    exposure_ev: f32,
) -> Result<(Difference, Grid<f32>), Error> {
    check_comparable(a, b)?;
    let map = flip(a, b, exposure_ev)?;
    let (mut sum_abs, mut sum_square, mut sum_relative) = (0.0, 0.0, 0.0);
    let (mut peak, mut peak_index) = (0.0, 0);
    for (index, (a, b)) in a.values().iter().zip(b.values()).enumerate() {
        for (a, b) in a.to_array().into_iter().zip(b.to_array()) {
            let (a, b) = (f64::from(a), f64::from(b));
            let (abs, square) = ((a - b).abs(), (a - b) * (a - b));
            sum_abs += abs;
            sum_square += square;
            sum_relative += square / (b * b + 0.01);
            if abs > peak {
                (peak, peak_index) = (abs, index);
            }
        }
    }
    let n = 3.0 * a.values().len() as f64;
    let difference = Difference {
        mean_abs: sum_abs / n,
        rms: (sum_square / n).sqrt(),
        rel_mse: sum_relative / n,
        peak: peak as f32,
        peak_pixel: a.size().pixel(peak_index),
        flip: FlipStats::of(&map),
    };
    Ok((difference, map))
}

impl FlipStats {
    /// The numbers of a map.
    ///
    /// # Panics
    /// When the map has no pixels.
    pub fn of(map: &Grid<f32>) -> Self {
        let n = map.values().len();
        assert!(n > 0, "a map without pixels has no statistics");
        let mean = map.values().iter().map(|&v| f64::from(v)).sum::<f64>() / n as f64;
        let mut sorted = map.values().to_vec();
        let rank = (n * 99).div_ceil(100).saturating_sub(1);
        let (_, &mut p99, _) = sorted.select_nth_unstable_by(rank, f32::total_cmp);
        let n_above = map.values().iter().filter(|&&v| v > 0.1).count();
        Self {
            mean,
            p99: f64::from(p99),
            worst_block_8x8: worst_block(map),
            share_above_0_1: n_above as f64 / n as f64,
        }
    }
}

fn worst_block(map: &Grid<f32>) -> f64 {
    const SIDE: usize = 8;
    let width = map.size().width as usize;
    let mut worst = 0.0_f64;
    for lines in map.values().chunks(SIDE * width) {
        for x in (0..width).step_by(SIDE) {
            let block_width = SIDE.min(width - x);
            let block = lines.chunks(width).flat_map(|line| &line[x..x + block_width]);
            let n = block_width * (lines.len() / width);
            worst = worst.max(block.map(|&v| f64::from(v)).sum::<f64>() / n as f64);
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use base::ImageSize;

    use super::*;

    const SIZE: ImageSize = ImageSize { width: 21, height: 10 };

    #[test]
    fn identical_pictures_differ_by_exactly_nothing() {
        let picture = Grid::from_fn(SIZE, |p| Rgb::new(p.x as f32 * 0.3, p.y as f32 * 0.01, 0.5));
        let (difference, map) = compare(&picture, &picture, 0.0).unwrap();
        let flip = FlipStats { mean: 0.0, p99: 0.0, worst_block_8x8: 0.0, share_above_0_1: 0.0 };
        let peak_pixel = Pixel { x: 0, y: 0 };
        assert_eq!(
            difference,
            Difference { mean_abs: 0.0, rms: 0.0, rel_mse: 0.0, peak: 0.0, peak_pixel, flip }
        );
        assert!(map.values().iter().all(|v| v.to_bits() == 0));
    }

    #[test]
    fn means_are_over_pixels_and_channels() {
        let reference = Grid::from_fn(SIZE, |_| Rgb::splat(2.0));
        let mut other = reference.clone();
        other[Pixel { x: 4, y: 3 }] = Rgb::new(2.0, 5.0, 1.0);
        other[Pixel { x: 5, y: 3 }] = Rgb::new(-1.0, 2.0, 2.0);
        let (difference, _) = compare(&other, &reference, 0.0).unwrap();
        let n = 3.0 * 210.0;
        let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-12, "{a} is not {b}");
        near(difference.mean_abs, 7.0 / n);
        near(difference.rms, (19.0 / n).sqrt());
        near(difference.rel_mse, 19.0 / 4.01 / n);
        assert_eq!((difference.peak, difference.peak_pixel), (3.0, Pixel { x: 4, y: 3 }));
    }

    #[test]
    fn statistics_of_a_known_map() {
        let mut map = Grid::from_fn(SIZE, |_| 0.0_f32);
        // The last block is 5 pixels wide and 2 high.
        for x in 16..21 {
            map[Pixel { x, y: 9 }] = 0.5;
        }
        map[Pixel { x: 0, y: 0 }] = 0.1;
        map[Pixel { x: 1, y: 0 }] = 1.0;
        let stats = FlipStats::of(&map);
        assert!((stats.mean - 3.6 / 210.0).abs() < 1e-8, "{stats:?}");
        assert!((stats.worst_block_8x8 - 0.25).abs() < 1e-12, "{stats:?}");
        assert_eq!(stats.share_above_0_1, 6.0 / 210.0);
        // 207.9 pixels are 99 %: the third largest value of 210 is the first that 208 do not exceed.
        assert_eq!(stats.p99, 0.5);
        assert_eq!(
            FlipStats::of(&Grid::from_values(ImageSize { width: 1, height: 1 }, vec![0.25])).p99,
            0.25
        );
    }

    #[test]
    fn refusals() {
        let picture = Grid::from_fn(SIZE, |_| Rgb::ONE);
        let says = |a: &Grid<Rgb>, b: &Grid<Rgb>, text: &str| {
            assert_eq!(compare(a, b, 0.0).unwrap_err().to_string(), text);
        };
        let wider = Grid::from_fn(ImageSize { width: 22, height: 10 }, |_| Rgb::ONE);
        says(
            &picture,
            &wider,
            "the pictures differ in size, 21x10 and 22x10; compare pictures of the same resolution",
        );
        let mut bad = picture.clone();
        bad[Pixel { x: 7, y: 2 }].b = f32::NAN;
        says(
            &picture,
            &bad,
            "the second picture is NaN at pixel (7, 2); only finite pictures can be compared",
        );
        let empty = Grid::from_fn(ImageSize { width: 0, height: 10 }, |_| Rgb::ONE);
        says(&empty, &empty, "pictures without pixels cannot be compared");
    }
}
