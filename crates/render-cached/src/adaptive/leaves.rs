//! The ends of specular chains: looked up in the primary view where it shows them, traced elsewhere.

use base::{Component, Grid, Interrupted, Pixel, Rgb, math::FRAC_1_PI};
use cache_map::{Reason, SurfacePoint, same_surface};
use geometry::Surface;
use shade::PixelStream;

use super::caustic::Caustic;
use super::direct::Direct;
use super::indirect::Indirect;
use super::{Account, View};
use crate::frame::Frame;

/// A diffuse surface at the end of a chain.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    pixel: u32,
    /// What is left on the way to the eye, times albedo over pi.
    weight: Rgb,
    surface: Surface,
    stream: PixelStream,
}

/// All specular chains of a picture.
#[derive(Debug)]
pub(crate) struct Leaves {
    leaves: Vec<Leaf>,
    /// Irradiance at the leaves that were traced.
    traced: Vec<Option<Rgb>>,
    /// What surfaces emit and what lies beyond the scene, by pixel.
    emitted: Grid<Rgb>,
    radiance: Grid<Rgb>,
}

impl Leaves {
    /// Follows all chains.
    pub(crate) fn start(frame: &Frame<'_>, account: &mut Account<'_, '_>) -> Result<Self, Interrupted> {
        let size = frame.size();
        let shader = frame.shader();
        let mut pixels = frame.surface_pixels();
        pixels.retain(|&p| frame.point(p).is_some_and(|point| point.material.is_specular()));
        let chains = account.pixels(Component::Specular, &pixels, |point, stream, work| {
            let mut emitted = Rgb::BLACK;
            let mut leaves = Vec::new();
            shader.chain(point, stream, work, |leaf, _| match leaf.point {
                None => emitted += leaf.weight * shader.background(),
                Some(end) => {
                    emitted += leaf.weight * end.emitted();
                    if end.material.is_diffuse() {
                        let weight = leaf.weight * end.material.albedo * FRAC_1_PI;
                        leaves.push(Leaf { pixel: 0, weight, surface: end.facing, stream: leaf.stream });
                    }
                }
            });
            (emitted, leaves)
        })?;
        let mut all = Self {
            leaves: Vec::new(),
            traced: Vec::new(),
            emitted: Grid::from_fn(size, |_| Rgb::BLACK),
            radiance: Grid::from_fn(size, |_| Rgb::BLACK),
        };
        for (&pixel, (emitted, leaves)) in pixels.iter().zip(chains) {
            all.emitted[pixel] = emitted;
            let index = size.index(pixel) as u32;
            all.leaves.extend(leaves.into_iter().map(|leaf| Leaf { pixel: index, ..leaf }));
        }
        all.traced = vec![None; all.leaves.len()];
        Ok(all)
    }

    pub(crate) fn radiance(&self, index: usize) -> Rgb {
        self.radiance.values()[index]
    }

    /// Why any leaf of a pixel was traced.
    pub(crate) fn reasons(&self) -> Vec<Reason> {
        let mut reasons = vec![Reason::Interpolated; self.radiance.values().len()];
        for (leaf, traced) in self.leaves.iter().zip(&self.traced) {
            if traced.is_some() {
                reasons[leaf.pixel as usize] = Reason::NoNeighbours;
            }
        }
        reasons
    }

    /// Finds the irradiance at every leaf and sums up the radiance of the pixels.
    pub(crate) fn resolve(
        &mut self,
        view: &View,
        direct: &Direct,
        indirect: &Indirect,
        caustic: &Caustic,
        account: &mut Account<'_, '_>,
    ) -> Result<(), Interrupted> {
        let shader = account.frame.shader();
        let camera = &shader.scene.camera;
        let size = view.size();
        let looked_up = account.overhead(&self.leaves, |leaf, _| {
            let at = camera.project(size, leaf.surface.position)? - 0.5;
            let low = at.floor();
            let inside = low.cmpge(glam::Vec2::ZERO).all() && low.x + 1.0 < size.width as f32 && low.y + 1.0 < size.height as f32;
            if !inside {
                return None;
            }
            let (x, y) = (low.x as u32, low.y as u32);
            let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| Pixel { x: x + dx, y: y + dy });
            let end = SurfacePoint {
                position: leaf.surface.position.into(),
                normal: leaf.surface.shading_normal.into(),
            };
            if !corners.iter().all(|&c| view.sites[c].as_ref().is_some_and(|site| same_surface(site, &end))) {
                return None;
            }
            let f = at - low;
            let weights = [(1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y];
            let indices = corners.map(|c| size.index(c));
            let mix = |value: &dyn Fn(usize) -> Rgb| -> Rgb {
                indices.iter().zip(weights).map(|(&i, w)| value(i) * w).sum()
            };
            let mut irradiance = mix(&|i| indirect.irradiance(i) + caustic.irradiance(i));
            if let Some((_, rest)) = direct.rest() {
                irradiance += mix(&|i| rest.values[i]);
            }
            for cached in direct.lights() {
                let unshadowed = shader
                    .light(cached.light)
                    .unshadowed_irradiance(leaf.surface.position, leaf.surface.shading_normal)?;
                let values = &cached.visibility.values;
                let visibility: f32 = indices.iter().zip(weights).map(|(&i, w)| values[i] * w).sum();
                irradiance += unshadowed * visibility;
            }
            Some(irradiance)
        })?;
        let missing: Vec<usize> =
            (0..self.leaves.len()).filter(|&i| looked_up[i].is_none() && self.traced[i].is_none()).collect();
        let leaves = &self.leaves;
        let values = account.items(Component::Specular, &missing, |&i, work| {
            let Leaf { surface, stream, .. } = &leaves[i];
            let lights = 0..shader.scene.lights.len();
            let direct: Rgb = lights.map(|light| shader.irradiance_from(light, surface, *stream, work)).sum();
            direct + shader.indirect_estimate(surface, work).irradiance + shader.caustic_estimate(surface, work).irradiance
        })?;
        missing.iter().zip(values).for_each(|(&i, value)| self.traced[i] = Some(value));

        self.radiance = self.emitted.clone();
        for (i, leaf) in self.leaves.iter().enumerate() {
            let irradiance = self.traced[i].or(looked_up[i]).expect("what wasn't looked up was traced");
            self.radiance.values_mut()[leaf.pixel as usize] += leaf.weight * irradiance;
        }
        Ok(())
    }
}
