//! The cache map.

use base::{Component, Components, Grid, ImageSize, Pixel, Rgb, Window};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::candidates::Tile;

/// Where an eye ray has arrived.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SurfacePoint {
    /// Position, in world units.
    pub position: Vec3,
    /// Unit shading normal on the side of the eye.
    pub normal: Vec3,
}

/// Where a pixel's value of a component comes from. The paper's Flag is "sampled or traced".
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Origin {
    /// It has none yet, or there is no surface.
    #[default]
    None,
    /// It was computed as a low-resolution sample.
    Sampled,
    /// It was computed because no candidate fitted.
    Traced,
    /// It is known from a saved cache map, should it be needed.
    Known,
    /// It was interpolated.
    Interpolated,
}

/// For each pixel the first surface, the radiance of the four components, and where each comes from.
#[derive(Debug)]
pub struct CacheMap {
    surfaces: Grid<Option<SurfacePoint>>,
    values: Components<Grid<Rgb>>,
    origins: Components<Grid<Origin>>,
    /// Where pixels are interpolated, or traced.
    pub(crate) tiles: Vec<Tile>,
    /// Samples of another resolution: candidates, but no pixel's own value. Sorted by pixel, one each.
    pub(crate) borrowed: Vec<(Pixel, SurfacePoint, Components<Rgb>)>,
    /// Index into `borrowed` plus one; empty when nothing is.
    pub(crate) borrowed_at: Vec<u32>,
}

impl CacheMap {
    /// A cache map without values. Pixels without a surface stay black.
    pub fn new(surfaces: Grid<Option<SurfacePoint>>) -> Self {
        let all = Window::whole(surfaces.size());
        Self::of_part(surfaces, all, all)
    }

    /// A cache map of the window `frame` of a picture. What lies in the window `part` of it comes out as in a map of the
    /// whole picture; beyond, samples are taken, but nothing is interpolated or traced. The borders of the part lie at
    /// multiples of [`TILE`](crate::TILE) or at those of the picture, and the frame reaches beyond it as far as candidates lie.
    ///
    /// # Panics
    /// When there aren't as many surfaces as pixels of the frame.
    pub fn of_part(surfaces: Grid<Option<SurfacePoint>>, frame: Window, part: Window) -> Self {
        let size = surfaces.size();
        assert_eq!(size, frame.size, "a surface for each pixel of the frame");
        Self {
            surfaces,
            tiles: Tile::all(frame, part),
            values: Components::from_fn(|_| Grid::from_fn(size, |_| Rgb::BLACK)),
            origins: Components::from_fn(|_| Grid::from_fn(size, |_| Origin::None)),
            borrowed: Vec::new(),
            borrowed_at: Vec::new(),
        }
    }

    /// Width and height.
    pub fn size(&self) -> ImageSize {
        self.surfaces.size()
    }

    /// The first surface of each pixel.
    pub fn surfaces(&self) -> &Grid<Option<SurfacePoint>> {
        &self.surfaces
    }

    /// The radiance of a component at each pixel.
    pub fn values(&self, component: Component) -> &Grid<Rgb> {
        &self.values[component]
    }

    /// Where the values of a component come from.
    pub fn origins(&self, component: Component) -> &Grid<Origin> {
        &self.origins[component]
    }

    /// The radiance of all components.
    pub fn into_values(self) -> Components<Grid<Rgb>> {
        self.values
    }

    /// The pixels among these that have a surface and no value of the component yet, to be recorded as samples. Values
    /// known from a saved map are put in place instead of being sampled again.
    pub fn missing(&mut self, component: Component, pixels: &[Pixel]) -> Vec<Pixel> {
        let mut missing = Vec::new();
        for &pixel in pixels.iter().filter(|&&p| self.surfaces[p].is_some()) {
            match self.origins[component][pixel] {
                Origin::None => missing.push(pixel),
                Origin::Known => self.origins[component][pixel] = Origin::Sampled,
                Origin::Sampled | Origin::Traced | Origin::Interpolated => {}
            }
        }
        missing
    }

    /// Takes the computed radiance of a component at some pixels.
    ///
    /// # Panics
    /// When there are not as many values as pixels.
    pub fn record(
        &mut self,
        component: Component,
        pixels: &[Pixel],
        values: &[Rgb],
        origin: Origin,
    ) {
        assert_eq!(pixels.len(), values.len(), "a value per pixel");
        for (&pixel, &value) in pixels.iter().zip(values) {
            self.values[component][pixel] = value;
            self.origins[component][pixel] = origin;
        }
    }

    pub(crate) fn set(
        &mut self,
        component: Component,
        pixel: Pixel,
        value: Option<Rgb>,
        origin: Origin,
    ) {
        if let Some(value) = value {
            self.values[component][pixel] = value;
        }
        self.origins[component][pixel] = origin;
    }
}
