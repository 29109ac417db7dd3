//! The objects of a scene file, one after another.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use geometry::{MaterialId, Mesh, Sphere};
use glam::Quat;
use toml::Spanned;

use super::mesh_checks::has_area;
use super::source::{MAX_LENGTH, Source};
use super::tables::{
    BoxTable, LightTable, MaterialTable, QuadTable, SceneFile, SphereTable, TextureTable,
    TransformTable,
};
use super::{keys, lights, materials, meshes, shapes, textures, transform};
use crate::{Error, Light, Material, Texture, TextureId};

/// The parts of a scene as they come in.
pub(super) struct Assembly<'a> {
    pub(super) source: &'a Source,
    pub(super) materials: Vec<Material>,
    ids: BTreeMap<String, MaterialId>,
    used: BTreeSet<MaterialId>,
    pub(super) textures: Vec<(String, Texture)>,
    used_textures: BTreeSet<String>,
    pub(super) meshes: Vec<(String, Mesh)>,
    pub(super) spheres: Vec<(String, Sphere)>,
    pub(super) lights: Vec<Light>,
    names: BTreeSet<String>,
    pub(super) warnings: Vec<String>,
}

impl<'a> Assembly<'a> {
    pub(super) fn new(source: &'a Source) -> Self {
        Self {
            source,
            materials: Vec::new(),
            ids: BTreeMap::new(),
            used: BTreeSet::new(),
            textures: Vec::new(),
            used_textures: BTreeSet::new(),
            meshes: Vec::new(),
            spheres: Vec::new(),
            lights: Vec::new(),
            names: BTreeSet::new(),
            warnings: Vec::new(),
        }
    }

    pub(super) fn add_textures(
        &mut self,
        tables: &BTreeMap<String, Spanned<TextureTable>>,
    ) -> Result<(), Error> {
        for (name, table) in tables {
            let texture = textures::texture(self.source, name, table.get_ref())?;
            self.add_texture(name.clone(), texture).ok_or_else(|| {
                self.source.fault(table.span(), "too many textures; use at most 65536")
            })?;
        }
        Ok(())
    }

    /// `None` when there are too many.
    pub(super) fn add_texture(&mut self, name: String, texture: Texture) -> Option<TextureId> {
        let id = TextureId(u16::try_from(self.textures.len()).ok()?);
        self.textures.push((name, texture));
        Some(id)
    }

    /// The texture that an object names, and the largest value of any of its channels.
    pub(super) fn texture(
        &mut self,
        name: &Spanned<String>,
        object: &str,
    ) -> Result<(TextureId, f32), Error> {
        let found = self.textures.iter().position(|(known, _)| known == name.get_ref());
        let index = found.ok_or_else(|| {
            let known: Vec<_> = self.textures.iter().map(|(name, _)| name.as_str()).collect();
            let fault = format!(
                "{object} names the unknown texture \"{}\"; the textures are {}",
                name.get_ref(),
                keys::list(&known)
            );
            self.source.fault(name.span(), fault)
        })?;
        self.used_textures.insert(name.get_ref().clone());
        Ok((TextureId(index as u16), self.textures[index].1.max()))
    }

    /// Whether the surfaces of a material need texture coordinates.
    pub(super) fn is_textured(&self, id: MaterialId) -> bool {
        self.materials[usize::from(id.0)].is_textured()
    }

    pub(super) fn add_materials(
        &mut self,
        tables: &BTreeMap<String, Spanned<MaterialTable>>,
    ) -> Result<(), Error> {
        for (name, table) in tables {
            let material = materials::material(self, name, table.get_ref())?;
            let id = self.add_material(material).ok_or_else(|| {
                self.source.fault(table.span(), "too many materials; use at most 65536")
            })?;
            self.ids.insert(name.clone(), id);
        }
        Ok(())
    }

    /// `None` when there are too many.
    pub(super) fn add_material(&mut self, material: Material) -> Option<MaterialId> {
        let id = MaterialId(u16::try_from(self.materials.len()).ok()?);
        self.materials.push(material);
        Some(id)
    }

    /// The material that an object names.
    pub(super) fn material(
        &mut self,
        name: &Spanned<String>,
        object: &str,
    ) -> Result<MaterialId, Error> {
        let id = *self.ids.get(name.get_ref()).ok_or_else(|| {
            let known: Vec<_> = self.ids.keys().map(String::as_str).collect();
            let fault = format!(
                "{object} names the unknown material \"{}\"; the materials are {}",
                name.get_ref(),
                keys::list(&known)
            );
            self.source.fault(name.span(), fault)
        })?;
        self.used.insert(id);
        Ok(id)
    }

    /// The name of the object number `index` of its list: the given one, or one made from its place.
    pub(super) fn name(
        &mut self,
        given: &Option<Spanned<String>>,
        kind: &str,
        index: usize,
        table: Range<usize>,
    ) -> Result<String, Error> {
        let (name, span) = match given {
            Some(name) => (name.get_ref().clone(), name.span()),
            None => (format!("{kind} {}", index + 1), table),
        };
        if name.is_empty() || name.chars().any(char::is_control) {
            let fault = "a name must be one line of at least one character";
            return Err(self.source.fault(span, fault));
        }
        if !self.names.insert(name.clone()) {
            let fault = format!("two objects are named \"{name}\"; rename one");
            return Err(self.source.fault(span, fault));
        }
        Ok(name)
    }

    pub(super) fn add_quad(
        &mut self,
        index: usize,
        table: &Spanned<QuadTable>,
    ) -> Result<(), Error> {
        let (span, table) = (table.span(), table.get_ref());
        let name = self.name(&table.name, "quad", index, span.clone())?;
        let object = format!("quad `{name}`");
        let corner = self.source.vector(&table.corner, &format!("the corner of {object}"))?;
        let [a, b] = &table.edges;
        let what = format!("an edge of {object}");
        let edges = [self.source.vector(a, &what)?, self.source.vector(b, &what)?];
        let material = self.material(&table.material, &object)?;
        let mut mesh = shapes::quad(corner, edges, material);
        if !self.is_textured(material) {
            mesh.uvs = Vec::new();
        }
        if (0..2).any(|t| !has_area(mesh.corners(t))) {
            let fault = format!("{object} has no area; give two edges that are not parallel");
            return Err(self.source.fault(table.edges[1].span(), fault));
        }
        let source = self.source;
        meshes::admit(self, &mut mesh, &|text| {
            source.warning(span.clone(), format!("{object}: {text}"))
        });
        self.meshes.push((name, mesh));
        Ok(())
    }

    pub(super) fn add_box(&mut self, index: usize, table: &Spanned<BoxTable>) -> Result<(), Error> {
        let (span, table) = (table.span(), table.get_ref());
        let name = self.name(&table.name, "box", index, span.clone())?;
        let object = format!("box `{name}`");
        let get = |v, what: &str| self.source.vector(v, &format!("the {what} of {object}"));
        let (min, max) = match table {
            BoxTable { min: Some(min), max: Some(max), center: None, size: None, .. } => {
                (get(min, "min")?, get(max, "max")?)
            }
            BoxTable { min: None, max: None, center: Some(center), size: Some(size), .. } => {
                let (center, size) = (get(center, "center")?, get(size, "size")?);
                (center - size * 0.5, center + size * 0.5)
            }
            _ => {
                let fault = format!("{object} needs either `min` and `max` or `center` and `size`");
                return Err(self.source.fault(span, fault));
            }
        };
        if !min.cmplt(max).all() {
            let fault = format!("{object} has no volume; make it larger than 0 along every axis");
            return Err(self.source.fault(span, fault));
        }
        let material = self.material(&table.material, &object)?;
        let mut mesh = shapes::cuboid(min, max, material);
        if self.is_textured(material) {
            shapes::unfold(&mut mesh);
        }
        if table.inward.unwrap_or(false) {
            transform::flip(&mut mesh);
        }
        if let Some(map) = &table.transform {
            self.apply(map, &mut mesh, &object)?;
        }
        if (0..12).any(|t| !has_area(mesh.corners(t))) {
            let fault = format!("{object} is too thin for single precision; make it thicker");
            return Err(self.source.fault(span, fault));
        }
        let source = self.source;
        meshes::admit(self, &mut mesh, &|text| {
            source.warning(span.clone(), format!("{object}: {text}"))
        });
        self.meshes.push((name, mesh));
        Ok(())
    }

    /// Moves a mesh by the transform of its table.
    pub(super) fn apply(
        &self,
        table: &Spanned<TransformTable>,
        mesh: &mut Mesh,
        object: &str,
    ) -> Result<(), Error> {
        let map = transform::affine(self.source, object, table)?;
        if transform::apply(&map, mesh) {
            return Ok(());
        }
        let fault = format!(
            "the transform of {object} moves it too far away; keep coordinates within {MAX_LENGTH:e}"
        );
        Err(self.source.fault(table.span(), fault))
    }

    pub(super) fn add_sphere(
        &mut self,
        index: usize,
        table: &Spanned<SphereTable>,
    ) -> Result<(), Error> {
        let (span, table) = (table.span(), table.get_ref());
        let name = self.name(&table.name, "sphere", index, span)?;
        let object = format!("sphere `{name}`");
        let center = self.source.vector(&table.center, &format!("the center of {object}"))?;
        let radius = self.source.number(&table.radius, &format!("the radius of {object}"))?;
        if !(radius > 0.0 && radius <= MAX_LENGTH) {
            let fault = format!(
                "the radius of {object} is {radius}; give one above 0 and up to {MAX_LENGTH:e}"
            );
            return Err(self.source.fault(table.radius.span(), fault));
        }
        let material = self.material(&table.material, &object)?;
        self.spheres.push((name, Sphere { center, radius, rotation: Quat::IDENTITY, material }));
        Ok(())
    }

    pub(super) fn add_light(
        &mut self,
        index: usize,
        table: &Spanned<LightTable>,
    ) -> Result<(), Error> {
        let (span, table) = (table.span(), table.get_ref());
        let name = self.name(&table.name, "light", index, span.clone())?;
        let object = format!("light `{name}`");
        let kind = lights::light(self.source, &object, table)?;
        if kind.is_black() {
            let warning = format!("{object} is black and left out");
            self.warnings.push(self.source.warning(span, warning));
        } else {
            self.lights.push(Light { name, kind });
        }
        Ok(())
    }

    pub(super) fn warn_of_unused(&mut self, file: &SceneFile) {
        for (name, table) in &file.textures {
            if !self.used_textures.contains(name) {
                let warning = format!("texture `{name}` is not used");
                self.warnings.push(self.source.warning(table.span(), warning));
            }
        }
        for (name, table) in &file.materials {
            if !self.used.contains(&self.ids[name]) {
                let warning = format!("material `{name}` is not used");
                self.warnings.push(self.source.warning(table.span(), warning));
            }
        }
    }
}
