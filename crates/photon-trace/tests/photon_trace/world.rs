//! Scenes made in code.

use base::{Photon, Rgb, math};
use geometry::{MaterialId, Mesh, Sphere};
use glam::{Quat, Vec3, Vec3A};
use photon_trace::{Budget, Config, Traced};
use scene::{Camera, FovAxis, Light, LightKind, Material, Parts, Scene, Specular, Spot};

/// A scene that is being put together.
#[derive(Default)]
pub(crate) struct World {
    materials: Vec<Material>,
    meshes: Vec<(String, Mesh)>,
    spheres: Vec<(String, Sphere)>,
    lights: Vec<Light>,
}

impl World {
    pub(crate) fn new() -> Self {
        Self::default()
    }

    fn material(&mut self, albedo: Rgb, specular: Specular, emission: Rgb) -> MaterialId {
        let black = Material::black(format!("material {}", self.materials.len()));
        self.materials.push(Material { albedo, specular, emission, ..black });
        MaterialId(self.materials.len() as u16 - 1)
    }

    pub(crate) fn rough(&mut self, specular: Specular, roughness: f32) -> MaterialId {
        let id = self.material(Rgb::BLACK, specular, Rgb::BLACK);
        self.materials[usize::from(id.0)].roughness = roughness;
        id
    }

    pub(crate) fn diffuse(&mut self, albedo: Rgb) -> MaterialId {
        self.material(albedo, Specular::None, Rgb::BLACK)
    }

    /// Diffuse, and there in part only.
    pub(crate) fn thin(&mut self, albedo: Rgb, opacity: f32) -> MaterialId {
        let id = self.diffuse(albedo);
        self.materials[usize::from(id.0)].opacity = opacity;
        id
    }

    pub(crate) fn glowing(&mut self, albedo: Rgb, emission: Rgb) -> MaterialId {
        self.material(albedo, Specular::None, emission)
    }

    pub(crate) fn shiny(&mut self, albedo: Rgb, specular: Specular) -> MaterialId {
        self.material(albedo, specular, Rgb::BLACK)
    }

    pub(crate) fn glass(&mut self, ior: f32, absorption: Rgb) -> MaterialId {
        self.material(Rgb::BLACK, Specular::Glass { ior, absorption }, Rgb::BLACK)
    }

    fn mesh(mut self, positions: Vec<Vec3>, quads: &[[u32; 4]], material: MaterialId) -> Self {
        let triangles: Vec<[u32; 3]> =
            quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let materials = vec![material; triangles.len()];
        let mesh = Mesh { positions, triangles, materials, ..Mesh::default() };
        self.meshes.push((format!("mesh {}", self.meshes.len()), mesh));
        self
    }

    /// A parallelogram; its front is where `a x b` points.
    pub(crate) fn quad(self, corner: Vec3, a: Vec3, b: Vec3, material: MaterialId) -> Self {
        self.mesh(vec![corner, corner + a, corner + a + b, corner + b], &[[0, 1, 2, 3]], material)
    }

    fn cuboid(self, min: Vec3, max: Vec3, quads: &[[u32; 4]; 6], material: MaterialId) -> Self {
        let corner = |i: usize| {
            let pick =
                |bit: usize, axis: usize| if i >> bit & 1 == 0 { min[axis] } else { max[axis] };
            Vec3::new(pick(0, 0), pick(1, 1), pick(2, 2))
        };
        self.mesh((0..8).map(corner).collect(), quads, material)
    }

    /// A box whose front is inside.
    pub(crate) fn room(self, min: Vec3, max: Vec3, material: MaterialId) -> Self {
        self.cuboid(min, max, &OUTWARD.map(|[a, b, c, d]| [d, c, b, a]), material)
    }

    /// A box whose front is outside.
    pub(crate) fn block(self, min: Vec3, max: Vec3, material: MaterialId) -> Self {
        self.cuboid(min, max, &OUTWARD, material)
    }

    pub(crate) fn sphere(mut self, center: Vec3, radius: f32, material: MaterialId) -> Self {
        let sphere = Sphere { center, radius, rotation: Quat::IDENTITY, material };
        self.spheres.push((format!("sphere {}", self.spheres.len()), sphere));
        self
    }

    pub(crate) fn light(mut self, kind: LightKind) -> Self {
        self.lights.push(Light { name: format!("light {}", self.lights.len()), kind });
        self
    }

    /// Parallel light downwards, of irradiance 1.
    pub(crate) fn beam(self) -> Self {
        self.light(LightKind::Directional { direction: -Vec3A::Z, irradiance: Rgb::ONE })
    }

    /// A spot straight down, into a cone of so many degrees around its axis.
    pub(crate) fn beam_from(self, position: Vec3, degrees: f32) -> Self {
        let cos = math::sin_cos(degrees.to_radians()).1;
        self.light(LightKind::Spot(Spot {
            position: position.into(),
            direction: -Vec3A::Z,
            intensity: Rgb::ONE,
            cos_outer: cos,
            cos_inner: cos,
        }))
    }

    pub(crate) fn assemble(self) -> Scene {
        let camera = Camera::look_at(Vec3::ZERO, Vec3::X, Vec3::Z, 50.0, FovAxis::X);
        let Self { materials, meshes, spheres, lights } = self;
        Scene::assemble(Parts { camera, materials, textures: Vec::new(), meshes, spheres, lights })
    }
}

/// The faces of a box, counterclockwise from outside; bits of a corner tell the side along x, y and z.
const OUTWARD: [[u32; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// All photons of a scene, *direct* ones included; almost no path is cut.
pub(crate) fn trace(scene: &Scene, n: u64, seed: u64) -> Traced {
    let budget = Budget::Total(n);
    let config = Config { budget, seed, max_bounces: 10_000, store_direct: true, aim: 0.0 };
    photon_trace::trace(scene, &config, &|_| true).expect("nobody stops it")
}

/// The sum of the flux of photons, by channel.
pub(crate) fn flux<'a>(photons: impl IntoIterator<Item = &'a Photon>) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for photon in photons {
        let flux = photon.flux.to_array();
        (0..3).for_each(|c| sum[c] += f64::from(flux[c]));
    }
    sum
}

/// Whether the share `k` of `n` is likely if each of the `n` has the probability `p`.
pub(crate) fn assert_share(k: usize, n: usize, p: f64, what: &str) {
    let n = n as f64;
    let (share, sigma) = (k as f64 / n, (p * (1.0 - p) / n).sqrt());
    assert!((share - p).abs() < 3.5 * sigma, "{what}: {share:.5} +- {sigma:.5}, not {p:.5}");
}
