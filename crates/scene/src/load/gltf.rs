//! glTF 2.0, text and binary (Khronos 2021, "glTF 2.0 Specification").
//!
//! Whatever isn't supported is refused by name, with its place in the JSON, or replaced and told of if the user asks for that.

mod accessor;
mod file;
mod lights;
mod materials;
mod meshes;
mod nodes;
mod tables;
mod textures;
mod uri;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use geometry::MaterialId;

use super::assembly::Assembly;
use super::{Options, whole};
use crate::{Error, Light, Parts};
use file::File;
use nodes::Placed;

/// The extensions that are taken into account, or refused where a material holds them.
const KNOWN: [&str; 17] = [
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    // Which tells who made it.
    "KHR_xmp_json_ld",
];

/// Reads a scene.
pub(super) fn read(path: &Path, options: &Options) -> Result<(Parts, Vec<String>), Error> {
    let file = File::read(path, &options.reach(path))?;
    let mut context = Context::new(&file, options.lenient);
    context.check_extensions()?;
    let placed = nodes::placed(&file)?;
    context.counts = meshes::Counts::new(&placed);
    let mut cameras = Vec::new();
    for placed in &placed {
        let place = format!("nodes[{}]", placed.index);
        if let Some(mesh) = placed.node.mesh {
            meshes::add(&mut context, placed, mesh)?;
        }
        if let Some(light) = &placed.node.extensions.punctual {
            let kind = lights::light(&file, light.light, &place, &placed.map)?;
            if kind.is_black() {
                context.warn(&place, "its light is black and left out");
            } else {
                let name = context.name(placed);
                context.assembly.lights.push(Light { name, kind });
            }
        }
        if let Some(index) = placed.node.camera {
            match lights::camera(&file, index, &place, &placed.map)? {
                Some(camera) => cameras.push((place, camera)),
                None => context.warn(&place, "its camera is not in perspective and left out"),
            }
        }
    }
    if let [(first, _), .., (_, _)] = &cameras[..] {
        let text = format!("the first of {} cameras is taken, that of {first}", cameras.len());
        context.warn("cameras", &text);
    }
    if !file.tables.animations.is_empty() {
        context.warn("animations", "they are left out; nodes stand where the file places them");
    }
    let Some((_, camera)) = cameras.into_iter().next() else {
        let fault = "no node of the scene has a camera in perspective; add one where the file was made, and save it with cameras";
        return Err(file.source.fault_of_whole(fault));
    };
    let Context { mut assembly, notes, .. } = context;
    assembly.warnings.extend(notes);
    whole::finish(assembly, camera)
}

/// What is known while a scene is read.
struct Context<'f> {
    file: &'f File,
    assembly: Assembly<'f>,
    is_lenient: bool,
    /// What was replaced, in order and as a set.
    notes: Vec<String>,
    noted: BTreeSet<String>,
    /// The first node of each name, and the first material.
    first_nodes: BTreeMap<&'f str, usize>,
    first_materials: BTreeMap<&'f str, usize>,
    /// Materials by their index, none for the default, each with the texture coordinates that it needs.
    materials: BTreeMap<Option<usize>, (MaterialId, Option<usize>)>,
    textures: textures::Known,
    counts: meshes::Counts,
}

impl<'f> Context<'f> {
    fn new(file: &'f File, is_lenient: bool) -> Self {
        Self {
            file,
            assembly: Assembly::new(&file.source),
            is_lenient,
            notes: Vec::new(),
            noted: BTreeSet::new(),
            first_nodes: first(file.tables.nodes.iter().map(|node| &node.name)),
            first_materials: first(file.tables.materials.iter().map(|material| &material.name)),
            materials: BTreeMap::new(),
            textures: textures::Known::default(),
            counts: meshes::Counts::default(),
        }
    }

    fn check_extensions(&mut self) -> Result<(), Error> {
        let tables = &self.file.tables;
        let is_unknown = |name: &&String| !KNOWN.contains(&name.as_str());
        if let Some(name) = tables.extensions_required.iter().find(is_unknown) {
            let fault = format!("{name} isn't supported; save the file without it");
            return Err(self.file.fault("extensionsRequired", fault));
        }
        for name in tables.extensions_used.iter().filter(is_unknown) {
            let text = format!("{name} isn't supported; what it says is left out");
            self.warn("extensionsUsed", &text);
        }
        Ok(())
    }

    /// Something isn't supported: an error, or, if the user has asked for that, a note of what takes its place.
    fn refuse(&mut self, place: &str, what: &str, instead: &str) -> Result<(), Error> {
        if !self.is_lenient {
            return Err(self.file.fault(place, format!("{what}; with --lenient {instead}")));
        }
        let note = self.file.fault(place, format!("{what}; {instead}")).to_string();
        if self.noted.insert(note.clone()) {
            self.notes.push(note);
        }
        Ok(())
    }

    fn warn(&mut self, place: &str, text: &str) {
        self.assembly.warnings.push(self.file.fault(place, text).to_string());
    }

    /// The name of what a node shows.
    fn name(&self, placed: &Placed<'_>) -> String {
        name(&placed.node.name, "node", placed.index, &self.first_nodes)
    }
}

/// The first place of every name in a list.
fn first<'t>(names: impl Iterator<Item = &'t Option<String>>) -> BTreeMap<&'t str, usize> {
    let mut first = BTreeMap::new();
    for (i, name) in names.enumerate() {
        if let Some(name) = name {
            first.entry(name.as_str()).or_insert(i);
        }
    }
    first
}

/// The name of an object, or one made from its number; no two objects of a list have the same.
fn name(given: &Option<String>, kind: &str, index: usize, first: &BTreeMap<&str, usize>) -> String {
    match given.as_deref() {
        Some(name) if !name.is_empty() && !name.contains(char::is_control) => {
            if first.get(name) == Some(&index) {
                name.to_owned()
            } else {
                format!("{name}, {kind} {index}")
            }
        }
        _ => format!("{kind} {index}"),
    }
}
