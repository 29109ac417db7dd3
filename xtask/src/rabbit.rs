//! `cargo xtask rabbit`: makes the mesh of `scenes/rabbit`, to the same bytes everywhere.
//!
//! An implicit surface is cut into triangles on a grid, its vertices are moved onto the surface and spread over it, and
//! the field's gradient gives their normals.

mod field;
mod mesh;
mod polygonize;
mod relax;
mod shape;
mod survey;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use atomic_file::Existing;
use glam::DVec3;

use crate::rabbit::mesh::{Mesh, to_ply};
use crate::rabbit::polygonize::{Lattice, polygonize};
use crate::rabbit::relax::relax;
use crate::rabbit::shape::Rabbit;
use crate::rabbit::survey::Survey;

/// Make the mesh of the rabbit scene, or check the one that is there
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// The PLY file to write or, with --check, to compare [default: scenes/rabbit/rabbit.ply]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Cubes of the grid along a length of 1, about the rabbit's height; fewer than 60 lose the rims of the ears
    #[arg(long, value_name = "N", default_value_t = RESOLUTION, value_parser = clap::value_parser!(u16).range(60..=256))]
    resolution: u16,
    /// Compare the file with what would be written, and write nothing
    #[arg(long)]
    check: bool,
}

/// Gives about 70,000 triangles, as many as the rabbit of the paper's second scene.
const RESOLUTION: u16 = 76;

/// Makes the rabbit, prints what it is like, and writes it or compares it.
///
/// # Errors
/// When the mesh is not sound, when the file cannot be read or written, and when it is not what it should be.
#[expect(clippy::print_stdout, reason = "the survey is the command's result")]
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let mesh = rabbit(args.resolution);
    let survey = Survey::of(&mesh);
    println!("{survey}");
    ensure!(survey.is_sound(), "the mesh is not sound: choose another --resolution");
    let ply = to_ply(&mesh, &comment(args.resolution));
    let path = args.output.clone().unwrap_or_else(committed);
    if args.check {
        compare(&path, &ply)?;
        println!("{} is what the generator makes", path.display());
    } else {
        atomic_file::write(&path, Existing::Replace, |out| out.write_all(&ply))?;
        println!("wrote {} ({} bytes)", path.display(), ply.len());
    }
    Ok(())
}

/// The mesh of the scene in this checkout.
fn committed() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().unwrap_or(package).join("scenes/rabbit/rabbit.ply")
}

fn comment(resolution: u16) -> String {
    format!("cargo xtask rabbit --resolution {resolution}")
}

fn compare(path: &Path, ply: &[u8]) -> anyhow::Result<()> {
    let found = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    if let Some(at) = (0..found.len().max(ply.len())).find(|i| found.get(*i) != ply.get(*i)) {
        bail!(
            "{} is not what the generator makes, from byte {at} on: without --check it is written anew",
            path.display()
        );
    }
    Ok(())
}

/// The rabbit on a grid of `resolution` cubes a unit of length: on y = 0, centered in x and z.
fn rabbit(resolution: u16) -> Mesh {
    let shape = Rabbit::new();
    let [low, high] = Rabbit::BOUNDS;
    let lattice = Lattice::covering(low, high, 1.0 / f64::from(resolution));
    let (mut vertices, triangles) = polygonize(&lattice, |p| shape.sample(p).value);
    relax(&mut vertices, &triangles, lattice.cell, |p| shape.sample(p));

    let (low, high) = vertices
        .iter()
        .fold((DVec3::MAX, DVec3::MIN), |(low, high), p| (low.min(*p), high.max(*p)));
    let foot = DVec3::new((low.x + high.x) / 2.0, low.y, (low.z + high.z) / 2.0);
    let normal = |p: &DVec3| shape.sample(*p).gradient.normalize_or_zero();
    Mesh {
        positions: vertices.iter().map(|p| (*p - foot).as_vec3().to_array()).collect(),
        normals: vertices.iter().map(|p| normal(p).as_vec3().to_array()).collect(),
        triangles,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mesh_is_sound_at_any_resolution() {
        for resolution in [60, 71] {
            let survey = Survey::of(&rabbit(resolution));
            assert!(survey.is_sound(), "resolution {resolution}:\n{survey}");
        }
    }

    #[test]
    fn the_rabbit_stands_on_the_ground_and_is_about_1_tall() {
        let mesh = rabbit(60);
        let extent = |axis: usize| {
            let values = mesh.positions.iter().map(|p| p[axis]);
            values.fold((f32::MAX, f32::MIN), |(low, high), v| (low.min(v), high.max(v)))
        };
        for axis in [0, 2] {
            let (low, high) = extent(axis);
            assert!((low + high).abs() < 1e-6, "axis {axis}: {low} {high}");
        }
        let (low, high) = extent(1);
        assert!(low == 0.0 && (high - 1.0).abs() < 0.02, "{low} {high}");
    }

    #[test]
    fn vertices_lie_on_the_surface() {
        let shape = Rabbit::new();
        let [low, high] = Rabbit::BOUNDS;
        let lattice = Lattice::covering(low, high, 1.0 / 60.0);
        let (mut vertices, triangles) = polygonize(&lattice, |p| shape.sample(p).value);
        let off = |vertices: &[DVec3]| {
            vertices.iter().map(|p| shape.sample(*p).value.abs()).fold(0.0, f64::max)
        };
        assert!(off(&vertices) > 1e-3, "the grid alone should not find the surface");
        relax(&mut vertices, &triangles, lattice.cell, |p| shape.sample(p));
        assert!(off(&vertices) < 1e-6, "{}", off(&vertices));
    }

    #[test]
    fn the_committed_file_is_what_the_generator_makes() {
        let ply = to_ply(&rabbit(RESOLUTION), &comment(RESOLUTION));
        compare(&committed(), &ply).unwrap();
    }

    #[test]
    fn a_changed_file_is_named_with_the_place_and_the_way_out() {
        let path = std::env::temp_dir().join(format!("rabbit-{}.ply", std::process::id()));
        fs::write(&path, b"plx").unwrap();
        let message = compare(&path, b"ply").unwrap_err().to_string();
        let longer = compare(&path, b"plx and more").unwrap_err().to_string();
        fs::remove_file(&path).unwrap();
        let name = path.display();
        assert_eq!(
            message,
            format!(
                "{name} is not what the generator makes, from byte 2 on: without --check it is written anew"
            )
        );
        assert!(longer.contains("from byte 3 on"), "{longer}");
        assert!(compare(&path, b"ply").unwrap_err().to_string().starts_with("cannot read"));
    }
}
