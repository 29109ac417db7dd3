//! Textures.

use base::Rgb;
use glam::{Affine2, Mat2, Vec2};

use super::Context;
use super::plugin::{Plugin, transform};
use super::xml::Element;
use crate::load::image;
use crate::load::keys::list;
use crate::load::textures::{FILTERS, WRAPS};
use crate::{Error, Pattern, Texture, TextureId};

/// The texture of an element. Mitsuba counts v of spheres from the other pole.
pub(super) fn texture<'d>(
    context: &mut Context<'d>,
    element: &'d Element,
    on_sphere: bool,
) -> Result<TextureId, Error> {
    let key = (element.place, on_sphere);
    if let Some(&id) = context.textures.get(&key) {
        return Ok(id);
    }
    let plugin = Plugin::new(context, element)?;
    let placement = placement(context, &plugin)?;
    // Mitsuba's images have (0, 0) at the upper left.
    let flip = Affine2::from_mat2_translation(Mat2::from_diagonal(Vec2::new(1.0, -1.0)), Vec2::Y);
    let (pattern, placement) = match plugin.kind {
        "bitmap" => (bitmap(context, &plugin)?, flip * placement),
        "checkerboard" => {
            let color = |name: &str, default: f32| {
                plugin.color(context, name).map(|c| c.unwrap_or(Rgb::splat(default)))
            };
            (Pattern::Checkerboard([color("color0", 0.4)?, color("color1", 0.2)?]), placement)
        }
        _ => {
            let fault = format!(
                "{} isn't supported; the textures are {}",
                plugin.title(),
                list(&["bitmap", "checkerboard"])
            );
            return Err(context.document.fault(element.place, fault));
        }
    };
    plugin.finish(context)?;
    let placement = if on_sphere { placement * flip } else { placement };
    let name = context.name(element, context.assembly.textures.len() + 1);
    let id = context.assembly.add_texture(name, Texture { placement, pattern });
    let id = id.ok_or_else(|| {
        context.document.fault(element.place, "too many textures; use at most 65536")
    })?;
    context.textures.insert(key, id);
    Ok(id)
}

fn bitmap(context: &Context<'_>, plugin: &Plugin<'_>) -> Result<Pattern, Error> {
    let element = plugin.element;
    let fault = |fault: String| context.document.fault(element.place, fault);
    let Some(file) = plugin.string("filename") else {
        return Err(fault(format!("{} needs a `filename`", plugin.title())));
    };
    let source = context.document.source(element.place);
    let path = source.resolve(file);
    let filter = choice(plugin, "filter_type", &FILTERS).map_err(fault)?;
    let wrap = choice(plugin, "wrap_mode", &WRAPS).map_err(fault)?;
    let raw = plugin.boolean(context, "raw")?;
    let (size, texels) = image::read(source.reach(), &path, raw).map_err(fault)?;
    Ok(Pattern::Bitmap { size, texels, filter, wrap })
}

fn choice<T: Copy>(plugin: &Plugin<'_>, name: &str, choices: &[(&str, T)]) -> Result<T, String> {
    let Some(written) = plugin.string(name) else { return Ok(choices[0].1) };
    let found = choices.iter().find(|(word, _)| *word == written);
    found.map(|(_, choice)| *choice).ok_or_else(|| {
        let known: Vec<_> = choices.iter().map(|(word, _)| *word).collect();
        format!("`{name}` is \"{written}\"; it may be one of {}", list(&known))
    })
}

/// `to_uv` of version 3; scales and offsets of 0.6.
fn placement(context: &Context<'_>, plugin: &Plugin<'_>) -> Result<Affine2, Error> {
    if let Some(element) = plugin.get(&["to_uv"]) {
        let map = transform(context, element)?;
        let [x, y] = [map.matrix3.x_axis, map.matrix3.y_axis].map(|a| a.truncate().as_vec2());
        // A matrix of 3 x 3 is one of the plane: its last column moves.
        let is_plane = element.children.iter().any(|step| {
            step.tag == "matrix"
                && step.attribute("value").is_some_and(|v| v.split_whitespace().count() == 9)
        });
        let offset = if is_plane { map.matrix3.z_axis } else { map.translation };
        return Ok(Affine2::from_mat2_translation(
            Mat2::from_cols(x, y),
            offset.truncate().as_vec2(),
        ));
    }
    let of = |name: &str, default: f64| plugin.number(context, name).map(|n| n.unwrap_or(default));
    let both = of("uvscale", 1.0)?;
    let scale = Vec2::new(of("uscale", both)? as f32, of("vscale", both)? as f32);
    let offset = Vec2::new(of("uoffset", 0.0)? as f32, of("voffset", 0.0)? as f32);
    Ok(Affine2::from_scale_angle_translation(scale, 0.0, offset))
}
