//! What the eye sees, as the cache sees it.

use std::f32::consts::LOG2_E;

use base::{Grid, ImageSize, Pixel, Rgb, math, math::FRAC_1_PI};
use cache_map::{Lattice, SurfacePoint, same_surface};
use geometry::Surface;
use glam::{Vec2, Vec3A};
use rayon::prelude::*;
use scene::{Camera, Scene};

use super::COARSEST;
use super::leaves::site_of;
use super::records::Place;
use crate::frame::Frame;

/// The diffuse surfaces in view.
#[derive(Debug)]
pub(crate) struct View {
    size: ImageSize,
    pub(crate) sites: Grid<Option<SurfacePoint>>,
    pub(crate) lattice: Lattice,
    albedo: Vec<Rgb>,
    camera: Camera,
    /// The picture that its pixels are from, and how far apart they are in it.
    whole: ImageSize,
    step: u32,
    supersample: u32,
}

impl View {
    /// Of a frame of a picture with so many subpixels a pixel, each way.
    pub(crate) fn new(frame: &Frame<'_>, supersample: u32) -> Self {
        let size = frame.size();
        let scene = frame.shader().scene;
        let (mut sites, mut albedo) = (Vec::new(), Vec::new());
        (0..size.n_pixels())
            .into_par_iter()
            .with_min_len(4096)
            .map(|i| match &frame.surface(i) {
                Some(surface) if scene.material(surface).is_diffuse() => {
                    let (site, albedo) = as_seen(surface, frame.eye(size.pixel(i)), scene);
                    (Some(site), albedo)
                }
                _ => (None, Rgb::BLACK),
            })
            .unzip_into_vecs(&mut sites, &mut albedo);
        let sites = Grid::from_values(size, sites);
        let lattice = Lattice::new(&sites, COARSEST);
        let (whole, step) = (frame.window().whole, frame.step());
        Self { size, sites, lattice, albedo, camera: scene.camera, whole, step, supersample }
    }

    pub(crate) fn size(&self) -> ImageSize {
        self.size
    }

    /// How far apart its pixels are in the picture, in whole pixels: 1 for subpixels, too.
    pub(crate) fn apart(&self) -> u32 {
        (self.step / self.supersample).max(1)
    }

    pub(crate) fn albedo(&self, index: usize) -> Rgb {
        self.albedo[index]
    }

    /// Luminance of radiance towards the eye for white irradiance of 1.
    #[inline]
    pub(crate) fn gain(&self, index: usize) -> f32 {
        self.albedo[index].luminance() * FRAC_1_PI
    }

    /// The length on a surface that a pixel spans.
    pub(crate) fn footprint(&self, site: &SurfacePoint) -> f32 {
        // A slanted surface is foreshortened one way only: the mean of both ways is the root.
        let (across, slant) = self.across(site);
        across / slant.sqrt()
    }

    /// The same along the way that is foreshortened.
    pub(crate) fn longest_footprint(&self, site: &SurfacePoint) -> f32 {
        let (across, slant) = self.across(site);
        across / slant
    }

    /// How much farther it is on a surface from a pixel to the one below than to the one beside it, as a power of two; 0 where
    /// these show others.
    pub(crate) fn skew(&self, pixel: Pixel) -> f32 {
        let ImageSize { width, height } = self.size;
        let Some(site) = &self.sites[pixel] else { return 0.0 };
        let distance_to = |beside: [Pixel; 2]| {
            let same =
                beside.into_iter().filter(|&p| p != pixel).filter_map(|p| self.sites[p].as_ref());
            let mut same = same.filter(|other| same_surface(other, site));
            same.next().map_or(0.0, |other| other.position.distance(site.position))
        };
        let Pixel { x, y } = pixel;
        let beside = [(x + 1).min(width - 1), x.saturating_sub(1)].map(|x| Pixel { x, y });
        let below = [(y + 1).min(height - 1), y.saturating_sub(1)].map(|y| Pixel { x, y });
        let ratio = distance_to(below) / distance_to(beside);
        if ratio > 0.0 && ratio.is_finite() { math::ln(ratio) * LOG2_E } else { 0.0 }
    }

    /// The length that a pixel spans at the depth of a surface, and the cosine of the surface.
    fn across(&self, site: &SurfacePoint) -> (f32, f32) {
        let (position, normal) = (Vec3A::from(site.position), Vec3A::from(site.normal));
        let to_eye = self.camera.origin() - position;
        let slant = (normal.dot(to_eye) / to_eye.length()).clamp(0.02, 1.0);
        let depth = self.camera.depth(position).max(f32::MIN_POSITIVE);
        (depth * self.camera.pixel_extent(self.size), slant)
    }

    /// Where a point is seen, in pixels from the middle of the first; nothing behind the eye.
    pub(crate) fn project(&self, position: Vec3A) -> Option<Vec2> {
        Some((self.camera.project(self.whole, position)? - 0.5) / self.step as f32)
    }

    /// The surface that a pixel shows, as records know it.
    pub(crate) fn place(&self, index: usize) -> Option<Place> {
        let surface = self.sites.values()[index]?;
        Some(Place { surface, pixel: self.footprint(&surface) })
    }

    /// A pixel of each cell of the coarsest lattice that shows a diffuse surface: its first, or another where that doesn't.
    pub(crate) fn coarse_pixels(&self) -> Vec<Pixel> {
        let one_of = |cell| self.some_pixels(cell).find(|&pixel| self.sites[pixel].is_some());
        (0..self.n_cells()).filter_map(one_of).collect()
    }

    /// A number for the cell of the coarsest lattice in which a pixel lies.
    #[inline]
    pub(crate) fn cell(&self, pixel: Pixel) -> usize {
        let columns = self.size.width.div_ceil(COARSEST) as usize;
        (pixel.y / COARSEST) as usize * columns + (pixel.x / COARSEST) as usize
    }

    /// Some pixels of a cell, evenly spread.
    pub(crate) fn some_pixels(&self, cell: usize) -> impl Iterator<Item = Pixel> + use<> {
        let ImageSize { width, height } = self.size;
        let columns = width.div_ceil(COARSEST) as usize;
        let (left, top) = (cell % columns, cell / columns);
        let side = move |first: usize, end: u32| {
            let first = first as u32 * COARSEST;
            (first..(first + COARSEST).min(end)).step_by(COARSEST as usize / 4)
        };
        side(top, height).flat_map(move |y| side(left, width).map(move |x| Pixel { x, y }))
    }

    /// A factor from 1 to 2 for the cell of a pixel, evenly spread (in octaves) over neighbouring cells.
    #[inline]
    pub(crate) fn dither(&self, pixel: Pixel) -> f32 {
        // 2^(1/8), 2^(3/8), 2^(5/8), 2^(7/8), as in a Bayer matrix.
        const FACTORS: [[f32; 2]; 2] = [[1.0905, 1.5422], [1.8340, 1.2968]];
        FACTORS[(pixel.y / COARSEST % 2) as usize][(pixel.x / COARSEST % 2) as usize]
    }

    /// The number of cells.
    pub(crate) fn n_cells(&self) -> usize {
        self.size.width.div_ceil(COARSEST) as usize * self.size.height.div_ceil(COARSEST) as usize
    }
}

/// A surface on the side of the eye, and its albedo as seen from there.
#[inline]
pub(super) fn as_seen(surface: &Surface, eye: Vec3A, scene: &Scene) -> (SurfacePoint, Rgb) {
    let to_eye = eye - surface.position;
    let site = site_of(&surface.facing(to_eye));
    (site, scene.albedo_from(surface, to_eye.normalize_or_zero()))
}
