//! PLY files: ASCII and binary of both byte orders (Turk 1994, "The PLY Polygon File Format").
//!
//! Memory is proportional to the file: no count is believed before the file is known to be long enough for it.

mod body;
mod header;

use std::path::Path;

use geometry::{MaterialId, Mesh};
use glam::{DVec2, DVec3, Vec3};

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
/// Normals are as written: of any length, even none. Texture coordinates are read only if they are needed.
pub(super) fn read(
    path: &Path,
    bytes: &[u8],
    material: MaterialId,
    textured: bool,
) -> Result<Ply, Error> {
    let header = Header::parse(path, bytes)?;
    let n_vertices = header.element("vertex").map_or(0, |e| e.count);
    let whole = |fault: String| Error::whole(path, fault);
    if header.element("face").is_none_or(|e| e.count == 0) || n_vertices == 0 {
        let other = header.elements.iter().any(|e| e.name == "tristrips");
        let fault = if other {
            "the file holds triangle strips instead of faces; save it with faces"
        } else {
            "the file holds no faces; save it as a mesh"
        };
        return Err(whole(fault.into()));
    }

    let mut body = Body::new(path, bytes, &header)?;
    if n_vertices > 1 << 31 {
        return Err(whole("the file holds more than 2^31 vertices; split it".into()));
    }
    let mut mesh = Mesh::default();
    let mut faces = Faces::default();
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => read_vertices(&mut body, element, textured, &mut mesh)?,
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

/// The names that programs give to texture coordinates.
const UVS: [[&str; 2]; 3] = [["u", "v"], ["s", "t"], ["texture_u", "texture_v"]];

fn read_vertices(
    body: &mut Body<'_>,
    element: &Element,
    textured: bool,
    mesh: &mut Mesh,
) -> Result<(), Error> {
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
    let uvs = UVS.iter().find_map(|[u, v]| Some([element.scalar(u)?, element.scalar(v)?]));
    let uvs = if textured { uvs } else { None };
    if textured && uvs.is_none() {
        let fault = "vertices have no texture coordinates, which the material needs; save the file with u and v";
        return Err(body.whole(fault.into()));
    }
    mesh.positions.reserve_exact(element.count);
    mesh.uvs.reserve_exact(if textured { element.count } else { 0 });
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
        if let Some(places) = uvs {
            let uv = DVec2::from_array(places.map(|place| values[place]));
            if !uv.is_finite() || uv.abs().max_element() > f64::from(MAX_LENGTH) {
                return Err(body.fault(format!(
                    "the texture coordinates of vertex {i} are ({}, {}); they must be finite and within {MAX_LENGTH:e}",
                    uv.x, uv.y
                )));
            }
            mesh.uvs.push(uv.as_vec2());
        }
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
    // Most files start, and end, here.
    let n_plain = body.plain_triangles(element, n_vertices, &mut faces.corners);
    for i in n_plain..element.count {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn ply(bytes: &[u8]) -> Result<Ply, String> {
        read(Path::new("a.ply"), bytes, MaterialId(3), false).map_err(|e| e.to_string())
    }

    const POSITIONS: [[f32; 3]; 4] =
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.5, 0.0], [-0.25, 1.0, 0.125]];
    const FACES: [&[u32]; 3] = [&[0, 1, 2], &[0, 2, 3], &[3, 2, 1, 0]];

    /// A file of these vertices and faces, with other properties and elements around them.
    fn written(format: &str, coordinate: &str, length: &str, index: &str) -> Vec<u8> {
        let header = format!(
            "ply\r\nformat {format} 1.0\ncomment made by hand\nobj_info none\nelement camera 1\nproperty float view\n\
             property list uchar short path\nelement vertex 4\nproperty uchar red\nproperty {coordinate} z\n\
             property {coordinate} y\nproperty list uchar float weights\nproperty {coordinate} x\n\
             property {coordinate} nx\nproperty {coordinate} ny\nproperty {coordinate} nz\nelement face 3\n\
             property int flags\nproperty list {length} {index} vertex_indices\nproperty char last\n\
             element edge 1\nproperty int vertex1\nend_header\n"
        );
        let mut bytes = header.into_bytes();
        let mut put = |kind: &str, value: f64| match (format, kind) {
            ("ascii", _) => bytes.extend(format!("{value} ").bytes()),
            (_, kind) => {
                let mut b = match kind {
                    "char" | "int8" => (value as i8).to_le_bytes().to_vec(),
                    "uchar" | "uint8" => (value as u8).to_le_bytes().to_vec(),
                    "short" | "int16" => (value as i16).to_le_bytes().to_vec(),
                    "ushort" | "uint16" => (value as u16).to_le_bytes().to_vec(),
                    "int" | "int32" => (value as i32).to_le_bytes().to_vec(),
                    "uint" | "uint32" => (value as u32).to_le_bytes().to_vec(),
                    "float" | "float32" => (value as f32).to_le_bytes().to_vec(),
                    _ => value.to_le_bytes().to_vec(),
                };
                if format == "binary_big_endian" {
                    b.reverse();
                }
                bytes.extend(b);
            }
        };
        [("float", 0.5), ("uchar", 2.0), ("short", -7.0), ("short", 9.0)]
            .iter()
            .for_each(|&(kind, v)| put(kind, v));
        for [x, y, z] in POSITIONS.map(|p| p.map(f64::from)) {
            put("uchar", 255.0);
            put(coordinate, z);
            put(coordinate, y);
            put("uchar", 1.0);
            put("float", 0.25);
            put(coordinate, x);
            [0.0, 2.0, 0.0].iter().for_each(|&n| put(coordinate, n));
        }
        for face in FACES {
            put("int", -1.0);
            put(length, face.len() as f64);
            face.iter().for_each(|&i| put(index, f64::from(i)));
            put("char", -3.0);
        }
        put("int", 0.0);
        bytes
    }

    #[test]
    fn all_formats_and_types_read_alike() {
        for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
            for coordinate in ["float", "float32", "double", "float64"] {
                for length in ["uchar", "int8", "ushort", "int16", "uint", "int32"] {
                    for index in ["char", "uint8", "short", "uint16", "int", "uint32"] {
                        let file = written(format, coordinate, length, index);
                        let Ply { mesh, warnings } = ply(&file).unwrap();
                        let positions: Vec<_> =
                            mesh.positions.iter().map(|p| p.to_array()).collect();
                        assert_eq!(positions, POSITIONS, "{format} {coordinate} {length} {index}");
                        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [3, 2, 1], [3, 1, 0]]);
                        assert_eq!(mesh.normals, [Vec3::Y; 4]);
                        assert_eq!(mesh.materials, [MaterialId(3); 4]);
                        assert!(warnings.is_empty(), "{warnings:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn texture_coordinates_have_many_names() {
        let file = |u: &str, v: &str, first: &str| {
            format!(
                "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                 property float {v}\nproperty float {u}\nelement face 1\nproperty list uchar int vertex_index\n\
                 end_header\n0 0 0 0.5 {first}\n1 0 0 0 0.75\n1 1 0 1 1\n3 0 1 2\n"
            )
        };
        let textured = |file: String| {
            read(Path::new("a.ply"), file.as_bytes(), MaterialId(0), true)
                .map_err(|e| e.to_string())
        };
        for [u, v] in UVS {
            let uvs = textured(file(u, v, "0.25")).unwrap().mesh.uvs;
            let uvs: Vec<_> = uvs.iter().map(|uv| uv.to_array()).collect();
            assert_eq!(uvs, [[0.25, 0.5], [0.75, 0.0], [1.0, 1.0]], "{u} {v}");
            assert!(ply(file(u, v, "0.25").as_bytes()).unwrap().mesh.uvs.is_empty());
        }
        assert_eq!(
            textured(file("u", "w", "0")).unwrap_err(),
            "a.ply: vertices have no texture coordinates, which the material needs; save the file with u and v"
        );
        assert_eq!(
            textured(file("u", "v", "1e9")).unwrap_err(),
            "a.ply:12:1: the texture coordinates of vertex 0 are (1000000000, 0.5); they must be finite and within 1e8"
        );
    }

    #[test]
    fn cut_files_are_refused_everywhere() {
        for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
            let file = written(format, "float", "uchar", "int");
            // The last value of a text may lose its blank.
            let whole = file.trim_ascii_end().len();
            let whole = if format == "ascii" { whole } else { file.len() };
            for end in 0..whole {
                let message = ply(&file[..end]).unwrap_err();
                assert!(message.starts_with("a.ply"), "{message}");
            }
        }
    }

    #[test]
    fn faults_are_named() {
        let head = |vertices: &str, faces: &str| {
            format!(
                "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
                 property float z\nelement face {faces}\nproperty list uchar int vertex_index\nend_header\n"
            )
        };
        let body = "0 0 0\n1 0 0\n1 1 0\n";
        let cases = [
            (String::new(), "a.ply: the header has no end; the file is cut off or not a PLY file"),
            ("solid a\n".into(), "a.ply:1:1: this is no PLY file; its first line must be `ply`"),
            (
                "ply\nformat ascii 1.0\n".into(),
                "a.ply: the header has no end; the file is cut off or not a PLY file",
            ),
            (
                "ply\nformat binary 1.0\n".into(),
                "a.ply:2:1: `format binary 1.0` is unknown; the formats are ascii, binary_little_endian and binary_big_endian",
            ),
            (
                "ply\nelement vertex -1\n".into(),
                "a.ply:2:1: `element vertex -1` must be: element NAME COUNT",
            ),
            ("ply\nproperty float x\n".into(), "a.ply:2:1: a property stands before any element"),
            (
                "ply\nelement vertex 1\nproperty half x\n".into(),
                "a.ply:3:1: `property half x` must be: property TYPE NAME, or: property list TYPE TYPE NAME",
            ),
            (
                "ply\nelement vertex 1\nproperty list float int x\n".into(),
                "a.ply:3:1: `property list float int x` must be: property TYPE NAME, or: property list TYPE TYPE NAME",
            ),
            (
                "ply\nelement vertex 1\nproperty int x\nproperty int x\n".into(),
                "a.ply:4:1: there are two properties `x`; keep one",
            ),
            (
                "ply\nelement vertex 1\nelement vertex 1\n".into(),
                "a.ply:3:1: there are two elements `vertex`; keep one",
            ),
            (
                "ply\nvertices 1\n".into(),
                "a.ply:2:1: `vertices` is no word of PLY headers; save the file anew",
            ),
            (
                "ply\nelement vertex 1\nend_header\n".into(),
                "a.ply:3:1: the element `vertex` has no properties",
            ),
            ("ply\nend_header\n".into(), "a.ply:2:1: the header names no format"),
            (head("3", "0") + body, "a.ply: the file holds no faces; save it as a mesh"),
            (
                head("3", "0").replace("element face", "element tristrips") + body,
                "a.ply: the file holds triangle strips instead of faces; save it with faces",
            ),
            (
                head("999999999999", "1") + body,
                "a.ply: the header promises 999999999999 of `vertex`, for which the file is too short; it may be cut off",
            ),
            (
                head("18446744073709551615", "1") + body,
                "a.ply: the header promises 18446744073709551615 of `vertex`, for which the file is too short; it may be cut off",
            ),
            (
                head("3", "1000") + body + "3 0 1 2\n",
                "a.ply: the header promises 1000 of `face`, for which the file is too short; it may be cut off",
            ),
            (
                head("3", "1") + body + "3 0 1\n",
                "a.ply: the file ends in `face` 0 of 1; it is cut off",
            ),
            (
                head("3", "1") + body + "300 0 1\n",
                "a.ply:13:1: the list `vertex_index` of face 0 promises 300 values, more than the file holds",
            ),
            (
                head("3", "1") + body + "-3 0 1\n",
                "a.ply:13:1: the list `vertex_index` of face 0 promises -3 values, more than the file holds",
            ),
            (
                head("3", "1") + body + "3 0 1 3\n",
                "a.ply:13:1: face 0 names vertex 3, but the vertices are 0 to 2",
            ),
            (
                head("3", "1") + body + "3 0 1 -1\n",
                "a.ply:13:1: face 0 names vertex -1, but the vertices are 0 to 2",
            ),
            (
                head("3", "1") + body + "3 0 1 1.5\n",
                "a.ply:13:1: face 0 names vertex 1.5, but the vertices are 0 to 2",
            ),
            (head("3", "1") + body + "3 0 1 two\n", "a.ply:13:1: `two` of face 0 is no number"),
            (
                head("3", "1") + "0 0 0\n1 nan 0\n1 1 0\n3 0 1 2\n",
                "a.ply:11:1: vertex 1 lies at (1, NaN, 0); coordinates must be finite and within 1e8",
            ),
            (
                head("3", "1") + "0 0 0\n1 0 0\n1 1 -1e9\n3 0 1 2\n",
                "a.ply:12:1: vertex 2 lies at (1, 1, -1000000000); coordinates must be finite and within 1e8",
            ),
            (
                head("3", "1").replace(" y", " v") + body + "3 0 1 2\n",
                "a.ply: vertices have no property `y`; save positions as x, y, z",
            ),
            (
                head("3", "1").replace("vertex_index", "corners") + body + "3 0 1 2\n",
                "a.ply: faces have no list `vertex_indices`; save the file with faces",
            ),
            (
                head("1", "1").replace(
                    "property float z",
                    "property float z\nproperty float nx\nproperty float ny\nproperty float nz",
                ) + "0 0 0 0 inf 0\n3 0 0 0\n",
                "a.ply:13:1: the normal of vertex 0 is (0, inf, 0); normals must be finite",
            ),
        ];
        for (text, expected) in cases {
            assert_eq!(ply(text.as_bytes()).unwrap_err(), expected);
        }
        let loose = head("3", "3") + body + "2 0 1\n0\n3 0 1 2\n\nmore\n";
        assert_eq!(
            ply(loose.as_bytes()).unwrap().warnings,
            [
                "a.ply: 2 faces with fewer than 3 corners are ignored",
                "a.ply: 4 bytes after the last element are ignored"
            ]
        );
        // Binary files have no lines to name.
        let mut file = written("binary_little_endian", "float", "uchar", "int");
        let last_face = file.len() - 4 - 1 - 4;
        file[last_face..last_face + 4].copy_from_slice(&4_i32.to_le_bytes());
        assert_eq!(
            ply(&file).unwrap_err(),
            "a.ply: face 2 names vertex 4, but the vertices are 0 to 3"
        );
    }
}
