//! A triangle mesh with normals, and its PLY file.

/// Triangles with a unit normal at each vertex.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mesh {
    /// Positions of the vertices.
    pub(crate) positions: Vec<[f32; 3]>,
    /// Unit normals of the vertices, outward.
    pub(crate) normals: Vec<[f32; 3]>,
    /// Three vertices each, counterclockwise seen from outside.
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// The mesh as a binary little-endian PLY file, with one line of `comment`.
pub(crate) fn to_ply(mesh: &Mesh, comment: &str) -> Vec<u8> {
    let header = format!(
        "ply\n\
         format binary_little_endian 1.0\n\
         comment {comment}\n\
         element vertex {}\n\
         property float x\n\
         property float y\n\
         property float z\n\
         property float nx\n\
         property float ny\n\
         property float nz\n\
         element face {}\n\
         property list uchar int vertex_indices\n\
         end_header\n",
        mesh.positions.len(),
        mesh.triangles.len(),
    );
    let mut bytes = header.into_bytes();
    for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
        bytes.extend(position.iter().chain(normal).flat_map(|v| v.to_le_bytes()));
    }
    for triangle in &mesh.triangles {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|i| i.to_le_bytes()));
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ply_file_is_header_vertices_triangles() {
        let mesh = Mesh {
            positions: vec![[1.0, 2.0, 3.0]],
            normals: vec![[0.0, 1.0, 0.0]],
            triangles: vec![[0, 0, 0]],
        };
        let bytes = to_ply(&mesh, "one point");
        let text = String::from_utf8_lossy(&bytes);
        assert!(text.starts_with(
            "ply\nformat binary_little_endian 1.0\ncomment one point\nelement vertex 1\n"
        ));
        let end = text.find("end_header\n").unwrap() + "end_header\n".len();
        let body = &bytes[end..];
        assert_eq!(body.len(), 6 * 4 + 1 + 3 * 4);
        assert_eq!(body[4..8], 2.0_f32.to_le_bytes());
        assert_eq!(body[24], 3);
    }
}
