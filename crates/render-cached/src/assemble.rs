//! `render-cached assemble`: from the parts of a picture to the file that one run makes.

use std::path::{Path, PathBuf};

use anyhow::bail;
use base::{ImageSize, Window};
use cli::{Clock, Console, Interrupt, WrongUsage};
use film::{Format, Part};
use serde_json::Value;

use crate::args::Assemble;

/// Joins the parts that the command line names.
///
/// # Errors
/// When a part can't be read, is missing, overlaps another, or belongs to another picture; the message names it.
pub(crate) fn assemble(args: &Assemble) -> anyhow::Result<()> {
    let clock = Clock::start();
    // What is joined has no pieces to ask between: an end comes when it is asked for.
    let _interrupt = Interrupt::listen("render-cached", "no picture was written");
    let console = Console::new("render-cached", &args.common);
    let mut formats = Vec::new();
    for path in &args.output {
        match Format::of(path) {
            Ok(format) => formats.push((format, path)),
            Err(error) => bail!(WrongUsage(error.to_string())),
        }
    }
    let paths: fn(&PathBuf) -> &Path = PathBuf::as_path;
    let outputs = args.output.iter().chain(&args.common.stats);
    let existing = args.common.existing();
    cli::check_outputs(
        &outputs.map(paths).collect::<Vec<_>>(),
        &args.parts.iter().map(paths).collect::<Vec<_>>(),
        existing,
    )?;
    args.common.thread_pool()?.install(|| {
        let parts = open(&args.parts)?;
        for &(format, path) in &formats {
            match format {
                Format::Exr => film::assemble_exr(path, existing, &parts)?,
                Format::Png => {
                    film::write_png(path, existing, &film::assemble_rgb(&parts)?, args.exposure)?
                }
            };
        }
        let total = clock.total();
        let ImageSize { width, height } = parts[0].window().whole;
        console.say(format_args!(
            "{width}x{height} from {} parts in {:.2} s ({:.2} CPU s)",
            parts.len(),
            total.wall,
            total.cpu
        ));
        if let Some(path) = &args.common.stats {
            cli::write_stats(path, existing, &stats(&parts, total))?;
        }
        Ok(())
    })
}

fn stats(parts: &[Part], total: cli::Seconds) -> Value {
    let ImageSize { width, height } = parts[0].window().whole;
    serde_json::json!({
        "program": "render-cached",
        "version": env!("CARGO_PKG_VERSION"),
        "parts": parts.len(),
        "resolution": [width, height],
        "threads": rayon::current_num_threads(),
        "seconds": { "total": total.wall },
        "cpu_seconds": { "total": total.cpu },
        "peak_rss_bytes": cli::peak_rss_bytes(),
    })
}

/// All parts of a picture, from top to bottom.
fn open(paths: &[PathBuf]) -> anyhow::Result<Vec<Part>> {
    let mut parts: Vec<Part> = Vec::new();
    for path in paths {
        let part = Part::open(path)?;
        if let Some(first) = parts.first() {
            check_kin(first, &part)?;
        }
        parts.push(part);
    }
    parts.sort_by_key(|part| (part.window().corner.y, part.window().corner.x));
    check_cover(&parts)?;
    Ok(parts)
}

/// Refuses a part of another picture than the first one.
fn check_kin(first: &Part, part: &Part) -> anyhow::Result<()> {
    let difference = if first.window().whole != part.window().whole {
        "the resolution".into()
    } else if first.metadata() != part.metadata() {
        let [a, b] = [first, part].map(|p| serde_json::from_str::<Value>(p.metadata()).ok());
        let differs =
            |key: &&str| a.as_ref().and_then(|a| a.get(key)) != b.as_ref().and_then(|b| b.get(key));
        let told = ["version", "inputs", "seed", "command", "error"].into_iter().find(differs);
        match told {
            Some("inputs") => "scene, camera, photons or quality".into(),
            Some("command") => {
                let command = |of: &Option<Value>| {
                    of.as_ref().map_or_else(String::new, |of| of["command"].to_string())
                };
                format!("their commands, {} and {}", command(&a), command(&b))
            }
            told => format!("the {}", told.unwrap_or("metadata")),
        }
    } else if first.names() != part.names() {
        "their channels".into()
    } else {
        return Ok(());
    };
    let [a, b] = [first, part].map(|p| p.path().display());
    bail!(
        "{b} is a part of another picture than {a}: they differ in {difference}; leave it out, or make it anew"
    )
}

/// Refuses parts, sorted by rows, that overlap or leave something out.
fn check_cover(parts: &[Part]) -> anyhow::Result<()> {
    for (i, a) in parts.iter().enumerate() {
        let [x, end_x, _, end_y] = a.window().bounds();
        let beside = parts[i + 1..].iter().take_while(|b| b.window().corner.y < end_y);
        for b in beside {
            let [bx, b_end_x, by, _] = b.window().bounds();
            if bx < end_x && x < b_end_x {
                let [a, b] = [a, b].map(|p| p.path().display());
                bail!("{a} and {b} both hold pixel ({}, {by}); leave one of them out", bx.max(x));
            }
        }
    }
    let Some([x, end_x, y, end_y]) = gap(parts[0].window().whole, parts) else { return Ok(()) };
    let metadata: Value = serde_json::from_str(parts[0].metadata()).unwrap_or_default();
    let command = metadata["command"].as_str().unwrap_or("render-cached");
    let command = command.trim_end_matches(" --force");
    bail!(
        "columns {x} to {} of rows {y} to {} are in no part; name the part that holds them, or make it with: \
         {command} --crop {x},{end_x},{y},{end_y} -o PART.exr",
        end_x - 1,
        end_y - 1
    )
}

/// The highest rectangle that no part covers, as large as it can be; parts don't overlap.
fn gap(whole: ImageSize, parts: &[Part]) -> Option<[u32; 4]> {
    let mut edges: Vec<u32> = parts
        .iter()
        .map(Part::window)
        .flat_map(|w: Window| [w.bounds()[2], w.bounds()[3]])
        .chain([0, whole.height])
        .collect();
    edges.sort_unstable();
    edges.dedup();
    // Gaps between the parts that cross the rows from `y` on, up to the next edge.
    let gaps = |y: u32| {
        let crossing = parts.iter().map(|part| part.window().bounds());
        let mut spans: Vec<[u32; 2]> = crossing
            .filter(|&[_, _, start, end]| (start..end).contains(&y))
            .map(|[x, end_x, ..]| [x, end_x])
            .chain([[whole.width, whole.width]])
            .collect();
        spans.sort_unstable();
        let mut end = 0;
        let mut gaps = Vec::new();
        for [x, end_x] in spans {
            if x > end {
                gaps.push([end, x]);
            }
            end = end_x;
        }
        gaps
    };
    let rows = edges.windows(2).map(|rows| (rows[0], rows[1]));
    let (y, [x, end_x]) = rows.clone().find_map(|(y, _)| Some((y, *gaps(y).first()?)))?;
    let below = rows.skip_while(|rows| rows.0 < y);
    let same = below.take_while(|&(y, _)| gaps(y).contains(&[x, end_x]));
    let end_y = same.last().map_or(y, |rows| rows.1);
    Some([x, end_x, y, end_y])
}
