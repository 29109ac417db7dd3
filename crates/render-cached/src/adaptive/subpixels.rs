//! Subpixels between those that the cache works on.
//!
//! Of the subpixels of a pixel the cache works on one, the first: these form a picture of their own, in which components are
//! computed, refined, verified and measured. Eye rays are traced for all, so silhouettes, materials and textures are exact; the
//! light at the others is that of the four around them. Where those differ too much, in the borders of sharp shadows and of what
//! mirrors and glass show, or show other surfaces, it is computed. So the cost of light hardly grows with their number.

use base::{
    Component, Components, Grid, ImageSize, Interrupted, Pixel, Rgb, Watch, math::FRAC_1_PI,
};
use cache_map::{Reason, SurfacePoint, Tolerance, Value, same_surface};
use geometry::Surface;
use glam::Vec3A;
use rayon::prelude::*;
use scene::{Camera, Light};

use super::direct::Lack;
use super::glossy::Glossy;
use super::leaves::{ByPixel, Finished, Leaves, begins_sharply, site_of};
use super::primary::Primary;
use super::strictness::Strictness;
use super::view::as_seen;
use super::whole::FEWEST_PIXELS;
use super::{Account, View};
use crate::Args;
use crate::frame::Frame;

/// The picture of the first subpixels, finished.
pub(super) struct Coarse<'x, 'a> {
    pub(super) frame: &'x Frame<'a>,
    pub(super) view: &'x View,
    pub(super) primary: &'x Primary,
    pub(super) finished: &'x Finished,
    pub(super) strictness: &'x Strictness,
}

/// Points of a light that single rays go to are stratified over squares of so many subpixels.
const BLOCK: u32 = 4;

/// All subpixels.
pub(super) struct Fine {
    pub(super) values: Components<Grid<Rgb>>,
    pub(super) reasons: Components<Vec<Reason>>,
    pub(super) levels: Components<Vec<u8>>,
}

/// The cells of the coarse picture, each between four of its pixels.
#[derive(Clone, Copy)]
pub(super) struct Cells {
    size: ImageSize,
    /// Subpixels of a pixel, each way.
    n: u32,
}

impl Cells {
    /// The corners of the cell that begins at a coarse pixel. At the border of the picture some are the same.
    #[inline]
    fn corners(self, Pixel { x, y }: Pixel) -> [usize; 4] {
        let (right, below) = ((x + 1).min(self.size.width - 1), (y + 1).min(self.size.height - 1));
        [(x, y), (right, y), (x, below), (right, below)]
            .map(|(x, y)| self.size.index(Pixel { x, y }))
    }

    /// Where in its cell a subpixel lies, from 0 to 1 both ways.
    #[inline]
    fn place(self, Pixel { x, y }: Pixel) -> [f32; 2] {
        [x, y].map(|at| (at % self.n) as f32 / self.n as f32)
    }

    /// The coarse pixels around a subpixel of which something holds.
    pub(super) fn around(
        self,
        subpixel: Pixel,
        is_shown: impl Fn(usize) -> bool,
    ) -> Option<Corners> {
        let Pixel { x, y } = subpixel;
        let cell = self.corners(Pixel { x: x / self.n, y: y / self.n });
        Corners::new(&cell, self.place(subpixel), is_shown)
    }
}

/// The pixels of the coarse picture around a subpixel that show its surface, with weights that sum to 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corners {
    at: [usize; 4],
    weights: [f32; 4],
    n: usize,
    /// Whether none of those around it was left out.
    pub(super) is_whole: bool,
}

impl Corners {
    /// Of the corners of a cell those that `is_shown` says show the surface of the subpixel at `place` in it, from 0 to 1 both
    /// ways; nothing if none does.
    #[inline]
    fn new(cell: &[usize; 4], place: [f32; 2], is_shown: impl Fn(usize) -> bool) -> Option<Self> {
        let mut corners = Self { at: [0; 4], weights: [0.0; 4], n: 0, is_whole: true };
        let mut sum = 0.0;
        for (&at, weight) in cell.iter().zip(bilinear(place)) {
            if weight > 0.0 {
                if is_shown(at) {
                    (corners.at[corners.n], corners.weights[corners.n]) = (at, weight);
                    corners.n += 1;
                    sum += weight;
                } else {
                    corners.is_whole = false;
                }
            }
        }
        if !corners.is_whole {
            corners.weights.iter_mut().for_each(|weight| *weight /= sum);
        }
        (corners.n > 0).then_some(corners)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, f32)> {
        self.at[..self.n].iter().copied().zip(self.weights)
    }

    /// The value in between.
    #[inline]
    pub(super) fn blend<T: Value>(&self, of: impl Fn(usize) -> T) -> T {
        self.iter().fold(T::default(), |sum, (at, weight)| sum + of(at) * weight)
    }

    /// How far the values differ.
    #[inline]
    pub(super) fn span<T: Value>(&self, of: impl Fn(usize) -> T) -> f32 {
        let first = of(self.at[0]);
        self.at[1..self.n].iter().map(|&at| (of(at) - first).size()).fold(0.0, f32::max)
    }
}

/// What is left to do of some subpixels.
#[derive(Default)]
struct Rest {
    /// Nothing around them shows their surface.
    alone: Vec<Pixel>,
    /// The light of some emitters is unknown, or in doubt.
    lights: Vec<(Pixel, Lack)>,
    /// Caustics differ too much.
    caustic: Vec<Pixel>,
    /// Chains differ.
    /// Of most it is known what comes by branches that carry little.
    chains: Vec<(Pixel, Option<Rgb>)>,
}

impl Rest {
    fn append(mut self, mut later: Self) -> Self {
        self.alone.append(&mut later.alone);
        self.lights.append(&mut later.lights);
        self.caustic.append(&mut later.caustic);
        self.chains.append(&mut later.chains);
        self
    }
}

/// Whether the cache works on one subpixel of each pixel of a picture: there must be enough of them, and what lies beside each
/// other in the picture must lie so in the scene, which a lens doesn't grant.
pub(crate) fn are_told(args: &Args, n_subpixels: usize, camera: &Camera) -> bool {
    let n = args.supersample as usize;
    n > 1 && n_subpixels / (n * n) >= FEWEST_PIXELS && camera.is_pinhole()
}

/// The first subpixel of each pixel, if the cache is to work on these alone.
pub(super) fn coarse<'a>(args: &Args, frame: &Frame<'a>) -> Option<Frame<'a>> {
    let camera = &frame.shader().scene.camera;
    let are_told = are_told(args, frame.size().n_pixels(), camera);
    are_told.then(|| frame.thinned(args.supersample))
}

/// Finds the light at all pixels of a frame, `coarse` being that of some of them.
pub(super) fn render(
    coarse: &Coarse<'_, '_>,
    specular: &mut Leaves,
    history: (Components<Vec<Reason>>, Components<Vec<u8>>),
    account: &mut Account<'_, '_>,
) -> Result<Fine, Interrupted> {
    let frame = account.frame;
    let (size, shader) = (frame.size(), frame.shader());
    let Coarse { view, primary, finished, strictness, .. } = coarse;
    let cells = Cells { size: view.size(), n: coarse.frame.step() / frame.step() };
    let by_pixel = specular.by_pixel(view.size().n_pixels());
    let mut values = Components::from_fn(|_| vec![Rgb::BLACK; size.n_pixels()]);
    let tolerance = strictness.tolerance(Component::Direct);
    let emitters = shader.scene.lights.iter().filter_map(Light::enclosing_sphere).collect();
    let by_pixel = &by_pixel;
    let sweep = Sweep { frame, coarse, cells, specular, by_pixel, emitters, tolerance };
    let n_rows = view.size().height as usize;
    let rest = account.watched(n_rows, |watch| sweep.all(&mut values, watch))?;
    let Rest { alone, lights, caustic, chains } = rest;
    let (reasons, levels) = history;
    let mut reasons = Components::from_fn(|component| spread(&reasons[component], cells));
    let mut levels = Components::from_fn(|component| spread(&levels[component], cells));

    // What the lights are predicted to do where not all around a subpixel is its surface, and that is black or white, is asked by
    // one ray.
    let is_free = account.overhead(&lights, |(pixel, lack), work| {
        let light = lack.is_doubtful.then(|| primary.direct.light(lack.part)).flatten()?;
        let Pixel { x, y } = *pixel;
        let block = u64::from(y / BLOCK) << 32 | u64::from(x / BLOCK);
        frame.at(*pixel, work, |point, _, work| {
            shader.probe(light, &point.facing, y % BLOCK * BLOCK + x % BLOCK, block, work)
        })
    })?;
    let mut unknown = Vec::new();
    for (&(pixel, lack), is_free) in lights.iter().zip(is_free) {
        if lack.is_doubtful && is_free.is_none_or(|free| free == lack.is_lit) {
            values.direct[size.index(pixel)] += lack.radiance;
        } else {
            unknown.push((pixel, lack));
        }
    }
    let found = account.items(Component::Direct, &unknown, |&(pixel, lack), work| {
        frame.at(pixel, work, |point, stream, work| {
            let irradiance = primary.direct.compute(lack.part, shader, &point.facing, stream, work);
            point.albedo * irradiance * FRAC_1_PI
        })
    })?;
    for (&(pixel, lack), radiance) in unknown.iter().zip(found) {
        let i = size.index(pixel);
        values.direct[i] += radiance;
        reasons.direct[i] = if lack.is_doubtful { Reason::Verification } else { Reason::Edge };
    }
    for component in [Component::Direct, Component::Indirect, Component::Caustic] {
        let found = account.pixels(component, &alone, |point, stream, work| match component {
            Component::Direct => shader.direct(point, stream, work),
            Component::Indirect => shader.indirect(point, work),
            _ => shader.caustic(point, work),
        })?;
        for (&pixel, radiance) in alone.iter().zip(found) {
            let i = size.index(pixel);
            (values[component][i], reasons[component][i]) = (radiance, Reason::NoNeighbours);
        }
    }
    let found =
        account.pixels(Component::Caustic, &caustic, |p, _, work| shader.caustic(p, work))?;
    for (&pixel, radiance) in caustic.iter().zip(found) {
        let i = size.index(pixel);
        (values.caustic[i], reasons.caustic[i]) = (radiance, Reason::Edge);
    }

    let tolerance = strictness.tolerance(Component::Specular);
    let followed =
        specular.between(by_pixel, &chains, cells, view, finished, tolerance, account)?;
    let first = |&Pixel { x, y }: &Pixel| Pixel { x: x * cells.n, y: y * cells.n };
    let mut glossy: Vec<Pixel> = specular.glossy_pixels().iter().map(first).collect();
    for (&(pixel, _), followed) in chains.iter().zip(followed) {
        let i = size.index(pixel);
        (values.specular[i], reasons.specular[i]) = (followed.radiance, followed.reason);
        glossy.extend(followed.is_glossy.then_some(pixel));
    }
    let mut glossy = Glossy::start(frame, &glossy);
    let sharp = |i: usize| values.specular[i];
    glossy.resolve(view, finished, sharp, strictness.tolerance_of_glossy(), account)?;
    glossy.tell(&mut reasons.specular, &mut levels.specular);
    let all = values.specular.par_iter_mut().with_min_len(4096).enumerate();
    all.for_each(|(i, value)| *value += glossy.radiance(i));
    let Components { direct, indirect, specular, caustic } = values;
    let grid = |values| Grid::from_values(size, values);
    let values = Components {
        direct: grid(direct),
        indirect: grid(indirect),
        specular: grid(specular),
        caustic: grid(caustic),
    };
    Ok(Fine { values, reasons, levels })
}

/// Values for all subpixels: those of the coarse pixels, and nothing between.
fn spread<T: Copy + Default + Send + Sync>(of: &[T], cells: Cells) -> Vec<T> {
    let Cells { size: ImageSize { width, height }, n } = cells;
    let (width, n) = (width as usize, n as usize);
    let mut all = vec![T::default(); width * height as usize * n * n];
    let rows = all.par_chunks_mut(width * n * n).zip(of.par_chunks(width));
    rows.for_each(|(all, of)| all.iter_mut().step_by(n).zip(of).for_each(|(to, &from)| *to = from));
    all
}

/// The weights of the corners of a cell at a place in it.
#[inline]
fn bilinear([x, y]: [f32; 2]) -> [f32; 4] {
    [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y]
}

#[inline]
fn mean(values: &[Rgb; 4], weights: [f32; 4]) -> Rgb {
    values.iter().zip(weights).fold(Rgb::BLACK, |sum, (&value, weight)| sum + value * weight)
}

/// What the corners of a cell show that lies on one surface.
struct Even {
    site: SurfacePoint,
    direct: [Rgb; 4],
    indirect: [Rgb; 4],
    caustic: [Rgb; 4],
}

/// All that is known of the coarse picture, and the subpixels between.
struct Sweep<'x, 'a> {
    frame: &'x Frame<'a>,
    coarse: &'x Coarse<'x, 'a>,
    cells: Cells,
    specular: &'x Leaves,
    by_pixel: &'x ByPixel,
    /// Spheres around them.
    emitters: Vec<(Vec3A, f32)>,
    tolerance: Tolerance,
}

/// Radiance of the subpixels of some rows.
type Rows<'x> = Components<&'x mut [Rgb]>;

impl Sweep<'_, '_> {
    /// Finds what can be found without computing anything, and says what is left. Nothing if somebody has asked for a stop.
    fn all(&self, values: &mut Components<Vec<Rgb>>, watch: Watch<'_>) -> Option<Rest> {
        let Cells { size, n } = self.cells;
        let stride = size.width as usize * (n * n) as usize;
        let Components { direct, indirect, specular, caustic } = values;
        let rows = (
            direct.par_chunks_mut(stride),
            indirect.par_chunks_mut(stride),
            specular.par_chunks_mut(stride),
            caustic.par_chunks_mut(stride),
        );
        let rows = rows.into_par_iter().enumerate();
        let rests: Option<Vec<Rest>> = rows
            .map(|(y, (direct, indirect, specular, caustic))| {
                let mut rows = Rows { direct, indirect, specular, caustic };
                watch(1).then(|| self.row(y as u32, &mut rows))
            })
            .collect();
        Some(rests?.into_iter().fold(Rest::default(), Rest::append))
    }

    /// The subpixels of a row of coarse pixels.
    fn row(&self, y: u32, values: &mut Rows<'_>) -> Rest {
        let Cells { size: ImageSize { width, .. }, n } = self.cells;
        let frame = self.frame;
        let scene = frame.shader().scene;
        let mut rest = Rest::default();
        for x in 0..width {
            let cell = self.cells.corners(Pixel { x, y });
            let even = self.even(Pixel { x, y }, &cell);
            let mut chains_agree = None;
            for (dy, dx) in (0..n).flat_map(|dy| (0..n).map(move |dx| (dy, dx))) {
                let pixel = Pixel { x: x * n + dx, y: y * n + dy };
                let Some(surface) = frame.surface(frame.size().index(pixel)) else { continue };
                let material = scene.material(&surface);
                let at = (dy * width * n + x * n + dx) as usize;
                let place = self.cells.place(pixel);
                if material.is_diffuse() {
                    let (site, albedo) = as_seen(&surface, frame.eye(pixel), scene);
                    let albedo = albedo * FRAC_1_PI;
                    match &even {
                        Some(even) if same_surface(&even.site, &site) => {
                            let weights = bilinear(place);
                            values.direct[at] = albedo * mean(&even.direct, weights);
                            values.indirect[at] = albedo * mean(&even.indirect, weights);
                            values.caustic[at] = albedo * mean(&even.caustic, weights);
                        }
                        _ => {
                            let (seen, rest) = ((pixel, site, albedo), &mut rest);
                            let found = self.diffuse(seen, &cell, place, rest);
                            values.direct[at] = albedo * found[0];
                            values.indirect[at] = albedo * found[1];
                            values.caustic[at] = albedo * found[2];
                        }
                    }
                }
                if begins_sharply(material) {
                    let known = match (dx, dy) {
                        (0, 0) => Ok(self.specular.radiance(cell[0])),
                        _ => {
                            let agree =
                                *chains_agree.get_or_insert_with(|| self.chains_agree(&cell));
                            self.specular(&surface, &cell, place, agree)
                        }
                    };
                    match known {
                        Ok(radiance) => values.specular[at] = radiance,
                        Err(faint) => rest.chains.push((pixel, faint)),
                    }
                }
            }
        }
        rest
    }

    /// Irradiance at the corners of a cell that show one surface far from its edges, if it is so alike that it holds everywhere
    /// between.
    fn even(&self, first: Pixel, cell: &[usize; 4]) -> Option<Even> {
        let Coarse { view, primary, finished, .. } = self.coarse;
        if !view.lattice.has_no_edge_around(first) {
            return None;
        }
        let site = view.sites.values()[cell[0]]?;
        let even = Even {
            site,
            direct: cell.map(|i| primary.direct.irradiance(i)),
            indirect: cell.map(|i| primary.indirect.irradiance(i)),
            caustic: cell.map(|i| primary.caustic.irradiance(i)),
        };
        let dark = finished.floor / view.gain(cell[0]).max(f32::MIN_POSITIVE);
        let others = dark + (even.indirect[0] + even.caustic[0]).luminance();
        let most = self.tolerance.edge * (others + even.direct[0].luminance());
        let differs = |values: &[Rgb; 4]| values.iter().any(|&v| (v - values[0]).size() > most);
        let is_even = !differs(&even.caustic) && primary.direct.is_even(cell, most);
        is_even.then_some(even)
    }

    /// Direct, indirect and caustic irradiance on a diffuse surface, as far as it is known.
    fn diffuse(
        &self,
        (pixel, site, albedo): (Pixel, SurfacePoint, Rgb),
        cell: &[usize; 4],
        place: [f32; 2],
        rest: &mut Rest,
    ) -> [Rgb; 3] {
        let Coarse { view, primary, finished, .. } = self.coarse;
        let sites = view.sites.values();
        let is_shown = |i: usize| sites[i].as_ref().is_some_and(|s| same_surface(s, &site));
        let Some(corners) = Corners::new(cell, place, is_shown) else {
            rest.alone.push(pixel);
            return [Rgb::BLACK; 3];
        };
        let indirect = corners.blend(|i| primary.indirect.irradiance(i));
        let mut caustic = corners.blend(|i| primary.caustic.irradiance(i));
        // What is too dark to be seen is known well enough.
        let dark = finished.floor / albedo.luminance().max(f32::MIN_POSITIVE);
        let others = dark + (indirect + caustic).luminance();
        let mut lack = |lack: Lack| {
            rest.lights.push((pixel, Lack { radiance: albedo * lack.radiance, ..lack }));
        };
        let direct = primary.direct.between(&corners, others, self.tolerance, &mut lack);
        let span = corners.span(|i| primary.caustic.irradiance(i));
        if span > self.tolerance.edge * (others + direct.luminance()) {
            rest.caustic.push(pixel);
            caustic = Rgb::BLACK;
        }
        [direct, indirect, caustic]
    }

    /// Whether the corners of a cell show the same by mirrors and glass.
    fn chains_agree(&self, cell: &[usize; 4]) -> bool {
        let [first, others @ ..] = cell;
        let tolerance = self.tolerance.error;
        let agrees = |&other: &usize| {
            self.specular.agree(self.by_pixel, &self.emitters, tolerance, *first, other)
        };
        others.iter().all(agrees)
    }

    /// What a surface that begins chains shows, if these `agree` around; if not, what of it comes by branches that carry little,
    /// where the surface is seen around, too.
    fn specular(
        &self,
        surface: &Surface,
        cell: &[usize; 4],
        place: [f32; 2],
        agree: bool,
    ) -> Result<Rgb, Option<Rgb>> {
        let site = site_of(surface);
        let is_shown = |i: usize| {
            let other = self.coarse.frame.surface(i);
            // Glossy ends are followed from every subpixel.
            !self.by_pixel.has_glossy(i)
                && other.is_some_and(|other| {
                    other.material == surface.material && same_surface(&site_of(&other), &site)
                })
        };
        let Some(corners) = Corners::new(cell, place, is_shown) else { return Err(None) };
        let radiance = corners.blend(|i| self.specular.radiance(i));
        let span = corners.span(|i| self.specular.radiance(i));
        let limit = self.tolerance.edge * (self.coarse.finished.floor + radiance.luminance());
        match agree && corners.is_whole && span <= limit {
            true => Ok(radiance),
            false => Err(Some(corners.blend(|i| self.by_pixel.faint(i)))),
        }
    }
}
