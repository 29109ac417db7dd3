//! A closed surface as triangles: marching tetrahedra, after Doi and Koide 1991.
//!
//! Each cube of a grid is cut into six tetrahedra around one diagonal (Freudenthal, Kuhn), the same way everywhere, so
//! that neighbors agree on their common face. Each edge of that lattice carries at most one vertex. The surface is
//! therefore a manifold without boundary, whatever the field, as long as the field is positive all round the grid.

use std::collections::HashMap;

use glam::DVec3;

/// The box of a grid of cubes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lattice {
    /// The lowest corner.
    pub(crate) origin: DVec3,
    /// The edge of a cube.
    pub(crate) cell: f64,
    /// The number of cubes along each axis.
    pub(crate) n_cells: [usize; 3],
}

impl Lattice {
    /// Cubes of edge `cell` that cover the box from `low` to `high`.
    pub(crate) fn covering(low: DVec3, high: DVec3, cell: f64) -> Self {
        let n = ((high - low) / cell).ceil().to_array().map(|n| n as usize);
        Self { origin: low, cell, n_cells: n }
    }

    fn n_points(&self) -> [usize; 3] {
        self.n_cells.map(|n| n + 1)
    }

    /// Where the value of a grid point lies in a list of them all.
    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        let [nx, ny, _] = self.n_points();
        (z * ny + y) * nx + x
    }

    fn position(&self, point: [usize; 3]) -> DVec3 {
        let [x, y, z] = point.map(|i| i as f64);
        self.origin + DVec3::new(x, y, z) * self.cell
    }
}

/// Vertices and counterclockwise triangles, seen from where `field` is positive.
///
/// Vertices are where the chords of the field along the lattice's edges vanish, but never near an edge's end.
pub(crate) fn polygonize(
    lattice: &Lattice,
    field: impl Fn(DVec3) -> f64,
) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let values = sample_grid(lattice, field);
    let mut surface = Surface { lattice, vertices: Vec::new(), by_edge: HashMap::new() };
    let mut triangles = Vec::new();
    let [nx, ny, nz] = lattice.n_cells;
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let cube = [x, y, z];
                let corners: [f64; 8] =
                    std::array::from_fn(|c| values[lattice.index(corner(cube, c))]);
                let n_inside = corners.iter().filter(|v| **v < 0.0).count();
                if n_inside != 0 && n_inside != 8 {
                    for tetrahedron in &TETRAHEDRA {
                        surface.cut(cube, &corners, tetrahedron, &mut triangles);
                    }
                }
            }
        }
    }
    (surface.vertices, triangles)
}

/// Corners of the six tetrahedra, bit 0 the x step, bit 1 the y step, bit 2 the z step.
/// Each one is positively oriented: the determinant of its edges from the first corner is positive.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 5, 1, 7], [0, 3, 2, 7], [0, 6, 4, 7]];

/// Even permutations, hence still positively oriented, that bring one corner to the front.
const ONE_FIRST: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]];

/// Even permutations that bring two corners to the front.
const TWO_FIRST: [[usize; 4]; 6] =
    [[0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 2, 0], [2, 3, 0, 1]];

/// Vertices keep this share of an edge away from its ends: smoothing cannot open a triangle that starts as a sliver.
const MARGIN: f64 = 0.15;

struct Surface<'a> {
    lattice: &'a Lattice,
    vertices: Vec<DVec3>,
    /// The vertex on the edge from a grid point by a step (1 to 7, as in `TETRAHEDRA`). Looked up, never walked.
    by_edge: HashMap<(usize, usize), u32>,
}

impl Surface<'_> {
    /// Adds the triangles of one tetrahedron.
    fn cut(
        &mut self,
        cube: [usize; 3],
        values: &[f64; 8],
        tetrahedron: &[usize; 4],
        triangles: &mut Vec<[u32; 3]>,
    ) {
        let inside = tetrahedron.map(|c| values[c] < 0.0);
        let n_inside = inside.iter().filter(|i| **i).count();
        let mut edge =
            |a: usize, b: usize| self.vertex(cube, values, [tetrahedron[a], tetrahedron[b]]);
        match n_inside {
            1 | 3 => {
                let lonely = inside.iter().position(|i| *i == (n_inside == 1));
                let [i, j, k, l] = ONE_FIRST[lonely.expect("one corner differs from three")];
                let [a, b, c] = [edge(i, j), edge(i, k), edge(i, l)];
                triangles.push(if n_inside == 1 { [a, b, c] } else { [a, c, b] });
            }
            2 => {
                let [i, j, k, l] = *TWO_FIRST
                    .iter()
                    .find(|order| inside[order[0]] && inside[order[1]])
                    .expect("the table has every pair");
                let [a, b, c, d] = [edge(i, k), edge(i, l), edge(j, l), edge(j, k)];
                let length2 = |p: u32, q: u32| {
                    self.vertices[p as usize].distance_squared(self.vertices[q as usize])
                };
                if length2(a, c) <= length2(b, d) {
                    triangles.extend([[a, b, c], [a, c, d]]);
                } else {
                    triangles.extend([[a, b, d], [b, c, d]]);
                }
            }
            _ => {}
        }
    }

    /// The vertex on the edge between two corners of a cube, made on the first call.
    fn vertex(&mut self, cube: [usize; 3], values: &[f64; 8], [a, b]: [usize; 2]) -> u32 {
        // Along a tetrahedron's edge the steps of one end contain those of the other.
        let (low, high) = (a & b, a | b);
        let key = (self.lattice.index(corner(cube, low)), high - low);
        *self.by_edge.entry(key).or_insert_with(|| {
            let t = (values[low] / (values[low] - values[high])).clamp(MARGIN, 1.0 - MARGIN);
            let [p, q] = [low, high].map(|c| self.lattice.position(corner(cube, c)));
            self.vertices.push(p + (q - p) * t);
            (self.vertices.len() - 1) as u32
        })
    }
}

/// The grid point at a corner of a cube.
fn corner([x, y, z]: [usize; 3], steps: usize) -> [usize; 3] {
    [x + (steps & 1), y + (steps >> 1 & 1), z + (steps >> 2)]
}

fn sample_grid(lattice: &Lattice, field: impl Fn(DVec3) -> f64) -> Vec<f64> {
    let [nx, ny, nz] = lattice.n_points();
    let mut values = Vec::with_capacity(nx * ny * nz);
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                values.push(field(lattice.position([x, y, z])));
            }
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tetrahedra_fill_the_cube_with_positive_orientation() {
        let at = |c: usize| DVec3::from(corner([0; 3], c).map(|i| i as f64));
        let mut volume = 0.0;
        for [a, b, c, d] in TETRAHEDRA.map(|t| t.map(at)) {
            let six = (b - a).dot((c - a).cross(d - a));
            assert_eq!(six, 1.0);
            volume += six / 6.0;
        }
        assert!((volume - 1.0).abs() < 1e-12, "{volume}");
    }

    #[test]
    fn permutations_are_even() {
        for order in ONE_FIRST.iter().chain(&TWO_FIRST) {
            let pairs = (0..4).flat_map(|i| (0..i).map(move |j| (order[j], order[i])));
            assert_eq!(pairs.filter(|(a, b)| a > b).count() % 2, 0, "{order:?}");
        }
    }

    #[test]
    fn any_field_gives_a_closed_oriented_surface() {
        let lattice = Lattice::covering(DVec3::splat(-1.0), DVec3::splat(1.0), 0.25);
        let noise = |p: DVec3| {
            let rim = p.abs().max_element() > 0.99;
            let scrambled = (p.x * 12.9898 + p.y * 78.233 + p.z * 37.719).rem_euclid(1.0);
            if rim { 1.0 } else { scrambled - 0.5 }
        };
        let (vertices, triangles) = polygonize(&lattice, noise);
        assert!(triangles.len() > 1000, "{}", triangles.len());
        let mut edges = HashMap::new();
        for [a, b, c] in triangles {
            for edge in [[a, b], [b, c], [c, a]] {
                assert!((edge[0] as usize) < vertices.len());
                assert!(edges.insert(edge, ()).is_none(), "edge {edge:?} is met twice");
            }
        }
        assert!(edges.keys().all(|[a, b]| edges.contains_key(&[*b, *a])), "an edge is open");
    }
}
