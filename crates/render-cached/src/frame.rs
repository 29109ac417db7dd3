//! What the eye sees in a picture, and the shading of any set of its pixels.

mod eye;
mod seen;

use std::sync::Arc;

use base::{Component, Grid, ImageSize, Interrupted, Pixel, Ray, Rgb, Watch, Window};
use geometry::{Surface, Target};
use glam::Vec3A;
use rayon::prelude::*;
use scene::Material;
use shade::{Counts, PixelStream, Shader, ShadingPoint, Work};

use eye::{eye_ray, middle, trace};
use seen::{Seen, Sight, Surfaces};

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
    surfaces: Surfaces,
}

impl<'a> Frame<'a> {
    /// Traces the eye rays.
    pub(crate) fn trace(
        shader: &'a Shader<'a>,
        window: Window,
        watch: Watch<'_>,
    ) -> Result<(Self, Counts), Interrupted> {
        let (surfaces, counts) = trace(shader, window, watch)?;
        Ok((Self { shader, window, step: 1, surfaces: Surfaces::kept(surfaces) }, counts))
    }

    /// The same for a frame that will be thinned by `step`, and of whose other pixels little is asked. What a surface lets pass
    /// can't be found anew, so there must be no such surfaces.
    pub(crate) fn sketch(
        shader: &'a Shader<'a>,
        window: Window,
        step: u32,
        watch: Watch<'_>,
    ) -> Result<(Self, Counts), Interrupted> {
        debug_assert!(!shader.scene.is_masked());
        let (primitives, counts) = trace(shader, window, watch)?;
        let surfaces = Surfaces::Named { primitives, some: None };
        let mut frame = Self { shader, window, step: 1, surfaces };
        let every = Arc::new(frame.every(step));
        if let Surfaces::Named { some, .. } = &mut frame.surfaces {
            *some = Some((step, every));
        }
        Ok((frame, counts))
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
        let surfaces = Surfaces::kept(Grid::from_values(size, surfaces));
        Ok(all_meet.then_some(Self { shader, window, step: 1, surfaces }))
    }

    /// Every `step`-th pixel, both ways, from the first on, with all of its surface: a smaller picture of the same.
    pub(crate) fn thinned(&self, step: u32) -> Self {
        let surfaces = match &self.surfaces {
            Surfaces::Kept(surfaces) if step == 1 => Surfaces::Kept(surfaces.clone()),
            Surfaces::Named { some: Some((every, surfaces)), .. } if *every == step => {
                Surfaces::Kept(surfaces.clone())
            }
            _ => Surfaces::kept(self.every(step)),
        };
        Self { surfaces, step: self.step * step, ..*self }
    }

    /// The surfaces of every `step`-th pixel.
    fn every(&self, step: u32) -> Grid<Option<Seen>> {
        let ImageSize { width, height } = self.size();
        let size = ImageSize { width: width.div_ceil(step), height: height.div_ceil(step) };
        let mut surfaces = vec![None; size.n_pixels()];
        let rows = surfaces.par_chunks_mut(size.width as usize).zip(0..size.height);
        rows.for_each(|(row, y)| {
            let mut looks = self.looks();
            for (to, x) in row.iter_mut().zip(0..) {
                let pixel = Pixel { x: x * step, y: y * step };
                *to = looks.surface(pixel).as_ref().map(Seen::new);
            }
        });
        Grid::from_values(size, surfaces)
    }

    /// The primitives that the eye rays meet first; [`NOTHING`] where there is none.
    pub(crate) fn primitives(&self) -> Vec<u32> {
        (0..self.size().n_pixels()).map(|index| self.primitive(index)).collect()
    }

    /// The same of the pixel of a number.
    #[inline]
    pub(crate) fn primitive(&self, index: usize) -> u32 {
        match &self.surfaces {
            Surfaces::Kept(surfaces) => surfaces.values()[index].primitive(),
            Surfaces::Named { primitives, .. } => primitives.values()[index],
        }
    }

    pub(crate) fn window(&self) -> Window {
        self.window
    }

    pub(crate) fn size(&self) -> ImageSize {
        match &self.surfaces {
            Surfaces::Kept(surfaces) => surfaces.size(),
            Surfaces::Named { primitives, .. } => primitives.size(),
        }
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
        let pixel = self.size().pixel(index);
        self.surfaces.seen(pixel).unwrap_or_else(|primitive| {
            self.shader.scene.accel.surface_on(&self.eye_ray(pixel), primitive)
        })
    }

    /// The same, given the eye ray of the pixel.
    #[inline]
    fn met(&self, pixel: Pixel, ray: &Ray) -> Option<Surface> {
        let find = |primitive| self.shader.scene.accel.surface_on(ray, primitive);
        self.surfaces.seen(pixel).unwrap_or_else(find)
    }

    /// For the surfaces of pixels one after the other, which often show the same triangle.
    pub(crate) fn looks(&self) -> Looks<'_, 'a, impl Fn(Pixel) -> Ray> {
        let camera = &self.shader.scene.camera;
        let rays = camera.rays(self.window.whole);
        let is_pinhole = camera.is_pinhole();
        let ray = move |pixel| match is_pinhole {
            true => rays(middle(self.window.in_whole(self.in_window(pixel)))),
            false => self.eye_ray(pixel),
        };
        Looks { frame: self, ray, last: None }
    }

    /// What the pixel of a number shows is made of.
    #[inline]
    pub(crate) fn material(&self, index: usize) -> Option<&'a Material> {
        let scene = self.shader.scene;
        match &self.surfaces {
            Surfaces::Kept(surfaces) => {
                let seen = surfaces.values()[index].as_ref()?;
                Some(&scene.materials[usize::from(seen.material.0)])
            }
            Surfaces::Named { primitives, .. } => match primitives.values()[index] {
                NOTHING => None,
                primitive => Some(scene.material_of(primitive)),
            },
        }
    }

    /// Whether the pixel of a number shows a surface.
    #[inline]
    pub(crate) fn shows_surface(&self, index: usize) -> bool {
        self.primitive(index) != NOTHING
    }

    /// How many pixels show a surface.
    pub(crate) fn n_surfaces(&self) -> usize {
        (0..self.size().n_pixels()).filter(|&index| self.shows_surface(index)).count()
    }

    /// Radiance that the first surface of a pixel emits towards the eye, or that comes from beyond the scene.
    pub(crate) fn emitted(&self, pixel: Pixel) -> Rgb {
        let index = self.size().index(pixel);
        if self.material(index).is_some_and(|material| material.emission.is_black()) {
            return Rgb::BLACK;
        }
        let ray = self.eye_ray(pixel);
        match self.met(pixel, &ray) {
            Some(surface) => self.shader.scene.emitted(&surface, -ray.dir()),
            None => self.shader.background(ray.dir()),
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
        let ray = self.eye_ray(pixel);
        let surface = self.met(pixel, &ray)?;
        Some(self.shader.shading_point(surface, -ray.dir()))
    }

    /// All pixels that show a surface, in an order in which neighbours are close.
    pub(crate) fn surface_pixels(&self) -> Vec<Pixel> {
        self.pixels_that_show(|_| true).collect()
    }

    /// The pixels that show surfaces of some materials, in the same order.
    pub(crate) fn pixels_that_show(
        &self,
        is_wanted: impl Fn(&Material) -> bool,
    ) -> impl Iterator<Item = Pixel> {
        let size = self.size();
        pixels_by_tiles(size)
            .filter(move |&pixel| self.material(size.index(pixel)).is_some_and(&is_wanted))
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

/// What many pixels show: see [`Frame::looks`].
pub(crate) struct Looks<'x, 'a, R> {
    frame: &'x Frame<'a>,
    /// The eye ray of a pixel.
    ray: R,
    /// The last primitive that a ray was to meet.
    last: Option<(u32, Target)>,
}

impl<'a, R: Fn(Pixel) -> Ray> Looks<'_, 'a, R> {
    /// [`Frame::surface`], by pixel.
    #[inline]
    pub(crate) fn surface(&mut self, pixel: Pixel) -> Option<Surface> {
        match self.frame.surfaces.seen(pixel) {
            Ok(surface) => surface,
            Err(primitive) => self.find(primitive, &(self.ray)(pixel)),
        }
    }

    /// [`Frame::point`].
    pub(crate) fn point(&mut self, pixel: Pixel) -> Option<ShadingPoint<'a>> {
        let frame = self.frame;
        let ray = (self.ray)(pixel);
        let find = |primitive| self.find(primitive, &ray);
        let surface = frame.surfaces.seen(pixel).unwrap_or_else(find)?;
        Some(frame.shader.shading_point(surface, -ray.dir()))
    }

    #[inline]
    fn find(&mut self, primitive: u32, ray: &Ray) -> Option<Surface> {
        let accel = &self.frame.shader.scene.accel;
        if self.last.is_none_or(|(last, _)| last != primitive) {
            self.last = Some((primitive, accel.target(primitive)?));
        }
        accel.surface_at(ray, &self.last.as_ref()?.1)
    }
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
            if scene.is_masked() {
                continue;
            }
            let step = 2 + window.size.width % 2;
            let (sketch, _) = Frame::sketch(&shader, window, step, &|_| true).unwrap();
            let mut looks = sketch.looks();
            for (i, pixel) in window.size.pixels().enumerate() {
                let expected = &one_by_one[window.in_whole(pixel)];
                let seen = [sketch.surface(i), looks.point(pixel).map(|point| point.surface)];
                for surface in seen {
                    assert_eq!(&bits(surface), expected, "{pixel:?} of {step} in {part:?}");
                }
                let material = sketch.material(i).map(|material| &material.name);
                assert_eq!(material, frame.surface(i).map(|s| &scene.material(&s).name));
            }
            for step in [1, step] {
                let (thin, expected) = (sketch.thinned(step), frame.thinned(step));
                for i in 0..thin.size().n_pixels() {
                    assert_eq!(bits(thin.surface(i)), bits(expected.surface(i)));
                }
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
}
