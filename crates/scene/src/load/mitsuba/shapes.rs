//! Shapes.

use base::{Rgb, math};
use geometry::{MaterialId, Mesh, Sphere};
use glam::{DAffine3, DMat3, DQuat, DVec3, Quat, Vec2, Vec3};

use super::materials::material;
use super::plugin::Plugin;
use super::textures::texture;
use super::xml::Element;
use super::{Context, instances};
use crate::load::keys::list;
use crate::load::mesh_checks::has_area;
use crate::load::obj::{self, Materials};
use crate::load::source::{MAX_LENGTH, MAX_LIGHT};
use crate::load::{meshes, ply, serialized, shapes, transform};
use crate::{Error, TextureId};

/// Sides of the polygons that stand for circles: their area is 0.04 % too small.
const SIDES: u32 = 128;

/// Adds a shape.
pub(super) fn add<'d>(context: &mut Context<'d>, element: &'d Element) -> Result<(), Error> {
    let plugin = Plugin::new(context, element)?;
    match plugin.kind {
        // It counts where instances show it.
        "shapegroup" => return Ok(()),
        "instance" => return instances::add(context, element),
        _ => {}
    }
    let fault =
        |context: &Context<'_>, fault: String| Err(context.document.fault(element.place, fault));
    let number = context.assembly.meshes.len() + context.assembly.spheres.len() + 1;
    let name = context.name(element, number);
    let is_sphere = plugin.kind == "sphere";
    let emission = emission(context, &plugin, is_sphere)?;
    let bsdfs = plugin.nested(context, &["bsdf"])?;
    if bsdfs.len() > 1 {
        return fault(context, format!("{} has two bsdfs; keep one", plugin.title()));
    }
    let id = material(context, element, bsdfs.first().copied(), emission, is_sphere)?;
    let flips = plugin.boolean(context, "flip_normals")?;
    if is_sphere {
        if flips {
            let text = "a sphere turned inside out isn't supported; use a mesh";
            return fault(context, text.into());
        }
        let sphere = sphere(context, &plugin, id)?;
        plugin.finish(context)?;
        context.assembly.spheres.push((name, sphere));
        return Ok(());
    }
    let mut mesh = mesh(context, &plugin, id)?;
    if !context.assembly.is_textured(id) {
        mesh.uvs = Vec::new();
    }
    let map = plugin.transform(context)?;
    plugin.finish(context)?;
    if !transform::apply(&map, &mut mesh) {
        let text = format!(
            "to_world moves {} too far away; keep coordinates within {MAX_LENGTH:e}",
            plugin.title()
        );
        return fault(context, text);
    }
    if flips {
        transform::flip(&mut mesh);
        mesh.normals.iter_mut().for_each(|n| *n = -*n);
    }
    if !(0..mesh.triangles.len()).any(|t| has_area(mesh.corners(t))) {
        return fault(context, format!("{} has no area", plugin.title()));
    }
    let document = context.document;
    meshes::admit(&mut context.assembly, &mut mesh, &|text| {
        document.fault(element.place, text).to_string()
    });
    context.assembly.meshes.push((name, mesh));
    Ok(())
}

/// The radiance of the area emitter in a shape: a color, times a texture if there is one.
fn emission<'d>(
    context: &mut Context<'d>,
    shape: &Plugin<'d>,
    on_sphere: bool,
) -> Result<(Rgb, Option<TextureId>), Error> {
    let emitters = shape.nested(context, &["emitter", "luminaire"])?;
    let Some(element) = emitters.first() else { return Ok((Rgb::BLACK, None)) };
    let plugin = Plugin::new(context, element)?;
    if plugin.kind != "area" || emitters.len() > 1 {
        let fault =
            format!("a shape has one emitter at most, of type \"area\", not \"{}\"", plugin.kind);
        return Err(context.document.fault(element.place, fault));
    }
    let written = plugin.get(&["radiance"]).map(|e| context.resolve(e)).transpose()?;
    let Some(target) = written.filter(|target| target.tag == "texture") else {
        let radiance = plugin.color(context, "radiance")?.unwrap_or(Rgb::ONE);
        plugin.finish(context)?;
        return Ok((radiance, None));
    };
    let id = texture(context, target, on_sphere)?;
    plugin.finish(context)?;
    let largest = context.assembly.textures[usize::from(id.0)].1.max();
    if largest > MAX_LIGHT {
        let fault =
            format!("the radiance of the texture reaches {largest:e}; use at most {MAX_LIGHT:e}");
        return Err(context.document.fault(target.place, fault));
    }
    Ok(if largest > 0.0 { (Rgb::ONE, Some(id)) } else { (Rgb::BLACK, None) })
}

fn sphere<'d>(
    context: &Context<'d>,
    plugin: &Plugin<'d>,
    material: MaterialId,
) -> Result<Sphere, Error> {
    let fault = |fault: &str| Err(context.document.fault(plugin.element.place, fault));
    let center = plugin.vector(context, "center")?.unwrap_or(DVec3::ZERO);
    let radius = plugin.number(context, "radius")?.unwrap_or(1.0);
    let map = plugin.transform(context)?;
    let scale = map.matrix3.determinant().abs().cbrt();
    let square = map.matrix3.transpose() * map.matrix3 * (1.0 / (scale * scale));
    if (square - DMat3::IDENTITY).to_cols_array().iter().any(|x| x.abs() > 1e-4) {
        return fault("a sphere that is scaled unevenly isn't supported; use a mesh");
    }
    let rotation = map.matrix3 * (1.0 / scale);
    let is_textured = context.assembly.is_textured(material);
    if is_textured && rotation.determinant() < 0.0 {
        return fault("a mirrored sphere with a texture isn't supported; use a mesh");
    }
    let radius = radius * scale;
    let center = map.transform_point3(center);
    if !(radius > 0.0 && radius <= f64::from(MAX_LENGTH))
        || center.abs().max_element() > f64::from(MAX_LENGTH)
    {
        return fault("the sphere is too small, too large or too far away");
    }
    // Mitsuba's pole is +z.
    let pole = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let turned = (DQuat::from_mat3(&rotation) * pole).as_quat();
    let rotation = if is_textured { turned } else { Quat::IDENTITY };
    Ok(Sphere { center: center.as_vec3(), radius: radius as f32, rotation, material })
}

/// The mesh of a shape before its transform.
fn mesh<'d>(
    context: &mut Context<'d>,
    plugin: &Plugin<'d>,
    material: MaterialId,
) -> Result<Mesh, Error> {
    match plugin.kind {
        "rectangle" => {
            Ok(shapes::quad(Vec3::new(-1.0, -1.0, 0.0), [Vec3::X * 2.0, Vec3::Y * 2.0], material))
        }
        "cube" => {
            let mut mesh = shapes::cuboid(-Vec3::ONE, Vec3::ONE, material);
            if context.assembly.is_textured(material) {
                shapes::unfold(&mut mesh);
            }
            Ok(mesh)
        }
        "disk" => Ok(disk(material)),
        "cylinder" => cylinder(context, plugin, material),
        "obj" | "ply" | "serialized" => from_file(context, plugin, material),
        _ => {
            let known = [
                "rectangle",
                "cube",
                "disk",
                "cylinder",
                "sphere",
                "obj",
                "ply",
                "serialized",
                "shapegroup",
                "instance",
            ];
            let fault =
                format!("{} isn't supported; the shapes are {}", plugin.title(), list(&known));
            Err(context.document.fault(plugin.element.place, fault))
        }
    }
}

/// Points around the unit circle.
fn circle() -> impl Iterator<Item = (f32, f32)> {
    (0..SIDES).map(|i| {
        let (sin, cos) = math::sin_cos(2.0 * math::PI * i as f32 / SIDES as f32);
        (cos, sin)
    })
}

/// The unit disk, its texture coordinates in polar form: the radius, and the turn.
fn disk(material: MaterialId) -> Mesh {
    let mut mesh = Mesh::default();
    for (i, (x, y)) in circle().enumerate() {
        let turn = |i: usize| i as f32 / SIDES as f32;
        let (next_x, next_y) = circle().nth((i + 1) % SIDES as usize).unwrap_or((1.0, 0.0));
        let n = mesh.positions.len() as u32;
        mesh.positions.extend([Vec3::ZERO, Vec3::new(x, y, 0.0), Vec3::new(next_x, next_y, 0.0)]);
        mesh.uvs.extend([
            Vec2::new(0.0, turn(i)),
            Vec2::new(1.0, turn(i)),
            Vec2::new(1.0, turn(i + 1)),
        ]);
        mesh.triangles.push([n, n + 1, n + 2]);
        mesh.materials.push(material);
    }
    mesh
}

/// The side of a cylinder from `p0` to `p1`, its front outside.
fn cylinder<'d>(
    context: &Context<'d>,
    plugin: &Plugin<'d>,
    material: MaterialId,
) -> Result<Mesh, Error> {
    let p0 = plugin.vector(context, "p0")?.unwrap_or(DVec3::ZERO);
    let p1 = plugin.vector(context, "p1")?.unwrap_or(DVec3::Z);
    let radius = plugin.number(context, "radius")?.unwrap_or(1.0);
    let Some(axis) = (p1 - p0).try_normalize().filter(|_| radius > 0.0) else {
        let fault = format!(
            "{} needs two ends apart from each other, and a radius above 0",
            plugin.title()
        );
        return Err(context.document.fault(plugin.element.place, fault));
    };
    let across = axis.any_orthonormal_vector();
    let frame = DAffine3 {
        matrix3: DMat3::from_cols(across * radius, axis.cross(across) * radius, p1 - p0),
        translation: p0,
    };
    let mut mesh = Mesh::default();
    for (i, (x, y)) in circle().chain([(1.0, 0.0)]).enumerate() {
        let turn = i as f32 / SIDES as f32;
        mesh.positions.extend([Vec3::new(x, y, 0.0), Vec3::new(x, y, 1.0)]);
        mesh.normals.extend([Vec3::new(x, y, 0.0); 2]);
        mesh.uvs.extend([Vec2::new(turn, 0.0), Vec2::new(turn, 1.0)]);
    }
    for i in 0..SIDES {
        let [a, b, c, d] = [2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1];
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
        mesh.materials.extend([material; 2]);
    }
    transform::apply(&frame, &mut mesh);
    Ok(mesh)
}

fn from_file<'d>(
    context: &mut Context<'d>,
    plugin: &Plugin<'d>,
    material: MaterialId,
) -> Result<Mesh, Error> {
    let place = plugin.element.place;
    let Some(file) = plugin.string("filename") else {
        let fault = format!("{} needs a `filename`", plugin.title());
        return Err(context.document.fault(place, fault));
    };
    let source = context.document.source(place);
    let path = source.resolve(file);
    let bytes = source.reach().bytes(&path).map_err(|cause| {
        context.document.fault(place, format!("cannot read {}: {cause}", path.display()))
    })?;
    let textured = context.assembly.is_textured(material);
    let is_obj = plugin.kind == "obj";
    let (mut mesh, warnings) = match plugin.kind {
        "obj" => {
            let obj = obj::read(&path, &bytes, Materials::Ignored { textured })?;
            (obj.mesh, obj.warnings)
        }
        "ply" => {
            let ply = ply::read(&path, &bytes, material, textured)?;
            (ply.mesh, ply.warnings)
        }
        _ => {
            let index = plugin.count(context, "shape_index")?.unwrap_or(0);
            (serialized::read(&path, &bytes, index, material, textured)?, Vec::new())
        }
    };
    context.assembly.warnings.extend(warnings);
    mesh.materials.fill(material);
    if plugin.boolean(context, "face_normals")? {
        mesh.normals = Vec::new();
    }
    // OBJ files count v from below, Mitsuba from above.
    let flips = match plugin.get(&["flip_tex_coords"]) {
        Some(_) => plugin.boolean(context, "flip_tex_coords")?,
        None => is_obj,
    };
    if flips {
        mesh.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
    }
    Ok(mesh)
}
