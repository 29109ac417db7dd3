//! The search for what the eye rays of a picture meet.

use base::{Grid, Interrupted, OwenSobol, Pixel, Ray, Stream, Watch, Window, hash_u64};
use geometry::Frustum;
use glam::{Vec2, Vec3A};
use rayon::prelude::*;
use shade::{Counts, Shader, Work};

use super::seen::Sight;
use super::{NOTHING, TILE};

/// The side of the largest squares of pixels that are tried for one flat surface.
const BLOCK: u32 = 16;

/// The side of the smallest.
const SMALLEST_BLOCK: u32 = 4;
/// Traces the eye rays of a window.
pub(super) fn trace<T: Sight>(
    shader: &Shader<'_>,
    window: Window,
    watch: Watch<'_>,
) -> Result<(Grid<T>, Counts), Interrupted> {
    let size = window.size;
    // Straight into the picture: it is larger than any cache, and copies of it take as long as the rays.
    let mut surfaces = vec![T::NOTHING; size.n_pixels()];
    // Where there are too few bands of tiles to share, lower ones.
    let rows = if size.height >= 8 * TILE { TILE } else { BLOCK / 2 };
    let counts: Option<Vec<Counts>> = surfaces
        .par_chunks_mut((size.width * rows) as usize)
        .zip((0..size.height).into_par_iter().step_by(rows as usize))
        .map(|(surfaces, top)| {
            let n = surfaces.len() as u64;
            let traced = [0; TILE as usize];
            let mut band = Band { shader, window, top, surfaces, traced, work: Work::default() };
            for left in (0..size.width).step_by(TILE as usize) {
                band.trace(left, watch)?;
            }
            // However they were found.
            band.work.counts.eye_rays = n;
            watch(n).then_some(band.work.counts)
        })
        .collect();
    let mut sum = Counts::default();
    counts.ok_or(Interrupted)?.into_iter().for_each(|counts| sum += counts);
    Ok((Grid::from_values(size, surfaces), sum))
}

/// Rows of a frame whose eye rays are being traced, one tile after the other.
struct Band<'x, 'a, T> {
    shader: &'x Shader<'a>,
    window: Window,
    /// The first of the rows.
    top: u32,
    surfaces: &'x mut [T],
    /// For each row of the tile a bit for each pixel whose ray is traced.
    traced: [u32; TILE as usize],
    work: Work,
}

impl<T: Sight> Band<'_, '_, T> {
    /// Traces a tile that begins at a column. Nothing if somebody has asked for a stop.
    fn trace(&mut self, left: u32, watch: Watch<'_>) -> Option<()> {
        let (shader, window) = (self.shader, self.window);
        let width = window.size.width;
        let bottom = self.top + self.surfaces.len() as u32 / width;
        let end = Pixel { x: (left + TILE).min(width), y: bottom };
        self.traced = [0; TILE as usize];
        // Through a lens, rays have no point in common.
        let camera = &shader.scene.camera;
        if camera.is_pinhole() {
            let rays = camera.rays(window.whole);
            let ray = |pixel| rays(middle(window.in_whole(pixel)));
            for y in (self.top..bottom).step_by(BLOCK as usize) {
                for x in (left..end.x).step_by(BLOCK as usize) {
                    self.trace_block(Pixel { x, y }, BLOCK, end, &ray, watch)?;
                }
            }
        } else {
            for y in self.top..bottom {
                for x in left..end.x {
                    watch(0).then_some(())?;
                    self.search(Pixel { x, y }, &|pixel| eye_ray(shader, window, pixel));
                }
            }
        }
        Some(())
    }

    /// Traces a square of pixels, as far as it lies before `end`.
    ///
    /// If the rays at its corners meet the same triangle, and nothing lies before that, rays between them need no search.
    fn trace_block(
        &mut self,
        corner: Pixel,
        side: u32,
        end: Pixel,
        ray: &impl Fn(Pixel) -> Ray,
        watch: Watch<'_>,
    ) -> Option<()> {
        watch(0).then_some(())?;
        let Pixel { x: left, y: top } = corner;
        let (right, bottom) = (end.x.min(left + side), end.y.min(top + side));
        let pixels = (top..bottom).flat_map(|y| (left..right).map(move |x| Pixel { x, y }));
        let frustum = match side >= SMALLEST_BLOCK {
            true => self.frustum([left, right - 1, top, bottom - 1], ray),
            false => None,
        };
        if let Some((frustum, dirs, triangle)) = frustum {
            if let Some(sight) = T::by_primitive(triangle)
                && frustum.fills(dirs)
            {
                pixels.for_each(|pixel| self.set(pixel, sight));
                return Some(());
            }
            for pixel in pixels {
                if !self.is_traced(pixel) {
                    let ray = ray(pixel);
                    match self.shader.scene.accel.surface_in(&frustum, &ray) {
                        Some(surface) => self.set(pixel, T::new(&surface)),
                        None => self.search_along(pixel, &ray),
                    }
                }
            }
        } else if side > SMALLEST_BLOCK {
            let half = side / 2;
            for y in (top..bottom).step_by(half as usize) {
                for x in (left..right).step_by(half as usize) {
                    self.trace_block(Pixel { x, y }, half, end, ray, watch)?;
                }
            }
        } else {
            pixels.for_each(|pixel| self.search(pixel, ray));
        }
        Some(())
    }

    /// What holds the rays of a block, its last column and row given, with the rays at its corners, which are traced, and the
    /// triangle that they meet.
    fn frustum(
        &mut self,
        [left, right, top, bottom]: [u32; 4],
        ray: &impl Fn(Pixel) -> Ray,
    ) -> Option<(Frustum, [Vec3A; 4], u32)> {
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
        let corners = corners.map(|(x, y)| Pixel { x, y });
        corners.iter().for_each(|&corner| self.search(corner, ray));
        let [first, others @ ..] =
            corners.map(|corner| self.surfaces[self.index(corner)].primitive());
        let is_same = first != NOTHING && others.into_iter().all(|other| other == first);
        if left == right || top == bottom || !is_same {
            return None;
        }
        let scene = self.shader.scene;
        let dirs = corners.map(|corner| ray(corner).dir());
        Some((scene.frustum(scene.camera.origin(), dirs, first)?, dirs, first))
    }

    /// Searches for what a pixel shows, if that isn't known.
    #[inline]
    fn search(&mut self, pixel: Pixel, ray: &impl Fn(Pixel) -> Ray) {
        if !self.is_traced(pixel) {
            self.search_along(pixel, &ray(pixel));
        }
    }

    fn search_along(&mut self, pixel: Pixel, ray: &Ray) {
        let met = self.shader.eye_surface(ray, &mut self.work);
        self.set(pixel, met.map_or(T::NOTHING, |surface| T::new(&surface)));
    }

    #[inline]
    fn is_traced(&self, Pixel { x, y }: Pixel) -> bool {
        self.traced[(y - self.top) as usize] >> (x % TILE) & 1 != 0
    }

    #[inline]
    fn set(&mut self, pixel: Pixel, sight: T) {
        self.traced[(pixel.y - self.top) as usize] |= 1 << (pixel.x % TILE);
        let index = self.index(pixel);
        self.surfaces[index] = sight;
    }

    /// Of a pixel in the band.
    #[inline]
    fn index(&self, Pixel { x, y }: Pixel) -> usize {
        (y - self.top) as usize * self.window.size.width as usize + x as usize
    }
}

/// The middle of a pixel, in pixels from the corner of the picture.
#[inline]
pub(super) fn middle(pixel: Pixel) -> Vec2 {
    Vec2::new(pixel.x as f32 + 0.5, pixel.y as f32 + 0.5)
}

/// The ray through the middle of a pixel, and through a lens, if there is one, where the place of the pixel tells.
///
/// Sobol' points in Morton order (Ahmed and Wonka 2020): any square of 2^n pixels a side, at a multiple of that, has
/// stratified points, so the subpixels of a pixel see the whole lens, and the noise of neighbors differs.
pub(super) fn eye_ray(shader: &Shader<'_>, window: Window, pixel: Pixel) -> Ray {
    let camera = &shader.scene.camera;
    let (size, pixel) = (window.whole, window.in_whole(pixel));
    let at = middle(pixel);
    if camera.is_pinhole() {
        return camera.ray(size, at);
    }
    let points = OwenSobol::new(hash_u64(shader.settings.seed, Stream::Lens as u64));
    camera.lens_ray(size, at, points.point::<2>(morton(pixel)).into())
}

/// The number of a pixel along a curve that goes through each square of 2^n pixels a side before it goes on.
fn morton(pixel: Pixel) -> u64 {
    let spread = |v: u32| {
        let mut v = u64::from(v);
        for (shift, mask) in [
            (16, 0x0000_ffff_0000_ffff),
            (8, 0x00ff_00ff_00ff_00ff),
            (4, 0x0f0f_0f0f_0f0f_0f0f),
            (2, 0x3333_3333_3333_3333),
            (1, 0x5555_5555_5555_5555),
        ] {
            v = (v | v << shift) & mask;
        }
        v
    };
    spread(pixel.x) | spread(pixel.y) << 1
}
