//! Meshes for the tests, and random numbers to place them.

use std::collections::HashMap;

use base::{Rng, Stream, warp};
use geometry::{MaterialId, Mesh, Sphere};
use glam::{DVec3, Quat, Vec3, Vec3A};

pub(crate) fn rng(index: u64) -> Rng {
    Rng::new(0, Stream::Test, index)
}

pub(crate) fn direction(rng: &mut Rng) -> Vec3A {
    warp::uniform_sphere(rng.next_2d()).normalize()
}

/// Uniform in the ball of radius 1.
pub(crate) fn in_ball(rng: &mut Rng) -> DVec3 {
    loop {
        let p = DVec3::from_array([(); 3].map(|()| f64::from(rng.next_f32()) * 2.0 - 1.0));
        if p.length_squared() < 1.0 {
            return p;
        }
    }
}

/// Where and how large a shape is: `p` of the unit shape becomes `(p + offset) * scale`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placement {
    pub(crate) scale: f64,
    /// In units of the shape's size.
    pub(crate) offset: f64,
}

impl Placement {
    /// Small, middling and large; at the origin, beside it and far from it.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        [1e-3, 1.0, 1e5]
            .into_iter()
            .flat_map(|scale| [0.0, 10.0, 1000.0].map(|offset| Self { scale, offset }))
    }

    pub(crate) fn point(&self, p: DVec3) -> Vec3 {
        ((p + DVec3::new(1.0, -0.7, 0.4) * self.offset) * self.scale).as_vec3()
    }

    pub(crate) fn mesh(&self, mesh: &Mesh) -> Mesh {
        let positions = mesh.positions.iter().map(|p| self.point(p.as_dvec3())).collect();
        Mesh { positions, ..mesh.clone() }
    }

    pub(crate) fn unit_sphere(&self) -> Sphere {
        Sphere {
            center: self.point(DVec3::ZERO),
            radius: self.scale as f32,
            rotation: Quat::IDENTITY,
            material: MaterialId(0),
        }
    }
}

/// A closed mesh of `20 * 4^levels` triangles with corners on the unit sphere.
pub(crate) fn icosphere(levels: u32) -> Mesh {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let mut positions = Vec::new();
    for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
        positions.extend([DVec3::new(a, b, 0.0), DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a)]);
    }
    positions.iter_mut().for_each(|p| *p = p.normalize());
    // The faces of an icosahedron join the corners that are nearest to each other.
    let edge = (positions[0] - positions[3]).length() * 1.01;
    let near = |i: usize, j: usize| (positions[i] - positions[j]).length() < edge;
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let [p, q, r] = [a, b, c].map(|i| positions[i]);
                    let outward = (q - p).cross(r - p).dot(p) > 0.0;
                    triangles.push(if outward { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    for _ in 0..levels {
        let mut middles = HashMap::new();
        let mut middle = |a: usize, b: usize| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions.push((positions[a] + positions[b]).normalize());
                positions.len() - 1
            })
        };
        let quarters = |&[a, b, c]: &[usize; 3]| {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.iter().flat_map(quarters).collect();
    }
    mesh(
        positions.iter().map(|p| p.as_vec3()).collect(),
        triangles.iter().map(|t| t.map(|i| i as u32)).collect(),
    )
}

/// A box with outward normals, twelve triangles; `place` moves its corners.
pub(crate) fn cuboid(min: DVec3, max: DVec3, place: impl Fn(DVec3) -> DVec3) -> Mesh {
    let corner = |i: usize| {
        DVec3::select(glam::BVec3::from_array([0, 1, 2].map(|k| i >> k & 1 == 1)), max, min)
    };
    let quads: [[u32; 4]; 6] =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    mesh(
        (0..8).map(|i| place(corner(i)).as_vec3()).collect(),
        quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
    )
}

/// Triangles of one material.
pub(crate) fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Mesh {
    let materials = vec![MaterialId(0); triangles.len()];
    Mesh { positions, triangles, materials, ..Mesh::default() }
}

#[test]
fn shapes_are_closed_and_turned_outward() {
    for shape in [icosphere(3), cuboid(DVec3::splat(-1.0), DVec3::ONE, |p| p)] {
        let mut edges = HashMap::new();
        for (i, &[a, b, c]) in shape.triangles.iter().enumerate() {
            for edge in [(a, b), (b, c), (c, a)] {
                *edges.entry(edge).or_insert(0) += 1;
            }
            let [p, q, r] = shape.corners(i);
            assert!((q - p).cross(r - p).dot(p) > 0.0, "triangle {i} looks inward");
        }
        assert!(edges.iter().all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1)));
    }
    assert_eq!(icosphere(3).triangles.len(), 20 * 64);
}
