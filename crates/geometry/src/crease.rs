//! Where smooth parts of the surfaces end.

use base::hash_u64;
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
        let mut creases = sharp_sides(meshes, counts, AT_ONCE);
        // By the ends, then in the order of the triangles.
        creases.sort_unstable_by_key(|(side, place)| (side.ends, *place));
        let creases: Vec<Crease> = creases.into_iter().map(|(side, _)| side.crease).collect();

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

/// Sides that are looked at together: bounds the memory, whatever the mesh.
pub(crate) const AT_ONCE: usize = 1 << 25;

/// The sides that are creases, each with its place: three times the number of the triangle among all, and which side it is.
///
/// Sides at one edge are brought together by a digest of its ends, a share of all digests at a time: sides themselves
/// would take 336 bytes a triangle.
fn sharp_sides(
    meshes: &[Mesh],
    counts: impl Fn(MaterialId) -> bool,
    at_once: usize,
) -> Vec<(Side, u64)> {
    let firsts: Vec<u64> = (meshes.iter())
        .scan(0, |first, mesh| {
            let this = *first;
            *first += mesh.triangles.len() as u64;
            Some(this)
        })
        .collect();
    let side_at = |place: u64| {
        let triangle = place / 3;
        let mesh = firsts.partition_point(|&first| first <= triangle) - 1;
        side(&meshes[mesh], (triangle - firsts[mesh]) as usize, (place % 3) as usize)
    };
    let n_sides: usize = meshes.iter().map(|mesh| 3 * mesh.triangles.len()).sum();
    let n_shares = n_sides.div_ceil(at_once).max(1);
    let share_of = |digest: u64| ((u128::from(digest) * n_shares as u128) >> 64) as usize;
    let mut creases = Vec::new();
    let (mut digests, mut at_edge) = (Vec::new(), Vec::new());
    for share in 0..n_shares {
        digests.clear();
        for (mesh, first) in meshes.iter().zip(&firsts) {
            let triangles = (0..mesh.triangles.len()).filter(|&t| counts(mesh.materials[t]));
            for (t, k) in triangles.flat_map(|t| (0..3).map(move |k| (t, k))) {
                let digest = digest(ends(mesh, t, k));
                if share_of(digest) == share {
                    digests.push((digest, 3 * (first + t as u64) + k as u64));
                }
            }
        }
        digests.sort_unstable();
        for alike in digests.chunk_by(|a, b| a.0 == b.0) {
            at_edge.clear();
            at_edge.extend(alike.iter().map(|&(_, place)| (side_at(place), place)));
            // Edges of one digest are as good as never there, but they may be.
            at_edge.sort_by_key(|(side, _)| side.ends);
            for at_edge in at_edge.chunk_by(|a: &(Side, u64), b| a.0.ends == b.0.ends) {
                let at_edge = &at_edge[..at_edge.len().min(MAX_AT_EDGE)];
                let turned = at_edge.iter().map(|(side, place)| {
                    let turn = at_edge.iter().map(|(other, _)| turn(side, other));
                    let turn = turn.reduce(f32::min).unwrap_or(f32::INFINITY);
                    (Side { crease: Crease { turn, ..side.crease }, ..*side }, *place)
                });
                creases.extend(turned.filter(|(side, _)| side.crease.turn > LEAST_TURN));
            }
        }
    }
    creases
}

/// The corners between which a side of a triangle lies, the lower bits first, and these.
#[inline]
fn ordered(mesh: &Mesh, t: usize, k: usize) -> [(usize, [u32; 3]); 2] {
    let indices = mesh.triangles[t];
    // Adding 0 turns -0 into it.
    let bits = |corner: usize| {
        let p = mesh.positions[indices[corner] as usize] + Vec3::ZERO;
        (corner, p.to_array().map(f32::to_bits))
    };
    let (a, b) = (bits(k), bits((k + 1) % 3));
    if a.1 <= b.1 { [a, b] } else { [b, a] }
}

#[inline]
fn ends(mesh: &Mesh, t: usize, k: usize) -> [[u32; 3]; 2] {
    ordered(mesh, t, k).map(|(_, bits)| bits)
}

/// That of the lower end first: sides that share it lie together when digests are sorted, and so do their triangles in
/// the processor's cache.
#[inline]
fn digest(ends: [[u32; 3]; 2]) -> u64 {
    let [a, b] = ends.map(|[x, y, z]| hash_u64(u64::from(x) << 32 | u64::from(y), u64::from(z)));
    a >> 32 << 32 | b >> 32
}

/// Side `k` of a triangle, from its corner `k` to the next.
#[inline]
fn side(mesh: &Mesh, t: usize, k: usize) -> Side {
    let corners = mesh.corners(t).map(Vec3A::from);
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
    let along = corners[(k + 1) % 3] - corners[k];
    let inward = normal.cross(along).normalize_or_zero();
    let [(a, start), (b, end)] = ordered(mesh, t, k);
    Side {
        ends: [start, end],
        crease: Crease { from: corners[a], to: corners[b], normal, inward, turn: f32::INFINITY },
    }
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
    fn shares_of_the_sides_hold_the_creases_of_all() {
        let mut rng = Rng::new(1, Stream::Test, 0);
        let mut meshes = vec![Mesh::default(); 3];
        for (i, mesh) in meshes.iter_mut().enumerate() {
            mesh.positions = (0..30).map(|_| warp::uniform_sphere(rng.next_2d()).into()).collect();
            for _ in 0..200 * i {
                mesh.triangles.push([0; 3].map(|_| rng.next_u32() % 30));
                mesh.materials.push(MaterialId(0));
            }
        }
        let found = |at_once: usize| {
            let mut sides = sharp_sides(&meshes, |_| true, at_once);
            sides.sort_unstable_by_key(|(_, place)| *place);
            sides.into_iter().map(|(side, place)| (side.crease, place)).collect::<Vec<_>>()
        };
        let all = found(AT_ONCE);
        assert!(all.len() > 1000);
        for at_once in [1, 100, 1799] {
            assert!(found(at_once) == all, "{at_once} sides at once");
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
