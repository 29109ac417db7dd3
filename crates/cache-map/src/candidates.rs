//! The search region: computed pixels around a pixel.

use std::ops::Range;

use base::{Component, Pixel, Rgb, Window};

use crate::map::{CacheMap, Origin, SurfacePoint};

/// The side of a tile, in pixels. Traced pixels are candidates in their tile only.
pub const TILE: u32 = 64;

/// The pixels of one tile, in the order of rows.
#[derive(Clone, Debug)]
pub(crate) struct Tile {
    pub(crate) x: Range<u32>,
    pub(crate) y: Range<u32>,
}

impl Tile {
    /// The tiles of a picture that lie in a window, whose borders are theirs, counted from the corner of `frame`.
    pub(crate) fn all(frame: Window, window: Window) -> Vec<Self> {
        let spans = |start: u32, end: u32, corner: u32| {
            (start / TILE..end.div_ceil(TILE))
                .map(move |i| i * TILE - corner..((i + 1) * TILE).min(end) - corner)
        };
        let [x, end_x, y, end_y] = window.bounds();
        let Pixel { x: corner_x, y: corner_y } = frame.corner;
        spans(y, end_y, corner_y)
            .flat_map(|y| spans(x, end_x, corner_x).map(move |x| Self { x, y: y.clone() }))
            .collect()
    }

    pub(crate) fn pixels(&self) -> impl Iterator<Item = Pixel> + use<'_> {
        self.y.clone().flat_map(|y| self.x.clone().map(move |x| Pixel { x, y }))
    }

    pub(crate) fn contains(&self, p: Pixel) -> bool {
        self.x.contains(&p.x) && self.y.contains(&p.y)
    }

    /// The place of a pixel among those of the tile.
    pub(crate) fn index(&self, p: Pixel) -> usize {
        ((p.y - self.y.start) * (self.x.end - self.x.start) + (p.x - self.x.start)) as usize
    }

    pub(crate) fn n_pixels(&self) -> usize {
        self.x.len() * self.y.len()
    }
}

impl CacheMap {
    /// Calls `each` for the candidates in the square of side `2 reach + 1` around `at`, in the order of rows, until it
    /// answers false.
    ///
    /// Candidates are samples, borrowed samples, and the pixels for which `traced` is true.
    #[inline]
    pub(crate) fn for_candidates(
        &self,
        component: Component,
        at: Pixel,
        reach: u32,
        traced: impl Fn(Pixel) -> bool,
        mut each: impl FnMut(&SurfacePoint, Rgb) -> bool,
    ) {
        let size = self.size();
        let origins = self.origins(component).values();
        let columns = at.x.saturating_sub(reach)..(at.x + reach + 1).min(size.width);
        for y in at.y.saturating_sub(reach)..(at.y + reach + 1).min(size.height) {
            for x in columns.clone() {
                let pixel = Pixel { x, y };
                let i = size.index(pixel);
                let is_candidate = match origins[i] {
                    Origin::Sampled => true,
                    // A tile that is being planned knows what it is about to trace before the map does.
                    _ => traced(pixel),
                };
                if is_candidate
                    && let Some(surface) = &self.surfaces().values()[i]
                    && !each(surface, self.values(component).values()[i])
                {
                    return;
                }
                if let Some(&index @ 1..) = self.borrowed_at.get(i) {
                    let (_, surface, values) = &self.borrowed[index as usize - 1];
                    if !each(surface, values[component]) {
                        return;
                    }
                }
            }
        }
    }
}
