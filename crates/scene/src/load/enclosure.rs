//! Cameras inside walls.

use base::math;
use geometry::{Bounds, Mesh};
use glam::{DVec3, Vec3A};

use crate::{LightKind, Material, Parts, Specular};

/// The name of the object that shuts the camera in where no light gets.
///
/// Only what is sure to give a black picture counts: the object is closed and opaque, and nothing in its box emits.
pub(super) fn dark_enclosure(parts: &Parts) -> Option<&String> {
    let eye = parts.camera.origin();
    let spheres = parts.spheres.iter().filter(|(_, sphere)| {
        let center = Vec3A::from(sphere.center);
        let bounds =
            Bounds { min: sphere.center - sphere.radius, max: sphere.center + sphere.radius };
        (eye - center).length() < sphere.radius
            && is_opaque(&parts.materials[usize::from(sphere.material.0)])
            && !has_light(parts, &bounds)
    });
    let meshes = parts.meshes.iter().filter(|(_, mesh)| {
        let bounds = mesh.bounds();
        eye.cmpge(bounds.min.into()).all()
            && eye.cmple(bounds.max.into()).all()
            && mesh.materials.iter().all(|m| is_opaque(&parts.materials[usize::from(m.0)]))
            && !has_light(parts, &bounds)
            && winding_number(mesh, eye.as_dvec3()).abs() > 1.0 - 1e-6
    });
    spheres.map(|(name, _)| name).chain(meshes.map(|(name, _)| name)).next()
}

fn is_opaque(material: &Material) -> bool {
    !matches!(material.specular, Specular::Glass { .. } | Specular::Pane { .. })
        && !material.is_masked()
}

/// Whether a light might lie within the box.
fn has_light(parts: &Parts, bounds: &Bounds) -> bool {
    let (min, max) = (Vec3A::from(bounds.min), Vec3A::from(bounds.max));
    let points = parts.lights.iter().any(|light| {
        let position = match &light.kind {
            LightKind::Point { position, .. } => *position,
            LightKind::Spot(spot) => spot.position,
            LightKind::Area(_) | LightKind::Sphere(_) => return true,
            LightKind::Directional { .. }
            | LightKind::Environment { .. }
            | LightKind::EnvironmentMap(_) => return false,
        };
        position.cmpge(min).all() && position.cmple(max).all()
    });
    let spheres = parts.spheres.iter().any(|(_, sphere)| {
        let (center, radius) = (Vec3A::from(sphere.center), sphere.radius);
        !parts.materials[usize::from(sphere.material.0)].emission.is_black()
            && (center + radius).cmpge(min).all()
            && (center - radius).cmple(max).all()
    });
    points
        || spheres
        || parts.meshes.iter().any(|(_, mesh)| {
            mesh.materials.iter().enumerate().any(|(t, m)| {
                !parts.materials[usize::from(m.0)].emission.is_black() && {
                    let [a, b, c] = mesh.corners(t).map(Vec3A::from);
                    a.max(b).max(c).cmpge(min).all() && a.min(b).min(c).cmple(max).all()
                }
            })
        })
}

/// How often a mesh goes around a point: 1 or -1 inside a closed mesh, 0 outside of it, between if it is open.
///
/// The solid angles of the triangles are those of van Oosterom and Strackee 1983 ("The Solid Angle of a Plane Triangle").
fn winding_number(mesh: &Mesh, point: DVec3) -> f64 {
    let angle: f64 = (0..mesh.triangles.len())
        .map(|t| {
            let [a, b, c] = mesh.corners(t).map(|p| p.as_dvec3() - point);
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            let det = a.dot(b.cross(c));
            let sum = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            2.0 * math::atan2_f64(det, sum)
        })
        .sum();
    angle / (4.0 * std::f64::consts::PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::shapes;
    use geometry::MaterialId;
    use glam::Vec3;

    #[test]
    fn winding_tells_inside_from_outside() {
        let mut mesh = shapes::cuboid(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0), MaterialId(0));
        let inside = DVec3::new(0.2, 1.9, 0.4);
        assert!((winding_number(&mesh, inside) - 1.0).abs() < 1e-9);
        assert!(winding_number(&mesh, DVec3::new(1.2, 1.9, 0.4)).abs() < 1e-9);
        // Of a cube, one face of six.
        mesh = shapes::cuboid(Vec3::ZERO, Vec3::ONE, MaterialId(0));
        mesh.triangles.drain(..2);
        let open = winding_number(&mesh, DVec3::splat(0.5));
        assert!((open - 5.0 / 6.0).abs() < 1e-9, "{open}");
    }
}
