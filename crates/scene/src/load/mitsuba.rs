//! Scenes of Mitsuba, versions 0.5 to 3: XML.
//!
//! Whatever isn't supported is refused by name, with line and column, or replaced and told of if the user asks for that.

mod emitters;
mod instances;
mod materials;
mod plugin;
mod sensor;
mod shapes;
mod spectrum;
mod textures;
mod xml;

use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;

use base::Rgb;
use geometry::MaterialId;

use super::assembly::Assembly;
use super::{Options, whole};
use crate::{Error, Parts};
use xml::{Document, Element, Place};

/// How many references may lead from one to the next.
const MAX_REFERENCES: usize = 32;

/// Reads a scene.
pub(super) fn read(path: &Path, options: &Options) -> Result<(Parts, Vec<String>), Error> {
    let document = Document::read(path, &options.reach(path), &options.definitions)?;
    let mut context = Context::new(&document, options.lenient)?;
    let mut sensors = Vec::new();
    for element in &document.elements {
        match element.tag.as_str() {
            "shape" => shapes::add(&mut context, element)?,
            "emitter" | "luminaire" => emitters::add(&mut context, element)?,
            "sensor" | "camera" => sensors.push(element),
            // Materials and textures count where they are referred to; integrators and samplers are settings of quality,
            // which are options of the programs.
            "bsdf" | "texture" | "integrator" | "sampler" | "alias" => {}
            "spectrum" | "blackbody" | "rgb" | "film" | "rfilter"
                if element.attribute("id").is_some() => {}
            other => {
                context.refuse(
                    element.place,
                    &format!("<{other}> isn't supported"),
                    "it is left out",
                )?;
            }
        }
    }
    let Some(sensor) = sensors.first() else {
        return Err(document.main().fault_of_whole("there is no <sensor>; add one"));
    };
    if let Some(second) = sensors.get(1) {
        context.refuse(second.place, "there is a second sensor", "the first one is taken")?;
    }
    let camera = sensor::camera(&mut context, sensor)?;
    let Context { mut assembly, notes, .. } = context;
    assembly.warnings.extend(notes);
    whole::finish(assembly, camera)
}

/// The place of the bsdf, whether it is for spheres, and what its surfaces emit: a color, by its bits, times a texture.
type MaterialKey = (Place, bool, [u32; 3], Option<u16>);

/// What is known while a scene is read.
struct Context<'d> {
    document: &'d Document,
    assembly: Assembly<'d>,
    is_lenient: bool,
    /// What was replaced.
    notes: Vec<String>,
    by_id: BTreeMap<&'d str, &'d Element>,
    /// Materials by what they are made of.
    materials: BTreeMap<MaterialKey, MaterialId>,
    /// Textures by their place, and whether they are for spheres.
    textures: BTreeMap<(Place, bool), crate::TextureId>,
    /// Groups that have instances.
    groups: BTreeMap<Place, Rc<instances::Group>>,
    /// What instances have added so far, in triangles and spheres.
    n_instanced: usize,
}

impl<'d> Context<'d> {
    fn new(document: &'d Document, is_lenient: bool) -> Result<Self, Error> {
        let mut context = Self {
            document,
            assembly: Assembly::new(document.main()),
            is_lenient,
            notes: Vec::new(),
            by_id: BTreeMap::new(),
            materials: BTreeMap::new(),
            textures: BTreeMap::new(),
            groups: BTreeMap::new(),
            n_instanced: 0,
        };
        let mut rest: Vec<&Element> = document.elements.iter().rev().collect();
        let mut aliases = Vec::new();
        while let Some(element) = rest.pop() {
            if element.tag == "alias" {
                aliases.push(element);
            } else if element.tag != "ref"
                && let Some(id) = element.attribute("id")
                && context.by_id.insert(id, element).is_some()
            {
                let fault = format!("two elements have the id \"{id}\"; rename one");
                return Err(document.fault(element.place, fault));
            }
            rest.extend(element.children.iter().rev());
        }
        for alias in aliases {
            let of = |name| alias.attribute(name).unwrap_or_default();
            let Some(&target) = context.by_id.get(of("id")) else {
                return Err(
                    document.fault(alias.place, format!("nothing has the id \"{}\"", of("id")))
                );
            };
            context.by_id.insert(of("as"), target);
        }
        Ok(context)
    }

    /// What an element refers to, or itself.
    fn resolve(&self, element: &'d Element) -> Result<&'d Element, Error> {
        if element.tag != "ref" {
            return Ok(element);
        }
        let id = element.attribute("id").unwrap_or_default();
        self.by_id.get(id).copied().ok_or_else(|| {
            self.document.fault(element.place, format!("nothing has the id \"{id}\""))
        })
    }

    /// Something isn't supported: an error, or, if the user has asked for that, a note of what takes its place.
    fn refuse(&mut self, place: Place, what: &str, instead: &str) -> Result<(), Error> {
        if !self.is_lenient {
            let fault = format!("{what}; with --lenient {instead}");
            return Err(self.document.fault(place, fault));
        }
        self.notes.push(self.document.fault(place, format!("{what}; {instead}")).to_string());
        Ok(())
    }

    /// The name of an object: its id, or one made from its number.
    fn name(&self, element: &Element, number: usize) -> String {
        match element.attribute("id") {
            Some(id) => id.to_owned(),
            None => format!("{} {number}", element.tag),
        }
    }
}

/// A key of a color.
fn bits(color: Rgb) -> [u32; 3] {
    color.to_array().map(f32::to_bits)
}
