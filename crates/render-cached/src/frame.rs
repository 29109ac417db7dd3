//! The eye rays of a picture, and the shading of any set of its pixels.

use std::num::NonZeroU32;

use base::{
    Component, Grid, ImageSize, Interrupted, OwenSobol, Pixel, Ray, Rgb, Stream, Watch, Window,
    hash_u64,
};
use geometry::{Frustum, MaterialId, Surface};
use glam::{Vec2, Vec3, Vec3A};
use rayon::prelude::*;
use shade::{Counts, PixelStream, Shader, ShadingPoint, Work};

/// Items that one task takes. Fixed, since the counts of work depend on it.
pub(crate) const CHUNK: usize = 512;

/// The side of the squares in which pixels are visited, so that neighbours in work are neighbours in space.
const TILE: u32 = 32;

/// The side of the largest squares of pixels that are tried for one flat surface.
const BLOCK: u32 = 16;

/// The side of the smallest.
const SMALLEST_BLOCK: u32 = 4;

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
        // Where there are too few bands of tiles to share, lower ones.
        let rows = if size.height >= 8 * TILE { TILE } else { BLOCK / 2 };
        let counts: Option<Vec<Counts>> = surfaces
            .par_chunks_mut((size.width * rows) as usize)
            .zip((0..size.height).into_par_iter().step_by(rows as usize))
            .map(|(surfaces, top)| {
                let n = surfaces.len() as u64;
                let mut band = Band {
                    shader,
                    window,
                    top,
                    surfaces,
                    traced: [0; TILE as usize],
                    work: Work::default(),
                };
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
        (0..self.size().n_pixels()).map(|index| self.primitive(index)).collect()
    }

    /// The same of the pixel of a number.
    #[inline]
    pub(crate) fn primitive(&self, index: usize) -> u32 {
        self.surfaces.values()[index].as_ref().map_or(NOTHING, |seen| seen.primitive)
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

/// Rows of a frame whose eye rays are being traced, one tile after the other.
struct Band<'x, 'a> {
    shader: &'x Shader<'a>,
    window: Window,
    /// The first of the rows.
    top: u32,
    surfaces: &'x mut [Option<Seen>],
    /// For each row of the tile a bit for each pixel whose ray is traced.
    traced: [u32; TILE as usize],
    work: Work,
}

impl Band<'_, '_> {
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
        if let Some(frustum) = frustum {
            for pixel in pixels {
                if !self.is_traced(pixel) {
                    let ray = ray(pixel);
                    match self.shader.scene.accel.surface_in(&frustum, &ray) {
                        Some(surface) => self.set(pixel, Some(Seen::new(&surface))),
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

    /// What holds the rays of a block, its last column and row given. Its corners are traced.
    fn frustum(
        &mut self,
        [left, right, top, bottom]: [u32; 4],
        ray: &impl Fn(Pixel) -> Ray,
    ) -> Option<Frustum> {
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
        let corners = corners.map(|(x, y)| Pixel { x, y });
        corners.iter().for_each(|&corner| self.search(corner, ray));
        let [first, others @ ..] = corners.map(|corner| self.surfaces[self.index(corner)]);
        let first = first?;
        let is_same = |seen: Option<Seen>| seen.is_some_and(|s| s.primitive == first.primitive);
        if left == right || top == bottom || !others.into_iter().all(is_same) {
            return None;
        }
        let scene = self.shader.scene;
        let dirs = corners.map(|corner| ray(corner).dir());
        scene.frustum(scene.camera.origin(), dirs, &first.surface())
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
        self.set(pixel, met.map(|surface| Seen::new(&surface)));
    }

    #[inline]
    fn is_traced(&self, Pixel { x, y }: Pixel) -> bool {
        self.traced[(y - self.top) as usize] >> (x % TILE) & 1 != 0
    }

    #[inline]
    fn set(&mut self, pixel: Pixel, seen: Option<Seen>) {
        self.traced[(pixel.y - self.top) as usize] |= 1 << (pixel.x % TILE);
        let index = self.index(pixel);
        self.surfaces[index] = seen;
    }

    /// Of a pixel in the band.
    #[inline]
    fn index(&self, Pixel { x, y }: Pixel) -> usize {
        (y - self.top) as usize * self.window.size.width as usize + x as usize
    }
}

/// The middle of a pixel, in pixels from the corner of the picture.
#[inline]
fn middle(pixel: Pixel) -> Vec2 {
    Vec2::new(pixel.x as f32 + 0.5, pixel.y as f32 + 0.5)
}

/// The ray through the middle of a pixel, and through a lens, if there is one, where the place of the pixel tells.
///
/// Sobol' points in Morton order (Ahmed and Wonka 2020): any square of 2^n pixels a side, at a multiple of that, has
/// stratified points, so the subpixels of a pixel see the whole lens, and the noise of neighbors differs.
fn eye_ray(shader: &Shader<'_>, window: Window, pixel: Pixel) -> Ray {
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
    use std::path::Path;

    use photon_map::{Gather, Kernel, Metadata, PhotonMaps, PhotonSet};
    use scene::Scene;
    use shade::Settings;

    use super::*;

    /// Asserts that frames of windows of all shapes show what each eye ray arrives at.
    fn assert_traced(scene: &Scene, whole: ImageSize) {
        let maps = PhotonMaps {
            metadata: Metadata::default(),
            direct: None,
            caustic: PhotonSet::build(&[]),
            indirect: PhotonSet::build(&[]),
            focused: None,
        };
        let gather = Gather { k: 1, max_radius: 1.0, kernel: Kernel::Cone };
        let settings =
            Settings { shadow_rays: 1, glossy_rays: 1, indirect: gather, caustic: gather, seed: 7 };
        let shader = Shader::new(scene, &maps, settings);
        let bits = |surface: Option<Surface>| format!("{surface:?}");
        let one_by_one = Grid::from_fn(whole, |pixel| {
            let ray = eye_ray(&shader, Window::whole(whole), pixel);
            bits(shader.eye_surface(&ray, &mut Work::default()))
        });
        let ImageSize { width, height } = whole;
        for part in [
            [0, width, 0, height],
            [0, width, 3, height],
            [13, width - 5, 0, 281],
            [1, 18, 0, height],
            [37, 38, 0, height],
            [5, width, 101, 140],
            [0, width, 77, 78],
        ] {
            let window = Window::new(part, whole).expect("a part");
            let (frame, counts) = Frame::trace(&shader, window, &|_| true).unwrap();
            assert_eq!(counts.eye_rays, window.size.n_pixels() as u64);
            for (i, pixel) in window.size.pixels().enumerate() {
                let at = window.in_whole(pixel);
                assert_eq!(bits(frame.surface(i)), one_by_one[at], "{at:?} in {part:?}");
            }
        }
        let window = Window::whole(whole);
        assert!(Frame::trace(&shader, window, &|_| false).is_err());
    }

    #[test]
    fn blocks_show_what_each_eye_ray_arrives_at() {
        let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let parts = |name: &str| scene::load_parts(&scenes.join(name), &OPTIONS).unwrap().0;
        let whole = ImageSize { width: 190, height: 301 };
        for name in ["cornell-box/scene.toml", "rabbit/scene.toml", "interior/scene.xml"] {
            assert_traced(&Scene::assemble(parts(name)), whole);
        }
        let mut masked = parts("cornell-box/scene.toml");
        masked.materials.iter_mut().step_by(2).for_each(|material| material.opacity = 0.5);
        assert_traced(&Scene::assemble(masked), whole);
        let mut through_lens = parts("cornell-box/scene.toml");
        through_lens.camera = through_lens.camera.with_lens(0.1, 3.0);
        assert_traced(&Scene::assemble(through_lens), whole);
    }

    const OPTIONS: scene::Options =
        scene::Options { definitions: Vec::new(), lenient: false, no_external: false };

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
