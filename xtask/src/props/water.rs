//! The water of the pool: a closed body whose top is in waves.

use base::math;
use glam::{Vec2, Vec3};

/// Squares along x and z.
const SQUARES: [u32; 2] = [120, 72];

/// Half the extent along x and z: a little more than the basin's, so that walls and floor of the basin lie in the water.
const HALF: Vec2 = Vec2::new(2.55, 1.55);

/// Where the water ends below, under the floor of the basin.
const BOTTOM: f32 = -1.45;

/// Waves as wave vectors, heights, and phases. Their curvatures add up to about 5 per unit of length, so that light meets
/// near the floor.
const WAVES: [(Vec2, f32, f32); 6] = [
    (Vec2::new(5.1, 2.3), 0.011, 0.3),
    (Vec2::new(-3.2, 6.7), 0.0095, 1.9),
    (Vec2::new(9.3, -4.1), 0.0062, 4.2),
    (Vec2::new(2.2, 11.8), 0.005, 2.7),
    (Vec2::new(-13.4, 5.6), 0.0036, 5.5),
    (Vec2::new(8.8, 14.9), 0.0026, 0.8),
];

/// Height above the level of still water, and the slope.
fn surface(at: Vec2) -> (f32, Vec2) {
    let mut sum = (0.0, Vec2::ZERO);
    for (k, height, phase) in WAVES {
        let (sin, cos) = math::sin_cos(k.dot(at) + phase);
        sum.0 += height * sin;
        sum.1 += k * (height * cos);
    }
    sum
}

/// The body as binary PLY: the top with smooth normals, the sides and the bottom with those of flat faces.
pub(super) fn ply() -> Vec<u8> {
    let [nx, nz] = SQUARES;
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    let place = |i: u32, k: u32| {
        (Vec2::new(i as f32 / nx as f32, k as f32 / nz as f32) * 2.0 - Vec2::ONE) * HALF
    };
    let top = |i: u32, k: u32| {
        let at = place(i, k);
        let (height, slope) = surface(at);
        (Vec3::new(at.x, height, at.y), Vec3::new(-slope.x, 1.0, -slope.y).normalize())
    };
    for k in 0..=nz {
        vertices.extend((0..=nx).map(|i| top(i, k)));
    }
    let index = |i: u32, k: u32| k * (nx + 1) + i;
    for (k, i) in (0..nz).flat_map(|k| (0..nx).map(move |i| (k, i))) {
        let [a, b, c, d] =
            [(i, k), (i, k + 1), (i + 1, k + 1), (i + 1, k)].map(|(i, k)| index(i, k));
        faces.extend([[a, b, c], [a, c, d]]);
    }
    // Around the rim, counterclockwise from above, with the normal of each side.
    let sides: [(Vec3, Vec<(u32, u32)>); 4] = [
        (Vec3::Z, (0..=nx).map(|i| (i, nz)).collect()),
        (Vec3::X, (0..=nz).rev().map(|k| (nx, k)).collect()),
        (Vec3::NEG_Z, (0..=nx).rev().map(|i| (i, 0)).collect()),
        (Vec3::NEG_X, (0..=nz).map(|k| (0, k)).collect()),
    ];
    let mut rim = Vec::new();
    for (normal, way) in sides {
        let first = vertices.len() as u32;
        for &(i, k) in &way {
            let upper = top(i, k).0;
            vertices.extend([(upper, normal), (upper.with_y(BOTTOM), normal)]);
        }
        for at in (0..way.len() as u32 - 1).map(|n| first + 2 * n) {
            faces.extend([[at, at + 1, at + 3], [at, at + 3, at + 2]]);
        }
        rim.extend(way[1..].iter().map(|&(i, k)| top(i, k).0.with_y(BOTTOM)));
    }
    let middle = vertices.len() as u32;
    vertices.push((Vec3::new(0.0, BOTTOM, 0.0), Vec3::NEG_Y));
    vertices.extend(rim.iter().map(|&p| (p, Vec3::NEG_Y)));
    let n = rim.len() as u32;
    faces.extend((0..n).map(|i| [middle, middle + 1 + (i + 1) % n, middle + 1 + i]));

    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\ncomment made by cargo xtask props\nelement vertex {}\n\
         property float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        faces.len()
    )
    .into_bytes();
    for (position, normal) in vertices {
        let numbers = position.to_array().into_iter().chain(normal.to_array());
        bytes.extend(numbers.flat_map(f32::to_le_bytes));
    }
    for face in faces {
        bytes.push(3);
        bytes.extend(face.into_iter().flat_map(u32::to_le_bytes));
    }
    bytes
}
