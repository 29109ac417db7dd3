//! What a picture took, all its bands together.

use base::{Component, Components};
use cache_map::Origin;
use cli::Seconds;
use shade::Counts;

use crate::adaptive::ErrorReport;
use crate::render::Rendered;

/// Sums over the bands of a picture. Supersampled, all counts are of subpixels.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    /// Those that were looked at.
    pub(crate) n_subpixels: usize,
    pub(crate) traced: Components<u64>,
    pub(crate) interpolated: Components<u64>,
    pub(crate) reused: Components<u64>,
    pub(crate) counts: Counts,
    /// Time of eye rays.
    pub(crate) primary: Seconds,
    pub(crate) seconds: Components<Seconds>,
    /// For choosing and interpolating.
    pub(crate) cache: Seconds,
    /// For layers and files.
    pub(crate) write: Seconds,
    pub(crate) error: Option<ErrorReport>,
}

impl Tally {
    /// Adds a band, or all of a picture.
    pub(crate) fn add(&mut self, rendered: &Rendered) {
        // In mode paper what is known may be of no use.
        let is_adaptive = rendered.adaptive.is_some();
        for component in Component::ALL {
            let origins = rendered.origins[component].values();
            let count = |wanted| origins.iter().filter(|&&o| o == wanted).count() as u64;
            self.traced[component] += rendered.traced[component];
            self.interpolated[component] += count(Origin::Interpolated);
            self.reused[component] += if is_adaptive { count(Origin::Known) } else { 0 };
            self.seconds[component] += rendered.seconds[component];
        }
        self.n_subpixels += rendered.origins.direct.size().n_pixels();
        self.counts += rendered.counts;
        self.cache += rendered.cache;
        self.error = rendered.adaptive.as_ref().map(|a| a.error);
    }
}
