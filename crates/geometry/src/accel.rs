//! The BVH over all surfaces of a scene.

use std::time::Duration;

use base::Ray;
use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::RayHit;

use crate::primitive::{Primitive, Shape, ShearedRay};
use crate::{Bounds, MaterialId, Mesh, Sphere, Surface};

/// The nearest place where a ray meets a surface; [`Accel::surface`] tells what is there.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance along the ray, in world units.
    pub t: f32,
    slot: u32,
    v: f32,
    w: f32,
}

/// All surfaces of a scene, ready for rays.
///
/// Inside, the scene is scaled by a power of two to a size of about 4096: obvhs skips boxes that end within 1e-4 of
/// the ray's origin, which at this size is below the resolution of single precision. Powers of two change no digit.
pub struct Accel {
    bvh: CwBvh,
    /// In the order of the leaves, in scaled units.
    primitives: Vec<Primitive>,
    /// Material and object of each triangle, then of each sphere.
    owners: Vec<(MaterialId, u32)>,
    n_triangles: u32,
    /// Shading normals of the corners of each triangle; empty when no mesh has any.
    normals: Vec<[Vec3; 3]>,
    scale: f32,
    bounds: Bounds,
}

impl std::fmt::Debug for Accel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Accel")
            .field("primitives", &self.primitives.len())
            .field("nodes", &self.bvh.nodes.len())
            .field("bounds", &self.bounds)
            .finish_non_exhaustive()
    }
}

struct BoundedPrimitive(Aabb);

impl obvhs::Boundable for BoundedPrimitive {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Accel {
    /// Builds the BVH in rayon's current pool; the result doesn't depend on the number of threads.
    ///
    /// An empty scene is allowed and never hit. Thousands of triangles stacked on one spot make the build slow and
    /// deep: the reader of scenes refuses them.
    pub fn build(meshes: &[Mesh], spheres: &[Sphere]) -> Self {
        let mut bounds = Bounds::EMPTY;
        for mesh in meshes {
            let b = mesh.bounds();
            if !b.is_empty() {
                bounds.extend(b.min);
                bounds.extend(b.max);
            }
        }
        for s in spheres {
            bounds.extend(s.center - s.radius);
            bounds.extend(s.center + s.radius);
        }
        let scale = power_of_two_scale(bounds.diagonal());

        let has_normals = meshes.iter().any(|m| !m.normals.is_empty());
        let (mut primitives, mut owners, mut normals) = (Vec::new(), Vec::new(), Vec::new());
        for (object, mesh) in meshes.iter().enumerate() {
            for (t, indices) in mesh.triangles.iter().enumerate() {
                primitives.push(Primitive::triangle(
                    mesh.corners(t).map(|p| p * scale),
                    owners.len() as u32,
                ));
                owners.push((mesh.materials[t], object as u32));
                if has_normals {
                    normals.push(match mesh.normals.is_empty() {
                        true => [Vec3::ZERO; 3],
                        false => indices.map(|i| mesh.normals[i as usize]),
                    });
                }
            }
        }
        let n_triangles = owners.len() as u32;
        for (i, s) in spheres.iter().enumerate() {
            primitives.push(Primitive::sphere(s.center * scale, s.radius * scale, i as u32));
            owners.push((s.material, (meshes.len() + i) as u32));
        }

        // Slab tests round; boxes that are a little too large keep rays aimed at edges and corners from slipping out.
        let largest =
            bounds.min.abs().max(bounds.max.abs()).max_element().max(bounds.diagonal()) * scale;
        let margin = if primitives.is_empty() { 0.0 } else { largest * 2.0_f32.powi(-21) };
        let boxes: Vec<_> = primitives.iter().map(|p| BoundedPrimitive(p.aabb(margin))).collect();
        let bvh = build_cwbvh(&boxes, BvhBuildParams::medium_build(), &mut Duration::default());
        let primitives = bvh.primitive_indices.iter().map(|&i| primitives[i as usize]).collect();
        Self { bvh, primitives, owners, n_triangles, normals, scale, bounds }
    }

    /// The nearest surface that the ray meets.
    #[inline]
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let (scaled, sheared) = self.prepare(ray);
        let mut nearest = RayHit::none();
        let (mut v, mut w) = (0.0, 0.0);
        let found = self.bvh.ray_traverse(scaled, &mut nearest, |ray, slot| {
            match self.primitives[slot].intersect(&sheared, ray.tmax) {
                Some((t, hit_v, hit_w)) => {
                    (v, w) = (hit_v, hit_w);
                    t
                }
                None => f32::INFINITY,
            }
        });
        found.then(|| Hit { t: nearest.t / self.scale, slot: nearest.primitive_id, v, w })
    }

    /// Whether anything lies on the ray before its end.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        let (scaled, sheared) = self.prepare(ray);
        !self.bvh.ray_traverse_miss(scaled, |ray, slot| {
            self.primitives[slot].intersect(&sheared, ray.tmax).map_or(f32::INFINITY, |(t, ..)| t)
        })
    }

    #[inline]
    fn prepare(&self, ray: &Ray) -> (obvhs::ray::Ray, ShearedRay) {
        let origin = ray.origin() * self.scale;
        (
            obvhs::ray::Ray::new(origin, ray.dir(), 0.0, ray.t_max() * self.scale),
            ShearedRay::new(origin, ray.dir()),
        )
    }

    /// What lies at a hit of `ray`.
    #[inline]
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        let primitive = &self.primitives[hit.slot as usize];
        let inverse_scale = 1.0 / self.scale;
        // Bounds eight roundings of the largest number that goes into the position and into a later test of the surface.
        let error_of = |normal: Vec3A, largest: Vec3A| {
            normal.abs().dot(largest) * (8.0 * f32::EPSILON * inverse_scale)
        };
        match primitive.shape() {
            Shape::Triangle { id } => {
                let [a, b, c] = primitive.corners().map(Vec3A::from);
                let u = 1.0 - hit.v - hit.w;
                let geometric_normal = (b - a).cross(c - a).normalize();
                let mut shading_normal = geometric_normal;
                if let Some(&[na, nb, nc]) = self.normals.get(id as usize) {
                    let n = Vec3A::from(na * u + nb * hit.v + nc * hit.w);
                    let n = n * n.dot(geometric_normal).signum();
                    // Interpolated normals that lie in the surface or vanish are of no use.
                    if n.dot(geometric_normal) > 1e-3 * n.length() {
                        shading_normal = n.normalize();
                    }
                }
                let (material, object) = self.owners[id as usize];
                let largest = a.abs().max(b.abs()).max(c.abs());
                Surface {
                    position: (a * u + b * hit.v + c * hit.w) * inverse_scale,
                    geometric_normal,
                    shading_normal,
                    material,
                    object,
                    error: error_of(geometric_normal, largest),
                }
            }
            Shape::Sphere { id, center, radius } => {
                let center = Vec3A::from(center);
                let normal = (ray.at(hit.t) * self.scale - center).normalize();
                let (material, object) = self.owners[(self.n_triangles + id) as usize];
                Surface {
                    position: (center + normal * radius) * inverse_scale,
                    geometric_normal: normal,
                    shading_normal: normal,
                    material,
                    object,
                    error: error_of(normal, center.abs() + radius),
                }
            }
        }
    }

    /// The box around everything.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Triangles and spheres.
    pub fn n_primitives(&self) -> usize {
        self.primitives.len()
    }
}

/// The power of two that brings `size` into [2048, 4096).
fn power_of_two_scale(size: f32) -> f32 {
    if size.is_normal() {
        2.0_f32.powi((11 - size.log2().floor() as i32).clamp(-120, 120))
    } else {
        1.0
    }
}
