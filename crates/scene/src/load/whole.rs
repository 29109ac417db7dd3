//! Checks that concern the scene as a whole.

use geometry::{Bounds, MAX_PRIMITIVES, MaterialId, Mesh, Sphere};

use super::assembly::Assembly;
use super::enclosure::dark_enclosure;
use super::mesh_checks::{MAX_STACK, largest_stack};
use crate::{Camera, Error, Parts};

/// The parts of the scene, and all warnings.
pub(super) fn finish(
    assembly: Assembly<'_>,
    camera: Camera,
) -> Result<(Parts, Vec<String>), Error> {
    let Assembly { source, materials, textures, meshes, spheres, lights, mut warnings, .. } =
        assembly;
    let emits = |id: &MaterialId| !materials[usize::from(id.0)].emission.is_black();
    if lights.is_empty()
        && !meshes.iter().any(|(_, mesh)| mesh.materials.iter().any(emits))
        && !spheres.iter().any(|(_, sphere)| emits(&sphere.material))
    {
        let fault = "nothing emits light; add a light or an emissive material";
        return Err(source.fault_of_whole(fault));
    }
    let bounds = bounds(&meshes, &spheres);
    if bounds.is_empty() {
        let fault = "there are no surfaces; add a mesh, a quad, a box or a sphere";
        return Err(source.fault_of_whole(fault));
    }
    let size = bounds.diagonal();
    if size < 1e-6 {
        let fault = format!("the scene is only {size:e} across; use a smaller unit of length");
        return Err(source.fault_of_whole(fault));
    }
    let n_triangles: usize = meshes.iter().map(|(_, mesh)| mesh.triangles.len()).sum();
    let n_primitives = n_triangles + spheres.len();
    if n_primitives > MAX_PRIMITIVES {
        let fault = format!(
            "{n_primitives} triangles and spheres are too many; use at most {MAX_PRIMITIVES}"
        );
        return Err(source.fault_of_whole(fault));
    }
    if let Some((n, i)) = largest_stack(meshes.iter().map(|(_, mesh)| mesh))
        && n > MAX_STACK
    {
        let fault =
            format!("{n} triangles of `{}` lie on one spot; remove all but one", meshes[i].0);
        return Err(source.fault_of_whole(fault));
    }
    let farthest = bounds.min.abs().max(bounds.max.abs()).max_element();
    if farthest > 1e4 * size {
        let text = format!(
            "the scene is {size} across but {farthest} away from the origin, where single precision is coarse; move it closer"
        );
        warnings.push(source.fault_of_whole(text).to_string());
    }
    let parts = Parts { camera, materials, textures, meshes, spheres, lights };
    if let Some(name) = dark_enclosure(&parts) {
        let fault = format!(
            "the camera is shut in by `{name}`, which is opaque and has no light inside; move one of them"
        );
        return Err(source.fault_of_whole(fault));
    }
    Ok((parts, warnings))
}

fn bounds(meshes: &[(String, Mesh)], spheres: &[(String, Sphere)]) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    for (_, mesh) in meshes {
        let own = mesh.bounds();
        bounds.extend(own.min);
        bounds.extend(own.max);
    }
    for (_, sphere) in spheres {
        bounds.extend(sphere.center - sphere.radius);
        bounds.extend(sphere.center + sphere.radius);
    }
    bounds
}
