//! Which pixels are sampled at low resolution.

use base::{ImageSize, Pixel, Rng, Stream, Window};

/// One random pixel in each cell of about `1 / fraction` pixels, in the order of the cells. A fraction of 1 chooses every
/// pixel.
///
/// The paper samples "one-fourth of the region" for the search; with a region of side `r` we take that as one sample in
/// each quarter of the region, so `fraction = 4 / r^2`.
///
/// # Panics
/// When the fraction isn't in (0, 1].
pub fn choose_pixels(size: ImageSize, fraction: f64, seed: u64) -> Vec<Pixel> {
    choose_pixels_in(Window::whole(size), fraction, seed)
}

/// Those of [`choose_pixels`] of the whole picture that lie in a window, counted from its corner.
///
/// # Panics
/// When the fraction isn't in (0, 1].
pub fn choose_pixels_in(window: Window, fraction: f64, seed: u64) -> Vec<Pixel> {
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
    // Cells with their places in the whole, as far as they cross the window.
    let cells = |extent: u32, start: u32, end: u32| -> Vec<(usize, u32, u32)> {
        let edges = edges(extent);
        let cells = edges.windows(2).enumerate().map(|(i, edges)| (i, edges[0], edges[1]));
        cells.filter(|&(_, low, high)| low < end && high > start).collect()
    };
    let [x, end_x, y, end_y] = window.bounds();
    let columns = cells(window.whole.width, x, end_x);
    let rows = cells(window.whole.height, y, end_y);
    let mut pixels = Vec::new();
    for &(j, top, bottom) in &rows {
        for &(i, left, right) in &columns {
            let mut rng = Rng::new(seed, Stream::PixelChoice, (j as u64) << 32 | i as u64);
            let mut pick =
                |low: u32, high: u32| low + (rng.next_f32() * (high - low) as f32) as u32;
            let (px, py) = (pick(left, right), pick(top, bottom));
            if (x..end_x).contains(&px) && (y..end_y).contains(&py) {
                pixels.push(Pixel { x: px - x, y: py - y });
            }
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
    fn a_window_has_the_samples_of_the_whole() {
        let whole = ImageSize { width: 130, height: 67 };
        for fraction in [1.0 / 16.0, 0.03, 1.0] {
            let window = Window::new([37, 101, 9, 67], whole).unwrap();
            let inside: Vec<_> = choose_pixels(whole, fraction, 3)
                .into_iter()
                .filter(|p| (37..101).contains(&p.x) && p.y >= 9)
                .collect();
            let in_window: Vec<_> = choose_pixels_in(window, fraction, 3)
                .into_iter()
                .map(|p| window.in_whole(p))
                .collect();
            assert_eq!(in_window, inside);
        }
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
