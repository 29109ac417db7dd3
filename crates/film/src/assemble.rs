//! From parts to the picture.

use std::ops::Range;
use std::path::Path;

use atomic_file::Existing;
use base::{Grid, ImageSize, Rgb, Window};
use rayon::prelude::*;

use crate::part::Rows;
use crate::picture::rgb_names;
use crate::write_exr::{blocks_at_once, header, write_blocks};
use crate::{Error, Part, zip};

/// Joins parts to the file that [`write_exr`](crate::write_exr) makes of the whole picture: the same bytes. Returns their
/// number. Some rows are in memory at a time, and one block of each part that they cross. Where a part spans whole rows,
/// from a multiple of 16 on, its blocks are those of the picture: they are copied, and never unpacked.
///
/// # Errors
/// When a part can't be read or is damaged, or when the picture can't be written.
///
/// # Panics
/// When the parts differ in size of the whole, metadata or channels, or don't fill the whole without overlap.
pub fn assemble_exr(path: &Path, existing: Existing, parts: &[Part]) -> Result<u64, Error> {
    let mut bands = Bands::new(parts);
    let first = &parts[0];
    let names = first.names().iter().map(String::as_str);
    let header = header(Window::whole(first.window().whole), first.metadata(), names);
    let width = first.window().whole.width as usize;
    let is_band = |part: &Part| {
        let [x, end_x, y, _] = part.window().bounds().map(|side| side as usize);
        end_x - x == width && y % zip::LINES == 0
    };
    let rows = if parts.iter().all(is_band) {
        // What is only copied uses the memory of what was copied before.
        zip::blocks(first.window().whole.height as usize).map(|rows| vec![rows]).collect()
    } else {
        blocks_at_once(&header)
    };
    let blocks = rows.into_iter().map(|rows| {
        let blocks: Result<Vec<Block>, Error> =
            rows.into_iter().map(|rows| bands.next_block(rows)).collect();
        Ok(blocks?.into_par_iter().map(|block| block.packed(width)).collect())
    });
    write_blocks(path, existing, header, None, blocks)
}

/// The beauty of the picture that the parts make up.
///
/// # Errors
/// When a part can't be read or is damaged, or has no beauty.
///
/// # Panics
/// As [`assemble_exr`].
pub fn assemble_rgb(parts: &[Part]) -> Result<Grid<Rgb>, Error> {
    let first = &parts[0];
    let find = |name: String| {
        let place = first.names().iter().position(|n| *n == name);
        place.ok_or_else(|| Error::NoChannel {
            path: first.path().into(),
            channel: name,
            present: first.names().to_vec(),
        })
    };
    let [r, g, b] = rgb_names("");
    let (r, g, b) = (find(r)?, find(g)?, find(b)?);
    let mut bands = Bands::new(parts);
    let size = first.window().whole;
    let mut values = Vec::with_capacity(size.n_pixels());
    for y in 0..size.height as usize {
        let row = bands.next(y..y + 1)?;
        values.extend((0..size.width as usize).map(|x| Rgb::new(row[r][x], row[g][x], row[b][x])));
    }
    Ok(Grid::from_values(size, values))
}

/// Some rows of the whole.
enum Block {
    /// As they are in the file.
    Packed(Vec<u8>),
    /// By channel.
    Rows(Vec<Vec<f32>>),
}

impl Block {
    fn packed(self, width: usize) -> Vec<u8> {
        match self {
            Self::Packed(bytes) => bytes,
            Self::Rows(channels) => zip::pack(&channels, width),
        }
    }
}

/// The rows of the whole, from the first to the last.
struct Bands<'p> {
    parts: &'p [Part],
    size: ImageSize,
    /// Parts that the rows at hand cross, by their place in `parts`.
    open: Vec<(usize, Rows<'p>)>,
}

impl<'p> Bands<'p> {
    fn new(parts: &'p [Part]) -> Self {
        let first = &parts[0];
        let size = first.window().whole;
        let is_kin = |part: &Part| {
            part.window().whole == size
                && part.metadata() == first.metadata()
                && part.names() == first.names()
        };
        assert!(parts.iter().all(is_kin), "parts of one picture");
        let n_pixels: usize = parts.iter().map(|part| part.window().size.n_pixels()).sum();
        assert_eq!(n_pixels, size.n_pixels(), "all parts of the picture, and each once");
        Self { parts, size, open: Vec::new() }
    }

    /// The rows of a block. They must follow those of the call before.
    fn next_block(&mut self, rows: Range<usize>) -> Result<Block, Error> {
        self.open(rows.start)?;
        let has_block = |part: &Part| {
            let [x, end_x, y, end_y] = part.window().bounds().map(|side| side as usize);
            end_x - x == self.size.width as usize && y % zip::LINES == 0 && end_y >= rows.end
        };
        match self.open.first_mut() {
            Some((i, part)) if has_block(&self.parts[*i]) => {
                let packed = part.next_packed()?;
                self.close(rows.end);
                Ok(Block::Packed(packed))
            }
            _ => Ok(Block::Rows(self.next(rows)?)),
        }
    }

    /// Some rows by channel. They must follow those of the call before.
    fn next(&mut self, rows: Range<usize>) -> Result<Vec<Vec<f32>>, Error> {
        let width = self.size.width as usize;
        let n_channels = self.parts[0].names().len();
        let mut band = vec![vec![0.0; rows.len() * width]; n_channels];
        for y in rows.clone() {
            self.open(y)?;
            for (i, part) in &mut self.open {
                let start = (y - rows.start) * width + self.parts[*i].window().corner.x as usize;
                for (values, row) in band.iter_mut().zip(part.next()?) {
                    values[start..start + row.len()].copy_from_slice(row);
                }
            }
            self.close(y + 1);
        }
        Ok(band)
    }

    /// Opens the parts that begin with this row and aren't open.
    fn open(&mut self, y: usize) -> Result<(), Error> {
        for (i, part) in self.parts.iter().enumerate() {
            let is_open = || self.open.iter().any(|(k, _)| *k == i);
            if part.window().corner.y as usize == y && !is_open() {
                self.open.push((i, part.rows()?));
            }
        }
        Ok(())
    }

    /// Closes the parts that end before this row.
    fn close(&mut self, y: usize) {
        self.open.retain(|(i, _)| self.parts[*i].window().bounds()[3] as usize > y);
    }
}
