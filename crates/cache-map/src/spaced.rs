//! Samples at distances that are known before, along rows and along columns.
//!
//! A surface that is seen aslant looks alike over many pixels one way and over few the other: there samples lie as close together
//! as each way asks for. Rows are filled from coarse to fine, and columns in each of them: a pixel between two rows of
//! samples is predicted from the rows around, one in a row of samples from the columns around. Either is there already,
//! whatever the distances are beside it: where they change there is no seam.

use std::iter::successors;

use base::{Grid, ImageSize, Pixel};
use rayon::prelude::*;

use crate::SurfacePoint;
use crate::lattice::{BLOCK, Lattice, same_surface};
use crate::layer::{Layer, Reason, Value};
use crate::refine::{Decision, Line, Row, Rule, Tolerance, Trace, keep, settle};

/// How far apart samples lie along a row and along a column, in pixels: powers of two.
pub type Steps = [u32; 2];

/// On a line that crosses an edge, what the two sides say of the pixel between them differs, however alike its neighbours' mean and
/// its curve are. It may differ by so much of what neighbours may span.
const JUMP: f32 = 0.25;

/// Fills a layer from samples: the pixels whose coordinates are multiples of what `steps` says of them, up to `coarsest` (a power
/// of two, at most 128). Where a square of 16 pixels a side shows one plane, its first is asked for all. Pixels that are traced already
/// keep their values. `trace` computes values at the pixels that it is given: at samples, and where a prediction
/// fails the tests of [`crate::refine()`].
///
/// # Errors
/// Those of `trace`.
#[expect(clippy::too_many_arguments, reason = "those of `refine`, and where samples lie")]
pub fn refine_spaced<T: Value, E>(
    lattice: &Lattice,
    sites: &Grid<Option<SurfacePoint>>,
    layer: &mut Layer<T>,
    coarsest: u32,
    steps: impl Fn(Pixel) -> Steps + Sync,
    rule: &impl Rule<T>,
    tolerance: Tolerance,
    trace: &mut Trace<'_, T, E>,
) -> Result<(), E> {
    let size = lattice.size();
    let steps = |pixel| steps(pixel).map(|step| step.min(coarsest) as u8);
    let mut all = vec![[1; 2]; size.n_pixels()];
    let rows = all.par_chunks_mut((size.width * BLOCK) as usize);
    rows.enumerate().for_each(|(by, rows)| {
        for bx in 0..size.width.div_ceil(BLOCK) {
            let first = Pixel { x: bx * BLOCK, y: by as u32 * BLOCK };
            let of_block = lattice.has_no_edge_around(first).then(|| steps(first));
            for (y, row) in (first.y..).zip(rows.chunks_mut(size.width as usize)) {
                for (x, at) in (first.x..).zip(&mut row[first.x as usize..]).take(BLOCK as usize) {
                    *at = of_block.unwrap_or_else(|| steps(Pixel { x, y }));
                }
            }
        }
    });
    let spaced = Spaced { lattice, sites, steps: &all, coarsest, tolerance };
    let samples = spaced.samples(layer, rule);
    settle(layer, lattice, coarsest, samples, trace)?;
    let halves = || successors(Some(coarsest), |&step| (step > 1).then_some(step / 2));
    for down in halves() {
        for across in halves() {
            let rows = spaced.predict(layer, rule, [across, down]);
            let to_trace = keep(layer, size, spaced.places(down), rows, across.min(down));
            settle(layer, lattice, coarsest, to_trace, trace)?;
        }
    }
    Ok(())
}

#[derive(Clone, Copy)]
struct Spaced<'x> {
    lattice: &'x Lattice,
    sites: &'x Grid<Option<SurfacePoint>>,
    /// Of each pixel.
    steps: &'x [[u8; 2]],
    coarsest: u32,
    tolerance: Tolerance,
}

impl Spaced<'_> {
    fn steps(&self, index: usize) -> Steps {
        self.steps[index].map(u32::from)
    }

    /// The samples that aren't traced yet.
    fn samples<T: Value>(&self, layer: &Layer<T>, rule: &impl Rule<T>) -> Vec<(Pixel, Reason)> {
        let is_sample = |&(i, Pixel { x, y }): &(usize, Pixel)| {
            let [across, down] = self.steps(i);
            x % across == 0
                && y % down == 0
                && self.lattice.has_site(i)
                && !layer.is_traced(i)
                && rule.gain(i) > 0.0
        };
        let samples = self.lattice.size().pixels().enumerate().filter(is_sample);
        samples.map(|(_, pixel)| (pixel, Reason::Lattice)).collect()
    }

    /// The first of the coordinates of a step, and how far apart they are.
    fn places(&self, step: u32) -> (u32, u32) {
        if step == self.coarsest { (0, step) } else { (step, 2 * step) }
    }

    /// Predicts the pixels whose coordinates are of these steps.
    fn predict<T: Value>(&self, layer: &Layer<T>, rule: &impl Rule<T>, step: Steps) -> Vec<Row<T>> {
        let height = self.lattice.size().height;
        let (first, apart) = self.places(step[1]);
        let rows = (first.min(height)..height).into_par_iter().step_by(apart as usize);
        rows.map(|y| self.row(layer, rule, y, step)).collect()
    }

    fn row<T: Value>(&self, layer: &Layer<T>, rule: &impl Rule<T>, y: u32, step: Steps) -> Row<T> {
        let Self { lattice, .. } = self;
        let (blocks, empty) = (lattice.blocks_of_row(y), lattice.empty_blocks_of_row(y));
        let width = lattice.size().width;
        let (first, apart) = self.places(step[0]);
        let predicted = Vec::with_capacity(width.div_ceil(apart) as usize);
        let mut row = Row { predicted, to_trace: Vec::new() };
        for x in (first..width).step_by(apart as usize) {
            let block = (x / BLOCK) as usize;
            let pixel = Pixel { x, y };
            let i = lattice.size().index(pixel);
            if empty[block] || !lattice.has_site(i) || layer.is_traced(i) {
                continue;
            }
            let gain = rule.gain(i);
            if gain > 0.0 {
                let in_plane = lattice.in_plane(blocks.start + block);
                match self.decide(layer, rule, pixel, gain, step, in_plane) {
                    Decision::Take(value) => row.predicted.push((x, value)),
                    Decision::Trace(reason) => row.to_trace.push((pixel, reason)),
                }
            }
        }
        row
    }

    /// Neighbours up to `in_plane` away are known to show the surface.
    #[inline]
    fn decide<T: Value>(
        &self,
        layer: &Layer<T>,
        rule: &impl Rule<T>,
        pixel: Pixel,
        gain: f32,
        [across, down]: Steps,
        in_plane: u32,
    ) -> Decision<T> {
        let Tolerance { error, edge } = self.tolerance;
        let ImageSize { width, height } = self.lattice.size();
        let i = self.lattice.size().index(pixel);
        let [wanted_across, wanted_down] = self.steps(i);
        // Between rows of samples the column tells, and in them the row; where the column is cut, too.
        let column = Span { step: down, at: pixel.y, end: height, pitch: width as usize };
        let row = Span { step: across, at: pixel.x, end: width, pitch: 1 };
        let mut reason = Reason::NoNeighbours;
        for (span, wanted) in [(column, wanted_down), (row, wanted_across)] {
            if span.step >= wanted {
                continue;
            }
            let mask = if span.step <= in_plane { u8::MAX } else { self.mask(i, span) };
            let at = |steps| layer.values[span.index(i, steps)];
            let Some(line) = Line::new(mask, at) else { continue };
            let predicted = line.predicted.sound();
            let limit = rule.reference(i, predicted);
            if gain * line.error > error * limit {
                reason = Reason::Error;
            } else if gain * line.span > edge * limit || gain * line.jump > JUMP * edge * limit {
                reason = Reason::Edge;
            } else {
                return Decision::Take(predicted);
            }
        }
        Decision::Trace(reason)
    }

    /// Which of the neighbours along a row or column show the surface of a pixel.
    fn mask(&self, i: usize, span: Span) -> u8 {
        let sites = self.sites.values();
        let shows = |steps: i64| {
            let to = i64::from(span.at) + steps * i64::from(span.step);
            let is_inside = (0..i64::from(span.end)).contains(&to);
            let other = is_inside.then(|| sites[span.index(i, steps)].as_ref()).flatten();
            other.zip(sites[i].as_ref()).is_some_and(|(other, site)| same_surface(site, other))
        };
        let near_then_far = [-1, 1, -3, 3].into_iter().enumerate();
        near_then_far.fold(0, |mask, (bit, steps)| mask | u8::from(shows(steps)) << bit)
    }
}

/// The row or the column of a pixel.
#[derive(Clone, Copy)]
struct Span {
    /// How far away the neighbours are.
    step: u32,
    /// The coordinate along it, and where it ends.
    at: u32,
    end: u32,
    /// How far apart the numbers of pixels along it are.
    pitch: usize,
}

impl Span {
    /// The number of the pixel so many steps away from that of a number.
    #[inline]
    fn index(self, i: usize, steps: i64) -> usize {
        (i as i64 + steps * i64::from(self.step) * self.pitch as i64) as usize
    }
}

#[cfg(test)]
mod tests {
    use base::{Rgb, math};
    use glam::Vec3;

    use super::*;

    const SIZE: ImageSize = ImageSize { width: 203, height: 171 };
    const LOOSE: Tolerance = Tolerance { error: 0.07, edge: 0.5 };

    struct AllMatters;
    impl Rule<Rgb> for AllMatters {
        fn gain(&self, _: usize) -> f32 {
            1.0
        }
        fn reference(&self, _: usize, predicted: Rgb) -> f32 {
            predicted.luminance()
        }
        fn spacing(&self, _: Pixel) -> f32 {
            16.0
        }
    }

    /// A wall, and beyond a column another that stands out from it.
    fn sites(second: u32) -> Grid<Option<SurfacePoint>> {
        Grid::from_fn(SIZE, |p| {
            let depth = if p.x < second { 0.0 } else { 50.0 };
            let position = Vec3::new(p.x as f32, p.y as f32, depth);
            Some(SurfacePoint { position, normal: Vec3::Z })
        })
    }

    fn refined(
        sites: &Grid<Option<SurfacePoint>>,
        steps: impl Fn(Pixel) -> Steps + Sync,
        value: impl Fn(Pixel) -> f32,
    ) -> Layer<Rgb> {
        let mut layer = Layer::new(SIZE.n_pixels());
        let mut trace =
            |pixels: &[Pixel]| Ok::<_, ()>(pixels.iter().map(|&p| Rgb::splat(value(p))).collect());
        let lattice = Lattice::new(sites, 16);
        refine_spaced(&lattice, sites, &mut layer, 16, steps, &AllMatters, LOOSE, &mut trace)
            .unwrap();
        layer
    }

    fn n_traced(layer: &Layer<Rgb>, reason: Reason) -> usize {
        layer.reasons.iter().filter(|&&r| r == reason).count()
    }

    fn mean_error(layer: &Layer<Rgb>, value: impl Fn(Pixel) -> f32) -> f32 {
        let errors = SIZE.pixels().zip(&layer.values).map(|(p, v)| (v.g - value(p)).abs());
        errors.sum::<f32>() / SIZE.n_pixels() as f32
    }

    #[test]
    fn samples_lie_where_they_are_asked_for() {
        let steep = |p: Pixel| 1.0 + 0.01 * p.x as f32 + 0.002 * p.y as f32;
        for steps in [[2, 8], [16, 1], [4, 4], [1, 1], [64, 64]] {
            let layer = refined(&sites(u32::MAX), |_| steps, steep);
            let [across, down] = steps.map(|step| step.min(16));
            let expected = SIZE.width.div_ceil(across) * SIZE.height.div_ceil(down);
            assert_eq!(n_traced(&layer, Reason::Lattice), expected as usize, "{steps:?}");
            // Beyond the last row and column of samples there are none on the other side.
            assert_eq!(n_traced(&layer, Reason::Error) + n_traced(&layer, Reason::Edge), 0);
            assert!(mean_error(&layer, steep) < 1e-6, "{steps:?}");
        }
    }

    #[test]
    fn what_is_alike_along_columns_needs_samples_across_them() {
        let streaks = |p: Pixel| 1.0 + 0.05 * math::sin_cos(p.x as f32 * 0.4 + p.y as f32 * 0.03).0;
        let [along, against] =
            [[2, 16], [16, 2]].map(|steps| refined(&sites(u32::MAX), |_| steps, streaks));
        assert!(mean_error(&along, streaks) < 0.001);
        assert!(mean_error(&against, streaks) > 0.015);
    }

    #[test]
    fn distances_may_change_from_block_to_block() {
        let smooth = |p: Pixel| 1.0 + 1e-5 * (p.x * p.x + p.y * p.y) as f32;
        let mixed = |p: Pixel| {
            [[2, 8], [8, 2], [4, 4], [16, 16], [1, 16]][((p.x / 16 + 2 * (p.y / 16)) % 5) as usize]
        };
        let inside = |layer: &Layer<Rgb>| {
            let all = SIZE.pixels().zip(&layer.reasons);
            let inside =
                all.filter(|(p, _)| p.x < SIZE.width / 16 * 16 && p.y < SIZE.height / 16 * 16);
            inside.filter(|(_, r)| !matches!(**r, Reason::Lattice | Reason::Interpolated)).count()
        };
        let layer = refined(&sites(u32::MAX), mixed, smooth);
        assert_eq!(inside(&layer), 0);
        assert!(mean_error(&layer, smooth) < 1e-4);
    }

    #[test]
    fn edges_are_kept() {
        // Between two surfaces nothing is interpolated.
        let two = |p: Pixel| if p.x < 77 { 1.0 } else { 1.2 };
        let layer = refined(&sites(77), |_| [8, 4], two);
        assert!(mean_error(&layer, two) < 1e-6);
        // On one, what jumps is traced, though neighbours are less apart than an edge is.
        let of_one = |p: Pixel| if p.y < 93 { 1.0 } else { 1.35 };
        let layer = refined(&sites(u32::MAX), |_| [8, 4], of_one);
        assert!(n_traced(&layer, Reason::Edge) > 0);
        assert!(mean_error(&layer, of_one) < 1e-4, "{}", mean_error(&layer, of_one));
    }
}
