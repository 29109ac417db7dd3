//! Emitters that aren't surfaces.

use base::Rgb;
use glam::{DVec3, Vec3A};

use super::Context;
use super::plugin::Plugin;
use super::xml::Element;
use crate::load::image;
use crate::load::keys::list;
use crate::load::source::MAX_LIGHT;
use crate::load::transform::orthogonal;
use crate::{EnvironmentMap, Error, Light, LightKind, Spot};

/// Adds the light of an element.
pub(super) fn add<'d>(context: &mut Context<'d>, element: &'d Element) -> Result<(), Error> {
    let plugin = Plugin::new(context, element)?;
    let color = |context: &Context<'d>, name: &str| {
        plugin.color(context, name).map(|c| c.unwrap_or(Rgb::ONE))
    };
    let kind = match plugin.kind {
        "point" => {
            let intensity = color(context, "intensity")?;
            let position = match plugin.vector(context, "position")? {
                Some(position) => position,
                None => plugin.transform(context)?.translation,
            };
            LightKind::Point { position: position.as_vec3a(), intensity }
        }
        "spot" => LightKind::Spot(spot(context, &plugin)?),
        "directional" => {
            let irradiance = color(context, "irradiance")?;
            let direction = match plugin.vector(context, "direction")? {
                Some(direction) => direction,
                None => plugin.transform(context)?.transform_vector3(DVec3::Z),
            };
            let Some(direction) = direction.try_normalize() else {
                let fault = format!("the direction of {} has no length", plugin.title());
                return Err(context.document.fault(element.place, fault));
            };
            LightKind::Directional { direction: direction.as_vec3a().normalize(), irradiance }
        }
        "constant" => LightKind::Environment { radiance: color(context, "radiance")? },
        "envmap" => LightKind::EnvironmentMap(map(context, &plugin)?),
        _ => {
            let known = ["point", "spot", "directional", "constant", "envmap"];
            let fault = format!(
                "{} isn't supported; the emitters are {}, and area in a shape",
                plugin.title(),
                list(&known)
            );
            return Err(context.document.fault(element.place, fault));
        }
    };
    plugin.finish(context)?;
    if kind.is_black() {
        let text = format!("{} is black and left out", plugin.title());
        let warning = context.document.fault(element.place, text).to_string();
        context.assembly.warnings.push(warning);
        return Ok(());
    }
    let name = context.name(element, context.assembly.lights.len() + 1);
    context.assembly.lights.push(Light { name, kind });
    Ok(())
}

fn map(context: &Context<'_>, plugin: &Plugin<'_>) -> Result<EnvironmentMap, Error> {
    let fault = |place, fault: String| context.document.fault(place, fault);
    let Some(file) = plugin.get(&["filename"]) else {
        let text = format!("{} needs a `filename`", plugin.title());
        return Err(fault(plugin.element.place, text));
    };
    let scale = plugin.number(context, "scale")?.unwrap_or(1.0);
    if !(0.0..=f64::from(MAX_LIGHT)).contains(&scale) {
        let text = format!(
            "`scale` of {} is {scale}; it lies between 0 and {MAX_LIGHT:e}",
            plugin.title()
        );
        return Err(fault(plugin.element.place, text));
    }
    // A way of sampling.
    plugin.boolean(context, "mis_compensation")?;
    let Some(to_world) = orthogonal(&plugin.transform(context)?.matrix3) else {
        let text = format!("to_world of {} distorts it; only turn it or mirror it", plugin.title());
        return Err(fault(plugin.element.place, text));
    };
    let source = context.document.source(file.place);
    let path = source.resolve(file.attribute("value").unwrap_or(""));
    let (size, texels) = image::read_linear(source.reach(), &path, Rgb::splat(scale as f32))
        .map_err(|text| fault(file.place, text))?;
    Ok(EnvironmentMap::from_pole_to_pole(size, texels, to_world.as_mat3().into()))
}

fn spot<'d>(context: &mut Context<'d>, plugin: &Plugin<'d>) -> Result<Spot, Error> {
    let place = plugin.element.place;
    let intensity = plugin.color(context, "intensity")?.unwrap_or(Rgb::ONE);
    let map = plugin.transform(context)?;
    let cutoff = plugin.number(context, "cutoff_angle")?.unwrap_or(20.0);
    let beam = plugin.number(context, "beam_width")?.unwrap_or(cutoff * 0.75);
    if !(cutoff > 0.01 && cutoff <= 180.0 && (0.0..=cutoff).contains(&beam)) {
        let fault = format!(
            "cutoff_angle of {} is {cutoff} and beam_width {beam}; give 0 < beam_width <= cutoff_angle <= 180",
            plugin.title()
        );
        return Err(context.document.fault(place, fault));
    }
    if beam < cutoff {
        let what = "a spot whose light falls off linearly with the angle isn't supported (give beam_width the value of cutoff_angle)";
        context.refuse(place, what, "it falls off smoothly between the same angles")?;
    }
    let cos = |degrees: f64| libm::cos(degrees.to_radians()) as f32;
    let direction = map.transform_vector3(DVec3::Z).normalize().as_vec3a();
    Ok(Spot {
        position: Vec3A::from(map.translation.as_vec3()),
        direction: direction.normalize(),
        intensity,
        cos_outer: cos(cutoff),
        cos_inner: cos(beam),
    })
}
