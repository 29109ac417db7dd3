//! OBJ files, read by tobj from lines that can do it no harm.
//!
//! tobj cuts concave polygons wrongly, takes NaN, forgets unknown materials, and gets normals wrong that only some
//! faces have: every line is checked, with its number, and written anew before tobj sees it. Polygons are cut by us.

mod check;

use std::collections::HashMap;
use std::path::Path;

use geometry::{MaterialId, Mesh};
use glam::{Vec2, Vec3};

use super::lines::TextFile;
use super::polygon::triangulate;
use super::reach::Reach;
use crate::{Error, Material, Texture};
use check::Checked;

/// Whether the materials of an OBJ file are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Materials<'a> {
    /// From the libraries that the file names, which name images.
    FromLibraries(&'a Reach),
    /// Not at all: another one takes their place.
    Ignored {
        /// Whether that one needs texture coordinates.
        textured: bool,
    },
}

/// A file's mesh, the materials it uses, and what its author should know.
#[derive(Debug)]
pub(super) struct Obj {
    /// Its material ids count in `materials`; they are all 0 if materials are ignored.
    pub(super) mesh: Mesh,
    pub(super) materials: Vec<Material>,
    /// The ids of its materials count in it.
    pub(super) textures: Vec<Texture>,
    pub(super) warnings: Vec<String>,
}

/// Reads the triangles of a file, and the materials of the libraries it names.
pub(super) fn read(path: &Path, bytes: &[u8], materials: Materials<'_>) -> Result<Obj, Error> {
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
    let some_have_uvs = models.iter().any(|m| !m.mesh.texcoords.is_empty());
    let some_have_normals = models.iter().any(|m| !m.mesh.normals.is_empty());
    for model in &models {
        let material = MaterialId(model.mesh.material_id.unwrap_or(0) as u16);
        add_model(&model.mesh, material, some_have_normals, &mut mesh);
        if some_have_uvs {
            // Models without are of materials without a texture.
            mesh.uvs.resize(mesh.positions.len(), Vec2::ZERO);
        }
    }
    let Checked { materials, textures, warnings, .. } = checked;
    Ok(Obj { mesh, materials, textures, warnings })
}

fn add_model(model: &tobj::Mesh, material: MaterialId, with_normals: bool, mesh: &mut Mesh) {
    let vectors = |v: &[f32]| -> Vec<Vec3> {
        v.as_chunks().0.iter().copied().map(Vec3::from_array).collect()
    };
    let positions = vectors(&model.positions);
    let uvs: Vec<Vec2> =
        model.texcoords.as_chunks().0.iter().copied().map(Vec2::from_array).collect();
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
            if !uvs.is_empty() {
                mesh.uvs.resize(mesh.positions.len(), Vec2::ZERO);
                mesh.uvs.extend(t.map(|i| uvs[i as usize]));
            }
            let corners = t.map(|i| positions[i as usize]);
            let [a, b, c] = corners.map(|p| p.as_dvec3());
            let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(corners);
            mesh.normals.extend([normal; 3]);
            mesh.triangles.push([first, first + 1, first + 2]);
        }
    } else {
        if !uvs.is_empty() {
            mesh.uvs.resize(mesh.positions.len(), Vec2::ZERO);
            mesh.uvs.extend(uvs);
        }
        mesh.positions.extend(positions);
        mesh.normals.extend(vectors(&model.normals));
        mesh.triangles.extend(triangles.into_iter().map(|t| t.map(|i| first + i)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn obj(text: &[u8]) -> Result<Obj, String> {
        read(Path::new("a.obj"), text, Materials::Ignored { textured: false })
            .map_err(|e| e.to_string())
    }

    /// The corners of all triangles.
    fn corners(obj: &Obj) -> Vec<[[f32; 3]; 3]> {
        (0..obj.mesh.triangles.len()).map(|t| obj.mesh.corners(t).map(|p| p.to_array())).collect()
    }

    const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn every_way_of_writing_a_face() {
        let expected = [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]];
        for face in [
            "f 1 2 3",
            "f 1/1 2/2 3/3",
            "f 1//1 2//1 3//1",
            "f 1/1/1 2/2/1 3/3/1",
            "f -4 -3 -2",
            "f\t1 2\\\n 3 # good",
            "  f 1 2 3  \r",
            "f 1/ 2/ 3/",
        ] {
            let text = format!("# caf\u{e9}\n{CORNERS}vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 2\n{face}\n");
            let obj = obj(text.as_bytes()).unwrap();
            assert_eq!(corners(&obj), expected, "{face}");
            assert!(obj.warnings.is_empty(), "{:?}", obj.warnings);
        }
    }

    #[test]
    fn concave_polygons_keep_their_shape() {
        // An arrow head of area 1: a fan around its first corner would cover 2.
        let obj = obj(b"v 0 2 0\nv 1 1 0\nv 0 0 0\nv 2 1 0\nf 1 2 3 4\n").unwrap();
        let area: f32 = (0..2)
            .map(|t| {
                let [a, b, c] = obj.mesh.corners(t);
                let normal = (b - a).cross(c - a);
                assert!(normal.z > 0.0);
                0.5 * normal.z
            })
            .sum();
        assert_eq!(area, 1.0);
    }

    #[test]
    fn points_lines_and_groups_are_no_faces() {
        let text = format!(
            "{CORNERS}o a\ng b c\ns 1\np 1 2\nl 1 2 3\nf 1 2 3\ng d\nf 1 3 4\nmtllib none.mtl\nusemtl x\n"
        );
        let obj = obj(text.as_bytes()).unwrap();
        assert_eq!(obj.mesh.triangles.len(), 2);
        assert!(obj.warnings.is_empty(), "{:?}", obj.warnings);
    }

    #[test]
    fn latin_1_comments_and_byte_order_marks_do_no_harm() {
        let text =
            [b"\xef\xbb\xbf# caf\xe9\n".as_slice(), CORNERS.as_bytes(), b"f 1 2 3\n"].concat();
        assert_eq!(obj(&text).unwrap().mesh.triangles.len(), 1);
    }

    #[test]
    fn normals_belong_to_their_corners() {
        let text = format!("{CORNERS}vn 0 0 1\nvn 0 1 1\nf 1//1 2//2 3//1\nf 1//2 3//1 4//1\n");
        let obj = obj(text.as_bytes()).unwrap();
        let normals: Vec<_> = (0..2)
            .flat_map(|t| obj.mesh.triangles[t].map(|i| obj.mesh.normals[i as usize].y))
            .collect();
        assert_eq!(normals, [0.0, 1.0, 0.0, 1.0, 0.0, 0.0]);
        assert_eq!(obj.mesh.normals.len(), obj.mesh.positions.len());
    }

    #[test]
    fn texture_coordinates_are_read_where_they_are_needed() {
        let textured = |text: &str| {
            let text = format!("{CORNERS}vn 0 0 1\nvt 0.25 0.5\nvt 0.75\nvt 1 1 0\n{text}\n");
            read(Path::new("a.obj"), text.as_bytes(), Materials::Ignored { textured: true })
                .map_err(|e| e.to_string())
        };
        // Flat faces among smooth ones get corners of their own.
        let obj = textured("o a\nf 1/1 2/-2 3/3\no b\nf 1/3/1 3/2/1 4/1/1").unwrap();
        let uvs: Vec<_> =
            obj.mesh.triangles.iter().map(|t| t.map(|i| obj.mesh.uvs[i as usize])).collect();
        let [p, q, r] = [Vec2::new(0.25, 0.5), Vec2::new(0.75, 0.0), Vec2::ONE];
        assert_eq!(uvs, [[p, q, r], [r, q, p]]);
        assert_eq!(obj.mesh.uvs.len(), obj.mesh.positions.len());
        let cases = [
            (
                "f 1/1 2 3/3",
                "a.obj:9:1: the face has no texture coordinates, which its material needs; add them, or remove the texture",
            ),
            (
                "f 1/1 2/4 3/3",
                "a.obj:9:1: the face names texture coordinates 4, but there are 3 before it",
            ),
            ("vt inf 0", "a.obj:9:1: `vt` holds inf; give finite numbers"),
        ];
        for (line, expected) in cases {
            assert_eq!(textured(line).unwrap_err(), expected);
        }
    }

    #[test]
    fn half_a_set_of_normals_is_none() {
        let faces =
            "o smooth\nf 1//1 2//1 3//1\no mixed\nf 1//1 3 4//1\nf 1 2 3\no flat\nf 2 1 3\n";
        let text = format!("{CORNERS}vn 0 3 0\n{faces}");
        let obj = obj(text.as_bytes()).unwrap();
        assert_eq!(
            obj.warnings,
            [
                "a.obj:9:1: only some corners of the object `mixed` have normals; all of them are ignored"
            ]
        );
        assert_eq!(obj.mesh.normals.len(), obj.mesh.positions.len());
        let normals: Vec<_> =
            (0..4).map(|t| obj.mesh.triangles[t].map(|i| obj.mesh.normals[i as usize])).collect();
        assert_eq!(normals, [[3.0 * Vec3::Y; 3], [Vec3::Z; 3], [Vec3::Z; 3], [-Vec3::Z; 3]]);
    }

    #[test]
    fn faults_name_their_line() {
        let cases = [
            ("v 0 nan 0", "a.obj:5:1: `v` holds NaN; give finite numbers"),
            ("v 0 1e999 0", "a.obj:5:1: `v` holds inf; give finite numbers"),
            ("v 0 0 -3e8", "a.obj:5:1: -3e8 is too large; keep numbers within 1e8"),
            ("v 0 0", "a.obj:5:1: `v` needs 3 numbers"),
            ("v 0 zero 0", "a.obj:5:1: `zero` after `v` is no number"),
            ("vn 0 0 inf", "a.obj:5:1: `vn` holds inf; give finite numbers"),
            ("f 1 2 5", "a.obj:5:1: the face names vertex 5, but there are 4 before it"),
            ("f 1 2 0", "a.obj:5:1: the face names vertex 0, but there are 4 before it"),
            ("f 1 2 -5", "a.obj:5:1: the face names vertex -5, but there are 4 before it"),
            ("f 1//1 2//1 3//1", "a.obj:5:1: the face names normal 1, but there are 0 before it"),
            ("f 1 2", "a.obj:5:1: the face has 2 corners; faces have 3 to 4096"),
            ("f", "a.obj:5:1: the face has 0 corners; faces have 3 to 4096"),
            ("f 1 2 x", "a.obj:5:1: `x` is no corner of a face"),
            ("f 1 2 3/1/1/1", "a.obj:5:1: the face names normal 1, but there are 0 before it"),
            ("f 1 2 3///", "a.obj:5:1: `3///` is no corner of a face"),
            (
                "f 1 2 99999999999999999999",
                "a.obj:5:1: `99999999999999999999` is no corner of a face",
            ),
            (
                "f 1 2 -9223372036854775808",
                "a.obj:5:1: the face names vertex -9223372036854775808, but there are 4 before it",
            ),
            (
                "glTF\u{1}",
                "a.obj:5:1: `glTF\u{fffd}` is no statement of OBJ files; remove the line",
            ),
            ("", "a.obj: the file holds no faces; save it as a mesh"),
        ];
        for (line, expected) in cases {
            let text = format!("{CORNERS}{line}\n");
            assert_eq!(obj(text.as_bytes()).unwrap_err(), expected);
        }
        let text = format!("{CORNERS}curv 0 1 1 2\nsurf 1\nf 1 2 3");
        assert_eq!(
            obj(text.as_bytes()).unwrap().warnings,
            ["a.obj: free-form curves and surfaces are ignored; save the file as a mesh"]
        );
        let without = read(
            Path::new("a.obj"),
            format!("{CORNERS}f 1 2 3").as_bytes(),
            Materials::FromLibraries(&Reach::Everything),
        );
        assert_eq!(
            without.unwrap_err().to_string(),
            "a.obj:5:1: the face has no material; add `usemtl`, or give the mesh a material in the scene file"
        );
    }

    #[test]
    fn materials_come_from_libraries() {
        let folder = tempfile::tempdir().unwrap();
        let write =
            |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write("a b.mtl", "newmtl Red #1\nKd 1 0 0\nnewmtl unused\nillum 10\n");
        write("c.mtl", "newmtl green\nKd 0 1 0\n");
        write("d.mtl", "newmtl blue\nKd 0 0 1\n");
        let from = |text: &str| {
            let path = folder.path().join("a.obj");
            read(
                &path,
                format!("{CORNERS}{text}").as_bytes(),
                Materials::FromLibraries(&Reach::Everything),
            )
            .map_err(|e| e.to_string().replace(&format!("{}/", folder.path().display()), ""))
        };
        let obj = from(
            "mtllib a b.mtl\nmtllib c.mtl d.mtl\nusemtl green\nf 1 2 3\nusemtl\tRed #1\nf 1 2 4\nf 1 3 4\nusemtl green\nf 2 3 4\n",
        )
        .unwrap();
        assert!(obj.warnings.is_empty(), "{:?}", obj.warnings);
        let names: Vec<_> = obj.materials.iter().map(|m| m.name.as_str()).collect();
        assert_eq!(names, ["green", "Red #1"]);
        assert_eq!(obj.mesh.materials, [0, 1, 1, 0].map(MaterialId));
        let cases = [
            (
                "usemtl red\nf 1 2 3",
                "a.obj:5:1: `usemtl` names the unknown material `red`; the libraries hold none",
            ),
            (
                "mtllib c.mtl d.mtl\nusemtl red\nf 1 2 3",
                "a.obj:6:1: `usemtl` names the unknown material `red`; the libraries hold green and blue",
            ),
            (
                "mtllib e.mtl\nusemtl red\nf 1 2 3",
                "a.obj:5:1: cannot read e.mtl: there is no such file; or give the mesh a material in the scene file",
            ),
            (
                "mtllib a b.mtl\nusemtl unused\nf 1 2 3",
                "a b.mtl:3:1: material `unused` has illum 10, which is not supported; use 1 for diffuse, 3 for mirrors or 7 for glass",
            ),
        ];
        for (text, expected) in cases {
            assert_eq!(from(text).unwrap_err(), expected);
        }
    }
}
