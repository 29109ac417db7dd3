//! Reading scene files.

mod assembly;
mod enclosure;
mod keys;
mod lights;
mod lines;
mod materials;
mod mesh_checks;
mod meshes;
mod mtl;
mod obj;
mod ply;
mod polygon;
mod shapes;
mod source;
mod tables;
mod transform;
mod view;
mod whole;

use std::path::Path;

use assembly::Assembly;
use source::Source;
use tables::SceneFile;

use crate::{Error, Scene};

/// A scene, and what its author should know about it.
#[derive(Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// What was ignored or repaired, one line each, with file and place.
    pub warnings: Vec<String>,
}

/// Reads a scene file.
///
/// # Errors
///
/// Whatever keeps the scene from being rendered, with file, line and column.
pub fn load(path: &Path) -> Result<Loaded, Error> {
    let source = Source::read(path)?;
    let file: SceneFile = toml::from_str(source.text()).map_err(|e| source.syntax(&e))?;
    let camera = view::camera(&source, &file.camera)?;
    let mut assembly = Assembly::new(&source);
    assembly.add_materials(&file.materials)?;
    for (i, table) in file.meshes.iter().enumerate() {
        meshes::add(&mut assembly, i, table)?;
    }
    for (i, table) in file.quads.iter().enumerate() {
        assembly.add_quad(i, table)?;
    }
    for (i, table) in file.boxes.iter().enumerate() {
        assembly.add_box(i, table)?;
    }
    for (i, table) in file.spheres.iter().enumerate() {
        assembly.add_sphere(i, table)?;
    }
    for (i, table) in file.lights.iter().enumerate() {
        assembly.add_light(i, table)?;
    }
    assembly.warn_of_unused(&file.materials);
    let (parts, warnings) = whole::finish(assembly, camera)?;
    Ok(Loaded { scene: Scene::assemble(parts), warnings })
}
