//! How strict decisions are, given the error aimed at.

use base::{Component, Components};
use cache_map::Tolerance;

use super::holdout::Report;

/// Tolerances of the embedded pair and of edges are multiples of the error aimed at. Found on the scenes of this project;
/// the pixels held out correct them where they don't fit.
#[derive(Clone, Debug)]
pub(crate) struct Strictness {
    errors: Components<f32>,
    glossy: f32,
    is_gathering: bool,
}

impl Strictness {
    /// For a mean FLIP of `error`, with indirect light that is gathered or estimated.
    pub(crate) fn new(error: f32, is_gathering: bool) -> Self {
        Self { errors: Components::from_fn(|_| error), glossy: error, is_gathering }
    }

    pub(crate) fn tolerance(&self, component: Component) -> Tolerance {
        let (error, edge) = match component {
            Component::Direct | Component::Caustic => (1.5, 12.0),
            // Density estimates have noise that isn't worth following; what is gathered has little.
            Component::Indirect if self.is_gathering => (2.0, 16.0),
            Component::Specular => (3.0, 30.0),
            Component::Indirect => (4.0, 28.0),
        };
        let times = self.errors[component];
        Tolerance { error: error * times, edge: edge * times }
    }

    /// Of what rough surfaces show.
    pub(crate) fn tolerance_of_glossy(&self) -> Tolerance {
        Tolerance { error: 4.0 * self.glossy, edge: 20.0 * self.glossy }
    }

    /// For what was worst where the error was too large by `factor`.
    pub(crate) fn tighten(&mut self, report: &Report, factor: f32) {
        if report.glossy_is_worst {
            self.glossy *= 0.5;
        } else if report.worst == Component::Indirect && !self.is_gathering {
            // Most of the error of estimates is their distance's: see `Indirect::tighten`.
            self.errors.indirect *= (1.0 / (factor * factor)).max(0.5);
        } else {
            self.errors[report.worst] *= 0.5;
        }
    }
}
