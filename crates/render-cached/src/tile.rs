//! Parts of pictures: which pixels they show, and which ones have to be computed for that.

use anyhow::bail;
use base::{ImageSize, Pixel, Share, Window};
use cache_map::TILE;
use cli::WrongUsage;

use crate::{Args, Mode, output};

/// The most subpixels of a band: few enough that what is held of them is small, enough that those which filters look at beyond
/// are few beside them.
pub(crate) const BAND: usize = 1 << 21;

/// What is computed to show a part of a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    /// What is shown, in pixels.
    pub(crate) part: Window,
    /// The part and what filters look at around it, in pixels.
    pub(crate) filtered: Window,
    /// What is computed, in subpixels: these at least.
    pub(crate) computed: Window,
    /// What eye rays are traced for, in subpixels: mode paper looks for candidates beyond what it computes.
    pub(crate) frame: Window,
}

impl Extent {
    /// Of the part that the command line asks for, in a picture of this size.
    ///
    /// # Errors
    /// When there is no such part.
    pub(crate) fn new(args: &Args, resolution: ImageSize) -> anyhow::Result<Self> {
        Ok(Self::of(args, part(args, resolution)?))
    }

    fn of(args: &Args, part: Window) -> Self {
        let filtered = part.grown(output::filter(args).margin());
        let shown = filtered.subdivided(args.supersample);
        let (computed, frame) = match args.mode {
            Mode::Original | Mode::Adaptive => (shown, shown),
            Mode::Paper => {
                let computed = shown.aligned(TILE);
                (computed, computed.grown(args.paper.region / 2))
            }
        };
        Self { part, filtered, computed, frame }
    }

    /// The part in bands of whole blocks of rows, from top to bottom, each of [`BAND`] subpixels at most, or one block. What
    /// filters look at beyond a band is in it, too: each can be rendered alone. Where layers are there already, each thread looks
    /// up one block at a time, in the memory of the one before.
    pub(crate) fn bands(&self, args: &Args) -> impl ExactSizeIterator<Item = Self> + use<> {
        let row = self.part.size.width as usize * (args.supersample * args.supersample) as usize;
        let n_blocks = match args.paper.from_layers {
            Some(_) => rayon::current_num_threads(),
            None => (BAND / (row * film::BLOCK_ROWS)).max(1),
        };
        self.split(args, n_blocks)
    }

    /// The part in blocks, as its file has them.
    pub(crate) fn blocks(&self, args: &Args) -> impl ExactSizeIterator<Item = Self> + use<> {
        self.split(args, 1)
    }

    /// Bands of so many blocks of rows.
    fn split(&self, args: &Args, n_blocks: usize) -> impl ExactSizeIterator<Item = Self> + use<> {
        let args = args.clone();
        let Window { corner, size, whole } = self.part;
        let n_rows = (n_blocks * film::BLOCK_ROWS).min(size.height as usize);
        (0..size.height).step_by(n_rows).map(move |y| {
            let corner = Pixel { y: corner.y + y, ..corner };
            let size = ImageSize { height: (size.height - y).min(n_rows as u32), ..size };
            Self::of(&args, Window { corner, size, whole })
        })
    }

    /// The same part in another frame, which holds it.
    pub(crate) fn in_frame_of(self, other: &Self) -> Self {
        Self { frame: other.frame, ..self }
    }

    /// The pixel of the frame that is this subpixel of the whole picture.
    pub(crate) fn in_frame(&self, subpixel: Pixel) -> Pixel {
        let Pixel { x, y } = self.frame.corner;
        Pixel { x: subpixel.x - x, y: subpixel.y - y }
    }

    /// The subpixels of a pixel of the part, `n` x `n`, in the frame.
    pub(crate) fn subpixels(&self, pixel: Pixel, n: u32) -> impl Iterator<Item = Pixel> + use<> {
        let Pixel { x, y } = self.part.in_whole(pixel);
        let first = self.in_frame(Pixel { x: x * n, y: y * n });
        (0..n * n).map(move |i| Pixel { x: first.x + i % n, y: first.y + i / n })
    }
}

fn part(args: &Args, resolution: ImageSize) -> anyhow::Result<Window> {
    let ImageSize { width, height } = resolution;
    match (args.crop, args.tile) {
        (Some(bounds), _) => Window::new(bounds, resolution).ok_or_else(|| {
            let crop = bounds.map(|x| x.to_string()).join(",");
            WrongUsage(format!(
                "--crop {crop} isn't a part of a picture of {width}x{height} pixels; \
                 give x0,x1,y0,y1 with x0 < x1 <= {width} and y0 < y1 <= {height}"
            ))
            .into()
        }),
        (None, Some(share)) => match tile(resolution, share) {
            Some(window) => Ok(window),
            None => bail!(WrongUsage(format!(
                "a picture of {width}x{height} pixels has {} blocks of {TILE}x{TILE} pixels; ask for as many tiles at most",
                u64::from(width.div_ceil(TILE)) * u64::from(height.div_ceil(TILE))
            ))),
        },
        (None, None) => Ok(Window::whole(resolution)),
    }
}

/// Tile `number` of `of`: a band of whole rows, whose blocks an assembled picture can take over as they are. Only if there
/// are more tiles than rows of blocks, bands of one row are cut into columns. Borders lie at multiples of 64 pixels, where
/// mode paper has borders of its own. Nothing if there are more tiles than blocks of that size.
pub(crate) fn tile(whole: ImageSize, share: Share) -> Option<Window> {
    let blocks = |extent: u32| u64::from(extent.div_ceil(TILE));
    let (columns, rows) = (blocks(whole.width), blocks(whole.height));
    let (number, of) = (u64::from(share.number() - 1), u64::from(share.of()));
    if of > columns * rows {
        return None;
    }
    // Where part `i` of `n` begins, if `extent` is shared out.
    let start = |extent: u64, i: u64, n: u64| extent * i / n;
    let (x, y) = if of <= rows {
        (0..columns, start(rows, number, of)..start(rows, number + 1, of))
    } else {
        // Tiles are shared out to rows, and columns to the tiles of a row. `row` is the last that begins with this tile
        // or before.
        let row = ((number + 1) * rows - 1) / of;
        let (first, end) = (start(of, row, rows), start(of, row + 1, rows));
        let (i, n) = (number - first, end - first);
        (start(columns, i, n)..start(columns, i + 1, n), row..row + 1)
    };
    let pixel = |block: u64, extent: u32| ((block * u64::from(TILE)) as u32).min(extent);
    let [x, end_x] = [x.start, x.end].map(|block| pixel(block, whole.width));
    let [y, end_y] = [y.start, y.end].map(|block| pixel(block, whole.height));
    Window::new([x, end_x, y, end_y], whole)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[test]
    fn tiles_are_the_picture_once() {
        for (width, height) in [(1024, 1024), (640, 65), (64, 64), (63, 1000), (3000, 1)] {
            let whole = ImageSize { width, height };
            let most = width.div_ceil(TILE) * height.div_ceil(TILE);
            for of in (1..=most).take(40).chain([most]) {
                let mut seen = vec![0_u8; (width.div_ceil(TILE) * height.div_ceil(TILE)) as usize];
                let mut n_pixels = 0;
                for number in 1..=of {
                    let window = tile(whole, Share::new(number, of).unwrap()).unwrap();
                    assert_eq!(window.aligned(TILE), window);
                    n_pixels += window.size.n_pixels();
                    let [x, end_x, y, end_y] = window.bounds();
                    for row in (y..end_y).step_by(TILE as usize) {
                        for column in (x..end_x).step_by(TILE as usize) {
                            seen[(row / TILE * width.div_ceil(TILE) + column / TILE) as usize] += 1;
                        }
                    }
                }
                assert!(seen.iter().all(|&n| n == 1), "{width}x{height} in {of}");
                assert_eq!(n_pixels, whole.n_pixels());
            }
            assert_eq!(tile(whole, Share::new(1, most + 1).unwrap()), None);
        }
    }

    #[test]
    fn tiles_are_alike() {
        let whole = ImageSize { width: 1024, height: 1024 };
        let sizes =
            |of| (1..=of).map(move |i| tile(whole, Share::new(i, of).unwrap()).unwrap().size);
        assert!(sizes(16).all(|size| size == ImageSize { width: 1024, height: 64 }));
        assert!(sizes(64).all(|size| size == ImageSize { width: 256, height: 64 }));
        let of_7: Vec<_> = sizes(7).map(ImageSize::n_pixels).collect();
        assert!(of_7.iter().all(|&n| (100_000..200_000).contains(&n)), "{of_7:?}");
        let of_20: Vec<_> = sizes(20).map(ImageSize::n_pixels).collect();
        assert!(of_20.iter().all(|&n| (32_768..=65_536).contains(&n)), "{of_20:?}");
    }

    #[test]
    fn bands_fill_the_part_in_whole_blocks() {
        for (size, supersample, n_bands) in [
            ("1024x1024", "1", 1),
            ("8192x8192", "1", 32),
            ("100x90", "16", 2),
            ("1000000x40", "1", 3),
            ("1x1", "1", 1),
        ] {
            let words =
                ["render-cached", "s", "--photons", "p", "-o", "o.exr", "--mode", "original"];
            let options = ["--supersample", supersample, "--resolution", size];
            let args = Args::parse_from(words.into_iter().chain(options));
            let whole = Extent::new(&args, args.resolution.unwrap()).unwrap();
            let (mut y, mut n) = (0, 0);
            for band in whole.bands(&args) {
                assert_eq!(band.part.corner, Pixel { x: 0, y });
                assert!((y as usize).is_multiple_of(film::BLOCK_ROWS));
                let is_small = band.frame.size.n_pixels() <= BAND;
                assert!(is_small || band.part.size.height as usize <= film::BLOCK_ROWS, "{size}");
                (y, n) = (y + band.part.size.height, n + 1);
            }
            assert_eq!((y, n), (whole.part.size.height, n_bands), "{size}");
        }
    }
}
