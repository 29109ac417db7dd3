//! Reading scene files.

mod keys;
mod lights;
mod materials;
mod shapes;
mod source;
mod tables;
mod transform;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;

use geometry::{Bounds, MaterialId, Mesh, Sphere};
use glam::{Vec3, Vec3A};
use toml::Spanned;

use source::{MAX_LENGTH, Source};
use tables::{BoxTable, CameraTable, LightTable, MaterialTable, QuadTable, SceneFile, SphereTable};

use crate::{Camera, Error, FovAxis, Light, LightKind, Material, Parts, Scene, Specular};

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
    let camera = camera(&source, &file.camera)?;
    let mut assembly = Assembly::new(&source);
    assembly.add_materials(&file.materials)?;
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
    let (parts, warnings) = assembly.finish(camera)?;
    Ok(Loaded { scene: Scene::assemble(parts), warnings })
}

fn camera(source: &Source, table: &Spanned<CameraTable>) -> Result<Camera, Error> {
    let table = table.get_ref();
    let origin = source.vector(&table.origin, "the origin of the camera")?;
    let target = source.vector(&table.target, "the target of the camera")?;
    let up = match &table.up {
        Some(up) => source.direction(up, "the up vector of the camera")?.as_vec3(),
        None => Vec3::Y,
    };
    let Some(forward) = (target - origin).try_normalize() else {
        let fault = "target and origin of the camera are the same point; move one";
        return Err(source.fault(table.target.span(), fault));
    };
    if forward.cross(up).length() < 1e-4 {
        let fault = "the camera looks along its up vector; give another `up`, such as [0, 0, 1]";
        let span = table.up.as_ref().map_or(table.target.span(), Spanned::span);
        return Err(source.fault(span, fault));
    }
    let fov = source.number(&table.fov, "the fov of the camera")?;
    // The upper limit is that of the tangent of half of it.
    if !(fov > 0.0 && fov < 179.99) {
        let fault =
            format!("the fov of the camera is {fov}; give degrees between 0 and 180, such as 40");
        return Err(source.fault(table.fov.span(), fault));
    }
    let fov_axis = match table.fov_axis.as_ref().map(|a| (a.get_ref().as_str(), a.span())) {
        None | Some(("x", _)) => FovAxis::X,
        Some(("y", _)) => FovAxis::Y,
        Some(("smaller", _)) => FovAxis::Smaller,
        Some(("larger", _)) => FovAxis::Larger,
        Some((other, span)) => {
            let fault = format!(
                "the fov_axis \"{other}\" is unknown; the axes are x, y, smaller and larger"
            );
            return Err(source.fault(span, fault));
        }
    };
    Ok(Camera::look_at(origin, target, up, fov, fov_axis))
}

/// The parts of a scene as they come in.
struct Assembly<'a> {
    source: &'a Source,
    materials: Vec<Material>,
    ids: BTreeMap<String, MaterialId>,
    used: BTreeSet<MaterialId>,
    meshes: Vec<(String, Mesh)>,
    spheres: Vec<(String, Sphere)>,
    lights: Vec<Light>,
    names: BTreeSet<String>,
    warnings: Vec<String>,
}

impl<'a> Assembly<'a> {
    fn new(source: &'a Source) -> Self {
        Self {
            source,
            materials: Vec::new(),
            ids: BTreeMap::new(),
            used: BTreeSet::new(),
            meshes: Vec::new(),
            spheres: Vec::new(),
            lights: Vec::new(),
            names: BTreeSet::new(),
            warnings: Vec::new(),
        }
    }

    fn add_materials(
        &mut self,
        tables: &BTreeMap<String, Spanned<MaterialTable>>,
    ) -> Result<(), Error> {
        for (name, table) in tables {
            let material =
                materials::material(self.source, name, table.get_ref(), &mut self.warnings)?;
            let id = self.add_material(material).ok_or_else(|| {
                self.source.fault(table.span(), "too many materials; use at most 65536")
            })?;
            self.ids.insert(name.clone(), id);
        }
        Ok(())
    }

    /// `None` when there are too many.
    fn add_material(&mut self, material: Material) -> Option<MaterialId> {
        let id = MaterialId(u16::try_from(self.materials.len()).ok()?);
        self.materials.push(material);
        Some(id)
    }

    /// The material that an object names.
    fn material(&mut self, name: &Spanned<String>, object: &str) -> Result<MaterialId, Error> {
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
    fn name(
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

    fn add_quad(&mut self, index: usize, table: &Spanned<QuadTable>) -> Result<(), Error> {
        let (span, table) = (table.span(), table.get_ref());
        let name = self.name(&table.name, "quad", index, span)?;
        let object = format!("quad `{name}`");
        let corner = self.source.vector(&table.corner, &format!("the corner of {object}"))?;
        let [a, b] = &table.edges;
        let what = format!("an edge of {object}");
        let edges = [self.source.vector(a, &what)?, self.source.vector(b, &what)?];
        let material = self.material(&table.material, &object)?;
        let mesh = shapes::quad(corner, edges, material);
        if (0..2).any(|t| !has_area(mesh.corners(t))) {
            let fault = format!("{object} has no area; give two edges that are not parallel");
            return Err(self.source.fault(table.edges[1].span(), fault));
        }
        self.meshes.push((name, mesh));
        Ok(())
    }

    fn add_box(&mut self, index: usize, table: &Spanned<BoxTable>) -> Result<(), Error> {
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
        if table.inward.unwrap_or(false) {
            transform::flip(&mut mesh);
        }
        if let Some(map) = &table.transform {
            let span = map.span();
            let map = transform::affine(self.source, &object, map)?;
            self.apply(&map, &mut mesh, &object, span)?;
        }
        if (0..12).any(|t| !has_area(mesh.corners(t))) {
            let fault = format!("{object} is too thin for single precision; make it thicker");
            return Err(self.source.fault(span, fault));
        }
        self.meshes.push((name, mesh));
        Ok(())
    }

    fn apply(
        &self,
        map: &glam::DAffine3,
        mesh: &mut Mesh,
        object: &str,
        span: Range<usize>,
    ) -> Result<(), Error> {
        if transform::apply(map, mesh) {
            return Ok(());
        }
        let fault = format!(
            "the transform of {object} moves it too far away; keep coordinates within {MAX_LENGTH:e}"
        );
        Err(self.source.fault(span, fault))
    }

    fn add_sphere(&mut self, index: usize, table: &Spanned<SphereTable>) -> Result<(), Error> {
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
        if !self.materials[usize::from(material.0)].emission.is_black() {
            let fault = format!(
                "{object} has the emissive material \"{}\", but spheres cannot emit; use a mesh",
                table.material.get_ref()
            );
            return Err(self.source.fault(table.material.span(), fault));
        }
        self.spheres.push((name, Sphere { center, radius, material }));
        Ok(())
    }

    fn add_light(&mut self, index: usize, table: &Spanned<LightTable>) -> Result<(), Error> {
        let (span, table) = (table.span(), table.get_ref());
        let name = self.name(&table.name, "light", index, span.clone())?;
        let object = format!("light `{name}`");
        let kind = lights::light(self.source, &object, table)?;
        let color = match &kind {
            LightKind::Area(light) => light.radiance(),
            LightKind::Point { intensity, .. } => *intensity,
            LightKind::Spot(spot) => spot.intensity,
            LightKind::Directional { irradiance, .. } => *irradiance,
            LightKind::Environment { radiance } => *radiance,
        };
        if color.is_black() {
            let warning = format!("{object} is black and left out");
            self.warnings.push(self.source.warning(span, warning));
        } else {
            self.lights.push(Light { name, kind });
        }
        Ok(())
    }

    fn warn_of_unused(&mut self, tables: &BTreeMap<String, Spanned<MaterialTable>>) {
        for (name, table) in tables {
            if !self.used.contains(&self.ids[name]) {
                let warning = format!("material `{name}` is not used");
                self.warnings.push(self.source.warning(table.span(), warning));
            }
        }
    }

    /// Checks that concern the scene as a whole.
    fn finish(self, camera: Camera) -> Result<(Parts, Vec<String>), Error> {
        let Self { source, materials, meshes, spheres, lights, mut warnings, .. } = self;
        let emits = |id: &MaterialId| !materials[usize::from(id.0)].emission.is_black();
        if lights.is_empty() && !meshes.iter().any(|(_, m)| m.materials.iter().any(emits)) {
            let fault = "nothing emits light; add [[lights]] or an emissive material";
            return Err(source.fault_of_whole(fault));
        }
        let bounds = bounds(&meshes, &spheres);
        if bounds.is_empty() {
            let fault =
                "there are no surfaces; add [[meshes]], [[quads]], [[boxes]] or [[spheres]]";
            return Err(source.fault_of_whole(fault));
        }
        let size = bounds.diagonal();
        if size < 1e-6 {
            let fault = format!("the scene is only {size:e} across; use a smaller unit of length");
            return Err(source.fault_of_whole(fault));
        }
        let farthest = bounds.min.abs().max(bounds.max.abs()).max_element();
        if farthest > 1e4 * size {
            warnings.push(
                source
                    .fault_of_whole(format!(
                        "the scene is {size} across but {farthest} away from the origin, where single precision is coarse; move it closer"
                    ))
                    .to_string(),
            );
        }
        for (name, sphere) in &spheres {
            let opaque = !matches!(
                materials[usize::from(sphere.material.0)].specular,
                Specular::Glass { .. }
            );
            let inside = |p: Vec3A| (p - Vec3A::from(sphere.center)).length() < sphere.radius;
            if opaque && inside(camera.origin()) {
                let fault = format!(
                    "the camera is inside the opaque sphere `{name}` and would see nothing; move one of them"
                );
                return Err(source.fault_of_whole(fault));
            }
        }
        Ok((Parts { camera, materials, meshes, spheres, lights }, warnings))
    }
}

/// Whether a triangle has a normal, as the surfaces compute it.
fn has_area([a, b, c]: [Vec3; 3]) -> bool {
    (b - a).cross(c - a).length_squared() >= f32::MIN_POSITIVE
}

fn bounds(meshes: &[(String, Mesh)], spheres: &[(String, Sphere)]) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    for (_, mesh) in meshes {
        mesh.positions.iter().for_each(|&p| bounds.extend(p));
    }
    for (_, sphere) in spheres {
        bounds.extend(sphere.center - sphere.radius);
        bounds.extend(sphere.center + sphere.radius);
    }
    bounds
}
