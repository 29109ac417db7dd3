//! The nearest of many points: a kd-tree (Bentley 1975) in one array, split at medians.

use glam::Vec3;

/// Points in a leaf of the tree.
const LEAF: usize = 8;

/// Points, ordered so that the order is the tree: the middle of a range splits it.
#[derive(Debug)]
pub(crate) struct PointTree {
    points: Vec<(Vec3, u32)>,
    /// The axis along which the range with this middle is split.
    axes: Vec<u8>,
}

/// A point that was found: its squared distance and its number.
pub(crate) type Found = (f32, u32);

impl PointTree {
    /// Numbers the points in the order in which they are given, of which there are fewer than 2^32.
    pub(crate) fn build(points: impl Iterator<Item = Vec3>) -> Self {
        let mut points: Vec<(Vec3, u32)> = points.zip(0..).collect();
        let mut axes = vec![0; points.len()];
        split(&mut points, &mut axes);
        Self { points, axes }
    }

    /// The points nearest to `at` and not beyond `radius` that are wanted, as many as `found` takes, nearest first; of
    /// those at one distance those with the lowest numbers.
    pub(crate) fn nearest<'f>(
        &self,
        at: Vec3,
        radius: f32,
        is_wanted: &impl Fn(u32) -> bool,
        found: &'f mut [Found],
    ) -> &'f [Found] {
        let mut search = Search { at, radius2: radius * radius, is_wanted, found, n: 0 };
        search.range(&self.points, &self.axes);
        let Search { found, n, .. } = search;
        &found[..n]
    }
}

/// Puts a range of points in order, large halves on several threads.
fn split(points: &mut [(Vec3, u32)], axes: &mut [u8]) {
    const ALONE: usize = 1 << 14;
    if points.len() <= LEAF {
        return;
    }
    let first = points[0].0;
    let (low, high) =
        points.iter().fold((first, first), |(low, high), p| (low.min(p.0), high.max(p.0)));
    let axis = (high - low).max_position();
    let middle = points.len() / 2;
    points
        .select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    axes[middle] = axis as u8;
    let (left, right) = points.split_at_mut(middle);
    let (left_axes, right_axes) = axes.split_at_mut(middle);
    let (right, right_axes) = (&mut right[1..], &mut right_axes[1..]);
    if left.len() < ALONE {
        split(left, left_axes);
        split(right, right_axes);
    } else {
        rayon::join(|| split(left, left_axes), || split(right, right_axes));
    }
}

struct Search<'f, W> {
    at: Vec3,
    radius2: f32,
    is_wanted: W,
    found: &'f mut [Found],
    n: usize,
}

impl<W: Fn(u32) -> bool> Search<'_, W> {
    fn range(&mut self, points: &[(Vec3, u32)], axes: &[u8]) {
        if points.len() <= LEAF {
            points.iter().for_each(|p| self.consider(p));
            return;
        }
        let middle = points.len() / 2;
        let axis = usize::from(axes[middle]);
        let beyond = self.at[axis] - points[middle].0[axis];
        let left = (&points[..middle], &axes[..middle]);
        let right = (&points[middle + 1..], &axes[middle + 1..]);
        let (near, far) = if beyond < 0.0 { (left, right) } else { (right, left) };
        self.range(near.0, near.1);
        if beyond * beyond <= self.radius2 {
            self.consider(&points[middle]);
            self.range(far.0, far.1);
        }
    }

    fn consider(&mut self, &(point, number): &(Vec3, u32)) {
        let candidate = (point.distance_squared(self.at), number);
        let precedes = |a: &Found, b: &Found| a.0 < b.0 || (a.0 == b.0 && a.1 < b.1);
        let is_full = self.n == self.found.len();
        if candidate.0 > self.radius2
            || is_full && self.found.last().is_none_or(|last| !precedes(&candidate, last))
            || !(self.is_wanted)(number)
        {
            return;
        }
        self.n += usize::from(!is_full);
        let place = self.found[..self.n - 1].partition_point(|f| precedes(f, &candidate));
        self.found[place..self.n].rotate_right(1);
        self.found[place] = candidate;
        if self.n == self.found.len() {
            self.radius2 = self.found[self.n - 1].0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Rng, Stream};

    #[test]
    fn the_nearest_are_those_of_a_linear_search() {
        let mut rng = Rng::new(0, Stream::Test, 0);
        for n in [0, 1, 7, 8, 9, 100, 3000] {
            // Coarse steps, so that many distances are equal.
            let mut step = || (rng.next_f32() * 20.0).floor() * 0.25;
            let points: Vec<Vec3> =
                (0..n).map(|_| Vec3::new(step(), step(), 0.1 * step())).collect();
            let tree = PointTree::build(points.iter().copied());
            for i in 0..200_u32 {
                let at = Vec3::new(step(), step(), 0.0);
                let radius = 0.25 * (i % 9) as f32;
                let is_wanted = |number: u32| number % 3 != i % 3;
                let mut expected: Vec<Found> = (points.iter().zip(0..))
                    .map(|(p, number)| (p.distance_squared(at), number))
                    .filter(|f| f.0 <= radius * radius && is_wanted(f.1))
                    .collect();
                expected.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                expected.truncate(8);
                let mut found = [(0.0, 0); 8];
                assert_eq!(tree.nearest(at, radius, &is_wanted, &mut found), expected, "{n} {i}");
            }
        }
    }
}
