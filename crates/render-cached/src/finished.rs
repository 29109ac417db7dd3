//! The file of what mode adaptive has found out about a whole picture, for tiles to be made of.
//!
//! Mode adaptive decides for the whole picture: what a mirror shows is looked up in the view, edges are followed wherever
//! they lead, and the error is that of all pixels. So one task computes, and tiles take from its file what they show.

use std::ops::Range;
use std::path::Path;

use anyhow::bail;
use base::{Component, Components, Grid, ImageSize, Inventory, Rgb};
use cache_map::Reason;
use cli::Seconds;
use mapfile::{Header, MapFile, Section};
use serde::{Deserialize, Serialize};
use shade::Counts;

use crate::adaptive::{ErrorReport, origins};
use crate::frame::Frame;
use crate::render::{AdaptiveLayers, Rendered};
use crate::{Args, output};

const KIND: &str = "finished layers";
const VERSION: u32 = 2;

/// Rows of subpixels that are a section: a tile reads and verifies those that it shows.
const BAND: usize = 64;

#[derive(Debug, Serialize, Deserialize)]
struct Metadata {
    inventory: Inventory,
    /// The command that makes the picture: all that decides its pixels.
    picture: String,
    /// In subpixels.
    size: ImageSize,
    error: ErrorReport,
}

/// Saves a whole picture that mode adaptive has rendered. `inputs` is all that its pixels depend on, the options aside.
///
/// # Errors
/// When the file can't be written.
pub(crate) fn save(
    path: &Path,
    args: &Args,
    rendered: &Rendered,
    layers: &AdaptiveLayers,
    inputs: &Inventory,
) -> anyhow::Result<()> {
    let size = rendered.values.direct.size();
    let numbers = |reasons: &Vec<Reason>| reasons.iter().map(|&r| r as u8).collect::<Vec<u8>>();
    let reasons = Components::from_fn(|component| numbers(&layers.reasons[component]));
    let bands: Vec<_> = bands(size)
        .flat_map(|(band, rows)| {
            let pixels = rows.start * size.width as usize..rows.end * size.width as usize;
            Component::ALL.map(|component| (component, names(component, band), pixels.clone()))
        })
        .collect();
    let mut sections = Vec::new();
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
        size,
        error: layers.error,
    };
    mapfile::write(path, args.common.existing(), &header, &metadata, &sections)?;
    Ok(())
}

/// The pixels of a frame, from the file that [`save`] has written of the whole picture.
///
/// # Errors
/// When the file can't be read, or is of another picture.
pub(crate) fn open(
    path: &Path,
    args: &Args,
    frame: &Frame<'_>,
    inputs: &Inventory,
) -> anyhow::Result<Rendered> {
    let (file, metadata) = MapFile::open_in_part::<Metadata>(path, KIND, VERSION)?;
    file.check_inputs(&metadata.inventory, inputs)?;
    let (there, asked) = (&metadata.picture, output::command(args));
    if *there != asked {
        bail!(
            "{} is of another picture: of {there}, and not of {asked}; make it anew with: {}",
            path.display(),
            output::layers_command(args, path)
        );
    }
    let window = frame.window();
    if metadata.size != window.whole {
        bail!(file.corrupt("it is of another size than it says"));
    }
    let [x, end_x, y, end_y] = window.bounds().map(|side| side as usize);
    let mut values: Components<Vec<Rgb>> = Components::from_fn(|_| Vec::new());
    let mut reasons: Components<Vec<Reason>> = Components::from_fn(|_| Vec::new());
    let mut levels: Components<Vec<u8>> = Components::from_fn(|_| Vec::new());
    let crossing = bands(window.whole).filter(|(_, rows)| rows.start < end_y && y < rows.end);
    for ((band, rows), component) in
        crossing.flat_map(|band| Component::ALL.map(|component| (band.clone(), component)))
    {
        let [of_values, of_reasons, of_levels] = names(component, band);
        let (v, r, l) = (
            file.array::<Rgb>(&of_values)?,
            file.array::<u8>(&of_reasons)?,
            file.array::<u8>(&of_levels)?,
        );
        let width = window.whole.width as usize;
        if [v.len(), r.len(), l.len()] != [rows.len() * width; 3] {
            bail!(file.corrupt(format!("{component} light hasn't a value for each pixel")));
        }
        for row in rows.start.max(y)..rows.end.min(end_y) {
            let start = (row - rows.start) * width;
            let part = start + x..start + end_x;
            values[component].extend_from_slice(&v[part.clone()]);
            let reason = |&number: &u8| Reason::ALL.get(usize::from(number)).copied();
            let found: Option<Vec<Reason>> = r[part.clone()].iter().map(reason).collect();
            let Some(found) = found else {
                bail!(file.corrupt(format!("{component} light was computed for no known reason")));
            };
            reasons[component].extend(found);
            levels[component].extend_from_slice(&l[part]);
        }
    }
    let values = Components::from_fn(|component| {
        Grid::from_values(window.size, std::mem::take(&mut values[component]))
    });
    let origins = origins(frame, &reasons);
    let adaptive = Some(AdaptiveLayers { reasons, levels, error: metadata.error });
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

/// The bands of a picture of this size, by number, and the rows of each.
fn bands(size: ImageSize) -> impl Iterator<Item = (usize, Range<usize>)> {
    let height = size.height as usize;
    (0..height).step_by(BAND).map(move |y| y..height.min(y + BAND)).enumerate()
}

/// The names of the sections of a component in a band: values, reasons, levels.
fn names(component: Component, band: usize) -> [String; 3] {
    ["values", "reasons", "levels"].map(|array| format!("{component}.{array}.{band}"))
}
