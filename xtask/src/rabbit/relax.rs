//! Moves the vertices of a mesh onto an implicit surface and spreads them evenly over it.

use glam::DVec3;

use crate::rabbit::field::Sample;

/// Rounds of smoothing.
const N_ROUNDS: usize = 3;
/// Newton steps per projection: the error squares with each.
const N_NEWTON: usize = 3;

/// Projects `vertices` onto the surface where `field` vanishes, and evens out the triangles.
///
/// Each round moves every vertex, within its tangent plane, to the mean of its neighbors, then back to the surface.
/// No step is longer than `reach`.
pub(crate) fn relax(
    vertices: &mut [DVec3],
    triangles: &[[u32; 3]],
    reach: f64,
    field: impl Fn(DVec3) -> Sample,
) {
    let project = |mut p: DVec3| {
        for _ in 0..N_NEWTON {
            let Sample { value, gradient } = field(p);
            let slope2 = gradient.length_squared();
            if slope2 > 0.0 {
                p -= (gradient * (value / slope2)).clamp_length_max(reach);
            }
        }
        p
    };
    for p in vertices.iter_mut() {
        *p = project(*p);
    }
    for _ in 0..N_ROUNDS {
        let means = neighbor_means(vertices, triangles);
        for (p, mean) in vertices.iter_mut().zip(means) {
            let normal = field(*p).gradient.normalize_or_zero();
            *p = project(*p + (mean - *p).reject_from_normalized(normal));
        }
    }
}

/// The mean of each vertex's neighbors. On a closed surface each directed edge is met once, so each neighbor counts once.
fn neighbor_means(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut sums = vec![(DVec3::ZERO, 0.0); vertices.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| i as usize);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            sums[from].0 += vertices[to];
            sums[from].1 += 1.0;
        }
    }
    sums.into_iter().map(|(sum, n)| sum / n).collect()
}
