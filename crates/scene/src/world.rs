//! A scene put together.

use base::{Fingerprint, FingerprintBuilder, Inventory, Rgb};
use geometry::{Accel, Bounds, Creases, MaterialId, Mesh, Sphere, Surface};
use glam::{Quat, Vec3A};

use crate::{AreaLight, Camera, Light, LightKind, Material, Specular, Texture};

/// What a scene is made of, named as in its file. The reader of scene files has checked it all.
#[derive(Clone, Debug)]
pub struct Parts {
    /// The view.
    pub camera: Camera,
    /// Indexed by [`geometry::MaterialId`].
    pub materials: Vec<Material>,
    /// Named textures, indexed by [`crate::TextureId`].
    pub textures: Vec<(String, Texture)>,
    /// Named meshes. Those whose material emits become lights.
    pub meshes: Vec<(String, Mesh)>,
    /// Named spheres; none emits.
    pub spheres: Vec<(String, Sphere)>,
    /// Lights that aren't surfaces.
    pub lights: Vec<Light>,
}

/// A scene, ready to be rendered.
#[derive(Debug)]
pub struct Scene {
    /// All surfaces.
    pub accel: Accel,
    /// Where diffuse surfaces end.
    pub creases: Creases,
    /// Indexed by [`geometry::MaterialId`].
    pub materials: Vec<Material>,
    textures: Vec<Texture>,
    /// All lights: emissive meshes first, then the others.
    pub lights: Vec<Light>,
    /// The view.
    pub camera: Camera,
    /// For each area light the object and the material that it is.
    emitters: Vec<(u32, MaterialId)>,
    inventory: Inventory,
}

impl Scene {
    /// Builds the BVH, finds the emissive meshes, and digests everything that light transport depends on.
    pub fn assemble(parts: Parts) -> Self {
        let inventory = inventory(&parts);
        let Parts { camera, materials, textures, meshes, spheres, lights } = parts;
        let (emitters, mut all_lights): (Vec<_>, Vec<_>) =
            area_lights(&meshes, &materials).into_iter().unzip();
        all_lights.extend(lights);
        let meshes: Vec<Mesh> = meshes.into_iter().map(|(_, mesh)| mesh).collect();
        let spheres: Vec<Sphere> = spheres.into_iter().map(|(_, sphere)| sphere).collect();
        Self {
            accel: Accel::build(&meshes, &spheres),
            creases: Creases::find(&meshes, |id| materials[id.0 as usize].is_diffuse()),
            materials,
            textures: textures.into_iter().map(|(_, texture)| texture).collect(),
            lights: all_lights,
            camera,
            emitters,
            inventory,
        }
    }

    /// What a surface is made of.
    #[inline]
    pub fn material(&self, surface: &Surface) -> &Material {
        &self.materials[surface.material.0 as usize]
    }

    /// Diffuse albedo of a surface that the rays of this scene have found, in [0, 1].
    #[inline]
    pub fn albedo(&self, surface: &Surface) -> Rgb {
        let material = self.material(surface);
        match material.albedo_texture {
            None => material.albedo,
            Some(id) => {
                let uv = self.accel.uv(surface).unwrap_or_default();
                material.albedo * self.textures[id.0 as usize].at(uv)
            }
        }
    }

    /// The number of the area light that a surface is.
    pub fn light_of(&self, surface: &Surface) -> Option<usize> {
        self.emitters.binary_search(&(surface.object, surface.material)).ok()
    }

    /// The box around all surfaces.
    pub fn bounds(&self) -> Bounds {
        self.accel.bounds()
    }

    /// Radiance that arrives from beyond the scene, in a direction out of it.
    pub fn background(&self, dir: Vec3A) -> Rgb {
        self.lights.iter().map(|light| light.from_beyond(dir).0).sum()
    }

    /// The parts that photons depend on, each with its digest: surfaces, materials and lights, but not the camera.
    pub fn inventory(&self) -> &Inventory {
        &self.inventory
    }

    /// A digest of the view.
    pub fn view_fingerprint(&self) -> Fingerprint {
        self.camera.fingerprint()
    }
}

/// One light for each mesh and each of its materials that emit, in this order.
fn area_lights(
    meshes: &[(String, Mesh)],
    materials: &[Material],
) -> Vec<((u32, MaterialId), Light)> {
    let mut lights = Vec::new();
    for (object, (name, mesh)) in (0..).zip(meshes) {
        let mut ids = mesh.materials.clone();
        ids.sort_unstable();
        ids.dedup();
        for id in ids.into_iter().filter(|id| !materials[id.0 as usize].emission.is_black()) {
            let triangles: Vec<_> =
                (0..mesh.triangles.len()).filter(|&t| mesh.materials[t] == id).collect();
            let triangles: Vec<_> = triangles.into_iter().map(|t| mesh.corners(t)).collect();
            let light = AreaLight::new(&triangles, materials[id.0 as usize].emission);
            let light = Light { name: name.clone(), kind: LightKind::Area(light) };
            lights.push(((object, id), light));
        }
    }
    lights
}

fn inventory(parts: &Parts) -> Inventory {
    let mut inventory = Inventory::new();
    for material in &parts.materials {
        inventory.add(format!("material `{}`", material.name), material_digest(material));
    }
    for (name, texture) in &parts.textures {
        inventory.add(format!("texture `{name}`"), texture.digest());
    }
    for (name, mesh) in &parts.meshes {
        let mut digest = FingerprintBuilder::new();
        digest.pod(&mesh.positions).pod(&mesh.normals).pod(mesh.triangles.as_flattened());
        digest.pod(&mesh.materials.iter().map(|m| m.0).collect::<Vec<_>>());
        // Not even their number where there are none, so that maps of untextured scenes stay valid.
        if !mesh.uvs.is_empty() {
            digest.pod(&mesh.uvs);
        }
        inventory.add(format!("mesh `{name}`"), digest.finish());
    }
    for (name, sphere) in &parts.spheres {
        let mut digest = FingerprintBuilder::new();
        digest.pod(&sphere.center.to_array()).pod(&[sphere.radius]).pod(&[sphere.material.0]);
        if sphere.rotation != Quat::IDENTITY {
            digest.pod(&sphere.rotation.to_array());
        }
        inventory.add(format!("sphere `{name}`"), digest.finish());
    }
    for light in &parts.lights {
        inventory.add(format!("light `{}`", light.name), light_digest(light));
    }
    inventory
}

fn material_digest(material: &Material) -> Fingerprint {
    let mut digest = FingerprintBuilder::new();
    digest.pod(&[material.albedo, material.emission]);
    if let Some(id) = material.albedo_texture {
        digest.bytes(b"albedo texture").pod(&[id.0]);
    }
    match material.specular {
        Specular::None => digest.bytes(b"none"),
        Specular::Mirror { reflectance } => digest.bytes(b"mirror").pod(&[reflectance]),
        Specular::Metal { eta, k } => digest.bytes(b"metal").pod(&[eta, k]),
        Specular::Glass { ior, absorption } => {
            digest.bytes(b"glass").pod(&[ior]).pod(&[absorption])
        }
        Specular::Pane { ior } => digest.bytes(b"pane").pod(&[ior]),
    };
    if material.is_rough() {
        digest.bytes(b"rough").pod(&[material.roughness]);
    }
    digest.finish()
}

fn light_digest(light: &Light) -> Fingerprint {
    let mut digest = FingerprintBuilder::new();
    match &light.kind {
        LightKind::Area(light) => {
            digest.bytes(b"area").pod(&[light.radiance()]).pod(&[light.area()])
        }
        LightKind::Point { position, intensity } => {
            digest.bytes(b"point").pod(&position.to_array()).pod(&[*intensity])
        }
        LightKind::Spot(spot) => digest
            .bytes(b"spot")
            .pod(&spot.position.to_array())
            .pod(&spot.direction.to_array())
            .pod(&[spot.intensity])
            .pod(&[spot.cos_outer, spot.cos_inner]),
        LightKind::Directional { direction, irradiance } => {
            digest.bytes(b"directional").pod(&direction.to_array()).pod(&[*irradiance])
        }
        LightKind::Environment { radiance } => digest.bytes(b"environment").pod(&[*radiance]),
        LightKind::EnvironmentMap(map) => return map.digest(),
    };
    digest.finish()
}
