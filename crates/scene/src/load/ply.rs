//! PLY files: ASCII and binary of both byte orders (Turk 1994, "The PLY Polygon File Format").
//!
//! Memory is proportional to the file: no count is believed before the file is known to be long enough for it.

mod body;
mod header;

use std::path::Path;

use geometry::{MaterialId, Mesh};
use glam::{DVec3, Vec3};

use super::polygon::{MAX_CORNERS, triangulate};
use super::source::MAX_LENGTH;
use crate::Error;
use body::Body;
use header::{Element, Header};

/// A file's mesh, and what its author should know about it.
#[derive(Debug)]
pub(super) struct Ply {
    pub(super) mesh: Mesh,
    pub(super) warnings: Vec<String>,
}

/// Reads the vertices and faces of a file; everything else in it is skipped.
///
/// Normals are as written: of any length, even none.
pub(super) fn read(path: &Path, bytes: &[u8], material: MaterialId) -> Result<Ply, Error> {
    let header = Header::parse(path, bytes)?;
    let n_vertices = header.element("vertex").map_or(0, |e| e.count);
    let whole = |fault: String| Error::Whole { path: path.to_path_buf(), fault };
    if header.element("face").is_none_or(|e| e.count == 0) || n_vertices == 0 {
        let other = header.elements.iter().any(|e| e.name == "tristrips");
        let fault = if other {
            "the file holds triangle strips instead of faces; save it with faces"
        } else {
            "the file holds no faces; save it as a mesh"
        };
        return Err(whole(fault.into()));
    }
    if n_vertices > 1 << 31 {
        return Err(whole("the file holds more than 2^31 vertices; split it".into()));
    }

    let mut body = Body::new(path, bytes, &header)?;
    let mut mesh = Mesh::default();
    let mut faces = Faces::default();
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => read_vertices(&mut body, element, &mut mesh)?,
            "face" => read_faces(&mut body, element, n_vertices, &mut faces)?,
            _ => (0..element.count).try_for_each(|i| body.skip(element, i))?,
        }
    }
    let mut warnings = Vec::new();
    if faces.n_too_small > 0 {
        warnings.push(format!(
            "{}: {} faces with fewer than 3 corners are ignored",
            path.display(),
            faces.n_too_small
        ));
    }
    let n_left = body.n_left();
    if n_left > 0 {
        warnings
            .push(format!("{}: {n_left} bytes after the last element are ignored", path.display()));
    }
    mesh.triangles = faces.into_triangles(&mesh.positions);
    mesh.materials = vec![material; mesh.triangles.len()];
    Ok(Ply { mesh, warnings })
}

fn read_vertices(body: &mut Body<'_>, element: &Element, mesh: &mut Mesh) -> Result<(), Error> {
    let mut positions = [0; 3];
    for (place, name) in positions.iter_mut().zip(["x", "y", "z"]) {
        *place = element.scalar(name).ok_or_else(|| {
            body.whole(format!("vertices have no property `{name}`; save positions as x, y, z"))
        })?;
    }
    let normals = ["nx", "ny", "nz"].map(|name| element.scalar(name));
    let normals = match normals {
        [Some(x), Some(y), Some(z)] => Some([x, y, z]),
        _ => None,
    };
    mesh.positions.reserve_exact(element.count);
    mesh.normals.reserve_exact(if normals.is_some() { element.count } else { 0 });
    let mut values = vec![0.0; element.properties.len()];
    for i in 0..element.count {
        body.scalars(element, i, &mut values)?;
        let p = DVec3::from_array(positions.map(|place| values[place]));
        if !p.is_finite() || p.abs().max_element() > f64::from(MAX_LENGTH) {
            return Err(body.fault(format!(
                "vertex {i} lies at ({}, {}, {}); coordinates must be finite and within {MAX_LENGTH:e}",
                p.x, p.y, p.z
            )));
        }
        mesh.positions.push(p.as_vec3());
        if let Some(places) = normals {
            let n = DVec3::from_array(places.map(|place| values[place]));
            if !n.is_finite() {
                return Err(body.fault(format!(
                    "the normal of vertex {i} is ({}, {}, {}); normals must be finite",
                    n.x, n.y, n.z
                )));
            }
            mesh.normals.push(n.normalize_or_zero().as_vec3());
        }
    }
    Ok(())
}

/// Polygons, one after another.
#[derive(Default)]
struct Faces {
    corners: Vec<u32>,
    /// The number of corners of each; empty as long as all are triangles.
    arities: Vec<u32>,
    n_too_small: usize,
}

impl Faces {
    /// Ends the polygon whose `n` corners were pushed.
    fn end(&mut self, n: usize) {
        if n < 3 {
            self.corners.truncate(self.corners.len() - n);
            self.n_too_small += 1;
        } else if n != 3 || !self.arities.is_empty() {
            if self.arities.is_empty() {
                self.arities = vec![3; (self.corners.len() - n) / 3];
            }
            self.arities.push(n as u32);
        }
    }

    fn into_triangles(self, positions: &[Vec3]) -> Vec<[u32; 3]> {
        if self.arities.is_empty() {
            return self.corners.as_chunks().0.to_vec();
        }
        let mut triangles = Vec::with_capacity(self.corners.len());
        let mut rest = self.corners.as_slice();
        for arity in self.arities {
            let (face, tail) = rest.split_at(arity as usize);
            let corners: Vec<_> = face.iter().map(|&i| positions[i as usize]).collect();
            triangles.extend(triangulate(&corners).into_iter().map(|t| t.map(|i| face[i])));
            rest = tail;
        }
        triangles
    }
}

fn read_faces(
    body: &mut Body<'_>,
    element: &Element,
    n_vertices: usize,
    faces: &mut Faces,
) -> Result<(), Error> {
    let wanted = ["vertex_indices", "vertex_index"].iter().find_map(|name| element.list(name));
    let Some(wanted) = wanted else {
        let fault = "faces have no list `vertex_indices`; save the file with faces";
        return Err(body.whole(fault.into()));
    };
    // A triangle takes at least four bytes.
    faces.corners.reserve(3 * element.count.min(body.n_left() / 4));
    for i in 0..element.count {
        for (place, property) in element.properties.iter().enumerate() {
            if place != wanted {
                body.skip_property(property, element, i)?;
                continue;
            }
            let n = body.list_length(property, element, i)?;
            if n > MAX_CORNERS {
                return Err(body.fault(format!(
                    "face {i} has {n} corners; cut it so that none has more than {MAX_CORNERS}"
                )));
            }
            for _ in 0..n {
                let index = body.number(property.kind, element, i)?;
                if !(index >= 0.0 && index < n_vertices as f64 && index.fract() == 0.0) {
                    return Err(body.fault(format!(
                        "face {i} names vertex {index}, but the vertices are 0 to {}",
                        n_vertices - 1
                    )));
                }
                faces.corners.push(index as u32);
            }
            faces.end(n);
        }
    }
    Ok(())
}
