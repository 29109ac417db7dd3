//! Pixels from coarse to fine.
//!
//! Every pixel has a step `h`, the lowest bit set in `x | y`: it is predicted from pixels `h` and `3 h` away, on two
//! lines through it, all of which are coarser than itself. If both coordinates have that bit the lines are the
//! diagonals (a *center*), otherwise they are the row and the column (a *midpoint*). This is the quincunx order: for each
//! step from large to small, first all centers, then all midpoints, and a pixel needs nothing of its own rank.

use base::{Grid, ImageSize};
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
        let (width, height) = (i64::from(size.width), i64::from(size.height));
        // What the comparisons read, ready for them.
        let points: Vec<Point> = (sites.values().par_iter())
            .with_min_len(4096)
            .map(|site| site.as_ref().map_or(Point::NONE, Point::new))
            .collect();
        let mut masks = vec![0; points.len()];
        masks.par_chunks_mut(size.width as usize).enumerate().for_each(|(y, masks)| {
            for (x, mask) in masks.iter_mut().enumerate() {
                let i = y as i64 * width + x as i64;
                let point = &points[i as usize];
                let (h, rank) = rank(x as u32, y as u32);
                if h >= coarsest || point.is_none() {
                    continue;
                }
                let (x, y, h) = (x as i64, y as i64, i64::from(h));
                for (line, (dx, dy)) in lines(rank).into_iter().enumerate() {
                    for (bit, steps) in [-h, h, -3 * h, 3 * h].into_iter().enumerate() {
                        let (nx, ny) = (x + dx * steps, y + dy * steps);
                        if (0..width).contains(&nx)
                            && (0..height).contains(&ny)
                            && point.shares_surface(&points[(ny * width + nx) as usize])
                        {
                            *mask |= 1 << (4 * line + bit);
                        }
                    }
                }
            }
        });
        Self { size, has_site: points.iter().map(|p| !p.is_none()).collect(), masks }
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

    pub(crate) fn has_site(&self, index: usize) -> bool {
        self.has_site[index]
    }

    pub(crate) fn mask(&self, index: usize) -> u8 {
        self.masks[index]
    }
}

/// Whether two points lie on the same smooth surface, so that irradiance varies smoothly between them.
#[inline]
pub fn same_surface(a: &SurfacePoint, b: &SurfacePoint) -> bool {
    Point::new(a).shares_surface(&Point::new(b))
}

/// A site, or nothing.
#[derive(Clone, Copy)]
struct Point {
    position: Vec3A,
    /// Zero for nothing, which shares no surface.
    normal: Vec3A,
}

impl Point {
    const NONE: Self = Self { position: Vec3A::ZERO, normal: Vec3A::ZERO };

    #[inline]
    fn new(site: &SurfacePoint) -> Self {
        Self { position: site.position.into(), normal: site.normal.into() }
    }

    #[inline]
    fn is_none(&self) -> bool {
        self.normal == Vec3A::ZERO
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
