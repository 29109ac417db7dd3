//! The eye rays of a picture, and the shading of any set of its pixels.

use std::num::NonZeroU32;

use base::{
    Component, Grid, ImageSize, Interrupted, OwenSobol, Pixel, Ray, Rgb, Stream, Watch, Window,
    hash_u64,
};
use geometry::{MaterialId, Surface};
use glam::{Vec2, Vec3, Vec3A};
use rayon::prelude::*;
use shade::{Counts, PixelStream, Shader, ShadingPoint, Work};

/// Items that one task takes. Fixed, since the counts of work depend on it.
pub(crate) const CHUNK: usize = 512;

/// The side of the squares in which pixels are visited, so that neighbours in work are neighbours in space.
const TILE: u32 = 32;

/// No primitive: an eye ray that meets nothing.
pub(crate) const NOTHING: u32 = u32::MAX;

/// What the eye sees in a window of a picture, one ray through the middle of each pixel. Pixels count from its corner.
#[derive(Debug)]
pub(crate) struct Frame<'a> {
    shader: &'a Shader<'a>,
    window: Window,
    /// Of the pixels of the window only every so many are here, both ways, from the first on.
    step: u32,
    surfaces: Grid<Option<Seen>>,
}

/// A surface as it is kept for each pixel: 52 bytes instead of the 80 of an `Option<Surface>`, and the same to the bit.
#[derive(Clone, Copy, Debug)]
struct Seen {
    position: Vec3,
    geometric_normal: Vec3,
    shading_normal: Vec3,
    /// One more than its number, so that there is a value for nothing.
    object: NonZeroU32,
    primitive: u32,
    error: f32,
    material: MaterialId,
}

impl Seen {
    fn new(surface: &Surface) -> Self {
        let &Surface { position, geometric_normal, shading_normal, material, .. } = surface;
        let &Surface { object, primitive, error, .. } = surface;
        Self {
            position: position.into(),
            geometric_normal: geometric_normal.into(),
            shading_normal: shading_normal.into(),
            object: NonZeroU32::MIN.saturating_add(object),
            primitive,
            error,
            material,
        }
    }

    #[inline]
    fn surface(&self) -> Surface {
        Surface {
            position: self.position.into(),
            geometric_normal: self.geometric_normal.into(),
            shading_normal: self.shading_normal.into(),
            material: self.material,
            object: self.object.get() - 1,
            primitive: self.primitive,
            error: self.error,
        }
    }
}

impl<'a> Frame<'a> {
    /// Traces the eye rays.
    pub(crate) fn trace(
        shader: &'a Shader<'a>,
        window: Window,
        watch: Watch<'_>,
    ) -> Result<(Self, Counts), Interrupted> {
        let size = window.size;
        // Straight into the picture: it is larger than any cache, and copies of it take as long as the rays.
        let mut surfaces = vec![None; size.n_pixels()];
        let width = size.width as usize;
        // Bands of tiles, or, where there are too few to share, stretches of rows.
        let stretch = if size.height >= 8 * TILE { width * TILE as usize } else { CHUNK };
        let counts: Option<Vec<Counts>> = surfaces
            .par_chunks_mut(stretch)
            .enumerate()
            .map(|(i, surfaces)| {
                let first = i * stretch;
                let mut work = Work::default();
                for tile in (0..surfaces.len().min(width)).step_by(TILE as usize) {
                    for row in (0..surfaces.len()).step_by(width) {
                        let row_end = (row + width).min(surfaces.len());
                        let start = (row + tile).min(row_end);
                        let end = (start + TILE as usize).min(row_end);
                        for (i, surface) in (first + start..).zip(&mut surfaces[start..end]) {
                            if !watch(0) {
                                return None;
                            }
                            let ray = eye_ray(shader, window, size.pixel(i));
                            let met = shader.eye_surface(&ray, &mut work);
                            *surface = met.map(|surface| Seen::new(&surface));
                        }
                    }
                }
                watch(surfaces.len() as u64).then_some(work.counts)
            })
            .collect();
        let mut sum = Counts::default();
        counts.ok_or(Interrupted)?.into_iter().for_each(|counts| sum += counts);
        Ok((Self { shader, window, step: 1, surfaces: Grid::from_values(size, surfaces) }, sum))
    }

    /// Takes the primitives that the eye rays meet first, instead of looking for them: [`NOTHING`] where there is none.
    /// Nothing if there is an eye ray that doesn't meet its primitive.
    pub(crate) fn meeting(
        shader: &'a Shader<'a>,
        window: Window,
        primitives: &[u32],
        watch: Watch<'_>,
    ) -> Result<Option<Self>, Interrupted> {
        let (size, accel) = (window.size, &shader.scene.accel);
        let mut surfaces = vec![None; size.n_pixels()];
        let chunks = surfaces.par_chunks_mut(CHUNK).zip(primitives.par_chunks(CHUNK)).enumerate();
        let all_meet = chunks.map(|(chunk, (surfaces, primitives))| {
            let pixels = (chunk * CHUNK..).map(|i| size.pixel(i));
            for ((pixel, surface), &primitive) in pixels.zip(surfaces).zip(primitives) {
                if primitive != NOTHING {
                    let ray = eye_ray(shader, window, pixel);
                    let Some(met) = accel.surface_on(&ray, primitive) else { return Ok(false) };
                    *surface = Some(Seen::new(&met));
                }
            }
            if watch(CHUNK as u64) { Ok(true) } else { Err(Interrupted) }
        });
        let all_meet = all_meet.try_reduce(|| true, |a, b| Ok(a && b))?;
        let surfaces = Grid::from_values(size, surfaces);
        Ok(all_meet.then_some(Self { shader, window, step: 1, surfaces }))
    }

    /// Every `step`-th pixel, both ways, from the first on: a smaller picture of the same.
    pub(crate) fn thinned(&self, step: u32) -> Self {
        let ImageSize { width, height } = self.size();
        let size = ImageSize { width: width.div_ceil(step), height: height.div_ceil(step) };
        let mut surfaces = vec![None; size.n_pixels()];
        let rows = surfaces.par_chunks_mut(size.width as usize).enumerate();
        rows.for_each(|(y, row)| {
            let all = &self.surfaces.values()[y * (step * width) as usize..][..width as usize];
            row.iter_mut()
                .zip(all.iter().step_by(step as usize))
                .for_each(|(to, from)| *to = *from);
        });
        let surfaces = Grid::from_values(size, surfaces);
        Self { surfaces, step: self.step * step, ..*self }
    }

    /// The primitives that the eye rays meet first; [`NOTHING`] where there is none.
    pub(crate) fn primitives(&self) -> Vec<u32> {
        let primitive = |seen: &Option<Seen>| seen.map_or(NOTHING, |seen| seen.primitive);
        self.surfaces.values().iter().map(primitive).collect()
    }

    pub(crate) fn window(&self) -> Window {
        self.window
    }

    pub(crate) fn size(&self) -> ImageSize {
        self.surfaces.size()
    }

    /// How far apart pixels are in the window: 1 but in a thinned frame.
    pub(crate) fn step(&self) -> u32 {
        self.step
    }

    pub(crate) fn shader(&self) -> &'a Shader<'a> {
        self.shader
    }

    /// The first surface of the pixel of a number, its front side not turned to the eye.
    #[inline]
    pub(crate) fn surface(&self, index: usize) -> Option<Surface> {
        self.surfaces.values()[index].as_ref().map(Seen::surface)
    }

    /// Whether the pixel of a number shows a surface.
    #[inline]
    pub(crate) fn shows_surface(&self, index: usize) -> bool {
        self.surfaces.values()[index].is_some()
    }

    /// How many pixels show a surface.
    pub(crate) fn n_surfaces(&self) -> usize {
        self.surfaces.values().iter().flatten().count()
    }

    /// Radiance that the first surface of a pixel emits towards the eye, or that comes from beyond the scene.
    pub(crate) fn emitted(&self, pixel: Pixel) -> Rgb {
        let scene = self.shader.scene;
        let to_surface = || self.eye_ray(pixel).dir();
        match self.surface(self.size().index(pixel)) {
            Some(surface) if scene.material(&surface).emission.is_black() => Rgb::BLACK,
            Some(surface) => scene.emitted(&surface, -to_surface()),
            None => self.shader.background(to_surface()),
        }
    }

    /// Where the eye ray of a pixel starts.
    pub(crate) fn eye(&self, pixel: Pixel) -> Vec3A {
        let camera = &self.shader.scene.camera;
        if camera.is_pinhole() {
            return camera.origin();
        }
        self.eye_ray(pixel).origin()
    }

    fn eye_ray(&self, pixel: Pixel) -> Ray {
        eye_ray(self.shader, self.window, self.in_window(pixel))
    }

    /// The pixel of the window that a pixel is.
    #[inline]
    fn in_window(&self, Pixel { x, y }: Pixel) -> Pixel {
        Pixel { x: x * self.step, y: y * self.step }
    }

    /// The first surface of a pixel, as the eye sees it.
    pub(crate) fn point(&self, pixel: Pixel) -> Option<ShadingPoint<'a>> {
        let w_o = -self.eye_ray(pixel).dir();
        let surface = self.surface(self.size().index(pixel))?;
        Some(self.shader.shading_point(surface, w_o))
    }

    /// All pixels that show a surface, in an order in which neighbours are close.
    pub(crate) fn surface_pixels(&self) -> Vec<Pixel> {
        self.pixels_that_show(|_| true).collect()
    }

    /// The pixels that show some surfaces, in the same order.
    pub(crate) fn pixels_that_show(
        &self,
        is_wanted: impl Fn(&Surface) -> bool,
    ) -> impl Iterator<Item = Pixel> {
        pixels_by_tiles(self.size())
            .filter(move |&p| self.surfaces[p].is_some_and(|seen| is_wanted(&seen.surface())))
    }

    /// `f` of the surface points of some pixels, in parallel; the default where there is none.
    pub(crate) fn evaluate<T: Default + Send>(
        &self,
        pixels: &[Pixel],
        watch: Watch<'_>,
        f: impl Fn(&ShadingPoint<'a>, PixelStream, &mut Work) -> T + Sync,
    ) -> Result<(Vec<T>, Counts), Interrupted> {
        for_each(pixels, watch, |&pixel, work| self.at(pixel, work, &f))
    }

    /// `f` of the surface point of a pixel; the default where there is none.
    pub(crate) fn at<T: Default>(
        &self,
        pixel: Pixel,
        work: &mut Work,
        f: impl FnOnce(&ShadingPoint<'a>, PixelStream, &mut Work) -> T,
    ) -> T {
        let Window { whole, .. } = self.window;
        let in_whole = self.window.in_whole(self.in_window(pixel));
        let stream = PixelStream(whole.index(in_whole) as u64);
        self.point(pixel).map_or_else(T::default, |point| f(&point, stream, work))
    }

    /// Radiance of one component at some pixels.
    pub(crate) fn shade(
        &self,
        component: Component,
        pixels: &[Pixel],
        watch: Watch<'_>,
    ) -> Result<(Vec<Rgb>, Counts), Interrupted> {
        self.evaluate(pixels, watch, |point, stream, work| match component {
            Component::Direct => self.shader.direct(point, stream, work),
            Component::Indirect => self.shader.indirect(point, work),
            Component::Specular => self.shader.specular(point, stream, work),
            Component::Caustic => self.shader.caustic(point, work),
        })
    }
}

/// The ray through the middle of a pixel, and through a lens, if there is one, where the place of the pixel tells.
///
/// Sobol' points in Morton order (Ahmed and Wonka 2020): any square of 2^n pixels a side, at a multiple of that, has
/// stratified points, so the subpixels of a pixel see the whole lens, and the noise of neighbors differs.
fn eye_ray(shader: &Shader<'_>, window: Window, pixel: Pixel) -> Ray {
    let camera = &shader.scene.camera;
    let (size, pixel) = (window.whole, window.in_whole(pixel));
    let at = Vec2::new(pixel.x as f32 + 0.5, pixel.y as f32 + 0.5);
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

fn pixels_by_tiles(size: ImageSize) -> impl Iterator<Item = Pixel> {
    let ImageSize { width, height } = size;
    let corners = (0..height)
        .step_by(TILE as usize)
        .flat_map(move |top| (0..width).step_by(TILE as usize).map(move |left| (top, left)));
    corners.flat_map(move |(top, left)| {
        (top..(top + TILE).min(height))
            .flat_map(move |y| (left..(left + TILE).min(width)).map(move |x| Pixel { x, y }))
    })
}

/// `f` of each item, in parallel, and the work that was done.
pub(crate) fn for_each<I: Sync, T: Send>(
    items: &[I],
    watch: Watch<'_>,
    f: impl Fn(&I, &mut Work) -> T + Sync,
) -> Result<(Vec<T>, Counts), Interrupted> {
    let chunks: Option<Vec<(Vec<T>, Counts)>> = items
        .par_chunks(CHUNK)
        .map(|items| {
            let mut work = Work::default();
            // Asked before each item, since some take long.
            let values: Option<Vec<T>> =
                items.iter().map(|item| watch(0).then(|| f(item, &mut work))).collect();
            watch(items.len() as u64).then_some((values?, work.counts))
        })
        .collect();
    chunks.map(|chunks| join(chunks, items.len())).ok_or(Interrupted)
}

/// The values of chunks of so many items in order, and all work together.
pub(crate) fn join<T>(chunks: Vec<(Vec<T>, Counts)>, n: usize) -> (Vec<T>, Counts) {
    let mut all = Vec::with_capacity(n);
    let mut counts = Counts::default();
    for (values, c) in chunks {
        all.extend(values);
        counts += c;
    }
    (all, counts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_of_a_surface_is_all_of_it() {
        assert_eq!(size_of::<Option<Seen>>(), 52);
        for (object, material) in [(0, 0), (7, 3), (u32::MAX - 1, u16::MAX)] {
            let surface = Surface {
                position: Vec3A::new(1.0, -0.0, f32::MIN_POSITIVE),
                geometric_normal: Vec3A::X,
                shading_normal: Vec3A::new(0.6, 0.8, 0.0),
                material: MaterialId(material),
                object,
                primitive: u32::MAX,
                error: 1e-30,
            };
            assert_eq!(format!("{:?}", Seen::new(&surface).surface()), format!("{surface:?}"));
        }
    }
}
