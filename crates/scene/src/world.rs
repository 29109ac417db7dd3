//! A scene put together.

use std::sync::Arc;

use base::{Fingerprint, FingerprintBuilder, Inventory, Ray, Rgb, hash_u64};
use geometry::{Accel, Bounds, Creases, Frustum, MaterialId, Memory, Mesh, Sphere, Surface};
use glam::{Quat, Vec2, Vec3A};

use crate::{
    AreaLight, Camera, Light, LightKind, Material, Specular, SphereLight, Texture, TextureId,
};

/// What a scene is made of, named as in its file. The reader of scene files has checked it all.
#[derive(Clone, Debug)]
pub struct Parts {
    /// The view.
    pub camera: Camera,
    /// Indexed by [`geometry::MaterialId`].
    pub materials: Vec<Material>,
    /// Named textures, indexed by [`crate::TextureId`].
    pub textures: Vec<(String, Texture)>,
    /// Named meshes. Those whose material emits become lights, as do spheres.
    pub meshes: Vec<(String, Mesh)>,
    /// Named spheres.
    pub spheres: Vec<(String, Sphere)>,
    /// Lights that aren't surfaces.
    pub lights: Vec<Light>,
}

impl Parts {
    /// What the surfaces of the scene take beside these parts.
    pub fn memory(&self) -> Memory {
        let spheres: Vec<Sphere> = self.spheres.iter().map(|(_, sphere)| *sphere).collect();
        Memory::of(self.meshes.iter().map(|(_, mesh)| mesh), &spheres)
    }
}

/// A scene, ready to be rendered.
#[derive(Debug)]
pub struct Scene {
    /// All surfaces.
    pub accel: Accel,
    /// Where diffuse surfaces end.
    pub creases: Creases,
    /// Where mirrors and metals end that hide what is behind them, and are hit by no photon that is stored.
    pub screens: Creases,
    /// Indexed by [`geometry::MaterialId`].
    pub materials: Vec<Material>,
    textures: Vec<Arc<Texture>>,
    /// All lights: emissive meshes first, then spheres, then the others.
    pub lights: Vec<Light>,
    /// The view.
    pub camera: Camera,
    /// Whether any material has an opacity.
    is_masked: bool,
    /// For each area light the object and the material that it is.
    emitters: Vec<(u32, MaterialId)>,
    inventory: Inventory,
}

impl Scene {
    /// Builds the BVH, finds the emissive meshes, and digests everything that light transport depends on.
    pub fn assemble(parts: Parts) -> Self {
        let inventory = inventory(&parts);
        let Parts { camera, materials, textures, meshes, spheres, lights } = parts;
        let textures: Vec<_> = textures.into_iter().map(|(_, texture)| Arc::new(texture)).collect();
        let of_meshes = area_lights(&meshes, &materials, &textures);
        let of_spheres = sphere_lights(&spheres, meshes.len(), &materials, &textures);
        let (emitters, mut all_lights): (Vec<_>, Vec<_>) =
            of_meshes.into_iter().chain(of_spheres).unzip();
        all_lights.extend(lights);
        let meshes: Vec<Mesh> = meshes.into_iter().map(|(_, mesh)| mesh).collect();
        let spheres: Vec<Sphere> = spheres.into_iter().map(|(_, sphere)| sphere).collect();
        let is_masked = materials.iter().any(Material::is_masked);
        Self {
            accel: Accel::build(&meshes, &spheres),
            creases: Creases::find(&meshes, |id| materials[id.0 as usize].is_diffuse()),
            screens: Creases::find(&meshes, |id| materials[id.0 as usize].is_screen()),
            materials,
            textures,
            lights: all_lights,
            camera,
            is_masked,
            emitters,
            inventory,
        }
    }

    /// Whether any material has an opacity, so that rays may pass what they meet.
    pub fn is_masked(&self) -> bool {
        self.is_masked
    }

    /// What a surface is made of.
    #[inline]
    pub fn material(&self, surface: &Surface) -> &Material {
        &self.materials[surface.material.0 as usize]
    }

    /// What a triangle or sphere is made of that a surface has named.
    #[inline]
    pub fn material_of(&self, primitive: u32) -> &Material {
        &self.materials[self.accel.material_of(primitive).0 as usize]
    }

    /// The surface where a ray arrives, and after what distance.
    ///
    /// Surfaces of an opacity between 0 and 1 stop a ray or let it pass by chance; the bits of the ray, the place and the seed
    /// decide, so that the same ray always arrives at the same surface.
    #[inline]
    pub fn arrive(&self, ray: &Ray, seed: u64) -> Option<(Surface, f32)> {
        let (surface, distance) = self.accel.closest_surface(ray)?;
        if !self.is_masked || !self.material(&surface).is_masked() {
            return Some((surface, distance));
        }
        self.arrive_by_chance(ray, seed, surface, distance)
    }

    fn arrive_by_chance(
        &self,
        ray: &Ray,
        seed: u64,
        mut surface: Surface,
        mut distance: f32,
    ) -> Option<(Surface, f32)> {
        let bits = |v: Vec3A| v.to_array().map(|x| u64::from(x.to_bits()));
        let bits = bits(ray.origin()).into_iter().chain(bits(ray.dir()));
        let mut bits = bits.fold(seed, hash_u64);
        loop {
            let opacity = self.opacity(&surface);
            bits = hash_u64(bits, u64::from(surface.primitive));
            let chance = (bits >> 40) as f32 * (1.0 / 16_777_216.0);
            if chance < opacity {
                return Some((surface, distance));
            }
            let rest = beyond(ray, &surface, distance);
            let (next, further) = self.accel.closest_surface(&rest)?;
            (surface, distance) = (next, distance + further);
        }
    }

    /// The rays from a point between four directions, one after the other around them, if surely all that meet a triangle
    /// arrive there.
    pub fn frustum(&self, origin: Vec3A, dirs: [Vec3A; 4], triangle: u32) -> Option<Frustum> {
        if self.material_of(triangle).is_masked() {
            return None;
        }
        self.accel.frustum(origin, dirs, triangle)
    }

    /// The part of light along a ray that nothing stops: 0 or 1, unless there are surfaces of an opacity between.
    #[inline]
    pub fn passing(&self, ray: &Ray) -> f32 {
        if !self.accel.occluded(ray) {
            1.0
        } else if self.is_masked {
            self.passing_masks(ray)
        } else {
            0.0
        }
    }

    fn passing_masks(&self, ray: &Ray) -> f32 {
        let (mut rest, mut distance, mut passing) = (*ray, 0.0, 1.0);
        while let Some(hit) = self.accel.closest_hit(&rest) {
            let surface = self.accel.surface(&rest, &hit);
            passing *= 1.0 - self.opacity(&surface);
            distance += hit.t;
            if passing <= 0.0 {
                return 0.0;
            }
            rest = beyond(ray, &surface, distance);
        }
        passing
    }

    /// The part of a surface that is there, in [0, 1].
    pub fn opacity(&self, surface: &Surface) -> f32 {
        let material = self.material(surface);
        match material.opacity_texture {
            None => material.opacity,
            Some(id) => (material.opacity * self.texel(id, surface).mean()).clamp(0.0, 1.0),
        }
    }

    /// Diffuse albedo of a surface that the rays of this scene have found, in [0, 1], for light from all sides towards all
    /// sides. A coat included, whose angles [`Material::passage`] tells.
    #[inline]
    pub fn albedo(&self, surface: &Surface) -> Rgb {
        let material = self.material(surface);
        let albedo = match material.albedo_texture {
            None => material.albedo,
            Some(id) => material.albedo * self.texel(id, surface),
        };
        match &material.specular {
            Specular::Coat(coat) => coat.albedo(albedo),
            _ => albedo,
        }
    }

    /// The same as seen from the unit direction `w_o`: radiance reflected, for an irradiance of pi.
    #[inline]
    pub fn albedo_from(&self, surface: &Surface, w_o: Vec3A) -> Rgb {
        let albedo = self.albedo(surface);
        let material = self.material(surface);
        match material.is_coated() {
            true => albedo * material.passage(surface.facing(w_o).shading_normal.dot(w_o)),
            false => albedo,
        }
    }

    /// Radiance that a surface which the rays of this scene have found emits towards `w_o`, `L_e` of Eq. (4).
    #[inline]
    pub fn emitted(&self, surface: &Surface, w_o: Vec3A) -> Rgb {
        let material = self.material(surface);
        if material.emission.is_black() || w_o.dot(surface.geometric_normal) <= 0.0 {
            return Rgb::BLACK;
        }
        match material.emission_texture {
            None => material.emission,
            Some(id) => material.emission * self.texel(id, surface),
        }
    }

    fn texel(&self, id: TextureId, surface: &Surface) -> Rgb {
        self.textures[usize::from(id.0)].at(self.accel.uv(surface).unwrap_or_default())
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

/// What is left of a ray behind a surface at a distance.
fn beyond(ray: &Ray, surface: &Surface, distance: f32) -> Ray {
    let rest = (ray.t_max() - distance).max(0.0);
    Ray::new(surface.leave(ray.dir()), ray.dir(), rest)
}

/// One light for each mesh and each of its materials that emit, in this order.
fn area_lights(
    meshes: &[(String, Mesh)],
    materials: &[Material],
    textures: &[Arc<Texture>],
) -> Vec<((u32, MaterialId), Light)> {
    let mut lights = Vec::new();
    for (object, (name, mesh)) in (0..).zip(meshes) {
        let mut ids = mesh.materials.clone();
        ids.sort_unstable();
        ids.dedup();
        for id in ids.into_iter().filter(|id| !materials[id.0 as usize].emission.is_black()) {
            let triangles: Vec<_> =
                (0..mesh.triangles.len()).filter(|&t| mesh.materials[t] == id).collect();
            let material = &materials[usize::from(id.0)];
            let light = match material.emission_texture {
                None => {
                    let corners: Vec<_> = triangles.into_iter().map(|t| mesh.corners(t)).collect();
                    AreaLight::new(&corners, material.emission)
                }
                Some(texture) => {
                    let uv = |i: u32| mesh.uvs.get(i as usize).copied().unwrap_or(Vec2::ZERO);
                    let of = |t: usize| (mesh.corners(t), mesh.triangles[t].map(uv));
                    let triangles: Vec<_> = triangles.into_iter().map(of).collect();
                    let texture = textures[usize::from(texture.0)].clone();
                    AreaLight::textured(&triangles, material.emission, texture)
                }
            };
            let light = Light { name: name.clone(), kind: LightKind::Area(light) };
            lights.push(((object, id), light));
        }
    }
    lights
}

/// One light for each sphere that emits, in this order; objects are counted from `first`.
fn sphere_lights(
    spheres: &[(String, Sphere)],
    first: usize,
    materials: &[Material],
    textures: &[Arc<Texture>],
) -> Vec<((u32, MaterialId), Light)> {
    let mut lights = Vec::new();
    for (object, (name, sphere)) in (first as u32..).zip(spheres) {
        let material = &materials[usize::from(sphere.material.0)];
        if !material.emission.is_black() {
            let texture = material.emission_texture.map(|id| textures[usize::from(id.0)].clone());
            let light = SphereLight::new(sphere, material.emission, texture);
            let light = Light { name: name.clone(), kind: LightKind::Sphere(light) };
            lights.push(((object, sphere.material), light));
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
    if let Some(id) = material.emission_texture {
        digest.bytes(b"emission texture").pod(&[id.0]);
    }
    match material.specular {
        Specular::None => digest.bytes(b"none"),
        Specular::Mirror { reflectance } => digest.bytes(b"mirror").pod(&[reflectance]),
        Specular::Metal { eta, k } => digest.bytes(b"metal").pod(&[eta, k]),
        Specular::Glass { ior, absorption } => {
            digest.bytes(b"glass").pod(&[ior]).pod(&[absorption])
        }
        Specular::Pane { ior } => digest.bytes(b"pane").pod(&[ior]),
        Specular::Coat(coat) => digest
            .bytes(b"coat")
            .pod(&[coat.ior()])
            .pod(&[coat.reflectance()])
            .pod(&[u8::from(coat.is_nonlinear())]),
    };
    if material.is_masked() {
        let texture = material.opacity_texture.map_or(u32::MAX, |id| u32::from(id.0));
        digest.bytes(b"mask").pod(&[material.opacity]).pod(&[texture]);
    }
    if material.is_rough() {
        digest.bytes(b"rough").pod(&[material.roughness]);
    }
    digest.finish()
}

fn light_digest(light: &Light) -> Fingerprint {
    let mut digest = FingerprintBuilder::new();
    match &light.kind {
        LightKind::Area(light) => {
            digest.bytes(b"area").pod(&[light.mean_radiance()]).pod(&[light.area()])
        }
        LightKind::Sphere(light) => digest.bytes(b"sphere").pod(&[light.flux()]),
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
