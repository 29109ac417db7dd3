//! Polygons cut into triangles.

use glam::{DVec2, DVec3, Vec3};

/// Cutting takes time quadratic in the number of corners.
pub(super) const MAX_CORNERS: usize = 4096;

/// Cuts a polygon of at least three corners, flat or nearly so, convex or not, into triangles that keep its winding.
/// They are given by the places of their corners in the list.
pub(super) fn triangulate(corners: &[Vec3]) -> Vec<[usize; 3]> {
    match corners.len() {
        0..3 => Vec::new(),
        3 => vec![[0, 1, 2]],
        _ => clip_ears(&flatten(corners)),
    }
}

/// Projects the polygon along the main axis of its normal, so that it runs counterclockwise.
fn flatten(corners: &[Vec3]) -> Vec<DVec2> {
    let at = |i: usize| corners[i % corners.len()].as_dvec3() - corners[0].as_dvec3();
    // Newell's method: right for concave polygons, too.
    let normal: DVec3 = (0..corners.len()).map(|i| at(i).cross(at(i + 1))).sum();
    let axis = normal.abs().max_position();
    let (x, y) = ((axis + 1) % 3, (axis + 2) % 3);
    let sign = 1.0_f64.copysign(normal[axis]);
    (0..corners.len()).map(|i| DVec2::new(at(i)[x], at(i)[y] * sign)).collect()
}

/// Twice the area of a triangle, positive if it runs counterclockwise.
fn area(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

fn clip_ears(points: &[DVec2]) -> Vec<[usize; 3]> {
    let mut rest: Vec<usize> = (0..points.len()).collect();
    let mut triangles = Vec::with_capacity(points.len() - 2);
    let mut at = 0;
    while rest.len() > 3 {
        let n = rest.len();
        // The second corner first, so that a convex polygon becomes a fan around the first one.
        let ear = (1..=n).map(|step| (at + step) % n).find(|&i| is_ear(points, &rest, i));
        // A polygon that crosses itself may have none; any corner will do then.
        let i = ear.unwrap_or((at + 1) % n);
        triangles.push([rest[(i + n - 1) % n], rest[i], rest[(i + 1) % n]]);
        rest.remove(i);
        at = (i + rest.len() - 1) % rest.len();
    }
    triangles.push([rest[0], rest[1], rest[2]]);
    triangles
}

/// Whether the triangle at corner `i` can be cut off: it turns left and no other corner lies in it.
fn is_ear(points: &[DVec2], rest: &[usize], i: usize) -> bool {
    let n = rest.len();
    let [a, b, c] = [(i + n - 1) % n, i, (i + 1) % n].map(|i| points[rest[i]]);
    if area(a, b, c) <= 0.0 {
        return false;
    }
    let inside = |p: DVec2| area(a, b, p) >= 0.0 && area(b, c, p) >= 0.0 && area(c, a, p) >= 0.0;
    rest.iter().all(|&j| {
        let p = points[j];
        // A corner in the same place as one of the triangle's is where the outline touches itself.
        p == a || p == b || p == c || !inside(p)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The triangles cover the polygon: none is turned over, and their areas add up.
    fn check(corners: &[Vec3], expected: f32) {
        let normal = {
            let p = |i: usize| corners[i % corners.len()];
            (0..corners.len()).map(|i| p(i).cross(p(i + 1))).sum::<Vec3>().normalize()
        };
        let triangles = triangulate(corners);
        assert_eq!(triangles.len(), corners.len() - 2);
        let mut total = 0.0;
        for t in triangles {
            let [a, b, c] = t.map(|i| corners[i]);
            let area = 0.5 * (b - a).cross(c - a).dot(normal);
            assert!(area >= 0.0, "{t:?} is turned over: {area}");
            total += area;
        }
        assert!((total - expected).abs() < 1e-5 * expected, "{total}, not {expected}");
    }

    fn flat(points: &[[f32; 2]]) -> Vec<Vec3> {
        points.iter().map(|&[x, y]| Vec3::new(x, y, 0.0)).collect()
    }

    #[test]
    fn covers_concave_polygons_once() {
        let arrow = flat(&[[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [1.0, 1.0]]);
        let star: Vec<_> = (0..10)
            .map(|i| {
                let angle = std::f64::consts::PI * 0.2 * f64::from(i);
                let radius = if i % 2 == 0 { 1.0 } else { 0.4 };
                Vec3::new((radius * angle.cos()) as f32, (radius * angle.sin()) as f32, 0.0)
            })
            .collect();
        let comb = flat(&[
            [0.0, 0.0],
            [5.0, 0.0],
            [5.0, 3.0],
            [4.0, 3.0],
            [4.0, 1.0],
            [3.0, 1.0],
            [3.0, 3.0],
            [2.0, 3.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [0.0, 3.0],
        ]);
        // Ten triangles of the center, an outer and an inner corner: 10 x 1/2 x 1 x 0.4 x sin 36 degrees.
        let star_area = 2.0 * 0.587_785_25;
        for turn in 0..12 {
            for (polygon, area) in [(&arrow, 1.0), (&star, star_area), (&comb, 11.0)] {
                let mut polygon = polygon.clone();
                polygon.rotate_left(turn % 4);
                check(&polygon, area);
                polygon.reverse();
                check(&polygon, area);
                // Standing upright, along each axis.
                polygon.iter_mut().for_each(|p| *p = Vec3::new(3.0, p.x, p.y));
                check(&polygon, area);
                polygon.iter_mut().for_each(|p| *p = Vec3::new(p.y, p.x, p.z));
                check(&polygon, area);
            }
        }
    }

    #[test]
    fn convex_polygons_become_fans() {
        let square = flat(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert_eq!(triangulate(&square), [[0, 1, 2], [0, 2, 3]]);
        // A corner on an edge makes no triangle without area.
        let edge = flat(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]);
        for t in triangulate(&edge) {
            let [a, b, c] = t.map(|i| edge[i]);
            assert!((b - a).cross(c - a).z > 0.1, "{t:?}");
        }
    }

    #[test]
    fn crossing_outlines_still_end() {
        let bow = flat(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
        assert_eq!(triangulate(&bow).len(), 2);
        assert_eq!(triangulate(&[Vec3::ONE; 7]).len(), 5);
        assert!(triangulate(&[Vec3::ONE; 2]).is_empty());
    }
}
