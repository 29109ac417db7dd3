//! The file of what mode adaptive has found out about a whole picture, for tiles to be made of.
//!
//! Mode adaptive decides for the whole picture: what a mirror shows is looked up in the view, edges are followed wherever
//! they lead, and the error is that of all pixels. So one task computes, and tiles take from its file what they show.

use std::fmt::Display;
use std::ops::Range;
use std::path::Path;

use anyhow::bail;
use base::{Component, Components, Fingerprint, Grid, ImageSize, Inventory, Rgb, Watch, Window};
use cache_map::Reason;
use cli::Seconds;
use mapfile::{Header, MapFile, Section};
use serde::{Deserialize, Serialize};
use shade::{Counts, Shader};

use crate::adaptive::{ErrorReport, origins};
use crate::frame::Frame;
use crate::render::{AdaptiveLayers, Rendered};
use crate::{Args, output};

const KIND: &str = "finished layers";
const VERSION: u32 = 3;

/// The arrays of the first primitives that eye rays meet. Scenes with masks have none.
const PRIMITIVES: &str = "primitives";

/// Rows of subpixels that are a section: a tile reads and verifies those that it shows.
const BAND: usize = 64;

#[derive(Debug, Serialize, Deserialize)]
struct Metadata {
    inventory: Inventory,
    /// The command that makes the picture: all that decides its pixels.
    picture: String,
    /// The digest of the file of photons, and that of the photons.
    photons: (u64, Fingerprint),
    /// In subpixels.
    size: ImageSize,
    error: ErrorReport,
}

/// Saves a whole picture that mode adaptive has rendered, with what its eye rays meet, so that no tile has to look for it
/// again. `inputs` is all that its pixels depend on, the options aside.
///
/// # Errors
/// When the file can't be written.
pub(crate) fn save(
    path: &Path,
    args: &Args,
    frame: &Frame<'_>,
    rendered: &Rendered,
    layers: &AdaptiveLayers,
    inputs: &Inventory,
    photons: (u64, Fingerprint),
) -> anyhow::Result<()> {
    let size = frame.size();
    let numbers = |reasons: &Vec<Reason>| reasons.iter().map(|&r| r as u8).collect::<Vec<u8>>();
    let reasons = Components::from_fn(|component| numbers(&layers.reasons[component]));
    let bands: Vec<_> = bands(size)
        .flat_map(|(band, rows)| {
            let pixels = pixels(&rows, size.width);
            Component::ALL.map(|component| (component, names(component, band), pixels.clone()))
        })
        .collect();
    let mut sections = Vec::new();
    let primitives = frame.primitives();
    let of_primitives: Vec<_> = self::bands(size)
        .map(|(band, rows)| (name(PRIMITIVES, band), pixels(&rows, size.width)))
        .collect();
    if !frame.shader().scene.is_masked() {
        for (name, pixels) in &of_primitives {
            sections.push(Section::new(name, &primitives[pixels.clone()]));
        }
    }
    for (component, [values, reason, level], pixels) in &bands {
        let part = || pixels.clone();
        sections.push(Section::new(values, &rendered.values[*component].values()[part()]));
        sections.push(Section::new(reason, &reasons[*component][part()]));
        sections.push(Section::new(level, &layers.levels[*component][part()]));
    }
    let header = Header {
        kind: KIND.into(),
        version: VERSION,
        made_by: concat!("render-cached ", env!("CARGO_PKG_VERSION")).into(),
        command: output::layers_command(args, Path::new("{file}")),
        inputs: inputs.fingerprint(),
        notes: vec![
            ("width".into(), size.width.to_string()),
            ("height".into(), size.height.to_string()),
        ],
    };
    let metadata = Metadata {
        inventory: inputs.clone(),
        picture: output::command(args),
        photons,
        size,
        error: layers.error,
    };
    mapfile::write(path, args.common.existing(), &header, &metadata, &sections)?;
    Ok(())
}

/// The file that [`save`] has written of a whole picture.
#[derive(Debug)]
pub(crate) struct Finished {
    file: MapFile,
    metadata: Metadata,
}

impl Finished {
    /// Opens the file.
    ///
    /// # Errors
    /// When it can't be read.
    pub(crate) fn open(path: &Path) -> anyhow::Result<Self> {
        let (file, metadata) = MapFile::open_in_part(path, KIND, VERSION)?;
        Ok(Self { file, metadata })
    }

    /// The digest of the file of photons that the picture was made with, and that of the photons.
    pub(crate) fn photons(&self) -> (u64, Fingerprint) {
        self.metadata.photons
    }

    /// Refuses another picture than the command line asks for.
    ///
    /// # Errors
    /// When it is of another picture.
    pub(crate) fn check(
        &self,
        path: &Path,
        args: &Args,
        whole: ImageSize,
        inputs: &Inventory,
    ) -> anyhow::Result<()> {
        let Self { file, metadata } = self;
        file.check_inputs(&metadata.inventory, inputs)?;
        let (there, asked) = (&metadata.picture, output::command(args));
        if *there != asked {
            bail!(
                "{} is of another picture: of {there}, and not of {asked}; make it anew with: {}",
                path.display(),
                output::layers_command(args, path)
            );
        }
        if metadata.size != whole {
            bail!(file.corrupt("it is of another size than it says"));
        }
        Ok(())
    }

    /// What the eye rays of a window meet.
    ///
    /// # Errors
    /// When the file is damaged, or somebody has asked for a stop.
    pub(crate) fn frame<'a>(
        &self,
        shader: &'a Shader<'a>,
        window: Window,
        watch: Watch<'_>,
    ) -> anyhow::Result<(Frame<'a>, Counts)> {
        // Which of the surfaces that let rays pass has stopped one is told by chance: by following it.
        if shader.scene.is_masked() {
            return Ok(Frame::trace(shader, window, watch)?);
        }
        let mut primitives = Vec::with_capacity(window.size.n_pixels());
        for (band, rows) in crossing(window) {
            let name = name(PRIMITIVES, band);
            let all = self.file.array::<u32>(&name)?;
            self.check_length(&name, &all, &rows)?;
            parts(window, &rows).for_each(|part| primitives.extend_from_slice(&all[part]));
        }
        match Frame::meeting(shader, window, &primitives, watch)? {
            Some(frame) => Ok((frame, Counts::default())),
            None => bail!(self.file.corrupt("an eye ray doesn't meet what it is said to meet")),
        }
    }

    /// The pixels of a frame.
    ///
    /// # Errors
    /// When the file is damaged.
    pub(crate) fn render(&self, frame: &Frame<'_>) -> anyhow::Result<Rendered> {
        let window = frame.window();
        let n = window.size.n_pixels();
        let mut values: Components<Vec<Rgb>> = Components::from_fn(|_| Vec::with_capacity(n));
        let mut reasons: Components<Vec<Reason>> = Components::from_fn(|_| Vec::with_capacity(n));
        let mut levels: Components<Vec<u8>> = Components::from_fn(|_| Vec::with_capacity(n));
        for (band, rows) in crossing(window) {
            for component in Component::ALL {
                let [of_values, of_reasons, of_levels] = names(component, band);
                let v = self.file.array::<Rgb>(&of_values)?;
                let r = self.file.array::<u8>(&of_reasons)?;
                let l = self.file.array::<u8>(&of_levels)?;
                self.check_length(&of_values, &v, &rows)?;
                self.check_length(&of_reasons, &r, &rows)?;
                self.check_length(&of_levels, &l, &rows)?;
                for part in parts(window, &rows) {
                    values[component].extend_from_slice(&v[part.clone()]);
                    let numbers = &r[part.clone()];
                    if numbers.iter().any(|&n| usize::from(n) >= Reason::ALL.len()) {
                        bail!(self.file.corrupt(format!(
                            "{component} light was computed for no known reason"
                        )));
                    }
                    reasons[component].extend(numbers.iter().map(|&n| Reason::ALL[usize::from(n)]));
                    levels[component].extend_from_slice(&l[part]);
                }
            }
        }
        let values = Components::from_fn(|component| {
            Grid::from_values(window.size, std::mem::take(&mut values[component]))
        });
        // All is copied by now.
        self.file.check_untouched()?;
        let origins = origins(frame, &reasons);
        let adaptive = Some(AdaptiveLayers { reasons, levels, error: self.metadata.error });
        Ok(Rendered {
            values,
            origins,
            traced: Components::default(),
            counts: Counts::default(),
            seconds: Components::<Seconds>::default(),
            cache: Seconds::default(),
            adaptive,
        })
    }

    /// Refuses an array that hasn't a value for each pixel of some rows of the whole picture.
    fn check_length<T>(&self, name: &str, array: &[T], rows: &Range<usize>) -> anyhow::Result<()> {
        if array.len() != pixels(rows, self.metadata.size.width).len() {
            bail!(self.file.corrupt(format!("`{name}` hasn't a value for each pixel")));
        }
        Ok(())
    }
}

/// The pixels of some rows.
fn pixels(rows: &Range<usize>, width: u32) -> Range<usize> {
    rows.start * width as usize..rows.end * width as usize
}

/// The bands that hold rows of a window.
fn crossing(window: Window) -> impl Iterator<Item = (usize, Range<usize>)> {
    let [_, _, y, end_y] = window.bounds().map(|side| side as usize);
    bands(window.whole).filter(move |(_, rows)| rows.start < end_y && y < rows.end)
}

/// The pixels of a window, row by row, in the arrays of a band of these rows.
fn parts(window: Window, rows: &Range<usize>) -> impl Iterator<Item = Range<usize>> + use<> {
    let [x, end_x, y, end_y] = window.bounds().map(|side| side as usize);
    let (first, width) = (rows.start, window.whole.width as usize);
    (rows.start.max(y)..rows.end.min(end_y)).map(move |row| {
        let start = (row - first) * width;
        start + x..start + end_x
    })
}

/// The bands of a picture of this size, by number, and the rows of each.
fn bands(size: ImageSize) -> impl Iterator<Item = (usize, Range<usize>)> {
    let height = size.height as usize;
    (0..height).step_by(BAND).map(move |y| y..height.min(y + BAND)).enumerate()
}

/// The names of the sections of a component in a band: values, reasons, levels.
fn names(component: Component, band: usize) -> [String; 3] {
    ["values", "reasons", "levels"].map(|array| name(format_args!("{component}.{array}"), band))
}

fn name(array: impl Display, band: usize) -> String {
    format!("{array}.{band}")
}
