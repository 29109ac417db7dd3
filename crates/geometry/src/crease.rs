//! Where smooth parts of the surfaces end.

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;

use crate::{MaterialId, Mesh};

/// A triangle goes on in another if their normals agree up to this cosine (26 degrees).
const MIN_COS_NORMALS: f32 = 0.9;

/// Where the surface turns by less than this sine (14 degrees), there is no crease.
const LEAST_TURN: f32 = 0.25;

/// More triangles than this meet at an edge only where a mesh is broken. The rest are left out: comparing all of them
/// would take time that grows with the square of their number, and so would a BVH of equal boxes.
const MAX_AT_EDGE: usize = 16;

/// An edge of a triangle at which no other triangle goes on, or only one that turns away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crease {
    /// One end.
    pub from: Vec3A,
    /// The other.
    pub to: Vec3A,
    /// Unit normal of the triangle, on its front side.
    pub normal: Vec3A,
    /// Unit vector in the plane of the triangle, perpendicular to the edge, towards the triangle.
    pub inward: Vec3A,
    /// The sine of the angle by which the surface turns away where it goes on; infinite where it doesn't.
    pub turn: f32,
}

/// All creases of a scene, to be searched by place.
///
/// Open edges and sharp ones count, each once for every triangle that meets there. Spheres have none.
pub struct Creases {
    bvh: Bvh2,
    /// In the order of the leaves.
    creases: Vec<Crease>,
}

impl std::fmt::Debug for Creases {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Creases").field("creases", &self.creases.len()).finish_non_exhaustive()
    }
}

/// A triangle at an edge.
struct Side {
    /// The bits of the ends in ascending order: the same for all triangles at the edge.
    ends: [[u32; 3]; 2],
    crease: Crease,
}

impl Creases {
    /// Finds the creases of all triangles whose material counts.
    pub fn find(meshes: &[Mesh], counts: impl Fn(MaterialId) -> bool) -> Self {
        let mut sides = Vec::new();
        for mesh in meshes {
            let triangles = (0..mesh.triangles.len()).filter(|&t| counts(mesh.materials[t]));
            triangles.for_each(|t| sides.extend(sides_of(mesh, t)));
        }
        sides.sort_by_key(|side| side.ends);
        let mut creases = Vec::new();
        for at_edge in sides.chunk_by(|a, b| a.ends == b.ends) {
            let at_edge = &at_edge[..at_edge.len().min(MAX_AT_EDGE)];
            let turned = at_edge.iter().map(|side| {
                let turn = at_edge.iter().map(|other| turn(side, other)).reduce(f32::min);
                Crease { turn: turn.unwrap_or(f32::INFINITY), ..side.crease }
            });
            creases.extend(turned.filter(|crease| crease.turn > LEAST_TURN));
        }

        let boxes: Vec<Aabb> =
            creases.iter().map(|c| Aabb::new(c.from.min(c.to), c.from.max(c.to))).collect();
        let params = BvhBuildParams::medium_build();
        let mut bvh = PlocBuilder::with_capacity(boxes.len()).build(
            params.ploc_search_distance,
            &boxes,
            (0..boxes.len() as u32).collect(),
            params.sort_precision,
            params.search_depth_threshold,
        );
        ReinsertionOptimizer::default().run(&mut bvh, params.reinsertion_batch_ratio, None);
        let creases = bvh.primitive_indices.iter().map(|&i| creases[i as usize]).collect();
        Self { bvh, creases }
    }

    /// Calls `visit` for all creases that come within `radius` of a point, and for some that don't, until it answers
    /// false.
    #[inline]
    pub fn near(&self, point: Vec3A, radius: f32, mut visit: impl FnMut(&Crease) -> bool) {
        // obvhs compares boxes in single precision and without rounding: an edge in a face of the box counts.
        self.bvh.aabb_traverse(Aabb::new(point - radius, point + radius), |bvh, node| {
            let node = &bvh.nodes[node as usize];
            let first = node.first_index as usize;
            self.creases[first..first + node.prim_count as usize].iter().all(&mut visit)
        });
    }
}

/// The three sides of a triangle.
fn sides_of(mesh: &Mesh, t: usize) -> [Side; 3] {
    let corners = mesh.corners(t).map(Vec3A::from);
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
    // Adding 0 turns -0 into it.
    let bits = corners.map(|p| Vec3::from(p + Vec3A::ZERO).to_array().map(f32::to_bits));
    [(0, 1), (1, 2), (2, 0)].map(|(a, b)| {
        let inward = normal.cross(corners[b] - corners[a]).normalize_or_zero();
        let (a, b) = if bits[a] <= bits[b] { (a, b) } else { (b, a) };
        Side {
            ends: [bits[a], bits[b]],
            crease: Crease {
                from: corners[a],
                to: corners[b],
                normal,
                inward,
                turn: f32::INFINITY,
            },
        }
    })
}

/// The sine of the angle by which a triangle turns away from another, if it goes on there: in nearly the same plane,
/// whatever its shading normals. Which side is the front makes no difference.
fn turn(side: &Side, other: &Side) -> f32 {
    let (n, inward) = (side.crease.normal, other.crease.inward);
    let is_fold = side.crease.inward.dot(inward) >= 0.0;
    let goes_on = !is_fold && n.dot(other.crease.normal).abs() > MIN_COS_NORMALS;
    if goes_on { inward.dot(n).abs() } else { f32::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Rng, Stream, warp};

    fn find(mesh: &Mesh) -> Creases {
        Creases::find(std::slice::from_ref(mesh), |_| true)
    }

    fn all(creases: &Creases) -> Vec<Crease> {
        creases.creases.clone()
    }

    /// Two triangles over the same edge, the second turned by an angle out of the plane of the first.
    fn hinge(sin: f32, cos: f32) -> Mesh {
        Mesh {
            positions: vec![Vec3::ZERO, Vec3::Y, Vec3::X, Vec3::new(-cos, 0.0, sin)],
            triangles: vec![[0, 2, 1], [0, 1, 3]],
            materials: vec![MaterialId(0); 2],
            ..Mesh::default()
        }
    }

    #[test]
    fn flat_edges_go_on_and_sharp_ones_end() {
        for (sin, cos, n) in [(0.0, 1.0, 4), (0.2, 0.98, 4), (0.4, 0.917, 6), (1.0, 0.0, 6)] {
            assert_eq!(all(&find(&hinge(sin, cos))).len(), n, "sine {sin}");
        }
        // Folded flat, one triangle lies on the other.
        assert_eq!(all(&find(&hinge(0.0, -1.0))).len(), 6);
        let mut turned = hinge(0.0, 1.0);
        turned.triangles[1].swap(0, 1);
        assert_eq!(all(&find(&turned)).len(), 4, "fronts on different sides");
    }

    #[test]
    fn edges_turn_by_the_angle_of_their_triangles() {
        for (sin, cos, turn) in [(0.4, 0.917, 0.4), (0.6, 0.8, f32::INFINITY)] {
            let mut creases = all(&find(&hinge(sin, cos)));
            creases.retain(|c| c.from == Vec3A::ZERO && c.to == Vec3A::Y);
            let turns: Vec<f32> = creases.iter().map(|c| c.turn).collect();
            assert!(turns.iter().all(|t| *t == turn || (t - turn).abs() < 1e-3), "{turns:?}");
        }
    }

    #[test]
    fn what_does_not_count_leaves_an_edge() {
        let mut mesh = hinge(0.0, 1.0);
        mesh.materials[1] = MaterialId(1);
        let creases = Creases::find(&[mesh], |id| id == MaterialId(0));
        let mut inwards: Vec<_> = all(&creases).iter().map(|c| c.inward.to_array()).collect();
        inwards.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let half = 0.5_f32.sqrt();
        assert_eq!(inwards.len(), 3);
        for (inward, expected) in
            inwards.iter().zip([[-half, -half, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
        {
            let error = Vec3::from(*inward) - Vec3::from(expected);
            assert!(error.length() < 1e-6, "{inward:?} for {expected:?}");
        }
        assert!(all(&creases).iter().all(|c| c.normal == Vec3A::Z));
    }

    #[test]
    fn a_fan_of_many_triangles_is_no_trap() {
        let mut mesh = Mesh { positions: vec![Vec3::ZERO, Vec3::Z], ..Mesh::default() };
        let n = 2000;
        for i in 0..n {
            let (sin, cos) = base::math::sin_cos(i as f32 * 3e-3);
            mesh.positions.push(Vec3::new(cos, sin, 0.0));
            mesh.triangles.push([0, 1, i + 2]);
            mesh.materials.push(MaterialId(0));
        }
        let at_axis =
            all(&find(&mesh)).iter().filter(|c| c.to == Vec3A::Z && c.from == Vec3A::ZERO).count();
        assert!(at_axis <= MAX_AT_EDGE, "{at_axis} creases");
    }

    #[test]
    fn all_that_are_near_are_found() {
        assert!(all(&Creases::find(&[], |_| true)).is_empty());
        Creases::find(&[], |_| true).near(Vec3A::ZERO, 1.0, |_| panic!("there is nothing"));
        let mut rng = Rng::new(0, Stream::Test, 0);
        for n in [1, 2, 500_u32] {
            let mut mesh = Mesh::default();
            for i in 0..n {
                let middle = warp::uniform_sphere(rng.next_2d());
                let mut corner = || Vec3::from(middle + warp::uniform_sphere(rng.next_2d()) * 0.1);
                mesh.positions.extend([corner(), corner(), corner()]);
                mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
                mesh.materials.push(MaterialId(0));
            }
            let creases = find(&mesh);
            assert_eq!(all(&creases).len(), 3 * n as usize);
            for _ in 0..200 {
                let (point, radius) = (warp::uniform_sphere(rng.next_2d()), 0.1 * rng.next_f32());
                let mut found = Vec::new();
                creases.near(point, radius, |c| {
                    found.push(*c);
                    true
                });
                let near = all(&creases).into_iter().filter(|c| {
                    let edge = c.to - c.from;
                    let t = ((point - c.from).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
                    (c.from + edge * t - point).length() < radius
                });
                near.for_each(|c| assert!(found.contains(&c), "{c:?} near {point}"));
                let mut n_visited = 0;
                creases.near(point, radius, |_| {
                    n_visited += 1;
                    false
                });
                assert!(n_visited <= 1, "{n_visited} visits after the first answer");
            }
        }
    }
}
