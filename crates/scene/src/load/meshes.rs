//! Meshes of the scene file, and what all meshes go through.

use geometry::{MaterialId, Mesh};
use toml::Spanned;

use super::assembly::Assembly;
use super::mesh_checks::{check_hull, drop_useless, repair_normals};
use super::obj::{self, Materials};
use super::ply;
use super::tables::MeshTable;
use crate::{Error, Specular, TextureId};

/// Adds the mesh number `index` of the scene file.
pub(super) fn add(
    assembly: &mut Assembly<'_>,
    index: usize,
    table: &Spanned<MeshTable>,
) -> Result<(), Error> {
    let (span, table) = (table.span(), table.get_ref());
    let source = assembly.source;
    let name = assembly.name(&table.name, "mesh", index, span)?;
    let object = format!("mesh `{name}`");
    let material = table.material.as_ref().map(|m| assembly.material(m, &object)).transpose()?;
    let path = source.resolve(table.file.get_ref());
    let bytes = || {
        source.reach().bytes(&path).map_err(|cause| {
            let fault = format!(
                "cannot read {}: {cause}; paths are relative to the scene file",
                path.display()
            );
            source.fault(table.file.span(), fault)
        })
    };
    let textured = material.is_some_and(|m| assembly.is_textured(m));
    let ending = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    let mut mesh = match ending.as_deref() {
        Some("obj") => {
            let wanted = match material {
                Some(_) => Materials::Ignored { textured },
                None => Materials::FromLibraries(source.reach()),
            };
            let obj = obj::read(&path, &bytes()?, wanted)?;
            assembly.warnings.extend(obj.warnings);
            let first = assembly.materials.len();
            let too_many = |what: &str| {
                let fault = format!("too many {what}; use at most 65536");
                source.fault(table.file.span(), fault)
            };
            let mut textures = Vec::new();
            for (i, texture) in obj.textures.into_iter().enumerate() {
                let id = assembly.add_texture(format!("{name}/map {}", i + 1), texture);
                textures.push(id.ok_or_else(|| too_many("textures"))?);
            }
            for mut own in obj.materials {
                let placed = |id: TextureId| textures[usize::from(id.0)];
                own.albedo_texture = own.albedo_texture.map(placed);
                own.opacity_texture = own.opacity_texture.map(placed);
                own.name = format!("{name}/{}", own.name);
                assembly.add_material(own).ok_or_else(|| too_many("materials"))?;
            }
            let mut mesh = obj.mesh;
            for id in &mut mesh.materials {
                *id = material.unwrap_or_else(|| MaterialId(first as u16 + id.0));
            }
            mesh
        }
        Some("ply") => {
            let Some(material) = material else {
                let fault = format!("{object} needs the key `material`: PLY files have none");
                return Err(source.fault(table.file.span(), fault));
            };
            let ply = ply::read(&path, &bytes()?, material, textured)?;
            assembly.warnings.extend(ply.warnings);
            ply.mesh
        }
        _ => {
            let fault = format!("the file of {object} must end in .obj or .ply");
            return Err(source.fault(table.file.span(), fault));
        }
    };
    if table.smooth == Some(false) {
        mesh.normals = Vec::new();
    }
    if let Some(map) = &table.transform {
        assembly.apply(map, &mut mesh, &object)?;
    }
    let about_file = |text: String| Error::whole(&path, text);
    admit(assembly, &mut mesh, &|text| about_file(text).to_string());
    if mesh.triangles.is_empty() {
        let fault = "no triangle has an area; check the scale and the coordinates";
        return Err(about_file(fault.into()));
    }
    assembly.meshes.push((name, mesh));
    Ok(())
}

/// Repairs what rays can't stand, and warns of what light can't; `place` tells where the mesh comes from.
pub(super) fn admit(
    assembly: &mut Assembly<'_>,
    mesh: &mut Mesh,
    place: &dyn Fn(String) -> String,
) {
    let is_glass: Vec<bool> =
        assembly.materials.iter().map(|m| matches!(m.specular, Specular::Glass { .. })).collect();
    let mut warn = |text: String| assembly.warnings.push(place(text));
    let hull = check_hull(mesh, &is_glass);
    if hull.open_edges > 0 {
        warn(format!("the glass has {} open edges, where light leaks; close it", hull.open_edges));
    }
    if hull.twisted_edges > 0 {
        warn(format!(
            "at {} edges of the glass, inside and outside change places; make the winding consistent",
            hull.twisted_edges
        ));
    }
    if hull.inside_out {
        warn("the glass is inside out and was turned around; reverse its faces".into());
    }
    let dropped = drop_useless(mesh);
    if dropped.without_area > 0 {
        warn(format!("{} triangles without area were dropped", dropped.without_area));
    }
    if dropped.duplicates > 0 {
        warn(format!(
            "{} triangles were dropped that have the corners of others",
            dropped.duplicates
        ));
    }
    let repaired = repair_normals(mesh);
    if repaired > 0 {
        warn(format!(
            "{repaired} normals without length were replaced by those of the faces around"
        ));
    }
}
