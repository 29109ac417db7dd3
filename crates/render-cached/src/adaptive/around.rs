//! Ends of chains that others of the same picture tell.
//!
//! What a curved glass shows is scattered: neighbors in the picture end far apart, so no line of them can be
//! interpolated. But many of its pixels show the same walls. An end is told by those around it in the scene that have been
//! computed before, as records from a file would tell it ([`cache_map::Records::near`]), and computed where they
//! don't agree.

use base::{Interrupted, Rgb, hash_u64};
use cache_map::{Nearby, Reason, RecordIndex, RecordPoint, Records, SurfacePoint};

use rayon::prelude::*;

/// Ends may be told from as far away as this part of the scene's diagonal. From farther away, caustics that are narrower were lost.
const REACH: f32 = 1.0 / 170.0;

/// Fewer are asked for, or learned, in one go.
const FEW: usize = 64;

/// Of many, one in so many is the first part: a power of two.
const FIRST: u64 = 8;

/// A value, and why it wasn't computed, if it wasn't.
pub(crate) type Known = (Rgb, Option<Reason>);

/// What has been computed at the ends of chains.
#[derive(Debug)]
pub(crate) struct Around {
    records: Records<Rgb>,
    index: RecordIndex,
    /// Not in the index yet.
    new: Vec<(RecordPoint, Rgb)>,
    reach: f32,
}

impl Around {
    /// Nothing yet, in a scene of this diagonal.
    pub(crate) fn new(diagonal: f32) -> Self {
        let records = Records::default();
        let index = records.index();
        Self { records, index, new: Vec::new(), reach: REACH * diagonal }
    }

    /// How far away others may tell of a place, in world units.
    pub(crate) fn reach(&self) -> f32 {
        self.reach
    }

    /// Values at some places, which have numbers: `is_good` judges what those around the n-th say, `compute` does the others.
    /// What was told counts as interpolated.
    ///
    /// Of many a part comes first, so that it can tell of the rest; which one depends on their numbers only.
    pub(crate) fn fill<A>(
        &mut self,
        account: &mut A,
        places: &[(u32, SurfacePoint)],
        is_good: impl Fn(usize, &Nearby<Rgb>) -> bool + Sync,
        mut compute: impl FnMut(&mut A, &[usize]) -> Result<Vec<Known>, Interrupted>,
    ) -> Result<Vec<Known>, Interrupted> {
        let mut values = vec![(Rgb::BLACK, None); places.len()];
        let mut rest: Vec<usize> = (0..places.len()).collect();
        let mut one_in = if places.len() < FEW { 1 } else { FIRST };
        while !rest.is_empty() {
            let is_first = |&n: &usize| hash_u64(0, u64::from(places[n].0)).is_multiple_of(one_in);
            let (first, others) = rest.into_iter().partition::<Vec<_>, _>(is_first);
            let tell = |&n: &usize| {
                let near = self.records.near(&self.index, &places[n].1, self.reach)?;
                is_good(n, &near).then_some(near.value)
            };
            let told: Vec<Option<Rgb>> = first.par_iter().map(tell).collect();
            let mut missing = Vec::new();
            for (&n, told) in first.iter().zip(told) {
                match told {
                    Some(value) => values[n] = (value, Some(Reason::Interpolated)),
                    None => missing.push(n),
                }
            }
            for (&n, known) in missing.iter().zip(compute(account, &missing)?) {
                values[n] = known;
                if matches!(known.1, None | Some(Reason::Reused)) {
                    let point = RecordPoint { surface: places[n].1, reach: 2.0 * self.reach };
                    self.new.push((point, known.0));
                }
            }
            self.learn();
            (rest, one_in) = (others, one_in / 2);
        }
        Ok(values)
    }

    /// Puts what is new into the index, if that is much.
    fn learn(&mut self) {
        if self.new.len() >= FEW.max(self.records.len() / 4) {
            self.records = self.records.with(std::mem::take(&mut self.new));
            self.index = self.records.index();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Rng, Stream};
    use glam::Vec3;

    #[test]
    fn what_agrees_is_told_and_an_edge_is_computed() {
        let mut rng = Rng::new(0, Stream::Test, 0);
        let mut place = |number| {
            let position = Vec3::new(rng.next_f32(), rng.next_f32(), 0.0);
            (number, SurfacePoint { position, normal: Vec3::Z })
        };
        let places: Vec<_> = (0..4000).map(&mut place).collect();
        let truth = |n: usize| Rgb::splat(if places[n].1.position.x < 0.5 { 1.0 } else { 3.0 });
        let mut around = Around::new(4.0);
        let is_good = |_, near: &Nearby<Rgb>| near.span < 0.1;
        let compute = |n_computed: &mut usize, missing: &[usize]| {
            *n_computed += missing.len();
            Ok(missing.iter().map(|&n| (truth(n), None)).collect())
        };
        let mut n_computed = 0;
        let values = around.fill(&mut n_computed, &places, is_good, compute).unwrap();
        let n_told = values.iter().filter(|v| v.1 == Some(Reason::Interpolated)).count();
        assert!(n_told > 2000 && n_told + n_computed == 4000, "{n_told}, {n_computed}");
        for (n, (value, _)) in values.into_iter().enumerate() {
            assert!((value - truth(n)).luminance().abs() < 1e-4, "{n}: {value:?}");
        }
        // What nobody has computed tells nothing.
        let mut around = Around::new(4.0);
        let borrow = |_: &mut (), missing: &[usize]| {
            Ok(missing.iter().map(|&n| (truth(n), Some(Reason::Nearby))).collect())
        };
        let values = around.fill(&mut (), &places, is_good, borrow).unwrap();
        assert!(values.iter().all(|v| v.1 == Some(Reason::Nearby)));
    }
}
