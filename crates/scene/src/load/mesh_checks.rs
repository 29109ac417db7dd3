//! What every mesh must pass before rays meet it.

use std::collections::{BTreeMap, BTreeSet};

use geometry::Mesh;
use glam::{DVec3, Vec3};

/// More triangles than this on one spot make the BVH deep and its construction slow.
pub(super) const MAX_STACK: usize = 1000;

/// Whether a triangle has a normal, as the surfaces compute it.
pub(super) fn has_area([a, b, c]: [Vec3; 3]) -> bool {
    let (u, v) = (b - a, c - a);
    if u.cross(v).length_squared() < f32::MIN_POSITIVE {
        return false;
    }
    // Flatter than the rounding of its corners: what single precision takes for its normal is noise.
    let cross = u.as_dvec3().cross(v.as_dvec3()).length();
    let longest2 = u.length_squared().max(v.length_squared()).max((c - b).length_squared());
    cross > f64::from(longest2) * f64::from(f32::EPSILON)
}

/// Makes normals unit vectors; those without a length become the mean of the faces around. Returns how many those were.
pub(super) fn repair_normals(mesh: &mut Mesh) -> usize {
    for n in &mut mesh.normals {
        *n = n.as_dvec3().normalize_or_zero().as_vec3();
    }
    let missing: BTreeSet<u32> = (0..mesh.normals.len() as u32)
        .filter(|&i| mesh.normals[i as usize] == Vec3::ZERO)
        .collect();
    if missing.is_empty() {
        return 0;
    }
    let mut sums: BTreeMap<u32, DVec3> = missing.iter().map(|&i| (i, DVec3::ZERO)).collect();
    for (t, corners) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(t).map(|p| p.as_dvec3());
        let normal = (b - a).cross(c - a);
        for i in corners {
            if let Some(sum) = sums.get_mut(i) {
                *sum += normal;
            }
        }
    }
    let mut repaired = 0;
    for (i, sum) in sums {
        // Vertices without a face may keep any normal.
        repaired += usize::from(sum != DVec3::ZERO);
        mesh.normals[i as usize] = sum.try_normalize().unwrap_or(DVec3::Y).as_vec3();
    }
    repaired
}

/// What is wrong with the hull of a glass body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct HullFaults {
    /// Edges that no second triangle shares.
    pub(super) open_edges: usize,
    /// Edges whose triangles show different sides.
    pub(super) twisted_edges: usize,
    /// Whether the front is inside.
    pub(super) inside_out: bool,
}

/// Looks at the hull of all triangles that are of glass. Turns it around if it is inside out.
pub(super) fn check_hull(mesh: &mut Mesh, is_glass: &[bool]) -> HullFaults {
    let glass: Vec<bool> = mesh.materials.iter().map(|m| is_glass[usize::from(m.0)]).collect();
    if !glass.contains(&true) {
        return HullFaults::default();
    }
    let by_index: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    let mut faults = edge_faults(mesh, &glass, &by_index);
    if faults != HullFaults::default() {
        // Vertices are often doubled where normals or texture coordinates jump.
        faults = edge_faults(mesh, &glass, &same_places(&mesh.positions));
    }
    if faults == HullFaults::default() {
        let center = mesh.bounds().center().as_dvec3();
        let volume: f64 = (0..mesh.triangles.len())
            .filter(|&t| glass[t])
            .map(|t| {
                let [a, b, c] = mesh.corners(t).map(|p| p.as_dvec3() - center);
                a.dot(b.cross(c))
            })
            .sum();
        faults.inside_out = volume < 0.0;
    }
    if faults.inside_out {
        let triangles = mesh.triangles.iter_mut().zip(glass);
        triangles.filter(|(_, glass)| *glass).for_each(|(t, _)| t.swap(1, 2));
    }
    faults
}

/// Counts the faulty edges of glass triangles. The hull may be continued by triangles that aren't of glass.
fn edge_faults(mesh: &Mesh, glass: &[bool], places: &[u32]) -> HullFaults {
    // One number an edge: its lower place, its higher place, whether it runs downwards, whether it is of glass.
    let mut edges = Vec::with_capacity(3 * mesh.triangles.len());
    for (t, &glass) in mesh.triangles.iter().zip(glass) {
        let corners = t.map(|i| u64::from(places[i as usize]));
        for i in 0..3 {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            if a != b {
                let downwards = u64::from(a > b);
                edges.push(a.min(b) << 33 | a.max(b) << 2 | downwards << 1 | u64::from(glass));
            }
        }
    }
    edges.sort_unstable();
    let mut faults = HullFaults::default();
    for edge in edges.chunk_by(|a, b| a >> 2 == b >> 2) {
        let n_down = edge.iter().filter(|&e| e & 2 != 0).count();
        if edge.iter().any(|e| e & 1 != 0) {
            if edge.len() % 2 == 1 {
                faults.open_edges += 1;
            } else if 2 * n_down != edge.len() {
                faults.twisted_edges += 1;
            }
        }
    }
    faults
}

/// For each position the first index of all that are in the same place.
fn same_places(positions: &[Vec3]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    let key = |&i: &u32| (place_bits(positions[i as usize]), i);
    order.sort_unstable_by_key(key);
    let mut places = vec![0; positions.len()];
    for same in order.chunk_by(|&i, &j| positions[i as usize] == positions[j as usize]) {
        same.iter().for_each(|&i| places[i as usize] = same[0]);
    }
    places
}

/// The bits of a position; adding zero turns -0 into 0, which is the same place.
fn place_bits(p: Vec3) -> [u32; 3] {
    (p + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// How many triangles were dropped, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Dropped {
    pub(super) without_area: usize,
    pub(super) duplicates: usize,
}

/// Drops triangles without area, and all but the first of those with the same three corners.
pub(super) fn drop_useless(mesh: &mut Mesh) -> Dropped {
    let mut keep: Vec<bool> =
        (0..mesh.triangles.len()).map(|t| has_area(mesh.corners(t))).collect();
    let without_area = keep.iter().filter(|k| !**k).count();
    let duplicates = mark_duplicates(mesh, &mut keep);
    if without_area + duplicates > 0 {
        let mut kept = keep.iter();
        mesh.triangles.retain(|_| *kept.next().expect("one flag a triangle"));
        let mut kept = keep.iter();
        mesh.materials.retain(|_| *kept.next().expect("one flag a triangle"));
    }
    Dropped { without_area, duplicates }
}

fn mark_duplicates(mesh: &Mesh, keep: &mut [bool]) -> usize {
    let hashes: Vec<u64> = mesh.positions.iter().map(|&p| hash(place_bits(p))).collect();
    // The order of the corners doesn't matter to a sum.
    let of_triangle =
        |t: &[u32; 3]| t.iter().fold(0_u64, |sum, &i| sum.wrapping_add(hashes[i as usize]));
    let suspects = repeated(mesh.triangles.iter().map(of_triangle).collect());
    let mut seen = BTreeSet::new();
    let mut n = 0;
    if suspects.is_empty() {
        return n;
    }
    for (t, keep) in mesh.triangles.iter().zip(keep) {
        if *keep && suspects.contains(&of_triangle(t)) {
            let mut corners = t.map(|i| place_bits(mesh.positions[i as usize]));
            corners.sort_unstable();
            *keep = seen.insert(corners);
            n += usize::from(!*keep);
        }
    }
    n
}

/// The values that occur more than once.
fn repeated(mut values: Vec<u64>) -> BTreeSet<u64> {
    values.sort_unstable();
    values.windows(2).filter(|w| w[0] == w[1]).map(|w| w[0]).collect()
}

/// The largest number of triangles with the same center and box, and the first mesh that holds one of them.
pub(super) fn largest_stack<'a>(
    meshes: impl Iterator<Item = &'a Mesh> + Clone,
) -> Option<(usize, usize)> {
    let spots_of = |mesh: &'a Mesh| (0..mesh.triangles.len()).map(|t| spot(mesh.corners(t)));
    let mut spots: Vec<u64> = meshes.clone().flat_map(spots_of).collect();
    spots.sort_unstable();
    let stack = spots.chunk_by(|a, b| a == b).max_by_key(|stack| stack.len())?;
    let mut meshes = meshes;
    let mesh = meshes.position(|mesh| spots_of(mesh).any(|spot| spot == stack[0]))?;
    Some((stack.len(), mesh))
}

/// A digest of the center and the box of a triangle.
fn spot([a, b, c]: [Vec3; 3]) -> u64 {
    let (min, max) = (a.min(b).min(c), a.max(b).max(c));
    let center = (a.as_dvec3() + b.as_dvec3() + c.as_dvec3()).as_vec3();
    // Unlike sums, a chain of products needs no further mixing.
    [min, max, center].into_iter().flat_map(place_bits).fold(0, |h: u64, word| {
        (h.rotate_left(23) ^ u64::from(word)).wrapping_mul(0xd134_2543_de82_ef95)
    })
}

/// Mixes the bits of three words (the finalizer of `SplitMix64`, Steele et al. 2014).
fn hash([x, y, z]: [u32; 3]) -> u64 {
    let mut h = 0;
    for word in [x, y, z] {
        h = (h ^ u64::from(word)).wrapping_add(0x9e37_79b9_7f4a_7c15);
        h = (h ^ h >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h = (h ^ h >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        h ^= h >> 31;
    }
    h
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::shapes::cuboid;
    use geometry::MaterialId;

    fn cube() -> Mesh {
        cuboid(Vec3::ZERO, Vec3::ONE, MaterialId(0))
    }

    #[test]
    fn closed_glass_passes() {
        let mut mesh = cube();
        let before = mesh.triangles.clone();
        assert_eq!(check_hull(&mut mesh, &[true]), HullFaults::default());
        assert_eq!(mesh.triangles, before);
        // With corners of its own for every triangle, as after smoothing groups.
        let mut split = Mesh { materials: mesh.materials.clone(), ..Mesh::default() };
        for t in 0..12 {
            split.triangles.push([0, 1, 2].map(|i| (3 * t + i) as u32));
            // -0 is in the same place as 0.
            let sign = if t % 2 == 0 { 1.0 } else { -1.0 };
            let signed = |x: f32| if x == 0.0 { x.copysign(sign) } else { x };
            split
                .positions
                .extend(mesh.corners(t).map(|p| Vec3::from_array(p.to_array().map(signed))));
        }
        assert_eq!(check_hull(&mut split, &[true]), HullFaults::default());
    }

    #[test]
    fn faults_of_the_hull_are_counted() {
        let mut open = cube();
        open.triangles.pop();
        open.materials.pop();
        assert_eq!(check_hull(&mut open, &[true]).open_edges, 3);
        assert_eq!(check_hull(&mut open, &[false]), HullFaults::default());

        let mut twisted = cube();
        twisted.triangles[0].swap(0, 1);
        assert_eq!(check_hull(&mut twisted, &[true]).twisted_edges, 3);

        let mut inside_out = cube();
        inside_out.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        assert!(check_hull(&mut inside_out, &[true]).inside_out);
        assert_eq!(check_hull(&mut inside_out, &[true]), HullFaults::default());

        // A hull may be closed by another material, such as a painted base.
        let mut painted = cube();
        painted.materials[..2].fill(MaterialId(1));
        assert_eq!(check_hull(&mut painted, &[true, false]), HullFaults::default());
    }

    #[test]
    fn useless_triangles_are_dropped() {
        let mut mesh = cube();
        let n = mesh.positions.len() as u32;
        // A copy with corners of its own and turned around, a needle, a point, and a sliver thinner than rounding.
        let [a, b, c] = mesh.corners(5);
        mesh.positions.extend([c, b, a, Vec3::new(0.5, 0.5, 0.5), Vec3::new(0.5, 1e-9, 0.0)]);
        mesh.triangles.extend([[n, n + 1, n + 2], [0, 1, 1], [n + 3; 3], [0, 1, n + 4]]);
        mesh.materials.extend([0, 1, 2, 3].map(MaterialId));
        assert_eq!(drop_useless(&mut mesh), Dropped { without_area: 3, duplicates: 1 });
        assert_eq!(mesh.triangles, cube().triangles);
        assert_eq!(mesh.materials, cube().materials);
        assert_eq!(drop_useless(&mut mesh), Dropped::default());
    }

    #[test]
    fn small_triangles_are_kept() {
        for scale in [1e-6, 1e-3, 1.0, 1e5] {
            let corners = [Vec3::ZERO, Vec3::X, Vec3::new(0.5, 1e-4, 0.0)].map(|p| p * scale);
            assert!(has_area(corners), "{scale}");
        }
    }

    #[test]
    fn normals_become_unit_vectors() {
        let mut mesh = cube();
        mesh.normals = vec![Vec3::new(0.0, 3e30, 0.0); 8];
        mesh.normals[7] = Vec3::ZERO;
        mesh.normals[6] = Vec3::new(0.0, -1e-30, 0.0);
        assert_eq!(repair_normals(&mut mesh), 1);
        assert_eq!(mesh.normals[0], Vec3::Y);
        assert_eq!(mesh.normals[6], -Vec3::Y);
        assert!(mesh.normals[7].is_normalized() && mesh.normals[7].min_element() > 0.3);
        // The faces around pull towards the corner they meet in.
        assert!(mesh.normals[7].dot(Vec3::ONE.normalize()) > 0.9);
    }

    #[test]
    fn stacks_are_measured() {
        let one = cube();
        let mut many = cube();
        // All six ways to write one triangle lie on one spot.
        for _ in 0..50 {
            many.triangles.extend([
                [0, 4, 6],
                [4, 6, 0],
                [6, 0, 4],
                [6, 4, 0],
                [4, 0, 6],
                [0, 6, 4],
            ]);
        }
        assert_eq!(largest_stack([&one, &many].into_iter()), Some((302, 0)));
        assert_eq!(largest_stack([&one].into_iter()).map(|s| s.0), Some(1));
        assert_eq!(largest_stack(std::iter::empty()), None);
    }
}
