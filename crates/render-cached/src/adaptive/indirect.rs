//! Indirect irradiance.

use std::f32::consts::SQRT_2;

use base::{Component, Interrupted, Pixel, Rgb, math};
use cache_map::{
    Layer, Nearby, Reason, RecordPoint, Records, Rule, Steps, Tolerance, Trace, refine,
    refine_spaced,
};
use shade::Shader;

use super::direct::Direct;
use super::records::{Saved, Source};
use super::{Account, COARSEST, View};

/// The estimate is noisy, and band-limited by its own radius `r`: samples `s` apart miss noise of about `(s / r)^1.1`, either
/// taken as the side of a square of the area that a sample, or the estimate's disk, has in the picture. Of
/// a picture of indirect light only, with 500 photons in an estimate, this is the mean FLIP at `s = r`. Measured on the
/// scenes of this project.
const FLIP_AT_RADIUS: f32 = 0.044;

/// That power.
const ORDER: f32 = 1.1;

/// Less than this part of indirect light in all light counts as so much.
const LEAST_PART: f32 = 0.05;

/// Samples are so many radii apart at most.
const WIDEST: f32 = 2.0;

/// What is gathered varies over the distance of what is around: samples are this share of it apart at most.
const SHARE_OF_DISTANCE: f32 = 0.25;

/// Where all values come from records around their pixels the error grows by this share. Measured likewise.
const ERROR_OF_NEARBY: f32 = 0.15;

/// Indirect irradiance at every pixel.
#[derive(Debug)]
pub(crate) struct Indirect {
    pub(crate) layer: Layer<Rgb>,
    /// For each cell of the coarsest lattice the radius of the estimate, in pixels.
    radius: Vec<f32>,
    /// The same in world units; 0 where the cell has no coarse pixel.
    reach: Vec<f32>,
    /// The distances of samples, in pixels, but for a common factor.
    spacing: Vec<f32>,
    /// That factor.
    share: f32,
    /// Luminance of the irradiance, likewise; before refinement this is all that is known.
    ambient: Vec<f32>,
    /// Luminance of a picture's indirect radiance, in the mean: errors far below it don't show.
    floor: f32,
    source: Source<Rgb>,
    /// Share of the coarsest lattice that is known from records around its pixels.
    nearby: f32,
}

impl Indirect {
    /// Traces the coarsest lattice, as far as it isn't known to this tolerance, relative to itself.
    pub(crate) fn start(
        view: &View,
        saved: &Saved,
        tolerance: Tolerance,
        account: &mut Account<'_, '_>,
    ) -> Result<Self, Interrupted> {
        let pixels = view.coarse_pixels();
        let shader = account.frame.shader();
        let source = saved.source(&saved.set.indirect);
        let take = |&pixel: &Pixel| {
            let is_good = |near: &Nearby<Rgb>| {
                let value = near.value.luminance();
                near.error <= tolerance.error * value && near.span <= tolerance.edge * value
            };
            source.take(&view.place(view.size().index(pixel))?, COARSEST, is_good)
        };
        let estimates = source.fill(account, &pixels, take, |account, pixels| {
            account.pixels(Component::Indirect, pixels, |point, _, work| {
                let estimate = shader.indirect_estimate(&point.facing, work);
                (estimate.irradiance, estimate.radius, Reason::Lattice)
            })
        })?;
        let mut layer = Layer::new(view.size().n_pixels());
        let mut radius_of_cell = vec![COARSEST as f32; view.n_cells()];
        let mut ambient = vec![0.0; view.n_cells()];
        let (mut sum, mut n_nearby) = (0.0_f64, 0);
        let mut reach = vec![0.0; view.n_cells()];
        for (&pixel, &(irradiance, radius, reason)) in pixels.iter().zip(&estimates) {
            let i = view.size().index(pixel);
            layer.values[i] = irradiance;
            layer.reasons[i] = reason;
            layer.levels[i] = COARSEST.trailing_zeros() as u8;
            reach[view.cell(pixel)] = radius;
            n_nearby += u32::from(reason == Reason::Nearby);
            if let Some(site) = &view.sites[pixel] {
                radius_of_cell[view.cell(pixel)] = radius / view.footprint(site);
            }
            ambient[view.cell(pixel)] = irradiance.luminance();
            sum += f64::from(irradiance.luminance() * view.gain(i));
        }
        let n = pixels.len().max(1) as f32;
        let (floor, nearby) = (0.1 * sum as f32 / n, n_nearby as f32 / n);
        let (radius, spacing) = (radius_of_cell.clone(), radius_of_cell);
        Ok(Self { layer, radius, reach, spacing, share: 1.0, ambient, floor, source, nearby })
    }

    pub(crate) fn irradiance(&self, index: usize) -> Rgb {
        self.layer.values[index]
    }

    /// All that is known of indirect light, for good.
    pub(crate) fn records(&self, view: &View) -> Records<Rgb> {
        self.source.with(&self.layer, |i| {
            let surface = view.sites.values()[i]?;
            let reach = match self.reach[view.cell(view.size().pixel(i))] {
                0.0 => COARSEST as f32 * view.footprint(&surface),
                reach => reach,
            };
            Some(RecordPoint { surface, reach })
        })
    }

    /// A guess of the luminance of what isn't direct light at a pixel, for white albedo and times pi.
    pub(crate) fn ambient(&self, view: &View, pixel: Pixel) -> f32 {
        0.5 * self.ambient[view.cell(pixel)]
    }

    /// Radiance below which errors don't show.
    pub(crate) fn floor(&self) -> f32 {
        self.floor
    }

    /// Sets the distance of samples so that the mean FLIP comes to about `error`, given how much of the picture's light is
    /// indirect.
    pub(crate) fn aim(&mut self, view: &View, direct: &Direct, error: f32, shader: &Shader<'_>) {
        if shader.is_gathering() {
            // Smooth: the tolerance does the rest.
            self.share = SHARE_OF_DISTANCE;
            return;
        }
        let noise = FLIP_AT_RADIUS * (500.0 / shader.settings.indirect.k as f32).sqrt();
        let pixels = view.coarse_pixels();
        let mut sum = 0.0_f64;
        for &pixel in &pixels {
            let (i, cell) = (view.size().index(pixel), view.cell(pixel));
            let indirect = self.irradiance(i).luminance();
            let part = indirect / (indirect + direct.luminance(i)).max(f32::MIN_POSITIVE);
            let radius = self.radius[cell];
            let scale = math::pow(radius, ORDER);
            // Of all ways to spread samples this has the least mean error: one more sample gains the same everywhere.
            let spacing = math::pow(scale / part.max(LEAST_PART), 1.0 / (ORDER + 2.0));
            self.spacing[cell] = spacing;
            sum += f64::from(noise * part * math::pow(spacing, ORDER) / scale);
        }
        let at_one = sum as f32 / pixels.len().max(1) as f32;
        let error = error * (1.0 - ERROR_OF_NEARBY * self.nearby);
        self.share = math::pow(error / at_one.max(1e-6), 1.0 / ORDER);
    }

    /// Brings samples closer together, for an error of all light that is too large by `factor`. Some of it isn't of theirs.
    pub(crate) fn tighten(&mut self, factor: f32) {
        self.share /= math::pow(factor, 1.7 / ORDER);
    }

    pub(crate) fn refine(
        &mut self,
        view: &View,
        direct: &Direct,
        tolerance: Tolerance,
        account: &mut Account<'_, '_>,
    ) -> Result<(), Interrupted> {
        struct IndirectRule<'x> {
            view: &'x View,
            direct: &'x Direct,
            radius: &'x [f32],
            spacing: &'x [f32],
            share: f32,
            floor: f32,
        }
        impl Rule<Rgb> for IndirectRule<'_> {
            fn gain(&self, index: usize) -> f32 {
                self.view.gain(index)
            }
            fn reference(&self, index: usize, predicted: Rgb) -> f32 {
                self.floor
                    + (self.direct.luminance(index) + predicted.luminance()) * self.view.gain(index)
            }
            fn spacing(&self, pixel: Pixel) -> f32 {
                let half_octaves = self.area(pixel);
                let octave = (1 << (half_octaves / 2)) as f32;
                if half_octaves.is_multiple_of(2) { octave } else { octave * SQRT_2 }
            }
        }
        impl IndirectRule<'_> {
            /// What a sample stands for, in pixels, as a power of two.
            fn area(&self, pixel: Pixel) -> u32 {
                let cell = self.view.cell(pixel);
                let wanted = (self.spacing[cell] * self.share).min(WIDEST * self.radius[cell]);
                // Cells take turns at the two powers of two around what is wanted.
                let square = wanted * wanted * self.view.dither(pixel);
                let widest = COARSEST / self.view.apart();
                (square.clamp(1.0, (widest * widest) as f32) as u32).ilog2()
            }

            /// The estimate is one of all photons in a disk on the surface: as many samples span its picture along rows as along
            /// columns.
            fn steps(&self, pixel: Pixel) -> Steps {
                let (area, largest) = (self.area(pixel) as i32, COARSEST.ilog2() as i32);
                let across = (0.5 * (area as f32 + self.view.skew(pixel))).round() as i32;
                let across = across.clamp((area - largest).max(0), area.min(largest));
                [across, area - across].map(|power| 1 << power)
            }
        }
        let rule = IndirectRule {
            view,
            direct,
            radius: &self.radius,
            spacing: &self.spacing,
            share: self.share,
            floor: self.floor,
        };
        let shader = account.frame.shader();
        let lattice = &view.lattice;
        let run = |layer: &mut Layer<Rgb>, trace: &mut Trace<'_, Rgb, Interrupted>| {
            // What is gathered has no noise whose shape would be known.
            if shader.is_gathering() {
                return refine(lattice, layer, COARSEST, &rule, tolerance, trace);
            }
            let steps = |pixel| rule.steps(pixel);
            refine_spaced(lattice, &view.sites, layer, COARSEST, steps, &rule, tolerance, trace)
        };
        self.source.refine_by(
            run,
            lattice,
            &mut self.layer,
            COARSEST,
            &rule,
            tolerance,
            |i| view.place(i),
            account,
            |account, pixels: &[Pixel]| {
                account.pixels(Component::Indirect, pixels, |point, _, work| {
                    shader.indirect_estimate(&point.facing, work).irradiance
                })
            },
        )
    }
}
