//! Pictures as numbers, and side by side.

use base::{Grid, ImageSize, Rgb};

/// The mean of each channel.
pub(super) fn mean(picture: &Grid<Rgb>) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for color in picture.values() {
        for (sum, c) in sum.iter_mut().zip(color.to_array()) {
            *sum += f64::from(c);
        }
    }
    sum.map(|sum| sum / picture.values().len() as f64)
}

/// Three values in a cell.
pub(super) fn channels(values: [f64; 3], format: impl Fn(f64) -> String) -> String {
    values.map(format).join(", ")
}

/// Pictures of one size, from left to right.
pub(super) fn strip(pictures: &[Grid<Rgb>]) -> Grid<Rgb> {
    let one = pictures[0].size();
    let size = ImageSize { width: one.width * pictures.len() as u32, height: one.height };
    let mut values = Vec::with_capacity(size.n_pixels());
    for row in 0..one.height as usize {
        for picture in pictures {
            let width = one.width as usize;
            values.extend_from_slice(&picture.values()[row * width..][..width]);
        }
    }
    Grid::from_values(size, values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_side_by_side() {
        let size = ImageSize { width: 2, height: 3 };
        let gray = |c: f32| Grid::from_fn(size, |_| Rgb::splat(c));
        let both = strip(&[gray(1.0), gray(4.0)]);
        assert_eq!(both.size(), ImageSize { width: 4, height: 3 });
        let row: Vec<f32> = both.values()[4..8].iter().map(|c| c.g).collect();
        assert_eq!(row, [1.0, 1.0, 4.0, 4.0]);
        assert_eq!(mean(&both), [2.5; 3]);
    }
}
