//! Irradiance in the primary view: all that the eye sees of it, and what the ends of chains are looked up in.

use base::{Component, Components, Interrupted, Rgb, math::FRAC_1_PI};

use super::caustic::Caustic;
use super::direct::Direct;
use super::indirect::Indirect;
use super::leaves::Finished;
use super::records::Saved;
use super::strictness::Strictness;
use super::{Account, View};

/// The part of the error that indirect light may make.
const INDIRECT_SHARE: f32 = 0.7;

/// The components of which irradiance is cached, at every pixel.
#[derive(Debug)]
pub(crate) struct Primary {
    pub(crate) direct: Direct,
    pub(crate) indirect: Indirect,
    pub(crate) caustic: Caustic,
}

impl Primary {
    /// Computes them to the tolerances of an error.
    pub(crate) fn start(
        view: &View,
        saved: &Saved,
        error: f32,
        strictness: &Strictness,
        account: &mut Account<'_, '_>,
    ) -> Result<Self, Interrupted> {
        let tolerance = |component| strictness.tolerance(component);
        let of_indirect = tolerance(Component::Indirect);
        let mut indirect = Indirect::start(view, saved, of_indirect, account)?;
        let mut direct = Direct::start(view, &indirect, saved, error, account)?;
        direct.refine(view, &indirect, tolerance(Component::Direct), account)?;
        indirect.aim(view, &direct, INDIRECT_SHARE * error, account.frame.shader());
        indirect.refine(view, &direct, of_indirect, account)?;
        let mut caustic = Caustic::start(view, saved, account);
        caustic.refine(view, &direct, &indirect, tolerance(Component::Caustic), account)?;
        Ok(Self { direct, indirect, caustic })
    }

    /// Makes a component better, the error being too large by `factor`.
    pub(crate) fn improve(
        &mut self,
        component: Component,
        view: &View,
        factor: f32,
        strictness: &Strictness,
        account: &mut Account<'_, '_>,
    ) -> Result<(), Interrupted> {
        let Self { direct, indirect, caustic } = self;
        let tolerance = strictness.tolerance(component);
        match component {
            Component::Direct => direct.refine(view, indirect, tolerance, account),
            Component::Indirect => {
                indirect.tighten(factor);
                indirect.refine(view, direct, tolerance, account)
            }
            Component::Caustic => caustic.refine(view, direct, indirect, tolerance, account),
            Component::Specular => Ok(()),
        }
    }

    /// Radiance towards the eye, and this as what is specular.
    pub(crate) fn radiance(&self, view: &View, index: usize, specular: Rgb) -> Components<Rgb> {
        let albedo = view.albedo(index) * FRAC_1_PI;
        Components {
            direct: albedo * self.direct.irradiance(index),
            indirect: albedo * self.indirect.irradiance(index),
            caustic: albedo * self.caustic.irradiance(index),
            specular,
        }
    }

    /// All of it together.
    pub(crate) fn finished(&self, view: &View) -> Finished {
        Finished::new(&self.direct, &self.indirect, &self.caustic, view.size().n_pixels())
    }
}
