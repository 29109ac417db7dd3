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
        let values = sites.values();
        let width = size.width as usize;
        let masks = (0..values.len())
            .into_par_iter()
            .with_min_len(4096)
            .map(|i| {
                let Some(site) = &values[i] else { return 0 };
                let (x, y) = ((i % width) as u32, (i / width) as u32);
                let (h, rank) = rank(x, y);
                if h >= coarsest {
                    return 0;
                }
                let mut mask = 0;
                for (line, (dx, dy)) in lines(rank).into_iter().enumerate() {
                    for (bit, steps) in [-1_i64, 1, -3, 3].into_iter().enumerate() {
                        let (nx, ny) = (
                            i64::from(x) + dx * steps * i64::from(h),
                            i64::from(y) + dy * steps * i64::from(h),
                        );
                        let inside = (0..i64::from(size.width)).contains(&nx)
                            && (0..i64::from(size.height)).contains(&ny);
                        if inside
                            && let Some(other) = &values[ny as usize * width + nx as usize]
                            && same_surface(site, other)
                        {
                            mask |= 1 << (4 * line + bit);
                        }
                    }
                }
                mask
            })
            .collect();
        Self { size, has_site: values.iter().map(Option::is_some).collect(), masks }
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
    let (na, nb) = (Vec3A::from(a.normal), Vec3A::from(b.normal));
    let between = Vec3A::from(b.position) - Vec3A::from(a.position);
    let limit2 = between.length_squared() * (MAX_SINE_HEIGHT * MAX_SINE_HEIGHT);
    let (from_a, from_b) = (na.dot(between), nb.dot(between));
    na.dot(nb) > MIN_COS_NORMALS && from_a * from_a <= limit2 && from_b * from_b <= limit2
}
