//! The shading normals of a triangle, packed.

use glam::{Vec3, Vec3A, Vec4};

/// Unit vectors at the corners of a triangle, or none.
///
/// Octahedral map (Cigolle et al. 2014, "A Survey of Efficient Representations for Independent Unit Vectors", section 3.3) with 21
/// bits a coordinate: off by less than three millionths, and those along axes by nothing.
///
/// Three lanes hold the first coordinate of a corner each and 11 bits of the second, whose others lie in the last lane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct CornerNormals([u32; 4]);

const BITS: u32 = 21;
/// Of the second coordinate, bits in the lane of its corner, and in the last one.
const LOW: u32 = 32 - BITS;
const HIGH: u32 = BITS - LOW;
const LARGEST: f32 = ((1 << (BITS - 1)) - 1) as f32;
/// In the last lane: there are normals.
const IS_THERE: u32 = 1 << 31;

impl CornerNormals {
    pub(crate) fn new(normals: [Vec3; 3]) -> Self {
        let mut lanes = [0, 0, 0, IS_THERE];
        for (corner, normal) in normals.into_iter().enumerate() {
            let [u, v] = encode(normal);
            lanes[corner] = u | v << BITS;
            lanes[3] |= v >> LOW << (HIGH * corner as u32);
        }
        Self(lanes)
    }

    /// Their sum with these weights, if there are any: not of unit length.
    #[inline(always)]
    pub(crate) fn blend(&self, weights: Vec3) -> Option<Vec3A> {
        let Self([a, b, c, last]) = *self;
        if last & IS_THERE == 0 {
            return None;
        }
        let first = |lane: u32| number(lane << LOW);
        let second = |lane: u32, corner: u32| {
            number((lane >> BITS | last >> (HIGH * corner) << LOW) << (32 - BITS))
        };
        // One coordinate of all corners in each vector.
        let u = Vec4::new(first(a), first(b), first(c), 0.0) / LARGEST;
        let v = Vec4::new(second(a, 0), second(b, 1), second(c, 2), 0.0) / LARGEST;
        let z = Vec4::ONE - u.abs() - v.abs();
        let folded = (-z).max(Vec4::ZERO);
        let (x, y) = (u - folded.copysign(u), v - folded.copysign(v));
        let length = (x * x + y * y + z * z).sqrt();
        let weights = weights.extend(0.0) / length;
        Some(Vec3A::new(x.dot(weights), y.dot(weights), z.dot(weights)))
    }
}

/// Two numbers of 21 bits.
fn encode(n: Vec3) -> [u32; 2] {
    let size = n.x.abs() + n.y.abs() + n.z.abs();
    let [x, y] = [n.x / size, n.y / size];
    let folded = |p: f32, q: f32| (1.0 - q.abs()).copysign(p);
    let [u, v] = if n.z < 0.0 { [folded(x, y), folded(y, x)] } else { [x, y] };
    [u, v].map(|p| (p.clamp(-1.0, 1.0) * LARGEST).round() as i32 as u32 & ((1 << BITS) - 1))
}

/// The signed number in the highest bits.
#[inline(always)]
fn number(bits: u32) -> f32 {
    (bits as i32 >> (32 - BITS)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Rng, Stream, warp};

    #[test]
    fn normals_are_found_again_and_axes_exactly() {
        let at = |corner: usize| {
            Vec3::from_array(std::array::from_fn(|i| f32::from(u8::from(i == corner))))
        };
        let mut rng = Rng::new(0, Stream::Test, 0);
        let mut largest = 0.0_f32;
        for _ in 0..100_000 {
            let normals = [(); 3].map(|()| Vec3::from(warp::uniform_sphere(rng.next_2d())));
            let packed = CornerNormals::new(normals);
            for (corner, normal) in normals.into_iter().enumerate() {
                let found = packed.blend(at(corner)).expect("normals");
                largest = largest.max((found - Vec3A::from(normal)).length());
            }
        }
        assert!((1e-7..3e-6).contains(&largest), "{largest}");
        let axes = [Vec3::X, Vec3::Y, Vec3::Z];
        for normals in [axes, axes.map(|axis| -axis)] {
            let packed = CornerNormals::new(normals);
            for (corner, normal) in normals.into_iter().enumerate() {
                assert_eq!(packed.blend(at(corner)), Some(normal.into()));
            }
        }
    }

    #[test]
    fn the_sum_is_weighted_and_none_is_none() {
        let packed = CornerNormals::new([Vec3::X, Vec3::Y, -Vec3::Z]);
        let weights = Vec3::new(0.5, 0.25, 0.125);
        assert_eq!(packed.blend(weights), Some(Vec3A::new(0.5, 0.25, -0.125)));
        assert_eq!(CornerNormals::default().blend(weights), None);
    }
}
