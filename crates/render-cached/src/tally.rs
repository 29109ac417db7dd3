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
    /// Of a band, or of all of a picture.
    pub(crate) fn of(rendered: &Rendered) -> Self {
        // In mode paper what is known may be of no use.
        let is_adaptive = rendered.adaptive.is_some();
        let count = |component, wanted| {
            let origins = rendered.origins[component].values();
            origins.iter().filter(|&&o| o == wanted).count() as u64
        };
        Self {
            n_subpixels: rendered.origins.direct.size().n_pixels(),
            traced: rendered.traced,
            interpolated: Components::from_fn(|c| count(c, Origin::Interpolated)),
            reused: Components::from_fn(|c| if is_adaptive { count(c, Origin::Known) } else { 0 }),
            counts: rendered.counts,
            seconds: rendered.seconds,
            cache: rendered.cache,
            error: rendered.adaptive.as_ref().map(|a| a.error),
            ..Self::default()
        }
    }

    /// Adds what another band took.
    pub(crate) fn add(&mut self, other: Self) {
        for component in Component::ALL {
            self.traced[component] += other.traced[component];
            self.interpolated[component] += other.interpolated[component];
            self.reused[component] += other.reused[component];
            self.seconds[component] += other.seconds[component];
        }
        self.n_subpixels += other.n_subpixels;
        self.counts += other.counts;
        self.primary += other.primary;
        self.cache += other.cache;
        self.write += other.write;
        self.error = other.error;
    }
}
