//! The BVH over all surfaces of a scene.

use base::Ray;
use base::math::{self, FRAC_1_PI};
use glam::{DVec3, Quat, Vec2, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::ploc::PlocBuilder;

use crate::corner_normals::CornerNormals;
use crate::frustum::Facet;
use crate::node::{self, MAX_PRIMITIVES_PER_LEAF, Node};
use crate::primitive::{Owner, Primitive, Shape, ShearedRay};
use crate::shaft::Shaft;
use crate::traverse::{Query, SlabRay};
use crate::{Bounds, Frustum, MaterialId, Mesh, Patch, Sphere, Surface};

/// The nearest place where a ray meets a surface; [`Accel::surface`] tells what is there.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance along the ray, in world units.
    pub t: f32,
    slot: u32,
}

/// All surfaces of a scene, ready for rays.
///
/// Inside, the scene is scaled by a power of two to a size of about 4096, so that products of lengths stay in the range of single
/// precision. Powers of two change no digit.
pub struct Accel {
    /// The first is the root; none if there is nothing.
    nodes: Vec<Node>,
    /// In the order of the leaves, in scaled units.
    primitives: Vec<Primitive>,
    /// Texture coordinates of the corners of each, as the primitives lie, not a number in meshes that have none; empty when no mesh has any.
    uvs: Vec<[Vec2; 3]>,
    /// How each sphere is turned.
    rotations: Vec<Quat>,
    scale: f32,
    /// The sphere around everything, in scaled units.
    center: Vec3A,
    radius: f32,
    bounds: Bounds,
}

impl std::fmt::Debug for Accel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Accel")
            .field("primitives", &self.primitives.len())
            .field("nodes", &self.nodes.len())
            .field("bounds", &self.bounds)
            .finish_non_exhaustive()
    }
}

/// A triangle or sphere that many rays meet: see [`Accel::target`].
#[derive(Clone, Copy, Debug)]
pub struct Target(Kind);

#[derive(Clone, Copy, Debug)]
enum Kind {
    Triangle(Facet),
    Sphere { slot: u32, owner: Owner, center: DVec3, radius: f64 },
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

        // What takes memory is made late: the build takes most, and boxes and owners are all that it needs. See `build_bvh`.
        let n_all = meshes.iter().map(|mesh| mesh.triangles.len()).sum::<usize>() + spheres.len();
        let mut owners = Vec::with_capacity(n_all);
        let mut firsts = Vec::with_capacity(meshes.len());
        for (object, mesh) in meshes.iter().enumerate() {
            firsts.push(owners.len());
            let object = object as u32;
            owners.extend(mesh.materials.iter().map(|&material| Owner { material, object }));
        }
        for (i, s) in spheres.iter().enumerate() {
            owners.push(Owner { material: s.material, object: (meshes.len() + i) as u32 });
        }
        let part = |i: usize| -> Part<'_> {
            let object = owners[i].object as usize;
            match meshes.get(object) {
                Some(mesh) => Ok((mesh, i - firsts[object])),
                None => Err(object - meshes.len()),
            }
        };
        let primitive = |i: usize| match part(i) {
            Ok((mesh, i_in_mesh)) => {
                Primitive::triangle(mesh.corners(i_in_mesh).map(|p| p * scale), owners[i])
            }
            Err(number) => {
                let Sphere { center, radius, .. } = &spheres[number];
                Primitive::sphere(*center * scale, radius * scale, number as u32, owners[i])
            }
        };

        // Slab tests round; boxes that are a little too large keep rays aimed at edges and corners from slipping out.
        // The first term is for differences of up to 2.5 diagonals (see `skipped`), each axis off by five roundings, the
        // second for the coordinates themselves.
        let (center, diagonal) = match bounds.is_empty() {
            true => (Vec3::ZERO, 0.0),
            false => (bounds.center() * scale, bounds.diagonal() * scale),
        };
        let largest = (center.abs() + diagonal).max_element();
        let margin = diagonal * 2.0_f32.powi(-20) + largest * 2.0_f32.powi(-22);
        let mut boxes = Vec::with_capacity(n_all);
        boxes.extend((0..n_all).map(|i| BoundedPrimitive(primitive(i).aabb(margin))));
        let bvh = build_bvh(boxes);
        let slots = || bvh.primitive_indices.iter().map(|&i| i as usize);
        let mut primitives = Vec::with_capacity(n_all);
        let normals = |i: usize| match part(i) {
            Ok((mesh, i_in_mesh)) if !mesh.normals.is_empty() => {
                CornerNormals::new(mesh.of_corners(&mesh.normals, i_in_mesh))
            }
            _ => CornerNormals::default(),
        };
        primitives.extend(slots().map(|i| primitive(i).with_normals(normals(i))));
        let nodes = node::expand(&bvh, |slot| primitives[slot as usize].aabb(margin));
        let uvs = uvs_of(meshes, slots().map(part));
        let (center, radius) = (center.into(), 0.5 * diagonal);
        let rotations = spheres.iter().map(|s| s.rotation).collect();
        Self { nodes, primitives, uvs, rotations, scale, center, radius, bounds }
    }

    /// The nearest surface that the ray meets.
    #[inline]
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let query = self.query(ray);
        let (t, slot) = query.nearest()?;
        Some(Hit { t: ((f64::from(t) + query.skipped) as f32) / self.scale, slot })
    }

    /// Whether anything lies on the ray before its end.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.query(ray).any()
    }

    /// Whether surely no ray from a point of one patch to a point of the other meets anything.
    pub fn is_clear(&self, from: &Patch, to: &Patch) -> bool {
        self.is_empty(&Shaft::new(from, to, self.scale), None)
    }

    /// Whether surely no primitive but one reaches into a shaft.
    fn is_empty(&self, shaft: &Shaft, except: Option<u32>) -> bool {
        // What rounding in single precision may hide.
        let doubt = (self.center.abs().max_element() + 2.0 * self.radius) * 2.0_f32.powi(-18);
        let mut left: Vec<u32> = Vec::with_capacity(64);
        left.extend((!self.nodes.is_empty()).then_some(0));
        while let Some(index) = left.pop() {
            let node = &self.nodes[index as usize];
            let may_hold = shaft.may_hold(&node.min, &node.max, doubt);
            for (&child, _) in node.children.iter().zip(may_hold).filter(|&(_, may_hold)| may_hold)
            {
                if child.n_primitives() == 0 {
                    left.push(child.index());
                    continue;
                }
                let is_in = |slot: u32| {
                    Some(slot) != except
                        && shaft.may_hold_primitive(&self.primitives[slot as usize])
                };
                if child.primitives().any(is_in) {
                    return false;
                }
            }
        }
        true
    }

    #[inline]
    fn query(&self, ray: &Ray) -> Query<'_> {
        let skipped = self.skipped(ray);
        Query {
            nodes: &self.nodes,
            primitives: &self.primitives,
            slab: self.slab_ray(ray, skipped),
            sheared: self.sheared(ray),
            skipped,
        }
    }

    /// The ray that primitives are tested against, in scaled units.
    #[inline]
    fn sheared(&self, ray: &Ray) -> ShearedRay {
        let origin = ray.origin() * self.scale;
        let reach = (origin - self.center).abs().max_element() + self.radius;
        ShearedRay::new(origin, ray.dir(), reach)
    }

    /// How much of a ray passes through nothing, in scaled units, if it starts far away. The farther a box is, the more
    /// its test rounds.
    #[inline]
    fn skipped(&self, ray: &Ray) -> f64 {
        let distance2 = (self.center - ray.origin() * self.scale).length_squared();
        if distance2 > 16.0 * self.radius * self.radius {
            f64::from(distance2).sqrt() - 2.0 * f64::from(self.radius)
        } else {
            0.0
        }
    }

    /// The ray that boxes are tested against, in scaled units.
    #[inline]
    fn slab_ray(&self, ray: &Ray, skipped: f64) -> SlabRay {
        let (mut origin, mut t_max) = (ray.origin() * self.scale, ray.t_max() * self.scale);
        if skipped > 0.0 {
            origin = (origin.as_dvec3() + ray.dir().as_dvec3() * skipped).as_vec3a();
            t_max = (f64::from(t_max) - skipped) as f32;
        }
        SlabRay::new(origin, ray.dir(), t_max)
    }

    /// What lies at a hit of `ray`.
    #[inline]
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        self.surface_of(&self.sheared(ray), &self.target_of(hit.slot)).0
    }

    /// The nearest surface that the ray meets, and its distance: [`Accel::closest_hit`] and [`Accel::surface`] at once.
    #[inline]
    pub fn closest_surface(&self, ray: &Ray) -> Option<(Surface, f32)> {
        let query = self.query(ray);
        let (t, slot) = query.nearest()?;
        let t = ((f64::from(t) + query.skipped) as f32) / self.scale;
        Some((self.surface_of(&query.sheared, &self.target_of(slot)).0, t))
    }

    /// What lies where a ray meets the primitive that a surface has named; nothing if its line passes by, or there is no
    /// such primitive.
    ///
    /// If the primitive is the nearest, this is what [`Accel::closest_hit`] leads to, without looking for it.
    #[inline]
    pub fn surface_on(&self, ray: &Ray, primitive: u32) -> Option<Surface> {
        self.surface_at(ray, &self.target(primitive)?)
    }

    /// A primitive that a surface has named, ready for [`Accel::surface_at`]; nothing if there is no such primitive.
    #[inline]
    pub fn target(&self, primitive: u32) -> Option<Target> {
        ((primitive as usize) < self.primitives.len()).then(|| self.target_of(primitive))
    }

    /// [`Accel::surface_on`] for many rays that meet the same primitive.
    #[inline]
    pub fn surface_at(&self, ray: &Ray, target: &Target) -> Option<Surface> {
        let (surface, is_met) = self.surface_of(&self.sheared(ray), target);
        is_met.then_some(surface)
    }

    /// What a primitive that a surface has named is made of.
    #[inline]
    pub fn material_of(&self, primitive: u32) -> MaterialId {
        self.primitives[primitive as usize].owner().material
    }

    #[inline(always)]
    fn target_of(&self, slot: u32) -> Target {
        let primitive = &self.primitives[slot as usize];
        Target(match primitive.shape() {
            Shape::Triangle => Kind::Triangle(Facet::new(slot, primitive)),
            Shape::Sphere { center, radius, .. } => {
                let owner = primitive.owner();
                Kind::Sphere { slot, owner, center: center.as_dvec3(), radius: radius.into() }
            }
        })
    }

    /// The surface of a primitive where a ray meets it, and whether its line does.
    #[inline(always)]
    fn surface_of(&self, ray: &ShearedRay, Target(kind): &Target) -> (Surface, bool) {
        match kind {
            Kind::Triangle(facet) => {
                let weights = ray.weights(facet.corners);
                (self.on_facet(facet, weights), weights.cmpge(DVec3::ZERO).all())
            }
            &Kind::Sphere { slot, owner, center, radius } => {
                let t = ray.sphere(center, radius);
                let normal = (ray.at(t) - center).normalize();
                let largest = center.abs() + radius;
                let surface = self.at(center + normal * radius, normal, largest, owner);
                (Surface { primitive: slot, ..surface }, t > 0.0 && t.is_finite())
            }
        }
    }

    /// The surface of a triangle at the place of these weights.
    #[inline(always)]
    fn on_facet(&self, facet: &Facet, weights: DVec3) -> Surface {
        let &Facet { slot, owner, corners: [a, b, c], normal, largest } = facet;
        let position = a * weights.x + b * weights.y + c * weights.z;
        let surface = self.at(position, normal, largest, owner);
        let shading_normal = self.shading_normal(slot, weights.as_vec3(), surface.geometric_normal);
        Surface { shading_normal, primitive: slot, ..surface }
    }

    /// The rays from a point between four directions, one after the other around them, if surely all that meet a triangle
    /// meet it before anything else.
    pub fn frustum(&self, origin: Vec3A, dirs: [Vec3A; 4], triangle: u32) -> Option<Frustum> {
        let primitive = self.primitives.get(triangle as usize)?;
        let Shape::Triangle = primitive.shape() else { return None };
        let facet = Facet::new(triangle, primitive);
        let origin = origin * self.scale;
        let (shaft, sides) =
            Shaft::between(origin.as_dvec3(), dirs.map(Vec3A::as_dvec3), &facet.corners)?;
        self.is_empty(&shaft, Some(triangle)).then(|| Frustum::new(origin, sides, facet))
    }

    /// What [`Accel::closest_surface`] finds along a ray that starts where a frustum does and has no end, if that is surely the
    /// triangle of the frustum.
    #[inline]
    pub fn surface_in(&self, frustum: &Frustum, ray: &Ray) -> Option<Surface> {
        frustum.weights(ray.dir()).map(|weights| self.on_facet(&frustum.facet, weights))
    }

    /// Texture coordinates at a surface that this scene has returned; none on meshes without.
    ///
    /// Those of a sphere whose rotation is none begin at +x and go once around +y, counterclockwise as seen from there,
    /// with u, and from -y to +y with v, so that a map of the world stands upright and isn't mirrored from outside.
    pub fn uv(&self, surface: &Surface) -> Option<Vec2> {
        let primitive = &self.primitives[surface.primitive as usize];
        let position = (surface.position * self.scale).as_dvec3();
        match primitive.shape() {
            Shape::Triangle => {
                let [u, v, w] = *self.uvs.get(surface.primitive as usize)?;
                let [a, b, c] = primitive.corners().map(|p| p.as_dvec3() - position);
                let normal = (b - a).cross(c - a);
                // Weights by area: of the point, not of the ray, which by now has gone.
                let weights = DVec3::from_array(
                    [(b, c), (c, a), (a, b)].map(|(p, q)| p.cross(q).dot(normal)),
                );
                let weights = (weights / weights.element_sum()).as_vec3();
                let uv = u * weights.x + v * weights.y + w * weights.z;
                uv.is_finite().then_some(uv)
            }
            Shape::Sphere { number, center, .. } => {
                let out = (position - center.as_dvec3()).as_vec3().normalize();
                Some(sphere_uv(self.rotations[number as usize], out))
            }
        }
    }

    /// A point in scaled units, with its normal for both purposes. No part of the surface lies farther from the origin
    /// than `largest`.
    #[inline(always)]
    fn at(&self, position: DVec3, normal: DVec3, largest: DVec3, owner: Owner) -> Surface {
        let inverse_scale = 1.0 / self.scale;
        let position = position.as_vec3a();
        let geometric_normal = normal.as_vec3a();
        // Half a unit in the last place of each coordinate now, half a unit when a ray's origin is moved, twice that to
        // be safe; and what double precision may lose on large surfaces.
        let rounding = position.abs() * 2.0_f32.powi(-22) + largest.as_vec3a() * 2.0_f32.powi(-46);
        Surface {
            position: position * inverse_scale,
            geometric_normal,
            shading_normal: geometric_normal,
            material: owner.material,
            object: owner.object,
            primitive: 0,
            error: geometric_normal.abs().dot(rounding) * inverse_scale,
        }
    }

    #[inline]
    fn shading_normal(&self, slot: u32, weights: Vec3, geometric_normal: Vec3A) -> Vec3A {
        let normals = self.primitives[slot as usize].normals();
        let Some(n) = normals.blend(weights) else { return geometric_normal };
        let n = n * n.dot(geometric_normal).signum();
        // Interpolated normals that lie in the surface or vanish are of no use.
        if n.dot(geometric_normal) > 1e-3 * n.length() { n.normalize() } else { geometric_normal }
    }

    /// The box around everything.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// The corners of all triangles, in world space, in no order that means anything.
    pub fn triangles(&self) -> impl Iterator<Item = [Vec3; 3]> {
        let is_triangle = |p: &&Primitive| matches!(p.shape(), Shape::Triangle);
        let to_world = 1.0 / self.scale;
        let triangles = self.primitives.iter().filter(is_triangle);
        triangles.map(move |p| p.corners().map(|corner| corner * to_world))
    }

    /// Triangles and spheres.
    pub fn n_primitives(&self) -> usize {
        self.primitives.len()
    }
}

/// Texture coordinates of a sphere that is turned, in a unit direction from its center: see [`Accel::uv`].
pub fn sphere_uv(rotation: Quat, out: Vec3) -> Vec2 {
    let p = rotation.inverse() * out;
    let turn = math::atan2(-p.z, p.x) * (0.5 * FRAC_1_PI);
    // The angle from the pole by two of its legs: the arc cosine is coarse there.
    let down = math::atan2(p.x.hypot(p.z), p.y) * FRAC_1_PI;
    Vec2::new(if turn < 0.0 { turn + 1.0 } else { turn }, 1.0 - down)
}

/// A triangle of a mesh, or the number of a sphere.
type Part<'a> = Result<(&'a Mesh, usize), usize>;

/// Texture coordinates at the corners of the triangles among some parts; empty when no mesh has any.
fn uvs_of<'a>(meshes: &[Mesh], parts: impl Iterator<Item = Part<'a>>) -> Vec<[Vec2; 3]> {
    if meshes.iter().all(|mesh| mesh.uvs.is_empty()) {
        return Vec::new();
    }
    let uvs = |part: Part<'_>| match part {
        Ok((mesh, i)) if !mesh.uvs.is_empty() => mesh.of_corners(&mesh.uvs, i),
        _ => [Vec2::NAN; 3],
    };
    parts.map(uvs).collect()
}

/// What obvhs's `build_cwbvh` does, but for its checks in debug builds: they allow rounding of 1e-5, whatever the size of
/// the scene. Each step has given back what it needed before the next: for a primitive, boxes take 32 bytes, clusters 84
/// more, the BVH of two children a node 64, its parents 8, and the costs by which it is made into one of eight 112.
fn build_bvh(boxes: Vec<BoundedPrimitive>) -> CwBvh {
    let params = BvhBuildParams::medium_build();
    let mut bvh2 = PlocBuilder::with_capacity(boxes.len()).build(
        params.ploc_search_distance,
        &boxes,
        (0..boxes.len() as u32).collect(),
        params.sort_precision,
        params.search_depth_threshold,
    );
    drop(boxes);
    ReinsertionOptimizer::default().run(&mut bvh2, params.reinsertion_batch_ratio, None);
    bvh2.parents = Vec::new();
    bvh2_to_cwbvh(&bvh2, MAX_PRIMITIVES_PER_LEAF, true, false)
}

/// The power of two that brings `size` into [2048, 4096).
fn power_of_two_scale(size: f32) -> f32 {
    if size.is_normal() {
        2.0_f32.powi((11 - size.log2().floor() as i32).clamp(-120, 120))
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::{Rng, Stream};

    #[test]
    fn the_scale_is_a_power_of_two_that_brings_sizes_to_4096() {
        for size in [1e-30, 1e-3, 0.999, 1.0, 1.001, 4096.0, 1e5, 1e30] {
            let scale = power_of_two_scale(size);
            assert_eq!(scale.log2().fract(), 0.0);
            assert!((2048.0..4096.0).contains(&(size * scale)), "{size} {scale}");
        }
        for degenerate in [0.0, f32::INFINITY, f32::NAN] {
            assert_eq!(power_of_two_scale(degenerate), 1.0);
        }
    }

    #[test]
    fn a_ray_from_nowhere_meets_nothing() {
        // One triangle leaves seven of eight places in its node empty, and such a ray meets all boxes.
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![[0, 1, 2]],
            materials: vec![MaterialId(0)],
            ..Mesh::default()
        };
        let accel = Accel::build(&[mesh], &[]);
        let ray = Ray::unbounded(Vec3A::NAN, Vec3A::Z);
        assert!(accel.closest_hit(&ray).is_none() && !accel.occluded(&ray));
    }

    #[test]
    fn triangles_are_lent_as_they_were_given() {
        let corners = [Vec3::ZERO, Vec3::X * 3.0, Vec3::new(0.1, 7.0, 0.3)];
        let mesh = Mesh {
            positions: corners.to_vec(),
            triangles: vec![[0, 1, 2]],
            materials: vec![MaterialId(0)],
            ..Mesh::default()
        };
        let sphere = Sphere {
            center: Vec3::ONE,
            radius: 0.5,
            rotation: Quat::IDENTITY,
            material: MaterialId(0),
        };
        let accel = Accel::build(&[mesh], &[sphere]);
        assert_eq!(accel.triangles().collect::<Vec<_>>(), [corners]);
    }

    /// So many small triangles in a cube.
    fn crowd(n: u32) -> Mesh {
        let mut rng = Rng::new(0, Stream::Test, 0);
        let mut mesh = Mesh::default();
        for i in 0..n {
            let mut point = || Vec3::new(rng.next_f32(), rng.next_f32(), rng.next_f32());
            let middle = point();
            mesh.positions.extend((0..3).map(|_| middle + point() * 0.02));
            mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
            mesh.materials.push(MaterialId(0));
        }
        mesh
    }

    #[test]
    fn boxes_are_hardly_larger_than_what_they_hold() {
        let accel = Accel::build(&[crowd(5000)], &[]);
        let mut n_boxes = 0;
        for node in &accel.nodes {
            for (slot, child) in node.children.into_iter().enumerate() {
                let planes = |of: &[[f32; 8]; 3]| Vec3A::from(of.map(|axis| axis[slot]));
                let (min, max) = (planes(&node.min), planes(&node.max));
                if min.x > max.x {
                    continue;
                }
                let held = match child.n_primitives() {
                    0 => accel.nodes[child.index() as usize].aabb(),
                    _ => child
                        .primitives()
                        .map(|p| accel.primitives[p as usize].aabb(0.0))
                        .fold(Aabb::INVALID, |all, one| all.union(&one)),
                };
                let more = (held.min - min).max(max - held.max);
                let is_tight = more.min_element() >= 0.0 && more.max_element() < 0.01;
                assert!(is_tight, "{more} around {held:?}");
                n_boxes += 1;
            }
        }
        assert!(n_boxes > 1000, "{n_boxes}");
    }

    #[test]
    fn threads_change_nothing() {
        // Enough for all of obvhs's parallel steps but the first, a sum that has no order.
        let meshes = [crowd(120_000)];
        let build = |n_threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            pool.install(|| Accel::build(&meshes, &[]))
        };
        let one = build(1);
        for n_threads in [2, 3] {
            let more = build(n_threads);
            assert!(one.nodes == more.nodes, "nodes of {n_threads} threads");
            let order =
                |accel: &Accel| accel.primitives.iter().map(Primitive::corners).collect::<Vec<_>>();
            assert_eq!(order(&one), order(&more));
        }
    }
}
