//! What the eye sees, as the cache sees it.

use base::{Grid, ImageSize, Pixel, Rgb, math::FRAC_1_PI};
use cache_map::{Lattice, SurfacePoint};
use rayon::prelude::*;

use super::COARSEST;
use super::records::Place;
use crate::frame::Frame;

/// The diffuse surfaces in view.
#[derive(Debug)]
pub(crate) struct View {
    size: ImageSize,
    pub(crate) sites: Grid<Option<SurfacePoint>>,
    pub(crate) lattice: Lattice,
    albedo: Vec<Rgb>,
    /// Pixels that a unit of length on the surface spans.
    pixels_per_unit: Vec<f32>,
}

impl View {
    pub(crate) fn new(frame: &Frame<'_>) -> Self {
        let size = frame.size();
        let camera = &frame.shader().scene.camera;
        let pixel_angle = camera.pixel_extent(size);
        let eye = camera.origin();
        let scene = frame.shader().scene;
        let found: Vec<_> = (frame.surfaces().values().par_iter())
            .with_min_len(4096)
            .map(|surface| {
                let surface = surface.as_ref()?;
                if !scene.material(surface).is_diffuse() {
                    return None;
                }
                let to_eye = eye - surface.position;
                let facing = surface.facing(to_eye);
                let site = SurfacePoint {
                    position: facing.position.into(),
                    normal: facing.shading_normal.into(),
                };
                // A slanted surface is foreshortened one way only: the mean of both ways is the root.
                let slant = (facing.shading_normal.dot(to_eye) / to_eye.length()).clamp(0.02, 1.0);
                let depth = camera.depth(facing.position).max(f32::MIN_POSITIVE);
                Some((site, scene.albedo(surface), slant.sqrt() / (depth * pixel_angle)))
            })
            .collect();
        let sites = Grid::from_values(size, found.iter().map(|f| f.map(|f| f.0)).collect());
        let lattice = Lattice::new(&sites, COARSEST);
        let albedo = found.iter().map(|f| f.map_or(Rgb::BLACK, |f| f.1)).collect();
        let pixels_per_unit = found.iter().map(|f| f.map_or(0.0, |f| f.2)).collect();
        Self { size, sites, lattice, albedo, pixels_per_unit }
    }

    pub(crate) fn size(&self) -> ImageSize {
        self.size
    }

    pub(crate) fn albedo(&self, index: usize) -> Rgb {
        self.albedo[index]
    }

    /// Luminance of radiance towards the eye for white irradiance of 1.
    #[inline]
    pub(crate) fn gain(&self, index: usize) -> f32 {
        self.albedo[index].luminance() * FRAC_1_PI
    }

    pub(crate) fn pixels_per_unit(&self, index: usize) -> f32 {
        self.pixels_per_unit[index]
    }

    /// The surface that a pixel shows, as records know it.
    pub(crate) fn place(&self, index: usize) -> Option<Place> {
        let surface = self.sites.values()[index]?;
        Some(Place { surface, pixel: 1.0 / self.pixels_per_unit[index] })
    }

    /// The pixels of the coarsest lattice that show a diffuse surface.
    pub(crate) fn coarse_pixels(&self) -> Vec<Pixel> {
        let all = (0..self.size.height).step_by(COARSEST as usize).flat_map(|y| {
            (0..self.size.width).step_by(COARSEST as usize).map(move |x| Pixel { x, y })
        });
        all.filter(|&p| self.sites[p].is_some()).collect()
    }

    /// A number for the cell of the coarsest lattice in which a pixel lies.
    #[inline]
    pub(crate) fn cell(&self, index: usize) -> usize {
        let pixel = self.size.pixel(index);
        let columns = self.size.width.div_ceil(COARSEST) as usize;
        (pixel.y / COARSEST) as usize * columns + (pixel.x / COARSEST) as usize
    }

    /// A factor from 1 to 2 for the cell of a pixel, evenly spread (in octaves) over neighbouring cells.
    #[inline]
    pub(crate) fn dither(&self, index: usize) -> f32 {
        // 2^(1/8), 2^(3/8), 2^(5/8), 2^(7/8), as in a Bayer matrix.
        const FACTORS: [[f32; 2]; 2] = [[1.0905, 1.5422], [1.8340, 1.2968]];
        let pixel = self.size.pixel(index);
        FACTORS[(pixel.y / COARSEST % 2) as usize][(pixel.x / COARSEST % 2) as usize]
    }

    /// The number of cells.
    pub(crate) fn n_cells(&self) -> usize {
        self.size.width.div_ceil(COARSEST) as usize * self.size.height.div_ceil(COARSEST) as usize
    }
}
