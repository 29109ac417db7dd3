//! Groups of shapes, and their instances.
//!
//! Instances are copies: each takes the memory of the shapes it shows. One BVH over all surfaces is what keeps scenes
//! without instances fast, so what instances add to it is limited instead.

use std::rc::Rc;

use geometry::{Mesh, Sphere};
use glam::{DAffine3, DMat3, DQuat, Quat};

use super::plugin::Plugin;
use super::xml::Element;
use super::{Context, shapes};
use crate::Error;
use crate::load::mesh_checks::drop_useless;
use crate::load::source::MAX_LENGTH;
use crate::load::transform;

/// How many triangles and spheres instances may add: with the BVH each takes about 150 bytes, so 2.5 GB.
const MAX_INSTANCED: usize = 1 << 24;

/// The shapes of a group, with their names.
#[derive(Debug, Default)]
pub(super) struct Group {
    meshes: Vec<(String, Mesh)>,
    spheres: Vec<(String, Sphere)>,
}

/// Adds an instance.
pub(super) fn add<'d>(context: &mut Context<'d>, element: &'d Element) -> Result<(), Error> {
    let plugin = Plugin::new(context, element)?;
    let document = context.document;
    let fault = |fault: String| Err(document.fault(element.place, fault));
    let name = context.name(element, context.assembly.meshes.len() + 1);
    let groups = plugin.nested(context, &["shape"])?;
    let [group] = groups.as_slice() else {
        return fault("shape \"instance\" needs one shapegroup, by a <ref> or in it".into());
    };
    let map = plugin.transform(context)?;
    plugin.finish(context)?;
    let group = members(context, group)?;
    let n_triangles: usize = group.meshes.iter().map(|(_, mesh)| mesh.triangles.len()).sum();
    context.n_instanced += n_triangles + group.spheres.len();
    if let Some(text) = too_many(context.n_instanced) {
        return fault(text);
    }
    for (part, mesh) in &group.meshes {
        let mut mesh = mesh.clone();
        if !transform::apply(&map, &mut mesh) {
            return fault(format!(
                "to_world moves {} too far away; keep coordinates within {MAX_LENGTH:e}",
                plugin.title()
            ));
        }
        // A small scale may round corners to one place.
        drop_useless(&mut mesh);
        if !mesh.triangles.is_empty() {
            context.assembly.meshes.push((format!("{name}/{part}"), mesh));
        }
    }
    for (part, sphere) in &group.spheres {
        let is_textured = context.assembly.is_textured(sphere.material);
        match moved(sphere, &map, is_textured) {
            Ok(sphere) => context.assembly.spheres.push((format!("{name}/{part}"), sphere)),
            Err(text) => return fault(format!("{part} of this instance {text}")),
        }
    }
    Ok(())
}

/// Why instances that add so many triangles and spheres are refused.
fn too_many(n: usize) -> Option<String> {
    (n > MAX_INSTANCED).then(|| {
        format!(
            "instances are copied, and up to this one they add {n} triangles; use at most {MAX_INSTANCED} in all, or coarser meshes"
        )
    })
}

/// The shapes of a group, which are read once.
fn members<'d>(context: &mut Context<'d>, element: &'d Element) -> Result<Rc<Group>, Error> {
    if let Some(group) = context.groups.get(&element.place) {
        return Ok(Rc::clone(group));
    }
    let plugin = Plugin::new(context, element)?;
    let document = context.document;
    if plugin.kind != "shapegroup" {
        let fault = format!("an instance shows a shapegroup, not {}", plugin.title());
        return Err(document.fault(element.place, fault));
    }
    let shapes = plugin.nested(context, &["shape"])?;
    plugin.finish(context)?;
    let mut group = Group::default();
    for shape in shapes {
        // Which also keeps groups from holding themselves.
        if matches!(shape.attribute("type"), Some("shapegroup" | "instance")) {
            let fault = "a shapegroup holds no other groups and no instances; put its shapes in it";
            return Err(document.fault(shape.place, fault));
        }
        for child in &shape.children {
            if matches!(context.resolve(child)?.tag.as_str(), "emitter" | "luminaire") {
                let fault = "a shape that emits can't be instanced; place each lamp on its own";
                return Err(document.fault(child.place, fault));
            }
        }
        let assembly = &context.assembly;
        let before = (assembly.meshes.len(), assembly.spheres.len());
        shapes::add(context, shape)?;
        group.meshes.extend(context.assembly.meshes.drain(before.0..));
        group.spheres.extend(context.assembly.spheres.drain(before.1..));
    }
    if group.meshes.is_empty() && group.spheres.is_empty() {
        return Err(document.fault(element.place, "the shapegroup holds no shapes"));
    }
    let group = Rc::new(group);
    context.groups.insert(element.place, Rc::clone(&group));
    Ok(group)
}

/// A sphere under a map, or why it is none.
fn moved(sphere: &Sphere, map: &DAffine3, is_textured: bool) -> Result<Sphere, &'static str> {
    let scale = map.matrix3.determinant().abs().cbrt();
    let turn = map.matrix3 * (1.0 / scale);
    let off = turn.transpose() * turn - DMat3::IDENTITY;
    if off.to_cols_array().iter().any(|x| x.abs() > 1e-4) {
        return Err("is a sphere that is scaled unevenly, which isn't supported; use a mesh");
    }
    let is_mirrored = turn.determinant() < 0.0;
    if is_textured && is_mirrored {
        return Err("is a mirrored sphere with a texture, which isn't supported; use a mesh");
    }
    let radius = f64::from(sphere.radius) * scale;
    let center = map.transform_point3(sphere.center.as_dvec3());
    let most = f64::from(MAX_LENGTH);
    if !(radius >= f64::from(f32::MIN_POSITIVE) && radius <= most)
        || center.abs().max_element() > most
    {
        return Err("becomes too small, too large or too far away");
    }
    let rotation = match is_textured {
        true => (DQuat::from_mat3(&turn) * sphere.rotation.as_dquat()).as_quat(),
        false => Quat::IDENTITY,
    };
    Ok(Sphere { center: center.as_vec3(), radius: radius as f32, rotation, ..*sphere })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_instances_add_is_limited() {
        assert_eq!(too_many(MAX_INSTANCED), None);
        let text = too_many(MAX_INSTANCED + 1).unwrap();
        assert!(text.contains("16777217 triangles; use at most 16777216 in all"), "{text}");
    }
}
