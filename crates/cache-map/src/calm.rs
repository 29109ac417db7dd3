//! Blocks of pixels in which nothing happens.
//!
//! Walls and floors fill most pictures, and away from edges all tests at their pixels pass. Where the coarser pixels in
//! a block and around it differ so little that no test can fail, none is made: its pixels are predicted all the same.

use crate::lattice::{BLOCK, Block, Lattice, SMALL};
use crate::layer::{Layer, Value};
use crate::refine::{Rule, Tolerance};

/// How far apart the pixels of a block are that are asked what errors may be.
const ASKED: usize = 4;

/// Whether no test can fail at the pixels of step `h` in a block, as far as coarser pixels tell.
pub(crate) fn is_calm<T: Value>(
    lattice: &Lattice,
    layer: &Layer<T>,
    rule: &impl Rule<T>,
    tolerance: Tolerance,
    h: u32,
    block: Block,
) -> bool {
    if h > SMALL || !lattice.is_whole(block) || rule.spacing(block.corner()) < 2.0 * h as f32 {
        return false;
    }
    let (width, first) = (lattice.size().width as usize, lattice.size().index(block.corner()));
    let asked = (0..BLOCK as usize).step_by(ASKED);
    let asked = asked.clone().flat_map(|dy| asked.clone().map(move |dx| first + dy * width + dx));
    let mut least = f32::INFINITY;
    for i in asked {
        // Where a value doesn't matter it isn't known.
        let gain = rule.gain(i);
        if gain <= 0.0 {
            return false;
        }
        least = least.min(rule.reference(i, layer.values[i]) / gain);
    }
    let Changes { bend, twist, slope } = Changes::around(layer, width, first, 2 * h as usize);
    0.5 * bend + twist <= tolerance.error * least && slope <= tolerance.edge * least
}

/// Whether a center of step `h` was traced in a block that has all its neighbors, or so close that midpoints of the block
/// see it.
pub(crate) fn sees_traced_center<T: Value>(
    lattice: &Lattice,
    layer: &Layer<T>,
    h: u32,
    block: Block,
) -> bool {
    let (width, h) = (lattice.size().width as usize, h as usize);
    let first = lattice.size().index(block.corner()) - 3 * h * (width + 1);
    let n = BLOCK as usize / (2 * h) + 3;
    (0..n).any(|row| {
        let row = &layer.reasons[first + 2 * h * row * width..][..2 * h * n];
        row.iter().step_by(2 * h).any(|reason| reason.is_traced())
    })
}

/// The largest differences between pixels on a lattice that covers a block and one line beyond it.
struct Changes {
    /// Second differences along rows and columns.
    bend: f32,
    /// Mixed differences of rows and columns.
    twist: f32,
    /// The difference of neighbors in a row, plus that of neighbors in a column.
    slope: f32,
}

impl Changes {
    fn around<T: Value>(layer: &Layer<T>, width: usize, first: usize, spacing: usize) -> Self {
        let (mut bend, mut twist, mut across, mut down) = (0.0_f32, 0.0_f32, 0.0_f32, 0.0_f32);
        let n = BLOCK as usize / spacing;
        for row in 0..=n {
            for column in 0..=n {
                let i = first + row * spacing * width + column * spacing;
                let at = |dx: usize, dy: usize| {
                    layer.values[i + dx * spacing + dy * spacing * width - spacing * (width + 1)]
                };
                let here = at(1, 1);
                let (right, below) = (at(2, 1) - here, at(1, 2) - here);
                bend = bend.max((right - (here - at(0, 1))).size());
                bend = bend.max((below - (here - at(1, 0))).size());
                twist = twist.max((at(2, 2) - at(1, 2) - right).size());
                (across, down) = (across.max(right.size()), down.max(below.size()));
            }
        }
        Self { bend, twist, slope: across + down }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Reason, SurfacePoint, refine};
    use base::{Grid, ImageSize, Pixel, Rgb};
    use glam::Vec3;

    const SIZE: ImageSize = ImageSize { width: 300, height: 170 };
    const TOLERANCE: Tolerance = Tolerance { error: 0.02, edge: 0.2 };

    /// Smooth but for a shadow with a soft border, a spot and a place where values don't matter.
    fn value(p: Pixel) -> Rgb {
        let (x, y) = (p.x as f32, p.y as f32);
        let smooth = 2.0 + 2e-5 * (x - 150.0) * (x - 150.0) + 0.003 * y;
        let shadow = ((x - 0.5 * y - 100.0) / 6.0).clamp(0.3, 1.0);
        let spot = if (x - 230.0).hypot(y - 60.0) < 9.0 { 2.0 } else { 1.0 };
        Rgb::new(smooth * shadow, smooth * spot, smooth)
    }

    struct AllMatters;
    impl Rule<Rgb> for AllMatters {
        fn gain(&self, index: usize) -> f32 {
            let p = SIZE.pixel(index);
            f32::from(u8::from(!(20..25).contains(&p.x)))
        }
        fn reference(&self, _: usize, predicted: Rgb) -> f32 {
            0.1 + predicted.luminance()
        }
        fn spacing(&self, _: Pixel) -> f32 {
            16.0
        }
    }

    /// The layer after two refinements, and for how many pixels a value was asked.
    fn refined(lattice: &Lattice) -> (Layer<Rgb>, usize) {
        let (mut layer, mut n) = (Layer::new(SIZE.n_pixels()), 0);
        for factor in [1.0, 0.5] {
            let Tolerance { error, edge } = TOLERANCE;
            let tolerance = Tolerance { error: error * factor, edge: edge * factor };
            let mut trace = |pixels: &[Pixel]| {
                n += pixels.len();
                Ok::<_, ()>(pixels.iter().map(|&p| value(p)).collect())
            };
            refine(lattice, &mut layer, 16, &AllMatters, tolerance, &mut trace).unwrap();
            // As a ray would that has found what was missed.
            let pixel = Pixel { x: 151, y: 121 };
            let at = SIZE.index(pixel);
            (layer.values[at], layer.reasons[at]) = (value(pixel) * 3.0, Reason::Verification);
        }
        (layer, n)
    }

    #[test]
    fn what_is_not_tested_would_have_passed() {
        let sites = Grid::from_fn(SIZE, |p| {
            let position = Vec3::new(p.x as f32, p.y as f32, 0.0);
            (p.y > 5).then_some(SurfacePoint { position, normal: Vec3::Z })
        });
        let lattice = Lattice::new(&sites, 16);
        let (with, n) = refined(&lattice);
        let n_calm = (0..lattice.n_blocks())
            .filter(|&i| is_calm(&lattice, &with, &AllMatters, TOLERANCE, 1, lattice.block(i)))
            .count();
        assert!(n_calm > 60 && n_calm < 150, "{n_calm} of {}", lattice.n_blocks());
        let (without, expected) = refined(&lattice.without_blocks());
        assert_eq!(n, expected);
        assert!(with.values == without.values && with.reasons == without.reasons);
        assert_eq!(with.levels, without.levels);
    }
}
