//! Pixels from coarse to fine.
//!
//! Every pixel has a step `h`, the lowest bit set in `x | y`: it is predicted from pixels `h` and `3 h` away, on two
//! lines through it, all of which are coarser than itself. If both coordinates have that bit the lines are the
//! diagonals (a *center*), otherwise they are the row and the column (a *midpoint*). This is the quincunx order: for each
//! step from large to small, first all centers, then all midpoints, and a pixel needs nothing of its own rank.

use std::ops::Range;

use base::{Grid, ImageSize, Pixel};
use glam::Vec3A;
use rayon::prelude::*;

use crate::SurfacePoint;

/// Neighbours may lie this sine out of the plane of a surface (about 6 degrees), seen from either side.
const MAX_SINE_HEIGHT: f32 = 0.1;
/// Neighbours' normals may differ by this cosine (about 18 degrees).
const MIN_COS_NORMALS: f32 = 0.95;

/// Where a line of neighbours is in a mask: the near pair, then the far pair.
pub(crate) const NEAR: u8 = 0b0011;
pub(crate) const FAR_BEFORE: u8 = 0b0100;
pub(crate) const FAR_AFTER: u8 = 0b1000;

/// For each pixel, which of its eight neighbours of coarser rank lie on the same smooth surface.
#[derive(Debug)]
pub struct Lattice {
    size: ImageSize,
    has_site: Vec<bool>,
    masks: Vec<u8>,
    /// For each block, row-major, whether all its pixels of small steps have all neighbours.
    whole: Vec<bool>,
    /// The same: whether no pixel has a site.
    empty: Vec<bool>,
    /// The same: up to which step all pixels so far away, and three times as far, lie in its plane.
    in_plane: Vec<u8>,
}

/// A square of pixels, by its place among such squares.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    pub(crate) x: u32,
    pub(crate) y: u32,
}

impl Block {
    pub(crate) fn corner(self) -> Pixel {
        Pixel { x: self.x * BLOCK, y: self.y * BLOCK }
    }
}

/// Centers come before midpoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rank {
    Center,
    Midpoint,
}

/// The step and rank of a pixel; the corner (0, 0) is coarser than all.
pub(crate) fn rank(x: u32, y: u32) -> (u32, Rank) {
    let h = 1 << (x | y).trailing_zeros().min(30);
    (h, if x & h != 0 && y & h != 0 { Rank::Center } else { Rank::Midpoint })
}

/// The directions of the two lines through a pixel.
pub(crate) fn lines(rank: Rank) -> [(i64, i64); 2] {
    match rank {
        Rank::Center => [(1, 1), (1, -1)],
        Rank::Midpoint => [(1, 0), (0, 1)],
    }
}

impl Lattice {
    /// Compares all pixels with their neighbours. Pixels without a site take no part.
    pub fn new(sites: &Grid<Option<SurfacePoint>>, coarsest: u32) -> Self {
        let size = sites.size();
        let planes = Planes::new(sites);
        let has_site: Vec<bool> = sites.values().iter().map(Option::is_some).collect();
        let mut masks = vec![0; size.n_pixels()];
        let (width, columns) = (size.width as usize, size.width.div_ceil(BLOCK));
        let mut whole = vec![false; (columns * size.height.div_ceil(BLOCK)) as usize];
        let mut empty = vec![true; whole.len()];
        let mut in_plane = vec![0; whole.len()];
        let rows = masks.par_chunks_mut(width * BLOCK as usize);
        let rows = rows.zip(has_site.par_chunks(width * BLOCK as usize));
        let blocks = (
            whole.par_chunks_mut(columns as usize),
            empty.par_chunks_mut(columns as usize),
            in_plane.par_chunks_mut(columns as usize),
        );
        rows.zip(blocks).enumerate().for_each(|(by, ((masks, has_site), of_blocks))| {
            let (whole, empty, reach) = of_blocks;
            for (((bx, whole), empty), reach) in (0..columns).zip(whole).zip(empty).zip(reach) {
                let (left, right) = (bx * BLOCK, ((bx + 1) * BLOCK).min(size.width));
                *empty = !has_site
                    .chunks(width)
                    .any(|row| row[left as usize..right as usize].contains(&true));
                if *empty {
                    continue;
                }
                // Pixels up to this step have all their neighbours in the plane of the block.
                let in_plane = planes.reach(bx, by as u32) * BLOCK / 3;
                *reach = in_plane as u8;
                for (dy, masks) in masks.chunks_mut(width).enumerate() {
                    let y = by as u32 * BLOCK + dy as u32;
                    let row = (bx * BLOCK..).zip(masks[(bx * BLOCK) as usize..].iter_mut());
                    for (x, mask) in row.take(BLOCK as usize) {
                        let (h, rank) = rank(x, y);
                        if h < coarsest {
                            *mask =
                                if h <= in_plane { u8::MAX } else { mask_of(sites, x, y, h, rank) };
                        }
                    }
                }
                let row =
                    |y: u32| &masks[(y * size.width + bx * BLOCK) as usize..][..BLOCK as usize];
                let is_filled = |y: u32| {
                    (0..BLOCK).zip(row(y)).all(|(x, &mask)| mask == u8::MAX || rank(x, y).0 > SMALL)
                };
                let is_inside =
                    masks.len() == width * BLOCK as usize && (bx + 1) * BLOCK <= size.width;
                *whole = is_inside && (in_plane >= SMALL || (0..BLOCK).all(is_filled));
            }
        });
        Self { size, has_site, masks, whole, empty, in_plane }
    }

    /// Width and height.
    pub fn size(&self) -> ImageSize {
        self.size
    }

    /// The step of a pixel: how far, in pixels, the coarser ones lie from which it is predicted.
    pub fn step(&self, index: usize) -> u32 {
        let pixel = self.size.pixel(index);
        rank(pixel.x, pixel.y).0
    }

    /// The same, but pixels are looked at one by one only.
    #[cfg(test)]
    pub(crate) fn without_blocks(mut self) -> Self {
        self.whole.fill(false);
        self
    }

    /// Whether a pixel and its eight neighbours show one smooth surface, as far as is known for many pixels at once.
    #[inline]
    pub fn has_no_edge_around(&self, Pixel { x, y }: Pixel) -> bool {
        self.is_whole(Block { x: x / BLOCK, y: y / BLOCK })
    }

    /// For each of the blocks that a row of pixels goes through, whether none of its pixels has a site.
    pub(crate) fn empty_blocks_of_row(&self, y: u32) -> &[bool] {
        &self.empty[self.blocks_of_row(y)]
    }

    pub(crate) fn n_blocks(&self) -> usize {
        self.whole.len()
    }

    /// The block of a number.
    pub(crate) fn block(&self, index: usize) -> Block {
        let columns = self.size.width.div_ceil(BLOCK);
        Block { x: index as u32 % columns, y: index as u32 / columns }
    }

    /// The numbers of the blocks that a row of pixels goes through.
    pub(crate) fn blocks_of_row(&self, y: u32) -> Range<usize> {
        let columns = self.size.width.div_ceil(BLOCK) as usize;
        let first = (y / BLOCK) as usize * columns;
        first..first + columns
    }

    /// Whether all pixels of a block with steps up to [`SMALL`] have all their neighbours.
    pub(crate) fn is_whole(&self, Block { x, y }: Block) -> bool {
        self.whole[(y * self.size.width.div_ceil(BLOCK) + x) as usize]
    }

    /// Up to which step all pixels so far from one in a block, and three times as far, show its plane.
    #[inline]
    pub(crate) fn in_plane(&self, block: usize) -> u32 {
        self.in_plane[block].into()
    }

    pub(crate) fn has_site(&self, index: usize) -> bool {
        self.has_site[index]
    }

    pub(crate) fn mask(&self, index: usize) -> u8 {
        self.masks[index]
    }
}

/// Which neighbours of a pixel lie on its surface.
fn mask_of(sites: &Grid<Option<SurfacePoint>>, x: u32, y: u32, h: u32, rank: Rank) -> u8 {
    let ImageSize { width, height } = sites.size();
    let Some(point) = sites[Pixel { x, y }].as_ref().map(Point::new) else { return 0 };
    let (x, y, h) = (i64::from(x), i64::from(y), i64::from(h));
    let mut mask = 0;
    for (line, (dx, dy)) in lines(rank).into_iter().enumerate() {
        for (bit, steps) in [-h, h, -3 * h, 3 * h].into_iter().enumerate() {
            let (nx, ny) = (x + dx * steps, y + dy * steps);
            if (0..i64::from(width)).contains(&nx)
                && (0..i64::from(height)).contains(&ny)
                && sites.values()[(ny * i64::from(width) + nx) as usize]
                    .as_ref()
                    .is_some_and(|other| point.shares_surface(&Point::new(other)))
            {
                mask |= 1 << (4 * line + bit);
            }
        }
    }
    mask
}

/// The side of the blocks that are asked whether they show one plane.
pub(crate) const BLOCK: u32 = 16;

/// Pixels of larger steps are few.
pub(crate) const SMALL: u32 = 2;

/// Points may lie out of a plane by this part of a block's extent: pixels, which lie farther apart than a hundredth of that,
/// see each other in the plane all the same.
const THICKNESS: f32 = 1e-4;

/// Walls, floors and table tops fill most pictures of rooms. What shows one plane needs no comparison pixel by pixel.
struct Planes {
    columns: u32,
    /// The plane that fills a block, row-major.
    blocks: Vec<Option<Plane>>,
}

#[derive(Clone, Copy)]
struct Plane {
    normal: Vec3A,
    /// From the origin, along the normal.
    distance: f32,
    thickness: f32,
}

impl Planes {
    fn new(sites: &Grid<Option<SurfacePoint>>) -> Self {
        // Those at the right and the bottom may be cut.
        let ImageSize { width, height } = sites.size();
        let (columns, rows) = (width / BLOCK, height / BLOCK);
        let block = |i: u32| plane_of(sites, i % columns * BLOCK, i / columns * BLOCK);
        let blocks = (0..columns * rows).into_par_iter().with_min_len(64).map(block).collect();
        Self { columns, blocks }
    }

    /// How many blocks around a block lie in its plane, each way; at most 2, which is as far as pixels look.
    fn reach(&self, x: u32, y: u32) -> u32 {
        let at = |x: i64, y: i64| -> Option<Plane> {
            let is_inside = (0..i64::from(self.columns)).contains(&x) && y >= 0;
            let i = is_inside.then_some(y * i64::from(self.columns) + x)?;
            *self.blocks.get(i as usize)?
        };
        let (x, y) = (i64::from(x), i64::from(y));
        let Some(plane) = at(x, y) else { return 0 };
        let is_same = |other: Plane| {
            other.normal == plane.normal
                && (other.distance - plane.distance).abs() <= plane.thickness
        };
        let is_filled = |reach: i64| {
            (-reach..=reach)
                .all(|dy| (-reach..=reach).all(|dx| at(x + dx, y + dy).is_some_and(is_same)))
        };
        (1..=2).take_while(|&reach| is_filled(reach)).last().unwrap_or(0) as u32
    }
}

/// The plane in which all points of a block lie.
fn plane_of(sites: &Grid<Option<SurfacePoint>>, left: u32, top: u32) -> Option<Plane> {
    let at = |x, y| sites[Pixel { x: left + x, y: top + y }].as_ref().map(Point::new);
    let (first, last) = (at(0, 0)?, at(BLOCK - 1, BLOCK - 1)?);
    let normal = first.normal;
    let distance = normal.dot(first.position);
    let thickness = THICKNESS * first.position.distance(last.position);
    for y in 0..BLOCK {
        for x in 0..BLOCK {
            let point = at(x, y)?;
            if point.normal != normal || (normal.dot(point.position) - distance).abs() > thickness {
                return None;
            }
        }
    }
    Some(Plane { normal, distance, thickness })
}

/// Whether two points lie on the same smooth surface, so that irradiance varies smoothly between them.
#[inline]
pub fn same_surface(a: &SurfacePoint, b: &SurfacePoint) -> bool {
    Point::new(a).shares_surface(&Point::new(b))
}

/// A site, ready for comparisons.
#[derive(Clone, Copy)]
struct Point {
    position: Vec3A,
    normal: Vec3A,
}

impl Point {
    #[inline]
    fn new(site: &SurfacePoint) -> Self {
        Self { position: site.position.into(), normal: site.normal.into() }
    }

    #[inline]
    fn shares_surface(&self, other: &Self) -> bool {
        let between = other.position - self.position;
        let limit2 = between.length_squared() * (MAX_SINE_HEIGHT * MAX_SINE_HEIGHT);
        let (from_self, from_other) = (self.normal.dot(between), other.normal.dot(between));
        // Without branches, which would be guessed wrong at every edge.
        (self.normal.dot(other.normal) > MIN_COS_NORMALS)
            & (from_self * from_self <= limit2)
            & (from_other * from_other <= limit2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A floor to the horizon, a slanted box on it, a step parallel to it, and a curved surface.
    fn sites(size: ImageSize) -> Grid<Option<SurfacePoint>> {
        let site = |z: f32, normal: Vec3, p: Pixel| {
            let position = Vec3::new(p.x as f32, p.y as f32, 0.0) * 0.01 + Vec3::Z * z;
            Some(SurfacePoint { position, normal })
        };
        Grid::from_fn(size, |p| match (p.x, p.y) {
            (_, 0..8) => None,
            (60..90, 70..120) => site(0.5, Vec3::Z, p),
            (100..170, 20..60) => site(0.006 * p.x as f32, Vec3::new(-0.6, 0.0, 0.8), p),
            (_, 150..) => site(0.0, Vec3::new(0.002 * p.x as f32, 0.0, 1.0).normalize(), p),
            _ => site(0.0, Vec3::Z, p),
        })
    }

    #[test]
    fn planes_change_nothing() {
        for (width, height) in [(203, 181), (256, 192), (40, 300), (15, 15)] {
            let sites = sites(ImageSize { width, height });
            for coarsest in [8, 16] {
                let lattice = Lattice::new(&sites, coarsest);
                for (i, &mask) in lattice.masks.iter().enumerate() {
                    let Pixel { x, y } = lattice.size.pixel(i);
                    let (h, rank) = rank(x, y);
                    let expected = if h < coarsest { mask_of(&sites, x, y, h, rank) } else { 0 };
                    assert_eq!(mask, expected, "{x}, {y} of {width}x{height}");
                }
            }
        }
        let planes = Planes::new(&sites(ImageSize { width: 256, height: 192 }));
        assert_eq!([11, 12, 13].map(|x| planes.reach(x, 3)), [0, 1, 2]);
    }
}
