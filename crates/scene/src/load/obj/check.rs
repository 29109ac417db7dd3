//! The lines of an OBJ file, checked and written anew for tobj.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use super::Materials;
use crate::load::lines::{Statement, TextFile, decode, statements};
use crate::load::mtl::{Found, Library};
use crate::load::polygon::MAX_CORNERS;
use crate::load::reach::Reach;
use crate::load::source::MAX_LENGTH;
use crate::{Error, Material, Texture, TextureId};

/// Statements without a meaning for us: points, lines, groups, levels of detail.
const IGNORED: [&str; 12] = [
    "p",
    "l",
    "s",
    "mg",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "usemap",
    "maplib",
    "shadow_obj",
    "trace_obj",
];

/// Curves and surfaces, and what belongs to them.
const FREE_FORM: [&str; 18] = [
    "vp", "cstype", "deg", "bmat", "step", "curv", "curv2", "surf", "parm", "trim", "hole", "scrv",
    "sp", "end", "con", "ctech", "stech", "call",
];

/// What is left of an OBJ file.
#[derive(Debug, Default)]
pub(super) struct Checked {
    /// Positions, normals, objects, faces, and materials by number.
    pub(super) text: String,
    /// The materials that faces use.
    pub(super) materials: Vec<Material>,
    /// What colors them.
    pub(super) textures: Vec<Texture>,
    pub(super) warnings: Vec<String>,
}

/// An object or group, and its faces so far.
#[derive(Default)]
struct Object {
    name: String,
    faces: Vec<Face>,
}

struct Face {
    line: usize,
    material: usize,
    /// Position, texture coordinates and normal, counted from 1; 0 is none.
    corners: Vec<[usize; 3]>,
}

/// What has been read so far.
struct Checker<'a> {
    file: &'a TextFile,
    materials: Materials<'a>,
    checked: Checked,
    libraries: Vec<Library>,
    /// Numbers in `checked.materials` by library and place in it.
    numbers: BTreeMap<(usize, usize), usize>,
    material: Option<usize>,
    object: Object,
    n_positions: usize,
    n_uvs: usize,
    n_normals: usize,
    n_faces: usize,
}

impl Checked {
    pub(super) fn new(
        file: &TextFile,
        bytes: &[u8],
        materials: Materials<'_>,
    ) -> Result<Self, Error> {
        let mut checker = Checker {
            file,
            materials,
            checked: Self { text: "mtllib all\n".into(), ..Self::default() },
            libraries: Vec::new(),
            numbers: BTreeMap::new(),
            material: None,
            object: Object::default(),
            n_positions: 0,
            n_uvs: 0,
            n_normals: 0,
            n_faces: 0,
        };
        for statement in statements(&decode(bytes)) {
            checker.take(&statement)?;
        }
        checker.end_object();
        if checker.n_faces == 0 {
            return Err(file.whole("the file holds no faces; save it as a mesh"));
        }
        Ok(checker.checked)
    }
}

impl Checker<'_> {
    fn take(&mut self, statement: &Statement<'_>) -> Result<(), Error> {
        let line = statement.line;
        match statement.keyword() {
            "" => {}
            "v" => {
                let [x, y, z] = self.file.numbers(statement, MAX_LENGTH)?;
                let _ = writeln!(self.checked.text, "v {} {} {}", x as f32, y as f32, z as f32);
                self.n_positions += 1;
            }
            "vn" => {
                let [x, y, z] = self.file.numbers(statement, f32::MAX)?;
                let _ = writeln!(self.checked.text, "vn {} {} {}", x as f32, y as f32, z as f32);
                self.n_normals += 1;
            }
            "vt" => {
                // Those along a line lack the second.
                let n_words = statement.words().count();
                let [u] = self.file.numbers(statement, MAX_LENGTH)?;
                let v = if n_words > 1 {
                    self.file.numbers::<2>(statement, MAX_LENGTH)?[1]
                } else {
                    0.0
                };
                let _ = writeln!(self.checked.text, "vt {} {}", u as f32, v as f32);
                self.n_uvs += 1;
            }
            "f" | "fo" => self.take_face(statement)?,
            "o" | "g" => {
                self.end_object();
                self.object.name = statement.name().to_string();
            }
            keyword @ ("mtllib" | "usemtl") => {
                if let Materials::FromLibraries(reach) = self.materials {
                    if keyword == "mtllib" {
                        self.open_libraries(statement, reach)?;
                    } else {
                        self.material = Some(self.use_material(line, statement.name(), reach)?);
                    }
                }
            }
            keyword if IGNORED.contains(&keyword) => {}
            keyword if FREE_FORM.contains(&keyword) => {
                let warning = "free-form curves and surfaces are ignored; save the file as a mesh";
                let warning = self.file.whole(warning).to_string();
                if !self.checked.warnings.contains(&warning) {
                    self.checked.warnings.push(warning);
                }
            }
            keyword => {
                let keyword: String = keyword.chars().take(20).collect();
                let fault = format!("`{keyword}` is no statement of OBJ files; remove the line");
                return Err(self.file.fault(line, fault));
            }
        }
        Ok(())
    }

    /// Whether a material needs texture coordinates.
    fn is_textured(&self, material: usize) -> bool {
        match self.materials {
            Materials::FromLibraries(_) => self.checked.materials[material].is_textured(),
            Materials::Ignored { textured } => textured,
        }
    }

    fn take_face(&mut self, statement: &Statement<'_>) -> Result<(), Error> {
        let line = statement.line;
        let material = match self.material {
            Some(material) => material,
            None if matches!(self.materials, Materials::FromLibraries(_)) => {
                let fault = "the face has no material; add `usemtl`, or give the mesh a material in the scene file";
                return Err(self.file.fault(line, fault));
            }
            None => 0,
        };
        let textured = self.is_textured(material);
        let mut corners = Vec::new();
        for word in statement.words() {
            let mut parts = word.split('/');
            let position = self.index(line, word, parts.next(), self.n_positions, "vertex")?;
            let uv = match parts.next() {
                _ if !textured => 0,
                None | Some("") => {
                    let fault = "the face has no texture coordinates, which its material needs; add them, or remove the texture";
                    return Err(self.file.fault(line, fault));
                }
                uv => self.index(line, word, uv, self.n_uvs, "texture coordinates")?,
            };
            let normal = match parts.next() {
                None | Some("") => 0,
                normal => self.index(line, word, normal, self.n_normals, "normal")?,
            };
            if parts.next().is_some() {
                return Err(self.file.fault(line, format!("`{word}` is no corner of a face")));
            }
            corners.push([position, uv, normal]);
        }
        if !(3..=MAX_CORNERS).contains(&corners.len()) {
            let fault =
                format!("the face has {} corners; faces have 3 to {MAX_CORNERS}", corners.len());
            return Err(self.file.fault(line, fault));
        }
        self.n_faces += 1;
        self.object.faces.push(Face { line, material, corners });
        Ok(())
    }

    /// An index, counted from 1; negative ones count from the end.
    fn index(
        &self,
        line: usize,
        word: &str,
        part: Option<&str>,
        n: usize,
        what: &str,
    ) -> Result<usize, Error> {
        let index: i64 = part
            .and_then(|p| p.parse().ok())
            .ok_or_else(|| self.file.fault(line, format!("`{word}` is no corner of a face")))?;
        let from_one =
            if index < 0 { (n as i64).saturating_add(index).saturating_add(1) } else { index };
        if from_one >= 1 && from_one <= n as i64 {
            Ok(from_one as usize)
        } else {
            let fault = format!("the face names {what} {index}, but there are {n} before it");
            Err(self.file.fault(line, fault))
        }
    }

    /// `mtllib` with one name, which may hold blanks, or several.
    fn open_libraries(&mut self, statement: &Statement<'_>, reach: &Reach) -> Result<(), Error> {
        let folder = self.file.path.parent().unwrap_or(Path::new("")).to_path_buf();
        // Some programs write the separators of another system.
        let resolve = |name: &str| -> PathBuf {
            let path = folder.join(name);
            if path.exists() { path } else { folder.join(name.replace('\\', "/")) }
        };
        let whole = resolve(statement.name());
        let paths: Vec<PathBuf> = if whole.is_file() || statement.words().nth(1).is_none() {
            vec![whole]
        } else {
            statement.words().map(resolve).collect()
        };
        for path in paths {
            let bytes = reach.bytes(&path).map_err(|cause| {
                let fault = format!(
                    "cannot read {}: {cause}; or give the mesh a material in the scene file",
                    path.display()
                );
                self.file.fault(statement.line, fault)
            })?;
            self.libraries.push(Library::read(&path, &bytes)?);
        }
        Ok(())
    }

    /// The number of a material, which comes from the last library that has it.
    fn use_material(&mut self, line: usize, name: &str, reach: &Reach) -> Result<usize, Error> {
        let mut found = self.libraries.iter().enumerate().rev();
        let origin = found.find_map(|(i, library)| library.find(name).map(|m| (i, m)));
        let Some(origin) = origin else {
            let known: Vec<_> = self.libraries.iter().flat_map(Library::names).collect();
            let fault = format!(
                "`usemtl` names the unknown material `{name}`; the libraries hold {}",
                crate::load::keys::list(&known)
            );
            return Err(self.file.fault(line, fault));
        };
        if let Some(&number) = self.numbers.get(&origin) {
            return Ok(number);
        }
        let Found { mut material, texture, mask, warnings } =
            self.libraries[origin.0].material(origin.1, reach)?;
        for warning in warnings {
            if !self.checked.warnings.contains(&warning) {
                self.checked.warnings.push(warning);
            }
        }
        let number = self.checked.materials.len();
        if number > usize::from(u16::MAX) {
            return Err(self.file.fault(line, "too many materials; use at most 65536"));
        }
        for (texture, place) in
            [(texture, &mut material.albedo_texture), (mask, &mut material.opacity_texture)]
        {
            let Some(texture) = texture else { continue };
            *place = self.add_texture(texture);
            if place.is_none() {
                return Err(self.file.fault(line, "too many textures; use at most 65536"));
            }
        }
        self.checked.materials.push(material);
        self.numbers.insert(origin, number);
        Ok(number)
    }

    /// Materials often share an image: the same texture is kept once. `None` when there are too many.
    fn add_texture(&mut self, texture: Texture) -> Option<TextureId> {
        let textures = &mut self.checked.textures;
        let known = textures.iter().position(|t| *t == texture);
        let index = known.unwrap_or_else(|| {
            textures.push(texture);
            textures.len() - 1
        });
        u16::try_from(index).ok().map(TextureId)
    }

    /// Writes the faces of an object. Its normals count only if every corner has one.
    fn end_object(&mut self) {
        let object = std::mem::take(&mut self.object);
        let Some(first) = object.faces.first() else { return };
        let corners = || object.faces.iter().flat_map(|f| &f.corners);
        let with_normals = corners().all(|c| c[2] != 0);
        if !with_normals && corners().any(|c| c[2] != 0) {
            let name = if object.name.is_empty() { "without a name" } else { &object.name };
            let warning = format!(
                "only some corners of the object `{name}` have normals; all of them are ignored"
            );
            self.checked.warnings.push(self.file.warning(first.line, warning));
        }
        // Formatting into a string can't fail.
        let text = &mut self.checked.text;
        let _ = writeln!(text, "o object");
        let mut material = None;
        for face in &object.faces {
            if material != Some(face.material) {
                material = Some(face.material);
                let _ = writeln!(text, "usemtl {}", face.material);
            }
            text.push('f');
            for &[position, uv, normal] in &face.corners {
                let _ = match (uv, with_normals) {
                    (0, false) => write!(text, " {position}"),
                    (0, true) => write!(text, " {position}//{normal}"),
                    (_, false) => write!(text, " {position}/{uv}"),
                    (_, true) => write!(text, " {position}/{uv}/{normal}"),
                };
            }
            text.push('\n');
        }
    }
}
