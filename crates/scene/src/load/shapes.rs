//! Quads and boxes.

use geometry::{MaterialId, Mesh};
use glam::{Vec2, Vec3};

/// The corners of the unit square, counterclockwise.
const SQUARE: [Vec2; 4] = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];

/// A parallelogram whose front is the side that `edges[0] x edges[1]` points to.
pub(super) fn quad(corner: Vec3, [a, b]: [Vec3; 2], material: MaterialId) -> Mesh {
    Mesh {
        positions: vec![corner, corner + a, corner + a + b, corner + b],
        uvs: SQUARE.to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![material; 2],
        ..Mesh::default()
    }
}

/// An axis-aligned box with its front sides outward.
pub(super) fn cuboid(min: Vec3, max: Vec3, material: MaterialId) -> Mesh {
    // Corner i takes the upper x, y or z where bit 0, 1 or 2 is set. Triangles of a face stand side by side, so that
    // an emissive face is found to be a rectangle.
    let corner = |i: u32| {
        let pick = |bit: u32, low: f32, high: f32| if i >> bit & 1 == 1 { high } else { low };
        Vec3::new(pick(0, min.x, max.x), pick(1, min.y, max.y), pick(2, min.z, max.z))
    };
    const FACES: [[u32; 4]; 6] =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    Mesh {
        positions: (0..8).map(corner).collect(),
        triangles: FACES.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        materials: vec![material; 12],
        ..Mesh::default()
    }
}

/// Gives each side of a [`cuboid`] corners of its own with texture coordinates: the unit square, upright as seen from
/// outside.
pub(super) fn unfold(mesh: &mut Mesh) {
    // Which corner of the square each side begins with.
    const FIRST: [usize; 6] = [0, 1, 0, 3, 1, 0];
    let cut = std::mem::take(mesh);
    mesh.materials = cut.materials;
    for (side, first) in cut.triangles.as_chunks::<2>().0.iter().zip(FIRST) {
        let [[a, b, c], [_, _, d]] = *side;
        let n = mesh.positions.len() as u32;
        mesh.positions.extend([a, b, c, d].map(|i| cut.positions[i as usize]));
        mesh.uvs.extend((0..4).map(|i| SQUARE[(first + i) % 4]));
        mesh.triangles.extend([[n, n + 1, n + 2], [n, n + 2, n + 3]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fronts_are_outward() {
        let mesh = cuboid(Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 6.0, 8.0), MaterialId(0));
        let center = mesh.bounds().center();
        let mut area = 0.0;
        for t in 0..12 {
            let [a, b, c] = mesh.corners(t);
            let normal = (b - a).cross(c - a);
            assert!(normal.dot(a - center) > 0.0, "triangle {t}");
            area += 0.5 * normal.length();
        }
        assert_eq!(area, 2.0 * (3.0 * 4.0 + 4.0 * 5.0 + 3.0 * 5.0));
        let mut unfolded = mesh.clone();
        unfold(&mut unfolded);
        for t in 0..12 {
            assert_eq!(unfolded.corners(t), mesh.corners(t));
            // Upright: v rises with y, or away from the eye above and towards it below; nothing is mirrored.
            let corners = unfolded.triangles[t].map(|i| i as usize);
            let [p, q, r] = corners.map(|i| unfolded.positions[i]);
            let [a, b, c] = corners.map(|i| unfolded.uvs[i]);
            assert!((b - a).perp_dot(c - a) > 0.0, "triangle {t}");
            let normal = (q - p).cross(r - p).normalize();
            let up = if normal.y.abs() > 0.5 { -Vec3::Z * normal.y } else { Vec3::Y };
            for (side, drawn) in [(q - p, b - a), (r - q, c - b)] {
                assert_eq!(side.dot(up) > 0.0, drawn.y > 0.0, "triangle {t}");
            }
        }
        let quad = quad(Vec3::ZERO, [Vec3::X, Vec3::Y], MaterialId(0));
        for t in 0..2 {
            let [a, b, c] = quad.corners(t);
            assert_eq!((b - a).cross(c - a), Vec3::Z);
        }
    }
}
