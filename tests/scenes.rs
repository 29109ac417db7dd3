//! Scenes made by code, for tests.

use base::Rgb;
use geometry::{MaterialId, Mesh, Sphere};
use glam::{Quat, Vec3};
use scene::{Camera, FovAxis, Light, LightKind, Material, Parts, Specular};

/// Nothing yet, seen from `eye` towards `target`; the field of view, in degrees, spans the height.
pub(crate) fn empty(eye: Vec3, target: Vec3, fov: f32) -> Parts {
    let up = if (target - eye).normalize().y.abs() > 0.99 { Vec3::Z } else { Vec3::Y };
    Parts {
        camera: Camera::look_at(eye, target, up, fov, FovAxis::Y),
        materials: Vec::new(),
        meshes: Vec::new(),
        textures: Vec::new(),
        spheres: Vec::new(),
        lights: Vec::new(),
    }
}

/// A material that does nothing, to be filled in.
pub(crate) fn black() -> Material {
    Material::black("")
}

/// A material that reflects diffusely.
pub(crate) fn diffuse(albedo: Rgb) -> Material {
    Material { albedo, ..black() }
}

/// A material that emits.
pub(crate) fn emissive(emission: Rgb) -> Material {
    Material { emission, ..black() }
}

/// A mirror of the same reflectance in every channel.
pub(crate) fn mirror(reflectance: f32) -> Material {
    Material { specular: Specular::Mirror { reflectance: Rgb::splat(reflectance) }, ..black() }
}

/// Clear glass.
pub(crate) fn glass(ior: f32) -> Material {
    Material { specular: Specular::Glass { ior, absorption: Rgb::BLACK }, ..black() }
}

/// A pane of glass.
pub(crate) fn pane(ior: f32) -> Material {
    Material { specular: Specular::Pane { ior }, ..black() }
}

/// Adds a material.
pub(crate) fn add_material(parts: &mut Parts, material: Material) -> MaterialId {
    let name = format!("material {}", parts.materials.len());
    parts.materials.push(Material { name, ..material });
    MaterialId(parts.materials.len() as u16 - 1)
}

/// Adds a mesh of one material.
pub(crate) fn add_mesh(parts: &mut Parts, mesh: Mesh, material: Material) {
    let id = add_material(parts, material);
    let materials = vec![id; mesh.triangles.len()];
    parts.meshes.push((format!("mesh {}", parts.meshes.len()), Mesh { materials, ..mesh }));
}

/// Adds a sphere.
pub(crate) fn add_sphere(parts: &mut Parts, center: Vec3, radius: f32, material: Material) {
    let material = add_material(parts, material);
    let name = format!("sphere {}", parts.spheres.len());
    parts.spheres.push((name, Sphere { center, radius, rotation: Quat::IDENTITY, material }));
}

/// Adds a light that isn't a surface.
pub(crate) fn add_light(parts: &mut Parts, kind: LightKind) {
    parts.lights.push(Light { name: format!("light {}", parts.lights.len()), kind });
}

/// A parallelogram; its front looks along `a x b`.
pub(crate) fn quad(corner: Vec3, a: Vec3, b: Vec3) -> Mesh {
    Mesh {
        positions: vec![corner, corner + a, corner + a + b, corner + b],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// A box with its fronts outside.
pub(crate) fn cuboid(min: Vec3, max: Vec3) -> Mesh {
    let size = max - min;
    let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| axis * size);
    let faces =
        [(min, z, y), (min, x, z), (min, y, x), (max, -y, -z), (max, -z, -x), (max, -x, -y)];
    let mut mesh = Mesh::default();
    for (corner, a, b) in faces {
        let face = quad(corner, a, b);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(face.positions);
        mesh.triangles.extend(face.triangles.iter().map(|t| t.map(|i| i + first)));
    }
    mesh
}

/// A ball made of flat triangles with their fronts outside: a stack of rings between two poles.
pub(crate) fn faceted_ball(center: Vec3, radius: f32, n_rings: u32) -> Mesh {
    let n_around = 2 * n_rings;
    let mut mesh = Mesh::default();
    for ring in 0..=n_rings {
        for i in 0..n_around {
            let theta = std::f64::consts::PI * f64::from(ring) / f64::from(n_rings);
            let phi = std::f64::consts::PI * f64::from(i) / f64::from(n_rings);
            let [x, y, z] = [theta.sin() * phi.cos(), theta.cos(), -theta.sin() * phi.sin()];
            mesh.positions.push(center + Vec3::new(x as f32, y as f32, z as f32) * radius);
        }
    }
    for ring in 0..n_rings {
        for i in 0..n_around {
            let at = |ring: u32, i: u32| ring * n_around + i % n_around;
            let (a, b) = (at(ring, i), at(ring, i + 1));
            let (c, d) = (at(ring + 1, i), at(ring + 1, i + 1));
            if ring > 0 {
                mesh.triangles.push([a, c, b]);
            }
            if ring + 1 < n_rings {
                mesh.triangles.push([b, c, d]);
            }
        }
    }
    mesh
}

/// The same with interpolated normals: those of a sphere.
pub(crate) fn smooth_ball(center: Vec3, radius: f32, n_rings: u32) -> Mesh {
    let ball = faceted_ball(center, radius, n_rings);
    let normals = ball.positions.iter().map(|&p| (p - center).normalize()).collect();
    Mesh { normals, ..ball }
}

/// The same surface with its front on the other side.
pub(crate) fn inside_out(mut mesh: Mesh) -> Mesh {
    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    mesh
}

/// The eye in a closed box all made of one material.
pub(crate) fn furnace(material: Material) -> Parts {
    let mut parts = empty(Vec3::new(0.3, -0.2, 0.4), Vec3::new(-0.5, 0.1, -1.0), 70.0);
    add_mesh(&mut parts, inside_out(cuboid(-Vec3::ONE, Vec3::ONE)), material);
    parts
}

/// A room of 2 x 2 x 2 around (0, 1, 0), open to the eye, with a red and a green wall and, below the middle of the
/// ceiling, a square lamp of radiance 10.
pub(crate) fn room(lamp_side: f32) -> Parts {
    let mut parts = empty(Vec3::new(0.0, 1.0, 4.0), Vec3::Y, 38.0);
    let (x, y, z) = (Vec3::X * 2.0, Vec3::Y * 2.0, Vec3::Z * 2.0);
    let (low, high) = (Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    let white = diffuse(Rgb::splat(0.74));
    add_mesh(&mut parts, quad(low, z, x), white.clone());
    add_mesh(&mut parts, quad(low, x, y), white.clone());
    add_mesh(&mut parts, quad(high, -x, -z), white);
    add_mesh(&mut parts, quad(low, y, z), diffuse(Rgb::new(0.63, 0.06, 0.05)));
    add_mesh(&mut parts, quad(high, -z, -y), diffuse(Rgb::new(0.14, 0.45, 0.09)));
    let corner = Vec3::new(0.5 * lamp_side, 1.99, 0.5 * lamp_side);
    let lamp = quad(corner, -Vec3::X * lamp_side, -Vec3::Z * lamp_side);
    add_mesh(&mut parts, lamp, emissive(Rgb::splat(10.0)));
    parts
}
