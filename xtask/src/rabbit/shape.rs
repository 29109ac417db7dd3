//! The rabbit: a kit of rounded solids, joined softly.

use glam::DVec3;

use crate::rabbit::field::{Sample, Solid, smooth_difference, smooth_union};

/// How a part is joined to those before it; the number is the width of the seam.
#[derive(Clone, Copy, Debug)]
enum Join {
    Add(f64),
    Carve(f64),
}

/// The rabbit as an implicit surface, sitting, facing +z, about 1 from feet to ears.
#[derive(Clone, Debug)]
pub(crate) struct Rabbit {
    parts: Vec<(Solid, Join)>,
}

impl Rabbit {
    /// The corners of a box that the rabbit does not reach.
    pub(crate) const BOUNDS: [DVec3; 2] =
        [DVec3::new(-0.36, -0.08, -0.50), DVec3::new(0.36, 1.10, 0.50)];

    /// The rabbit.
    pub(crate) fn new() -> Self {
        let v = DVec3::new;
        let ball = Solid::upright;
        let egg = |center, radii, lean| Solid::tilted(center, radii, v(0.0, 1.0, lean), DVec3::Z);
        let [ear_up, ear_front] = [v(0.13, 1.0, -0.2), v(0.4, 0.0, 1.0)];
        let ear = |center, radii| Solid::tilted(center, radii, ear_up, ear_front);

        let mut parts = Vec::new();
        let mut one = |solid, join| parts.push((solid, join));
        // Rump, chest, tail.
        one(egg(v(0.0, 0.235, -0.12), v(0.185, 0.215, 0.235), 0.12), Join::Add(0.1));
        one(egg(v(0.0, 0.305, 0.06), v(0.14, 0.21, 0.15), 0.25), Join::Add(0.22));
        one(ball(v(0.0, 0.15, -0.36), v(0.07, 0.078, 0.07)), Join::Add(0.03));
        // Skull, muzzle, nose.
        one(egg(v(0.0, 0.565, 0.165), v(0.12, 0.122, 0.148), 0.25), Join::Add(0.1));
        one(egg(v(0.0, 0.525, 0.27), v(0.076, 0.066, 0.078), 0.25), Join::Add(0.08));
        one(ball(v(0.0, 0.554, 0.332), v(0.024, 0.017, 0.018)), Join::Add(0.03));

        let mut two = |solid: Solid, join| {
            one(solid, join);
            one(solid.mirrored(), join);
        };
        // Cheeks, eyes.
        two(ball(v(0.04, 0.508, 0.29), v(0.05, 0.045, 0.052)), Join::Add(0.03));
        two(ball(v(0.094, 0.592, 0.222), v(0.024, 0.03, 0.03)), Join::Add(0.012));
        // Ears, then their hollows.
        two(ear(v(0.085, 0.80, 0.085), v(0.059, 0.20, 0.042)), Join::Add(0.04));
        two(ear(v(0.099, 0.82, 0.128), v(0.036, 0.135, 0.037)), Join::Carve(0.03));
        // Haunches, hind feet.
        two(egg(v(0.145, 0.185, -0.105), v(0.085, 0.165, 0.155), -0.25), Join::Add(0.045));
        two(ball(v(0.17, 0.042, -0.005), v(0.05, 0.042, 0.135)), Join::Add(0.05));
        // Fore legs from shoulder to wrist, paws.
        let [shoulder, wrist] = [v(0.08, 0.29, 0.11), v(0.074, 0.06, 0.17)];
        two(Solid::round_cone(shoulder, wrist, [0.07, 0.042]), Join::Add(0.09));
        two(ball(v(0.074, 0.036, 0.205), v(0.046, 0.036, 0.064)), Join::Add(0.03));
        Self { parts }
    }

    /// The field at `p`.
    pub(crate) fn sample(&self, p: DVec3) -> Sample {
        let outside = Sample { value: f64::MAX, gradient: DVec3::ZERO };
        self.parts.iter().fold(outside, |body, (solid, join)| match *join {
            Join::Add(k) => smooth_union(body, solid.sample(p), k),
            Join::Carve(k) => smooth_difference(body, solid.sample(p), k),
        })
    }
}
