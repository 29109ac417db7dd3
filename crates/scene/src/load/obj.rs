//! OBJ files, read by tobj from lines that can do it no harm.
//!
//! tobj cuts concave polygons wrongly, takes NaN, forgets unknown materials, and gets normals wrong that only some
//! faces have: every line is checked, with its number, and written anew before tobj sees it. Polygons are cut by us.

mod check;

use std::collections::HashMap;
use std::path::Path;

use geometry::{MaterialId, Mesh};
use glam::Vec3;

use super::lines::TextFile;
use super::polygon::triangulate;
use crate::{Error, Material};
use check::Checked;

/// Whether the materials of an OBJ file are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Materials {
    /// From the libraries that the file names.
    FromLibraries,
    /// Not at all: another one takes their place.
    Ignored,
}

/// A file's mesh, the materials it uses, and what its author should know.
#[derive(Debug)]
pub(super) struct Obj {
    /// Its material ids count in `materials`; they are all 0 if materials are ignored.
    pub(super) mesh: Mesh,
    pub(super) materials: Vec<Material>,
    pub(super) warnings: Vec<String>,
}

/// Reads the triangles of a file, and the materials of the libraries it names.
pub(super) fn read(path: &Path, bytes: &[u8], materials: Materials) -> Result<Obj, Error> {
    let file = TextFile::new(path);
    let checked = Checked::new(&file, bytes, materials)?;
    let options = tobj::LoadOptions { single_index: true, ..Default::default() };
    // Checked lines name materials by number.
    let numbered = |_: &Path| {
        let numbers = 0..checked.materials.len();
        let unnamed = vec![tobj::Material::default(); numbers.len()];
        Ok((unnamed, numbers.map(|i| (i.to_string(), i)).collect::<HashMap<_, _>>()))
    };
    let (models, _) = tobj::load_obj_buf(&mut checked.text.as_bytes(), &options, numbered)
        .map_err(|e| file.whole(format!("{e}; save the file anew")))?;
    let mut mesh = Mesh::default();
    let some_have_normals = models.iter().any(|m| !m.mesh.normals.is_empty());
    for model in &models {
        let material = MaterialId(model.mesh.material_id.unwrap_or(0) as u16);
        add_model(&model.mesh, material, some_have_normals, &mut mesh);
    }
    Ok(Obj { mesh, materials: checked.materials, warnings: checked.warnings })
}

fn add_model(model: &tobj::Mesh, material: MaterialId, with_normals: bool, mesh: &mut Mesh) {
    let vectors = |v: &[f32]| -> Vec<Vec3> {
        v.as_chunks().0.iter().copied().map(Vec3::from_array).collect()
    };
    let positions = vectors(&model.positions);
    let mut triangles = Vec::new();
    let mut rest = model.indices.as_slice();
    // No arities mean triangles only.
    let n_faces =
        if model.face_arities.is_empty() { rest.len() / 3 } else { model.face_arities.len() };
    for i in 0..n_faces {
        let arity = model.face_arities.get(i).map_or(3, |&n| n as usize);
        let (face, tail) = rest.split_at(arity);
        let corners: Vec<Vec3> = face.iter().map(|&i| positions[i as usize]).collect();
        triangles.extend(triangulate(&corners).into_iter().map(|t| t.map(|i| face[i])));
        rest = tail;
    }
    mesh.materials.resize(mesh.materials.len() + triangles.len(), material);
    let first = mesh.positions.len() as u32;
    if with_normals && model.normals.is_empty() {
        // Flat faces among smooth ones: each triangle has corners of its own.
        for t in triangles {
            let corners = t.map(|i| positions[i as usize]);
            let [a, b, c] = corners.map(|p| p.as_dvec3());
            let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(corners);
            mesh.normals.extend([normal; 3]);
            mesh.triangles.push([first, first + 1, first + 2]);
        }
    } else {
        mesh.positions.extend(positions);
        mesh.normals.extend(vectors(&model.normals));
        mesh.triangles.extend(triangles.into_iter().map(|t| t.map(|i| first + i)));
    }
}
