//! Where a textured emitter is bright, so that photons and shadow rays start from there.
//!
//! Every piece of the emitter is an image of the unit square that keeps ratios of area. The square is divided into cells,
//! and places are drawn by the brightness of cells, which a few lookups estimate. No estimate biases anything: what a
//! place is drawn too often or too rarely is made up by its weight, and no cell is dark enough to be left out.

use base::Rgb;
use glam::Vec2;

use crate::shares::{pick, running_shares};

/// Cells of one emitter, at most.
const MAX_CELLS: usize = 1 << 16;

/// Cells along a side of a piece, at most.
const MAX_SIDE: usize = 64;

/// Lookups along a side of a cell.
const LOOKUPS: usize = 4;

/// The least brightness of a cell, as a share of the mean: what lookups have missed is drawn no more rarely than that.
const LEAST_SHARE: f64 = 0.05;

/// How often places are drawn.
#[derive(Clone, Debug)]
pub(crate) struct BrightCells {
    /// Cells along a side of each piece.
    side: usize,
    /// Of each piece, the share of the flux that comes from it or from pieces before it.
    pieces: Vec<f32>,
    /// Of each row of a piece, the share of the piece's that comes from it or from rows before it.
    rows: Vec<f32>,
    /// Of each cell, the share of its row's that comes from it or from cells before it.
    columns: Vec<f32>,
    /// Of each cell, how often uniform places would fall there, over how often these do.
    weights: Vec<f32>,
}

/// A place on an emitter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BrightPlace {
    pub(crate) piece: usize,
    /// In the unit square of the piece.
    pub(crate) at: Vec2,
    /// The density of uniform places over that at which this one was drawn.
    pub(crate) weight: f32,
}

impl BrightCells {
    /// The cells of pieces with these areas. `brightness` is that of a place in the unit square of a piece.
    pub(crate) fn new(areas: &[f32], brightness: impl Fn(usize, Vec2) -> f32) -> Self {
        let side = ((MAX_CELLS / areas.len().max(1)) as f64).sqrt() as usize;
        let side = side.clamp(1, MAX_SIDE);
        let n = side * LOOKUPS;
        let mut cells = vec![0.0_f64; areas.len() * side * side];
        for (piece, cells) in cells.chunks_mut(side * side).enumerate() {
            for (x, y) in (0..n).flat_map(|y| (0..n).map(move |x| (x, y))) {
                let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / n as f32;
                cells[y / LOOKUPS * side + x / LOOKUPS] += f64::from(brightness(piece, at));
            }
        }
        let area: f64 = areas.iter().copied().map(f64::from).sum();
        let mean_of = |cells: &[f64]| -> f64 {
            let pieces = cells.chunks(side * side).zip(areas);
            pieces.map(|(cells, &a)| cells.iter().sum::<f64>() * f64::from(a)).sum::<f64>()
                / (area * (side * side) as f64)
        };
        let least = (LEAST_SHARE * mean_of(&cells)).max(f64::MIN_POSITIVE);
        cells.iter_mut().for_each(|cell| *cell = cell.max(least));
        let mean = mean_of(&cells);
        let (mut pieces, mut rows, mut columns) = (Vec::new(), Vec::new(), Vec::new());
        for (cells, &area) in cells.chunks(side * side).zip(areas) {
            let by_row: Vec<f64> = cells.chunks(side).map(|row| row.iter().sum()).collect();
            cells.chunks(side).for_each(|row| columns.extend(running_shares(row)));
            pieces.push(by_row.iter().sum::<f64>() * f64::from(area));
            rows.extend(running_shares(&by_row));
        }
        Self {
            side,
            pieces: running_shares(&pieces).collect(),
            rows,
            columns,
            weights: cells.iter().map(|cell| (mean / cell) as f32).collect(),
        }
    }

    /// The mean of a color over pieces with these areas, by lookups.
    pub(crate) fn mean(&self, areas: &[f32], of: impl Fn(usize, Vec2) -> Rgb) -> Rgb {
        let n = self.side * LOOKUPS;
        let (mut sum, mut all) = ([0.0_f64; 3], 0.0);
        for (piece, &area) in areas.iter().enumerate() {
            all += f64::from(area);
            for (x, y) in (0..n).flat_map(|y| (0..n).map(move |x| (x, y))) {
                let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / n as f32;
                let share = f64::from(area) / (n * n) as f64;
                let color = of(piece, at).to_array();
                sum.iter_mut().zip(color).for_each(|(sum, c)| *sum += f64::from(c) * share);
            }
        }
        Rgb::from(sum.map(|sum| (sum / all) as f32))
    }

    /// A place, from two uniform numbers.
    pub(crate) fn draw(&self, u: Vec2) -> BrightPlace {
        let (piece, x) = pick(&self.pieces, u.x);
        let (row, y) = pick(&self.rows[piece * self.side..][..self.side], u.y);
        let first = (piece * self.side + row) * self.side;
        let (column, x) = pick(&self.columns[first..][..self.side], x);
        let at = Vec2::new(column as f32 + x, row as f32 + y) / self.side as f32;
        let at = at.min(Vec2::splat(1.0 - f32::EPSILON));
        BrightPlace { piece, at, weight: self.weights[first + column] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Rng, Stream};

    /// Two pieces, one of them three times as large, with a spot of which most lookups know nothing.
    #[test]
    fn weights_make_up_for_how_often_places_are_drawn() {
        let areas = [1.0, 3.0];
        let brightness = |piece: usize, at: Vec2| match piece {
            0 => at.x * at.x * at.y,
            _ if (at - 0.5).length() < 0.01 => 40.0,
            _ => 0.0,
        };
        let cells = BrightCells::new(&areas, brightness);
        let mut rng = Rng::new(0, Stream::Test, 9);
        let n = 400_000;
        let (mut ones, mut sums) = (0.0_f64, [0.0_f64; 2]);
        for _ in 0..n {
            let place = cells.draw(rng.next_2d());
            assert!(place.at.cmpge(Vec2::ZERO).all() && place.at.cmplt(Vec2::ONE).all());
            ones += f64::from(place.weight);
            sums[place.piece] += f64::from(place.weight * brightness(place.piece, place.at));
        }
        let n = f64::from(n);
        assert!((ones / n - 1.0).abs() < 0.02, "{}", ones / n);
        // Means over all area: a quarter of 1/6, and three quarters of 40 on a disc.
        let expected = [0.25 / 6.0, 0.75 * 40.0 * std::f64::consts::PI * 1e-4];
        for (sum, expected) in sums.into_iter().zip(expected) {
            assert!((sum / n / expected - 1.0).abs() < 0.02, "{} of {expected}", sum / n);
        }
    }

    #[test]
    fn the_same_brightness_everywhere_is_drawn_uniformly() {
        let cells = BrightCells::new(&[2.0, 1.0, 1.0], |_, _| 0.7);
        let mut rng = Rng::new(0, Stream::Test, 10);
        let mut counts = [0; 3];
        for _ in 0..40_000 {
            let place = cells.draw(rng.next_2d());
            counts[place.piece] += 1;
            assert!((place.weight - 1.0).abs() < 1e-4);
        }
        assert!((counts[0] as f32 / 20_000.0 - 1.0).abs() < 0.03, "{counts:?}");
    }
}
