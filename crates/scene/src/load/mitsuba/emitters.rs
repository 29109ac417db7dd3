//! Emitters that aren't surfaces.

use base::Rgb;
use glam::{DVec3, Vec3A};

use super::Context;
use super::plugin::Plugin;
use super::xml::Element;
use crate::load::keys::list;
use crate::{Error, Light, LightKind, Spot};

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
        _ => {
            let known = ["point", "spot", "directional", "constant"];
            let fault = format!(
                "{} isn't supported; the emitters are {}, and area in a shape",
                plugin.title(),
                list(&known)
            );
            return Err(context.document.fault(element.place, fault));
        }
    };
    plugin.finish(context)?;
    let color = match &kind {
        LightKind::Point { intensity, .. } => *intensity,
        LightKind::Spot(spot) => spot.intensity,
        LightKind::Directional { irradiance, .. } => *irradiance,
        LightKind::Environment { radiance } => *radiance,
        LightKind::Area(light) => light.radiance(),
    };
    if color.is_black() {
        let text = format!("{} is black and left out", plugin.title());
        let warning = context.document.fault(element.place, text).to_string();
        context.assembly.warnings.push(warning);
        return Ok(());
    }
    let name = context.name(element, context.assembly.lights.len() + 1);
    context.assembly.lights.push(Light { name, kind });
    Ok(())
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
