//! Where a light is surely seen whole.
//!
//! For squares of pixels that show one flat surface the space between them and the light is searched, larger squares
//! first. Where nothing reaches into it no shadow ray can meet anything: none is needed, be it to find the visibility or to
//! verify it.

use base::{Interrupted, Pixel};
use geometry::{Bounds, Patch, Plane};
use glam::Vec3A;
use rayon::prelude::*;
use scene::Light;

use super::{Account, View};
use crate::frame::Frame;

/// The side of the smallest squares, in pixels.
const SMALLEST: u32 = 8;

/// The smallest squares in a row of the largest.
const ROW: usize = 8;

/// The side of the largest squares.
const LARGEST: u32 = SMALLEST * ROW as u32;

/// The cosine between normals from which on they count as one.
const ALIKE: f32 = 1.0 - 1e-6;

/// From where a light is seen whole.
#[derive(Debug)]
pub(crate) struct Clear {
    columns: u32,
    /// For each of the largest squares a bit for each of the smallest in it.
    squares: Vec<u64>,
}

impl Clear {
    /// Looks at some lights.
    pub(crate) fn find(
        lights: &[usize],
        view: &View,
        account: &mut Account<'_, '_>,
    ) -> Result<Vec<Self>, Interrupted> {
        if lights.is_empty() {
            return Ok(Vec::new());
        }
        let frame = account.frame;
        let size = view.size();
        let columns = size.width.div_ceil(LARGEST);
        let tops: Vec<u32> = (0..size.height).step_by(LARGEST as usize).collect();
        let search = |corner: Pixel| -> Vec<u64> {
            let squares = Squares::new(corner, view, frame);
            let of_light = |&light: &usize| {
                let mut clear = 0;
                squares.search(0, 0, ROW, &mut clear, &|patch| {
                    is_clear(frame, frame.shader().light(light), patch)
                });
                clear
            };
            lights.iter().map(of_light).collect()
        };
        // Rows are too few to share.
        let rows = account.overhead(&tops, |&y, _| -> Vec<_> {
            let corners = (0..columns).into_par_iter().map(|x| Pixel { x: x * LARGEST, y });
            corners.map(search).collect()
        })?;
        let squares = rows.concat();
        let of_light = |n| Self { columns, squares: squares.iter().map(|of| of[n]).collect() };
        Ok((0..lights.len()).map(of_light).collect())
    }

    /// Whether the light is surely seen whole from the surface that a pixel shows.
    #[inline]
    pub(crate) fn holds(&self, Pixel { x, y }: Pixel) -> bool {
        let square = self.squares[(y / LARGEST * self.columns + x / LARGEST) as usize];
        let bit = y % LARGEST / SMALLEST * ROW as u32 + x % LARGEST / SMALLEST;
        square >> bit & 1 != 0
    }
}

/// What the smallest squares in one of the largest show: nothing where it isn't one flat surface.
struct Squares([Option<Patch>; ROW * ROW]);

impl Squares {
    fn new(corner: Pixel, view: &View, frame: &Frame<'_>) -> Self {
        let side = SMALLEST;
        Self(std::array::from_fn(|i| {
            let (row, column) = ((i / ROW) as u32, (i % ROW) as u32);
            patch(Pixel { x: corner.x + column * side, y: corner.y + row * side }, view, frame)
        }))
    }

    /// What a square shows whose side is so many of the smallest.
    fn patch(&self, row: usize, column: usize, side: usize) -> Option<Patch> {
        let mut whole = EMPTY;
        for row in row..row + side {
            for patch in &self.0[row * ROW + column..row * ROW + column + side] {
                join(&mut whole, (*patch)?)?;
            }
        }
        Some(whole)
    }

    fn search(
        &self,
        row: usize,
        column: usize,
        side: usize,
        clear: &mut u64,
        is_clear: &impl Fn(&Patch) -> bool,
    ) {
        let patch = self.patch(row, column, side);
        if patch.is_some_and(|patch| patch.plane.is_none()) {
            return;
        }
        if patch.is_some_and(|patch| is_clear(&patch)) {
            for row in row..row + side {
                *clear |= ((1 << side) - 1) << (row * ROW + column);
            }
        } else if side > 1 {
            let half = side / 2;
            for (down, right) in [(0, 0), (0, half), (half, 0), (half, half)] {
                self.search(row + down, column + right, half, clear, is_clear);
            }
        }
    }
}

/// No surface: anything can join.
const EMPTY: Patch = Patch { bounds: Bounds::EMPTY, plane: None };

/// Adds what lies on the same surface, or on one parallel to it.
fn join(whole: &mut Patch, part: Patch) -> Option<()> {
    let Some(plane) = part.plane else { return Some(()) };
    let first = whole.plane.get_or_insert(plane);
    if first.normal.dot(plane.normal) < ALIKE {
        return None;
    }
    first.offset = first.offset.min(plane.offset);
    whole.bounds.extend(part.bounds.min);
    whole.bounds.extend(part.bounds.max);
    Some(())
}

/// Where shadow rays leave the diffuse surfaces that one of the smallest squares shows, if these are flat; with what lies between
/// its pixels and those of the next ones, where others lie there.
fn patch(corner: Pixel, view: &View, frame: &Frame<'_>) -> Option<Patch> {
    let size = view.size();
    let mut plane: Option<Plane> = None;
    let (mut min, mut max) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    let mut most_moved = 0.0_f32;
    let side = SMALLEST + u32::from(view.apart() > 1);
    for y in corner.y..(corner.y + side).min(size.height) {
        for x in corner.x..(corner.x + side).min(size.width) {
            let i = size.index(Pixel { x, y });
            let (Some(site), Some(surface)) = (&view.sites.values()[i], frame.surface(i)) else {
                continue;
            };
            let (position, normal) = (Vec3A::from(site.position), Vec3A::from(site.normal));
            let cos = surface.geometric_normal.dot(normal);
            let plane = plane.get_or_insert_with(|| Plane {
                normal: surface.geometric_normal * cos.signum(),
                offset: f64::INFINITY,
            });
            if cos.abs() < ALIKE || normal.dot(plane.normal) < ALIKE {
                return None;
            }
            // Rays start so far off the surface, which itself lies below half of that.
            let moved = surface.error;
            let lowest = Plane::height(plane.normal, position) + 0.5 * f64::from(moved);
            plane.offset = plane.offset.min(lowest);
            (min, max) = (min.min(position), max.max(position));
            most_moved = most_moved.max(moved);
        }
    }
    let bounds = Bounds { min: (min - most_moved).into(), max: (max + most_moved).into() };
    Some(if plane.is_some() { Patch { bounds, plane } } else { EMPTY })
}

fn is_clear(frame: &Frame<'_>, light: &Light, from: &Patch) -> bool {
    let scene = frame.shader().scene;
    let Some(to) = light.patch(from, &scene.bounds()) else { return false };
    scene.accel.is_clear(from, &to)
}
