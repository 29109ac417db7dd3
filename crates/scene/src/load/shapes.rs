//! Quads and boxes.

use geometry::{MaterialId, Mesh};
use glam::Vec3;

/// A parallelogram whose front is the side that `edges[0] x edges[1]` points to.
pub(super) fn quad(corner: Vec3, [a, b]: [Vec3; 2], material: MaterialId) -> Mesh {
    Mesh {
        positions: vec![corner, corner + a, corner + a + b, corner + b],
        normals: Vec::new(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![material; 2],
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
        normals: Vec::new(),
        triangles: FACES.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        materials: vec![material; 12],
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
        let quad = quad(Vec3::ZERO, [Vec3::X, Vec3::Y], MaterialId(0));
        for t in 0..2 {
            let [a, b, c] = quad.corners(t);
            assert_eq!((b - a).cross(c - a), Vec3::Z);
        }
    }
}
