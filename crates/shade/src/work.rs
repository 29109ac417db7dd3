//! Memory that shading reuses, and what it counts.

use std::ops::AddAssign;

use glam::Vec3A;
use photon_map::{Estimate, Scratch};
use scene::LightSample;

/// Work done, in numbers that don't depend on the machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Rays from the eye.
    pub eye_rays: u64,
    /// Rays along specular chains.
    pub specular_rays: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// Rays of final gathering, and what follows from them.
    pub gather_rays: u64,
    /// Photons whose distance from a point was computed.
    pub photons_visited: u64,
    /// Specular chains that were cut at their greatest length.
    pub chains_cut: u64,
}

impl AddAssign for Counts {
    fn add_assign(&mut self, o: Self) {
        self.eye_rays += o.eye_rays;
        self.specular_rays += o.specular_rays;
        self.shadow_rays += o.shadow_rays;
        self.gather_rays += o.gather_rays;
        self.photons_visited += o.photons_visited;
        self.chains_cut += o.chains_cut;
    }
}

/// One for each tile of work: its counts depend on the order of queries within, never on other tiles.
#[derive(Debug, Default)]
pub struct Work {
    /// Work done so far.
    pub counts: Counts,
    pub(crate) scratch: Scratch,
    pub(crate) light_samples: Vec<LightSample>,
    pub(crate) last_indirect: LastEstimate,
    pub(crate) last_caustic: LastEstimate,
}

/// Where the last estimate was made and how far it reached: a guess for the next.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LastEstimate {
    point: Vec3A,
    radius: f32,
}

impl LastEstimate {
    /// A radius that likely holds as many photons as the last one did, if the last one was near enough to tell.
    ///
    /// As much larger as the points are apart it would surely hold them; but to search once more now and then takes less time than
    /// to search so far each time.
    pub(crate) fn guess(&self, point: Vec3A) -> Option<f32> {
        let distance = (point - self.point).length();
        let more = distance.min(0.03 * self.radius + 0.05 * distance);
        (distance < 2.0 * self.radius).then_some(self.radius + more)
    }

    pub(crate) fn remember(&mut self, point: Vec3A, estimate: &Estimate) {
        (self.point, self.radius) = (point, estimate.radius);
    }
}
