//! `render-cached diff`: how far two pictures differ.

use std::io::{self, ErrorKind, Write};

use anyhow::{Context, bail};
use atomic_file::Existing;
use cli::WrongUsage;
use film::Format;

use crate::args::Diff;

/// Writes the figures to standard output, and a picture of the difference where one is asked for.
///
/// # Errors
/// When a picture can't be read, or the two can't be compared.
pub(crate) fn diff(args: &Diff) -> anyhow::Result<()> {
    let existing = if args.force { Existing::Replace } else { Existing::Refuse };
    if let Some(path) = &args.output {
        if Format::of(path).ok() != Some(Format::Png) {
            bail!(WrongUsage(format!(
                "the picture of a difference is a PNG; end its name in .png, unlike {}",
                path.display()
            )));
        }
        cli::check_outputs(&[path], &[&args.a, &args.b], existing)?;
    }
    let a = film::read_rgb(&args.a, &args.layer)?;
    let b = film::read_rgb(&args.b, &args.layer)?;
    let (difference, map) = film::compare(&a, &b, args.exposure)?;
    if let Some(path) = &args.output {
        film::write_png(path, existing, &film::flip_picture(&map), 0.0)?;
    }
    let flip = &difference.flip;
    let at = difference.peak_pixel;
    let text = format!(
        "mean error  {:.6}\nRMS error   {:.6}\nrelMSE      {:.6}\npeak error  {:.6} at {},{}\n\
         FLIP mean   {:.5}\nFLIP p99    {:.5}\nFLIP block  {:.5}\nFLIP > 0.1  {:.4} %\n",
        difference.mean_abs,
        difference.rms,
        difference.rel_mse,
        difference.peak,
        at.x,
        at.y,
        flip.mean,
        flip.p99,
        flip.worst_block_8x8,
        flip.share_above_0_1 * 100.0,
    );
    match io::stdout().write_all(text.as_bytes()) {
        // Whoever reads has seen enough.
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(()),
        result => result.context("cannot write to standard output"),
    }
}
