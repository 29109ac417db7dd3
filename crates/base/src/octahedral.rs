//! Unit vectors in 16 bits (Cigolle et al. 2014, "A Survey of Efficient Representations for Independent Unit
//! Vectors", section 3.3: octahedral map, two bytes). The error stays below 1.0 degree.

use glam::{Vec2, Vec3A};

fn sign_not_zero(v: Vec2) -> Vec2 {
    Vec2::new(1.0_f32.copysign(v.x), 1.0_f32.copysign(v.y))
}

/// Encodes a unit vector.
pub fn encode_octahedral(v: Vec3A) -> u16 {
    let p = Vec2::new(v.x, v.y) / (v.x.abs() + v.y.abs() + v.z.abs());
    let p = if v.z < 0.0 {
        (Vec2::ONE - Vec2::new(p.y.abs(), p.x.abs())) * sign_not_zero(p)
    } else {
        p
    };
    let quantize = |x: f32| ((x.clamp(-1.0, 1.0) * 127.0).round() as i8) as u8;
    u16::from_le_bytes([quantize(p.x), quantize(p.y)])
}

/// Decodes a unit vector.
#[inline]
pub fn decode_octahedral(code: u16) -> Vec3A {
    let [x, y] = code.to_le_bytes();
    let p = Vec2::new(f32::from(x as i8), f32::from(y as i8)) / 127.0;
    let z = 1.0 - p.x.abs() - p.y.abs();
    let p =
        if z < 0.0 { (Vec2::ONE - Vec2::new(p.y.abs(), p.x.abs())) * sign_not_zero(p) } else { p };
    Vec3A::new(p.x, p.y, z).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Rng, Stream, warp};

    #[test]
    fn error_is_below_one_degree_and_axes_are_exact() {
        for axis in [Vec3A::X, Vec3A::Y, Vec3A::Z] {
            for v in [axis, -axis] {
                assert!((decode_octahedral(encode_octahedral(v)) - v).length() < 1e-6, "{v}");
            }
        }
        let mut rng = Rng::new(0, Stream::Test, 0);
        for _ in 0..100_000 {
            let v = warp::uniform_sphere(rng.next_2d());
            let d = decode_octahedral(encode_octahedral(v));
            assert!(d.dot(v) > 0.99985, "{v} became {d}");
        }
    }
}
