//! Implicit surfaces: a value and its gradient at a point, and ways to join them.
//!
//! Only `+ - * /` and square roots, which IEEE 754 rounds the same way everywhere.

use std::ops::Neg;

use glam::DVec3;

/// The value of a field at a point, and its gradient there.
///
/// Negative inside, positive outside, about the distance to the surface near it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    /// The value.
    pub(crate) value: f64,
    /// Its gradient: points outward, of length about 1 near the surface.
    pub(crate) gradient: DVec3,
}

impl Neg for Sample {
    type Output = Self;
    fn neg(self) -> Self {
        Self { value: -self.value, gradient: -self.gradient }
    }
}

/// A solid of the kit.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Solid {
    /// The points `p` with `|rows * (p - center)| <= 1`.
    Ellipsoid {
        /// The center.
        center: DVec3,
        /// The unit axes, each divided by its radius.
        rows: [DVec3; 3],
    },
    /// The convex hull of two balls: Quilez 2018, "Round Cone".
    RoundCone {
        /// Center of the first ball.
        from: DVec3,
        /// Unit vector to the center of the second.
        axis: DVec3,
        /// The distance of the centers.
        length: f64,
        /// The radii; they differ by less than `length`.
        radii: [f64; 2],
    },
}

impl Solid {
    /// An ellipsoid along the axes of the world.
    pub(crate) const fn upright(center: DVec3, radii: DVec3) -> Self {
        let rows = [
            DVec3::new(1.0 / radii.x, 0.0, 0.0),
            DVec3::new(0.0, 1.0 / radii.y, 0.0),
            DVec3::new(0.0, 0.0, 1.0 / radii.z),
        ];
        Self::Ellipsoid { center, rows }
    }

    /// An ellipsoid whose y axis points along `up` and whose z axis, made perpendicular to it, along `front`.
    pub(crate) fn tilted(center: DVec3, radii: DVec3, up: DVec3, front: DVec3) -> Self {
        let y = up.normalize();
        let z = front.reject_from_normalized(y).normalize();
        Self::Ellipsoid { center, rows: [y.cross(z) / radii.x, y / radii.y, z / radii.z] }
    }

    /// The convex hull of the ball `from`, `radii[0]` and the ball `to`, `radii[1]`.
    pub(crate) fn round_cone(from: DVec3, to: DVec3, radii: [f64; 2]) -> Self {
        let length = from.distance(to);
        Self::RoundCone { from, axis: (to - from) / length, length, radii }
    }

    /// The same in the mirror x = 0.
    pub(crate) fn mirrored(self) -> Self {
        let mirror = DVec3::new(-1.0, 1.0, 1.0);
        match self {
            Self::Ellipsoid { center, rows } => {
                Self::Ellipsoid { center: center * mirror, rows: rows.map(|row| row * mirror) }
            }
            Self::RoundCone { from, axis, length, radii } => {
                Self::RoundCone { from: from * mirror, axis: axis * mirror, length, radii }
            }
        }
    }

    /// The field at `p`. At the center of an ellipsoid the gradient is zero: there is none.
    pub(crate) fn sample(&self, p: DVec3) -> Sample {
        match *self {
            Self::Ellipsoid { center, rows } => ellipsoid(&rows, p - center),
            Self::RoundCone { from, axis, length, radii } => {
                round_cone(axis, length, radii, p - from)
            }
        }
    }
}

/// The union of two solids, its seam rounded over a width `k > 0`.
///
/// The cubic of Quilez 2013, "Smooth minimum": continuous curvature, which glass needs, without an exponential.
pub(crate) fn smooth_union(a: Sample, b: Sample, k: f64) -> Sample {
    let (near, far) = if a.value <= b.value { (a, b) } else { (b, a) };
    let h = (1.0 - (far.value - near.value) / k).max(0.0);
    let weight = 0.5 * h * h;
    Sample {
        value: near.value - h * h * h * k / 6.0,
        gradient: near.gradient * (1.0 - weight) + far.gradient * weight,
    }
}

/// `a` without `b`, the edge rounded over a width `k > 0`.
pub(crate) fn smooth_difference(a: Sample, b: Sample, k: f64) -> Sample {
    -smooth_union(-a, b, k)
}

/// `u (u - 1) / v` with `u = |M q|` and `v = |M^T M q|`: the distance to first order, for every shape of ellipsoid.
fn ellipsoid(rows: &[DVec3; 3], q: DVec3) -> Sample {
    let transposed = |w: DVec3| rows[0] * w.x + rows[1] * w.y + rows[2] * w.z;
    let times = |w: DVec3| DVec3::new(rows[0].dot(w), rows[1].dot(w), rows[2].dot(w));
    let mq = times(q);
    let u = mq.length();
    let g = transposed(mq);
    let v = g.length();
    if v == 0.0 {
        // The value's limit along the shortest axis; every limit is as negative as a radius.
        let shortest = rows.iter().map(|r| 1.0 / r.length()).fold(f64::INFINITY, f64::min);
        return Sample { value: -shortest, gradient: DVec3::ZERO };
    }
    let grad_u = g / u;
    let grad_v = transposed(times(g)) / v;
    Sample {
        value: u * (u - 1.0) / v,
        gradient: (grad_u * (2.0 * u - 1.0) - grad_v * (u * (u - 1.0) / v)) / v,
    }
}

/// The exact distance, in the half plane of `along` the axis and `across` it.
fn round_cone(axis: DVec3, length: f64, [r0, r1]: [f64; 2], q: DVec3) -> Sample {
    let along = q.dot(axis);
    let radial = q - axis * along;
    let across = radial.length();
    // The cone's side leans from the axis by the angle of this sine.
    let sin = (r0 - r1) / length;
    let cos = (1.0 - sin * sin).sqrt();
    let foot = along * cos - across * sin;
    if foot < 0.0 {
        ball(q, r0)
    } else if foot > cos * length {
        ball(q - axis * length, r1)
    } else {
        let gradient = if across > 0.0 { radial * (cos / across) } else { DVec3::ZERO };
        Sample { value: across * cos + along * sin - r0, gradient: gradient + axis * sin }
    }
}

fn ball(q: DVec3, radius: f64) -> Sample {
    let distance = q.length();
    let gradient = if distance > 0.0 { q / distance } else { DVec3::ZERO };
    Sample { value: distance - radius, gradient }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kit() -> [Solid; 3] {
        let c = DVec3::new(0.1, -0.2, 0.3);
        [
            Solid::upright(c, DVec3::new(0.3, 0.5, 0.4)),
            Solid::tilted(c, DVec3::new(0.2, 0.6, 0.3), DVec3::new(0.3, 1.0, -0.2), DVec3::Z),
            Solid::round_cone(c, DVec3::new(0.5, 0.3, -0.1), [0.3, 0.1]),
        ]
    }

    fn assert_gradient(name: &str, field: impl Fn(DVec3) -> Sample) {
        let h = 1e-5;
        for i in 0..200 {
            let t = f64::from(i);
            let p = DVec3::new((t * 0.618) % 1.0, (t * 0.755) % 1.0, (t * 0.57) % 1.0) * 1.6 - 0.8;
            let slope = |e: DVec3| (field(p + e * h).value - field(p - e * h).value) / (2.0 * h);
            let numeric = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
            let analytic = field(p).gradient;
            assert!((numeric - analytic).length() < 1e-4, "{name} at {p}: {numeric} {analytic}");
        }
    }

    #[test]
    fn gradients_are_the_slopes_of_the_values() {
        let [a, b, c] = kit();
        for solid in [a, b, c, a.mirrored(), b.mirrored(), c.mirrored()] {
            assert_gradient(&format!("{solid:?}"), |p| solid.sample(p));
        }
        assert_gradient("union", |p| smooth_union(a.sample(p), c.sample(p), 0.3));
        assert_gradient("difference", |p| smooth_difference(b.sample(p), c.sample(p), 0.3));
    }

    #[test]
    fn centers_are_inside_and_finite() {
        let [a, b, c] = kit();
        for solid in [a, b, c] {
            let s = solid.sample(DVec3::new(0.1, -0.2, 0.3));
            assert!(s.value < -0.15 && s.gradient.is_finite(), "{solid:?}: {s:?}");
        }
    }

    #[test]
    fn a_round_cone_is_the_hull_of_its_balls() {
        let cone = Solid::round_cone(DVec3::ZERO, DVec3::new(0.0, 1.0, 0.0), [0.5, 0.25]);
        for (p, distance) in [
            (DVec3::new(0.0, -1.0, 0.0), 0.5),
            (DVec3::new(0.0, 2.0, 0.0), 0.75),
            (DVec3::new(0.5, 0.5, 0.0), 15.0_f64.sqrt() / 8.0 - 0.375),
        ] {
            assert!((cone.sample(p).value - distance).abs() < 1e-6, "{p}: {:?}", cone.sample(p));
        }
    }

    #[test]
    fn far_solids_do_not_blend() {
        let a = Sample { value: 0.1, gradient: DVec3::X };
        let b = Sample { value: 0.5, gradient: DVec3::Y };
        let s = smooth_union(a, b, 0.4);
        assert_eq!((s.value, s.gradient), (0.1, DVec3::X));
    }
}
