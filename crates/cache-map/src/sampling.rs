//! Which pixels are sampled at low resolution.

use base::{ImageSize, Pixel, Rng, Stream};

/// One random pixel in each cell of about `1 / fraction` pixels, in the order of the cells. A fraction of 1 chooses every
/// pixel.
///
/// The paper samples "one-fourth of the region" for the search; with a region of side `r` we take that as one sample in
/// each quarter of the region, so `fraction = 4 / r^2`.
///
/// # Panics
/// When the fraction isn't in (0, 1].
pub fn choose_pixels(size: ImageSize, fraction: f64, seed: u64) -> Vec<Pixel> {
    assert!(fraction > 0.0 && fraction <= 1.0, "fraction {fraction} is not in (0, 1]");
    let side = 1.0 / fraction.sqrt();
    let edges = |extent: u32| -> Vec<u32> {
        let n = (f64::from(extent) / side - 1e-9).ceil().max(1.0) as u32;
        let mut edges: Vec<_> =
            (0..=n).map(|i| ((f64::from(i) * side + 1e-9) as u32).min(extent)).collect();
        // No cell is empty, however the sums above are rounded.
        edges.dedup();
        edges
    };
    let (columns, rows) = (edges(size.width), edges(size.height));
    let mut pixels = Vec::new();
    for (j, y) in rows.windows(2).enumerate() {
        for (i, x) in columns.windows(2).enumerate() {
            let mut rng = Rng::new(seed, Stream::PixelChoice, (j as u64) << 32 | i as u64);
            let mut pick =
                |low: u32, high: u32| low + (rng.next_f32() * (high - low) as f32) as u32;
            pixels.push(Pixel { x: pick(x[0], x[1]), y: pick(y[0], y[1]) });
        }
    }
    pixels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_has_one_sample() {
        let size = ImageSize { width: 130, height: 67 };
        let pixels = choose_pixels(size, 1.0 / 16.0, 3);
        assert_eq!(pixels.len(), 33 * 17);
        let mut cells: Vec<_> = pixels.iter().map(|p| (p.y / 4, p.x / 4)).collect();
        cells.dedup();
        assert_eq!(cells.len(), 33 * 17);
        assert!(pixels.iter().all(|p| p.x < size.width && p.y < size.height));
        assert_ne!(pixels, choose_pixels(size, 1.0 / 16.0, 4));
    }

    #[test]
    fn odd_fractions_sample_about_that_share() {
        let size = ImageSize { width: 200, height: 200 };
        for fraction in [0.3, 0.1, 0.02] {
            let share = choose_pixels(size, fraction, 0).len() as f64 / 40_000.0;
            assert!((share / fraction - 1.0).abs() < 0.06, "{share} for {fraction}");
        }
        assert_eq!(choose_pixels(size, 1.0, 0).len(), 40_000);
        assert_eq!(
            choose_pixels(ImageSize { width: 1, height: 1 }, 0.01, 0),
            [Pixel { x: 0, y: 0 }]
        );
    }
}
