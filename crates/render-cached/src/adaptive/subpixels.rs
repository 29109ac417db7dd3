//! Subpixels, or pixels, between those that the cache works on.
//!
//! Of the subpixels of a pixel the cache works on one, the first, and of a large picture on every other pixel, both ways: these form
//! a picture of their own, in which components are computed, refined, verified and measured. Eye rays are traced for all, so
//! silhouettes, materials and textures are exact; the light at the others is that of the four around them. Where those differ too
//! much, in the borders of sharp shadows and of what mirrors and glass show, or show other surfaces, it is computed. So the cost of
//! light hardly grows with their number.

use std::ops::Range;

use base::{
    Component, Components, Grid, ImageSize, Interrupted, Pixel, Rgb, Watch, math::FRAC_1_PI,
};
use cache_map::{Reason, SurfacePoint, Tolerance, Value, same_surface};
use geometry::Surface;
use glam::Vec3A;
use rayon::prelude::*;
use scene::{Camera, Light};
use shade::Path;

use super::cells::{Cells, Corners, bilinear};
use super::direct::Lack;
use super::glossy::Glossy;
use super::leaves::{ByPixel, Chain, Finished, Leaves, begins_sharply, site_of};
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

/// A picture of so many pixels is large.
const LARGE: usize = 1 << 20;

/// Tolerances of chains are so much wider: most of what lies around is told, and one of four exact. Whether paths of whole pixels agree
/// isn't among them: there errors are seen one by one.
const WIDER: f32 = 3.0;

/// A subpixel whose chains were followed may be so much brighter than those beside it before theirs are, too.
const BRIGHTER: f32 = 0.5;

/// Points of a light that single rays go to are stratified over squares of so many subpixels.
const BLOCK: u32 = 4;

/// All subpixels.
pub(super) struct Fine {
    pub(super) values: Components<Grid<Rgb>>,
    pub(super) reasons: Components<Vec<Reason>>,
    pub(super) levels: Components<Vec<u8>>,
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
    chains: Vec<Chain>,
    /// Of their paths, what comes by some.
    known: Vec<(Path, Rgb)>,
}

impl Rest {
    fn append(mut self, mut later: Self) -> Self {
        self.alone.append(&mut later.alone);
        self.lights.append(&mut later.lights);
        self.caustic.append(&mut later.caustic);
        let n = self.known.len();
        let moved = |Range { start, end }: Range<usize>| start + n..end + n;
        self.chains.extend(
            later.chains.into_iter().map(|chain| Chain { known: moved(chain.known), ..chain }),
        );
        self.known.append(&mut later.known);
        self
    }
}

/// How far apart the subpixels are, each way, that the cache works on: one of each pixel, or every other pixel of a large
/// picture, or all. There must be enough of them, and what lies beside each other in the picture must lie so in the scene, which a
/// lens doesn't grant.
pub(crate) fn step(args: &Args, n_subpixels: usize, camera: &Camera) -> u32 {
    let step = match args.supersample {
        1 if n_subpixels >= LARGE => 2,
        n => n,
    };
    let are_enough = n_subpixels / (step * step) as usize >= FEWEST_PIXELS;
    if are_enough && camera.is_pinhole() { step } else { 1 }
}

/// The subpixels that the cache is to work on, if these aren't all.
pub(super) fn coarse<'a>(args: &Args, frame: &Frame<'a>) -> Option<Frame<'a>> {
    let step = step(args, frame.size().n_pixels(), &frame.shader().scene.camera);
    (step > 1).then(|| frame.thinned(step))
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
    let cells = Cells::new(frame, coarse.frame);
    let by_pixel = specular.by_pixel(view.size().n_pixels());
    // Fresh memory is black: the sweep is the first to touch it.
    let mut values = Components::from_fn(|_| bytemuck::zeroed_vec(size.n_pixels()));
    let tolerance = strictness.tolerance(Component::Direct);
    let of_paths = if view.apart() > 1 { tolerance.error } else { WIDER * tolerance.error };
    let emitters = shader.scene.lights.iter().filter_map(Light::enclosing_sphere).collect();
    let by_pixel = &by_pixel;
    let places = (0..cells.n).flat_map(|y| (0..cells.n).map(move |x| Pixel { x, y }));
    let weights = places.map(|pixel| bilinear(cells.place(pixel))).collect();
    let sweep =
        Sweep { frame, coarse, cells, weights, specular, by_pixel, emitters, tolerance, of_paths };
    let n_rows = view.size().height as usize;
    let rest = account.watched(n_rows, |watch| sweep.all(&mut values, watch))?;
    let Rest { alone, lights, caustic, chains, known } = rest;
    let (reasons, levels) = history;
    let mut reasons = Components::from_fn(|component| spread(&reasons[component], cells, size));
    let mut levels = Components::from_fn(|component| spread(&levels[component], cells, size));

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

    let Tolerance { error, edge } = strictness.tolerance(Component::Specular);
    let tolerance = Tolerance { error: WIDER * error, edge: WIDER * edge };
    let first = |&Pixel { x, y }: &Pixel| Pixel { x: x * cells.n, y: y * cells.n };
    let mut glossy: Vec<Pixel> = specular.glossy_pixels().iter().map(first).collect();
    let (mut chains, mut is_followed) = (chains, vec![false; size.n_pixels()]);
    // What is narrower than the pixels are apart may be seen by none of four, and by others beside them.
    while !chains.is_empty() {
        let followed = specular
            .between(by_pixel, &chains, &known, cells, view, finished, tolerance, account)?;
        for (chain, followed) in chains.iter().zip(followed) {
            let i = size.index(chain.pixel);
            (values.specular[i], reasons.specular[i]) = (followed.radiance, followed.reason);
            is_followed[i] = true;
            glossy.extend(followed.is_glossy.then_some(chain.pixel));
        }
        let mut next = Vec::new();
        for &Chain { pixel, .. } in &chains {
            let brightest = BRIGHTER * values.specular[size.index(pixel)].luminance();
            for beside in cells.beside(pixel, size) {
                let i = size.index(beside);
                let shown = finished.floor + values.specular[i].luminance();
                let is_between = !cells.is_first(beside) && !is_followed[i];
                if is_between && shown < brightest && frame.material(i).is_some_and(begins_sharply)
                {
                    is_followed[i] = true;
                    next.push(Chain { pixel: beside, faint: None, known: 0..0 });
                }
            }
        }
        next.sort_unstable_by_key(|chain| size.index(chain.pixel));
        chains = next;
    }
    let mut glossy = Glossy::start(frame, &glossy);
    let sharp = |i: usize| values.specular[i];
    glossy.resolve(view, finished, sharp, strictness.tolerance_of_glossy(), account)?;
    glossy.tell(&mut reasons.specular, &mut levels.specular);
    glossy.add_to(&mut values.specular);
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
fn spread<T: Copy + Default + Send + Sync>(of: &[T], cells: Cells, size: ImageSize) -> Vec<T> {
    let n = cells.n as usize;
    let mut all = vec![T::default(); size.n_pixels()];
    let rows =
        all.par_chunks_mut(size.width as usize * n).zip(of.par_chunks(cells.size.width as usize));
    rows.for_each(|(all, of)| all.iter_mut().step_by(n).zip(of).for_each(|(to, &from)| *to = from));
    all
}

/// What the corners of a cell show that lies on one surface.
struct Even {
    site: SurfacePoint,
    /// Direct, indirect and caustic irradiance.
    irradiance: [[Vec3A; 4]; 3],
}

impl Even {
    /// The light in between; what of it is seen by so much albedo.
    #[inline]
    fn radiance(&self, albedo: Rgb, weights: [f32; 4]) -> [Rgb; 3] {
        let albedo = Vec3A::from(albedo.to_array());
        self.irradiance.map(|[a, b, c, d]| {
            let [wa, wb, wc, wd] = weights;
            Rgb::from((albedo * (a * wa + b * wb + c * wc + d * wd)).to_array())
        })
    }
}

/// All that is known of the coarse picture, and the subpixels between.
struct Sweep<'x, 'a> {
    frame: &'x Frame<'a>,
    coarse: &'x Coarse<'x, 'a>,
    cells: Cells,
    /// Of the corners of a cell, for each of the subpixels in it.
    weights: Vec<[f32; 4]>,
    specular: &'x Leaves,
    by_pixel: &'x ByPixel,
    /// Spheres around them.
    emitters: Vec<(Vec3A, f32)>,
    tolerance: Tolerance,
    /// What paths that agree may bring differently, of all that is shown.
    of_paths: f32,
}

/// Radiance of the subpixels of some rows.
type Rows<'x> = Components<&'x mut [Rgb]>;

impl Sweep<'_, '_> {
    /// Finds what can be found without computing anything, and says what is left. Nothing if somebody has asked for a stop.
    fn all(&self, values: &mut Components<Vec<Rgb>>, watch: Watch<'_>) -> Option<Rest> {
        let stride = (self.frame.size().width * self.cells.n) as usize;
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
        let n = self.cells.n;
        let frame = self.frame;
        let ImageSize { width, height } = frame.size();
        let scene = frame.shader().scene;
        let mut rest = Rest::default();
        let mut looks = frame.looks();
        for x in 0..self.cells.size.width {
            let cell = self.cells.corners(Pixel { x, y });
            let has_edge = !self.coarse.view.lattice.has_no_edge_around(Pixel { x, y });
            // Most are so: the same triangle, of one color, everywhere.
            let plain = if has_edge { None } else { self.plain(cell[0]) };
            let even = if has_edge { None } else { self.even(Pixel { x, y }, &cell) };
            let mut agreeing = None;
            // At the border of the picture a cell may have fewer.
            let (n_right, n_down) = (n.min(width - x * n), n.min(height - y * n));
            for (dy, dx) in (0..n_down).flat_map(|dy| (0..n_right).map(move |dx| (dy, dx))) {
                let pixel = Pixel { x: x * n + dx, y: y * n + dy };
                let (index, at) = (frame.size().index(pixel), (dy * width + x * n + dx) as usize);
                let weights = self.weights[(dy * n + dx) as usize];
                if let Some((primitive, albedo)) = plain
                    && frame.primitive(index) == primitive
                {
                    [values.direct[at], values.indirect[at], values.caustic[at]] = match &even {
                        Some(even) => even.radiance(albedo, weights),
                        None => {
                            let (seen, rest) = ((pixel, None, albedo), &mut rest);
                            self.diffuse(seen, &cell, weights, rest).map(|found| albedo * found)
                        }
                    };
                    continue;
                }
                let Some(material) = frame.material(index) else { continue };
                if material.is_diffuse()
                    && let Some(surface) = looks.surface(pixel)
                {
                    let (site, albedo) = as_seen(&surface, frame.eye(pixel), scene);
                    let albedo = albedo * FRAC_1_PI;
                    [values.direct[at], values.indirect[at], values.caustic[at]] = match &even {
                        Some(even) if same_surface(&even.site, &site) => {
                            even.radiance(albedo, weights)
                        }
                        _ => {
                            let (seen, rest) = ((pixel, Some(site), albedo), &mut rest);
                            self.diffuse(seen, &cell, weights, rest).map(|found| albedo * found)
                        }
                    }
                }
                if begins_sharply(material) {
                    let first = rest.known.len();
                    let radiance = match (dx, dy) {
                        (0, 0) => Ok(self.specular.radiance(cell[0])),
                        _ => looks.surface(pixel).map_or(Err(None), |surface| {
                            let (agreeing, known) = (&mut agreeing, &mut rest.known);
                            self.specular(&surface, &cell, weights, agreeing, known)
                        }),
                    };
                    match radiance {
                        Ok(radiance) => values.specular[at] = radiance,
                        Err(faint) => {
                            let known = first..rest.known.len();
                            rest.chains.push(Chain { pixel, faint, known });
                        }
                    }
                }
            }
        }
        rest
    }

    /// Irradiance at the corners of a cell, which show one surface far from its edges, if it is so alike that it holds
    /// everywhere between.
    fn even(&self, first: Pixel, cell: &[usize; 4]) -> Option<Even> {
        let Coarse { view, primary, finished, .. } = self.coarse;
        let site = view.sites.values()[cell[0]]?;
        let Primary { direct, indirect, caustic } = primary;
        let of_caustic = cell.map(|i| caustic.irradiance(i));
        let dark = finished.floor / view.gain(cell[0]).max(f32::MIN_POSITIVE);
        let others = indirect.irradiance(cell[0]) + of_caustic[0];
        let all = dark + others.luminance() + direct.luminance(cell[0]);
        let most = self.tolerance.edge * all;
        if of_caustic.iter().any(|&v| (v - of_caustic[0]).size() > most)
            || !direct.is_even(cell, first, most)
        {
            return None;
        }
        let vector = |irradiance: Rgb| Vec3A::from(irradiance.to_array());
        let irradiance = [
            cell.map(|i| vector(direct.irradiance(i))),
            cell.map(|i| vector(indirect.irradiance(i))),
            of_caustic.map(vector),
        ];
        Some(Even { site, irradiance })
    }

    /// The triangle or sphere that a coarse pixel shows, and its albedo over pi, if that is the same everywhere on it and
    /// nothing is seen in it.
    fn plain(&self, index: usize) -> Option<(u32, Rgb)> {
        let Coarse { frame, view, .. } = self.coarse;
        let material = frame.material(index)?;
        let is_plain =
            material.is_diffuse() && !material.is_specular() && material.albedo_texture.is_none();
        is_plain.then(|| (frame.primitive(index), view.albedo(index) * FRAC_1_PI))
    }

    /// Direct, indirect and caustic irradiance on a diffuse surface, as far as it is known. It needs no site where it surely is
    /// that of the first corner, far from edges.
    fn diffuse(
        &self,
        (pixel, site, albedo): (Pixel, Option<SurfacePoint>, Rgb),
        cell: &[usize; 4],
        weights: [f32; 4],
        rest: &mut Rest,
    ) -> [Rgb; 3] {
        let Coarse { view, primary, finished, .. } = self.coarse;
        let sites = view.sites.values();
        let is_shown = |i: usize| match &site {
            Some(site) => sites[i].as_ref().is_some_and(|s| same_surface(s, site)),
            None => true,
        };
        // Far from edges, the first stands for the others.
        let are_shown =
            view.lattice.has_no_edge_around(view.size().pixel(cell[0])).then(|| is_shown(cell[0]));
        let is_shown = |i: usize| are_shown.unwrap_or_else(|| is_shown(i));
        let Some(corners) = Corners::new(cell, weights, is_shown) else {
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
        let first = view.size().pixel(cell[0]);
        let direct = primary.direct.between(&corners, first, others, self.tolerance, &mut lack);
        let span = corners.span(|i| primary.caustic.irradiance(i));
        if span > self.tolerance.edge * (others + direct.luminance()) {
            rest.caustic.push(pixel);
            caustic = Rgb::BLACK;
        }
        [direct, indirect, caustic]
    }

    /// The corners of a cell that show the same as the first by mirrors and glass.
    fn agreeing(&self, cell: &[usize; 4]) -> [bool; 4] {
        cell.map(|corner| {
            self.specular.agree(self.by_pixel, &self.emitters, self.of_paths, cell[0], corner)
        })
    }

    /// What a surface that begins chains shows, if all corners that count are `agreeing`; if not, what of it comes by branches
    /// that carry little, where the surface is seen around, too, and adds what comes by paths on which the corners agree. Whether
    /// all of them do is asked once for a cell.
    fn specular(
        &self,
        surface: &Surface,
        cell: &[usize; 4],
        weights: [f32; 4],
        agreeing: &mut Option<[bool; 4]>,
        known: &mut Vec<(Path, Rgb)>,
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
        let Some(corners) = Corners::new(cell, weights, is_shown) else { return Err(None) };
        let radiance = corners.blend(|i| self.specular.radiance(i));
        let shown = self.coarse.finished.floor + radiance.luminance();
        if corners.is_whole {
            let limit = self.tolerance.edge * shown;
            let agreeing = agreeing.get_or_insert_with(|| self.agreeing(cell));
            let agree = |(&agrees, weight): (&bool, f32)| agrees || weight == 0.0;
            let are_even = agreeing.iter().zip(weights).all(agree);
            if are_even && corners.span(|i| self.specular.radiance(i)) <= limit {
                return Ok(radiance);
            }
            let (by_pixel, tolerance) = (self.by_pixel, self.of_paths);
            self.specular.tell(by_pixel, &self.emitters, tolerance, &corners, limit, known);
        }
        let has_highlight = corners.iter().any(|(i, _)| self.by_pixel.has_highlight(i, shown));
        Err((!has_highlight).then(|| corners.blend(|i| self.by_pixel.faint(i))))
    }
}
