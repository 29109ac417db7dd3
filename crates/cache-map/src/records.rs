//! Records: values that were computed at points of surfaces, to be used again from anywhere.
//!
//! A record is as good as new at its own point. Close to it, its neighbors tell how the value changes: a plane fitted to
//! them gives the gradient, and what the plane would have said of the record itself gives the error. That is an embedded
//! pair again, as between pixels.

use std::cmp::Ordering;

use base::Frame;
use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3A};
use mapfile::Array;
use rayon::prelude::*;

use crate::nearest::PointTree;
use crate::{Rule, SurfacePoint, Tolerance, Value, same_surface};

/// Where a record lies, and how far it can be of use.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct RecordPoint {
    /// Where the value was computed.
    pub surface: SurfacePoint,
    /// The length over which the value was expected to vary, in world units; 0 if it tells nothing of other points.
    pub reach: f32,
}

/// Values of one quantity, at most one at a point, in an order that depends on the points only.
#[derive(Clone, Debug)]
pub struct Records<T: Value> {
    pub(crate) points: Array<RecordPoint>,
    pub(crate) values: Array<T>,
}

/// What records around a place say of it.
#[derive(Clone, Copy, Debug)]
pub struct Nearby<T> {
    /// The value of the nearest one, moved along the gradient.
    pub value: T,
    /// The length over which that record was expected to vary.
    pub reach: f32,
    /// How far away it lies, in world units.
    pub distance: f32,
    /// By how much the others miss it, in proportion to how close it is to the place.
    pub error: f32,
    /// The greatest difference of any of them from it.
    pub span: f32,
}

impl<T: Value> Nearby<T> {
    /// Whether this will do for a pixel: as in [`crate::refine`], where the others are pixels. Beyond `close` they must agree
    /// as well as their gradient must.
    pub fn is_within(
        &self,
        index: usize,
        close: f32,
        rule: &impl Rule<T>,
        tolerance: Tolerance,
    ) -> bool {
        let gain = rule.gain(index);
        let limit = rule.reference(index, self.value);
        let edge = if self.distance <= close { tolerance.edge } else { tolerance.error };
        gain * self.error <= tolerance.error * limit && gain * self.span <= edge * limit
    }
}

/// A tree over the places of some records.
#[derive(Debug)]
pub struct RecordIndex(PointTree);

/// Neighbors that are asked for a gradient, the nearest record included.
const NEIGHBORS: usize = 9;
/// Fewer don't prove that anything is smooth.
const FEWEST: usize = 6;
/// Neighbors are searched within so many times the distance at which a record may serve.
const SEARCH: f32 = 3.0;
/// A record may serve at this part of its reach ...
const REACH: f32 = 0.5;
/// ... and of the distance within which its neighbors lie, or the gradient would be extrapolated.
const SPREAD: f32 = 0.4;

impl<T: Value> Records<T> {
    /// Takes values in any order. Of several at one point the first counts.
    pub fn new(records: Vec<(RecordPoint, T)>) -> Self {
        let mut records = records;
        records.par_sort_by(|a, b| order(&a.0.surface, &b.0.surface));
        records.dedup_by(|b, a| order(&a.0.surface, &b.0.surface).is_eq());
        let (points, values): (Vec<_>, Vec<_>) = records.into_iter().unzip();
        Self { points: points.into(), values: values.into() }
    }

    /// These records and others at other points.
    pub fn with(&self, others: Vec<(RecordPoint, T)>) -> Self {
        let mut all = self.all();
        all.extend(others);
        Self::new(all)
    }

    fn all(&self) -> Vec<(RecordPoint, T)> {
        self.points.iter().copied().zip(self.values.iter().copied()).collect()
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The value at this very point, to the bit, and its reach.
    pub fn at(&self, surface: &SurfacePoint) -> Option<(T, f32)> {
        let i = self.points.binary_search_by(|p| order(&p.surface, surface)).ok()?;
        Some((self.values[i], self.points[i].reach))
    }

    /// An index for [`Records::near`].
    pub fn index(&self) -> RecordIndex {
        RecordIndex(PointTree::build(self.points.iter().map(|p| p.surface.position)))
    }

    /// What the records around a point say of it, if the nearest is not farther than `limit` (in world units), and there
    /// are enough on the same surface to tell how it varies. `index` is theirs.
    pub fn near(
        &self,
        index: &RecordIndex,
        surface: &SurfacePoint,
        limit: f32,
    ) -> Option<Nearby<T>> {
        let (points, values) = (&*self.points, &*self.values);
        let is_wanted = |i: u32| {
            let point = &points[i as usize];
            point.reach > 0.0 && same_surface(surface, &point.surface)
        };
        let mut found = [(0.0, 0); NEIGHBORS];
        // Most answers are no, and this is the quickest way to them.
        index.0.nearest(surface.position, limit, &is_wanted, &mut found[..1]).first()?;
        let found = index.0.nearest(surface.position, SEARCH * limit, &is_wanted, &mut found);
        let (&(d2, nearest), others) = found.split_first()?;
        let d = d2.sqrt();
        let RecordPoint { surface: center, reach } = points[nearest as usize];
        let spread = found[found.len() - 1].0.sqrt();
        if found.len() < FEWEST || d > limit.min(REACH * reach).min(SPREAD * spread) {
            return None;
        }
        let frame = Frame::new(surface.normal.into());
        let place = |point: &SurfacePoint| {
            let between = Vec3A::from(point.position - center.position);
            Vec2::new(between.dot(frame.s), between.dot(frame.t))
        };
        let here = values[nearest as usize];
        let mut span = 0.0_f32;
        let neighbors = others.iter().map(|&(_, i)| {
            let rise = values[i as usize] - here;
            span = span.max(rise.size());
            (place(&points[i as usize].surface), rise)
        });
        let plane = Plane::fit(neighbors)?;
        let to = place(surface);
        Some(Nearby {
            value: (here + plane.along_x * to.x + plane.along_y * to.y).sound(),
            reach,
            distance: d,
            // Half the spread is about how far records are apart.
            error: plane.at_origin.size() * (2.0 * d / spread),
            span,
        })
    }
}

/// The order of points in which records are stored: any will do, as long as it tells all points apart.
pub(crate) fn order(a: &SurfacePoint, b: &SurfacePoint) -> Ordering {
    let bits = |s: &SurfacePoint| bytemuck::cast::<SurfacePoint, [u32; 6]>(*s);
    bits(a).cmp(&bits(b))
}

/// A value that varies linearly over a plane.
struct Plane<T> {
    at_origin: T,
    along_x: T,
    along_y: T,
}

impl<T: Value> Plane<T> {
    /// The plane through these values with the least squared error, where those near the origin weigh most; none if the
    /// places lie on a line.
    fn fit(values: impl Iterator<Item = (Vec2, T)>) -> Option<Self> {
        let mut moments = [0.0_f32; 5];
        let mut total = 0.0_f32;
        let mut sums = [T::default(); 3];
        for (at, value) in values {
            let w = 1.0 / at.length_squared().max(f32::MIN_POSITIVE);
            total += w;
            for (moment, term) in
                moments.iter_mut().zip([at.x, at.y, at.x * at.x, at.x * at.y, at.y * at.y])
            {
                *moment += w * term;
            }
            sums =
                [sums[0] + value * w, sums[1] + value * (w * at.x), sums[2] + value * (w * at.y)];
        }
        // About the center of the places the slopes don't depend on the mean.
        let scale = 1.0 / total;
        let [x, y, xx, xy, yy] = moments.map(|m| m * scale);
        let [mean, sum_x, sum_y] = sums.map(|s| s * scale);
        let (xx, xy, yy) = (xx - x * x, xy - x * y, yy - y * y);
        let determinant = xx * yy - xy * xy;
        if determinant.is_nan() || determinant <= 1e-3 * (xx + yy) * (xx + yy) {
            return None;
        }
        let (sum_x, sum_y) = (sum_x - mean * x, sum_y - mean * y);
        let along_x = (sum_x * yy - sum_y * xy) * (1.0 / determinant);
        let along_y = (sum_y * xx - sum_x * xy) * (1.0 / determinant);
        Some(Self { at_origin: mean - along_x * x - along_y * y, along_x, along_y })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Rgb, Rng, Stream};
    use glam::Vec3;

    fn point(x: f32, y: f32, z: f32) -> SurfacePoint {
        SurfacePoint { position: Vec3::new(x, y, z), normal: Vec3::Z }
    }

    /// Records on a jittered grid of spacing 1.
    fn records<T: Value>(value: impl Fn(Vec2) -> T) -> Records<T> {
        let mut rng = Rng::new(1, Stream::Test, 0);
        let mut all = Vec::new();
        for y in 0..20 {
            for x in 0..20 {
                let at = Vec2::new(x as f32, y as f32) + 0.3 * rng.next_2d();
                all.push((RecordPoint { surface: point(at.x, at.y, 0.0), reach: 4.0 }, value(at)));
            }
        }
        Records::new(all)
    }

    #[test]
    fn a_record_stands_for_its_own_point_only() {
        let records = records(|at| at.x);
        for p in records.points.iter() {
            assert_eq!(records.at(&p.surface), Some((p.surface.position.x, 4.0)));
            let mut other = p.surface;
            other.position.z = -0.0;
            assert_eq!(records.at(&other), None);
            other = SurfacePoint { normal: -p.surface.normal, ..p.surface };
            assert_eq!(records.at(&other), None);
        }
    }

    #[test]
    fn order_and_duplicates_change_nothing() {
        let records = records(|at| Rgb::new(at.x, at.y, 1.0));
        let mut backward = records.all();
        backward.reverse();
        // What comes later at the same point doesn't count.
        backward.extend(records.all().into_iter().map(|(p, _)| (p, Rgb::BLACK)));
        let again = Records::new(backward);
        assert_eq!((&*again.points, &*again.values), (&*records.points, &*records.values));
        assert_eq!(records.with(again.all()).len(), records.len());
    }

    #[test]
    fn what_is_linear_is_found_exactly() {
        let f = |at: Vec2| Rgb::new(2.0 + 0.3 * at.x, 5.0 - 0.2 * at.y, 1.0);
        let records = records(f);
        let index = records.index();
        let mut rng = Rng::new(2, Stream::Test, 0);
        let mut n = 0;
        for _ in 0..1000 {
            let at = 2.0 + 15.0 * rng.next_2d();
            if let Some(near) = records.near(&index, &point(at.x, at.y, 0.0), 0.7) {
                assert!((near.value - f(at)).size() < 1e-4, "{at}: {near:?}");
                assert!(near.error < 1e-4 && near.span > 0.05 && near.reach == 4.0, "{near:?}");
                n += 1;
            }
        }
        assert!(n > 300, "{n}");
    }

    #[test]
    fn an_edge_shows_as_error_and_span() {
        let records = records(|at| f32::from(u8::from(at.x > 10.0)));
        let index = records.index();
        let (mut n, mut worst) = (0, 0.0_f32);
        for i in 0..400 {
            let at = Vec2::new(5.0 + 0.025 * i as f32, 10.0);
            let Some(near) = records.near(&index, &point(at.x, at.y, 0.0), 0.7) else { continue };
            let is_near_edge = (at.x - 10.0).abs() < 0.5;
            n += usize::from(is_near_edge);
            assert!(!is_near_edge || near.span == 1.0, "{at}: {near:?}");
            if near.span == 0.0 {
                worst = worst.max((near.value - f32::from(u8::from(at.x > 10.0))).abs());
            }
        }
        assert!(n > 5 && worst == 0.0, "{n}, {worst}");
    }

    #[test]
    fn what_is_far_or_elsewhere_or_alone_says_nothing() {
        let records = records(|at| at.x);
        let index = records.index();
        let near = |surface: SurfacePoint| records.near(&index, &surface, 0.7);
        let at = records.points[records.len() / 2].surface.position;
        assert!(near(point(at.x, at.y, 0.0)).is_some());
        assert!(near(point(at.x, at.y, 0.3)).is_none(), "above the plane");
        assert!(near(point(-3.0, at.y, 0.0)).is_none(), "beside it");
        let turned = SurfacePoint { normal: -Vec3::Z, ..point(at.x, at.y, 0.0) };
        assert!(near(turned).is_none(), "on its back");

        let row: Vec<_> = (0..20)
            .map(|i| (RecordPoint { surface: point(i as f32, 0.0, 0.0), reach: 9.0 }, 1.0_f32))
            .collect();
        let row = Records::new(row);
        assert!(row.near(&row.index(), &point(9.1, 0.0, 0.0), 1.0).is_none(), "on a line");
        let few =
            Records::new(vec![(RecordPoint { surface: point(0.0, 0.0, 0.0), reach: 9.0 }, 1.0)]);
        assert!(few.near(&few.index(), &point(0.1, 0.0, 0.0), 1.0).is_none(), "alone");
        // Much closer than its neighbors are, but not within its own reach.
        for reach in [0.01, 0.0] {
            let short = records.all().into_iter().map(|(p, v)| (RecordPoint { reach, ..p }, v));
            let short = Records::new(short.collect());
            let near = short.near(&short.index(), &point(at.x + 0.01, at.y, 0.0), 0.7);
            assert!(near.is_none(), "reach");
        }
    }
}
