//! How much memory surfaces take.

use crate::crease::AT_ONCE;
use crate::{Mesh, Sphere};

/// Bytes that surfaces take beside the meshes that they are made from. Measured on meshes of 2, 10 and 50 million triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory {
    /// At most, while [`Accel`](crate::Accel) and [`Creases`](crate::Creases) are built.
    pub building: u64,
    /// When they are.
    pub built: u64,
}

impl Memory {
    /// Of some meshes and spheres.
    ///
    /// How many edges are creases isn't known: as many as there would be if all vertices at borders were open ends of a
    /// surface, which is none of a closed mesh and all of triangles that share no vertex.
    pub fn of<'a>(meshes: impl IntoIterator<Item = &'a Mesh>, spheres: &[Sphere]) -> Self {
        /// Nodes of two children, and the costs by which they are made into nodes of eight: see `build_bvh`.
        const BUILDING: u64 = 210;
        /// A primitive, normals included, and its share of the nodes: there is one for each 8 to 13 primitives.
        const BUILT: u64 = 91;
        const UVS: u64 = 24;
        const CREASE_BUILDING: u64 = 260;
        const CREASE_BUILT: u64 = 160;

        let (mut n_triangles, mut n_creases) = (0, 0);
        let mut has_uvs = false;
        for mesh in meshes {
            let n = mesh.triangles.len() as u64;
            n_triangles += n;
            n_creases += (2 * mesh.positions.len() as u64).saturating_sub(n).min(3 * n);
            has_uvs |= !mesh.uvs.is_empty();
        }
        let uvs = if has_uvs { UVS * n_triangles } else { 0 };
        let n = n_triangles + spheres.len() as u64;
        let accel = BUILT * n + uvs;
        let sides = 16 * (3 * n_triangles).min(AT_ONCE as u64);
        let creases = (accel + sides).max(accel + CREASE_BUILDING * n_creases);
        Self { building: creases.max(BUILDING * n), built: accel + CREASE_BUILT * n_creases }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn what_shares_no_vertex_has_creases_at_all_sides() {
        let mesh = |n_vertices: usize| Mesh {
            positions: vec![Vec3::ZERO; n_vertices],
            triangles: vec![[0, 1, 2]; 1000],
            ..Mesh::default()
        };
        let of = |n_vertices| Memory::of([&mesh(n_vertices)], &[]);
        assert_eq!(of(502), Memory { building: 210_000, built: 91_640 });
        assert_eq!(of(3000), Memory { building: 871_000, built: 571_000 });
        assert_eq!(Memory::of([], &[]), Memory { building: 0, built: 0 });
    }
}
